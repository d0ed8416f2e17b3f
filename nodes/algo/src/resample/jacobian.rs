//! How much a map shrinks the picture: at each pixel of a tile, and at most.

use super::Map;
use super::cell::{Corners, Shape};
use super::ellipse::Axes;
use super::locate::Located;
use super::net::{Net, Place};
use super::spans::Point;
use crate::rect::Rect;
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

    /// The axes at each pixel of a tile, row-major; [`Axes::UNIT`] where nothing is drawn.
    pub fn tile(&self, at: &Located) -> Vec<Axes> {
        let mut axes = Vec::with_capacity(at.x.len());
        if self.is_forward {
            let mut last = None;
            axes.extend(at.x.iter().zip(&at.y).map(|(&x, &y)| self.at_source([x, y], &mut last)));
        } else {
            let [left, top] = at.corner;
            let centers: Vec<Place> = (0..at.width as i64).map(|x| self.net.center(0, left + x)).collect();
            let sides: Vec<Place> = (0..=at.width as i64).map(|x| self.net.place(0, (left + x) as f64)).collect();
            (0..at.height() as i64).for_each(|y| self.across(&centers, &sides, top + y, &mut axes));
        }
        axes
    }

    /// Appends a row's axes of a backward map: the differences between the middles of a pixel's sides.
    fn across(&self, centers: &[Place], sides: &[Place], row: i64, axes: &mut Vec<Axes>) {
        let net = &self.net;
        let [above, below] = [row, row + 1].map(|y| net.place(1, y as f64));
        let middle = net.center(1, row);
        let mut left = net.position(sides[0], middle);
        axes.extend(centers.iter().zip(&sides[1..]).map(|(&center, &side)| {
            let right = net.position(side, middle);
            let e = minus(right, left);
            left = right;
            Axes::of([e, minus(net.position(center, below), net.position(center, above))])
        }));
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
    /// A Jacobian is bilinear in a cell and its inverse's norm quasiconvex, so the major axis is exact.
    pub fn greatest(&self, area: &Rect, watch: Watch) -> Result<[f64; 2], Interrupted> {
        let columns = self.stops(0, [area.x0, area.x1]);
        let rows = self.stops(1, [area.y0, area.y1]);
        let line = |row: &Stop| columns.iter().map(|column| self.net.position(column.place, row.place)).collect();
        let chunks = (0..rows.len() - 1).into_par_iter().step_by(ROWS).map(|first| {
            let mut greatest = [0.0; 2];
            let mut upper: Vec<Point> = line(&rows[first]);
            for pair in rows[first..].windows(2).take(ROWS) {
                watch.go_on()?;
                let lower: Vec<Point> = line(&pair[1]);
                let height = pair[1].at - pair[0].at;
                for (i, stops) in columns.windows(2).enumerate() {
                    let corners = [upper[i], upper[i + 1], lower[i + 1], lower[i]];
                    self.corners(&corners, [stops[1].at - stops[0].at, height], &mut greatest);
                }
                upper = lower;
            }
            Ok(greatest)
        });
        chunks.try_reduce(|| [0.0; 2], |a, b| Ok([a[0].max(b[0]), a[1].max(b[1])]))
    }

    /// Raises `greatest` to the axes at a cell's corners.
    fn corners(&self, corners: &Corners, [width, height]: [f64; 2], greatest: &mut [f64; 2]) {
        let [top, right, bottom, left] = sides(corners);
        for e in [top, bottom].map(|e| over(e, width)) {
            for f in [left, right].map(|f| over(f, height)) {
                let axes = Axes::of(if self.is_forward { inverse([e, f]) } else { [e, f] });
                *greatest = [greatest[0].max(axes.major()), greatest[1].max(axes.minor())];
            }
        }
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
