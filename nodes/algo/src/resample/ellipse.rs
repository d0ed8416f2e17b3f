//! The ellipse that a destination pixel covers in the source, and the weights of the samples in it.
//!
//! A circle around the pixel becomes an ellipse with the semi-axes a >= b, the singular values of the Jacobian, px per
//! pixel. Neither is less than 1, and b is no less than a / 16. A sample at the distance r from the centre, in units
//! of the axes, weighs `(1 - u)^2 (1 - c u)`, u = (r / R)^2 < 1, divided by the sum. R = 5/6 + 2 / 3b: wide where the
//! axis is short, so that the few samples' weights add up evenly, and 8 samples across at b = 4. c gives the kernel the
//! second moment of the pixel itself, 1/12 along both axes: `c = (30 R^2 - 20) / (12 R^2 - 5)`. Of the kernels of this form
//! those came nearest to the mean over the pixel, measured on noise, discs, lines and a zone plate.

use super::spans::Point;
use pulp::bytemuck::cast;
use pulp::f32x8;
use std::ops::Range;

/// The greatest ratio of the axes.
const ECCENTRICITY: f64 = 16.0;
/// Squares of axes up to this are no shrink: far above rounding, and below what a sample of 24 bits shows.
const STILL: f32 = 1.0 + 1.0 / (1 << 20) as f32;
/// A change over from one way of drawing to the next, from a shrink s on, ends at 5/4 s.
const CHANGE: f64 = 0.25;
/// Levels are halved as long as the minor axis is longer than this, px of the level.
pub(super) const LONGEST: f64 = 4.0;

/// The axes of a pixel's ellipse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axes {
    /// Squares of the major and the minor axis, px^2.
    squares: [f32; 2],
    /// Cosine and sine of twice the angle of the major axis.
    twice: [f32; 2],
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
        let squares = [major as f32, minor as f32];
        if !(squares[0].is_finite() && radius > 0.0) {
            let square = if squares[0].is_finite() { squares[0] } else { 1.0 };
            return Self { squares: [square; 2], ..Self::UNIT };
        }
        Self { squares, twice: [(half / radius) as f32, (xy / radius) as f32] }
    }

    /// Longer semi-axis, px.
    pub fn major(&self) -> f64 {
        f64::from(self.squares[0]).sqrt()
    }

    /// Shorter semi-axis, px.
    pub fn minor(&self) -> f64 {
        f64::from(self.squares[1]).sqrt()
    }

    /// Whether there is no shrink, and Cubic stands alone.
    #[inline(always)]
    pub fn is_still(&self) -> bool {
        self.squares[0] <= STILL
    }

    /// The ellipse's share of the value, Cubic has the rest: 0 where nothing shrinks, 1 from 5/4 on.
    #[inline(always)]
    pub fn share(&self) -> f32 {
        match self.squares[0] {
            square if square <= STILL => 0.0,
            square if square >= 25.0 / 16.0 => 1.0,
            square => change(f64::from(square).sqrt()),
        }
    }

    /// The level of a pyramid with `top` halvings to draw at, and its share; the level before it has the rest. The axes
    /// become no longer than the top level can serve.
    #[inline(always)]
    pub fn level(&mut self, top: usize) -> (usize, f32) {
        if f64::from(self.squares[1]) <= LONGEST * LONGEST {
            return (0, 1.0);
        }
        let longest = LONGEST * (1_u64 << top) as f64;
        let minor = self.minor().min(longest);
        self.squares[1] = self.squares[1].min((longest * longest) as f32);
        self.squares[0] = self.squares[0].min(self.squares[1] * (ECCENTRICITY * ECCENTRICITY) as f32);
        let level = (0..top).take_while(|&level| minor > LONGEST * (1_u64 << level) as f64).count();
        if level == 0 { (0, 1.0) } else { (level, change(minor * 2.0 / (LONGEST * (1_u64 << level) as f64))) }
    }
}

/// Rises smoothly from 0 to 1 while `shrink` does from 1 to 5/4.
fn change(shrink: f64) -> f32 {
    let x = ((shrink - 1.0) / CHANGE).clamp(0.0, 1.0);
    (x * x * (3.0 - 2.0 * x)) as f32
}

/// An ellipse in a level of the pyramid, whose pixels are its unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ellipse {
    /// The square of the scaled distance is `along * (x - slope * y)^2 + down * y^2`.
    along: f64,
    slope: f64,
    down: f64,
    /// c of the module's text.
    dip: f32,
    /// Half the width and the height of its bounding box.
    reach: [f64; 2],
}

