//! Poisson's equation on the nodes of a lattice: conductances on the edges, values given on the frame.
//!
//! Minimise `sum over edges e = (p, q) of c_e (x_q - x_p)^2 - 2 phi_e (x_q - x_p)` over the nodes off the frame. The
//! normal equations are `L x = div phi`, L the weighted five-point Laplacian, with the frame's values eliminated. L
//! depends on the conductances alone, so one factor serves any number of fluxes and frames.

use crate::room::Room;
use crate::{Interrupted, Watch};
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{FaerError, SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side, Spec};
use rayon::prelude::*;

/// Solutions are refined once when their relative residual is above this. Below it a million nodes of a weight-10
/// system are good to about 1e-9 cells.
const REFINE_ABOVE: f64 = 1e-12;

/// A factor whose probe keeps a relative residual above this is refused.
const PROBE_LIMIT: f64 = 1e-9;

/// Bytes of the matrix per unknown.
const MATRIX_BYTES: usize = 40;

/// Bytes per unknown that ordering and symbolic factorization take.
const SYMBOLIC_BYTES: usize = 160;

/// Bytes that the library's products of dense blocks take beside the scratch it asks for.
const BLOCK_BYTES: usize = 4 << 20;

/// Bytes per unknown of the probe beside its solve: a field and fluxes.
const PROBE_BYTES: usize = 24;

/// Why a Laplacian was not factored or a system not solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Error {
    /// The watch stopped it.
    Interrupted,
    /// The factor needs more entries than its index type counts.
    TooLarge,
    /// The memory for the factor or for a solution was refused.
    OutOfMemory,
    /// The conductances do not make the Laplacian positive definite.
    NotPositiveDefinite,
    /// The factor does not solve a system with a known solution.
    Inaccurate {
        /// Relative residual of that system.
        residual: f64,
    },
}

impl From<Interrupted> for Error {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

impl From<FaerError> for Error {
    fn from(error: FaerError) -> Self {
        match error {
            FaerError::IndexOverflow => Self::TooLarge,
            _ => Self::OutOfMemory,
        }
    }
}

/// One number for every edge of a lattice of C x R nodes, row-major; edges point right and down.
#[derive(Clone, Debug, PartialEq)]
pub struct Edges {
    /// (C - 1) * R of them: `[r * (C - 1) + c]` leads from node (c, r) to node (c + 1, r).
    pub horizontal: Vec<f64>,
    /// C * (R - 1) of them: `[r * C + c]` leads from node (c, r) to node (c, r + 1).
    pub vertical: Vec<f64>,
}

impl Edges {
    /// Zero on every edge of a lattice of `nodes` columns and rows, at least 1 each.
    pub fn zeros([columns, rows]: [usize; 2]) -> Self {
        Self { horizontal: vec![0.0; (columns - 1) * rows], vertical: vec![0.0; columns * (rows - 1)] }
    }

    fn assert_shape(&self, [columns, rows]: [usize; 2]) {
        assert_eq!(self.horizontal.len(), (columns - 1) * rows, "horizontal edges of {columns} x {rows} nodes");
        assert_eq!(self.vertical.len(), columns * (rows - 1), "vertical edges of {columns} x {rows} nodes");
    }
}

/// The weighted five-point Laplacian of a lattice, the values on its frame given.
#[derive(Clone, Debug)]
pub struct GridLaplacian {
    nodes: [usize; 2],
    conductances: Edges,
}

/// A factored Laplacian: solves for any fluxes and any values on the frame.
#[derive(Debug)]
pub struct Factor {
    laplacian: GridLaplacian,
    /// None where every node lies on the frame.
    cholesky: Option<Cholesky>,
}

/// Node values that solve the systems they were asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// One array of node values per right-hand side, row-major.
    pub fields: Vec<Vec<f64>>,
    /// Largest |b - A x| over largest |b| of the normal equations, the worst of the right-hand sides; 0 where b = 0.
    pub residual: f64,
}

#[derive(Debug)]
struct Cholesky {
    symbolic: SymbolicCholesky<u32>,
    values: Vec<f64>,
}

impl GridLaplacian {
    /// The Laplacian of the given conductances.
    ///
    /// `(L x)_i = sum over neighbours j of c_ij (x_i - x_j)` for the nodes i off the frame.
    ///
    /// * `nodes`: columns and rows, at least 1 each.
    /// * `conductances`: finite and positive; those between two nodes of the frame do not matter.
    ///
    /// Keeps the arrays; nothing is computed.
    pub fn new(nodes: [usize; 2], conductances: Edges) -> Self {
        conductances.assert_shape(nodes);
        Self { nodes, conductances }
    }

