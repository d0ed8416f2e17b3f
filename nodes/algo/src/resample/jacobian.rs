//! How much a map shrinks the picture: at each pixel of a tile, and at most.

use super::Map;
use super::axes::{Axes, Shapes};
use super::cell::{Corners, Shape};
use super::locate::Located;
use super::net::{Columns, Net, Place};
use super::spans::Point;
use crate::rect::Rect;
use crate::simd::vectorized;
use crate::{Interrupted, Watch};
use rayon::prelude::*;

/// A Jacobian's columns: what a step of 1 px along x and one along y make.
type Jacobian = [Point; 2];

/// Rows of cells that a thread looks at together.
const ROWS: usize = 16;

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

fn over(a: Point, by: f64) -> Point {
    a.map(|at| at / by)
}

fn inverse([e, f]: Jacobian) -> Jacobian {
    let det = e[0] * f[1] - e[1] * f[0];
    [over([f[1], -e[1]], det), over([-f[0], e[0]], det)]
}

/// A map's Jacobians, always those of the source by the destination.
#[derive(Clone, Copy)]
pub(super) struct Jacobians<'a> {
    net: Net<'a>,
    is_forward: bool,
}

impl<'a> Jacobians<'a> {
    pub fn new(map: &Map<'a>) -> Self {
        match *map {
            Map::Forward { lattice, positions } => Self { net: Net::new(lattice, positions), is_forward: true },
            Map::Backward { lattice, positions } => Self { net: Net::new(lattice, positions), is_forward: false },
        }
    }

    /// The axes at each pixel of a tile; [`Axes::UNIT`] where nothing is drawn.
    pub fn tile(&self, at: &Located, shapes: &mut Shapes) {
        let count = at.width * at.height;
        shapes.resize(count);
        if self.is_forward {
            let mut last = None;
            for (i, (&x, &y)) in at.x[..count].iter().zip(&at.y).enumerate() {
                shapes.set(i, self.at_source([x, y], &mut last));
            }
            return;
        }
        let mut lines = Lines::new(&self.net, at);
        vectorized(
            #[inline(always)]
            || {
                for row in 0..at.height {
                    lines.next(&self.net, at.corner[1] + row as i64);
                    lines.axes(at.row(row), shapes.rows_mut(row * at.width..(row + 1) * at.width));
                }
            },
        );
    }

    /// The axes at a place of the source of a forward map; `last`: the cell looked at last.
    fn at_source(&self, at: Point, last: &mut Option<Cell>) -> Axes {
        if at[0].is_nan() {
            return Axes::UNIT;
        }
        let lattice = self.net.lattice;
        let cells: Point = std::array::from_fn(|axis| (at[axis] - lattice.origin[axis]) / lattice.spacing[axis]);
        let index: [usize; 2] = std::array::from_fn(|axis| (cells[axis] as usize).min(lattice.nodes[axis] - 2));
        let cell = match last {
            Some(cell) if cell.index == index => cell,
            _ => last.insert(Cell::new(index, &self.net.corners(index))),
        };
        let [e, f] = cell.jacobian([cells[0] - index[0] as f64, cells[1] - index[1] as f64]);
        Axes::of(inverse([over(e, lattice.spacing[0]), over(f, lattice.spacing[1])]))
    }

    /// The greatest axes, px, that the corners of the cells overlapping `area` have: of the source for a forward map,
    /// of the destination for a backward one; border cells are stretched to hold it.
    ///
    /// A Jacobian is bilinear in a cell and its inverse's norm quasiconvex, so the major axis is exact. And what the minor
    /// axis is at least in the cells: a cell's least determinant, which is at a corner, over its longest major axis.
    pub fn range(&self, area: &Rect, watch: Watch) -> Result<Range, Interrupted> {
        let columns = self.stops(0, [area.x0, area.x1]);
        let rows = self.stops(1, [area.y0, area.y1]);
        let line = |row: &Stop| columns.iter().map(|column| self.net.position(column.place, row.place)).collect();
        let chunks = (0..rows.len() - 1).into_par_iter().step_by(ROWS).map(|first| {
            let mut range = Range::EMPTY;
            let mut upper: Vec<Point> = line(&rows[first]);
            for pair in rows[first..].windows(2).take(ROWS) {
                watch.go_on()?;
                let lower: Vec<Point> = line(&pair[1]);
                let height = pair[1].at - pair[0].at;
                for (i, stops) in columns.windows(2).enumerate() {
                    let corners = [upper[i], upper[i + 1], lower[i + 1], lower[i]];
                    self.corners(&corners, [stops[1].at - stops[0].at, height], &mut range);
                }
                upper = lower;
            }
            Ok(range)
        });
        chunks.try_reduce(|| Range::EMPTY, |a, b| Ok(a.with(&b)))
    }

