//! Sample: from source positions to filtered values.
//!
//! Positions are rounded to 2^-24 px, the resolution of the weights: far above the locator's rounding errors, so
//! that a whole-pixel position is one, and exact for the fraction t and for 1 - t, so that a weight is zero only
//! where t is.
//!
//! Filters work block by block: the part of the source that a block of pixels needs is copied once, edges resolved and
//! planes interleaved, and then weighed for all planes at a time.

use super::locate::{Clip, Located};
use crate::rect::Rect;
use crate::view::{View, ViewMut};
use std::ops::Range;

/// What a value is made of around a source position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Filter {
    /// The pixel that the position lies in.
    Nearest,
    /// Bilinear, 2 x 2 pixels.
    Linear,
    /// Keys' cubic convolution with a = -1/2 along both axes, 4 x 4 pixels.
    Cubic,
}

impl Filter {
    /// How far outside the source window a position gets weight from it, px: 0, 1/2, 3/2 (less the resolution,
    /// since the weight at the very end is zero).
    fn reach(self) -> f64 {
        match self {
            Self::Nearest => 0.0,
            Self::Linear => 0.5 - 1.0 / ONE as f64,
            Self::Cubic => 1.5 - 1.0 / ONE as f64,
        }
    }

    /// The source positions that get weight from `window`.
    pub(super) fn clip(self, window: &Rect) -> Clip {
        Clip::grown(window, self.reach())
    }
}

/// What lies outside the source window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Edge {
    /// Zeros.
    Transparent,
    /// The nearest pixel of the window: 0 0 | 0 1 2.
    Clamp,
    /// The picture mirrored at the window's edges: 1 0 | 0 1 2.
    Mirror,
    /// The picture repeated: 1 2 | 0 1 2.
    Wrap,
}

impl Edge {
    /// The pixel of `0..count` that stands at `index`; none where that is a zero. `count` is positive.
    fn resolve(self, index: i32, count: usize) -> Option<usize> {
        let (index, count) = (i64::from(index), count as i64);
        let inside = match self {
            Self::Transparent => return (0..count).contains(&index).then_some(index as usize),
            Self::Clamp => index.clamp(0, count - 1),
            Self::Wrap => index.rem_euclid(count),
            Self::Mirror => {
                let phase = index.rem_euclid(2 * count);
                phase.min(2 * count - 1 - phase)
            }
        };
        Some(inside as usize)
    }
}

/// Positions have this many fractional bits, those of an f32.
const FRACTION_BITS: u32 = 24;
const ONE: u64 = 1 << FRACTION_BITS;
/// Positions farther out than this, px, count as lying here.
const FARTHEST: f64 = (1_u64 << 27) as f64;
/// The last place of a number near this is 2^-24, and its own last 24 bits are zero.
const ROUNDER: f64 = 1.5 * (1_u64 << (52 - FRACTION_BITS)) as f64;

/// Rounds a position to 2^-24 px and splits it into whole pixels, rounded down, and the rest in 0..1.
#[inline(always)]
fn split(position: f64) -> (i32, f32) {
    let near = if position > -FARTHEST { position } else { -FARTHEST };
    let near = if near < FARTHEST { near } else { FARTHEST };
    let bits = (near + ROUNDER).to_bits();
    let whole = (bits >> FRACTION_BITS) as u32;
    let rest = (bits & (ONE - 1)) as i32 as f32 * (1.0 / ONE as f32);
    (whole.wrapping_sub((ROUNDER.to_bits() >> FRACTION_BITS) as u32) as i32, rest)
}

/// The source window's place and size, and what lies outside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    pub window: Rect,
    pub edge: Edge,
}

impl Source {
    fn column(&self, column: i32) -> Option<usize> {
        self.edge.resolve(column, self.window.width())
    }

    fn row(&self, row: i32) -> Option<usize> {
        self.edge.resolve(row, self.window.height())
    }

    /// The window's corner, px.
    fn corner(&self) -> [f64; 2] {
        [self.window.x0 as f64, self.window.y0 as f64]
    }
}

