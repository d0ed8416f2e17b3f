//! The published relaxation: nodes push their neighbours away or pull them near until the areas around them fit.

use super::Moved;
use super::means::resized;
use crate::lattice::{Lattice, Positions};
use crate::warp::certify;
use crate::{Interrupted, Watch};

/// Parameters of the relaxation; the default is the published one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keahey {
    /// Sweeps over all nodes, on every level.
    pub sweeps: usize,
    /// Part of an error that one visit removes, > 0.
    pub refine: f64,
    /// Most of the way to the next node that a node moves in one visit, 0..=0.5 to be of use.
    pub limit: f64,
    /// Errors count times M to this power.
    pub weight: f64,
    /// Lattices, each of half the cells along each side, that are relaxed from the coarsest on: 1 for this one alone.
    pub levels: usize,
}

impl Default for Keahey {
    fn default() -> Self {
        Self { sweeps: 100, refine: 0.3, limit: 0.1, weight: 1.0, levels: 1 }
    }
}

/// Cells along the shorter side of the coarsest lattice, at least.
const COARSEST: usize = 4;

/// Bytes per cell beside the areas and the positions that come out: those asked for, what they are at nodes, weights,
/// and the coarser level.
const BYTES_PER_CELL: usize = 4 * size_of::<f64>();

/// Relaxes the lattice towards `areas`.
///
/// A sweep visits the inner nodes in order, every other sweep backwards. There the distances d to the four neighbours give
/// the error e = M 4 dx dy / ((left + right) (above + below)) - 1, with M the mean of the four cells around; e is
/// multiplied by M^weight and by `refine` and cut at the limit. Where e > 0 each neighbour moves on towards the node
/// beyond it by e (sum - d) / sum of the way, else towards the node by -e d / sum. Nodes on the frame stay.
pub(super) fn keahey(
    lattice: &Lattice,
    areas: &[f64],
    parameters: &Keahey,
    watch: Watch,
) -> Result<Moved, Interrupted> {
    watch.reserve(areas.len() * BYTES_PER_CELL)?;
    let cells = lattice.cells();
    let mut levels = vec![cells];
    while let Some(&[columns, rows]) = levels.last()
        && levels.len() < parameters.levels
        && columns.min(rows).div_ceil(2) >= COARSEST
    {
        levels.push([columns.div_ceil(2), rows.div_ceil(2)]);
    }
    let (mut moved, mut steps) = (None, 0);
    let total = (levels.len() * parameters.sweeps).max(1) as f64;
    for &level in levels.iter().rev() {
        let [columns, rows] = level;
        let size = lattice.size();
        let here = Lattice {
            spacing: [size[0] / columns as f64, size[1] / rows as f64],
            nodes: [columns + 1, rows + 1],
            ..*lattice
        };
        let here = if level == cells { *lattice } else { here };
        let asked = if level == cells { areas.to_vec() } else { resized(areas, cells, level) };
        let mut net = Net::new(&here, &asked, parameters, moved.as_ref());
        for sweep in 0..parameters.sweeps {
            watch.progress(steps as f64 / total)?;
            net.sweep(sweep % 2 == 1, watch)?;
            steps += 1;
        }
        moved = Some((here, net.positions));
    }
    let (_, positions) = moved.expect("there is one level at least");
    let certificate = certify(lattice, &positions, watch)?;
    Ok(Moved { positions, certificate, exponent: 1.0, steps })
}

/// A lattice at work.
struct Net {
    nodes: [usize; 2],
    positions: Positions,
    /// M times the rest area of the four cells around a node; of inner nodes.
    asked: Vec<f64>,
    /// What an error at a node counts.
    weights: Vec<f64>,
    limit: f64,
}

