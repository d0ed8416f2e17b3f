//! The corner Jacobians of a lattice's cells, and what they do along a straight move.

use super::Freedom;
use crate::lattice::{Lattice, Positions};
use crate::warp::least_cross_products;
use rayon::prelude::*;
use robust::{Coord, orient2d};

/// One number per node for x and for y.
pub(super) type Field = [Vec<f64>; 2];

/// A corner of a cell: its node, and the far ends of the edges that leave it along and against the way round.
pub(super) type Corner = [usize; 3];

/// The corners of a lattice's cells; a corner's number is four times that of its cell, plus 0 to 3.
pub(super) struct Shape {
    /// Of a cell at rest, px^2.
    pub(super) area: f64,
    nodes: [usize; 2],
    pinned: Vec<bool>,
}

/// A corner Jacobian along a move: `at_0 + linear t + square t^2`.
#[derive(Clone, Copy)]
pub(super) struct Quadratic {
    pub(super) at_0: f64,
    linear: f64,
    square: f64,
}

impl Shape {
    pub(super) fn new(lattice: &Lattice, freedom: &[Freedom]) -> Self {
        let pinned = freedom.iter().map(|freedom| matches!(freedom, Freedom::Pinned)).collect();
        Self { area: lattice.spacing[0] * lattice.spacing[1], nodes: lattice.nodes, pinned }
    }

    fn is_fixed(&self, corner: Corner) -> bool {
        corner.into_iter().all(|node| self.pinned[node])
    }

    /// The corners that a move may change, and their numbers.
    pub(super) fn movable(&self) -> impl Iterator<Item = (usize, Corner)> {
        corners(self.nodes).filter(|&(_, corner)| !self.is_fixed(corner))
    }

    /// The corners that no move changes: all their nodes are pinned.
    pub(super) fn fixed(&self) -> impl Iterator<Item = Corner> {
        corners(self.nodes).map(|(_, corner)| corner).filter(|&corner| self.is_fixed(corner))
    }

    pub(super) fn corner_count(&self) -> usize {
        4 * (self.nodes[0] - 1) * (self.nodes[1] - 1)
    }

    pub(super) fn jacobian(&self, x: &Positions, corner: Corner) -> f64 {
        let ([ax, ay], [bx, by]) = edges(&x.x, &x.y, corner);
        (ax * by - ay * bx) / self.area
    }

    /// The least Jacobian of the movable corners, infinite if there are none; negative infinity where it is NaN.
    pub(super) fn least(&self, x: &Positions) -> f64 {
        self.movable().map(|(_, corner)| self.jacobian(x, corner)).fold(f64::INFINITY, lesser)
    }

    /// The same, of exact sign.
    pub(super) fn least_exactly(&self, x: &Positions) -> f64 {
        let columns = self.nodes[0] - 1;
        let of_row = |least: &mut Vec<f64>, row: usize| {
            least.resize(columns, 0.0);
            least_cross_products(self.nodes, x, row, least);
            let of_cell = |(column, &least): (usize, &f64)| {
                let around = around(self.nodes[0], row * columns + column);
                if !around.into_iter().any(|node| self.pinned[node]) {
                    return least;
                }
                let movable = corners_of(around).filter(|&corner| !self.is_fixed(corner));
                movable.map(|corner| exact_cross(x, corner)).fold(f64::INFINITY, lesser)
            };
            least.iter().enumerate().map(of_cell).fold(f64::INFINITY, lesser)
        };
        let rows: Vec<f64> = (0..self.nodes[1] - 1).into_par_iter().map_init(Vec::new, of_row).collect();
        rows.into_iter().fold(f64::INFINITY, lesser) / self.area
    }

    /// The Jacobian of a corner of `x + t step`.
    pub(super) fn along(&self, x: &Positions, [sx, sy]: &Field, corner: Corner) -> Quadratic {
        let (a, b) = edges(&x.x, &x.y, corner);
        let (da, db) = edges(sx, sy, corner);
        Quadratic {
            at_0: cross(a, b) / self.area,
            linear: (cross(a, db) + cross(da, b)) / self.area,
            square: cross(da, db) / self.area,
        }
    }