    /// Widens the range to the axes in a cell.
    fn corners(&self, corners: &Corners, [width, height]: [f64; 2], range: &mut Range) {
        let [top, right, bottom, left] = sides(corners);
        let (mut cell, mut least, mut signs) = (Range::EMPTY, f64::INFINITY, [false; 2]);
        for e in [top, bottom].map(|e| over(e, width)) {
            for f in [left, right].map(|f| over(f, height)) {
                let axes = Axes::of(if self.is_forward { inverse([e, f]) } else { [e, f] });
                cell = cell.with(&Range { major: axes.major(), minor: axes.minor(), least: f64::INFINITY });
                least = least.min(axes.major() * axes.minor());
                signs[usize::from(e[0] * f[1] > e[1] * f[0])] = true;
            }
        }
        let least = if signs == [true; 2] { 0.0 } else { least };
        *range = range.with(&Range { least: least / cell.major, ..cell });
    }

    /// The ends of the cells along an axis that overlap a range.
    fn stops(&self, axis: usize, range: [i64; 2]) -> Vec<Stop> {
        let (lattice, [low, high]) = (self.net.lattice, range.map(|at| at as f64));
        let (origin, spacing, last) = (lattice.origin[axis], lattice.spacing[axis], lattice.nodes[axis] - 1);
        let [first, end] = [low, high].map(|at| (((at - origin) / spacing) as usize).min(last - 1));
        let stop = |node: usize| match origin + node as f64 * spacing {
            at if node == 0 && low < at => Stop { at: low, place: self.net.place(axis, low) },
            at if node == last && high > at => Stop { at: high, place: self.net.place(axis, high) },
            at => Stop { at, place: Place::at_node(node) },
        };
        (first..=end + 1).map(stop).collect()
    }
}

/// Where a backward map sends the middles of the sides of a row's pixels: x, then y.
struct Lines {
    /// Of the pixels' centres and of their left and right sides along x.
    centers: Columns,
    sides: Columns,
    /// The first of the lattice's columns they need.
    first: usize,
    nodes: Vec<f64>,
    /// Of the left and right sides.
    middle: [Vec<f64>; 2],
    /// Of the sides above and below.
    above: [Vec<f64>; 2],
    below: [Vec<f64>; 2],
}

impl Lines {
    /// Above the first row of a tile.
    fn new(net: &Net, at: &Located) -> Self {
        let [left, top] = at.corner;
        let centers: Vec<Place> = (0..at.width as i64).map(|x| net.center(0, left + x)).collect();
        let sides: Vec<Place> = (0..=at.width as i64).map(|x| net.place(0, (left + x) as f64)).collect();
        let needed = || centers.iter().chain(&sides).flat_map(|place| [place.node, place.next]);
        let first = needed().min().unwrap_or(0);
        let nodes = vec![0.0; needed().max().map_or(0, |last| last + 1 - first)];
        let line = |count: usize| [vec![0.0; count], vec![0.0; count]];
        let [middle, above, below] = [line(sides.len()), line(centers.len()), line(centers.len())];
        let (centers, sides) = (Columns::new(&centers, first), Columns::new(&sides, first));
        let mut lines = Self { centers, sides, first, nodes, middle, above, below };
        lines.lower(net, top);
        lines
    }

