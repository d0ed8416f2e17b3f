//! The distance that a part of the pixels is within.

use rayon::prelude::*;

use crate::view::View;
use crate::{Interrupted, Watch};

/// Bits of a number that are looked at together: three looks see all 31 bits of a number that is not negative.
const DIGITS: [u32; 3] = [21, 10, 0];
/// Numbers that such a digit has.
const BINS: usize = 1 << 11;
/// Rows that are counted together.
const ROWS: usize = 64;

/// The least distance that a part of the pixels is within.
///
/// The least T among the distances such that at least `part` of all samples are <= T, and at least one sample is.
///
/// - `distances`: at least 0, finite, see [`distances`](super::distances()); any size.
/// - `part`: 0..=1 (asserted).
/// - `watch`: asked now and then whether to go on.
///
/// Without samples it is 0. Exact: three histograms, each of the samples that share the digits found before.
///
/// Cost: linear, three passes, rows side by side; the result does not depend on the count of threads.
pub fn quantile(distances: View<f32>, part: f64, watch: Watch) -> Result<f32, Interrupted> {
    assert!((0.0..=1.0).contains(&part), "part {part}");
    let rows: Vec<&[f32]> = distances.rows().collect();
    let count = distances.width() * distances.height();
    if count == 0 {
        return Ok(0.0);
    }
    let mut rank = ((part * count as f64).ceil() as usize).clamp(1, count) - 1;
    let (mut found, mut known) = (0u32, 0u32);
    for (at, shift) in DIGITS.into_iter().enumerate() {
        let width = if at == 0 { BINS } else { 1 << (DIGITS[at - 1] - shift) };
        let counts = counts(&rows, shift, width, |bits| bits & known == found, watch)?;
        let mut before = 0;
        let digit = counts.iter().position(|count| {
            before += count;
            before > rank
        });
        let digit = digit.expect("as many are counted as there are");
        rank -= before - counts[digit];
        found |= (digit as u32) << shift;
        known |= (width as u32 - 1) << shift;
    }
    Ok(f32::from_bits(found))
}

/// How many of the numbers that are `meant` have each digit at a place.
fn counts(
    rows: &[&[f32]],
    shift: u32,
    width: usize,
    meant: impl Fn(u32) -> bool + Sync,
    watch: Watch,
) -> Result<Vec<usize>, Interrupted> {
    let of_rows = |rows: &[&[f32]]| {
        let mut counts = vec![0; BINS];
        for bits in rows.iter().flat_map(|row| row.iter()).map(|number| number.to_bits()).filter(|bits| meant(*bits)) {
            counts[(bits >> shift) as usize & (width - 1)] += 1;
        }
        watch.go_on().map(|()| counts)
    };
    let merged = |mut all: Vec<usize>, more: Vec<usize>| {
        all.iter_mut().zip(more).for_each(|(all, more)| *all += more);
        Ok(all)
    };
    rows.par_chunks(ROWS).map(of_rows).try_reduce(|| vec![0; BINS], merged)
}