impl Ellipse {
    /// `flip`: mirrored along one axis. A level's samples are means of squares already, which the axes leave out.
    #[inline(always)]
    pub fn new(axes: &Axes, level: usize, flip: bool) -> Self {
        let scale = 1.0 / (1_u64 << (2 * level)) as f64;
        let [major, minor] = axes.squares.map(|square| (f64::from(square) * scale - (1.0 - scale)).max(1.0));
        let [cos, sin] = axes.twice.map(f64::from);
        let (mean, half) = (0.5 * (major + minor), 0.5 * (major - minor));
        let (xx, yy) = (mean + half * cos, mean - half * cos);
        let xy = if flip { -half * sin } else { half * sin };
        let radius = 5.0 / 6.0 + 2.0 / 3.0 / minor.sqrt();
        let square = radius * radius;
        Self {
            along: yy / (major * minor * square),
            slope: xy / yy,
            down: 1.0 / (yy * square),
            dip: ((30.0 * square - 20.0) / (12.0 * square - 5.0)) as f32,
            reach: [radius * xx.sqrt(), radius * yy.sqrt()],
        }
    }

    /// Whether it holds at most [`LANES`] samples of a row; one more at the very border has next to no weight.
    #[inline(always)]
    fn is_narrow(&self) -> bool {
        2.0 * self.reach[0] < LANES as f64 + 1e-3
    }

    /// The weights of samples that lie `x` and `y` from the centre.
    #[inline(always)]
    fn weigh<S: Eight>(&self, simd: S, x: f32x8, y: f32) -> f32x8 {
        let (along, base) = (simd.splat_f32s(self.along as f32), simd.splat_f32s(self.down as f32 * y * y));
        let x = simd.sub_f32s(x, simd.splat_f32s(self.slope as f32 * y));
        let u = simd.add_f32s(base, simd.mul_f32s(along, simd.mul_f32s(x, x)));
        let one = simd.splat_f32s(1.0);
        let t = simd.max_f32s(simd.sub_f32s(one, u), simd.splat_f32s(0.0));
        let dip = simd.sub_f32s(one, simd.mul_f32s(simd.splat_f32s(self.dip), u));
        simd.mul_f32s(simd.mul_f32s(t, t), dip)
    }
}

/// Samples that are weighed together; runs are filled up to a multiple of it.
pub(super) const LANES: usize = 8;

/// A processor's way to compute with eight samples; all give the same bits.
pub(super) trait Eight: pulp::Simd<f32s = f32x8> {}
impl<S: pulp::Simd<f32s = f32x8>> Eight for S {}

/// 0, 1, .. from `start` on.
#[inline(always)]
fn counted<S: Eight>(simd: S, start: f32) -> f32x8 {
    simd.add_f32s(simd.splat_f32s(start), f32x8(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0))
}

/// Neighbours in a row that have weight.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Run {
    pub row: i32,
    /// The first one's column.
    pub first: i32,
    /// Groups of [`LANES`].
    pub groups: usize,
}

/// The weights of a pixel's samples.
#[derive(Debug, Default)]
pub(super) struct Weights {
    pub runs: Vec<Run>,
    /// Those of all runs, one after the other.
    pub groups: Vec<[f32; LANES]>,
    /// Of all weights; positive.
    pub sum: f32,
    /// The least column and the end of all runs.
    columns: [i32; 2],
}

impl Weights {
    /// Weighs the samples around `center`, px from the corner of the picture.
    #[inline(always)]
    pub fn lay<S: Eight>(&mut self, simd: S, ellipse: &Ellipse, center: Point) {
        // Pixel i has its centre at i + 1/2.
        let [x, y] = [center[0] - 0.5, center[1] - 0.5];
        let [width, height] = ellipse.reach;
        let [left, right] = [(x - width).ceil() as i32, (x + width).floor() as i32];
        let [top, bottom] = [(y - height).ceil() as i32, (y + height).floor() as i32];
        self.columns = [left, right + 1];
        self.sum = if ellipse.is_narrow() {
            self.columns[1] = left + LANES as i32;
            self.lay_narrow(simd, ellipse, [x, y], left, top..bottom + 1)
        } else {
            self.lay_wide(simd, ellipse, [x, y], top..bottom + 1)
        };
    }

