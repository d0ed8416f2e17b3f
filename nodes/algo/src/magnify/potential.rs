//! Potentials whose gradient moves the nodes of a lattice, from how much its cells are to grow.

use rayon::prelude::*;

use super::Frame;
use crate::fourier::{Basis, Rows};
use crate::lattice::Lattice;

/// Rows that one task transposes, and the side of a tile of them.
const TILE: usize = 16;

/// Solves for a potential at the cells of a lattice: mirrored at its frame, or periodic.
pub(super) struct Poisson {
    across: Rows,
    down: Rows,
    cells: [usize; 2],
    /// One over the eigenvalue and the transforms' scale, column by column.
    reciprocals: Vec<f64>,
}

impl Poisson {
    /// The solver for the cells of `lattice`.
    ///
    /// `response` of an eigenvalue is that of the moved cells' areas, the rest the five-point Laplacian's. It must be less
    /// than 1: no nodes' moves make a checkerboard of areas, and none may be answered by an endless potential.
    pub(super) fn new(lattice: &Lattice, frame: Frame, response: f64) -> Self {
        let cells @ [columns, rows] = lattice.cells();
        let basis = if frame == Frame::Periodic { Basis::Wave } else { Basis::Cosine };
        // Of each coefficient the second difference, per px squared, and what averaging two samples leaves of it, squared.
        let [across, down] = [0, 1].map(|axis| {
            let parts = |k: usize| {
                let (sin, cos) = libm::sincos(basis.half_angle(k, cells[axis]));
                let slope = 2.0 * sin / lattice.spacing[axis];
                (slope * slope, cos * cos)
            };
            (0..cells[axis]).map(parts).collect::<Vec<_>>()
        });
        let scale = (columns * rows) as f64;
        let reciprocal = |(x, left_x): (f64, f64), (y, left_y): (f64, f64)| {
            let eigenvalue = response * (x * left_y + y * left_x) + (1.0 - response) * (x + y);
            if eigenvalue > 0.0 { -1.0 / (eigenvalue * scale) } else { 0.0 }
        };
        let reciprocals = across.iter().flat_map(|&x| down.iter().map(move |&y| reciprocal(x, y))).collect();
        Self { across: Rows::new(basis, columns), down: Rows::new(basis, rows), cells, reciprocals }
    }

    /// Turns the growth of cells, of mean 0, into the potential of mean 0 that causes it to first order; `spare` is of
    /// the same size.
    pub(super) fn solve(&self, values: &mut [f64], spare: &mut [f64]) {
        let Self { across, down, cells: [columns, rows], reciprocals } = self;
        across.each_pair(values, |_, pair, scratch| across.analyse(pair, scratch));
        transpose(values, *columns, spare);
        down.each_pair(spare, |first, pair, scratch| {
            down.analyse(pair, scratch);
            let reciprocals = &reciprocals[first * rows..][..pair.len()];
            pair.iter_mut().zip(reciprocals).for_each(|(value, reciprocal)| *value *= reciprocal);
            down.synthesise(pair, scratch);
        });
        transpose(spare, *rows, values);
        across.each_pair(values, |_, pair, scratch| across.synthesise(pair, scratch));
    }
}

/// Columns of `values`, whose rows are `width` long, as rows of `out`.
fn transpose(values: &[f64], width: usize, out: &mut [f64]) {
    let height = values.len() / width;
    out.par_chunks_mut(TILE * height).enumerate().for_each(|(task, out)| {
        for top in (0..height).step_by(TILE) {
            for (column, out) in out.chunks_mut(height).enumerate() {
                let end = height.min(top + TILE);
                for (row, out) in (top..end).zip(&mut out[top..end]) {
                    *out = values[row * width + task * TILE + column];
                }
            }
        }
    });
}