    /// Goes on to a row, the one below the last.
    #[inline(always)]
    fn next(&mut self, net: &Net, y: i64) {
        std::mem::swap(&mut self.above, &mut self.below);
        let place = net.center(1, y);
        for axis in 0..2 {
            net.line(axis, place, self.first, &mut self.nodes);
            self.sides.blend(&self.nodes, &mut self.middle[axis]);
        }
        self.lower(net, y + 1);
    }

    /// The axes of the row gone on to: of the differences between the middles of a pixel's sides; where one side is not
    /// finite, twice that from the centre to the other.
    #[inline(always)]
    fn axes(&self, (center_x, center_y): (&[f64], &[f64]), [major, minor, cos, sin]: [&mut [f32]; 4]) {
        let count = major.len();
        let (center_x, center_y) = (&center_x[..count], &center_y[..count]);
        let [[x, y], [above_x, above_y], [below_x, below_y]] =
            [&self.middle, &self.above, &self.below].map(|line| line.each_ref().map(|line| &line[..count]));
        let [next_x, next_y] = self.middle.each_ref().map(|line| &line[1..count + 1]);
        let (minor, cos, sin) = (&mut minor[..count], &mut cos[..count], &mut sin[..count]);
        for i in 0..count {
            let e = [across(x[i], center_x[i], next_x[i]), across(y[i], center_y[i], next_y[i])];
            let f = [across(above_x[i], center_x[i], below_x[i]), across(above_y[i], center_y[i], below_y[i])];
            let axes = Axes::of([e, f]);
            (major[i], minor[i]) = (axes.squares[0], axes.squares[1]);
            (cos[i], sin[i]) = (axes.twice[0], axes.twice[1]);
        }
    }

    /// Sets `below` to the upper side of a row.
    #[inline(always)]
    fn lower(&mut self, net: &Net, y: i64) {
        let place = net.place(1, y as f64);
        for axis in 0..2 {
            net.line(axis, place, self.first, &mut self.nodes);
            self.centers.blend(&self.nodes, &mut self.below[axis]);
        }
    }
}

/// How much a coordinate differs across a pixel, by its values at two sides and the centre.
#[inline(always)]
fn across(before: f64, center: f64, after: f64) -> f64 {
    let before = if before.is_finite() { before } else { center - (after - center) };
    let after = if after.is_finite() { after } else { center + (center - before) };
    after - before
}

/// The greatest axes, px, and how long the minor axis is at least.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub major: f64,
    pub minor: f64,
    pub least: f64,
}

impl Range {
    const EMPTY: Self = Self { major: 0.0, minor: 0.0, least: f64::INFINITY };

    fn with(&self, other: &Self) -> Self {
        Self {
            major: self.major.max(other.major),
            minor: self.minor.max(other.minor),
            least: self.least.min(other.least),
        }
    }
}

/// Where a line of nodes stands along an axis, px.
struct Stop {
    at: f64,
    place: Place,
}

/// A cell's sides, along x and y: top, right, bottom, left.
fn sides(&[p00, p10, p11, p01]: &Corners) -> Corners {
    [minus(p10, p00), minus(p11, p10), minus(p11, p01), minus(p01, p00)]
}

/// A cell of a forward map and how it is drawn.
struct Cell {
    index: [usize; 2],
    sides: Corners,
    shape: Shape,
}

impl Cell {
    fn new(index: [usize; 2], corners: &Corners) -> Self {
        Self { index, sides: sides(corners), shape: Shape::of(corners) }
    }

    /// Of the destination by the place in the cell: bilinear, or that of the triangle which the place lies in.
    fn jacobian(&self, [u, v]: Point) -> Jacobian {
        let [top, right, bottom, left] = self.sides;
        let mean = |t: f64, a: Point, b: Point| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
        match self.shape {
            Shape::Convex { .. } => [mean(v, top, bottom), mean(u, left, right)],
            Shape::Folded { split: 0 } if u >= v => [top, right],
            Shape::Folded { split: 0 } => [bottom, left],
            Shape::Folded { .. } if u + v >= 1.0 => [bottom, right],
            Shape::Folded { .. } => [top, left],
        }
    }
}
