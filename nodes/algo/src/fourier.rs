//! Analysis of real rows in cosines, or in a period's waves, by complex Fourier transforms.

use std::sync::Arc;

use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlannerScalar};

/// Rows that one task transforms; even, so that pairs do not depend on the tasks.
const ROWS: usize = 16;

/// What a row is analysed in: the eigenvectors of second differences along it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Basis {
    /// Mirrored at both ends: X_k = sum of x_j cos(pi (j + 1/2) k / n).
    Cosine,
    /// Repeated: X_k = sum of x_j (cos + sin)(2 pi j k / n).
    Wave,
}

impl Basis {
    /// Half the angle from one sample to the next of coefficient `k` of `count`.
    pub(crate) fn half_angle(self, k: usize, count: usize) -> f64 {
        let part = k as f64 / count as f64;
        std::f64::consts::PI * if self == Self::Cosine { part / 2.0 } else { part }
    }
}

/// The transforms of rows of one length.
///
/// Two rows at a time: a + i b goes through one complex transform Z, and the coefficients A + i B come out of Z_k and
/// Z_(n - k).
///
/// R. V. L. Hartley, "A More Symmetrical Fourier Analysis Applied to Transmission Problems", Proc. IRE 30, 1942; J.
/// Makhoul, "A Fast Cosine Transform in One and Two Dimensions", IEEE Trans. ASSP 28, 1980.
pub(crate) struct Rows {
    basis: Basis,
    forward: Arc<dyn Fft<f64>>,
    backward: Arc<dyn Fft<f64>>,
    /// exp(-i pi k / 2n).
    turns: Vec<Complex64>,
}

/// Space for the transform of a pair of rows.
pub(crate) struct Scratch {
    wave: Vec<Complex64>,
    more: Vec<Complex64>,
}

impl Rows {
    /// Transforms of rows of `count` samples, at least one.
    pub(crate) fn new(basis: Basis, count: usize) -> Self {
        let mut planner = FftPlannerScalar::new();
        let turn = |k: usize| {
            let (sin, cos) = libm::sincos(Basis::Cosine.half_angle(k, count));
            Complex64::new(cos, -sin)
        };
        let (forward, backward) = (planner.plan_fft_forward(count), planner.plan_fft_inverse(count));
        Self { basis, forward, backward, turns: (0..count).map(turn).collect() }
    }

    /// Space for the transform of a pair of rows.
    pub(crate) fn scratch(&self) -> Scratch {
        let more = self.forward.get_inplace_scratch_len().max(self.backward.get_inplace_scratch_len());
        Scratch { wave: vec![Complex64::default(); self.turns.len()], more: vec![Complex64::default(); more] }
    }

    /// Calls `work` with every pair of rows, the last one alone if their count is odd.
    pub(crate) fn each_pair(&self, values: &mut [f64], work: impl Fn(usize, &mut [f64], &mut Scratch) + Sync) {
        let count = self.turns.len();
        values.par_chunks_mut(ROWS * count).enumerate().for_each(|(task, rows)| {
            let mut scratch = self.scratch();
            for (pair, rows) in rows.chunks_mut(2 * count).enumerate() {
                work(task * ROWS + 2 * pair, rows, &mut scratch);
            }
        });
    }

    /// The coefficients of one row or two that follow each other.
    pub(crate) fn analyse(&self, rows: &mut [f64], Scratch { wave, more }: &mut Scratch) {
        let (count, turns) = (self.turns.len(), &self.turns);
        let (one, two) = rows.split_at_mut(count);
        for j in 0..count {
            wave[self.place(j)] = Complex64::new(one[j], two.get(j).copied().unwrap_or(0.0));
        }
        self.forward.process_with_scratch(wave, more);
        put(one, two, 0, wave[0]);
        for k in 1..count {
            let (here, there) = (wave[k], wave[count - k]);
            let sum = match self.basis {
                Basis::Cosine => turns[k] * here + i_times(turns[count - k] * there),
                Basis::Wave => here + there + i_times(here - there),
            };
            put(one, two, k, 0.5 * sum);
        }
    }

