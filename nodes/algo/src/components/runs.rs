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
