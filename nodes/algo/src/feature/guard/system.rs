//! The linear systems of Newton's steps: x and y of all nodes that may move, coupled within cells.

use super::shape::{Corner, Field};
use super::{Error, Freedom, Functional};
use crate::Watch;
use crate::dissection::dissection;
use crate::poisson::{self, Edges};
use crate::room::Room;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side, Spec};

/// Bytes per unknown of the matrix, its order and its symbolic factorization.
const SYMBOLIC_BYTES: usize = 480;

/// Bytes per node of what a step holds beside the factor: blocks, gradient, step and positions and corners.
const STEP_BYTES: usize = 480;

/// Second derivatives between nodes of a cell, 2 x 2 each: of every node with itself, and with the nodes right of it,
/// below to the left, below, and below to the right.
#[derive(Clone)]
pub(super) struct Blocks {
    columns: usize,
    of_node: Vec<[[f64; 4]; 5]>,
}

/// First unknown of a node, and the directions of its unknowns.
type Place = (u32, [[f64; 2]; 2]);

/// The pattern of a system, its factor, and room to work in.
pub(super) struct System {
    nodes: [usize; 2],
    places: Vec<Place>,
    /// Unknowns of each node.
    counts: Vec<u8>,
    pattern: SymbolicSparseColMat<u32>,
    matrix: Vec<f64>,
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
    scratch: MemBuffer,
    /// That it and its steps hold, and what is held beside.
    pub(super) bytes: usize,
}

impl Blocks {
    pub(super) fn new(functional: &Functional) -> Self {
        let [columns, rows] = functional.lattice.nodes;
        let mut of_node = vec![[[0.0; 4]; 5]; columns * rows];
        let mut edge = |from: usize, to: usize, way: usize, c: f64| {
            for i in [0, 3] {
                of_node[from][0][i] += 2.0 * c;
                of_node[to][0][i] += 2.0 * c;
                of_node[from][way][i] -= 2.0 * c;
            }
        };
        let Edges { horizontal, vertical } = functional.conductances;
        functional.horizontal().for_each(|(e, from, to)| edge(from, to, 1, horizontal[e]));
        functional.vertical().for_each(|(e, from, to)| edge(from, to, 3, vertical[e]));
        Self { columns, of_node }
    }

    /// Adds a matrix in the edges (a, b) of a corner, a to the next node and b to the previous one.
    pub(super) fn add_corner(&mut self, [node, next, previous]: Corner, m: &[[f64; 4]; 4]) {
        let part = |rows: usize, columns: usize| {
            [m[rows][columns], m[rows][columns + 1], m[rows + 1][columns], m[rows + 1][columns + 1]]
        };
        let (aa, ab, ba, bb) = (part(0, 0), part(0, 2), part(2, 0), part(2, 2));
        let sum = |a: [f64; 4], b: [f64; 4], sign: f64| [0, 1, 2, 3].map(|i| sign * (a[i] + b[i]));
        self.add(next, next, aa);
        self.add(previous, previous, bb);
        self.add(next, previous, ab);
        self.add(node, next, sum(aa, ba, -1.0));
        self.add(node, previous, sum(ab, bb, -1.0));
        self.add(node, node, sum(sum(aa, ab, 1.0), sum(ba, bb, 1.0), 1.0));
    }

    /// Adds the derivatives by `p` (rows) and by `q` (columns), two nodes of a cell.
    fn add(&mut self, p: usize, q: usize, block: [f64; 4]) {
        let [first, second, third, fourth] = block;
        let (from, to, block) = if p <= q { (p, q, block) } else { (q, p, [first, third, second, fourth]) };
        let way = match to - from {
            0 => 0,
            1 if to / self.columns == from / self.columns => 1,
            apart => apart + 3 - self.columns,
        };
        (0..4).for_each(|i| self.of_node[from][way][i] += block[i]);
    }
}

