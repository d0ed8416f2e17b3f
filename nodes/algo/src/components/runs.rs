//! Runs of pixels along rows.

/// First column of a run and the first one after it.
pub(super) type Run = [u32; 2];

/// Appends the ends of the runs of samples above 0.5, two per run.
pub(super) fn append_runs(row: &[f32], ends: &mut Vec<u32>) {
    let mut before = 0;
    for (word, samples) in row.chunks(64).enumerate() {
        let bits = above_half(samples);
        let mut changes = bits ^ (bits << 1 | before);
        before = bits >> 63;
        while changes != 0 {
            ends.push(word as u32 * 64 + changes.trailing_zeros());
            changes &= changes - 1;
        }
    }
    if before == 1 {
        ends.push(row.len() as u32);
    }
}

/// Bit x tells whether sample x, of at most 64, is above 0.5.
fn above_half(samples: &[f32]) -> u64 {
    let mut flags = [0u8; 64];
    match <&[f32; 64]>::try_from(samples) {
        // The known length lets the comparisons run several at once.
        Ok(samples) => flags.iter_mut().zip(samples).for_each(|(flag, &sample)| *flag = u8::from(sample > 0.5)),
        Err(_) => flags.iter_mut().zip(samples).for_each(|(flag, &sample)| *flag = u8::from(sample > 0.5)),
    }
    let eights = flags.as_chunks::<8>().0.iter().enumerate();
    eights.fold(0, |bits, (index, &eight)| bits | gather(eight) << (8 * index))
}

/// Bit x of the result is byte x, each 0 or 1: the product moves it to bit 56 + x.
fn gather(flags: [u8; 8]) -> u64 {
    u64::from_le_bytes(flags).wrapping_mul(0x0102_0408_1020_4080) >> 56
}

/// Calls `touch(a, b)` for each run `above[a]` that touches run `below[b]` of the next row, in raster order of `below`;
/// `reach` is 1 where corners touch, else 0.
pub(super) fn for_touching(above: &[Run], below: &[Run], reach: u32, mut touch: impl FnMut(usize, usize)) {
    let mut first = 0;
    for (b, &[start, end]) in below.iter().enumerate() {
        while first < above.len() && above[first][1] + reach <= start {
            first += 1;
        }
        let mut a = first;
        while a < above.len() && above[a][0] < end + reach {
            touch(a, b);
            a += 1;
        }
        // The last that touches may touch the next run too.
        first = first.max(a.saturating_sub(1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs_of(row: &[f32]) -> Vec<u32> {
        let mut ends = Vec::new();
        append_runs(row, &mut ends);
        ends
    }

    #[test]
    fn runs_are_where_samples_exceed_one_half() {
        assert_eq!(runs_of(&[1.0, 0.5, 0.51, f32::INFINITY, f32::NAN, -1.0, 0.6]), [0, 1, 2, 4, 6, 7]);
        assert_eq!(runs_of(&[]), []);
    }

    #[test]
    fn runs_cross_words_and_end_with_the_row() {
        for width in [63, 64, 65, 127, 128, 200] {
            assert_eq!(runs_of(&vec![1.0; width]), [0, width as u32]);
            let mut row = vec![0.0; width];
            row[width - 1] = 1.0;
            row[30..63].fill(1.0);
            let expected = if width == 63 || width == 64 {
                vec![30, width as u32]
            } else {
                vec![30, 63, width as u32 - 1, width as u32]
            };
            assert_eq!(runs_of(&row), expected);
        }
    }

    #[test]
    fn corners_touch_only_within_reach() {
        let (above, below) = ([[0, 2], [4, 5], [7, 9]], [[2, 4], [5, 6], [8, 9]]);
        let touching = |reach| {
            let mut pairs = Vec::new();
            for_touching(&above, &below, reach, |a, b| pairs.push((a, b)));
            pairs
        };
        assert_eq!(touching(0), [(2, 2)]);
        assert_eq!(touching(1), [(0, 0), (1, 0), (1, 1), (2, 2)]);
    }
}