    /// Count of nodes off the frame.
    pub fn unknowns(&self) -> usize {
        self.nodes[0].saturating_sub(2) * self.nodes[1].saturating_sub(2)
    }

    /// Factors the Laplacian for repeated solves.
    ///
    /// `P L P^T = G G^T` in f64 with an approximate minimum degree permutation P; then a probe: a constant on the
    /// frame and no flux must be solved for.
    ///
    /// * `watch`: called between the phases; a phase runs to its end. Asked for all memory, for the factor's once its
    ///   entries are counted.
    ///
    /// With fewer than 3 nodes on a side there is nothing to solve for and nothing is factored. Conductances that
    /// are not finite and positive give `NotPositiveDefinite` or `Inaccurate`. One thread, so the bits do not depend
    /// on the thread count. Time O(n^1.5) and memory O(n log n) for n unknowns, half a GB held at a million.
    pub fn factor(self, watch: Watch) -> Result<Factor, Error> {
        let cholesky = if self.unknowns() == 0 { None } else { Some(Cholesky::new(&self, watch)?) };
        let factor = Factor { laplacian: self, cholesky };
        factor.probe(watch)?;
        Ok(factor)
    }

    /// The matrix over the nodes off the frame, row-major.
    fn lower_triangle(&self, watch: Watch) -> Result<SparseColMat<u32, f64>, Error> {
        let n = self.unknowns();
        if n > i32::MAX as usize / 3 {
            return Err(Error::TooLarge);
        }
        let [columns, rows] = self.nodes;
        let Edges { horizontal, vertical } = &self.conductances;
        let (mut starts, mut indices, mut values) =
            (Vec::with_capacity(n + 1), Vec::with_capacity(3 * n), Vec::with_capacity(3 * n));
        let mut entry = |index: usize, value: f64| {
            indices.push(index as u32);
            values.push(value);
            indices.len() as u32
        };
        starts.push(0);
        for row in 1..rows - 1 {
            watch.go_on()?;
            for column in 1..columns - 1 {
                let unknown = starts.len() - 1;
                let (right, below) = (row * (columns - 1) + column, row * columns + column);
                let diagonal = horizontal[right - 1] + horizontal[right] + vertical[below - columns] + vertical[below];
                let mut end = entry(unknown, diagonal);
                if column + 2 < columns {
                    end = entry(unknown + 1, -horizontal[right]);
                }
                if row + 2 < rows {
                    end = entry(unknown + columns - 2, -vertical[below]);
                }
                starts.push(end);
            }
        }
        Ok(SparseColMat::new(SymbolicSparseColMat::new_checked(n, n, starts, None, indices), values))
    }

    /// `div (flux - c grad x)` at the nodes off the frame, for every field one after the other.
    fn residuals(&self, fluxes: &[Edges], fields: &[Vec<f64>]) -> Vec<f64> {
        let columns = self.nodes[0];
        let conductances = &self.conductances;
        let mut residuals = vec![0.0; self.unknowns() * fields.len()];
        for ((out, flux), x) in residuals.chunks_mut(self.unknowns()).zip(fluxes).zip(fields) {
            let across = |edge: usize, from: usize| {
                flux.horizontal[edge] - conductances.horizontal[edge] * (x[from + 1] - x[from])
            };
            let down = |edge: usize| flux.vertical[edge] - conductances.vertical[edge] * (x[edge + columns] - x[edge]);
            out.par_chunks_mut(columns - 2).enumerate().for_each(|(row, out)| {
                for (column, out) in out.iter_mut().enumerate() {
                    let node = (row + 1) * columns + column + 1;
                    let right = node - (row + 1);
                    *out = across(right - 1, node - 1) - across(right, node) + down(node - columns) - down(node);
                }
            });
        }
        residuals
    }
}

