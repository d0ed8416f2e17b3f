//! A factored energy, and what handles feel of it.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::perm::PermRef;
use faer::sparse::SparseColMat;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::supernodal::{SupernodalLltRef, SupernodeRef};
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::{Accum, Conj, Mat, MatMut, Par, Side, Spec};

use super::Error;
use super::energy::{Energy, Number};
use super::rows::Row;
use crate::Watch;
use crate::dissection::dissection;
use crate::room::Room;

/// A factor whose probe leaves a relative residual above this is refused, and so is a solution.
pub(super) const PROBE_LIMIT: f64 = 1e-9;

/// Bytes of indices per unknown of the matrix, of ordering and of symbolic factorization.
const SYMBOLIC_BYTES: usize = 170;

/// Bytes that the library's products of dense blocks take beside the scratch it asks for.
const BLOCK_BYTES: usize = 4 << 20;

/// The factored matrix K^-1 of an energy with some nodes pinned.
#[derive(Debug)]
pub(super) struct Factor<T> {
    pub(super) energy: Energy<T>,
    pins: Vec<usize>,
    symbolic: SymbolicCholesky<u32>,
    pub(super) values: Vec<T>,
}

impl<T: Number> Factor<T> {
    /// Factors an energy; without `pins`, on which its null space vanishes only as a whole, it would be singular.
    ///
    /// * `before`: bytes that are held beside it meanwhile.
    pub(super) fn new(
        energy: Energy<T>,
        pins: Vec<usize>,
        before: usize,
        room: &mut Room,
        watch: Watch,
    ) -> Result<Self, Error> {
        let n = energy.node_count();
        let matrix_bytes = n.saturating_mul(3 * (size_of::<T>() + size_of::<u32>()) + size_of::<u32>());
        room.phase(before.saturating_add(matrix_bytes).saturating_add(n.saturating_mul(SYMBOLIC_BYTES)))?;
        let matrix = energy.lower_triangle(&pins, watch)?;
        let symbolic = analyze(&matrix, energy.nodes())?;
        watch.go_on()?;
        let request = symbolic.factorize_numeric_llt_scratch::<T>(Par::Seq, Spec::default());
        let held = before + symbolic.len_val() * size_of::<T>() + index_bytes(&symbolic);
        room.phase(held + 2 * matrix_bytes + request.unaligned_bytes_required() + BLOCK_BYTES)?;
        let mut values = Vec::new();
        values.try_reserve_exact(symbolic.len_val()).map_err(|_| Error::OutOfMemory)?;
        values.resize(symbolic.len_val(), T::ZERO);
        let mut scratch = scratch(request)?;
        symbolic
            .factorize_numeric_llt(
                &mut values,
                matrix.as_ref(),
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut scratch),
                Spec::default(),
            )
            .map_err(|_| Error::NotPositiveDefinite)?;
        drop((scratch, matrix));
        watch.go_on()?;
        let factor = Self { energy, pins, symbolic, values };
        room.phase(held + factor.solve_bytes(1) + 2 * n * size_of::<T>())?;
        factor.probe()?;
        Ok(factor)
    }

    /// Bytes held, approximately.
    pub(super) fn bytes(&self) -> usize {
        self.values.len() * size_of::<T>() + index_bytes(&self.symbolic)
    }

    /// Bytes that a solve for `count` right-hand sides takes.
    pub(super) fn solve_bytes(&self, count: usize) -> usize {
        self.symbolic.solve_in_place_scratch::<T>(count, Par::Seq).unaligned_bytes_required() + BLOCK_BYTES
    }

    /// K times each of `fields`, in place. What pulls at a pin is not felt.
    pub(super) fn solve(&self, mut fields: MatMut<T>) -> Result<(), Error> {
        for column in 0..fields.ncols() {
            self.pins.iter().for_each(|&pin| fields[(pin, column)] = T::ZERO);
        }
        let mut scratch = scratch(self.symbolic.solve_in_place_scratch::<T>(fields.ncols(), Par::Seq))?;
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            fields,
            Par::Seq,
            MemStack::new(&mut scratch),
        );
        Ok(())
    }

    fn probe(&self) -> Result<(), Error> {
        let n = self.energy.node_count();
        let mut field = Mat::from_fn(n, 1, |_, _| T::ONE);
        self.solve(field.as_mut())?;
        let field = field.col(0);
        let mut remainder = vec![T::ZERO; n];
        self.energy.add_gradients(&mut remainder, |nodes| nodes.map(|node| field[node]));
        remainder.iter_mut().for_each(|value| *value -= T::ONE);
        self.pins.iter().for_each(|&pin| remainder[pin] = T::ZERO);
        let size = field.iter().map(|value| value.modulus()).fold(0.0, larger);
        let residual = remainder.iter().map(|value| value.modulus()).fold(0.0, larger);
        let residual = residual / (1.0 + self.energy.norm() * size);
        if residual <= PROBE_LIMIT { Ok(()) } else { Err(Error::Inaccurate { residual }) }
    }

    /// How far each handle gives where another is pulled: `S = C K C^*` for the rows C.
    ///
    /// With `P K^-1 P^T = L L^*` it is `Y^* Y`, `L Y = P C^*`: half of each solve, and only in the blocks of L that a
    /// row reaches, the lines of the dissection above its nodes. All rows pass a block together. For k rows on n
    /// nodes O(k n + k^2 sqrt(n)) operations and O(k sqrt(n) + k^2) memory.
    pub(super) fn compliance(
        &self,
        rows: &[Row],
        before: usize,
        room: &mut Room,
        watch: Watch,
    ) -> Result<Mat<T>, Error> {
        let blocks = Blocks::of(self);
        let reached = blocks.reached(&self.symbolic, &self.pins, rows);
        let count: usize = reached.iter().enumerate().map(|(block, rows)| rows.len() * blocks.width(block)).sum();
        let lists = reached.len() * (size_of::<Vec<u32>>() + size_of::<Mat<T>>());
        room.phase(before + lists + (count + 2 * rows.len() * rows.len()) * size_of::<T>() + BLOCK_BYTES)?;
        let mut fields: Vec<Mat<T>> =
            reached.iter().enumerate().map(|(block, rows)| Mat::zeros(blocks.width(block), rows.len())).collect();
        for (row, node, weight) in pulls(&self.pins, rows) {
            let place = self.place(node);
            let block = blocks.owner(place);
            let at = position(&reached[block], row);
            fields[block][(place - blocks.begin(block), at)] += T::ONE * weight;
        }
        let mut compliance = Mat::zeros(rows.len(), rows.len());
        for block in (0..reached.len()).filter(|&block| !reached[block].is_empty()) {
            watch.go_on()?;
            let mut field = std::mem::replace(&mut fields[block], Mat::new());
            blocks.eliminate(block, &mut field, &reached, &mut fields);
            let mut share = Mat::zeros(field.ncols(), field.ncols());
            matmul(share.as_mut(), Accum::Replace, field.adjoint(), field.as_ref(), T::ONE, Par::Seq);
            for (j, &to) in reached[block].iter().enumerate() {
                for (i, &from) in reached[block].iter().enumerate() {
                    compliance[(from as usize, to as usize)] += share[(i, j)];
                }
            }
        }
        Ok(compliance)
    }

    /// Where a node stands in the order of elimination.
    fn place(&self, node: usize) -> usize {
        self.symbolic.perm().map_or(node, |order| order.arrays().1[node] as usize)
    }
}

