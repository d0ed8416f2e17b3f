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
use super::whole::floored;

/// What of an ellipse's width and height has next to no weight.
const BORDER: f32 = 1e-3;

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

    /// Whether it holds at most [`LANES`] samples of a row, but for the [`BORDER`].
    #[inline(always)]
    pub fn is_narrow(&self) -> bool {
        2.0 * self.reach[0] < LANES as f32 + BORDER
    }

    /// Half the width and the height of its bounding box.
    #[inline(always)]
    pub fn reach(&self) -> Point {
        self.reach.map(f64::from)
    }

    /// Columns read, from the first of its bounding box on.
    #[inline(always)]
    pub fn width(&self) -> i32 {
        if self.is_narrow() { LANES as i32 } else { floored(2.0 * self.reach[0]) + 1 + TWICE as i32 }
    }

    /// Rows that hold samples, but for the [`BORDER`], from the first of its bounding box on.
    #[inline(always)]
    pub fn rows(&self) -> i32 {
        floored(2.0 * self.reach[1] - BORDER) + 1
    }

    /// Its weights around a sample that lies `x` and `y` from the centre.
    #[inline(always)]
    pub fn spot(&self, x: f64, y: f64) -> Spot {
        Spot { along: self.along, slope: self.slope, down: self.down, dip: self.dip, x: x as f32, y: y as f32 }
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
const ALONG: [f32; TWICE] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];

impl Spot {
    /// The weights of samples, by their [`Self::rest`].
    #[inline(always)]
    fn weigh<L: Lanes>(&self, lanes: L, rest: L::Two) -> L::Two {
        // With t = 1 - u, 1 - c u is 1 - c + c t.
        let t = lanes.max(rest, lanes.splat(0.0));
        let dip = lanes.mul_add(lanes.splat(self.dip), t, lanes.splat(1.0 - self.dip));
        lanes.mul(lanes.mul(t, t), dip)
    }

    /// One less the squares of the scaled distances of samples `across`, the part of x that y leaves, and `y` from the
    /// centre.
    #[inline(always)]
    fn rest<L: Lanes>(&self, lanes: L, across: L::Two, y: L::Two) -> L::Two {
        let rest = lanes.mul_add(lanes.splat(-self.down), lanes.mul(y, y), lanes.splat(1.0));
        lanes.mul_add(lanes.splat(-self.along), lanes.mul(across, across), rest)
    }

    /// Tells `each` the weights of a narrow ellipse, two rows of [`LANES`] samples at a time, from the first sample on.
    /// Returns their sums.
    #[inline(always)]
    fn narrow<L: Lanes>(&self, lanes: L, rows: usize, mut each: impl FnMut(usize, L::Two)) -> L::Two {
        let x = lanes.add(lanes.splat(self.x), lanes.load(&ACROSS));
        let y = lanes.add(lanes.splat(self.y), lanes.load(&DOWN));
        let across = lanes.mul_add(lanes.splat(-self.slope), y, x);
        // A quadratic of the row: its second difference, two rows on, is the same everywhere.
        let mut rest = self.rest(lanes, across, y);
        let tilt = lanes.mul(lanes.splat(4.0 * self.along * self.slope), lanes.sub(across, lanes.splat(self.slope)));
        let mut step = lanes.mul_add(lanes.splat(-4.0 * self.down), lanes.add(y, lanes.splat(1.0)), tilt);
        let bend = lanes.splat(-8.0 * (self.along * self.slope * self.slope + self.down));
        let mut sums = lanes.splat(0.0);
        for row in (0..rows).step_by(2) {
            let weights = self.weigh(lanes, rest);
            (rest, step) = (lanes.add(rest, step), lanes.add(step, bend));
            sums = lanes.add(sums, weights);
            each(row, weights);
        }
        sums
    }

    /// Tells `each` the weights of a wide ellipse, row by row of those that lie in it, twice [`LANES`] at a time or what is
    /// left: the row, the first column, from the first sample on, and the samples left. Returns their sums.
    #[inline(always)]
    fn wide<L: Lanes>(&self, lanes: L, rows: usize, mut each: impl FnMut(usize, usize, usize, L::Two)) -> L::Two {
        let mut sums = lanes.splat(0.0);
        for row in 0..rows {
            let y = self.y + row as f32;
            let half = ((1.0 - self.down * y * y).max(0.0) / self.along).sqrt();
            let middle = self.slope * y - self.x;
            let (first, last) = ((middle - half).ceil().max(0.0), (middle + half).floor());
            let count = (last - first + 1.0) as usize;
            for start in (0..count).step_by(TWICE) {
                let from = lanes.splat(self.x + (first + start as f32));
                let across = lanes.sub(lanes.add(from, lanes.load(&ALONG)), lanes.splat(self.slope * y));
                let weights = self.weigh(lanes, self.rest(lanes, across, lanes.splat(y)));
                sums = lanes.add(sums, weights);
                each(row, first as usize + start, count - start, weights);
            }
        }
        sums
    }

