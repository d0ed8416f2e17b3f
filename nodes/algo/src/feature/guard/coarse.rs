//! The functional on every other node of the lattice, for a start from afar.

use super::functional::{difference, moved};
use super::{Freedom, Functional};
use crate::lattice::{Lattice, Positions, is_on_border};
use crate::poisson::Edges;

/// Lattices with a side of fewer nodes are not halved.
const SMALLEST: usize = 33;

/// A functional on a halved lattice: every other column and row, and the last ones.
///
/// Where a count of nodes is even the last cells are half as wide or high as the others; their Jacobians are by the
/// whole area all the same, so they count as nearer to a fold than they are.
pub(super) struct Coarse {
    /// Columns and rows of the fine lattice.
    nodes: [usize; 2],
    lattice: Lattice,
    /// The columns and rows that are left.
    kept: [Vec<usize>; 2],
    conductances: Edges,
    fluxes: [Edges; 2],
    base: Positions,
    freedom: Vec<Freedom>,
}

impl Coarse {
    /// Halves a functional; none where its lattice is small, or pinned elsewhere than on its frame.
    ///
    /// Displacements are thought linear along the new edges and between them. The fine edges of a new edge lie in
    /// series; those of a line left out count half for each of the lines beside it.
    pub(super) fn new(functional: &Functional) -> Option<Self> {
        let nodes = functional.lattice.nodes;
        let expected = |node: usize| if is_on_border(nodes, node) { Freedom::Pinned } else { Freedom::Free };
        if nodes[0].min(nodes[1]) < SMALLEST
            || (0..nodes[0] * nodes[1]).any(|node| functional.freedom[node] != expected(node))
        {
            return None;
        }
        let kept = nodes.map(kept);
        let of_kept = |edges: &Edges, along: fn(f64) -> f64| halved(edges, nodes, &kept, along);
        let lattice = Lattice {
            spacing: functional.lattice.spacing.map(|h| 2.0 * h),
            nodes: [kept[0].len(), kept[1].len()],
            ..*functional.lattice
        };
        let coarse = Self {
            nodes,
            lattice,
            conductances: of_kept(functional.conductances, |length| length * length),
            fluxes: [0, 1].map(|axis| of_kept(&functional.fluxes[axis], |length| length)),
            base: at_kept(functional.base, nodes, &kept),
            freedom: Vec::new(),
            kept,
        };
        let nodes_left =
            coarse.kept[1].iter().flat_map(|&row| coarse.kept[0].iter().map(move |&column| row * nodes[0] + column));
        let freedom = nodes_left.map(|node| functional.freedom[node]).collect();
        Some(Self { freedom, ..coarse })
    }

    pub(super) fn functional(&self) -> Functional<'_> {
        Functional {
            lattice: &self.lattice,
            conductances: &self.conductances,
            fluxes: &self.fluxes,
            base: &self.base,
            freedom: &self.freedom,
        }
    }

    /// Positions of the nodes that are left.
    pub(super) fn injected(&self, x: &Positions) -> Positions {
        at_kept(x, self.nodes, &self.kept)
    }

    /// `fine` moved as the nodes that are left move from `from` to `to`, linearly between them.
    pub(super) fn prolonged(&self, from: &Positions, to: &Positions, fine: &Positions) -> Positions {
        let columns = self.kept[0].len();
        let nodes = self.nodes;
        let step = difference(from, to).map(|d| {
            let value = |node: usize| {
                let (column, row) = (node % nodes[0], node / nodes[0]);
                let [left, right] = beside(column, nodes[0]);
                let [above, below] = beside(row, nodes[1]);
                0.25 * (d[above * columns + left]
                    + d[above * columns + right]
                    + d[below * columns + left]
                    + d[below * columns + right])
            };
            (0..nodes[0] * nodes[1]).map(value).collect()
        });
        moved(fine, &step, 1.0)
    }
}

/// The lines kept of `count`.
fn kept(count: usize) -> Vec<usize> {
    (0..count - 1).step_by(2).chain([count - 1]).collect()
}