impl Factor {
    /// Solves for several fluxes and frames together.
    ///
    /// Minimises `sum of c_e (x_q - x_p)^2 - 2 phi_e (x_q - x_p)`: `A x = div phi - (the frame's share)`.
    ///
    /// * `fluxes`: phi, one per right-hand side.
    /// * `frames`: node values, one array of C * R per right-hand side; only those on the frame are read.
    /// * `watch`: called before every substitution.
    ///
    /// One refinement step follows where the relative residual is above 1e-12. Without nodes off the frame the
    /// frame is the result. Time and memory traffic O(n log n) for n unknowns; the substitution runs on one thread.
    pub fn solve(&self, fluxes: &[Edges], frames: &[&[f64]], watch: Watch) -> Result<Solution, Error> {
        let nodes = self.laplacian.nodes;
        assert_eq!(fluxes.len(), frames.len(), "fluxes and frames");
        fluxes.iter().for_each(|flux| flux.assert_shape(nodes));
        if let Some(cholesky) = &self.cholesky {
            watch.reserve(solve_bytes(&cholesky.symbolic, nodes, frames.len()))?;
        }
        let mut fields: Vec<Vec<f64>> = frames.iter().map(|frame| with_clear_interior(frame, nodes)).collect();
        let (Some(cholesky), false) = (&self.cholesky, fields.is_empty()) else {
            return Ok(Solution { fields, residual: 0.0 });
        };
        let n = self.laplacian.unknowns();
        let mut remainders = self.laplacian.residuals(fluxes, &fields);
        let right_hand_sides = largest(&remainders, n);
        let mut residual = f64::INFINITY;
        for part in [0.1, 0.6] {
            watch.progress(part)?;
            cholesky.solve(&mut remainders, n)?;
            for (field, step) in fields.iter_mut().zip(remainders.chunks(n)) {
                add_to_interior(field, step, nodes);
            }
            remainders = self.laplacian.residuals(fluxes, &fields);
            residual = relative(&largest(&remainders, n), &right_hand_sides);
            if residual <= REFINE_ABOVE {
                break;
            }
        }
        Ok(Solution { fields, residual })
    }

    /// Count of unknowns: nodes off the frame.
    pub fn unknowns(&self) -> usize {
        self.laplacian.unknowns()
    }

    /// Bytes held, approximately: conductances, permutations, indices and values of the factor.
    pub fn bytes(&self) -> usize {
        let Edges { horizontal, vertical } = &self.laplacian.conductances;
        let factor = self.cholesky.as_ref().map_or(0, |cholesky| held_bytes(&cholesky.symbolic));
        factor + (horizontal.len() + vertical.len()) * size_of::<f64>()
    }

    fn probe(&self, watch: Watch) -> Result<(), Error> {
        let nodes = self.laplacian.nodes;
        let constant = vec![1.0; nodes[0] * nodes[1]];
        let Solution { residual, .. } = self.solve(&[Edges::zeros(nodes)], &[&constant], &|_| watch.progress(0.9))?;
        if residual <= PROBE_LIMIT { Ok(()) } else { Err(Error::Inaccurate { residual }) }
    }
}

impl Cholesky {
    fn new(laplacian: &GridLaplacian, watch: Watch) -> Result<Self, Error> {
        watch.progress(0.0)?;
        let (n, mut room) = (laplacian.unknowns(), Room::new(watch));
        room.phase(n.saturating_mul(MATRIX_BYTES + SYMBOLIC_BYTES))?;
        let matrix = laplacian.lower_triangle(watch)?;
        watch.progress(0.05)?;
        let parameters = CholeskySymbolicParams::default();
        let symbolic = factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, SymmetricOrdering::Amd, parameters)?;
        watch.progress(0.2)?;
        let request = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default());
        let held = held_bytes(&symbolic);
        room.phase(held + n * MATRIX_BYTES + request.unaligned_bytes_required() + BLOCK_BYTES)?;
        room.phase(held + solve_bytes(&symbolic, laplacian.nodes, 1) + n * PROBE_BYTES)?;
        let mut values = Vec::new();
        values.try_reserve_exact(symbolic.len_val()).map_err(|_| Error::OutOfMemory)?;
        values.resize(symbolic.len_val(), 0.0);
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
        Ok(Self { symbolic, values })
    }

    /// Solves in place for right-hand sides of `n` values each, one after the other.
    fn solve(&self, right_hand_sides: &mut [f64], n: usize) -> Result<(), Error> {
        let count = right_hand_sides.len() / n;
        let mut scratch = scratch(self.symbolic.solve_in_place_scratch::<f64>(count, Par::Seq))?;
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(right_hand_sides, n, count),
            Par::Seq,
            MemStack::new(&mut scratch),
        );
        Ok(())
    }
}

/// Bytes that a factor holds: permutations, indices and values.
fn held_bytes(symbolic: &SymbolicCholesky<u32>) -> usize {
    let permutations = 2 * symbolic.nrows();
    let indices = match symbolic.raw() {
        SymbolicCholeskyRaw::Simplicial(factor) => factor.row_idx().len() + factor.col_ptr().len(),
        SymbolicCholeskyRaw::Supernodal(factor) => factor.row_idx().len() + 5 * factor.n_supernodes(),
    };
    symbolic.len_val() * size_of::<f64>() + (permutations + indices) * size_of::<u32>()
}

