//! Whole maps: positions to planes of numbers, and back.

use super::{PixelMap, pixel_lattice};
use crate::lattice::Positions;
use crate::rect::Rect;
use crate::steps::Steps;
use crate::view::{View, ViewMut};
use crate::{Interrupted, Watch};
use rayon::prelude::*;

/// Rows that are worked on together.
const BAND: usize = 16;

/// What [`encode`] finds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoded {
    /// Pixels without a position.
    pub without_source: u64,
    /// Farthest that a position has moved by being stored in 32 bits, px.
    pub rounding: f64,
}

/// The planes of a map of positions.
///
/// A pixel's two numbers are those of [`PixelMap::numbers`], rounded to f32, and its alpha is 1. A pixel whose position
/// is not finite, or whose numbers do not fit an f32, has alpha 0 and the numbers of [`PixelMap::nowhere`].
///
/// - `map`: what the numbers mean.
/// - `window`: the map's pixels, not empty.
/// - `positions`: one per pixel, px, row-major; afterwards those that a reader will find, NaN where there is none.
/// - `x`, `y`, `alpha`: planes of the window's size (asserted); every sample is written.
///
/// Cost: linear in the pixels, bands of rows side by side. Stops when `watch` says so.
pub fn encode(
    map: &PixelMap,
    window: Rect,
    positions: &mut Positions,
    [x, y, alpha]: [ViewMut<f32>; 3],
    watch: Watch,
) -> Result<Encoded, Interrupted> {
    let (width, height) = (window.width(), window.height());
    assert!(!window.is_empty(), "a map has pixels");
    let count = width * height;
    assert!(positions.x.len() == count && positions.y.len() == count, "one position per pixel, {count}");
    let of_the_window = |plane: &ViewMut<f32>| (plane.width(), plane.height()) == (width, height);
    assert!([&x, &y, &alpha].into_iter().all(of_the_window), "planes of {width} x {height} px");
    let steps = Steps::new(watch, height.div_ceil(BAND));
    let planes = x.bands(BAND).into_par_iter().zip(y.bands(BAND)).zip(alpha.bands(BAND));
    let chunks = positions.x.par_chunks_mut(width * BAND).zip(positions.y.par_chunks_mut(width * BAND));
    let bands = planes.zip(chunks).map(|((((top, mut x), (_, mut y)), (_, mut alpha)), (xs, ys))| {
        let mut found = Encoded { without_source: 0, rounding: 0.0 };
        for (row, (xs, ys)) in xs.chunks_mut(width).zip(ys.chunks_mut(width)).enumerate() {
            let outs = [x.row_mut(row), y.row_mut(row), alpha.row_mut(row)];
            found = worse(found, encode_row(map, [window.x0, window.y0 + (top + row) as i64], xs, ys, outs));
        }
        steps.step().map(|()| found)
    });
    bands.try_reduce(|| Encoded { without_source: 0, rounding: 0.0 }, |a, b| Ok(worse(a, b)))
}

fn worse(a: Encoded, b: Encoded) -> Encoded {
    Encoded { without_source: a.without_source + b.without_source, rounding: a.rounding.max(b.rounding) }
}

/// A row from the pixel `first` on.
fn encode_row(
    map: &PixelMap,
    [x0, y]: [i64; 2],
    xs: &mut [f64],
    ys: &mut [f64],
    [out_x, out_y, alpha]: [&mut [f32]; 3],
) -> Encoded {
    let mut found = Encoded { without_source: 0, rounding: 0.0 };
    for i in 0..xs.len() {
        let center = [(x0 + i as i64) as f64 + 0.5, y as f64 + 0.5];
        let numbers = map.numbers(center, [xs[i], ys[i]]).map(|number| number as f32);
        if numbers.iter().all(|number| number.is_finite()) {
            let stored = map.position(center, numbers.map(f64::from));
            let moved = (stored[0] - xs[i]).abs().max((stored[1] - ys[i]).abs());
            found.rounding = found.rounding.max(moved);
            [xs[i], ys[i]] = stored;
            ([out_x[i], out_y[i]], alpha[i]) = (numbers, 1.0);
        } else {
            found.without_source += 1;
            [xs[i], ys[i]] = [f64::NAN; 2];
            ([out_x[i], out_y[i]], alpha[i]) = (map.numbers(center, map.nowhere()).map(|number| number as f32), 0.0);
        }
    }
    found
}

/// A map that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded {
    /// Positions of the nodes of [`pixel_lattice`], px; NaN where there is none.
    pub positions: Positions,
    /// Pixels without a position.
    pub without_source: u64,
}

