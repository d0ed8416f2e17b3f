//! Gaussian blurs whose width differs from place to place, and their transposes.

use rayon::prelude::*;

use crate::{Interrupted, Watch};

/// Variances below and above which a blur is none and is cut, square px.
const VARIANCES: [f64; 2] = [1.0 / 16.0, 64.0];

/// The upper half of the normalised Gaussian of a variance in square px, from its middle on; 1 alone for none.
fn gaussian(variance: f64) -> Vec<f32> {
    let reach = (3.0 * variance.sqrt()).ceil() as i32;
    let weight = |at: i32| if at == 0 { 1.0 } else { libm::exp(-f64::from(at * at) / (2.0 * variance)) };
    let sum: f64 = (-reach..=reach).map(weight).sum();
    (0..=reach).map(|at| (weight(at) / sum) as f32).collect()
}

/// Pixel `i` of `n`, mirrored at the edges of the first and the last one: what makes a blur its own transpose.
fn mirrored(i: isize, n: usize) -> usize {
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
        (-reach..=reach).zip(longer.windows(width)).for_each(|(i, row)| add(out, tap(i), row));
        watch.go_on()
    })?;
    let mut down = vec![0.0; plane.len()];
    down.par_chunks_mut(width.max(1)).enumerate().try_for_each(|(y, out)| {
        for i in -reach..=reach {
            let from = mirrored(y as isize + i, height) * width;
            add(out, tap(i), &across[from..from + width]);
        }
        watch.go_on()
    })?;
    Ok(down)
}

fn add(sum: &mut [f32], weight: f32, values: &[f32]) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
}

/// A blur that differs from place to place: a mixture of Gaussians whose variances double, in shares that give each
/// pixel's variance.
pub(super) struct LocalBlur {
    width: usize,
    /// A variance, and its share in each pixel.
    parts: Vec<(f64, Vec<f32>)>,
}

impl LocalBlur {
    /// The blur of a variance per pixel, square px. Those that are NaN have no share in anything.
    pub fn new(width: usize, variances: &[f32]) -> Self {
        let [least, most] = VARIANCES;
        let taken = |variance: f32| if f64::from(variance) < least { 0.0 } else { f64::from(variance).min(most) };
        let known = || variances.iter().filter(|variance| !variance.is_nan()).map(|&variance| taken(variance));
        let (low, high) = known().fold((f64::INFINITY, 0.0), |(low, high), v| (v.min(low), v.max(high)));
        let mut steps = vec![low.min(high)];
        while let Some(&last) = steps.last().filter(|&&last| last < high) {
            steps.push((2.0 * last.max(least / 2.0)).min(high));
        }
        let share = |step: usize| {
            let at = |step: usize| steps.get(step).copied();
            let (own, before, after) = (steps[step], step.checked_sub(1).and_then(at), at(step + 1));
            let share = move |&variance: &f32| match taken(variance) {
                _ if variance.is_nan() => 0.0,
                v if v < own => before.map_or(0.0, |before| ((v - before) / (own - before)).max(0.0) as f32),
                v => after.map_or(1.0, |after| ((after - v) / (after - own)).max(0.0) as f32),
            };
            (own, variances.iter().map(share).collect())
        };
        Self { width, parts: (0..steps.len()).map(share).collect() }
    }

    /// The plane as the blur leaves it; 0 where no variance is known.
    pub fn apply(&self, plane: &[f32], watch: Watch) -> Result<Vec<f32>, Interrupted> {
        let mut out = vec![0.0; plane.len()];
        for (variance, shares) in &self.parts {
            let part = blurred(plane, self.width, *variance, watch)?;
            out.iter_mut().zip(part).zip(shares).for_each(|((out, part), share)| *out += share * part);
        }
        Ok(out)
    }

    /// The transposed blur of a plane.
    pub fn transposed(&self, plane: &[f32], watch: Watch) -> Result<Vec<f32>, Interrupted> {
        let mut out = vec![0.0; plane.len()];
        for (variance, shares) in &self.parts {
            let part: Vec<f32> = plane.iter().zip(shares).map(|(value, share)| value * share).collect();
            out.iter_mut().zip(blurred(&part, self.width, *variance, watch)?).for_each(|(out, part)| *out += part);
        }
        Ok(out)
    }
}

/// Moves `plane` so that `blur` of it comes nearer to `constraint`, `steps` times by G^T (constraint - G plane); where
/// no variance is known it stays. Returns the sum of squared differences before and after.
pub(super) fn back_project(
    blur: &LocalBlur,
    constraint: &[f32],
    known: &[f32],
    plane: &mut [f32],
    steps: usize,
    watch: Watch,
) -> Result<[f64; 2], Interrupted> {
    let mut sums = [0.0; 2];
    for step in 0..=steps {
        let mut missing = blur.apply(plane, watch)?;
        for ((missing, constraint), known) in missing.iter_mut().zip(constraint).zip(known) {
            *missing = if known.is_nan() { 0.0 } else { constraint - *missing };
        }
        let sum = missing.iter().map(|&missing| f64::from(missing) * f64::from(missing)).sum();
        sums = if step == 0 { [sum; 2] } else { [sums[0], sum] };
        if step < steps {
            let correction = blur.transposed(&missing, watch)?;
            for ((value, correction), known) in plane.iter_mut().zip(correction).zip(known) {
                *value += if known.is_nan() { 0.0 } else { correction };
            }
        }
    }
    Ok(sums)
}