/// Gives each pixel of a tile the sample that its position lies in, zero where there is none. The tile's first column
/// is `left` in `out`, its first row the first.
pub(super) fn nearest<T: Copy + Default + Send>(
    source: &Source,
    planes: &[View<T>],
    positions: &Located,
    left: usize,
    out: &mut [ViewMut<T>],
) {
    let [x0, y0] = source.corner();
    let pixel = |(x, y): (&f64, &f64)| {
        if x.is_nan() {
            return None;
        }
        let (column, row) = (split(x - x0).0, split(y - y0).0);
        Some((source.column(column)?, source.row(row)?))
    };
    let mut pixels = Vec::with_capacity(positions.width);
    for row in 0..positions.height() {
        let (xs, ys) = positions.row(row);
        pixels.clear();
        pixels.extend(xs.iter().zip(ys).map(pixel));
        for (plane, out) in planes.iter().zip(&mut *out) {
            for (value, pixel) in out.row_mut(row)[left..].iter_mut().zip(&pixels) {
                *value = pixel.map_or(T::default(), |(column, row)| plane.row(row)[column]);
            }
        }
    }
}

/// Bilinear weights of pixels 0 and 1 at t.
#[inline(always)]
pub(super) fn linear_weights(t: f32) -> [f32; 2] {
    [1.0 - t, t]
}

/// Cubic convolution weights of pixels -1, 0, 1, 2 at t, a = -1/2 (Keys 1981, equation 15).
#[inline(always)]
pub(super) fn cubic_weights(t: f32) -> [f32; 4] {
    let s = 1.0 - t;
    [-0.5 * t * s * s, 1.0 + t * t * (1.5 * t - 2.5), 1.0 + s * s * (1.5 * s - 2.5), -0.5 * t * t * s]
}

/// Columns of the blocks that filters work in; they are as high as the tile.
const BLOCK_WIDTH: usize = 64;
/// Planes that are weighed together.
const LANES: usize = 4;

/// Gives each pixel of a tile the value filtered with `weights`, the N along one axis at a fraction of a pixel; places
/// as in [`nearest`].
pub(super) fn filtered<const N: usize>(
    source: &Source,
    planes: &[View<f32>],
    positions: &Located,
    left: usize,
    out: &mut [ViewMut<f32>],
    weights: impl Fn(f32) -> [f32; N] + Copy,
) {
    for (planes, out) in planes.chunks(LANES).zip(out.chunks_mut(LANES)) {
        if planes.len() == 1 {
            Filtering::<N, 1, _> { source, planes, positions, left, weights }.tile(out);
        } else {
            Filtering::<N, LANES, _> { source, planes, positions, left, weights }.tile(out);
        }
    }
}

/// A rectangle of a tile's pixels, not empty.
#[derive(Clone, Debug)]
struct Block {
    columns: Range<usize>,
    rows: Range<usize>,
}

impl Block {
    fn halves(self) -> [Self; 2] {
        let Self { columns, rows } = self;
        if columns.len() > rows.len() {
            let middle = columns.start + columns.len() / 2;
            [columns.start..middle, middle..columns.end].map(|columns| Self { columns, rows: rows.clone() })
        } else {
            let middle = rows.start + rows.len() / 2;
            [rows.start..middle, middle..rows.end].map(|rows| Self { columns: columns.clone(), rows })
        }
    }
}

/// The work on one tile: an N x N filter over at most L planes.
struct Filtering<'a, const N: usize, const L: usize, W> {
    source: &'a Source,
    planes: &'a [View<'a, f32>],
    positions: &'a Located,
    left: usize,
    weights: W,
}

/// Part of the source, edges resolved, L planes interleaved.
#[derive(Default)]
struct Patch<const L: usize> {
    /// First column and row, counted from the source window's corner.
    first: [i32; 2],
    width: usize,
    samples: Vec<[f32; L]>,
}

