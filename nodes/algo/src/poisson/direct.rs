//! The direct backend: sparse Cholesky in the order of a nested dissection.

use super::{Edges, Error, GridLaplacian, substitute};
use crate::Watch;
use crate::dissection::dissection;
use crate::room::Room;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::SymbolicSupernodalParams;
use faer::sparse::linalg::cholesky::simplicial::{
    prefactorize_symbolic_cholesky, prefactorize_symbolic_cholesky_scratch,
};
use faer::sparse::linalg::cholesky::supernodal::{
    SupernodalLltRef, SymbolicSupernodalCholesky, factorize_supernodal_numeric_llt,
    factorize_supernodal_numeric_llt_scratch, factorize_supernodal_symbolic_cholesky,
    factorize_supernodal_symbolic_cholesky_scratch,
};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Spec};

/// Bytes per unknown of the matrix and its order.
const MATRIX_BYTES: usize = 72;

/// Bytes per unknown that symbolic factorization takes.
const SYMBOLIC_BYTES: usize = 60;

/// Bytes that the library's products of dense blocks take beside the scratch it asks for.
const BLOCK_BYTES: usize = 4 << 20;

/// Bytes per unknown of the probe beside its solve: a field and fluxes.
const PROBE_BYTES: usize = 24;

/// From so many right-hand sides on products of dense blocks beat walks over the factor for two at a time.
const MANY: usize = 12;

/// How far neighbouring supernodes are merged: (columns together, part of zeros allowed).
const MERGE: &[(usize, f64)] = &[(4, 1.0), (16, 0.8), (48, 0.1), (usize::MAX, 0.05)];

/// A node that is not among the unknowns.
const NONE: u32 = u32::MAX;

#[derive(Debug)]
pub(super) struct Cholesky {
    /// Node of every unknown, in order of elimination.
    order: Vec<u32>,
    symbolic: SymbolicSupernodalCholesky<u32>,
    pub(super) values: Vec<f64>,
}

impl Cholesky {
    /// Factors a Laplacian with at least one unknown.
    pub(super) fn new(laplacian: &GridLaplacian, watch: Watch) -> Result<Self, Error> {
        watch.progress(0.0)?;
        let (n, mut room) = (laplacian.unknowns(), Room::new(watch));
        let count = laplacian.nodes[0] * laplacian.nodes[1];
        if count > i32::MAX as usize / 5 {
            return Err(Error::TooLarge);
        }
        room.phase(count.saturating_mul(MATRIX_BYTES + SYMBOLIC_BYTES))?;
        let order = elimination_order(laplacian);
        let matrix = matrix(laplacian, &order, watch)?;
        watch.progress(0.05)?;
        let symbolic = analyze(&matrix)?;
        watch.progress(0.2)?;
        let request = factorize_supernodal_numeric_llt_scratch::<u32, f64>(&symbolic, Par::Seq, Spec::default());
        let mut cholesky = Self { order, symbolic, values: Vec::new() };
        let (length, held) = (cholesky.symbolic.len_val(), cholesky.bytes());
        let held = held + length * size_of::<f64>();
        room.phase(held + n * MATRIX_BYTES + request.unaligned_bytes_required() + BLOCK_BYTES)?;
        room.phase(held + cholesky.solve_bytes(count, 1) + n * PROBE_BYTES)?;
        cholesky.values.try_reserve_exact(length).map_err(|_| Error::OutOfMemory)?;
        cholesky.values.resize(length, 0.0);
        factorize_supernodal_numeric_llt(
            &mut cholesky.values,
            matrix.as_ref(),
            LltRegularization::default(),
            &cholesky.symbolic,
            Par::Seq,
            MemStack::new(&mut scratch(request)?),
            Spec::default(),
        )
        .map_err(|_| Error::NotPositiveDefinite)?;
        Ok(cholesky)
    }

    /// Adds to the unknowns of every field the solution for the right-hand side of the same number, both over all
    /// nodes.
    pub(super) fn add_solutions(&self, right_hand_sides: &[Vec<f64>], fields: &mut [Vec<f64>]) -> Result<(), Error> {
        let step = if fields.len() < MANY { 2 } else { fields.len() };
        let n = self.order.len();
        let mut x = vec![0.0; n * step];
        for (right_hand_sides, fields) in right_hand_sides.chunks(step).zip(fields.chunks_mut(step)) {
            x.fill(0.0);
            for (x, b) in x.chunks_mut(n).zip(right_hand_sides) {
                x.iter_mut().zip(&self.order).for_each(|(x, &node)| *x = b[node as usize]);
            }
            self.substitute(&mut x, step)?;
            for (x, field) in x.chunks(n).zip(fields) {
                x.iter().zip(&self.order).for_each(|(x, &node)| field[node as usize] += x);
            }
        }
        Ok(())
    }

