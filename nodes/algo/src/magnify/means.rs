//! Means over areas.

use std::ops::Range;

use rayon::prelude::*;

use crate::lattice::Lattice;
use crate::view::View;
use crate::{Interrupted, Watch};

/// The mean of a field over the area of every cell of a lattice, row-major.
///
/// The integral of the field, constant on each pixel, over the cell by the cell's area: pixels that a cell covers in part
/// count with that part.
///
/// * `lattice`: in the coordinates of the pixels, any positive spacing.
/// * `field`: any numbers; those that are not finite count as 0.
/// * `x0`, `y0`: position of the view's top left pixel, px.
///
/// Outside the view the field is 0. O(pixels + cells) time, rows of cells side by side. Stops when `watch` says so.
pub fn cell_means(
    lattice: &Lattice,
    field: View<f32>,
    x0: i64,
    y0: i64,
    watch: Watch,
) -> Result<Vec<f64>, Interrupted> {
    let [columns, rows] = lattice.cells();
    let edges = |axis: usize, count: usize| (0..=count).map(move |at| lattice.rest(at, at)[axis]).collect::<Vec<_>>();
    let across = shares(&edges(0, columns), x0 as f64, field.width());
    let down = shares(&edges(1, rows), y0 as f64, field.height());
    let mut means = vec![0.0; columns * rows];
    means.par_chunks_mut(columns).zip(&down).try_for_each(|(means, rows)| {
        let mut column_sums = vec![0.0; field.width()];
        for (y, share) in rows.parts() {
            for (sum, &sample) in column_sums.iter_mut().zip(field.row(y)) {
                *sum += if sample.is_finite() { share * f64::from(sample) } else { 0.0 };
            }
        }
        across.iter().zip(means).for_each(|(columns, mean)| *mean = columns.sum(&column_sums));
        watch.go_on()
    })?;
    Ok(means)
}

/// Means of `values`, rows of `from[0]` over a rectangle, over the cells of a coarser or finer division of it.
pub(super) fn resized(values: &[f64], from: [usize; 2], to: [usize; 2]) -> Vec<f64> {
    let [across, down] = [0, 1].map(|axis| {
        let step = from[axis] as f64 / to[axis] as f64;
        shares(&(0..=to[axis]).map(|at| at as f64 * step).collect::<Vec<_>>(), 0.0, from[axis])
    });
    let mut means = Vec::with_capacity(to[0] * to[1]);
    for rows in &down {
        let mut column_sums = vec![0.0; from[0]];
        for (y, share) in rows.parts() {
            column_sums.iter_mut().zip(&values[y * from[0]..]).for_each(|(sum, value)| *sum += share * value);
        }
        means.extend(across.iter().map(|columns| columns.sum(&column_sums)));
    }
    means
}

/// The parts of an interval that samples in a row take: all inner ones the same.
struct Shares {
    samples: Range<usize>,
    first: f64,
    inner: f64,
    last: f64,
}

impl Shares {
    /// Each sample and its part.
    fn parts(&self) -> impl Iterator<Item = (usize, f64)> {
        let last = self.samples.end.saturating_sub(1);
        self.samples.clone().map(move |at| match at {
            _ if at == self.samples.start => (at, self.first),
            _ if at == last => (at, self.last),
            _ => (at, self.inner),
        })
    }

    fn sum(&self, samples: &[f64]) -> f64 {
        self.parts().map(|(at, share)| share * samples[at]).sum()
    }
}

/// The parts that samples of width 1 from `start` on take of the intervals between neighbouring edges.
fn shares(edges: &[f64], start: f64, count: usize) -> Vec<Shares> {
    let of = |edges: &[f64]| {
        let [from, to] = [edges[0] - start, edges[1] - start];
        let length = to - from;
        let (low, high) = (from.clamp(0.0, count as f64), to.clamp(0.0, count as f64));
        let samples = low.floor() as usize..high.ceil() as usize;
        if low >= high {
            return Shares { samples: 0..0, first: 0.0, inner: 0.0, last: 0.0 };
        }
        let first = (high.min(samples.start as f64 + 1.0) - low) / length;
        let last = (high - (samples.end as f64 - 1.0)) / length;
        Shares { samples, first, inner: 1.0 / length, last }
    };
    edges.windows(2).map(of).collect()
}