impl<const N: usize, const L: usize, W: Fn(f32) -> [f32; N]> Filtering<'_, N, L, W> {
    fn tile(&self, out: &mut [ViewMut<f32>]) {
        let mut patch = Patch::default();
        for start in (0..self.positions.width).step_by(BLOCK_WIDTH) {
            let columns = start..self.positions.width.min(start + BLOCK_WIDTH);
            self.block(Block { columns, rows: 0..self.positions.height() }, &mut patch, out);
        }
    }

    /// Filters a block, by halves where the part of the source that it needs is out of proportion.
    fn block(&self, block: Block, patch: &mut Patch<L>, out: &mut [ViewMut<f32>]) {
        let Some((first, last)) = self.footprint(&block) else {
            for row in block.rows {
                for out in &mut *out {
                    out.row_mut(row)[self.left..][block.columns.clone()].fill(0.0);
                }
            }
            return;
        };
        let [width, height] = [0, 1].map(|axis| (last[axis] - first[axis]) as usize + N);
        let count = block.columns.len() * block.rows.len();
        if count > 1 && width.saturating_mul(height) > 8 * count + 64 {
            for half in block.halves() {
                self.block(half, patch, out);
            }
        } else {
            self.fetch(first, width, height, patch);
            for row in block.rows {
                self.row(patch, row, block.columns.clone(), out);
            }
        }
    }

    /// The first source pixel with weight at a position, along one axis, and the fraction of a pixel.
    #[inline(always)]
    fn first(position: f64, corner: f64) -> (i32, f32) {
        let (whole, rest) = split(position - corner - 0.5);
        (whole - (N as i32 / 2 - 1), rest)
    }

    /// First source pixels, column and row, of the block's pixels: the least and the greatest; none if none is drawn.
    fn footprint(&self, block: &Block) -> Option<([i32; 2], [i32; 2])> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for row in block.rows.clone() {
            let (xs, ys) = self.positions.row(row);
            for (&x, &y) in xs[block.columns.clone()].iter().zip(&ys[block.columns.clone()]) {
                low = [if x < low[0] { x } else { low[0] }, if y < low[1] { y } else { low[1] }];
                high = [if x > high[0] { x } else { high[0] }, if y > high[1] { y } else { high[1] }];
            }
        }
        let corner = self.source.corner();
        let first = |at: [f64; 2]| [0, 1].map(|axis| Self::first(at[axis], corner[axis]).0);
        (low[0] <= high[0]).then(|| (first(low), first(high)))
    }

    fn fetch(&self, first: [i32; 2], width: usize, height: usize, patch: &mut Patch<L>) {
        (patch.first, patch.width) = (first, width);
        patch.samples.clear();
        let columns: Vec<_> = (first[0]..).take(width).map(|column| self.source.column(column)).collect();
        let inside = first[0] >= 0 && first[0] as usize + width <= self.source.window.width();
        let blank = vec![0.0; width];
        for row in (first[1]..).take(height) {
            let Some(row) = self.source.row(row) else {
                patch.samples.resize(patch.samples.len() + width, [0.0; L]);
                continue;
            };
            let line = |lane: usize| self.planes.get(lane).map(|plane| plane.row(row));
            if inside {
                let start = first[0] as usize;
                let lines: [_; L] =
                    std::array::from_fn(|lane| line(lane).map_or(&blank[..], |line| &line[start..start + width]));
                patch.samples.extend((0..width).map(|i| lines.map(|line| line[i])));
            } else {
                let lines: [_; L] = std::array::from_fn(line);
                let sample = |column: usize| lines.map(|line| line.map_or(0.0, |line| line[column]));
                patch.samples.extend(columns.iter().map(|column| column.map_or([0.0; L], sample)));
            }
        }
    }

    fn row(&self, patch: &Patch<L>, row: usize, columns: Range<usize>, out: &mut [ViewMut<f32>]) {
        let (xs, ys) = self.positions.row(row);
        let (xs, ys) = (&xs[columns.clone()], &ys[columns.clone()]);
        let corner = self.source.corner();
        let across = Taps::new(xs, |x| Self::first(x, corner[0]), &self.weights);
        let down = Taps::new(ys, |y| Self::first(y, corner[1]), &self.weights);
        let mut values = [[0.0; L]; BLOCK_WIDTH];
        for (i, _) in xs.iter().enumerate().filter(|(_, x)| !x.is_nan()) {
            let start = (down.first[i] - patch.first[1]) as usize * patch.width;
            let samples = &patch.samples[start + (across.first[i] - patch.first[0]) as usize..];
            let (x_weights, y_weights) = (across.weights(i), down.weights(i));
            values[i] = match (across.rest[i] == 0.0, down.rest[i] == 0.0) {
                (false, false) => weigh(samples, patch.width, &x_weights, &y_weights),
                (true, true) => samples[(N / 2 - 1) * (patch.width + 1)],
                _ => weigh_some(samples, patch.width, &x_weights, &y_weights),
            };
        }
        for (lane, out) in out.iter_mut().enumerate() {
            let out = &mut out.row_mut(row)[self.left..][columns.clone()];
            for (to, value) in out.iter_mut().zip(&values) {
                *to = value[lane];
            }
        }
    }
}

