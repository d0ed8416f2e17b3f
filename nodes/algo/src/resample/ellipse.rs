//! The ellipse that a destination pixel covers in the source, and the weights of the samples in it.
//!
//! A circle around the pixel becomes an ellipse with the semi-axes a >= b, the singular values of the Jacobian, px per
//! pixel. Neither is less than 1, and b is no less than a / 16. A sample at the distance r from the centre, in units
//! of the axes, weighs `(1 - u)^2 (1 - c u)`, u = (r / R)^2 < 1, divided by the sum. R = 5/6 + 2 / 3b: wide where the
//! axis is short, so that the few samples' weights add up evenly, and 8 samples across at b = 4. c gives the kernel the
//! second moment of the pixel itself, 1/12 along both axes: `c = (30 R^2 - 20) / (12 R^2 - 5)`. Of the kernels of this form
//! those came nearest to the mean over the pixel, measured on noise, discs, lines and a zone plate.

use super::axes::Axes;
use super::lanes::{LANES, Lanes, TWICE};
use super::spans::Point;
use std::ops::Range;

/// An ellipse in a level of the pyramid, whose pixels are its unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ellipse {
    /// The square of the scaled distance is `along * (x - slope * y)^2 + down * y^2`.
    along: f32,
    slope: f32,
    down: f32,
    /// c of the module's text.
    dip: f32,
    /// Half the width and the height of its bounding box.
    reach: [f32; 2],
}

impl Ellipse {
    /// `grown`: how much smaller than 2^level px the level's pixels are. They are means of squares already, which the axes
    /// leave out.
    #[inline(always)]
    pub fn new(axes: &Axes, level: usize, grown: [f32; 2]) -> Self {
        let scale = 1.0 / (1_u64 << (2 * level)) as f32;
        let [major, minor] = axes.squares.map(|square| (square * scale - (1.0 - scale)).max(1.0));
        let [cos, sin] = axes.twice;
        let (mean, half) = (0.5 * (major + minor), 0.5 * (major - minor));
        let [xx, yy] = [(mean + half * cos) * (grown[0] * grown[0]), (mean - half * cos) * (grown[1] * grown[1])];
        let (xy, area) = (half * sin * (grown[0] * grown[1]), grown[0] * grown[1]);
        let radius = 5.0 / 6.0 + 2.0 / 3.0 / minor.sqrt();
        let square = radius * radius;
        let per_yy = 1.0 / yy;
        let down = per_yy / square;
        Self {
            along: yy / (major * minor * (area * area) * square),
            slope: xy * per_yy,
            down,
            dip: (30.0 * square - 20.0) / (12.0 * square - 5.0),
            reach: [radius * xx.sqrt(), radius * yy.sqrt()],
        }
    }

    /// Whether it holds at most [`LANES`] samples of a row; one more at the very border has next to no weight.
    #[inline(always)]
    pub fn is_narrow(&self) -> bool {
        2.0 * self.reach[0] < LANES as f32 + 1e-3
    }

    /// Half the width and the height of its bounding box.
    #[inline(always)]
    pub fn reach(&self) -> Point {
        self.reach.map(f64::from)
    }

    /// Rows that hold samples, the first at the top of its bounding box, if it is narrow.
    #[inline(always)]
    pub fn rows(&self) -> i32 {
        (2.0 * self.reach[1]) as i32 + 1
    }

    /// Its weights around a sample that lies `x` and `y` from the centre.
    #[inline(always)]
    pub fn spot(&self, x: f64, y: f64) -> Spot {
        Spot {
            along: self.along,
            slope: self.slope,
            down: self.down,
            dip: self.dip,
            x: x as f32,
            y: y as f32,
        }
    }
}

/// An ellipse around its centre, seen from a sample.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spot {
    pub along: f32,
    pub slope: f32,
    pub down: f32,
    pub dip: f32,
    /// Where the sample lies from the centre.
    pub x: f32,
    pub y: f32,
}

/// Columns and rows of the samples weighed together, [`LANES`] of two rows.
const ACROSS: [f32; TWICE] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
const DOWN: [f32; TWICE] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];

impl Spot {
    /// The weights of samples `x` and `y` from the centre.
    #[inline(always)]
    fn weigh<L: Lanes>(&self, lanes: L, x: L::Two, y: L::Two) -> L::Two {
        let x = lanes.sub(x, lanes.mul(lanes.splat(self.slope), y));
        let base = lanes.mul(lanes.splat(self.down), lanes.mul(y, y));
        let u = lanes.add(base, lanes.mul(lanes.splat(self.along), lanes.mul(x, x)));
        let one = lanes.splat(1.0);
        let t = lanes.max(lanes.sub(one, u), lanes.splat(0.0));
        let dip = lanes.sub(one, lanes.mul(lanes.splat(self.dip), u));
        lanes.mul(lanes.mul(t, t), dip)
    }

    /// Tells `each` the weights of two rows of [`LANES`] samples at a time, from the first on. Returns their sums.
    #[inline(always)]
    fn narrow<L: Lanes>(&self, lanes: L, rows: usize, mut each: impl FnMut(usize, L::Two)) -> L::Two {
        let x = lanes.add(lanes.splat(self.x), lanes.load(&ACROSS));
        let y = lanes.add(lanes.splat(self.y), lanes.load(&DOWN));
        let mut sums = lanes.splat(0.0);
        for row in (0..rows).step_by(2) {
            let weights = self.weigh(lanes, x, lanes.add(y, lanes.splat(row as f32)));
            sums = lanes.add(sums, weights);
            each(row, weights);
        }
        sums
    }

