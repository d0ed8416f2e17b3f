//! Least energy under rows of constraints, by a bordered system over one factor.

use faer::linalg::solvers::{Llt, Solve};
use faer::{Mat, Side};
use rayon::prelude::*;

use super::Error;
use super::cholesky::{Factor, PROBE_LIMIT, larger};
use super::energy::Number;
use super::rows::Row;
use crate::Watch;
use crate::room::Room;

/// A compliance whose pivots stay above this share of the largest is factored as it is.
const PIVOT: f64 = 1e-10;

/// Else, what is below this share of its largest eigenvalue counts as nothing.
const NOTHING: f64 = 1e-12;

/// Solutions are refined while their relative residual is above this,
const RESIDUAL: f64 = 1e-12;

/// or while they miss the constraints by more than this share of their largest entry.
const MISS: f64 = 1e-11;

/// Nodes that follow the forces together, side by side with others.
const PART: usize = 4096;

/// Most solutions of one system: the first and its refinements.
const PASSES: usize = 4;

/// A least energy under constraints.
pub(super) struct Solution<T> {
    /// One column of node values per right-hand side.
    pub(super) fields: Mat<T>,
    /// Largest |b + C^* f - H d| over |b| + |H| |d|, d with what it is added to.
    pub(super) residual: f64,
    /// Rows that do not depend on others.
    pub(super) rank: usize,
}

/// The pseudo-inverse of a Hermitian matrix without negative eigenvalues.
#[derive(Debug)]
enum Inverse<T> {
    Full(Llt<T>),
    /// Eigenvectors of what is not nothing, and the inverse eigenvalues.
    Part(Mat<T>, Vec<f64>),
}

impl<T: Number> Inverse<T> {
    fn of(matrix: &Mat<T>) -> Result<Self, Error> {
        if let Ok(llt) = matrix.llt(Side::Lower) {
            let pivots = (0..matrix.nrows()).map(|i| llt.L()[(i, i)].modulus().powi(2));
            let (least, most) = pivots.fold((f64::INFINITY, 0.0), |(a, b), pivot| (pivot.min(a), pivot.max(b)));
            if least > PIVOT * most {
                return Ok(Self::Full(llt));
            }
        }
        let eigen = matrix.self_adjoint_eigen(Side::Lower).map_err(|_| Error::NotPositiveDefinite)?;
        let values: Vec<f64> = eigen.S().column_vector().iter().map(|value| value.modulus()).collect();
        let most = values.iter().copied().fold(0.0, f64::max);
        let kept: Vec<usize> = (0..values.len()).filter(|&i| values[i] > NOTHING * most).collect();
        let vectors = Mat::from_fn(matrix.nrows(), kept.len(), |i, j| eigen.U()[(i, kept[j])]);
        Ok(Self::Part(vectors, kept.into_iter().map(|i| 1.0 / values[i]).collect()))
    }

    fn times(&self, right: &Mat<T>) -> Mat<T> {
        match self {
            Self::Full(llt) => llt.solve(right),
            Self::Part(vectors, inverse) => {
                let inner = vectors.adjoint() * right;
                vectors * Mat::from_fn(inner.nrows(), inner.ncols(), |i, j| inner[(i, j)] * inverse[i])
            }
        }
    }

    /// The part of each column that can be reached.
    fn reachable(&self, right: &Mat<T>) -> Mat<T> {
        match self {
            Self::Full(_) => right.clone(),
            Self::Part(vectors, _) => vectors * (vectors.adjoint() * right),
        }
    }

    fn rank(&self, rows: usize) -> usize {
        match self {
            Self::Full(_) => rows,
            Self::Part(vectors, _) => vectors.ncols(),
        }
    }
}

/// What an energy does not see, as functions of the node.
pub(super) type Kernel<'a, T> = &'a [Box<dyn Fn(usize) -> T + Sync>];

/// What rows of constraints need of an energy's factor, whatever they ask for.
#[derive(Debug)]
pub(super) struct Prepared<T> {
    /// C N.
    border: Mat<T>,
    inverse: Inverse<T>,
    /// The inverse times C N.
    solved: Mat<T>,
    corner: Llt<T>,
    /// K C^*, how the nodes follow a pull at each row; kept of few rows.
    responses: Option<Mat<T>>,
}