/// The structure of the factor, in the order of a nested dissection.
fn analyze<T: Number>(
    matrix: &SparseColMat<u32, T>,
    [columns, rows]: [usize; 2],
) -> Result<SymbolicCholesky<u32>, Error> {
    let n = columns * rows;
    let order = dissection(columns, rows);
    let mut place = vec![0; n];
    order.iter().zip(0..).for_each(|(&node, position)| place[node as usize] = position);
    let parameters = CholeskySymbolicParams {
        supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
        ..CholeskySymbolicParams::default()
    };
    let ordering = SymmetricOrdering::Custom(PermRef::new_checked(&order, &place, n));
    Ok(factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, ordering, parameters)?)
}

/// What each row puts on each node that is not pinned: row, node, weight.
fn pulls<'a>(pins: &'a [usize], rows: &'a [Row]) -> impl Iterator<Item = (usize, usize, f64)> + 'a {
    let all = rows.iter().enumerate().flat_map(|(number, row)| row.pulls().map(move |(node, by)| (number, node, by)));
    all.filter(|(_, node, _)| !pins.contains(node))
}

/// Where `number` stands in a rising list.
fn position(list: &[u32], number: usize) -> usize {
    list.binary_search(&(number as u32)).expect("a block that a row reaches lists it")
}