    /// `n` times the rows that have these coefficients, one or two that follow each other.
    pub(crate) fn synthesise(&self, rows: &mut [f64], scratch: &mut Scratch) {
        let (count, turns) = (self.turns.len(), &self.turns);
        if self.basis == Basis::Wave {
            return self.analyse(rows, scratch);
        }
        let Scratch { wave, more } = scratch;
        let (one, two) = rows.split_at_mut(count);
        let coefficient = |k: usize| Complex64::new(one[k], two.get(k).copied().unwrap_or(0.0));
        wave[0] = coefficient(0);
        for k in 1..count {
            wave[k] = turns[k].conj() * (coefficient(k) - i_times(coefficient(count - k)));
        }
        self.backward.process_with_scratch(wave, more);
        for j in 0..count {
            put(one, two, j, wave[self.place(j)]);
        }
    }

    /// Where a sample stands in the transform: for cosines even ones rising, then odd ones falling.
    fn place(&self, j: usize) -> usize {
        match self.basis {
            Basis::Wave => j,
            Basis::Cosine if j.is_multiple_of(2) => j / 2,
            Basis::Cosine => self.turns.len() - 1 - j / 2,
        }
    }
}

/// Puts a complex number into a pair of rows; the second may be missing.
fn put(one: &mut [f64], two: &mut [f64], at: usize, value: Complex64) {
    one[at] = value.re;
    if let Some(second) = two.get_mut(at) {
        *second = value.im;
    }
}

/// `i value`.
fn i_times(value: Complex64) -> Complex64 {
    Complex64::new(-value.im, value.re)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(count: usize) -> Vec<f64> {
        (0..2 * count).map(|at| libm::sin(1.7 * at as f64) + 0.1 * at as f64).collect()
    }

    /// Coefficients by the definition.
    fn defined(basis: Basis, row: &[f64]) -> Vec<f64> {
        let angle = |j: usize, k: usize| match basis {
            Basis::Cosine => std::f64::consts::PI * (j as f64 + 0.5) * k as f64 / row.len() as f64,
            Basis::Wave => std::f64::consts::TAU * (j * k) as f64 / row.len() as f64,
        };
        let of = |j: usize, k: usize| match basis {
            Basis::Cosine => libm::cos(angle(j, k)),
            Basis::Wave => libm::cos(angle(j, k)) + libm::sin(angle(j, k)),
        };
        (0..row.len()).map(|k| row.iter().enumerate().map(|(j, x)| x * of(j, k)).sum()).collect()
    }

    #[test]
    fn coefficients_are_those_of_the_definition_and_give_the_rows_back() {
        for (basis, count) in
            [Basis::Cosine, Basis::Wave].into_iter().flat_map(|b| [1, 2, 3, 4, 5, 8, 12, 17].map(|n| (b, n)))
        {
            let transform = Rows::new(basis, count);
            let (start, mut scratch) = (rows(count), transform.scratch());
            let mut values = start.clone();
            transform.analyse(&mut values, &mut scratch);
            let expected: Vec<f64> = start.chunks(count).flat_map(|row| defined(basis, row)).collect();
            let mut single = start[..count].to_vec();
            transform.analyse(&mut single, &mut scratch);
            for (at, expected) in expected.iter().enumerate() {
                assert!((values[at] - expected).abs() < 1e-11, "{basis:?} of {count}: {values:?}");
                assert!(at >= count || (single[at] - expected).abs() < 1e-11, "{basis:?} of {count}, alone");
            }
            transform.synthesise(&mut values, &mut scratch);
            for (value, start) in values.iter().zip(&start) {
                assert!((value / count as f64 - start).abs() < 1e-12, "{basis:?} of {count}, back");
            }
        }
    }
}
