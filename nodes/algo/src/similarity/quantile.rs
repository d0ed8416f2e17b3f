//! The distance that a part of the pixels is within.

use rayon::prelude::*;

use crate::view::View;
use crate::{Interrupted, Watch};

/// The 31 bits of a number that is not negative are looked at as two digits, the lower of this many bits.
const LOWER: u32 = 15;
/// Numbers that a digit has at most. Of the upper one's few occur among distances.
const BINS: usize = 1 << 16;
/// Rows that are counted together.
const ROWS: usize = 64;

/// The least distance that a part of the pixels is within.
///
/// The least T among the distances such that at least `part` of all samples are <= T, and at least one sample is.
///
/// - `distances`: at least 0, finite, see [`distances`](super::distances()); fewer than 2^32 (asserted).
/// - `part`: 0..=1 (asserted).
/// - `watch`: asked now and then whether to go on.
///
/// Without samples it is 0. Exact: a histogram of the upper halves of their bits, then one of the lower
/// halves of those that share the upper one found.
///
/// Cost: linear, two passes, rows side by side; the result does not depend on the count of threads.
pub fn quantile(distances: View<f32>, part: f64, watch: Watch) -> Result<f32, Interrupted> {
    assert!((0.0..=1.0).contains(&part), "part {part}");
    let rows: Vec<&[f32]> = distances.rows().collect();
    let count = distances.width() * distances.height();
    assert!(u32::try_from(count).is_ok(), "{count} samples");
    if count == 0 {
        return Ok(0.0);
    }
    let rank = ((part * count as f64).ceil() as usize).clamp(1, count) - 1;
    let (upper, rank) = ranked(&counts(&rows, |bits| Some(bits >> LOWER), watch)?, rank);
    let lower = |bits: u32| (bits >> LOWER == upper).then_some(bits & ((1 << LOWER) - 1));
    let (lower, _) = ranked(&counts(&rows, lower, watch)?, rank);
    Ok(f32::from_bits(upper << LOWER | lower))
}

/// The digit of the number that so many numbers precede, and how many with the same digit do.
fn ranked(counts: &[u32], rank: usize) -> (u32, usize) {
    let mut left = rank;
    for (digit, count) in (0..).zip(counts) {
        match left.checked_sub(*count as usize) {
            Some(fewer) => left = fewer,
            None => return (digit, left),
        }
    }
    unreachable!("as many are counted as there are")
}

/// How many of the numbers have each digit.
fn counts(rows: &[&[f32]], digit: impl Fn(u32) -> Option<u32> + Sync, watch: Watch) -> Result<Vec<u32>, Interrupted> {
    let counted = |mut counts: Vec<u32>, rows: &[&[f32]]| {
        for row in rows {
            for digit in row.iter().filter_map(|number| digit(number.to_bits())) {
                counts[digit as usize % BINS] += 1;
            }
        }
        watch.go_on().map(|()| counts)
    };
    let merged = |mut all: Vec<u32>, more: Vec<u32>| {
        all.iter_mut().zip(more).for_each(|(all, more)| *all += more);
        Ok(all)
    };
    let zeros = || vec![0; BINS];
    rows.par_chunks(ROWS).try_fold(zeros, counted).try_reduce(zeros, merged)
}