impl Net {
    /// A net that starts where a coarser one ended, or at rest.
    fn new(lattice: &Lattice, areas: &[f64], parameters: &Keahey, start: Option<&(Lattice, Positions)>) -> Self {
        let ([columns, rows], [nodes, _]) = (lattice.cells(), lattice.nodes);
        let rest = 4.0 * lattice.spacing[0] * lattice.spacing[1];
        let (mut asked, mut weights) = (vec![0.0; lattice.node_count()], vec![0.0; lattice.node_count()]);
        for (row, column) in (1..rows).flat_map(|row| (1..columns).map(move |column| (row, column))) {
            let (above, below) = ((row - 1) * columns + column, row * columns + column);
            let mean = 0.25 * (areas[above - 1] + areas[above] + areas[below - 1] + areas[below]);
            asked[row * nodes + column] = mean * rest;
            weights[row * nodes + column] = parameters.refine * libm::pow(mean, parameters.weight);
        }
        let positions = match start {
            Some((coarse, positions)) => refined(coarse, positions, lattice),
            None => Positions::from_map(lattice, |p| p),
        };
        Self { nodes: lattice.nodes, positions, asked, weights, limit: parameters.limit }
    }

    fn sweep(&mut self, backwards: bool, watch: Watch) -> Result<(), Interrupted> {
        let [columns, rows] = self.nodes;
        for number in 1..rows - 1 {
            let row = if backwards { rows - 1 - number } else { number };
            for number in 1..columns - 1 {
                self.visit(if backwards { columns - 1 - number } else { number }, row);
            }
            watch.go_on()?;
        }
        Ok(())
    }

    fn at(&self, node: usize) -> [f64; 2] {
        [self.positions.x[node], self.positions.y[node]]
    }

    /// Moves the neighbours of an inner node.
    fn visit(&mut self, column: usize, row: usize) {
        let [columns, rows] = self.nodes;
        let node = row * columns + column;
        let here = self.at(node);
        let neighbours = [node - 1, node + 1, node - columns, node + columns];
        let on_frame = [column == 1, column + 2 == columns, row == 1, row + 2 == rows];
        let arms = neighbours.map(|neighbour| {
            let [x, y] = self.at(neighbour);
            ((x - here[0]) * (x - here[0]) + (y - here[1]) * (y - here[1])).sqrt()
        });
        let sum: f64 = arms.iter().sum();
        let error = self.asked[node] / ((arms[0] + arms[1]) * (arms[2] + arms[3])) - 1.0;
        let error = (error * self.weights[node]).clamp(-self.limit, self.limit);
        // All neighbours in one place: nothing says where to.
        if error.is_nan() || sum == 0.0 {
            return;
        }
        for ((neighbour, arm), _) in neighbours.into_iter().zip(arms).zip(on_frame).filter(|(_, on_frame)| !on_frame) {
            let [x, y] = self.at(neighbour);
            let ([to_x, to_y], part) = match error > 0.0 {
                true => (self.at(2 * neighbour - node), error * (sum - arm) / sum),
                false => (here, -error * arm / sum),
            };
            self.positions.x[neighbour] = x + part * (to_x - x);
            self.positions.y[neighbour] = y + part * (to_y - y);
        }
    }
}

/// Positions on a finer lattice over the same rectangle, bilinear in those on a coarser one.
fn refined(coarse: &Lattice, positions: &Positions, fine: &Lattice) -> Positions {
    let step = [0, 1].map(|axis| fine.spacing[axis] / coarse.spacing[axis]);
    let split = |at: usize, axis: usize| {
        let place = at as f64 * step[axis];
        let cell = (place as usize).min(coarse.nodes[axis] - 2);
        (cell, place - cell as f64)
    };
    let mut refined = Positions::from_map(fine, |p| p);
    let [columns, rows] = fine.nodes;
    for (row, column) in (1..rows - 1).flat_map(|row| (1..columns - 1).map(move |column| (row, column))) {
        let ((left, u), (above, v)) = (split(column, 0), split(row, 1));
        let node = above * coarse.nodes[0] + left;
        let mixed = |values: &[f64]| {
            let [top, bottom] = [node, node + coarse.nodes[0]].map(|at| values[at] + u * (values[at + 1] - values[at]));
            top + v * (bottom - top)
        };
        refined.x[row * columns + column] = mixed(&positions.x);
        refined.y[row * columns + column] = mixed(&positions.y);
    }
    refined
}
