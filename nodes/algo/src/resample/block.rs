//! Where a block of pixels finds its samples: in a copy of their part of the source with a pixel's channels side by
//! side, or in the planes themselves.
//!
//! In a copy, what lies outside the source is filled in, so that weighing meets no edge. Rows of a large picture are
//! often a power of two apart: those of a footprint then push each other out of the cache; in the copy they lie close
//! together.

use super::locate::Located;
use super::sample::{Source, Stretch};
use crate::view::{View, ViewMut};
use std::ops::Range;

/// Most pixel columns of a block.
pub(super) const BLOCK_WIDTH: usize = 64;
/// Source pixels of a part per pixel drawn up to which a copy pays.
const SPREAD: usize = 8;
/// Rows from the one that is copied to the one that is fetched.
const AHEAD: usize = 4;
/// More than a footprint, for samples whose sums are not used.
static FAR: [[f32; 1]; 64] = [[0.0]; 64];
/// Lanes of a search for the least and the greatest.
const LANES: usize = 32;

/// A rectangle of a tile's pixels.
#[derive(Clone, Debug)]
pub(super) struct Pixels {
    pub columns: Range<usize>,
    pub rows: Range<usize>,
}

/// A rectangle of source pixels, counted from the window's corner. It may lie outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Part {
    pub corner: [i32; 2],
    pub size: [usize; 2],
}

impl Part {
    /// The footprints of `taps` x `taps` pixels of all of `pixels` that are drawn; none if none is.
    #[inline(always)]
    pub fn of(source: &Source, at: &Located, pixels: &Pixels, taps: usize) -> Option<Self> {
        let (mut low, mut high) = ([[f64::INFINITY; LANES]; 2], [[f64::NEG_INFINITY; LANES]; 2]);
        for row in pixels.rows.clone() {
            let (xs, ys) = at.row(row);
            widen(&mut low[0], &mut high[0], &xs[pixels.columns.clone()]);
            widen(&mut low[1], &mut high[1], &ys[pixels.columns.clone()]);
        }
        let low = low.map(|lanes| lanes.into_iter().fold(f64::INFINITY, f64::min));
        let high = high.map(|lanes| lanes.into_iter().fold(f64::NEG_INFINITY, f64::max));
        let first = |[x, y]: [f64; 2]| source.first_tap([x, y], taps).0;
        (low[0] <= high[0]).then(|| {
            let (corner, last) = (first(low), first(high));
            Self { corner, size: [0, 1].map(|axis| (last[axis] - corner[axis]) as usize + taps) }
        })
    }

    /// Whether a copy of it pays for drawing `pixels`: not where a map shrinks much or scatters.
    pub fn is_dense(&self, pixels: &Pixels, taps: usize) -> bool {
        // Around few pixels most of the part is the footprint's rim.
        let [width, height] = [pixels.columns.len() + taps, pixels.rows.len() + taps];
        self.size[0].saturating_mul(self.size[1]) <= SPREAD * width * height
    }

    /// What of it lies inside the source.
    pub fn inside(&self, source: &Source) -> Self {
        let limits = [source.window.width(), source.window.height()].map(|size| size as i64);
        let range = |axis: usize| {
            let start = i64::from(self.corner[axis]);
            let end = (start + self.size[axis] as i64).clamp(0, limits[axis]);
            start.clamp(0, end)..end
        };
        let ranges = [range(0), range(1)];
        let corner = [ranges[0].start as i32, ranges[1].start as i32];
        Self { corner, size: ranges.map(|range| (range.end - range.start) as usize) }
    }
}

/// Lowers and raises limits to hold some values; NaN does nothing.
#[inline(always)]
fn widen(low: &mut [f64; LANES], high: &mut [f64; LANES], values: &[f64]) {
    let (chunks, rest) = values.as_chunks::<LANES>();
    for chunk in chunks {
        for i in 0..LANES {
            low[i] = if chunk[i] < low[i] { chunk[i] } else { low[i] };
            high[i] = if chunk[i] > high[i] { chunk[i] } else { high[i] };
        }
    }
    for &value in rest {
        low[0] = if value < low[0] { value } else { low[0] };
        high[0] = if value > high[0] { value } else { high[0] };
    }
}

/// The samples of a part of C planes, a pixel's channels side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Samples<'a, const C: usize> {
    pub planes: [View<'a, f32>; C],
    pixels: &'a [[f32; C]],
    /// Pixels from a row to the next.
    pub stride: usize,
}

