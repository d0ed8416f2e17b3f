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

/// How far, in spacings, a warp's last nodes may be from its first ones, one period on, for it to repeat.
const REPEATS: f64 = 1e-6;

/// A warp that repeats, with as many cells more on each side as its nodes move: what is drawn through it has no seam.
///
/// Along an axis that is `periodic` a warp repeats if its last nodes are its first ones, one period on. Cells are added
/// there, at most a period on each side; the others keep their bits. `None` if none is added.
pub fn repeated(lattice: &Lattice, positions: &Positions, periodic: [bool; 2]) -> Option<(Lattice, Positions)> {
    let repeats = |axis: usize| periodic[axis] && repeats(lattice, positions, axis);
    let more = [0, 1].map(|axis| if repeats(axis) { overhang(lattice, positions, axis) } else { 0 });
    if more == [0, 0] {
        return None;
    }
    let wider = Lattice {
        origin: [0, 1].map(|axis| lattice.origin[axis] - more[axis] as f64 * lattice.spacing[axis]),
        nodes: [0, 1].map(|axis| lattice.nodes[axis] + 2 * more[axis]),
        ..*lattice
    };
    let home = |axis: usize, at: usize| {
        let (cells, at) = (lattice.cells()[axis] as i64, at as i64 - more[axis] as i64);
        let periods = if at == cells { 0 } else { at.div_euclid(cells) };
        ((at - periods * cells) as usize, periods as f64 * lattice.size()[axis])
    };
    let mut all = Positions { x: Vec::with_capacity(wider.node_count()), y: Vec::with_capacity(wider.node_count()) };
    for row in 0..wider.nodes[1] {
        let (row, down) = home(1, row);
        for column in 0..wider.nodes[0] {
            let (column, right) = home(0, column);
            let node = row * lattice.nodes[0] + column;
            all.x.push(positions.x[node] + right);
            all.y.push(positions.y[node] + down);
        }
    }
    Some((wider, all))
}

/// Whether the last nodes along an axis are the first ones, one period on.
fn repeats(lattice: &Lattice, positions: &Positions, axis: usize) -> bool {
    let ([columns, rows], mut period) = (lattice.nodes, [0.0; 2]);
    period[axis] = lattice.size()[axis];
    let pair = |at: usize| match axis {
        0 => [at * columns, at * columns + columns - 1],
        _ => [at, (rows - 1) * columns + at],
    };
    (0..lattice.nodes[1 - axis]).map(pair).all(|[first, last]| {
        let by = [positions.x[last] - positions.x[first], positions.y[last] - positions.y[first]];
        (0..2).all(|axis| (by[axis] - period[axis]).abs() <= REPEATS * lattice.spacing[axis])
    })
}

/// Cells along an axis that nodes move, and one more for what a filter reads.
fn overhang(lattice: &Lattice, positions: &Positions, axis: usize) -> usize {
    let columns = lattice.nodes[0];
    let moved = |node: usize| match axis {
        0 => positions.x[node] - lattice.rest(node % columns, 0)[0],
        _ => positions.y[node] - lattice.rest(0, node / columns)[1],
    };
    let farthest = (0..lattice.node_count()).map(|node| moved(node).abs()).fold(0.0, f64::max);
    ((farthest / lattice.spacing[axis]).ceil() as usize + 1).min(lattice.cells()[axis])
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warp_that_repeats_goes_on_beyond_its_borders() {
        let lattice = Lattice { origin: [10.0, 20.0], spacing: [2.0, 3.0], nodes: [9, 5] };
        let wave = |x: f64| libm::sin((x - 10.0) * std::f64::consts::TAU / 16.0);
        let warp = |[x, y]: [f64; 2]| [x + 3.0 * wave(x), y + 0.5 * wave(x)];
        let positions = Positions::from_map(&lattice, warp);
        let (wider, all) = repeated(&lattice, &positions, [true, true]).expect("it moves");
        // It moves by up to 3 px, 1.5 cells, along x, and by up to 0.5 px along y.
        assert_eq!((wider.nodes, wider.origin), ([9 + 6, 5 + 4], [4.0, 14.0]));
        for row in 0..wider.nodes[1] {
            for column in 0..wider.nodes[0] {
                let (node, [x, y]) = (row * wider.nodes[0] + column, warp(wider.rest(column, row)));
                assert!((all.x[node] - x).abs() < 1e-9 && (all.y[node] - y).abs() < 1e-9, "({column}, {row})");
            }
        }
        assert_eq!(all.x[2 * 15 + 3..][..9], positions.x[..9]);
        // Along y alone, where it is not said to repeat along x; not at all where it does not repeat.
        assert_eq!(repeated(&lattice, &positions, [false, true]).map(|(wider, _)| wider.nodes), Some([9, 9]));
        let turned = Positions::from_map(&lattice, |[x, y]| [x - y, x + y]);
        assert_eq!(repeated(&lattice, &turned, [true, true]), None);
    }
}
