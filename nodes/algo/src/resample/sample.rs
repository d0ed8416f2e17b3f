//! Sample: from source positions to filtered values.

use super::filter::Kernel;
use super::locate::{Located, TILE_WIDTH};
use super::taps::{Taps, split};
use super::weigh::Footprint;
use crate::rect::Rect;
use crate::view::{View, ViewMut};

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

/// The source window's place and size, and what lies outside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    pub window: Rect,
    pub edge: Edge,
}

impl Source {
    #[inline(always)]
    pub fn column(&self, column: i32) -> Option<usize> {
        self.edge.resolve(column, self.window.width())
    }

    #[inline(always)]
    pub fn row(&self, row: i32) -> Option<usize> {
        self.edge.resolve(row, self.window.height())
    }

    /// The window's corner, px.
    #[inline(always)]
    pub fn corner(&self) -> [f64; 2] {
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

/// Gives each pixel of a tile the value filtered with a kernel; places as in [`nearest`]. Returns how many of them are
/// not finite.
pub(super) fn filtered<const L: usize, const D: usize>(
    kernel: &Kernel<L, D>,
    clamp: bool,
    source: &Source,
    planes: &[View<f32>],
    positions: &Located,
    left: usize,
    out: &mut [ViewMut<f32>],
) -> u64 {
    let (arch, mut taps, mut rest) = (pulp::Arch::new(), Taps::EMPTY, Vec::with_capacity(TILE_WIDTH));
    let mut bad = 0;
    for row in 0..positions.height() {
        let (xs, ys) = positions.row(row);
        arch.dispatch(|| taps.fill(source, [xs, ys], [kernel.taps, L], clamp));
        for (planes, out) in planes.chunks(TOGETHER).zip(out.chunks_mut(TOGETHER)) {
            let mut rows: Vec<_> = out.iter_mut().map(|out| &mut out.row_mut(row)[left..left + xs.len()]).collect();
            rest.clear();
            fast(kernel, &taps, clamp, planes, &mut rows, &mut rest);
            bad += one_by_one(kernel, clamp, source, &taps, planes, xs, &mut rows, &rest);
        }
    }
    bad
}

/// Planes that are weighed together.
const TOGETHER: usize = 4;

/// Writes what can be weighed eight pixels at a time, and lists the other pixels.
fn fast<const L: usize, const D: usize>(
    kernel: &Kernel<L, D>,
    taps: &Taps,
    clamp: bool,
    planes: &[View<f32>],
    rows: &mut [&mut [f32]],
    rest: &mut Vec<usize>,
) {
    #[cfg(target_arch = "x86_64")]
    if super::simd::available() {
        let alike = planes.iter().all(|plane| plane.samples().1 == planes[0].samples().1);
        if let (true, Ok(planes), Ok(rows)) = (alike, planes.try_into(), rows.try_into()) {
            return super::simd::row::<L, D, TOGETHER>(kernel, taps, clamp, planes, rows, rest);
        }
        if let (&[plane], [row]) = (planes, &mut *rows) {
            return super::simd::row(kernel, taps, clamp, &[plane], &mut [row], rest);
        }
    }
    rest.extend(0..rows[0].len());
}

/// Writes the listed pixels of a row, and returns how many values are not finite.
fn one_by_one<const L: usize, const D: usize>(
    kernel: &Kernel<L, D>,
    clamp: bool,
    source: &Source,
    taps: &Taps,
    planes: &[View<f32>],
    xs: &[f64],
    rows: &mut [&mut [f32]],
    pixels: &[usize],
) -> u64 {
    let mut bad = 0;
    for &i in pixels {
        if xs[i].is_nan() {
            rows.iter_mut().for_each(|row| row[i] = 0.0);
            continue;
        }
        let footprint = Footprint::new(kernel, source, taps, i);
        for (plane, row) in planes.iter().zip(&mut *rows) {
            row[i] = footprint.value(plane, clamp);
            bad += u64::from(!row[i].is_finite());
        }
    }
    bad
}
