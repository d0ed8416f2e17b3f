//! Sample: from source positions to samples.

use super::locate::Located;
use super::taps::split;
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

    /// The first of the `taps` x `taps` pixels around a position, counted from the window's corner, and how far past the
    /// middle one the position lies.
    pub fn first_tap(&self, position: [f64; 2], taps: usize) -> ([i32; 2], [f32; 2]) {
        let corner = self.corner();
        let [x, y] = [0, 1].map(|axis| split(position[axis] - corner[axis] - 0.5));
        ([x.0, y.0].map(|whole| whole - (taps as i32 / 2 - 1)), [x.1, y.1])
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