/// What a run of pixels takes from the source along one axis.
struct Taps<const N: usize> {
    /// First source pixel.
    first: [i32; BLOCK_WIDTH],
    /// Fraction of a pixel.
    rest: [f32; BLOCK_WIDTH],
    weights: [[f32; BLOCK_WIDTH]; N],
}

impl<const N: usize> Taps<N> {
    #[inline(always)]
    fn new(positions: &[f64], split: impl Fn(f64) -> (i32, f32), weights: impl Fn(f32) -> [f32; N]) -> Self {
        let mut taps = Self { first: [0; BLOCK_WIDTH], rest: [0.0; BLOCK_WIDTH], weights: [[0.0; BLOCK_WIDTH]; N] };
        for ((first, rest), &position) in taps.first.iter_mut().zip(&mut taps.rest).zip(positions) {
            (*first, *rest) = split(position);
        }
        for i in 0..BLOCK_WIDTH {
            let at = weights(taps.rest[i]);
            for n in 0..N {
                taps.weights[n][i] = at[n];
            }
        }
        taps
    }

    #[inline(always)]
    fn weights(&self, i: usize) -> [f32; N] {
        std::array::from_fn(|n| self.weights[n][i])
    }
}

/// Sum over j of `y_weights[j]` times the sum over i of `x_weights[i]` times sample (i, j).
#[inline(always)]
fn weigh<const N: usize, const L: usize>(
    samples: &[[f32; L]],
    width: usize,
    x_weights: &[f32; N],
    y_weights: &[f32; N],
) -> [f32; L] {
    let mut total = [0.0; L];
    for j in 0..N {
        let line = &samples[j * width..][..N];
        let mut sum = line[0].map(|sample| x_weights[0] * sample);
        for i in 1..N {
            for lane in 0..L {
                sum[lane] += x_weights[i] * line[i][lane];
            }
        }
        for lane in 0..L {
            let term = y_weights[j] * sum[lane];
            total[lane] = if j == 0 { term } else { total[lane] + term };
        }
    }
    total.map(plain_nan)
}

/// The same where some weights are zero: their samples are left out.
#[inline(never)]
fn weigh_some<const N: usize, const L: usize>(
    samples: &[[f32; L]],
    width: usize,
    x_weights: &[f32; N],
    y_weights: &[f32; N],
) -> [f32; L] {
    let mut total = [0.0; L];
    for j in (0..N).filter(|&j| y_weights[j] != 0.0) {
        let mut sum = [0.0; L];
        for i in (0..N).filter(|&i| x_weights[i] != 0.0) {
            for lane in 0..L {
                sum[lane] += x_weights[i] * samples[j * width + i][lane];
            }
        }
        for lane in 0..L {
            total[lane] += y_weights[j] * sum[lane];
        }
    }
    total.map(plain_nan)
}

/// The sign and payload of a computed NaN depend on how the compiler orders operands; this takes them away.
#[inline(always)]
fn plain_nan(value: f32) -> f32 {
    if value.is_nan() { f32::NAN } else { value }
}
