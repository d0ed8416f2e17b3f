//! Passes over the rows of one level; smoothing sweeps follow each other a row apart, so that an array crosses the
//! memory bus once.
//!
//! Red nodes are those with an even sum of column and row, black the others.

use super::level::{Level, halves, rows_around};
use super::transfer::{Interpolation, Restriction};
use crate::simd::vectorized;

/// Partial sums and maxima, so that their order does not depend on the machine's vectors.
const LANES: usize = 16;

/// What a cycle tells about its correction.
#[derive(Clone, Copy, Default)]
pub(super) struct Tally {
    /// Scalar product of the residual and the correction.
    pub(super) product: f64,
    /// Largest magnitude of the correction; NaN where there is one.
    pub(super) largest: f32,
}

/// One red-black sweep from 0 for the right-hand side `b`, and what it leaves, restricted to `out`.
pub(super) fn descend(level: &Level, coarser: &Level, b: &[f32], out: &mut [f32]) {
    vectorized(
        #[inline(always)]
        || descend_rows(level, coarser, b, &mut *out),
    );
}

#[inline(always)]
fn descend_rows(level: &Level, coarser: &Level, b: &[f32], out: &mut [f32]) {
    let (half, last) = (level.half, level.rows - 2);
    let mut ring: [Vec<f32>; 4] = std::array::from_fn(|_| vec![0.0; 2 * half]);
    let mut rest = vec![0.0; 2 * half];
    let mut restriction = Restriction::new(level);
    for step in 1..=last + 2 {
        if step <= last {
            let (s, row) = (step % 2, &mut ring[step % 4]);
            let (first, end) = level.inner(s);
            let b = &level.half_row(b, step, s)[first..end];
            let inverse = &level.half_row(&level.inverse, step, s)[first..end];
            let out = &mut row[s * half + first..s * half + end];
            out.iter_mut().zip(b).zip(inverse).for_each(|((out, b), inverse)| *out = b * inverse);
        } else {
            ring[step % 4].fill(0.0);
        }
        if (2..=last + 1).contains(&step) {
            let row = step - 1;
            let s = 1 - row % 2;
            let mut here = std::mem::take(&mut ring[row % 4]);
            let (target, beside) = halves(&mut here, half, s);
            let [up, down] = [&ring[(row + 3) % 4], &ring[(row + 1) % 4]].map(|row| &row[s * half..(s + 1) * half]);
            let (first, end) = level.inner(s);
            let around = level.around(s, up, beside, down);
            level.stencil(row, s).relax(&level.half_row(b, row, s)[first..], &around, &mut target[first..end]);
            ring[row % 4] = here;
        }
        if step >= 3 {
            let row = step - 2;
            let s = row % 2;
            let half_of = |row: usize, s: usize| &ring[row % 4][s * half..(s + 1) * half];
            let (first, end) = level.inner(s);
            let n = end - first;
            let around = level.around(s, half_of(row - 1, s), half_of(row, 1 - s), half_of(row + 1, s)).cut(n);
            let stencil = level.stencil(row, s).cut(n);
            rest[(1 - s) * half..(2 - s) * half].fill(0.0);
            let remainder = &mut rest[s * half + first..][..n];
            for i in 0..n {
                remainder[i] = stencil.flow(i, &around);
            }
            restriction.row(level, coarser, &rest, row, out);
        }
    }
}

/// Adds the coarse correction to the sweep from 0 that [`descend`] made, then sweeps black and red: `z`.
pub(super) fn ascend(level: &Level, coarser: &Level, b: &[f32], coarse: &[f32], z: &mut [f32]) -> Tally {
    let mut tally = Tally::default();
    vectorized(
        #[inline(always)]
        || tally = ascend_rows(level, coarser, b, coarse, &mut *z),
    );
    tally
}

