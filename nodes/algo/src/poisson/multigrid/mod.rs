//! The multigrid backend: conjugate gradients in single precision on corrections, preconditioned by a V-cycle, with
//! residuals in double precision around them.
//!
//! A coarser lattice has every other node. A cycle sweeps red-black before and black-red after it goes coarser, so it
//! is symmetric. The first guess is a full multigrid's: the coarser system's solution, itself found so.

mod level;
mod passes;
mod spectrum;
mod transfer;

use super::direct::Cholesky;
use super::{Edges, Error, GridLaplacian, Pins, larger, largest};
use crate::Watch;
use level::Level;
use passes::Tally;
use spectrum::Lanczos;

/// Lattices with at most so many columns or rows are not made coarser.
const COARSEST: usize = 9;

/// Single precision blurs a solution by about this part of it, times the largest over the least diagonal entry; less on
/// all systems tried. Once corrections are as small the residual is computed anew in double precision.
const BLUR: f32 = 1e-7;

/// Bounds of that part.
const BLUR_BETWEEN: [f32; 2] = [1.0 / 1_048_576.0, 1.0 / 64.0];

/// Iterations between two residuals in double precision at most.
const ITERATIONS: usize = 24;

/// Double precision residuals at most.
const ROUNDS: usize = 40;

/// The largest correction over the least eigenvalue of the preconditioned matrix estimates the error it is made for,
/// and one minus that eigenvalue the part of it that is left once the correction is added. Both hold in the energy
/// norm; times this the product bounds the largest error on nearly all systems tried, by twice that on all.
const SAFETY: f64 = 3.0;

/// Steps of conjugate gradients that it takes to see the least eigenvalue,
const STEPS_TO_SEE: usize = 4;

/// what it is taken for before,
const UNSEEN: f64 = 0.25;

/// and the largest that is believed.
const BELIEVED: f64 = 0.75;

#[derive(Debug)]
pub(super) struct Multigrid {
    levels: Vec<Level>,
    coarsest: Cholesky,
    /// What single precision conductances and residuals are multiplied by.
    scale: f64,
    /// Part of a solution that single precision may miss.
    blur: f32,
}

/// The arrays of one level, for one right-hand side.
pub(super) struct Arrays {
    residual: Vec<f32>,
    correction: Vec<f32>,
    direction: Vec<f32>,
    solution: Vec<f32>,
}

impl Arrays {
    fn new(level: &Level) -> Self {
        let zeros = || vec![0.0; level.len()];
        Self { residual: zeros(), correction: zeros(), direction: zeros(), solution: zeros() }
    }
}

impl Multigrid {
    /// The hierarchy of a Laplacian pinned on its frame, with positive conductances.
    pub(super) fn new(laplacian: &GridLaplacian, watch: Watch) -> Result<Self, Error> {
        let Edges { horizontal, vertical } = &laplacian.conductances;
        watch.reserve(held_bytes(laplacian.nodes))?;
        let scale = 1.0 / laplacian.stiffest();
        let mut levels = vec![Level::finest(laplacian.nodes, horizontal, vertical, scale)];
        while let Some(finest) = levels.last().filter(|level| level.columns.min(level.rows) > COARSEST) {
            watch.go_on()?;
            let coarser = finest.coarser();
            levels.push(coarser);
        }
        let coarsest = coarsest(&levels[levels.len() - 1], watch)?;
        let inner = || levels[0].inverse.iter().filter(|inverse| **inverse > 0.0);
        let contrast = inner().fold(0.0, |a: f32, b| a.max(*b)) / inner().fold(f32::INFINITY, |a, b| a.min(*b));
        let blur = (BLUR * contrast).clamp(BLUR_BETWEEN[0], BLUR_BETWEEN[1]);
        Ok(Self { levels, coarsest, scale, blur })
    }

    /// The arrays of a solve; they serve one after the other.
    pub(super) fn arrays(&self) -> Vec<Arrays> {
        self.levels.iter().map(Arrays::new).collect()
    }

