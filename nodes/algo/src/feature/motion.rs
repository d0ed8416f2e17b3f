//! Pinned nodes that move together by a few numbers: exact features and nodes that slide.
//!
//! The factor holds these nodes. A motion is a field of values on some of them; all other nodes that the factor
//! solves for follow by its harmonic extension. The functional of any sum of motions is quadratic in their sizes, its
//! matrix that of the extensions' mutual energies, which knows no warp. What a warp adds is which sizes go together
//! (those of a similarity, or of a direction), and a force on every motion.

use super::rhs::{Guide, Rhs};
use super::setup::{Exact, Features, Group};
use super::{Error, local};
use crate::Watch;
use crate::lattice::Lattice;
use crate::poisson::{self, Edges, horizontal_edges, vertical_edges};
use crate::steps::{Paid, Span};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::{Mat, Par, Spec, c64};
use rayon::prelude::*;

/// Motions extended together.
const BLOCK: usize = 8;

/// Largest error of an extension, whose values are at most 1.
const TOLERANCE: f64 = 1e-12;

/// The fields of x, of y and of 1, about a group's centre and by its size, on some of its nodes: how similarities move
/// them.
const OF_A_SIMILARITY: usize = 3;

/// Values on some nodes, 0 on all other nodes that are pinned.
#[derive(Debug)]
pub(super) struct Field {
    nodes: Vec<usize>,
    values: Vec<f64>,
}

/// All motions of a factor, and what they cost.
#[derive(Debug, Default)]
pub(super) struct Motions {
    /// For every part of every group three fields; then one for every sliding node.
    pub(super) fields: Vec<Field>,
    /// Mutual energies of the extended fields, a square.
    energy: Vec<f64>,
}

/// A number that the least squares find: the fields it moves, and how far along x and y.
struct Unknown(Vec<(usize, [f64; 2])>);

/// Where a group's motions are measured from, and in which unit.
struct Ruler {
    centre: c64,
    size: f64,
}

impl Ruler {
    fn of(lattice: &Lattice, group: &Group) -> Self {
        let mut bounds = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for &node in &group.whole.nodes {
            let rest = rest(lattice, node);
            bounds = [
                [bounds[0][0].min(rest.re), bounds[0][1].min(rest.im)],
                [bounds[1][0].max(rest.re), bounds[1][1].max(rest.im)],
            ];
        }
        let [low, high] = bounds.map(|[x, y]| c64::new(x, y));
        Self { centre: (low + high) / 2.0, size: local::modulus(high - low) / 2.0 }
    }

    fn place(&self, lattice: &Lattice, node: usize) -> c64 {
        (rest(lattice, node) - self.centre) / self.size
    }
}

fn rest(lattice: &Lattice, node: usize) -> c64 {
    let [x, y] = lattice.rest(node % lattice.nodes[0], node / lattice.nodes[0]);
    c64::new(x, y)
}

fn fields(features: &Features) -> Vec<Field> {
    let lattice = &features.lattice;
    let of_group = |group: &Group| {
        let ruler = Ruler::of(lattice, group);
        let on = |nodes: &Vec<usize>| {
            let values = |of: fn(c64) -> f64| nodes.iter().map(|&node| of(ruler.place(lattice, node))).collect();
            [values(|z| z.re), values(|z| z.im), values(|_| 1.0)].map(|values| Field { nodes: nodes.clone(), values })
        };
        group.parts().flat_map(on).collect::<Vec<_>>()
    };
    let sliding = features.sliding.iter().map(|&node| Field { nodes: vec![node], values: vec![1.0] });
    features.groups.iter().flat_map(of_group).chain(sliding).collect()
}

/// The motions of a factor's exact features and sliding nodes.
pub(super) fn motions(features: &Features, factor: &poisson::Factor, watch: Watch) -> Result<Motions, Error> {
    let fields = fields(features);
    let count = fields.len();
    if count == 0 {
        return Ok(Motions::default());
    }
    let members: usize = fields.iter().map(|field| 2 * field.nodes.len()).sum();
    let nodes = features.lattice.nodes;
    let block = BLOCK.min(count) * 4 * features.lattice.node_count();
    watch.reserve((count * count + members + block) * size_of::<f64>())?;
    let still = vec![Edges::zeros(nodes); BLOCK.min(count)];
    let mut energy = Vec::with_capacity(count * count);
    for (number, block) in fields.chunks(BLOCK).enumerate() {
        watch.progress((number * BLOCK) as f64 / count as f64)?;
        let values: Vec<Vec<f64>> = block.iter().map(|field| field.spread(features.lattice.node_count())).collect();
        let values: Vec<&[f64]> = values.iter().map(Vec::as_slice).collect();
        let (first, again) = (Span::new(watch, 0.0, 0.0), Paid(watch));
        // What the first block took the others take again.
        let asked: Watch = if number == 0 { &first } else { &again };
        let solution = factor.solve(&still[..block.len()], &values, TOLERANCE, asked)?;
        let row = |extended: &Vec<f64>| {
            let forces = forces(nodes, factor.conductances(), &still[0], extended);
            fields.iter().map(|field| -field.dot(&forces)).collect::<Vec<f64>>()
        };
        let rows: Vec<Vec<f64>> = solution.fields.par_iter().map(row).collect();
        energy.extend(rows.into_iter().flatten());
    }
    Ok(Motions { fields, energy })
}