/// The block columns of a factor.
struct Blocks<'a, T> {
    llt: SupernodalLltRef<'a, u32, T>,
    begin: &'a [u32],
}

impl<'a, T: Number> Blocks<'a, T> {
    fn of(factor: &'a Factor<T>) -> Self {
        let SymbolicCholeskyRaw::Supernodal(symbolic) = factor.symbolic.raw() else {
            unreachable!("a supernodal factor was asked for")
        };
        Self { llt: SupernodalLltRef::new(symbolic, &factor.values), begin: symbolic.supernode_begin() }
    }

    fn get(&self, block: usize) -> SupernodeRef<'a, u32, T> {
        self.llt.supernode(block)
    }

    fn begin(&self, block: usize) -> usize {
        self.get(block).start()
    }

    fn width(&self, block: usize) -> usize {
        self.get(block).val().ncols()
    }

    /// The block that a place in the order of elimination belongs to.
    fn owner(&self, place: usize) -> usize {
        self.begin.partition_point(|&begin| begin as usize <= place) - 1
    }

    /// For every block the rows that reach it, rising: those that pull at its nodes or at those of a block below.
    fn reached(&self, symbolic: &SymbolicCholesky<u32>, pins: &[usize], rows: &[Row]) -> Vec<Vec<u32>> {
        let mut reached = vec![Vec::new(); self.llt.symbolic().n_supernodes()];
        let place = |node: usize| symbolic.perm().map_or(node, |order| order.arrays().1[node] as usize);
        for (row, node, _) in pulls(pins, rows) {
            let mut next = Some(self.owner(place(node)));
            while let Some(block) = next.filter(|&block| reached[block].last() != Some(&(row as u32))) {
                reached[block].push(row as u32);
                next = self.get(block).pattern().first().map(|&above| self.owner(above as usize));
            }
        }
        reached
    }

    /// Forward substitution in one block: solves for its `field`, and takes its share off the blocks above.
    fn eliminate(&self, block: usize, field: &mut Mat<T>, reached: &[Vec<u32>], fields: &mut [Mat<T>]) {
        let node = self.get(block);
        let (pattern, width) = (node.pattern(), field.nrows());
        let (top, below) = node.val().split_at_row(width);
        solve_lower_triangular_in_place(top, field.as_mut(), Par::Seq);
        let mut share = Mat::<T>::zeros(pattern.len(), field.ncols());
        matmul(share.as_mut(), Accum::Replace, below, field.as_ref(), T::ONE, Par::Seq);
        let mut from = 0;
        while from < pattern.len() {
            let above = self.owner(pattern[from] as usize);
            let (begin, end) = (self.begin(above), self.begin(above) + self.width(above));
            let to = from + pattern[from..].partition_point(|&place| (place as usize) < end);
            for (column, &row) in reached[block].iter().enumerate() {
                let at = position(&reached[above], row as usize);
                for index in from..to {
                    fields[above][(pattern[index] as usize - begin, at)] -= share[(index, column)];
                }
            }
            from = to;
        }
    }
}

/// The larger of two numbers; NaN if there is one.
pub(super) fn larger(a: f64, b: f64) -> f64 {
    if b.is_nan() || b > a { b } else { a }
}

/// Bytes of a factor's permutations and indices.
fn index_bytes(symbolic: &SymbolicCholesky<u32>) -> usize {
    let indices = match symbolic.raw() {
        SymbolicCholeskyRaw::Simplicial(factor) => factor.row_idx().len() + factor.col_ptr().len(),
        SymbolicCholeskyRaw::Supernodal(factor) => factor.row_idx().len() + 5 * factor.n_supernodes(),
    };
    (2 * symbolic.nrows() + indices) * size_of::<u32>()
}

fn scratch(request: StackReq) -> Result<MemBuffer, Error> {
    MemBuffer::try_new(request).map_err(|_| Error::OutOfMemory)
}