    /// The weighted sums of `rows` rows of [`LANES`] pixels, `stride` apart in `pixels`, and those of the weights; to be
    /// added up by [`means`].
    #[inline(always)]
    pub fn sums<L: Lanes>(&self, lanes: L, rows: usize, pixels: &[[f32; 4]], stride: usize) -> [L::Two; 2] {
        let mut sums = [lanes.splat(0.0); 2];
        let mut add = |row: usize, spread: [L::Two; 2]| {
            let samples: &[[f32; 4]; LANES] = pixels[row * stride..].first_chunk().expect("the block holds the rows");
            let samples = samples.as_flattened().as_chunks().0;
            for half in 0..2 {
                sums[half] = lanes.add(sums[half], lanes.mul(spread[half], lanes.load(&samples[half])));
            }
        };
        let weights = self.narrow(
            lanes,
            rows,
            #[inline(always)]
            |row, weights| {
                add(row, [lanes.spread::<0>(weights), lanes.spread::<1>(weights)]);
                if row + 1 < rows {
                    add(row + 1, [lanes.spread::<2>(weights), lanes.spread::<3>(weights)]);
                }
            },
        );
        [lanes.add(sums[0], sums[1]), weights]
    }
}

/// The means of four pixels, four channels each, by their [`Spot::sums`]; NaN without weights.
#[inline(always)]
pub(super) fn means<L: Lanes>(lanes: L, [a, b, c, d]: [[L::Two; 2]; 4]) -> [[f32; 4]; 4] {
    let sums = lanes.quarters([a[0], b[0], c[0], d[0]]);
    let weights = lanes.quarters([a[1], b[1], c[1], d[1]]);
    let means = lanes.div(sums, lanes.total(weights));
    // Never minus zero.
    let means = lanes.store(lanes.add(means, lanes.splat(0.0)));
    pulp::bytemuck::cast(means)
}

/// The sum of all lanes: of both groups', halves first.
#[inline(always)]
fn total<L: Lanes>(lanes: L, two: L::Two) -> f32 {
    lanes.store(lanes.total(lanes.quarters([two; 4])))[0]
}

/// The sum of a group's lanes, halves first.
#[inline(always)]
pub(super) fn group_total(lanes: [f32; LANES]) -> f32 {
    let fours: [f32; 4] = std::array::from_fn(|i| lanes[i] + lanes[i + 4]);
    (fours[0] + fours[2]) + (fours[1] + fours[3])
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
    pub fn lay<L: Lanes>(&mut self, lanes: L, ellipse: &Ellipse, center: Point) {
        // Pixel i has its centre at i + 1/2.
        let [x, y] = [center[0] - 0.5, center[1] - 0.5];
        let [width, height] = ellipse.reach();
        let [left, right] = [(x - width).ceil() as i32, (x + width).floor() as i32];
        let top = (y - height).ceil() as i32;
        self.runs.clear();
        self.groups.clear();
        self.columns = [left, right + 1];
        self.sum = if ellipse.is_narrow() {
            self.columns[1] = left + LANES as i32;
            self.lay_narrow(lanes, ellipse, [x, y], left, top..top + ellipse.rows())
        } else {
            self.lay_wide(lanes, ellipse, [x, y], top..(y + height).floor() as i32 + 1)
        };
    }

    /// Rows of one group each.
    #[inline(always)]
    fn lay_narrow<L: Lanes>(&mut self, lanes: L, ellipse: &Ellipse, at: Point, first: i32, rows: Range<i32>) -> f32 {
        let spot = ellipse.spot(f64::from(first) - at[0], f64::from(rows.start) - at[1]);
        self.runs.extend(rows.map(|row| Run { row, first, groups: 1 }));
        let groups = &mut self.groups;
        let sums = spot.narrow(
            lanes,
            self.runs.len(),
            #[inline(always)]
            |_, weights| groups.extend_from_slice(lanes.store(weights).as_chunks().0),
        );
        self.groups.truncate(self.runs.len());
        total(lanes, sums)
    }

    /// Rows as long as they are in the ellipse.
    #[inline(always)]
    fn lay_wide<L: Lanes>(&mut self, lanes: L, ellipse: &Ellipse, [x, y]: Point, rows: Range<i32>) -> f32 {
        let (width, slope, down) = (1.0 / f64::from(ellipse.along), f64::from(ellipse.slope), f64::from(ellipse.down));
        let mut sums = lanes.splat(0.0);
        let across: [f32; TWICE] = std::array::from_fn(|i| i as f32);
        for row in rows {
            let dy = f64::from(row) - y;
            let half = (width * (1.0 - down * dy * dy).max(0.0)).sqrt();
            let middle = x + slope * dy;
            let (first, last) = ((middle - half).ceil() as i32, (middle + half).floor() as i32);
            if last < first {
                continue;
            }
            let groups = ((last - first) as usize + LANES) / LANES;
            self.runs.push(Run { row, first, groups });
            self.columns = [self.columns[0].min(first), self.columns[1].max(first + (groups * LANES) as i32)];
            let spot = ellipse.spot(f64::from(first) - x, dy);
            let start = self.groups.len();
            for group in (0..groups).step_by(2) {
                let from = spot.x + (group * LANES) as f32;
                let weights = spot.weigh(lanes, lanes.add(lanes.splat(from), lanes.load(&across)), lanes.splat(spot.y));
                sums = lanes.add(sums, weights);
                self.groups.extend_from_slice(lanes.store(weights).as_chunks().0);
            }
            self.groups.truncate(start + groups);
        }
        total(lanes, sums)
    }

    /// Whether all runs lie in a picture of this size.
    #[inline(always)]
    pub fn lie_in(&self, width: usize, height: usize) -> bool {
        let (Some(first), Some(last)) = (self.runs.first(), self.runs.last()) else { return false };
        first.row >= 0 && (last.row as usize) < height && self.columns[0] >= 0 && self.columns[1] as usize <= width
    }
}
