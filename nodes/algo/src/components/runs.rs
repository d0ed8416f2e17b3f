//! Runs of set pixels along rows of bits.

use super::lanes::{Lanes, WORD};

/// First column of a run and the first one after it.
pub(super) type Run = [u32; 2];

/// Bits of a row: bit x of a word tells whether its sample x is above 0.5, none is set past the row.
#[inline(always)]
pub(super) fn row_bits<L: Lanes>(lanes: L, row: &[f32], bits: &mut [u64]) {
    let (words, rest) = row.as_chunks::<WORD>();
    for (bits, samples) in bits.iter_mut().zip(words) {
        *bits = lanes.above_half(samples);
    }
    if let Some(last) = bits.get_mut(words.len()) {
        let mut samples = [0.0; WORD];
        samples[..rest.len()].copy_from_slice(rest);
        *last = lanes.above_half(&samples);
    }
}

/// The words of a row, each with that of its pixels' left neighbours.
#[inline(always)]
pub(super) fn with_left(bits: &[u64]) -> impl Iterator<Item = (u64, u64)> {
    let mut before = 0;
    bits.iter().map(move |&word| {
        let left = word << 1 | before;
        before = word >> (WORD - 1);
        (word, left)
    })
}

/// Finds the runs of a row of `width` pixels; they fill the front of `ends`, which has room for `width` + 1: the runs.
#[inline(always)]
pub(super) fn find_runs<'a>(bits: &[u64], width: usize, ends: &'a mut [u32]) -> &'a [Run] {
    let mut count = 0;
    for (index, (word, left)) in with_left(bits).enumerate() {
        let mut changes = word ^ left;
        while changes != 0 {
            ends[count] = (index * WORD) as u32 + changes.trailing_zeros();
            count += 1;
            changes &= changes - 1;
        }
    }
    // A run that ends with the last word has no change after it.
    if count % 2 == 1 {
        ends[count] = width as u32;
        count += 1;
    }
    ends[..count].as_chunks().0
}

/// Finds the pairs (a, b) where run a of a row and run b of the next one touch, in the order of both; `corners` tells
/// whether those that share a corner do. They fill the front of `pairs`, which has room for one per pixel.
///
/// Where two runs touch, one of them starts beside or, with corners, at the end of the other, and a pixel is the start of
/// at most one pair.
#[inline(always)]
pub(super) fn touching<'a>(above: &[u64], below: &[u64], corners: bool, pairs: &'a mut [[u32; 2]]) -> &'a [[u32; 2]] {
    let (mut count, mut runs) = (0, [0; 2]);
    let reach = if corners { u64::MAX } else { 0 };
    for ((a, a_left), (b, b_left)) in with_left(above).zip(with_left(below)) {
        let starts = [a & !a_left, b & !b_left];
        let mut meets = starts[0] & (b | b_left & reach) | starts[1] & (a | a_left & reach);
        while meets != 0 {
            let up_to = meets ^ (meets - 1);
            pairs[count] = [0, 1].map(|i| runs[i] + (starts[i] & up_to).count_ones() - 1);
            count += 1;
            meets &= meets - 1;
        }
        runs = [0, 1].map(|i| runs[i] + starts[i].count_ones());
    }
    &pairs[..count]
}

#[cfg(test)]
mod tests {
    use super::super::lanes::Plain;
    use super::*;

    fn runs_of(row: &[f32]) -> Vec<Run> {
        let mut bits = vec![0; row.len().div_ceil(WORD)];
        row_bits(Plain, row, &mut bits);
        find_runs(&bits, row.len(), &mut vec![0; row.len() + 1]).to_vec()
    }

    #[test]
    fn runs_are_where_samples_exceed_one_half() {
        let row = [1.0, 0.5, 0.51, f32::INFINITY, f32::NAN, -1.0, 0.6];
        assert_eq!(runs_of(&row), [[0, 1], [2, 4], [6, 7]]);
        assert_eq!(runs_of(&[]), [[0; 2]; 0]);
    }

    #[test]
    fn runs_cross_words_and_end_with_the_row() {
        for width in [63, 64, 65, 127, 128, 200] {
            let end = width as u32;
            assert_eq!(runs_of(&vec![1.0; width]), [[0, end]]);
            let mut row = vec![0.0; width];
            row[width - 1] = 1.0;
            row[30..63].fill(1.0);
            let expected = if width <= 64 { vec![[30, end]] } else { vec![[30, 63], [end - 1, end]] };
            assert_eq!(runs_of(&row), expected);
        }
    }

    /// A row's bits.
    fn bits(runs: &[Run], width: usize) -> Vec<u64> {
        let mut bits = vec![0; width.div_ceil(WORD)];
        runs.iter()
            .flat_map(|&[start, end]| start..end)
            .for_each(|x| bits[x as usize / WORD] |= 1 << (x % WORD as u32));
        bits
    }

    #[test]
    fn corners_touch_only_if_asked() {
        let (above, below) = ([[0, 2], [4, 5], [7, 9]], [[2, 4], [5, 6], [8, 9]]);
        let (above, below, mut pairs) = (bits(&above, 9), bits(&below, 9), [[0; 2]; WORD]);
        assert_eq!(touching(&above, &below, false, &mut pairs), [[2, 2]]);
        assert_eq!(touching(&above, &below, true, &mut pairs), [[0, 0], [1, 0], [1, 1], [2, 2]]);
    }

    #[test]
    fn pairs_are_those_whose_ends_overlap() {
        // Rows of runs and gaps, 1 to 9 long.
        let row = |seed: u32| {
            let (mut runs, mut x, mut state) = (Vec::new(), 0, seed);
            while x < 300 {
                let mut next = || {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (state >> 24) * 9 / 256 + 1
                };
                let start = x + next();
                x = start + next();
                runs.push([start, x]);
            }
            runs
        };
        for seed in 0..50 {
            let (above, below, mut pairs) = (row(seed), row(seed + 1000), vec![[0; 2]; 320]);
            for reach in [0, 1] {
                let touch = |[a, b]: &[u32; 2]| {
                    let (a, b): (Run, Run) = (above[*a as usize], below[*b as usize]);
                    a[0] < b[1] + reach && b[0] < a[1] + reach
                };
                let all = (0..below.len() as u32).flat_map(|b| (0..above.len() as u32).map(move |a| [a, b]));
                let expected: Vec<[u32; 2]> = all.filter(touch).collect();
                assert_eq!(
                    touching(&bits(&above, 320), &bits(&below, 320), reach == 1, &mut pairs),
                    expected,
                    "{seed}"
                );
            }
        }
    }
}
