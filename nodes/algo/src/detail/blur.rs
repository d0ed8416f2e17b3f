//! Gaussian blurs, and pictures that have a given blurred form.

use rayon::prelude::*;

use super::local_blur::LocalBlur;
use crate::simd::vectorized;
use crate::{Interrupted, Watch};

/// The upper half of the normalised Gaussian of a variance in square px, from its middle on; 1 alone for none.
pub(super) fn gaussian(variance: f64) -> Vec<f32> {
    let reach = (3.0 * variance.sqrt()).ceil() as i32;
    let weight = |at: i32| if at == 0 { 1.0 } else { libm::exp(-f64::from(at * at) / (2.0 * variance)) };
    let sum: f64 = (-reach..=reach).map(weight).sum();
    (0..=reach).map(|at| (weight(at) / sum) as f32).collect()
}

/// Pixel `i` of `n`, mirrored at the edges of the first and the last one: what makes a blur its own transpose.
pub(super) fn mirrored(i: isize, n: usize) -> usize {
    let n = n as isize;
    let i = i.rem_euclid(2 * n);
    i.min(2 * n - 1 - i) as usize
}

/// A packed plane after the separable Gaussian of a variance, square px; mirrored at the border's edge.
pub(super) fn blurred(plane: &[f32], width: usize, variance: f64, watch: Watch) -> Result<Vec<f32>, Interrupted> {
    let kernel = gaussian(variance);
    let (reach, height) = (kernel.len() as isize - 1, plane.len() / width.max(1));
    let tap = |i: isize| kernel[i.unsigned_abs()];
    let mut across = vec![0.0; plane.len()];
    across.par_chunks_mut(width.max(1)).zip(plane.par_chunks(width.max(1))).try_for_each(|(out, row)| {
        let longer: Vec<f32> = (-reach..width as isize + reach).map(|x| row[mirrored(x, width)]).collect();
        vectorized(
            #[inline(always)]
            || (-reach..=reach).zip(longer.windows(width)).for_each(|(i, row)| add(out, tap(i), row)),
        );
        watch.go_on()
    })?;
    let mut down = vec![0.0; plane.len()];
    down.par_chunks_mut(width.max(1)).enumerate().try_for_each(|(y, out)| {
        vectorized(
            #[inline(always)]
            || {
                for i in -reach..=reach {
                    let from = mirrored(y as isize + i, height) * width;
                    add(out, tap(i), &across[from..from + width]);
                }
            },
        );
        watch.go_on()
    })?;
    Ok(down)
}

#[inline(always)]
fn add(sum: &mut [f32], weight: f32, values: &[f32]) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
}

/// Moves `plane` so that `blur` of it comes nearer to `constraint`, `steps` times by G^T (constraint - G plane); where
/// no variance is known it stays. Returns the sum of squared differences before and after.
pub(super) fn back_project(
    blur: &LocalBlur,
    constraint: &[f32],
    plane: &mut [f32],
    steps: usize,
    watch: Watch,
) -> Result<[f64; 2], Interrupted> {
    let (mut sums, width) = ([0.0; 2], blur.width.max(1));
    let [mut missing, mut correction] = [0, 1].map(|_| vec![0.0; plane.len()]);
    for step in 0..=steps {
        blur.apply(plane, &mut missing, watch)?;
        let rows =
            missing.par_chunks_mut(width).zip(constraint.par_chunks(width)).zip(blur.variances.par_chunks(width));
        let of_rows: Vec<f64> = rows.map(|((row, constraint), known)| lack(row, constraint, known)).collect();
        let sum = of_rows.iter().sum();
        sums = if step == 0 { [sum; 2] } else { [sums[0], sum] };
        if step < steps {
            blur.transposed(&missing, &mut correction, watch)?;
            let rows = plane.par_chunks_mut(width).zip(correction.par_chunks(width));
            rows.zip(blur.variances.par_chunks(width)).for_each(|((plane, correction), known)| {
                for ((value, correction), known) in plane.iter_mut().zip(correction).zip(known) {
                    *value += if known.is_nan() { 0.0 } else { *correction };
                }
            });
        }
    }
    Ok(sums)
}

/// What a row lacks of the constraint where variances are known, and its sum of squares.
fn lack(row: &mut [f32], constraint: &[f32], known: &[f32]) -> f64 {
    for ((value, constraint), known) in row.iter_mut().zip(constraint).zip(known) {
        *value = if known.is_nan() { 0.0 } else { constraint - *value };
    }
    row.iter().map(|&missing| f64::from(missing) * f64::from(missing)).sum()
}
