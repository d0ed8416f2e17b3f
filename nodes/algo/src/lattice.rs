//! The regular lattice that warps live on.

use crate::steps::Steps;
use crate::{Interrupted, UNWATCHED, Watch};
use rayon::prelude::*;

/// A regular lattice of nodes at rest: node (c, r) lies at `origin + (c, r) * spacing`, in px.
///
/// Arrays over its nodes are row-major, `nodes[0]` columns wide; arrays over its cells are row-major,
/// `nodes[0] - 1` columns wide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Position of node (0, 0), px.
    pub origin: [f64; 2],
    /// Distance between neighbours along x and y, px, positive.
    pub spacing: [f64; 2],
    /// Columns and rows of nodes, at least 2 each.
    pub nodes: [usize; 2],
}

impl Lattice {
    /// Count of nodes.
    pub fn node_count(&self) -> usize {
        self.nodes[0] * self.nodes[1]
    }

    /// Columns and rows of cells.
    pub fn cells(&self) -> [usize; 2] {
        [self.nodes[0] - 1, self.nodes[1] - 1]
    }

    /// Rest position of node (column, row), px.
    pub fn rest(&self, column: usize, row: usize) -> [f64; 2] {
        [self.origin[0] + column as f64 * self.spacing[0], self.origin[1] + row as f64 * self.spacing[1]]
    }

    /// Centre of the lattice, px.
    pub fn center(&self) -> [f64; 2] {
        let [w, h] = self.size();
        [self.origin[0] + w / 2.0, self.origin[1] + h / 2.0]
    }

    /// Width and height of the rectangle it covers, px.
    pub fn size(&self) -> [f64; 2] {
        let [columns, rows] = self.cells();
        [columns as f64 * self.spacing[0], rows as f64 * self.spacing[1]]
    }
}

/// Positions of all nodes of a lattice, one array per coordinate, px, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Positions {
    /// x of each node.
    pub x: Vec<f64>,
    /// y of each node.
    pub y: Vec<f64>,
}

impl Positions {
    /// `map` of every node's rest position, rows side by side; stops when `watch` says so.
    pub fn mapped(
        lattice: &Lattice,
        watch: Watch,
        map: impl Fn([f64; 2]) -> [f64; 2] + Sync,
    ) -> Result<Self, Interrupted> {
        let [columns, rows] = lattice.nodes;
        let (mut x, mut y) = (vec![0.0; lattice.node_count()], vec![0.0; lattice.node_count()]);
        let steps = Steps::new(watch, rows);
        x.par_chunks_mut(columns).zip(y.par_chunks_mut(columns)).enumerate().try_for_each(|(row, (x, y))| {
            for (column, (x, y)) in x.iter_mut().zip(y).enumerate() {
                [*x, *y] = map(lattice.rest(column, row));
            }
            steps.step()
        })?;
        Ok(Self { x, y })
    }

    /// Moves all of them by the same, px.
    pub fn translate(&mut self, [dx, dy]: [f64; 2]) {
        self.x.iter_mut().for_each(|x| *x += dx);
        self.y.iter_mut().for_each(|y| *y += dy);
    }

    /// `map` of every node's rest position.
    pub fn from_map(lattice: &Lattice, map: impl Fn([f64; 2]) -> [f64; 2] + Sync) -> Self {
        Self::mapped(lattice, UNWATCHED, map).unwrap_or_else(|Interrupted| unreachable!("nobody watches"))
    }
}

/// Whether a node, counted row by row, lies on the border of a lattice.
pub(crate) fn is_on_border([columns, rows]: [usize; 2], node: usize) -> bool {
    let (column, row) = (node % columns, node / columns);
    column == 0 || row == 0 || column + 1 == columns || row + 1 == rows
}

/// The nodes of the border, once around, clockwise on screen from node (0, 0); at least 2 x 2 nodes.
pub(crate) fn border([columns, rows]: [usize; 2]) -> Vec<usize> {
    let last = columns * (rows - 1);
    let top = 0..columns - 1;
    let right = (0..rows - 1).map(|row| row * columns + columns - 1);
    let bottom = (1..columns).rev().map(|column| last + column);
    let left = (1..rows).rev().map(|row| row * columns);
    top.chain(right).chain(bottom).chain(left).collect()
}
