//! The map itself: a lattice with its nodes' positions, continued past its border.

use super::block::fetch;
use super::cell::Corners;
use crate::lattice::{Lattice, Positions};

/// Rows between the one evaluated and the one fetched.
const AHEAD: usize = 4;

/// A lattice with its nodes' positions: bilinear between nodes, the border cells' patches continued outside.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Net<'a> {
    pub lattice: &'a Lattice,
    pub positions: &'a Positions,
}

/// Where a coordinate stands along one axis of a lattice: at `node + t * (next - node)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    pub node: usize,
    pub next: usize,
    pub t: f64,
}

impl Place {
    /// At a node.
    pub fn at_node(node: usize) -> Self {
        Self { node, next: node, t: 0.0 }
    }

    /// `cells` after the first of `count` nodes; before it and after the last one, in the border cell continued.
    pub fn at(cells: f64, count: usize) -> Self {
        let last = count - 1;
        if cells <= 0.0 {
            Self { node: 0, next: 1, t: cells }
        } else if cells >= last as f64 {
            Self { node: last, next: last - 1, t: last as f64 - cells }
        } else {
            let node = cells as usize;
            Self { node, next: node + 1, t: cells - node as f64 }
        }
    }

    #[inline(always)]
    pub fn blend(self, from: f64, to: f64) -> f64 {
        from + self.t * (to - from)
    }
}

impl<'a> Net<'a> {
    pub fn new(lattice: &'a Lattice, positions: &'a Positions) -> Self {
        assert!(lattice.nodes.iter().all(|&count| count >= 2), "a lattice has at least 2 x 2 nodes");
        assert!(lattice.spacing.iter().all(|&spacing| spacing > 0.0), "a lattice's spacing is positive");
        let count = lattice.node_count();
        assert!(positions.x.len() == count && positions.y.len() == count, "one position per node, {count}");
        Self { lattice, positions }
    }

    /// Place of the rest coordinate `at`, px, along `axis` (0 = x).
    pub fn place(&self, axis: usize, at: f64) -> Place {
        Place::at((at - self.lattice.origin[axis]) / self.lattice.spacing[axis], self.lattice.nodes[axis])
    }

    /// Place of the centre of pixel `pixel` along `axis`. On a node it needs no other, which may be non-finite.
    pub fn center(&self, axis: usize, pixel: i64) -> Place {
        let place = self.place(axis, pixel as f64 + 0.5);
        if place.t == 0.0 { Place::at_node(place.node) } else { place }
    }

    /// The corners of one of the lattice's own cells, [column, row].
    pub fn corners(&self, [column, row]: [usize; 2]) -> Corners {
        let Positions { x, y } = self.positions;
        let node = row * self.lattice.nodes[0] + column;
        let below = node + self.lattice.nodes[0];
        [node, node + 1, below + 1, below].map(|node| [x[node], y[node]])
    }

    /// One coordinate of the map on the line at `place`, at the columns of nodes from `first` on.
    #[inline(always)]
    pub fn line(&self, axis: usize, place: Place, first: usize, out: &mut [f64]) {
        let (values, columns) = ([&self.positions.x, &self.positions.y][axis], self.lattice.nodes[0]);
        let [here, next] = [place.node, place.next].map(|row| &values[row * columns + first..][..out.len()]);
        if let Some(ahead) = values.get((place.next + AHEAD) * columns + first..) {
            fetch(&ahead[..out.len().min(ahead.len())]);
        }
        for ((out, &here), &next) in out.iter_mut().zip(here).zip(next) {
            *out = place.blend(here, next);
        }
    }

    /// The map at a place; not finite where a node it needs is not.
    pub fn position(&self, x: Place, y: Place) -> [f64; 2] {
        let columns = self.lattice.nodes[0];
        [&self.positions.x, &self.positions.y].map(|values| {
            let along = |row: usize| x.blend(values[row * columns + x.node], values[row * columns + x.next]);
            y.blend(along(y.node), along(y.next))
        })
    }
}

/// Places beside each other along a line of nodes.
pub(super) struct Columns {
    steps: Vec<f64>,
    /// Where runs of places between the same two nodes end, and those nodes.
    runs: Vec<(usize, [usize; 2])>,
    /// How much farther the next node is, where there is one place per node from the first on.
    dense: Option<usize>,
}

impl Columns {
    /// `first`: the first of the nodes.
    pub fn new(places: &[Place], first: usize) -> Self {
        let nodes = |place: &Place| [place.node - first, place.next - first];
        let mut end = 0;
        let runs = places.chunk_by(|a, b| nodes(a) == nodes(b)).map(|run| {
            end += run.len();
            (end, nodes(&run[0]))
        });
        let step = places.first().map_or(0, |place| place.next.saturating_sub(place.node));
        let dense = places.iter().enumerate().all(|(i, place)| nodes(place) == [i, i + step]);
        Self { runs: runs.collect(), steps: places.iter().map(|place| place.t).collect(), dense: dense.then_some(step) }
    }

