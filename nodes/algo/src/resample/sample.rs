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

/// What neighbours in a row or a column are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stretch {
    Zeros,
    /// All the pixel at this index.
    Same(usize),
    /// The pixels from this index up.
    Rising(usize),
    /// The pixels from this index down.
    Falling(usize),
}

impl Edge {
    /// What stands at `index` and after it, beside the pixels `0..count`, and how many places on that ends; `count` is
    /// positive.
    #[inline(always)]
    fn stretch(self, index: i32, count: usize) -> (Stretch, usize) {
        const FOREVER: usize = usize::MAX;
        let (index, count) = (i64::from(index), count as i64);
        if (0..count).contains(&index) {
            return (Stretch::Rising(index as usize), (count - index) as usize);
        }
        match self {
            Self::Transparent if index < 0 => (Stretch::Zeros, -index as usize),
            Self::Transparent => (Stretch::Zeros, FOREVER),
            Self::Clamp if index < 0 => (Stretch::Same(0), -index as usize),
            Self::Clamp => (Stretch::Same(count as usize - 1), FOREVER),
            Self::Wrap => {
                let phase = index.rem_euclid(count);
                (Stretch::Rising(phase as usize), (count - phase) as usize)
            }
            Self::Mirror => {
                let phase = index.rem_euclid(2 * count);
                let mirrored = 2 * count - 1 - phase;
                if phase < count {
                    (Stretch::Rising(phase as usize), (count - phase) as usize)
                } else {
                    (Stretch::Falling(mirrored as usize), mirrored as usize + 1)
                }
            }
        }
    }

    /// The pixel of `0..count` that stands at `index`; none where that is a zero.
    fn resolve(self, index: i32, count: usize) -> Option<usize> {
        match self.stretch(index, count).0 {
            Stretch::Zeros => None,
            Stretch::Same(pixel) | Stretch::Rising(pixel) | Stretch::Falling(pixel) => Some(pixel),
        }
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

    /// What stands in a row at `column` and after it, and how many columns on that ends.
    pub fn stretch(&self, column: i32) -> (Stretch, usize) {
        self.edge.stretch(column, self.window.width())
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
    for row in 0..positions.height {
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