    /// Rows of one group each.
    #[inline(always)]
    fn lay_narrow<S: Eight>(&mut self, simd: S, ellipse: &Ellipse, [x, y]: Point, first: i32, rows: Range<i32>) -> f32 {
        self.runs.clear();
        self.runs.extend(rows.map(|row| Run { row, first, groups: 1 }));
        self.groups.resize(self.runs.len(), [0.0; LANES]);
        let start = (f64::from(first) - x) as f32;
        let across = counted(simd, start);
        let mut sums = simd.splat_f32s(0.0);
        for (run, group) in self.runs.iter().zip(&mut self.groups) {
            let weights = ellipse.weigh(simd, across, (f64::from(run.row) - y) as f32);
            sums = simd.add_f32s(sums, weights);
            *group = cast(weights);
        }
        total(cast(sums))
    }

    /// Rows as long as they are in the ellipse.
    #[inline(always)]
    fn lay_wide<S: Eight>(&mut self, simd: S, ellipse: &Ellipse, [x, y]: Point, rows: Range<i32>) -> f32 {
        self.runs.clear();
        self.groups.clear();
        let width = 1.0 / ellipse.along;
        let mut sums = simd.splat_f32s(0.0);
        for row in rows {
            let dy = f64::from(row) - y;
            let half = (width * (1.0 - ellipse.down * dy * dy).max(0.0)).sqrt();
            let middle = x + ellipse.slope * dy;
            let (first, last) = ((middle - half).ceil() as i32, (middle + half).floor() as i32);
            if last < first {
                continue;
            }
            let groups = ((last - first) as usize + LANES) / LANES;
            self.runs.push(Run { row, first, groups });
            self.columns = [self.columns[0].min(first), self.columns[1].max(first + (groups * LANES) as i32)];
            let start = (f64::from(first) - x) as f32;
            for group in 0..groups {
                let from = start + (group * LANES) as f32;
                let weights = ellipse.weigh(simd, counted(simd, from), dy as f32);
                sums = simd.add_f32s(sums, weights);
                self.groups.push(cast(weights));
            }
        }
        total(cast(sums))
    }

    /// Whether all runs lie in a picture of this size.
    #[inline(always)]
    pub fn lie_in(&self, width: usize, height: usize) -> bool {
        let (Some(first), Some(last)) = (self.runs.first(), self.runs.last()) else { return false };
        first.row >= 0 && (last.row as usize) < height && self.columns[0] >= 0 && self.columns[1] as usize <= width
    }
}

/// A patch of a picture's planes, as many as are weighed together.
#[derive(Clone, Copy)]
pub(super) struct Patch<'a, const P: usize> {
    /// All of one size and stride.
    pub planes: [&'a [f32]; P],
    pub stride: usize,
    pub size: [usize; 2],
}

impl<const P: usize> Patch<'_, P> {
    /// What [`Weights`] of one group per row give, at once: the weighted means, if the rows lie inside and all samples
    /// read are finite. The count of rows is the ellipse's alone, so that it is foreseen from pixel to pixel.
    #[inline(always)]
    pub fn means<S: Eight>(&self, simd: S, ellipse: &Ellipse, center: Point) -> Option<[f32; P]> {
        let [x, y] = [center[0] - 0.5, center[1] - 0.5];
        let [width, height] = ellipse.reach;
        if !ellipse.is_narrow() {
            return None;
        }
        let (first, top, rows) = ((x - width).ceil(), (y - height).ceil(), (2.0 * height) as usize + 1);
        let inside = (first >= 0.0) & (top >= 0.0) & (first as usize + LANES <= self.size[0]);
        if !(inside & (top as usize + rows <= self.size[1])) {
            return None;
        }
        let across = counted(simd, (first - x) as f32);
        let mut at = top as usize * self.stride + first as usize;
        let (mut sum, mut sums) = (simd.splat_f32s(0.0), [simd.splat_f32s(0.0); P]);
        for row in 0..rows {
            let weights = ellipse.weigh(simd, across, (top + row as f64 - y) as f32);
            sum = simd.add_f32s(sum, weights);
            for plane in 0..P {
                let samples: [f32; LANES] = *self.planes[plane][at..].first_chunk().expect("the row lies inside");
                sums[plane] = simd.add_f32s(sums[plane], simd.mul_f32s(weights, cast(samples)));
            }
            at += self.stride;
        }
        let sum = total(cast(sum));
        let means = sums.map(|sums| total(cast(sums)) / sum + 0.0);
        means.iter().all(|mean| mean.is_finite()).then_some(means)
    }
}

/// The sum of the lanes, halves first.
#[inline(always)]
pub(super) fn total(lanes: [f32; LANES]) -> f32 {
    let fours: [f32; 4] = std::array::from_fn(|i| lanes[i] + lanes[i + 4]);
    (fours[0] + fours[2]) + (fours[1] + fours[3])
}
