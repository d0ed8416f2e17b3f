//! The axes of the ellipses that pixels cover in the source, and the levels of the pyramid to draw them at.

use super::block::Pixels;
use super::spans::Point;
use std::ops::Range;

/// The greatest ratio of the axes.
const ECCENTRICITY: f64 = 16.0;
/// Squares of axes up to this are no shrink: far above rounding, and below what a sample of 24 bits shows.
const STILL: f32 = 1.0 + 1.0 / (1 << 20) as f32;
/// A change over from one way of drawing to the next, from a shrink s on, ends at 5/4 s.
const CHANGE: f32 = 0.25;

/// The axes of a pixel's ellipse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axes {
    /// Squares of the major and the minor axis, px^2.
    pub squares: [f32; 2],
    /// Cosine and sine of twice the angle of the major axis.
    pub twice: [f32; 2],
}

impl Axes {
    /// Nothing shrinks.
    pub const UNIT: Self = Self { squares: [1.0; 2], twice: [1.0, 0.0] };

    /// Of the Jacobian with columns `e` and `f`; where that is not finite nothing shrinks.
    #[inline(always)]
    pub fn of([e, f]: [Point; 2]) -> Self {
        let (xx, xy, yy) = (e[0] * e[0] + f[0] * f[0], e[0] * e[1] + f[0] * f[1], e[1] * e[1] + f[1] * f[1]);
        let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let radius = (half * half + xy * xy).sqrt();
        let det = e[0] * f[1] - e[1] * f[0];
        let major = (mean + radius).max(1.0);
        let minor = (det * det / major).max(major / (ECCENTRICITY * ECCENTRICITY)).max(1.0).min(major);
        // Selected, not branched on, so that a row's are computed side by side.
        let finite = (major as f32).is_finite();
        let round = !(finite & (radius > 0.0));
        let (major, minor) = if finite { (major as f32, minor as f32) } else { (1.0, 1.0) };
        let minor = if round { major } else { minor };
        let turn = if round { 1.0 } else { 1.0 / radius };
        let [cos, sin] = if round { [1.0, 0.0] } else { [half * turn, xy * turn] };
        Self { squares: [major, minor], twice: [cos as f32, sin as f32] }
    }

    /// Longer semi-axis, px.
    pub fn major(&self) -> f64 {
        f64::from(self.squares[0]).sqrt()
    }

    /// Shorter semi-axis, px.
    pub fn minor(&self) -> f64 {
        f64::from(self.squares[1]).sqrt()
    }
}

/// From which minor axis on, px, a level is drawn. Where halving starts four samples lie side by side in the level at
/// least; later levels start where three do in the level before.
fn start(level: usize) -> f64 {
    if level == 1 { 4.0 } else { 1.5 * (1_u64 << level) as f64 }
}

/// The levels to draw at up to a minor axis, px, of a pyramid of `most`: the last one, and the first one if no minor axis is
/// shorter than the given one.
pub(super) fn levels(minor: f64, most: usize) -> [usize; 2] {
    let last = (1..=most).take_while(|&level| minor > start(level)).count();
    let mixes = last > 0 && change((minor / start(last)) as f32) < 1.0;
    [if mixes { last - 1 } else { last }, last]
}