    /// Solves for one right-hand side, the unknowns of `field` 0 at first; gives the relative residual.
    pub(super) fn solve(
        &self,
        laplacian: &GridLaplacian,
        flux: &Edges,
        field: &mut [f64],
        tolerance: f64,
        arrays: &mut [Arrays],
        watch: Watch,
    ) -> Result<f64, Error> {
        arrays[0].direction.fill(0.0);
        let Arrays { residual, direction, .. } = &mut arrays[0];
        let first = self.advance(laplacian, flux, field, direction, residual);
        self.guess(arrays)?;
        self.start(0, arrays);
        let (mut least, mut last) = (None, first);
        for _ in 0..ROUNDS {
            watch.go_on()?;
            let error = self.correct(arrays, tolerance, &mut least, watch)?;
            if error.is_nan() {
                return Err(Error::Inaccurate { residual: error });
            }
            let Arrays { residual, solution, .. } = &mut arrays[0];
            last = self.advance(laplacian, flux, field, solution, residual);
            solution.fill(0.0);
            if error <= tolerance {
                return Ok(relative(last, first));
            }
        }
        Err(Error::Inaccurate { residual: relative(last, first) })
    }

    /// Adds a correction to the field. What is left of the residual in double precision is scaled and rounded to
    /// `residual`; gives its largest magnitude.
    fn advance(
        &self,
        laplacian: &GridLaplacian,
        flux: &Edges,
        field: &mut [f64],
        correction: &[f32],
        residual: &mut [f32],
    ) -> f64 {
        let level = &self.levels[0];
        let mut row_values = vec![0.0; level.columns];
        let mut most = 0.0;
        for row in 1..level.rows - 1 {
            // The row below takes part; the frame has no correction.
            for row in if row == 1 { 1..3 } else { row + 1..row + 2 } {
                let field = &mut field[row * level.columns..(row + 1) * level.columns];
                passes::add_row(level.row(correction, row), level.half, field);
            }
            laplacian.residual_row(flux, field, row, &mut row_values);
            let inner = &mut row_values[..level.columns - 1];
            inner[0] = 0.0;
            most = larger(most, largest(inner));
            let at = 2 * level.half * row;
            passes::round(inner, self.scale, level.half, &mut residual[at..at + 2 * level.half]);
        }
        most
    }

    /// A full multigrid's first guess for the residual of the finest level, in its `direction`.
    fn guess(&self, arrays: &mut [Arrays]) -> Result<(), Error> {
        let last = self.levels.len() - 1;
        for l in 0..last {
            let (fine, coarse) = arrays.split_at_mut(l + 1);
            passes::restrict(&self.levels[l], &self.levels[l + 1], &fine[l].residual, &mut coarse[0].residual);
        }
        if last == 0 {
            return Ok(());
        }
        self.solve_coarsest(&mut arrays[last])?;
        let Arrays { solution, correction, .. } = &mut arrays[last];
        solution.copy_from_slice(correction);
        for l in (0..last).rev() {
            let (fine, coarse) = arrays.split_at_mut(l + 1);
            passes::interpolate(&self.levels[l], &self.levels[l + 1], &coarse[0].solution, &mut fine[l].direction);
            if l > 0 {
                self.start(l, arrays);
                self.cycle(l, arrays)?;
                let Arrays { correction, solution, .. } = &mut arrays[l];
                passes::add(correction, solution);
            }
        }
        Ok(())
    }

    /// Makes the `direction` of a level its `solution`, and leaves its residual.
    fn start(&self, l: usize, arrays: &mut [Arrays]) {
        let Arrays { residual, direction, solution, .. } = &mut arrays[l];
        solution.fill(0.0);
        passes::advance(&self.levels[l], direction, 1.0, solution, residual);
    }

