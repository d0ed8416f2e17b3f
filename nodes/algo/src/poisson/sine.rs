//! The sine backend: Fourier analysis of a Laplacian that is the same everywhere, pinned on its frame.
//!
//! Sines along the rows are eigenvectors of the differences across. In their coefficients every frequency is a system
//! of its own down the rows, tridiagonal with equal entries, so that elimination runs over whole rows.

use super::{Error, GridLaplacian};
use crate::{Interrupted, Watch};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlannerScalar};

/// Rows that one task transforms.
const ROWS: usize = 16;

#[derive(Debug)]
pub(super) struct Sine {
    columns: usize,
    /// Conductance down.
    down: f64,
    /// Reciprocal pivots of the elimination down the rows: one a row and frequency, inner nodes only.
    reciprocals: Vec<f64>,
}

impl Sine {
    /// The elimination of a Laplacian with unknowns.
    pub(super) fn new(laplacian: &GridLaplacian, watch: Watch) -> Result<Self, Error> {
        let [columns, rows] = laplacian.nodes;
        let (across, down) = (laplacian.conductances.horizontal[columns - 1], laplacian.conductances.vertical[1]);
        let width = columns - 2;
        let mut reciprocals = Vec::new();
        watch.reserve(laplacian.unknowns() * size_of::<f64>())?;
        reciprocals.try_reserve_exact(laplacian.unknowns()).map_err(|_| Error::OutOfMemory)?;
        let diagonal = |frequency: usize| {
            let sine = libm::sin(std::f64::consts::FRAC_PI_2 * (frequency + 1) as f64 / (columns - 1) as f64);
            4.0 * across * sine * sine + 2.0 * down
        };
        let diagonals: Vec<f64> = (0..width).map(diagonal).collect();
        reciprocals.extend(diagonals.iter().map(|diagonal| 1.0 / diagonal));
        for row in 1..rows - 2 {
            for (frequency, diagonal) in diagonals.iter().enumerate() {
                let above = reciprocals[(row - 1) * width + frequency];
                reciprocals.push(1.0 / (diagonal - down * down * above));
            }
        }
        Ok(Self { columns, down, reciprocals })
    }

    /// Adds to the unknowns of every field the solution for the right-hand side of the same number, both over all
    /// nodes. The right-hand sides are lost.
    pub(super) fn add_solutions(
        &self,
        right_hand_sides: &mut [Vec<f64>],
        fields: &mut [Vec<f64>],
        go_on: &dyn Fn() -> Result<(), Interrupted>,
    ) -> Result<(), Error> {
        let columns = self.columns;
        let period = 2 * (columns - 1);
        let fft = &*FftPlannerScalar::new().plan_fft_forward(period);
        for (values, field) in right_hand_sides.iter_mut().zip(fields) {
            let inner = columns..values.len() - columns;
            transform(fft, columns, &mut values[inner.clone()]);
            go_on()?;
            self.eliminate(&mut values[inner.clone()]);
            go_on()?;
            transform(fft, columns, &mut values[inner.clone()]);
            let scale = 4.0 / period as f64;
            let rows = field[inner.clone()].par_chunks_mut(columns).zip(values[inner].par_chunks(columns));
            rows.for_each(|(row, values)| {
                let unknowns = 1..columns - 1;
                row[unknowns.clone()].iter_mut().zip(&values[unknowns]).for_each(|(x, value)| *x += scale * value);
            });
        }
        Ok(())
    }

    /// Solves for every frequency down the rows.
    fn eliminate(&self, values: &mut [f64]) {
        let (columns, width, down) = (self.columns, self.columns - 2, self.down);
        let rows = values.len() / columns;
        for row in 0..rows {
            let (above, here) = values.split_at_mut(row * columns);
            let here = &mut here[1..=width];
            if row > 0 {
                let above = &above[(row - 1) * columns + 1..][..width];
                here.iter_mut().zip(above).for_each(|(x, above)| *x += down * above);
            }
            let reciprocals = &self.reciprocals[row * width..(row + 1) * width];
            here.iter_mut().zip(reciprocals).for_each(|(x, reciprocal)| *x *= reciprocal);
        }
        for row in (1..rows).rev() {
            let (above, here) = values.split_at_mut(row * columns);
            let above = &mut above[(row - 1) * columns + 1..][..width];
            let reciprocals = &self.reciprocals[(row - 1) * width..row * width];
            for ((x, below), reciprocal) in above.iter_mut().zip(&here[1..]).zip(reciprocals) {
                *x += down * reciprocal * below;
            }
        }
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        self.reciprocals.len() * size_of::<f64>()
    }

    /// Bytes that a solve for `together` right-hand sides over `count` nodes takes beside the fields: remainders before
    /// and after a step, and what a row needs for its transform.
    pub(super) fn solve_bytes(&self, count: usize, together: usize) -> usize {
        let transforms = (2 * rayon::current_num_threads() + 2) * 2 * self.columns * size_of::<Complex64>();
        2 * together * count * size_of::<f64>() + transforms
    }
}

/// `X_k = sum over j of x_j sin(pi j k / (columns - 1))` along every row, the nodes on the frame left as they are.
///
/// Two rows at a time: a + i b, continued as an odd function, has the Fourier coefficients 2 B_k - 2 i A_k.
fn transform(fft: &dyn Fft<f64>, columns: usize, values: &mut [f64]) {
    values.par_chunks_mut(ROWS * columns).for_each(|rows| {
        let mut wave = vec![Complex64::default(); fft.len()];
        let mut scratch = vec![Complex64::default(); fft.get_inplace_scratch_len()];
        for pair in rows.chunks_mut(2 * columns) {
            let (one, two) = pair.split_at_mut(columns);
            wave.fill(Complex64::default());
            for j in 1..columns - 1 {
                let value = Complex64::new(one[j], two.get(j).copied().unwrap_or(0.0));
                (wave[j], wave[2 * (columns - 1) - j]) = (value, -value);
            }
            fft.process_with_scratch(&mut wave, &mut scratch);
            for k in 1..columns - 1 {
                one[k] = -0.5 * wave[k].im;
                if let Some(value) = two.get_mut(k) {
                    *value = 0.5 * wave[k].re;
                }
            }
        }
    });
}
