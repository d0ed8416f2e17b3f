//! The part of the source that a block of pixels is drawn from, copied with a pixel's channels side by side.
//!
//! What lies outside the source is filled in, so that weighing meets no edge. Rows of a large picture are often a power
//! of two apart: those of a footprint then push each other out of the cache; in the copy they lie close together.

use super::locate::Located;
use super::sample::Source;
use crate::view::View;
use std::ops::Range;

/// Most pixel columns of a block.
pub(super) const BLOCK_WIDTH: usize = 64;
/// Most source pixels of a part.
const LARGEST: usize = 1 << 15;
/// Pixels that are drawn one by one if they lie too far apart.
const FEW: usize = 64;
/// Lanes of a search for the least and the greatest.
const LANES: usize = 8;

/// A rectangle of a tile's pixels.
#[derive(Clone, Debug)]
pub(super) struct Pixels {
    pub columns: Range<usize>,
    pub rows: Range<usize>,
}

impl Pixels {
    fn count(&self) -> usize {
        self.columns.len() * self.rows.len()
    }

    /// In smaller parts: single pixels if there are few, else halves, cut across the longer side.
    pub fn parts(&self) -> Vec<Self> {
        if self.count() <= FEW {
            let (rows, columns) = (self.rows.clone(), self.columns.clone());
            let single = |row, column| Self { columns: column..column + 1, rows: row..row + 1 };
            return rows.flat_map(|row| columns.clone().map(move |column| single(row, column))).collect();
        }
        let cut = |range: &Range<usize>| {
            let middle = range.start + range.len() / 2;
            [range.start..middle, middle..range.end]
        };
        if self.columns.len() >= self.rows.len() {
            cut(&self.columns).map(|columns| Self { columns, ..self.clone() }).into()
        } else {
            cut(&self.rows).map(|rows| Self { rows, ..self.clone() }).into()
        }
    }
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
        let first = |[x, y]: [f64; 2]| source.first_tap([x, y], taps);
        (low[0] <= high[0]).then(|| {
            let (corner, last) = (first(low), first(high));
            Self { corner, size: [0, 1].map(|axis| (last[axis] - corner[axis]) as usize + taps) }
        })
    }

    /// Whether a copy of it costs no more than copies of the footprints of all `pixels`: not where a map shrinks much.
    pub fn suits(&self, pixels: &Pixels, taps: usize) -> bool {
        let area = self.size[0].saturating_mul(self.size[1]);
        area <= taps * taps * pixels.count() && area <= LARGEST
    }

    /// Its columns that lie inside the source.
    fn inside(&self, source: &Source) -> Range<usize> {
        let width = self.size[0] as i64;
        let start = (-i64::from(self.corner[0])).clamp(0, width);
        let end = (source.window.width() as i64 - i64::from(self.corner[0])).clamp(start, width);
        start as usize..end as usize
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

/// A copy of a part of C planes.
#[derive(Debug, Default)]
pub(super) struct Block<const C: usize> {
    pixels: Vec<[f32; C]>,
    part: Part,
}

impl<const C: usize> Block<C> {
    /// Copies a part.
    #[inline(always)]
    pub fn load(&mut self, source: &Source, planes: &[View<f32>; C], part: Part) {
        self.part = part;
        let ([width, height], inside) = (part.size, part.inside(source));
        if self.pixels.len() < width * height {
            self.pixels.resize(width * height, [0.0; C]);
        }
        for (y, line) in self.pixels.chunks_exact_mut(width).take(height).enumerate() {
            let Some(row) = source.row(part.corner[1] + y as i32) else {
                line.fill([0.0; C]);
                continue;
            };
            let rows = planes.map(|plane| plane.row(row));
            for x in (0..inside.start).chain(inside.end..width) {
                let column = source.column(part.corner[0] + x as i32);
                line[x] = column.map_or([0.0; C], |column| rows.map(|row| row[column]));
            }
            if !inside.is_empty() {
                let from = (part.corner[0] + inside.start as i32) as usize;
                interleave(rows.map(|row| &row[from..from + inside.len()]), &mut line[inside.clone()]);
            }
        }
    }

    /// Pixels from number `first` on, and how many a row is from the next.
    #[inline(always)]
    pub fn pixels(&self, first: u32) -> (&[[f32; C]], usize) {
        (&self.pixels[first as usize..], self.part.size[0])
    }

    pub fn part(&self) -> &Part {
        &self.part
    }
}

#[inline(always)]
fn interleave<const C: usize>(rows: [&[f32]; C], line: &mut [[f32; C]]) {
    let rows = rows.map(|row| &row[..line.len()]);
    #[cfg(target_arch = "x86_64")]
    let done = super::simd::interleave(rows, line);
    #[cfg(not(target_arch = "x86_64"))]
    let done = 0;
    for (x, pixel) in line.iter_mut().enumerate().skip(done) {
        *pixel = std::array::from_fn(|channel| rows[channel][x]);
    }
}