impl<T: Number> Prepared<T> {
    /// Prepares `rows` that fix the `kernel`.
    ///
    /// * `most`: bytes that the responses may take to be kept.
    /// * `before`: bytes that are held beside it meanwhile.
    pub(super) fn new(
        factor: &Factor<T>,
        rows: &[Row],
        kernel: Kernel<T>,
        most: usize,
        before: usize,
        room: &mut Room,
        watch: Watch,
    ) -> Result<Self, Error> {
        let mut compliance = factor.compliance(rows, before, room, watch)?;
        let square = rows.len() * rows.len() * size_of::<T>();
        room.phase(before + 4 * square)?;
        let border = Mat::from_fn(rows.len(), kernel.len(), |row, which| {
            rows[row].pulls().fold(T::ZERO, |sum, (node, weight)| sum + kernel[which](node) * weight)
        });
        let outer = &border * border.adjoint();
        let trace = |matrix: &Mat<T>| (0..matrix.nrows()).map(|i| matrix[(i, i)].modulus()).sum::<f64>();
        let share = match trace(&compliance) / trace(&outer) {
            share if share > 0.0 => share,
            _ => 1.0,
        };
        for column in 0..rows.len() {
            (0..rows.len()).for_each(|row| compliance[(row, column)] += outer[(row, column)] * share);
        }
        watch.go_on()?;
        let inverse = Inverse::of(&compliance)?;
        drop((compliance, outer));
        let solved = inverse.times(&border);
        let corner = (border.adjoint() * &solved).llt(Side::Lower).map_err(|_| Error::NotPositiveDefinite)?;
        watch.go_on()?;
        let bytes = rows.len().saturating_mul(factor.energy.node_count() * size_of::<T>());
        let responses = (bytes <= most).then(|| responses(factor, rows, before + square + bytes, room, watch));
        Ok(Self { border, inverse, solved, corner, responses: responses.transpose()? })
    }

    /// As for so many rows that their responses are not kept.
    #[cfg(test)]
    pub(super) fn forget_responses(&mut self) {
        self.responses = None;
    }

    /// Bytes held, approximately.
    pub(super) fn bytes(&self) -> usize {
        let responses = self.responses.as_ref().map_or(0, |fields| fields.nrows() * fields.ncols());
        let rows = self.border.nrows();
        (responses + rows * (rows + 2 * self.border.ncols())) * size_of::<T>()
    }
}

/// K C^*, a quarter of the columns together.
fn responses<T: Number>(
    factor: &Factor<T>,
    rows: &[Row],
    before: usize,
    room: &mut Room,
    watch: Watch,
) -> Result<Mat<T>, Error> {
    let together = rows.len().div_ceil(4);
    room.phase(before + factor.solve_bytes(together))?;
    let mut fields = Mat::zeros(factor.energy.node_count(), rows.len());
    for (number, row) in rows.iter().enumerate() {
        row.pulls().for_each(|(node, by)| fields[(node, number)] += T::ONE * by);
    }
    for first in (0..rows.len()).step_by(together) {
        watch.go_on()?;
        factor.solve(fields.as_mut().subcols_mut(first, together.min(rows.len() - first)))?;
    }
    Ok(fields)
}

/// An energy's factor with rows of constraints.
///
/// Least `d^* H d / 2 - Re b^* d` under `C d = g`: `H d = b + C^* f` with forces f at the rows. N spans the null space of
/// H and K is the inverse of H pinned: `d = K (b + C^* f) + N a` where `S f + C N a = g - C K b` and `(C N)^* f = 0`,
/// S = C K C^*. As the last line holds, S may grow by a multiple of `C N (C N)^*`: then it is definite unless rows
/// depend on each other, and its pseudo-inverse gives the least squares of those.
pub(super) struct Constrained<'a, T> {
    pub(super) factor: &'a Factor<T>,
    pub(super) rows: &'a [Row],
    pub(super) kernel: Kernel<'a, T>,
    pub(super) prepared: &'a Prepared<T>,
}

