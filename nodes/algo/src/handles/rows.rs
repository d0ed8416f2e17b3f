//! Handles as rows of equations on the nodes.

use super::{Error, Handle};
use crate::lattice::Lattice;

/// Handles nearer to each other than this share of a cell lie on one place; as a share of the lattice, so much may one
/// lie outside.
const SAME_PLACE: f64 = 1e-9;

/// Targets nearer to each other than this share of the lattice's size are one.
const SAME_TARGET: f64 = 1e-9;

/// A point of the lattice as the weighted sum of its cell's corners, and how far it is to be moved, px.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    nodes: [usize; 4],
    weights: [f64; 4],
    pub(super) at: [f64; 2],
    pub(super) by: [f64; 2],
}

impl Row {
    /// The nodes that the point depends on, and how much.
    pub(super) fn pulls(&self) -> impl Iterator<Item = (usize, f64)> {
        self.nodes.into_iter().zip(self.weights).filter(|(_, weight)| *weight != 0.0)
    }
}

/// Column and row of the cell that a point of the lattice lies in, and where in the cell, 0..=1; None outside.
pub(super) fn locate(lattice: &Lattice, point: [f64; 2]) -> Option<([usize; 2], [f64; 2])> {
    let (mut cell, mut within) = ([0; 2], [0.0; 2]);
    for axis in 0..2 {
        let count = lattice.cells()[axis];
        let at = (point[axis] - lattice.origin[axis]) / lattice.spacing[axis];
        let slack = SAME_PLACE * count as f64;
        if !(-slack..=count as f64 + slack).contains(&at) {
            return None;
        }
        cell[axis] = (at.max(0.0) as usize).min(count - 1);
        within[axis] = (at - cell[axis] as f64).clamp(0.0, 1.0);
    }
    Some((cell, within))
}

/// The rows of handles, each place once.
///
/// Handles on one place with one target are one. A handle outside the lattice, a number that is not finite, and one
/// place with two targets are errors that give the handles' indices.
pub(super) fn rows(lattice: &Lattice, handles: &[Handle]) -> Result<Vec<Row>, Error> {
    let reach = SAME_PLACE * lattice.spacing[0].min(lattice.spacing[1]);
    let tolerance = SAME_TARGET * lattice.size()[0].max(lattice.size()[1]);
    let mut order: Vec<usize> = (0..handles.len()).collect();
    if let Some(index) = order.iter().copied().find(|&index| !handles[index].to.iter().all(|v| v.is_finite())) {
        return Err(Error::NotFinite { index });
    }
    let place = |index: usize| locate(lattice, handles[index].from).ok_or(Error::Outside { index });
    let places = order.iter().map(|&index| place(index)).collect::<Result<Vec<_>, _>>()?;
    order.sort_by(|&a, &b| handles[a].from[0].total_cmp(&handles[b].from[0]).then(a.cmp(&b)));
    let mut merged = vec![false; handles.len()];
    for (rank, &first) in order.iter().enumerate() {
        for &second in order[rank + 1..].iter().take_while(|&&i| handles[i].from[0] - handles[first].from[0] <= reach) {
            if (handles[second].from[1] - handles[first].from[1]).abs() > reach {
                continue;
            }
            if (0..2).any(|axis| (handles[second].to[axis] - handles[first].to[axis]).abs() > tolerance) {
                return Err(Error::Contradiction { first: first.min(second), second: first.max(second) });
            }
            merged[first.max(second)] = true;
        }
    }
    let kept = (0..handles.len()).filter(|&index| !merged[index]);
    Ok(kept.map(|index| row(lattice, places[index], &handles[index])).collect())
}

fn row(lattice: &Lattice, (cell, [u, v]): ([usize; 2], [f64; 2]), handle: &Handle) -> Row {
    let columns = lattice.nodes[0];
    let first = cell[1] * columns + cell[0];
    Row {
        nodes: [first, first + 1, first + columns, first + columns + 1],
        weights: [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v],
        at: handle.from,
        by: [0, 1].map(|axis| handle.to[axis] - handle.from[axis]),
    }
}
