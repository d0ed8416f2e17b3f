//! Weighing the samples of one pixel, plainly: any edge, any rule. [`simd`](super::simd) does the same sums for eight
//! pixels at a time.

use super::filter::Kernel;
use super::sample::Source;
use super::taps::Taps;
use crate::view::View;

/// Where a pixel's samples lie, and their weights.
pub(super) struct Footprint<const L: usize> {
    columns: [Option<usize>; L],
    rows: [Option<usize>; L],
    weights: [[f32; L]; 2],
    rest: [f32; 2],
    interpolates: bool,
    taps: usize,
}

impl<const L: usize> Footprint<L> {
    /// Of pixel `i` of a row.
    pub fn new<const D: usize>(kernel: &Kernel<L, D>, source: &Source, taps: &Taps, i: usize) -> Self {
        let place = |axis: usize, lane: usize| taps.first[axis][i].wrapping_add(lane as i32);
        let rest = [taps.rest[0][i], taps.rest[1][i]];
        Self {
            columns: std::array::from_fn(|lane| source.column(place(0, lane))),
            rows: std::array::from_fn(|lane| source.row(place(1, lane))),
            weights: rest.map(|t| kernel.weights(t)),
            rest,
            interpolates: kernel.interpolates(),
            taps: kernel.taps,
        }
    }

    fn sample(&self, plane: &View<f32>, column: usize, row: usize) -> f32 {
        match (self.columns[column], self.rows[row]) {
            (Some(column), Some(row)) => plane.row(row)[column],
            _ => 0.0,
        }
    }

    /// The weighted sum of a plane's samples; with `clamp` no less than the least and no more than the greatest of
    /// those within 1 px. Samples of weight zero are not read.
    pub fn value(&self, plane: &View<f32>, clamp: bool) -> f32 {
        let middle = self.taps / 2 - 1;
        if self.interpolates && self.rest == [0.0; 2] {
            return self.sample(plane, middle, middle);
        }
        let [x, y] = &self.weights;
        let mut terms = [0.0; L];
        for column in (0..self.taps).filter(|&column| x[column] != 0.0) {
            let rows = (0..self.taps).filter(|&row| y[row] != 0.0);
            terms[column] = x[column] * rows.fold(0.0, |sum, row| sum + y[row] * self.sample(plane, column, row));
        }
        let mut total = total(terms);
        if clamp {
            let [low, high] = self.range(plane);
            total = if total < low { low } else { total };
            total = if total > high { high } else { total };
        }
        // The sign and payload of a computed NaN depend on how the compiler orders operands; this takes them away.
        if total.is_nan() { f32::NAN } else { total }
    }

    /// The least and the greatest sample with weight within 1 px along both axes.
    fn range(&self, plane: &View<f32>) -> [f32; 2] {
        let inner = |axis: usize| {
            let (middle, whole) = (self.taps / 2 - 1, self.rest[axis] == 0.0);
            let first = if whole { middle - 1 } else { middle };
            (first..middle + 2).filter(move |&tap| !whole || self.weights[axis][tap] != 0.0)
        };
        let mut range = [f32::INFINITY, f32::NEG_INFINITY];
        for row in inner(1) {
            for column in inner(0) {
                let sample = self.sample(plane, column, row);
                range = [range[0].min(sample), range[1].max(sample)];
            }
        }
        range
    }
}

/// The sum of the columns' terms, halves first. Never minus zero.
fn total<const L: usize>(terms: [f32; L]) -> f32 {
    let folded: [f32; 4] = std::array::from_fn(|i| (i + 4..L).step_by(4).fold(terms[i], |sum, k| sum + terms[k]));
    (folded[0] + folded[1]) + (folded[2] + folded[3]) + 0.0
}