    /// One coordinate at the places, by that of the nodes.
    #[inline(always)]
    pub fn blend(&self, nodes: &[f64], out: &mut [f64]) {
        if let Some(step) = self.dense {
            for (((out, here), next), t) in out.iter_mut().zip(nodes).zip(&nodes[step..]).zip(&self.steps) {
                *out = here + t * (next - here);
            }
            return;
        }
        let mut start = 0;
        for &(end, [node, next]) in &self.runs {
            let (from, step) = (nodes[node], nodes[next] - nodes[node]);
            for (out, t) in out[start..end].iter_mut().zip(&self.steps[start..end]) {
                *out = from + t * step;
            }
            start = end;
        }
    }
}

/// The lattice's nodes along one axis and the rings of its continuation before and after them.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    /// Rest coordinate of each node, px, rising.
    pub stops: Vec<f64>,
    pub places: Vec<Place>,
    /// Rings before the first of the lattice's own nodes.
    pub before: usize,
    /// The lattice's own nodes.
    pub nodes: usize,
}

impl Axis {
    /// Continued by `reach` = [before, after] px (nothing where that is not positive).
    pub fn new(net: &Net, axis: usize, reach: [f64; 2]) -> Self {
        let (origin, spacing) = (net.lattice.origin[axis], net.lattice.spacing[axis]);
        let nodes = net.lattice.nodes[axis];
        let last = nodes - 1;
        let end = origin + last as f64 * spacing;
        let [before, after] = reach.map(|reach| ring_distances(reach / spacing));
        let mut stops: Vec<f64> = before.iter().rev().map(|distance| origin - distance * spacing).collect();
        stops.extend((0..nodes).map(|node| origin + node as f64 * spacing));
        stops.extend(after.iter().map(|distance| end + distance * spacing));
        let mut places: Vec<Place> = before.iter().rev().map(|d| Place { node: 0, next: 1, t: -d }).collect();
        places.extend((0..nodes).map(Place::at_node));
        places.extend(after.iter().map(|d| Place { node: last, next: last - 1, t: -d }));
        Self { stops, places, before: before.len(), nodes }
    }

    pub fn cells(&self) -> usize {
        self.stops.len() - 1
    }

    /// The cells that are the lattice's own.
    pub fn own(&self) -> std::ops::Range<usize> {
        self.before..self.before + self.nodes - 1
    }

    /// The lattice's own cell that `cell` is or continues.
    pub fn origin_cell(&self, cell: usize) -> usize {
        cell.saturating_sub(self.before).min(self.nodes - 2)
    }
}

/// Distances of the rings' outer nodes from the border, in cells: doubling, so that few rings reach far and a
/// patch that folds far out costs only its outer pieces.
fn ring_distances(reach: f64) -> Vec<f64> {
    let mut distances = Vec::new();
    if reach > 0.0 && reach.is_finite() {
        let mut distance = 1.0;
        while distance < reach {
            distances.push(distance);
            distance *= 2.0;
        }
        distances.push(reach);
    }
    distances
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn continues_the_border_patch() {
        let lattice = Lattice { origin: [1.0, -2.0], spacing: [2.0, 4.0], nodes: [3, 2] };
        // One bilinear function is its own continuation.
        let map = |[x, y]: [f64; 2]| [x + 0.25 * y + 0.125 * x * y, 3.0 - x + 0.5 * x * y];
        let positions = Positions::from_map(&lattice, map);
        let net = Net::new(&lattice, &positions);
        for at in [[1.0, -2.0], [2.5, 0.0], [5.0, 2.0], [-7.0, -6.0], [9.0, 1.0], [3.0, 30.0], [40.0, 40.0]] {
            let [x, y] = net.position(net.place(0, at[0]), net.place(1, at[1]));
            let [ex, ey] = map(at);
            assert!((x - ex).abs() < 1e-12 && (y - ey).abs() < 1e-12, "{at:?}: {x} {y}, not {ex} {ey}");
        }
    }

    #[test]
    fn axis_rings_double_and_end_at_the_reach() {
        let lattice = Lattice { origin: [0.0, 0.0], spacing: [2.0, 1.0], nodes: [3, 2] };
        let positions = Positions::from_map(&lattice, |p| p);
        let axis = Axis::new(&Net::new(&lattice, &positions), 0, [5.0, 0.0]);
        assert_eq!(axis.stops, [-5.0, -4.0, -2.0, 0.0, 2.0, 4.0]);
        assert_eq!((axis.before, axis.own(), axis.cells()), (3, 3..5, 5));
        assert_eq!([0, 2, 3, 4].map(|cell| axis.origin_cell(cell)), [0, 0, 0, 1]);
    }
}