impl<'a, const C: usize> Samples<'a, C> {
    /// From pixel number `first` on.
    #[inline(always)]
    pub fn from(&self, first: u32) -> &'a [[f32; C]] {
        &self.pixels[first as usize..]
    }
}

/// The samples of a part of C planes, got row by row as they are asked for: so they are near when they are weighed, and
/// few rows of the planes are in the cache at a time.
#[derive(Debug)]
pub(super) struct Supply<'a, const C: usize> {
    pub part: Part,
    pub stride: usize,
    source: &'a Source,
    planes: [View<'a, f32>; C],
    pixels: Store<'a, C>,
    /// What of the part, and of the one after it, lies inside the source.
    inside: [Part; 2],
    /// Rows of the part that were asked for.
    rows: usize,
    /// Whether they are fetched as they are copied.
    fetches: bool,
}

/// Where samples lie.
#[derive(Debug)]
enum Store<'a, const C: usize> {
    /// A copy, to be filled.
    Copy(&'a mut [[f32; C]]),
    Plane(&'a [[f32; C]]),
}

impl<'a> Supply<'a, 1> {
    /// The plane itself, what of a part lies in it. If that does not hold a footprint, samples far from the part.
    pub fn of_plane(plane: View<'a, f32>, source: &'a Source, part: &Part, next: Option<Part>, taps: usize) -> Self {
        let mut part = part.inside(source);
        let (samples, stride) = plane.samples();
        // Pixels have numbers of 32 bits.
        part.size[1] = part.size[1].min(u32::MAX as usize / stride.max(1));
        let inside = [part, next.unwrap_or_default()];
        let supply =
            Self { part, stride, source, planes: [plane], pixels: Store::Plane(&FAR), inside, rows: 0, fetches: true };
        if part.size[0] < taps || part.size[1] < taps {
            let part = Part { corner: [i32::MIN / 2; 2], size: [taps; 2] };
            return Self { part, stride: taps, inside: Default::default(), ..supply };
        }
        let first = part.corner[1] as usize * stride + part.corner[0] as usize;
        Self { pixels: Store::Plane(samples[first..].as_chunks().0), ..supply }
    }
}

impl<'a, const C: usize> Supply<'a, C> {
    /// None of its rows is fetched: few of their samples are needed.
    pub fn sparse(self) -> Self {
        Self { rows: usize::MAX, ..self }
    }

    /// No row is fetched but by [`Ahead::fetch`].
    pub fn unfetched(self) -> Self {
        Self { fetches: false, ..self }
    }

    /// The rows up to number `rows` of the part that are not copied yet.
    pub fn ahead(&self, rows: usize) -> Ahead<'a, C> {
        let Part { corner: [x, y], size: [width, height] } = self.inside[0];
        let outside = (i64::from(y) - i64::from(self.part.corner[1])) as usize;
        let row = |row: usize| y as usize + row.saturating_sub(outside).min(height);
        Ahead { planes: self.planes, columns: x as usize..x as usize + width, rows: row(self.rows)..row(rows) }
    }

    /// The samples, with the part's first rows, at least `rows`.
    #[inline(always)]
    pub fn samples(&mut self, rows: usize) -> Samples<'_, C> {
        while self.rows < rows {
            if self.fetches {
                self.fetch(self.rows + AHEAD);
            }
            self.load(self.rows);
            self.rows += 1;
        }
        let pixels = match &self.pixels {
            Store::Copy(pixels) => pixels,
            Store::Plane(pixels) => *pixels,
        };
        Samples { planes: self.planes, pixels, stride: self.stride }
    }

    /// Has the memory bring a row nearer; those beyond the part's last are the next part's.
    #[inline(always)]
    fn fetch(&self, row: usize) {
        let [here, next] = &self.inside;
        let (part, row) = if row < here.size[1] { (here, row) } else { (next, row - here.size[1]) };
        if row >= part.size[1] {
            return;
        }
        let [x, y] = part.corner.map(|corner| corner as usize);
        for plane in &self.planes {
            fetch(&plane.row(y + row)[x..x + part.size[0]]);
        }
    }

    /// Copies a row of the part, if it is to be copied.
    #[inline(always)]
    fn load(&mut self, row: usize) {
        let Store::Copy(pixels) = &mut self.pixels else { return };
        let (part, width) = (&self.part, self.part.size[0]);
        let line = &mut pixels[row * width..(row + 1) * width];
        let Some(row) = self.source.row(part.corner[1] + row as i32) else {
            line.fill([0.0; C]);
            return;
        };
        let rows = self.planes.map(|plane| plane.row(row));
        let mut start = 0;
        while start < width {
            let (stretch, length) = self.source.stretch(part.corner[0] + start as i32);
            let end = width.min(start.saturating_add(length));
            let line = &mut line[start..end];
            match stretch {
                Stretch::Zeros => line.fill([0.0; C]),
                Stretch::Same(column) => line.fill(rows.map(|row| row[column])),
                Stretch::Rising(first) => interleave::<C, false>(rows.map(|row| &row[first..first + line.len()]), line),
                Stretch::Falling(last) => {
                    interleave::<C, true>(rows.map(|row| &row[last + 1 - line.len()..last + 1]), line);
                }
            }
            start = end;
        }
    }
}

