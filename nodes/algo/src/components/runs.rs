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

/// Finds the pairs of runs `above[a]` and `below[b]`, of a row and the next one, that touch; `reach` is 1 where corners
/// touch, else 0. `pairs` is scratch space, at its front lie the pairs (a, b) given back.
pub(super) fn touching<'a>(above: &[Run], below: &[Run], reach: u32, pairs: &'a mut Vec<[u32; 2]>) -> &'a [[u32; 2]] {
    if pairs.len() < above.len() + below.len() {
        pairs.resize(above.len() + below.len(), [0; 2]);
    }
    let (mut a, mut b, mut count) = (0, 0, 0);
    // No branch depends on the runs here: on noise it would be mispredicted all the time.
    while let (Some(upper), Some(lower)) = (above.get(a), below.get(b)) {
        pairs[count] = [a as u32, b as u32];
        count += usize::from((upper[0] < lower[1] + reach) & (lower[0] < upper[1] + reach));
        // The run that ends first cannot touch the next one on the other row.
        let upper_ends_first = upper[1] < lower[1];
        a += usize::from(upper_ends_first);
        b += usize::from(!upper_ends_first);
    }
    &pairs[..count]
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
        let mut pairs = Vec::new();
        assert_eq!(touching(&above, &below, 0, &mut pairs), [[2, 2]]);
        assert_eq!(touching(&above, &below, 1, &mut pairs), [[0, 0], [1, 0], [1, 1], [2, 2]]);
    }
}