/// Bytes that a solve for `count` right-hand sides takes: fields, remainders before and after a step, scratch.
fn solve_bytes(symbolic: &SymbolicCholesky<u32>, nodes: [usize; 2], count: usize) -> usize {
    let scratch = symbolic.solve_in_place_scratch::<f64>(count, Par::Seq).unaligned_bytes_required();
    3 * count * nodes[0] * nodes[1] * size_of::<f64>() + scratch
}

fn scratch(request: StackReq) -> Result<MemBuffer, Error> {
    MemBuffer::try_new(request).map_err(|_| Error::OutOfMemory)
}

fn with_clear_interior(frame: &[f64], [columns, rows]: [usize; 2]) -> Vec<f64> {
    assert_eq!(frame.len(), columns * rows, "values of {columns} x {rows} nodes");
    let mut field = frame.to_vec();
    if columns > 2 && rows > 2 {
        field[columns..columns * (rows - 1)].chunks_mut(columns).for_each(|row| row[1..columns - 1].fill(0.0));
    }
    field
}

fn add_to_interior(field: &mut [f64], step: &[f64], [columns, _]: [usize; 2]) {
    for (row, step) in field[columns..].chunks_mut(columns).zip(step.chunks(columns - 2)) {
        row[1..columns - 1].iter_mut().zip(step).for_each(|(value, step)| *value += step);
    }
}

/// Largest magnitude of every run of `n` values; NaN where a run holds one.
fn largest(values: &[f64], n: usize) -> Vec<f64> {
    let larger = |a: f64, b: f64| if b.is_nan() || b > a { b } else { a };
    values.chunks(n).map(|run| run.iter().fold(0.0, |most, value| larger(most, value.abs()))).collect()
}