    /// The last stretch of 0..=1 in which every movable corner of `x + t step` stays at or above `level`.
    ///
    /// None where no t does. Sorts the stretches in which a corner is below: O(n log n) in their count.
    pub(super) fn last_stretch(&self, x: &Positions, step: &Field, level: f64) -> Option<[f64; 2]> {
        let mut below: Vec<[f64; 2]> = Vec::new();
        for (_, corner) in self.movable() {
            self.along(x, step, corner).below(level, |stretch| below.push(stretch));
        }
        below.sort_unstable_by(|a, b| b[1].total_cmp(&a[1]));
        let mut end = 1.0;
        for [from, to] in below {
            if to < end {
                return Some([to, end]);
            }
            end = f64::min(end, from);
        }
        (end > 0.0).then_some([0.0, end])
    }
}

impl Quadratic {
    pub(super) fn at(&self, t: f64) -> f64 {
        self.at_0 + t * (self.linear + t * self.square)
    }

    pub(super) fn slope_at(&self, t: f64) -> f64 {
        self.linear + 2.0 * t * self.square
    }

    /// The first t > 0 where it falls to `level`, if it starts above and falls at all.
    pub(super) fn falls_to(&self, level: f64) -> Option<f64> {
        let above = self.at_0 - level;
        let discriminant = self.linear * self.linear - 4.0 * self.square * above;
        if discriminant < 0.0 {
            None
        } else if self.linear < 0.0 {
            Some(2.0 * above / (discriminant.sqrt() - self.linear))
        } else {
            (self.square < 0.0).then(|| (self.linear + discriminant.sqrt()) / (-2.0 * self.square))
        }
    }

    /// Its least value for t in 0..=`end`.
    pub(super) fn least(&self, end: f64) -> f64 {
        let vertex = -self.linear / (2.0 * self.square);
        let inside = if self.square > 0.0 && vertex > 0.0 && vertex < end { self.at(vertex) } else { self.at_0 };
        self.at_0.min(self.at(end)).min(inside)
    }

    /// Gives the stretches of 0..=1 in which it is below `level`; all of it where it is NaN.
    fn below(&self, level: f64, mut give: impl FnMut([f64; 2])) {
        let mut ends = [0.0, 1.0, 1.0, 1.0];
        for (end, root) in ends[1..3].iter_mut().zip(self.roots(level)) {
            *end = if root > 0.0 && root < 1.0 { root } else { 1.0 };
        }
        ends.sort_unstable_by(f64::total_cmp);
        for pair in ends.windows(2).filter(|pair| pair[0] < pair[1]) {
            let middle = self.at(0.5 * (pair[0] + pair[1]));
            if middle < level || middle.is_nan() {
                give([pair[0], pair[1]]);
            }
        }
    }

    /// Where it equals `level`; NaN or infinite where it does not.
    fn roots(&self, level: f64) -> [f64; 2] {
        let constant = self.at_0 - level;
        let root = (self.linear * self.linear - 4.0 * self.square * constant).sqrt();
        let half = -0.5 * (self.linear + root.copysign(self.linear));
        [half / self.square, constant / half]
    }
}

/// Every corner and its number.
fn corners([columns, rows]: [usize; 2]) -> impl Iterator<Item = (usize, Corner)> {
    (0..(columns - 1) * (rows - 1)).flat_map(move |cell| (4 * cell..).zip(corners_of(around(columns, cell))))
}

/// The nodes of a cell, clockwise on screen.
fn around(columns: usize, cell: usize) -> [usize; 4] {
    let first = cell + cell / (columns - 1);
    [first, first + 1, first + columns + 1, first + columns]
}

/// The corners of the cell with these nodes.
fn corners_of(around: [usize; 4]) -> impl Iterator<Item = Corner> {
    (0..4).map(move |i| [around[i], around[(i + 1) % 4], around[(i + 3) % 4]])
}

/// Positions as single precision keeps them.
pub(super) fn in_single_precision(x: &Positions) -> Positions {
    let round = |values: &[f64]| values.iter().map(|&value| f64::from(value as f32)).collect();
    Positions { x: round(&x.x), y: round(&x.y) }
}

/// The cross product of a corner's edges, of exact sign; negative infinity where it is NaN.
pub(super) fn exact_cross(x: &Positions, corner: Corner) -> f64 {
    let [node, next, previous] = corner.map(|node| Coord { x: x.x[node], y: x.y[node] });
    lesser(f64::INFINITY, orient2d(node, next, previous))
}

pub(super) fn edges(x: &[f64], y: &[f64], [node, next, previous]: Corner) -> ([f64; 2], [f64; 2]) {
    ([x[next] - x[node], y[next] - y[node]], [x[previous] - x[node], y[previous] - y[node]])
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// The lesser of both, negative infinity where one is NaN.
fn lesser(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NEG_INFINITY } else { a.min(b) }
}
