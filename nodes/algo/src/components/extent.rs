//! What is known of a component: sums over its pixels.

use super::Component;
use super::runs::Run;

/// Sums over the pixels of a component, exact.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    /// Count of pixels.
    pub(super) area: u64,
    /// Sums of 2 x + 1 and 2 y + 1, twice the centres' coordinates in the view.
    doubled_sums: [u64; 2],
    min: [u32; 2],
    /// Exclusive.
    max: [u32; 2],
}

impl Extent {
    #[inline(always)]
    pub(super) fn of_run([start, end]: Run, y: u32) -> Self {
        let (first, end_squared) = (u64::from(start), u64::from(end) * u64::from(end));
        let area = u64::from(end) - first;
        // The odd numbers below 2 n sum to n^2.
        let doubled_sums = [end_squared - first * first, area * (2 * u64::from(y) + 1)];
        Self { area, doubled_sums, min: [start, y], max: [end, y + 1] }
    }

    #[inline(always)]
    pub(super) fn merge(&mut self, other: &Self) {
        self.area += other.area;
        for axis in 0..2 {
            self.doubled_sums[axis] += other.doubled_sums[axis];
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
    }

    /// The component, in a view whose top left pixel is (`x0`, `y0`).
    pub(super) fn component(&self, x0: i64, y0: i64) -> Component {
        let mean = |sum: u64| sum as f64 / (2 * self.area) as f64;
        let ([left, top], [right, bottom]) = (self.min.map(i64::from), self.max.map(i64::from));
        Component {
            area: self.area,
            bounds: [x0 + left, y0 + top, x0 + right, y0 + bottom],
            centroid: [x0 as f64 + mean(self.doubled_sums[0]), y0 as f64 + mean(self.doubled_sums[1])],
        }
    }
}
