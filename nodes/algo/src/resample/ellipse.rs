//! The ellipse that a destination pixel covers in the source, and the weights of the samples in it.
//!
//! A circle around the pixel becomes an ellipse with the semi-axes a >= b, the singular values of the Jacobian, px per
//! pixel. Neither is less than 1, and b is no less than a / 16. A sample at the distance r from the centre, in units
//! of the axes, weighs `(1 - u)^2 (1 - c u)`, u = (r / R)^2 < 1, divided by the sum. R = 1 + 1 / 2b: half a source pixel
//! is added to the minor axis, which keeps the weights' sum even where the axis is short. c gives the kernel
//! the second moment of the pixel itself, 1/12 along both axes: `c = (5 - 20 e) / (2 - 5 e)`, e = 1 / 6 R^2.

use super::spans::Point;

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
        if self.is_still() { 0.0 } else { change(self.major()) }
    }

    /// The level of a pyramid with `top` halvings to draw at, and its share; the level before it has the rest. The axes
    /// become no longer than the top level can serve.
    pub fn level(&mut self, top: usize) -> (usize, f32) {
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
}

impl Ellipse {
    /// `flip`: mirrored along one axis. A level's samples are means of squares already, which the axes leave out.
    pub fn new(axes: &Axes, level: usize, flip: bool) -> Self {
        let scale = 1.0 / (1_u64 << (2 * level)) as f64;
        let [major, minor] = axes.squares.map(|square| (f64::from(square) * scale - (1.0 - scale)).max(1.0));
        let [cos, sin] = axes.twice.map(f64::from);
        let (mean, half) = (0.5 * (major + minor), 0.5 * (major - minor));
        let (xy, yy) = (if flip { -half * sin } else { half * sin }, mean - half * cos);
        let radius = 1.0 + 0.5 / minor.sqrt();
        let square = radius * radius;
        let e = 1.0 / (6.0 * square);
        Self {
            along: yy / (major * minor * square),
            slope: xy / yy,
            down: 1.0 / (yy * square),
            dip: ((5.0 - 20.0 * e) / (2.0 - 5.0 * e)) as f32,
        }
    }
}

/// Samples that are weighed together; runs are filled up to a multiple of it.
pub(super) const LANES: usize = 8;

/// Neighbours in a row that have weight.
#[derive(Clone, Copy, Debug)]
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
}

impl Weights {
    /// Weighs the samples around `center`, px from the corner of the picture.
    #[inline(always)]
    pub fn lay(&mut self, ellipse: &Ellipse, center: Point) {
        self.runs.clear();
        self.groups.clear();
        let Ellipse { along, slope, down, dip } = *ellipse;
        let (reach, width) = ((1.0 / down).sqrt(), 1.0 / along);
        // Pixel i has its centre at i + 1/2.
        let [x, y] = [center[0] - 0.5, center[1] - 0.5];
        let mut sums = [0.0; LANES];
        for row in (y - reach).ceil() as i32..=(y + reach).floor() as i32 {
            let dy = f64::from(row) - y;
            let base = down * dy * dy;
            let half = (width * (1.0 - base).max(0.0)).sqrt();
            let middle = x + slope * dy;
            let (first, last) = ((middle - half).ceil() as i32, (middle + half).floor() as i32);
            if last < first {
                continue;
            }
            let groups = ((last - first) as usize + LANES) / LANES;
            self.runs.push(Run { row, first, groups });
            let (start, along, base) = ((f64::from(first) - middle) as f32, along as f32, base as f32);
            for group in 0..groups {
                let from = start + (group * LANES) as f32;
                let weights: [f32; LANES] = std::array::from_fn(|lane| {
                    let dx = from + lane as f32;
                    let u = base + along * dx * dx;
                    let t = if u < 1.0 { 1.0 - u } else { 0.0 };
                    t * t * (1.0 - dip * u)
                });
                for lane in 0..LANES {
                    sums[lane] += weights[lane];
                }
                self.groups.push(weights);
            }
        }
        self.sum = total(sums);
    }
}

/// The sum of the lanes, halves first.
#[inline(always)]
pub(super) fn total(lanes: [f32; LANES]) -> f32 {
    let fours: [f32; 4] = std::array::from_fn(|i| lanes[i] + lanes[i + 4]);
    (fours[0] + fours[2]) + (fours[1] + fours[3])
}