impl<T: Number> Constrained<'_, T> {
    /// Bytes that a solution takes.
    pub(super) fn bytes(&self) -> usize {
        let field = self.factor.energy.node_count() * T::COLUMNS * size_of::<T>();
        2 * field + self.factor.solve_bytes(T::COLUMNS)
    }

    /// The solution for `loads` b, None being 0, and `moves` g, one column per right-hand side.
    ///
    /// * `size`: largest entry of what the solution is added to; below its last digit nothing counts.
    ///
    /// `Inaccurate` where refining leaves a relative residual above 1e-9.
    pub(super) fn solve(
        &self,
        loads: Option<&Mat<T>>,
        moves: &Mat<T>,
        size: f64,
        watch: Watch,
    ) -> Result<Solution<T>, Error> {
        let (n, count) = (self.factor.energy.node_count(), moves.ncols());
        let mut fields = Mat::zeros(n, count);
        let mut forces = Mat::zeros(self.rows.len(), count);
        let (mut load, mut missing) = (loads.cloned(), moves.clone());
        let mut residual = 0.0;
        for _ in 0..PASSES {
            watch.go_on()?;
            self.add_step(load, &missing, &mut fields, &mut forces)?;
            let remainder = self.remainder(loads, &fields, &forces);
            missing = moves - self.at_rows(&fields);
            let (size, error) = (size + largest(&fields), largest(&remainder));
            // Nothing is asked for and nothing moves.
            let scale = loads.map_or(0.0, largest) + self.factor.energy.norm() * size;
            residual = if error == 0.0 { 0.0 } else { error / scale };
            let miss = largest(&self.prepared.inverse.reachable(&missing));
            if residual <= RESIDUAL && miss <= MISS * size {
                break;
            }
            load = (residual > RESIDUAL).then_some(remainder);
        }
        // What is no number has overflowed, as its positions tell.
        if residual > PROBE_LIMIT {
            return Err(Error::Inaccurate { residual });
        }
        Ok(Solution { fields, residual, rank: self.prepared.inverse.rank(self.rows.len()) })
    }

    /// Adds the solution for `load` and `missing` to nodes and forces.
    fn add_step(
        &self,
        load: Option<Mat<T>>,
        missing: &Mat<T>,
        fields: &mut Mat<T>,
        forces: &mut Mat<T>,
    ) -> Result<(), Error> {
        let mut right = missing.clone();
        if let Some(mut load) = load {
            self.factor.solve(load.as_mut())?;
            right -= self.at_rows(&load);
            *fields += &load;
        }
        let motion = self.prepared.corner.solve(self.prepared.solved.adjoint() * &right);
        let force = self.prepared.inverse.times(&(right - &self.prepared.border * &motion));
        self.add_responses(&force, fields)?;
        *forces += &force;
        for column in 0..fields.ncols() {
            for (which, kernel) in self.kernel.iter().enumerate() {
                let by = motion[(which, column)];
                fields.col_as_slice_mut(column).iter_mut().enumerate().for_each(|(node, d)| *d += kernel(node) * by);
            }
        }
        Ok(())
    }

    /// Adds K C^* f to the nodes.
    fn add_responses(&self, forces: &Mat<T>, fields: &mut Mat<T>) -> Result<(), Error> {
        let Some(responses) = &self.prepared.responses else {
            let mut step = Mat::zeros(fields.nrows(), fields.ncols());
            self.add_forces(forces, &mut step);
            self.factor.solve(step.as_mut())?;
            *fields += &step;
            return Ok(());
        };
        for column in 0..fields.ncols() {
            let parts = fields.col_as_slice_mut(column).par_chunks_mut(PART).enumerate();
            parts.for_each(|(index, sums)| {
                for number in 0..forces.nrows() {
                    let (force, nodes) = (forces[(number, column)], index * PART..index * PART + sums.len());
                    let response = &responses.col_as_slice(number)[nodes];
                    sums.iter_mut().zip(response).for_each(|(sum, &by)| *sum += by * force);
                }
            });
        }
        Ok(())
    }

    /// Adds C^* f to the nodes.
    fn add_forces(&self, forces: &Mat<T>, fields: &mut Mat<T>) {
        for column in 0..fields.ncols() {
            for (number, row) in self.rows.iter().enumerate() {
                row.pulls().for_each(|(node, by)| fields[(node, column)] += forces[(number, column)] * by);
            }
        }
    }

    /// C d.
    fn at_rows(&self, fields: &Mat<T>) -> Mat<T> {
        Mat::from_fn(self.rows.len(), fields.ncols(), |row, column| {
            self.rows[row].pulls().fold(T::ZERO, |sum, (node, weight)| sum + fields[(node, column)] * weight)
        })
    }

    /// b + C^* f - H d.
    fn remainder(&self, loads: Option<&Mat<T>>, fields: &Mat<T>, forces: &Mat<T>) -> Mat<T> {
        let mut remainder = loads.cloned().unwrap_or_else(|| Mat::zeros(fields.nrows(), fields.ncols()));
        self.add_forces(forces, &mut remainder);
        for column in 0..fields.ncols() {
            let field = fields.col_as_slice(column);
            let sums = remainder.col_as_slice_mut(column);
            self.factor.energy.add_gradients(sums, |nodes| nodes.map(|node| T::ZERO - field[node]));
        }
        remainder
    }
}

/// The largest modulus; NaN if there is one.
fn largest<T: Number>(matrix: &Mat<T>) -> f64 {
    let columns = (0..matrix.ncols()).flat_map(|column| matrix.col_as_slice(column));
    columns.map(|value| value.modulus()).fold(0.0, larger)
}