#[inline(always)]
fn ascend_rows(level: &Level, coarser: &Level, b: &[f32], coarse: &[f32], z: &mut [f32]) -> Tally {
    let (half, last) = (level.half, level.rows - 2);
    let mut interpolation = Interpolation::new(level);
    let mut tally = Tally::default();
    for step in 1..=last + 2 {
        if step <= last {
            let s = step % 2;
            let (first, end) = level.inner(s);
            let n = end - first;
            let correction = &interpolation.row(level, coarser, coarse, step)[s * half + first..][..n];
            let b = &level.half_row(b, step, s)[first..][..n];
            let inverse = &level.half_row(&level.inverse, step, s)[first..][..n];
            let out = &mut z[(2 * step + s) * half + first..][..n];
            for i in 0..n {
                out[i] = b[i] * inverse[i] + correction[i];
            }
        }
        if (2..=last + 1).contains(&step) {
            relax(level, b, z, step - 1, 1 - (step - 1) % 2);
        }
        if step >= 3 {
            let row = step - 2;
            relax(level, b, z, row, row % 2);
            let (b, z) = (level.row(b, row), level.row(z, row));
            tally.product += product(b, z);
            tally.largest = larger(tally.largest, largest_of(z));
        }
    }
    tally
}

#[inline(always)]
fn relax(level: &Level, b: &[f32], z: &mut [f32], row: usize, s: usize) {
    let half = level.half;
    let (up, here, down) = rows_around(z, row, 2 * half);
    let (target, beside) = halves(here, half, s);
    let (first, end) = level.inner(s);
    let around = level.around(s, &up[s * half..], beside, &down[s * half..]);
    level.stencil(row, s).relax(&level.half_row(b, row, s)[first..], &around, &mut target[first..end]);
}

/// `p = z + beta p` and the energy `p . A p`.
pub(super) fn direct(level: &Level, z: &[f32], beta: f32, p: &mut [f32]) -> f64 {
    let mut energy = 0.0;
    vectorized(
        #[inline(always)]
        || energy = direct_rows(level, z, beta, &mut *p),
    );
    energy
}

#[inline(always)]
fn direct_rows(level: &Level, z: &[f32], beta: f32, p: &mut [f32]) -> f64 {
    let (half, stride) = (level.half, 2 * level.half);
    let mut energy = 0.0;
    for row in 1..level.rows {
        let (above, rest) = p.split_at_mut(row * stride);
        let (above, here) = (&above[(row - 1) * stride..], &mut rest[..stride]);
        here.iter_mut().zip(level.row(z, row)).for_each(|(p, z)| *p = z + beta * *p);
        let (even, odd) = here.split_at(half);
        energy += drops(level.half_row(&level.right, row, 0), even, odd)
            + drops(&level.half_row(&level.right, row, 1)[..half - 1], &odd[..half - 1], &even[1..])
            + drops(level.row(&level.down, row - 1), above, here);
    }
    energy
}

/// `x += alpha p` and `r -= alpha A p`.
pub(super) fn advance(level: &Level, p: &[f32], alpha: f32, x: &mut [f32], r: &mut [f32]) {
    vectorized(
        #[inline(always)]
        || advance_rows(level, p, alpha, &mut *x, &mut *r),
    );
}

#[inline(always)]
fn advance_rows(level: &Level, p: &[f32], alpha: f32, x: &mut [f32], r: &mut [f32]) {
    let half = level.half;
    for row in 1..level.rows - 1 {
        for s in 0..2 {
            let (first, end) = level.inner(s);
            let n = end - first;
            let [up, beside, down] =
                [(row - 1, s), (row, 1 - s), (row + 1, s)].map(|(row, s)| level.half_row(p, row, s));
            let (stencil, around) = (level.stencil(row, s).cut(n), level.around(s, up, beside, down).cut(n));
            let here = &level.half_row(p, row, s)[first..][..n];
            let at = (2 * row + s) * half + first;
            let (x, r) = (&mut x[at..][..n], &mut r[at..][..n]);
            for i in 0..n {
                x[i] += alpha * here[i];
                r[i] -= alpha * stencil.outflow(i, here[i], &around);
            }
        }
    }
}

/// `x += z`.
pub(super) fn add(z: &[f32], x: &mut [f32]) {
    x.iter_mut().zip(z).for_each(|(x, z)| *x += z);
}