/// Why a map cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DecodeError {
    /// Told to stop, or refused memory.
    Interrupted,
    /// Pixels whose alpha is not 0 or below have numbers, or an alpha, that are not finite.
    NotFinite {
        /// The first of them in row order.
        pixel: [i64; 2],
        /// Count of them.
        count: u64,
    },
    /// Alpha is 0 or below everywhere.
    NoSource,
}

impl From<Interrupted> for DecodeError {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

/// The positions that the planes of a map stand for.
///
/// Node (c, r) of the lattice is pixel (c, r) of the window; its position is [`PixelMap::position`] of its numbers, and
/// NaN where alpha is 0, or below, as filters leave it beside a hard edge. A side of one pixel has a second node that
/// belongs 1 px farther along that side.
///
/// - `map`: what the numbers mean.
/// - `window`: the map's pixels, not empty.
/// - `x`, `y`, `alpha`: planes of the window's size (asserted); without alpha every pixel has a position.
///
/// Cost: linear in the pixels, bands of rows side by side. Asks `watch` for 16 bytes per node, and stops when it says
/// so.
pub fn decode(
    map: &PixelMap,
    window: Rect,
    [x, y]: [View<f32>; 2],
    alpha: Option<View<f32>>,
    watch: Watch,
) -> Result<Decoded, DecodeError> {
    assert!(!window.is_empty(), "a map has pixels");
    let (width, height) = (window.width(), window.height());
    assert!([Some(x), Some(y), alpha].iter().flatten().all(|plane| (plane.width(), plane.height()) == (width, height)));
    let [columns, rows] = pixel_lattice(window).nodes;
    watch.reserve(columns * rows * size_of::<[f64; 2]>())?;
    let mut positions = Positions { x: vec![f64::NAN; columns * rows], y: vec![f64::NAN; columns * rows] };
    let steps = Steps::new(watch, height.div_ceil(BAND));
    let chunk = columns * BAND;
    let bands = positions.x.par_chunks_mut(chunk).zip(positions.y.par_chunks_mut(chunk)).enumerate();
    let tallies = bands.map(|(band, (xs, ys))| {
        let mut tally = Tally::default();
        for (row, (xs, ys)) in (band * BAND..height).zip(xs.chunks_mut(columns).zip(ys.chunks_mut(columns))) {
            let alpha = alpha.map(|alpha| alpha.row(row));
            tally.row(map, [window.x0, window.y0 + row as i64], [x.row(row), y.row(row)], alpha, xs, ys);
            if width == 1 {
                (xs[1], ys[1]) = (xs[0] + 1.0, ys[0]);
            }
        }
        steps.step().map(|()| tally)
    });
    let tally = tallies.try_reduce(Tally::default, |a, b| Ok(a.and(b)))?;
    if height == 1 {
        positions.x.copy_within(..columns, columns);
        let (first, second) = positions.y.split_at_mut(columns);
        second.iter_mut().zip(first).for_each(|(below, above)| *below = *above + 1.0);
    }
    match tally {
        Tally { first_bad: Some(pixel), bad, .. } => Err(DecodeError::NotFinite { pixel, count: bad }),
        Tally { without_source, .. } if without_source == (width * height) as u64 => Err(DecodeError::NoSource),
        Tally { without_source, .. } => Ok(Decoded { positions, without_source }),
    }
}

/// Pixels that have no position, and those that should.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    without_source: u64,
    bad: u64,
    first_bad: Option<[i64; 2]>,
}

impl Tally {
    /// This one's pixels come first.
    fn and(self, next: Self) -> Self {
        Self {
            without_source: self.without_source + next.without_source,
            bad: self.bad + next.bad,
            first_bad: self.first_bad.or(next.first_bad),
        }
    }

    /// Decodes a row from the pixel `[x0, y]` on.
    fn row(
        &mut self,
        map: &PixelMap,
        [x0, y]: [i64; 2],
        [from_x, from_y]: [&[f32]; 2],
        alpha: Option<&[f32]>,
        xs: &mut [f64],
        ys: &mut [f64],
    ) {
        for i in 0..from_x.len() {
            let coverage = alpha.map_or(1.0, |alpha| alpha[i]);
            if coverage <= 0.0 && coverage.is_finite() {
                self.without_source += 1;
                continue;
            }
            if !(coverage.is_finite() && from_x[i].is_finite() && from_y[i].is_finite()) {
                self.bad += 1;
                self.first_bad = self.first_bad.or(Some([x0 + i as i64, y]));
                continue;
            }
            let center = [(x0 + i as i64) as f64 + 0.5, y as f64 + 0.5];
            [xs[i], ys[i]] = map.position(center, [from_x[i], from_y[i]].map(f64::from));
        }
    }
}