impl Field {
    fn spread(&self, count: usize) -> Vec<f64> {
        let mut all = vec![0.0; count];
        self.add_to(&mut all, 1.0);
        all
    }

    fn add_to(&self, all: &mut [f64], size: f64) {
        self.nodes.iter().zip(&self.values).for_each(|(&node, value)| all[node] += size * value);
    }

    fn dot(&self, all: &[f64]) -> f64 {
        self.nodes.iter().zip(&self.values).map(|(&node, value)| all[node] * value).sum()
    }
}

/// What pulls every node: `div (flux - c grad x)`, minus half the gradient of the functional.
fn forces(nodes: [usize; 2], conductances: &Edges, flux: &Edges, x: &[f64]) -> Vec<f64> {
    let mut forces = vec![0.0; x.len()];
    let mut pull = |c: f64, flux: f64, from: usize, to: usize| {
        let force = flux - c * (x[to] - x[from]);
        forces[to] += force;
        forces[from] -= force;
    };
    for (edge, from, to) in horizontal_edges(nodes) {
        pull(conductances.horizontal[edge], flux.horizontal[edge], from, to);
    }
    for (edge, from, to) in vertical_edges(nodes) {
        pull(conductances.vertical[edge], flux.vertical[edge], from, to);
    }
    forces
}

impl Motions {
    /// Whether there is anything to move.
    pub(super) fn is_empty(&self) -> bool {
        self.fields.is_empty()
    }

    pub(super) fn bytes(&self) -> usize {
        let members: usize = self.fields.iter().map(|field| field.nodes.len()).sum();
        (self.energy.len() + 2 * members) * size_of::<f64>()
    }

    /// Displacements of the nodes held by the factor to begin with: those of exact features go where their guides put
    /// them, centred on where the warp puts them; all others stay.
    pub(super) fn begin(rhs: &Rhs) -> [Vec<f64>; 2] {
        let features = &rhs.factor.features;
        let (lattice, warp) = (&features.lattice, rhs.warp);
        let mut begin = [vec![0.0; warp.x.len()], vec![0.0; warp.x.len()]];
        for (group, guide) in features.groups.iter().zip(&rhs.guides) {
            let centre = Ruler::of(lattice, group).centre;
            let turned = |node: usize| guide.map(rest(lattice, node) - centre);
            let off = |node: usize| c64::new(warp.x[node], warp.y[node]) - turned(node);
            let mut moving = group.moving(rhs.keeps_shape()).peekable();
            let Some(&first) = moving.peek() else { continue };
            let sum = first.iter().map(|&node| off(node)).fold(c64::new(0.0, 0.0), |sum, off| sum + off);
            let shift = sum / first.len() as f64;
            for &node in moving.flatten() {
                let displacement = shift - off(node);
                [begin[0][node], begin[1][node]] = [displacement.re, displacement.im];
            }
        }
        begin
    }

    /// Moves the nodes held by the factor to where the functional is least, from displacements of all nodes that
    /// solve for the ones held now.
    ///
    /// Time O(k^3) for k motions, memory O(k^2).
    pub(super) fn settle(
        &self,
        rhs: &Rhs,
        solved: &[Vec<f64>],
        held: &mut [Vec<f64>; 2],
        watch: Watch,
    ) -> Result<(), Error> {
        let features = &rhs.factor.features;
        let unknowns = unknowns(rhs);
        if unknowns.is_empty() {
            return Ok(());
        }
        watch.reserve((unknowns.len() * unknowns.len() + held[0].len()) * size_of::<f64>())?;
        let conductances = rhs.factor.conductances();
        let pulls = [0, 1].map(|axis| {
            let forces = forces(features.lattice.nodes, conductances, &rhs.fluxes[axis], &solved[axis]);
            self.fields.iter().map(|field| field.dot(&forces)).collect::<Vec<f64>>()
        });
        for (unknown, size) in unknowns.iter().zip(self.sizes(&unknowns, &pulls, watch)?) {
            for &(field, along) in &unknown.0 {
                held.iter_mut().zip(along).for_each(|(held, along)| self.fields[field].add_to(held, size * along));
            }
        }
        Ok(())
    }

