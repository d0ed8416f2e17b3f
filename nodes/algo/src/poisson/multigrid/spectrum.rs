//! How slow the slowest error is: the least eigenvalue of the preconditioned matrix, from what conjugate gradients do.

/// The tridiagonal matrix of a Lanczos process, told step by step.
#[derive(Default)]
pub(super) struct Lanczos {
    diagonal: Vec<f64>,
    /// Squares of the entries beside the diagonal.
    beside: Vec<f64>,
    last_alpha: f64,
}

impl Lanczos {
    /// A step of conjugate gradients with these coefficients, beta 0 in the first one.
    pub(super) fn step(&mut self, alpha: f64, beta: f64) {
        if alpha > 0.0 {
            if self.last_alpha > 0.0 {
                self.beside.push(beta / (self.last_alpha * self.last_alpha));
            }
            let before = if self.last_alpha > 0.0 { beta / self.last_alpha } else { 0.0 };
            self.diagonal.push(1.0 / alpha + before);
            self.last_alpha = alpha;
        }
    }

    /// The least eigenvalue so far, to 1 %; 1 before the first step.
    pub(super) fn least(&self) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        while high - low > 0.01 * high && high > 1e-9 {
            let middle = 0.5 * (low + high);
            if self.is_below(middle) { high = middle } else { low = middle }
        }
        high
    }

    /// Whether an eigenvalue is below `bound`: a pivot of the shifted matrix is negative.
    fn is_below(&self, bound: f64) -> bool {
        let mut pivot = 1.0;
        self.diagonal.iter().enumerate().any(|(i, diagonal)| {
            let coupling = if i == 0 { 0.0 } else { self.beside[i - 1] / pivot };
            pivot = diagonal - bound - coupling;
            pivot <= 0.0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Conjugate gradients on diag(0.1, 0.5, 1) from (1, 1, 1).
    #[test]
    fn the_least_eigenvalue_is_found() {
        let values = [0.1, 0.5, 1.0];
        let (mut r, mut p) = ([1.0; 3], [0.0; 3]);
        let (mut product, mut lanczos) = (0.0, Lanczos::default());
        assert_eq!(lanczos.least(), 1.0);
        for step in 0..3 {
            let next: f64 = r.iter().map(|r| r * r).sum();
            let beta = if step == 0 { 0.0 } else { next / product };
            product = next;
            (0..3).for_each(|i| p[i] = r[i] + beta * p[i]);
            let alpha = product / (0..3).map(|i| values[i] * p[i] * p[i]).sum::<f64>();
            (0..3).for_each(|i| r[i] -= alpha * values[i] * p[i]);
            lanczos.step(alpha, beta);
        }
        assert!((lanczos.least() - 0.1).abs() < 2e-3, "{}", lanczos.least());
    }
}