    /// Conjugate gradients for the residual of the finest level, added to its `solution`. Gives an estimate of the
    /// error left, NaN where single precision does not hold the numbers.
    ///
    /// * `least`: the least eigenvalue seen.
    fn correct(
        &self,
        arrays: &mut [Arrays],
        tolerance: f64,
        least: &mut Option<f64>,
        watch: Watch,
    ) -> Result<f64, Error> {
        let mut product = 0.0;
        let mut whole = passes::largest(&arrays[0].solution);
        let mut error = f64::INFINITY;
        let mut spectrum = Lanczos::default();
        for iteration in 0..ITERATIONS {
            watch.go_on()?;
            let tally = self.cycle(0, arrays)?;
            let seen = (iteration >= STEPS_TO_SEE).then(|| spectrum.least().min(BELIEVED));
            *least = seen.into_iter().chain(*least).reduce(f64::min);
            let slowest = least.unwrap_or(UNSEEN);
            if iteration == 0 {
                whole = whole.max(tally.largest);
            }
            let blur = self.blur * whole;
            error = SAFETY * f64::from(tally.largest) * (1.0 - slowest) / slowest + f64::from(blur);
            if error.is_nan() {
                return Ok(error);
            }
            let arrays = &mut arrays[0];
            if error <= tolerance || tally.largest <= blur {
                passes::add(&arrays.correction, &mut arrays.solution);
                return Ok(error);
            }
            let ratio = |a: f64, b: f64| if b > 0.0 { (a / b) as f32 } else { 0.0 };
            let beta = if iteration == 0 { 0.0 } else { ratio(tally.product, product) };
            let energy = passes::direct(&self.levels[0], &arrays.correction, beta, &mut arrays.direction);
            let alpha = ratio(tally.product, energy);
            spectrum.step(alpha.into(), beta.into());
            passes::advance(&self.levels[0], &arrays.direction, alpha, &mut arrays.solution, &mut arrays.residual);
            product = tally.product;
        }
        Ok(error)
    }

    /// One V-cycle for the residual of a level, from 0: its `correction`.
    fn cycle(&self, l: usize, arrays: &mut [Arrays]) -> Result<Tally, Error> {
        if l + 1 == self.levels.len() {
            return self.solve_coarsest(&mut arrays[l]);
        }
        let (level, coarser) = (&self.levels[l], &self.levels[l + 1]);
        let (fine, coarse) = arrays.split_at_mut(l + 1);
        passes::descend(level, coarser, &fine[l].residual, &mut coarse[0].residual);
        self.cycle(l + 1, arrays)?;
        let (fine, coarse) = arrays.split_at_mut(l + 1);
        let Arrays { residual, correction, .. } = &mut fine[l];
        Ok(passes::ascend(level, coarser, residual, &coarse[0].correction, correction))
    }

    fn solve_coarsest(&self, arrays: &mut Arrays) -> Result<Tally, Error> {
        let level = &self.levels[self.levels.len() - 1];
        let place = |node: usize| {
            let (column, row) = (node % level.columns, node / level.columns);
            (2 * row + column % 2) * level.half + column / 2
        };
        let count = level.columns * level.rows;
        let right_hand_side: Vec<f64> = (0..count).map(|node| f64::from(arrays.residual[place(node)])).collect();
        let mut fields = [vec![0.0; count]];
        self.coarsest.add_solutions(std::slice::from_ref(&right_hand_side), &mut fields)?;
        let [field] = fields;
        field.iter().enumerate().for_each(|(node, value)| arrays.correction[place(node)] = *value as f32);
        let product = field.iter().zip(&right_hand_side).map(|(a, b)| a * b).sum();
        Ok(Tally { product, largest: largest(&field) as f32 })
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        self.levels.iter().map(|level| 3 * level.len() * size_of::<f32>()).sum::<usize>() + self.coarsest.bytes()
    }

    /// Bytes that a solve takes beside the fields, for any count of right-hand sides.
    pub(super) fn solve_bytes(&self) -> usize {
        self.levels.iter().map(|level| 4 * level.len() * size_of::<f32>()).sum()
    }
}

fn relative(residual: f64, right_hand_side: f64) -> f64 {
    if residual == 0.0 { 0.0 } else { residual / right_hand_side }
}

/// Bytes of the hierarchy of a lattice: three numbers a node, on all levels.
fn held_bytes([columns, rows]: [usize; 2]) -> usize {
    16 * columns * rows
}

fn coarsest(level: &Level, watch: Watch) -> Result<Cholesky, Error> {
    let nodes = [level.columns, level.rows];
    let edge = |edges: &[f32], column: usize, row: usize| f64::from(level.edge(edges, column, row));
    let horizontal = (0..nodes[1]).flat_map(|row| (0..nodes[0] - 1).map(move |column| (column, row)));
    let vertical = (0..nodes[1] - 1).flat_map(|row| (0..nodes[0]).map(move |column| (column, row)));
    let conductances = Edges {
        horizontal: horizontal.map(|(column, row)| edge(&level.right, column, row)).collect(),
        vertical: vertical.map(|(column, row)| edge(&level.down, column, row)).collect(),
    };
    Cholesky::new(&GridLaplacian::new(nodes, conductances, Pins::Frame), watch)
}