    /// The sizes of the unknowns that the pulls on the fields bring about.
    fn sizes(&self, unknowns: &[Unknown], pulls: &[Vec<f64>; 2], watch: Watch) -> Result<Vec<f64>, Error> {
        let (n, m) = (unknowns.len(), self.fields.len());
        let mutual = |a: &Unknown, b: &Unknown| {
            let pairs = a.0.iter().flat_map(|one| b.0.iter().map(move |other| (one, other)));
            // Of both halves, which differ by rounding, the mean.
            let energy = |i: usize, j: usize| 0.5 * (self.energy[i * m + j] + self.energy[j * m + i]);
            pairs.map(|(&(i, p), &(j, q))| energy(i, j) * (p[0] * q[0] + p[1] * q[1])).sum::<f64>()
        };
        let mut matrix = Mat::<f64>::zeros(n, n);
        for (row, one) in unknowns.iter().enumerate() {
            watch.go_on()?;
            for (column, other) in unknowns[..=row].iter().enumerate() {
                matrix[(row, column)] = mutual(one, other);
            }
        }
        let pull = |unknown: &Unknown| {
            unknown.0.iter().map(|&(field, along)| pulls[0][field] * along[0] + pulls[1][field] * along[1]).sum::<f64>()
        };
        let mut sizes = Mat::<f64>::from_fn(n, 1, |row, _| pull(&unknowns[row]));
        let request = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Spec::default());
        let mut scratch = MemBuffer::try_new(request).map_err(|_| poisson::Error::OutOfMemory)?;
        let stack = MemStack::new(&mut scratch);
        llt::factor::cholesky_in_place(matrix.as_mut(), Default::default(), Par::Seq, stack, Spec::default())
            .map_err(|_| poisson::Error::NotPositiveDefinite)?;
        llt::solve::solve_in_place(matrix.as_ref(), sizes.as_mut(), Par::Seq, MemStack::new(&mut scratch));
        Ok(sizes.col_as_slice(0).to_vec())
    }
}

/// The numbers to find for a warp.
fn unknowns(rhs: &Rhs) -> Vec<Unknown> {
    let features = &rhs.factor.features;
    let mut unknowns = Vec::new();
    let mut first = 0;
    for (group, guide) in features.groups.iter().zip(&rhs.guides) {
        let parts = group.moving(rhs.keeps_shape()).count();
        // One node alone says nothing about a rotation.
        let turns = features.exact == Exact::Similarity && group.moving(rhs.keeps_shape()).flatten().count() > 1;
        let of_one_part = guide.unknowns(turns);
        unknowns.extend(of_one_part.filter(|_| parts > 0).map(|moves| {
            let of_part = |part: usize| {
                let start = first + part * OF_A_SIMILARITY;
                moves.iter().map(move |&(field, along)| (start + field, along))
            };
            Unknown((0..parts).flat_map(of_part).collect())
        }));
        first += OF_A_SIMILARITY * group.parts().count();
    }
    for (number, &node) in features.sliding.iter().enumerate() {
        unknowns.extend(rhs.tangent(node).map(|along| Unknown(vec![(first + number, along)])));
    }
    unknowns
}

impl Guide {
    /// Image of a vector.
    fn map(&self, z: c64) -> c64 {
        self.turn * if self.mirrored { z.conj() } else { z }
    }

    /// The parts of `a z + b`, or `a conj(z) + b`, that may change: b, and a if it `turns`. Each as the fields x, y
    /// and 1 that it moves, numbered from 0, and how far.
    fn unknowns(&self, turns: bool) -> impl Iterator<Item = Vec<(usize, [f64; 2])>> {
        let down = if self.mirrored { -1.0 } else { 1.0 };
        let a = [vec![(0, [1.0, 0.0]), (1, [0.0, down])], vec![(0, [0.0, 1.0]), (1, [-down, 0.0])]];
        let b = [vec![(2, [1.0, 0.0])], vec![(2, [0.0, 1.0])]];
        a.into_iter().filter(move |_| turns).chain(b)
    }
}
