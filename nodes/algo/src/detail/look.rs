//! What a pixel's surroundings look like, in a few numbers.

use rayon::prelude::*;

use super::picture::{Colour, Picture, each, mirrored};
use crate::simd::vectorized;
use crate::{Interrupted, Watch};

/// Eight numbers; how unlike two surroundings are is the sum of their squared differences.
pub(super) type Look = [f32; 8];

// The first three basis functions of the orthonormal DCT-II of five samples.
const EVEN: [f32; 5] = [0.447_213_6; 5];
const SLOPE: [f32; 5] = [0.601_500_9, 0.371_748, 0.0, -0.371_748, -0.601_500_9];
const BOW: [f32; 5] = [0.511_667_3, -0.195_439_5, -0.632_455_5, -0.195_439_5, 0.511_667_3];

/// The basis functions of a look's numbers along x and along y, sample by sample.
const ACROSS: [Look; 5] = by_sample([EVEN, SLOPE, BOW, EVEN, SLOPE, EVEN, EVEN, EVEN]);
const DOWN: [Look; 5] = by_sample([EVEN, EVEN, EVEN, SLOPE, SLOPE, BOW, EVEN, EVEN]);

const fn by_sample(functions: [[f32; 5]; 8]) -> [Look; 5] {
    let mut samples = [[0.0; 8]; 5];
    let mut i = 0;
    while i < 40 {
        samples[i % 5][i / 5] = functions[i / 5][i % 5];
        i += 1;
    }
    samples
}

/// What the numbers are made of: luma, and once each colour difference.
const OF: [usize; 8] = [0, 0, 0, 0, 0, 0, 1, 2];

/// How much a difference in a ring counts beside one in the smooth surroundings: the root of 0.3.
const RING: f32 = 0.547_722_6;

/// The smooth look of 5 x 5 pixels around each that is wanted: the six lowest frequencies of luma, the means of the
/// colour differences.
pub(super) fn smooth(
    picture: &Picture,
    wanted: impl Fn(usize, usize) -> bool + Sync,
    watch: Watch,
) -> Result<Vec<Look>, Interrupted> {
    let (width, height) = (picture.width, picture.height);
    let mut looks = vec![[0.0; 8]; width * height];
    looks.par_chunks_mut(width.max(1)).enumerate().try_for_each(|(y, out)| {
        let Some(first) = (0..width).find(|&x| wanted(x, y)) else {
            return Ok(());
        };
        let last = (first..width).rfind(|&x| wanted(x, y)).unwrap_or(first);
        let rows: [_; 5] = std::array::from_fn(|tap| picture.row(mirrored((y + tap) as isize - 2, height)));
        let columns = columns(rows, first, last);
        vectorized(
            #[inline(always)]
            || {
                for ((x, out), around) in out[first..=last].iter_mut().enumerate().zip(columns.windows(5)) {
                    if wanted(first + x, y) {
                        for (column, weights) in around.iter().zip(&ACROSS) {
                            (0..8).for_each(|i| out[i] += weights[i] * column[i]);
                        }
                    }
                }
            },
        );
        watch.go_on()
    })?;
    Ok(looks)
}

/// The sums along y that looks from `first` to `last` need, from two pixels before on.
fn columns(rows: [&[Colour]; 5], first: usize, last: usize) -> Vec<Look> {
    let width = rows[0].len();
    let inside = first.saturating_sub(2)..width.min(last + 3);
    let before = inside.start + 2 - first;
    let mut columns = vec![[0.0; 8]; last - first + 5];
    vectorized(
        #[inline(always)]
        || {
            for (row, weights) in rows.iter().zip(&DOWN) {
                for (column, colour) in columns[before..].iter_mut().zip(&row[inside.clone()]) {
                    (0..8).for_each(|i| column[i] += weights[i] * colour[OF[i]]);
                }
            }
        },
    );
    for i in (0..before).chain(before + inside.len()..columns.len()) {
        let x = mirrored((first + i) as isize - 2, width);
        columns[i] = columns[x + 2 - first];
    }
    columns
}

/// The sharp look of a pixel's eight neighbours: their luma.
pub(super) fn ring(picture: &Picture, x: usize, y: usize) -> Look {
    let xs = [mirrored(x as isize - 1, picture.width), x, mirrored(x as isize + 1, picture.width)];
    let rows = [mirrored(y as isize - 1, picture.height), y, mirrored(y as isize + 1, picture.height)];
    let [above, here, below] = rows.map(|y| picture.row(y));
    let ring =
        [above[xs[0]], above[xs[1]], above[xs[2]], here[xs[0]], here[xs[2]], below[xs[0]], below[xs[1]], below[xs[2]]];
    ring.map(|colour| RING * colour[0])
}

/// The rings of all pixels.
pub(super) fn rings(picture: &Picture, watch: Watch) -> Result<Vec<Look>, Interrupted> {
    let ring = |pixel| ring(picture, pixel % picture.width, pixel / picture.width);
    each(picture.width, picture.height, watch, ring)
}

/// The sum of squared differences, in four lanes that are added at the end.
pub(super) fn distance<const D: usize>(a: &[f32; D], b: &[f32; D]) -> f32 {
    const { assert!(D.is_multiple_of(4)) };
    let mut sum = [0.0; 4];
    for (a, b) in a.as_chunks::<4>().0.iter().zip(b.as_chunks::<4>().0) {
        for lane in 0..4 {
            let apart = a[lane] - b[lane];
            sum[lane] += apart * apart;
        }
    }
    (sum[0] + sum[2]) + (sum[1] + sum[3])
}