    /// Solves in place for `count` right-hand sides in order of elimination, one after the other.
    fn substitute(&self, x: &mut [f64], count: usize) -> Result<(), Error> {
        let n = self.order.len();
        if let (2, (one, two)) = (count, x.split_at_mut(n)) {
            substitute::solve(&self.symbolic, &self.values, [one, two]);
            return Ok(());
        }
        SupernodalLltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(x, n, count),
            Par::Seq,
            MemStack::new(&mut scratch(self.symbolic.solve_in_place_scratch::<f64>(count, Par::Seq))?),
        );
        Ok(())
    }

    /// Bytes held: order, indices and values.
    pub(super) fn bytes(&self) -> usize {
        let indices = self.symbolic.row_idx().len() + 5 * self.symbolic.n_supernodes();
        self.values.len() * size_of::<f64>() + (self.order.len() + indices) * size_of::<u32>()
    }

    /// Bytes that a solve for `together` right-hand sides over `count` nodes takes beside the fields: remainders before
    /// and after a step, unknowns, scratch.
    pub(super) fn solve_bytes(&self, count: usize, together: usize) -> usize {
        let scratch = match together {
            MANY.. => self.symbolic.solve_in_place_scratch::<f64>(together, Par::Seq).unaligned_bytes_required(),
            _ => 0,
        };
        2 * together * count * size_of::<f64>() + together.max(2) * self.order.len() * size_of::<f64>() + scratch
    }
}

/// The nodes of the unknowns in order of a nested dissection.
fn elimination_order(laplacian: &GridLaplacian) -> Vec<u32> {
    let mut order = dissection(laplacian.nodes[0], laplacian.nodes[1]);
    order.retain(|&node| !laplacian.pins.holds(node as usize, laplacian.nodes));
    order
}

/// The matrix over the unknowns, both triangles, columns in order of elimination, entries of a column in none.
fn matrix(laplacian: &GridLaplacian, order: &[u32], watch: Watch) -> Result<SparseColMat<u32, f64>, Error> {
    let [columns, rows] = laplacian.nodes;
    let Edges { horizontal, vertical } = &laplacian.conductances;
    let mut unknown_of = vec![NONE; columns * rows];
    order.iter().enumerate().for_each(|(unknown, &node)| unknown_of[node as usize] = unknown as u32);
    let n = order.len();
    let (mut starts, mut indices, mut values) =
        (Vec::with_capacity(n + 1), Vec::with_capacity(5 * n), Vec::with_capacity(5 * n));
    starts.push(0);
    for (unknown, &node) in order.iter().enumerate() {
        if unknown % (1 << 16) == 0 {
            watch.go_on()?;
        }
        let node = node as usize;
        let (column, row) = (node % columns, node / columns);
        let (at, mut diagonal) = (values.len(), 0.0);
        indices.push(unknown as u32);
        values.push(0.0);
        let mut couple = |neighbour: usize, conductance: f64| {
            diagonal += conductance;
            if unknown_of[neighbour] != NONE {
                indices.push(unknown_of[neighbour]);
                values.push(-conductance);
            }
        };
        if column > 0 {
            couple(node - 1, horizontal[node - row - 1]);
        }
        if column + 1 < columns {
            couple(node + 1, horizontal[node - row]);
        }
        if row > 0 {
            couple(node - columns, vertical[node - columns]);
        }
        if row + 1 < rows {
            couple(node + columns, vertical[node]);
        }
        values[at] = diagonal;
        starts.push(values.len() as u32);
    }
    Ok(SparseColMat::new(SymbolicSparseColMat::new_unsorted_checked(n, n, starts, None, indices), values))
}

/// The structure of the factor.
fn analyze(matrix: &SparseColMat<u32, f64>) -> Result<SymbolicSupernodalCholesky<u32>, Error> {
    let n = matrix.ncols();
    let request = StackReq::or(
        prefactorize_symbolic_cholesky_scratch::<u32>(n, matrix.compute_nnz()),
        factorize_supernodal_symbolic_cholesky_scratch::<u32>(n),
    );
    let mut scratch = scratch(request)?;
    let stack = MemStack::new(&mut scratch);
    let (mut parents, mut counts) = (vec![0_i32; n], vec![0_u32; n]);
    let tree = prefactorize_symbolic_cholesky(&mut parents, &mut counts, matrix.symbolic(), stack);
    let parameters = SymbolicSupernodalParams { relax: Some(MERGE) };
    Ok(factorize_supernodal_symbolic_cholesky(matrix.symbolic(), tree, &counts, stack, parameters)?)
}

fn scratch(request: StackReq) -> Result<MemBuffer, Error> {
    MemBuffer::try_new(request).map_err(|_| Error::OutOfMemory)
}
