//! One band of rows: its runs, and the parts of components that they form.

use std::ops::Range;

use super::Component;
use super::runs::{Run, append_runs, touching};
use super::unions::Unions;
use crate::view::{View, ViewMut};

/// The runs of a band of rows and the parts of components that are connected within the band.
pub(super) struct Band {
    /// Ends of all runs in raster order, two per run.
    ends: Vec<u32>,
    /// Runs before each row, and after the last one.
    row_starts: Vec<usize>,
    /// The part that each run belongs to; parts are numbered in raster order of their first runs.
    pub(super) parts: Vec<u32>,
    /// Extent of each part.
    pub(super) extents: Vec<Extent>,
}

impl Band {
    /// Finds the runs of the rows and the parts that they form.
    pub(super) fn scan(mask: View<f32>, rows: Range<usize>, reach: u32) -> Self {
        let mut band = Self { ends: Vec::new(), row_starts: vec![0], parts: Vec::new(), extents: Vec::new() };
        let mut unions = Unions::default();
        let (mut above, mut pairs) = (0..0, Vec::new());
        for y in rows.clone() {
            append_runs(mask.row(y), &mut band.ends);
            let row = above.end..band.ends.len() / 2;
            band.row_starts.push(row.end);
            unions.extend(row.end as u32);
            for &[a, b] in touching(band.runs(above.clone()), band.runs(row.clone()), reach, &mut pairs) {
                unions.join(above.start as u32 + a, row.start as u32 + b);
            }
            above = row;
        }
        band.parts = unions.into_sets();
        band.extents.reserve_exact(band.parts.iter().max().map_or(0, |&last| last as usize + 1));
        for (row, y) in rows.enumerate() {
            band.measure(row, y);
        }
        band.ends.shrink_to_fit();
        band.parts.shrink_to_fit();
        band
    }

    /// Bytes it holds.
    pub(super) fn bytes(&self) -> usize {
        let words = self.ends.capacity() + self.parts.capacity();
        words * size_of::<u32>() + self.extents.capacity() * size_of::<Extent>()
    }

    /// Some of the runs.
    pub(super) fn runs(&self, range: Range<usize>) -> &[Run] {
        &self.ends.as_chunks::<2>().0[range]
    }

    /// Numbers of the first row's runs.
    pub(super) fn first_row(&self) -> Range<usize> {
        self.row(0)
    }

    /// Numbers of the last row's runs.
    pub(super) fn last_row(&self) -> Range<usize> {
        self.row(self.row_starts.len() - 2)
    }

    fn row(&self, row: usize) -> Range<usize> {
        self.row_starts[row]..self.row_starts[row + 1]
    }

    /// Adds the runs of a row, row `y` of the view, to the extents of their parts.
    fn measure(&mut self, row: usize, y: usize) {
        let range = self.row(row);
        let runs = &self.ends.as_chunks::<2>().0[range.clone()];
        for (&run, &part) in runs.iter().zip(&self.parts[range]) {
            let extent = Extent::of_run(run, y as u32);
            match self.extents.get_mut(part as usize) {
                Some(part) => part.merge(&extent),
                None => self.extents.push(extent),
            }
        }
    }

    /// Writes the label of its part into each pixel of each run, 0 elsewhere.
    pub(super) fn paint(&self, labels: &[u32], mut out: ViewMut<u32>) {
        for y in 0..out.height() {
            let (row, range) = (out.row_mut(y), self.row(y));
            let mut painted = 0;
            for (&[start, end], &part) in self.runs(range.clone()).iter().zip(&self.parts[range]) {
                paint_span(row, painted..start as usize, 0);
                paint_span(row, start as usize..end as usize, labels[part as usize]);
                painted = end as usize;
            }
            row[painted..].fill(0);
        }
    }
}

/// Paints a span, and perhaps up to 8 samples from its start: those right of it are painted anew by the spans that
/// follow. The known length is quicker for short spans.
fn paint_span(row: &mut [u32], span: Range<usize>, label: u32) {
    let Some(start) = row[span.start..].first_chunk_mut::<8>() else { return row[span].fill(label) };
    *start = [label; 8];
    if span.len() > 8 {
        row[span.start + 8..span.end].fill(label);
    }
}

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
    pub(super) fn of_run([start, end]: Run, y: u32) -> Self {
        let (first, end_squared) = (u64::from(start), u64::from(end) * u64::from(end));
        let area = u64::from(end) - first;
        // The odd numbers below 2 n sum to n^2.
        let doubled_sums = [end_squared - first * first, area * (2 * u64::from(y) + 1)];
        Self { area, doubled_sums, min: [start, y], max: [end, y + 1] }
    }

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