impl System {
    /// The system of a lattice whose nodes may move so; None where none may.
    ///
    /// Every cell couples all its nodes, so one symbolic factorization serves whatever corners are active.
    ///
    /// * `before`: bytes that are held beside it meanwhile.
    pub(super) fn new(
        nodes: [usize; 2],
        freedom: &[Freedom],
        before: usize,
        room: &mut Room,
        watch: Watch,
    ) -> Result<Option<Self>, Error> {
        let (places, counts, n) = places(freedom);
        if n == 0 {
            return Ok(None);
        }
        if n > i32::MAX as usize / 12 {
            return Err(poisson::Error::TooLarge.into());
        }
        room.phase(before + n * SYMBOLIC_BYTES)?;
        watch.go_on()?;
        let pattern = pattern(nodes, &places, &counts, n);
        let symbolic = analyze(nodes, &places, &counts, &pattern, watch)?;
        let request = symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default())
            .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let held = symbolic.len_val() * size_of::<f64>() + request.unaligned_bytes_required();
        let bytes = before + n * SYMBOLIC_BYTES + held + freedom.len() * STEP_BYTES;
        room.phase(bytes)?;
        let mut factor = Vec::new();
        factor.try_reserve_exact(symbolic.len_val()).map_err(|_| poisson::Error::OutOfMemory)?;
        factor.resize(symbolic.len_val(), 0.0);
        let scratch = MemBuffer::try_new(request).map_err(|_| poisson::Error::OutOfMemory)?;
        let matrix = Vec::with_capacity(pattern.row_idx().len());
        Ok(Some(Self { nodes, places, counts, pattern, matrix, symbolic, factor, scratch, bytes }))
    }

    /// The step s of `blocks s = -gradient`, 0 where nodes may not move.
    ///
    /// None where the matrix is not positive definite or the step not finite.
    pub(super) fn step(&mut self, blocks: &Blocks, gradient: &Field) -> Option<Field> {
        self.fill(blocks);
        let stack = MemStack::new(&mut self.scratch);
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), &self.matrix[..]);
        let regularization = LltRegularization::default();
        let parameters = Spec::default();
        self.symbolic
            .factorize_numeric_llt(&mut self.factor, matrix, Side::Lower, regularization, Par::Seq, stack, parameters)
            .ok()?;
        let mut unknowns = vec![0.0; self.symbolic.nrows()];
        for (node, &(first, directions)) in self.places.iter().enumerate() {
            for k in 0..usize::from(self.counts[node]) {
                let [dx, dy] = directions[k];
                unknowns[first as usize + k] = -(dx * gradient[0][node] + dy * gradient[1][node]);
            }
        }
        let n = unknowns.len();
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(&mut unknowns, n, 1),
            Par::Seq,
            MemStack::new(&mut self.scratch),
        );
        unknowns.iter().all(|value| value.is_finite()).then(|| self.spread(&unknowns))
    }

    /// The step of every node.
    fn spread(&self, unknowns: &[f64]) -> Field {
        let mut step = [vec![0.0; self.places.len()], vec![0.0; self.places.len()]];
        for (node, &(first, directions)) in self.places.iter().enumerate() {
            for k in 0..usize::from(self.counts[node]) {
                step[0][node] += directions[k][0] * unknowns[first as usize + k];
                step[1][node] += directions[k][1] * unknowns[first as usize + k];
            }
        }
        step
    }

    /// Writes the matrix's values in the order of [`pattern`].
    fn fill(&mut self, blocks: &Blocks) {
        self.matrix.clear();
        for node in 0..self.places.len() {
            for i in 0..usize::from(self.counts[node]) {
                let d = self.places[node].1[i];
                for (way, other) in neighbours(node, self.nodes) {
                    let block = &blocks.of_node[node][way];
                    let row = [d[0] * block[0] + d[1] * block[2], d[0] * block[1] + d[1] * block[3]];
                    for j in if way == 0 { i } else { 0 }..usize::from(self.counts[other]) {
                        let e = self.places[other].1[j];
                        self.matrix.push(row[0] * e[0] + row[1] * e[1]);
                    }
                }
            }
        }
    }
}