/// The values of every node, restricted.
pub(super) fn restrict(level: &Level, coarser: &Level, b: &[f32], out: &mut [f32]) {
    vectorized(
        #[inline(always)]
        || {
            let mut restriction = Restriction::new(level);
            for row in 1..level.rows - 1 {
                restriction.row(level, coarser, level.row(b, row), row, &mut *out);
            }
        },
    );
}

/// The coarse values, interpolated at every node.
pub(super) fn interpolate(level: &Level, coarser: &Level, coarse: &[f32], out: &mut [f32]) {
    vectorized(
        #[inline(always)]
        || {
            let mut interpolation = Interpolation::new(level);
            for row in 1..level.rows - 1 {
                let at = 2 * level.half * row;
                let values = interpolation.row(level, coarser, coarse, row);
                out[at..at + 2 * level.half].copy_from_slice(values);
            }
        },
    );
}

/// Adds a split row to one of columns in order.
pub(super) fn add_row(split: &[f32], half: usize, out: &mut [f64]) {
    let (even, odd) = split.split_at(half);
    vectorized(
        #[inline(always)]
        || {
            let count = out.len();
            if count % 2 == 1 {
                out[count - 1] += f64::from(even[count / 2]);
            }
            for ((pair, even), odd) in out.chunks_exact_mut(2).zip(even).zip(odd) {
                pair[0] += f64::from(*even);
                pair[1] += f64::from(*odd);
            }
        },
    );
}

/// A row of values times `scale`, split into even and odd columns.
pub(super) fn round(values: &[f64], scale: f64, half: usize, out: &mut [f32]) {
    let (even, odd) = out.split_at_mut(half);
    vectorized(
        #[inline(always)]
        || {
            let pairs = values.chunks_exact(2);
            if let [last] = pairs.remainder() {
                even[values.len() / 2] = (last * scale) as f32;
            }
            for ((pair, even), odd) in pairs.zip(&mut *even).zip(&mut *odd) {
                (*even, *odd) = ((pair[0] * scale) as f32, (pair[1] * scale) as f32);
            }
        },
    );
}

/// Sum of `c (b - a)^2`.
#[inline(always)]
fn drops(c: &[f32], a: &[f32], b: &[f32]) -> f64 {
    fold([c, a, b], |sum, [c, a, b]| {
        let drop = b - a;
        sum + c * (drop * drop)
    })
}

#[inline(always)]
fn product(a: &[f32], b: &[f32]) -> f64 {
    fold([a, b], |sum, [a, b]| sum + a * b)
}

/// A sum over arrays of equal length.
#[inline(always)]
fn fold<const N: usize>(arrays: [&[f32]; N], step: impl Fn(f32, [f32; N]) -> f32) -> f64 {
    let length = arrays[0].len();
    let whole = length - length % LANES;
    let mut sums = [0.0_f32; LANES];
    for at in (0..whole).step_by(LANES) {
        let run = arrays.map(|array| &array[at..at + LANES]);
        for lane in 0..LANES {
            sums[lane] = step(sums[lane], run.map(|values| values[lane]));
        }
    }
    for at in whole..length {
        sums[at - whole] = step(sums[at - whole], arrays.map(|array| array[at]));
    }
    sums.iter().map(|sum| f64::from(*sum)).sum()
}

/// The larger one; NaN where one is.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if b > a || b.is_nan() { b } else { a }
}

/// Largest magnitude; NaN where there is one.
pub(super) fn largest(values: &[f32]) -> f32 {
    let mut most = 0.0;
    vectorized(
        #[inline(always)]
        || most = largest_of(values),
    );
    most
}

#[inline(always)]
fn largest_of(values: &[f32]) -> f32 {
    let runs = values.chunks_exact(LANES);
    let rest = runs.remainder().iter().fold(0.0, |most, value| larger(most, value.abs()));
    let mut most = [0.0_f32; LANES];
    for run in runs {
        for lane in 0..LANES {
            most[lane] = larger(most[lane], run[lane].abs());
        }
    }
    most.iter().fold(rest, |a, b| larger(a, *b))
}