/// The kept lines on both sides of a line, or twice the line itself.
fn beside(line: usize, count: usize) -> [usize; 2] {
    if line + 1 == count { [count / 2; 2] } else { [line / 2, line.div_ceil(2)] }
}

fn at_kept(x: &Positions, nodes: [usize; 2], [columns, rows]: &[Vec<usize>; 2]) -> Positions {
    let pick = |values: &[f64]| {
        rows.iter().flat_map(|row| columns.iter().map(move |column| values[row * nodes[0] + column])).collect()
    };
    Positions { x: pick(&x.x), y: pick(&x.y) }
}

/// Sums of the fine edges' values over `along` of how many make a new edge.
fn halved(edges: &Edges, nodes: [usize; 2], kept: &[Vec<usize>; 2], along: fn(f64) -> f64) -> Edges {
    let mut sum = Edges::zeros([kept[0].len(), kept[1].len()]);
    let columns = kept[0].len();
    for row in 0..nodes[1] {
        for (edge, pair) in kept[0].windows(2).enumerate() {
            let from = row * (nodes[0] - 1);
            let total: f64 = edges.horizontal[from + pair[0]..from + pair[1]].iter().sum();
            for line in beside(row, nodes[1]) {
                sum.horizontal[line * (columns - 1) + edge] += 0.5 * total / along((pair[1] - pair[0]) as f64);
            }
        }
    }
    for column in 0..nodes[0] {
        for (edge, pair) in kept[1].windows(2).enumerate() {
            let total: f64 = (pair[0]..pair[1]).map(|row| edges.vertical[row * nodes[0] + column]).sum();
            for line in beside(column, nodes[0]) {
                sum.vertical[edge * columns + line] += 0.5 * total / along((pair[1] - pair[0]) as f64);
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_kept_and_found_beside() {
        assert_eq!(kept(5), [0, 2, 4]);
        assert_eq!(kept(6), [0, 2, 4, 5]);
        for count in [33, 34, 40, 41] {
            let kept = kept(count);
            for line in 0..count {
                let [before, after] = beside(line, count).map(|index| kept[index]);
                assert!(before <= line && line <= after && after - before <= 2, "{line} of {count}");
                assert_eq!(before == line, after == line, "{line} of {count}");
            }
        }
    }

    /// The energy of a displacement that is linear in x and in y is that of the halved functional.
    #[test]
    fn linear_displacements_keep_their_energy() {
        for nodes in [[33, 35], [41, 33], [34, 40]] {
            let lattice = Lattice { origin: [0.0; 2], spacing: [1.0, 1.5], nodes };
            let base = Positions::from_map(&lattice, |p| p);
            let count = lattice.node_count();
            let edges = |f: fn(f64) -> f64| {
                let mut edges = Edges::zeros(nodes);
                edges
                    .horizontal
                    .iter_mut()
                    .chain(&mut edges.vertical)
                    .enumerate()
                    .for_each(|(e, value)| *value = f(e as f64));
                edges
            };
            let conductances = edges(|e| 2.0 + (0.7 * e).sin());
            let fluxes = [edges(|e| (1.3 * e).cos()), edges(|e| (0.9 * e).sin())];
            let freedom: Vec<Freedom> = (0..count)
                .map(|node| if is_on_border(nodes, node) { Freedom::Pinned } else { Freedom::Free })
                .collect();
            let fine = Functional {
                lattice: &lattice,
                conductances: &conductances,
                fluxes: &fluxes,
                base: &base,
                freedom: &freedom,
            };
            let coarse = Coarse::new(&fine).expect("large enough");
            let x = Positions::from_map(&lattice, |[x, y]| [1.1 * x + 0.2 * y, 0.9 * y - 0.3 * x]);
            let below = coarse.injected(&x);
            let (expected, found) = (fine.energy(&x), coarse.functional().energy(&below));
            assert!((expected - found).abs() < 1e-9 * expected.abs(), "{found} for {expected}");
            let back = coarse.prolonged(&coarse.base, &below, &base);
            assert!(back.x.iter().zip(&x.x).all(|(a, b)| (a - b).abs() < 1e-10));
        }
    }
}