fn relative(remainders: &[f64], right_hand_sides: &[f64]) -> f64 {
    let ratio = |(r, b): (&f64, &f64)| if *r == 0.0 { 0.0 } else { r / b };
    remainders.iter().zip(right_hand_sides).map(ratio).fold(0.0, |a, b| if b.is_nan() || b > a { b } else { a })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UNWATCHED;

    /// Numbers in -1..1, the same on every run.
    fn noise(seed: u32) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 23) - 1.0
        }
    }

    fn random_edges(nodes: [usize; 2], mut number: impl FnMut() -> f64) -> Edges {
        let mut edges = Edges::zeros(nodes);
        edges.horizontal.iter_mut().chain(&mut edges.vertical).for_each(|value| *value = number());
        edges
    }

    fn random_conductances(nodes: [usize; 2], seed: u32) -> Edges {
        let mut number = noise(seed);
        random_edges(nodes, || 1.0 + 100.0 * number().powi(8))
    }

    /// c grad x, the flux that x itself solves for.
    fn flux_of(conductances: &Edges, x: &[f64], [columns, _]: [usize; 2]) -> Edges {
        let across = |(edge, c): (usize, &f64)| {
            let node = edge + edge / (columns - 1);
            c * (x[node + 1] - x[node])
        };
        let down = |(node, c): (usize, &f64)| c * (x[node + columns] - x[node]);
        Edges {
            horizontal: conductances.horizontal.iter().enumerate().map(across).collect(),
            vertical: conductances.vertical.iter().enumerate().map(down).collect(),
        }
    }

    fn factored(nodes: [usize; 2], conductances: &Edges) -> Factor {
        GridLaplacian::new(nodes, conductances.clone()).factor(UNWATCHED).expect("positive conductances")
    }

    #[test]
    fn middle_of_three_by_three_is_the_weighted_mean() {
        let nodes = [3, 3];
        let mut conductances = Edges::zeros(nodes);
        conductances.horizontal[2..4].copy_from_slice(&[1.0, 2.0]);
        conductances.vertical[1] = 3.0;
        conductances.vertical[4] = 4.0;
        let frame = [9.0, 30.0, 9.0, 10.0, 9.0, 20.0, 9.0, 40.0, 9.0];
        let mut flux = Edges::zeros(nodes);
        flux.horizontal[2] = 7.0;
        flux.vertical[4] = 2.0;
        let solution = factored(nodes, &conductances).solve(&[flux], &[&frame], UNWATCHED).expect("solved");
        let expected = (1.0 * 10.0 + 2.0 * 20.0 + 3.0 * 30.0 + 4.0 * 40.0 + 7.0 - 2.0) / 10.0;
        assert!((solution.fields[0][4] - expected).abs() < 1e-13, "{solution:?}");
        assert_eq!(solution.fields[0][..4], frame[..4]);
    }

    #[test]
    fn any_field_is_recovered_from_its_flux_and_frame() {
        for nodes in [[3, 3], [3, 9], [9, 3], [4, 7], [23, 17], [70, 64]] {
            let conductances = random_conductances(nodes, 5);
            let mut number = noise(7);
            let fields: Vec<Vec<f64>> = (0..3).map(|_| (0..nodes[0] * nodes[1]).map(|_| number()).collect()).collect();
            let fluxes: Vec<Edges> = fields.iter().map(|field| flux_of(&conductances, field, nodes)).collect();
            let frames: Vec<&[f64]> = fields.iter().map(|field| &field[..]).collect();
            let factor = factored(nodes, &conductances);
            assert_eq!(factor.unknowns(), (nodes[0] - 2) * (nodes[1] - 2));
            let solution = factor.solve(&fluxes, &frames, UNWATCHED).expect("solved");
            assert!(solution.residual < 1e-13, "{nodes:?}: {}", solution.residual);
            for (solved, field) in solution.fields.iter().flatten().zip(fields.iter().flatten()) {
                assert!((solved - field).abs() < 1e-11, "{nodes:?}: {solved} for {field}");
            }
        }
    }

    #[test]
    fn right_hand_sides_do_not_mix() {
        let nodes = [12, 10];
        let factor = factored(nodes, &random_conductances(nodes, 1));
        let [one, two] = [3, 4].map(|seed| random_edges(nodes, noise(seed)));
        let still = vec![0.0; 120];
        let both = factor.solve(&[one.clone(), two], &[&still, &still], UNWATCHED).expect("solved");
        let alone = factor.solve(&[one], &[&still], UNWATCHED).expect("solved");
        for (a, b) in both.fields[0].iter().zip(&alone.fields[0]) {
            assert!((a - b).abs() < 1e-13);
        }
        assert_eq!(factor.solve(&[], &[], UNWATCHED).expect("solved").fields.len(), 0);
    }

    #[test]
    fn without_interior_the_frame_is_the_result() {
        for nodes in [[2, 2], [2, 5], [5, 2], [1, 4]] {
            let frame: Vec<f64> = (0..nodes[0] * nodes[1]).map(|node| node as f64).collect();
            let factor = factored(nodes, &Edges::zeros(nodes));
            let solution = factor.solve(&[Edges::zeros(nodes)], &[&frame], UNWATCHED).expect("solved");
            assert_eq!((solution.fields, solution.residual, factor.unknowns()), (vec![frame], 0.0, 0));
        }
    }

    #[test]
    fn bad_conductances_and_watches_are_told() {
        let nodes = [6, 6];
        let fail = |value: f64| {
            let conductances = random_edges(nodes, || value);
            GridLaplacian::new(nodes, conductances).factor(UNWATCHED).expect_err("no factor")
        };
        assert_eq!(fail(-1.0), Error::NotPositiveDefinite);
        assert_eq!(fail(0.0), Error::NotPositiveDefinite);
        fail(f64::NAN);
        fail(f64::INFINITY);
        let laplacian = GridLaplacian::new(nodes, random_conductances(nodes, 1));
        assert_eq!(laplacian.clone().factor(&|_| Err(Interrupted)).expect_err("stopped"), Error::Interrupted);
        let factor = laplacian.factor(UNWATCHED).expect("factored");
        let stopped = factor.solve(&[Edges::zeros(nodes)], &[&[0.0; 36]], &|_| Err(Interrupted));
        assert_eq!(stopped, Err(Error::Interrupted));
    }

    #[test]
    fn a_slightly_wrong_factor_is_made_good_by_refinement() {
        let nodes = [30, 20];
        let mut factor = factored(nodes, &random_conductances(nodes, 2));
        factor.cholesky.as_mut().expect("interior").values.iter_mut().for_each(|value| *value *= 1.0 + 1e-8);
        let solution = factor.solve(&[random_edges(nodes, noise(6))], &[&vec![0.5; 600]], UNWATCHED).expect("solved");
        assert!(solution.residual < 1e-12, "{}", solution.residual);
    }

    #[test]
    fn a_wrong_factor_does_not_pass_its_probe() {
        let nodes = [40, 40];
        let mut factor = factored(nodes, &random_conductances(nodes, 2));
        assert!(factor.probe(UNWATCHED).is_ok());
        assert!(factor.bytes() > 8 * 38 * 38);
        let values = &mut factor.cholesky.as_mut().expect("interior").values;
        let middle = values.len() / 2;
        values[middle..middle + 50].iter_mut().for_each(|value| *value *= 0.1);
        assert!(matches!(factor.probe(UNWATCHED), Err(Error::Inaccurate { .. })));
    }
}