/// The directions in which a node may move, and their count.
fn basis(freedom: &Freedom) -> ([[f64; 2]; 2], u8) {
    match *freedom {
        Freedom::Free => ([[1.0, 0.0], [0.0, 1.0]], 2),
        Freedom::Pinned => ([[0.0; 2]; 2], 0),
        Freedom::Along([x, y]) => {
            let length = libm::hypot(x, y);
            assert!(length.is_finite() && length > 0.0, "a direction of length {length}");
            ([[x / length, y / length], [0.0; 2]], 1)
        }
    }
}

/// The place of every node, the count of its unknowns, and that of all.
fn places(freedom: &[Freedom]) -> (Vec<Place>, Vec<u8>, usize) {
    let mut n = 0;
    let place = |freedom: &Freedom| {
        let (directions, count) = basis(freedom);
        let first = n as u32;
        n += usize::from(count);
        ((first, directions), count)
    };
    let (places, counts) = freedom.iter().map(place).unzip();
    (places, counts, n)
}

/// The structure of the factor, in the order of a nested dissection.
fn analyze(
    nodes: [usize; 2],
    places: &[Place],
    counts: &[u8],
    pattern: &SymbolicSparseColMat<u32>,
    watch: Watch,
) -> Result<SymbolicCholesky<u32>, Error> {
    let (forward, inverse) = order(nodes, places, counts);
    watch.go_on()?;
    let ordering = SymmetricOrdering::Custom(PermRef::new_checked(&forward, &inverse, forward.len()));
    let parameters = CholeskySymbolicParams {
        supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
        ..Default::default()
    };
    Ok(factorize_symbolic_cholesky(pattern.as_ref(), Side::Lower, ordering, parameters)
        .map_err(poisson::Error::from)?)
}

/// A node itself and those of its neighbours that come later, rising, with their places in [`Blocks`].
fn neighbours(node: usize, [columns, rows]: [usize; 2]) -> impl Iterator<Item = (usize, usize)> {
    let (column, row) = (node % columns, node / columns);
    let (right, below) = (column + 1 < columns, row + 1 < rows);
    [
        (true, 0, node),
        (right, 1, node + 1),
        (below && column > 0, 2, node + columns - 1),
        (below, 3, node + columns),
        (below && right, 4, node + columns + 1),
    ]
    .into_iter()
    .filter_map(|(there, way, other)| there.then_some((way, other)))
}

/// The lower triangle over the unknowns, row-major nodes, those of a node next to each other.
fn pattern(nodes: [usize; 2], places: &[Place], counts: &[u8], n: usize) -> SymbolicSparseColMat<u32> {
    let (mut starts, mut indices) = (Vec::with_capacity(n + 1), Vec::with_capacity(10 * n));
    starts.push(0);
    for node in 0..places.len() {
        for i in 0..u32::from(counts[node]) {
            for (way, other) in neighbours(node, nodes) {
                indices.extend((if way == 0 { i } else { 0 }..u32::from(counts[other])).map(|j| places[other].0 + j));
            }
            starts.push(indices.len() as u32);
        }
    }
    SymbolicSparseColMat::new_checked(n, n, starts, None, indices)
}

/// The elimination order of the unknowns and its inverse: nested dissection of the lattice.
fn order([columns, rows]: [usize; 2], places: &[Place], counts: &[u8]) -> (Vec<u32>, Vec<u32>) {
    let forward: Vec<u32> = dissection(columns, rows)
        .into_iter()
        .flat_map(|node| (0..u32::from(counts[node as usize])).map(move |k| places[node as usize].0 + k))
        .collect();
    let mut inverse = vec![0; forward.len()];
    forward.iter().enumerate().for_each(|(place, &unknown)| inverse[unknown as usize] = place as u32);
    (forward, inverse)
}