/// Rows of some planes that are needed soon.
#[derive(Clone, Debug)]
pub(super) struct Ahead<'a, const C: usize> {
    planes: [View<'a, f32>; C],
    columns: Range<usize>,
    rows: Range<usize>,
}

impl<const C: usize> Ahead<'_, C> {
    /// Has the memory bring one of `count` equal parts of their columns nearer: all at once would be more than it brings at
    /// a time.
    #[inline(always)]
    pub fn fetch(&self, part: usize, count: usize) {
        let at = |part: usize| self.columns.start + part * self.columns.len() / count;
        let columns = at(part)..at(part + 1);
        for row in self.rows.clone() {
            for plane in &self.planes {
                fetch(&plane.row(row)[columns.clone()]);
            }
        }
    }
}

/// Room for a copy of a part of C planes.
#[derive(Debug, Default)]
pub(super) struct Block<const C: usize> {
    pixels: Vec<[f32; C]>,
}

impl<const C: usize> Block<C> {
    /// A part to be copied; `next` is what of the next one lies inside.
    pub fn supply<'a>(
        &'a mut self,
        source: &'a Source,
        planes: [View<'a, f32>; C],
        part: Part,
        next: Option<Part>,
    ) -> Supply<'a, C> {
        let [width, height] = part.size;
        if self.pixels.len() < width * height {
            self.pixels.resize(width * height, [0.0; C]);
        }
        let inside = [part.inside(source), next.unwrap_or_default()];
        let pixels = Store::Copy(&mut self.pixels);
        Supply { part, stride: width, source, planes, pixels, inside, rows: 0, fetches: true }
    }
}

/// Has the memory bring samples nearer, for later; a hint.
#[inline(always)]
pub(super) fn fetch<T>(samples: &[T]) {
    #[cfg(target_arch = "x86_64")]
    super::simd::fetch(samples);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = samples;
}

/// Puts the samples of rows side by side, from the last to the first if `FALLING`.
#[inline(always)]
fn interleave<const C: usize, const FALLING: bool>(rows: [&[f32]; C], line: &mut [[f32; C]]) {
    let count = line.len();
    let rows = rows.map(|row| &row[..count]);
    #[cfg(target_arch = "x86_64")]
    if super::simd::interleave::<C, FALLING>(rows, line) {
        return;
    }
    for (x, pixel) in line.iter_mut().enumerate() {
        let x = if FALLING { count - 1 - x } else { x };
        *pixel = std::array::from_fn(|channel| rows[channel][x]);
    }
}

/// Writes pixels with their channels side by side to columns of a row of planes, at most as many as channels.
/// [`finish_stores`] must follow before anyone reads them.
#[inline(always)]
pub(super) fn store<const C: usize>(
    pixels: &[[f32; C]],
    row: usize,
    columns: Range<usize>,
    planes: &mut [ViewMut<f32>],
) {
    let count = planes.len();
    let mut rows: [&mut [f32]; C] = std::array::from_fn(|_| Default::default());
    for (to, plane) in rows.iter_mut().zip(planes) {
        *to = &mut plane.row_mut(row)[columns.clone()];
    }
    #[cfg(target_arch = "x86_64")]
    if super::simd::store(pixels, &mut rows[..count]) {
        return;
    }
    for (channel, row) in rows[..count].iter_mut().enumerate() {
        for (sample, pixel) in row.iter_mut().zip(pixels) {
            *sample = pixel[channel];
        }
    }
}

/// Waits until all that [`store`] wrote can be seen.
pub(super) fn finish_stores() {
    #[cfg(target_arch = "x86_64")]
    super::simd::finish_stores();
}