    /// The weighted sums of the ellipse's pixels, and those of the weights, to be added up by [`means`]. `pixels` lie
    /// around it in rows `stride` apart, its first sample first; those of a wide one as far as [`Ellipse::width`] says.
    #[inline(always)]
    pub fn sums<L: Lanes>(
        &self,
        lanes: L,
        is_narrow: bool,
        rows: usize,
        pixels: &[[f32; 4]],
        stride: usize,
    ) -> [L::Two; 2] {
        let mut sums = [lanes.splat(0.0); 2];
        let weights = if is_narrow {
            self.narrow(
                lanes,
                rows,
                #[inline(always)]
                |row, weights| {
                    add(
                        lanes,
                        &mut sums,
                        &pixels[row * stride..],
                        [lanes.spread::<0>(weights), lanes.spread::<1>(weights)],
                    );
                    if row + 1 < rows {
                        add(
                            lanes,
                            &mut sums,
                            &pixels[(row + 1) * stride..],
                            [lanes.spread::<2>(weights), lanes.spread::<3>(weights)],
                        );
                    }
                },
            )
        } else {
            self.wide(
                lanes,
                rows,
                #[inline(always)]
                |row, column, left, weights| {
                    let at = row * stride + column;
                    add(lanes, &mut sums, &pixels[at..], [lanes.spread::<0>(weights), lanes.spread::<1>(weights)]);
                    if left > LANES {
                        add(
                            lanes,
                            &mut sums,
                            &pixels[at + LANES..],
                            [lanes.spread::<2>(weights), lanes.spread::<3>(weights)],
                        );
                    }
                },
            )
        };
        [lanes.add(sums[0], sums[1]), weights]
    }
}

/// Adds the weighted samples of [`LANES`] pixels.
#[inline(always)]
fn add<L: Lanes>(lanes: L, sums: &mut [L::Two; 2], pixels: &[[f32; 4]], spread: [L::Two; 2]) {
    let samples: &[[f32; 4]; LANES] = pixels.first_chunk().expect("the block holds the ellipse");
    let samples = samples.as_flattened().as_chunks().0;
    for half in 0..2 {
        sums[half] = lanes.mul_add(spread[half], lanes.load(&samples[half]), sums[half]);
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
        let [left, top] = [(x - width).ceil(), (y - height).ceil()];
        let (spot, rows) = (ellipse.spot(left - x, top - y), ellipse.rows() as usize);
        let [left, top] = [left as i32, top as i32];
        let Self { runs, groups, columns, .. } = self;
        runs.clear();
        groups.clear();
        *columns = [left, left + LANES as i32];
        let sums = if ellipse.is_narrow() {
            runs.extend((top..top + rows as i32).map(|row| Run { row, first: left, groups: 1 }));
            spot.narrow(
                lanes,
                rows,
                #[inline(always)]
                |_, weights| groups.extend_from_slice(lanes.store(weights).as_chunks().0),
            )
        } else {
            spot.wide(
                lanes,
                rows,
                #[inline(always)]
                |row, column, count, weights| {
                    let (row, first, some) = (top + row as i32, left + column as i32, count.min(TWICE).div_ceil(LANES));
                    runs.push(Run { row, first, groups: some });
                    columns[1] = columns[1].max(first + (some * LANES) as i32);
                    groups.extend_from_slice(&lanes.store(weights).as_chunks().0[..some]);
                },
            )
        };
        groups.truncate(runs.iter().map(|run| run.groups).sum());
        self.sum = total(lanes, sums);
    }

    /// Whether all runs lie in a picture of this size.
    #[inline(always)]
    pub fn lie_in(&self, width: usize, height: usize) -> bool {
        let (Some(first), Some(last)) = (self.runs.first(), self.runs.last()) else { return false };
        first.row >= 0 && (last.row as usize) < height && self.columns[0] >= 0 && self.columns[1] as usize <= width
    }
}