/// Rises smoothly from 0 to 1 while `shrink` does from 1 to 5/4.
#[inline(always)]
fn change(shrink: f32) -> f32 {
    let x = ((shrink - 1.0) / CHANGE).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// The axes of a tile's pixels, row-major, and the levels they are drawn at.
#[derive(Debug, Default)]
pub(super) struct Shapes {
    squares: [Vec<f32>; 2],
    twice: [Vec<f32>; 2],
    /// The level to draw at and the one before it, that has the rest where its part is not 1; else the same.
    pub levels: [Vec<i32>; 2],
    pub part: Vec<f32>,
}

impl Shapes {
    /// Room for the pixels of a tile.
    pub fn resize(&mut self, count: usize) {
        for values in self.squares.iter_mut().chain(&mut self.twice).chain([&mut self.part]) {
            values.resize(count, 1.0);
        }
        self.levels.iter_mut().for_each(|levels| levels.resize(count, 0));
    }

    #[inline(always)]
    pub fn axes(&self, i: usize) -> Axes {
        Axes { squares: [self.squares[0][i], self.squares[1][i]], twice: [self.twice[0][i], self.twice[1][i]] }
    }

    #[inline(always)]
    pub fn set(&mut self, i: usize, axes: Axes) {
        for axis in 0..2 {
            (self.squares[axis][i], self.twice[axis][i]) = (axes.squares[axis], axes.twice[axis]);
        }
    }

    /// Major and minor axes, cosines and sines of a range of pixels.
    #[inline(always)]
    pub fn rows(&self, pixels: Range<usize>) -> [&[f32]; 4] {
        let [major, minor] = self.squares.each_ref().map(|values| &values[pixels.clone()]);
        let [cos, sin] = self.twice.each_ref().map(|values| &values[pixels.clone()]);
        [major, minor, cos, sin]
    }

    /// As [`Self::rows`], to be set.
    #[inline(always)]
    pub fn rows_mut(&mut self, pixels: Range<usize>) -> [&mut [f32]; 4] {
        let [major, minor] = self.squares.each_mut().map(|values| &mut values[pixels.clone()]);
        let [cos, sin] = self.twice.each_mut().map(|values| &mut values[pixels.clone()]);
        [major, minor, cos, sin]
    }

    /// Whether nothing shrinks anywhere, and Cubic stands alone.
    pub fn are_still(&self) -> bool {
        self.squares[0].iter().all(|&square| square <= STILL)
    }

    /// Whether Cubic has a part somewhere.
    pub fn mix(&self) -> bool {
        self.mix_in(0..self.part.len())
    }

    /// Whether Cubic has a part in some of these pixels.
    #[inline(always)]
    pub fn mix_in(&self, pixels: Range<usize>) -> bool {
        self.squares[0][pixels].iter().fold(false, |some, &square| some | (square < 25.0 / 16.0))
    }

    /// The ellipse's share of the value, Cubic has the rest: 0 where nothing shrinks, 1 from 5/4 on.
    #[inline(always)]
    pub fn share(&self, i: usize) -> f32 {
        match self.squares[0][i] {
            square if square <= STILL => 0.0,
            square if square >= 25.0 / 16.0 => 1.0,
            square => change(square.sqrt()),
        }
    }

    /// Says at which of a pyramid's levels to draw: the source itself, or one of `lowest..=top`. The axes become no longer
    /// than the top level can serve.
    #[inline(always)]
    pub fn choose(&mut self, [lowest, top]: [usize; 2]) {
        let longest = start(top + 1);
        let [majors, minors] = &mut self.squares;
        for (major, minor) in majors.iter_mut().zip(minors) {
            *minor = minor.min((longest * longest) as f32);
            *major = major.min(*minor * (ECCENTRICITY * ECCENTRICITY) as f32);
        }
        let [levels, before] = &mut self.levels;
        for values in [&mut *levels, &mut *before] {
            values.fill(0);
        }
        self.part.fill(1.0);
        for level in lowest.max(1)..=top {
            let (from, square) = (start(level) as f32, (start(level) * start(level)) as f32);
            let finer = if level > lowest.max(1) { level as i32 - 1 } else { 0 };
            let pixels = levels.iter_mut().zip(&mut *before).zip(&mut self.part);
            for (((at, before), part), &minor) in pixels.zip(&self.squares[1]) {
                let here = minor > square;
                *at = if here { level as i32 } else { *at };
                *before = if here { finer } else { *before };
                *part = if here { change(minor.sqrt() / from) } else { *part };
            }
        }
        for (before, (&level, &part)) in before.iter_mut().zip(levels.iter().zip(&self.part)) {
            *before = if part < 1.0 { *before } else { level };
        }
    }

    /// The levels that some of a tile's pixels are drawn at, a bit each.
    #[inline(always)]
    pub fn used(&self, width: usize, pixels: &Pixels) -> u32 {
        let mut used = 0;
        for row in pixels.rows.clone() {
            for levels in &self.levels {
                for level in &levels[row * width + pixels.columns.start..row * width + pixels.columns.end] {
                    used |= 1 << level;
                }
            }
        }
        used
    }
}
