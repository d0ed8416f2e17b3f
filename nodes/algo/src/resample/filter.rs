//! Filters: how a value is made of the samples around a source position.

/// What a value is made of around a source position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Filter {
    /// The pixel that the position lies in.
    Nearest,
    /// Bilinear, 2 x 2 pixels.
    Linear,
    /// Keys' cubic convolution with a = -1/2 along both axes, 4 x 4 pixels.
    Cubic,
    /// Mitchell's and Netravali's cubic with B = C = 1/3, 4 x 4 pixels. It blurs, at whole-pixel positions too.
    Mitchell,
    /// The sinc windowed by its own middle lobe, three times as wide, weights divided by their sum, 6 x 6 pixels.
    Lanczos3,
    /// Cubic where the map does not shrink; elsewhere the mean over the ellipse that the destination pixel covers in the
    /// source, weighted by a kernel as wide as the pixel. See [`draw`](super::draw).
    Ewa,
}

impl Filter {
    /// How far outside the source window a position gets weight from it, px: 0, 1/2, 3/2, 5/2 (less the resolution,
    /// since the weight at the very end is zero). That of Ewa depends on the map, see [`Ewa`](super::ewa::Ewa).
    pub(super) fn reach(self) -> f64 {
        match self {
            Self::Nearest => 0.0,
            Self::Linear => 0.5 - RESOLUTION,
            Self::Cubic | Self::Mitchell | Self::Ewa => 1.5 - RESOLUTION,
            Self::Lanczos3 => 2.5 - RESOLUTION,
        }
    }
}

/// Positions have this many fractional bits, those of an f32.
pub(super) const FRACTION_BITS: u32 = 24;
pub(super) const RESOLUTION: f64 = 1.0 / (1_u64 << FRACTION_BITS) as f64;

/// The weights along one axis of T pixels, as functions of the position's fraction t of the way from the middle pixel
/// to the next: `at_zero + t * q(t - 1/2)`, q of D coefficients. So they are exact at t = 0, and one form serves all
/// filters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kernel<const T: usize, const D: usize> {
    pub at_zero: [f32; T],
    pub q: [[f32; T]; D],
}

/// Cubics over four pixels.
pub(super) type Cubics = Kernel<4, 3>;
/// Over six pixels.
pub(super) type Sixth = Kernel<6, 9>;

pub(super) const LINEAR: Cubics =
    Kernel { at_zero: [0.0, 1.0, 0.0, 0.0], q: [[0.0, -1.0, 1.0, 0.0], [0.0; 4], [0.0; 4]] };

/// Keys 1981, equation 15.
pub(super) const CUBIC: Cubics = Kernel {
    at_zero: [0.0, 1.0, 0.0, 0.0],
    q: [[-0.125, -0.875, 1.125, -0.125], [0.5, -1.0, 0.5, 0.0], [-0.5, 1.5, -1.5, 0.5]],
};

/// Mitchell and Netravali 1988, equation 8.
pub(super) const MITCHELL: Cubics = Kernel {
    at_zero: [1.0 / 18.0, 16.0 / 18.0, 1.0 / 18.0, 0.0],
    q: [
        [-3.25 / 18.0, -12.75 / 18.0, 17.25 / 18.0, -1.25 / 18.0],
        [8.0 / 18.0, -15.0 / 18.0, 6.0 / 18.0, 1.0 / 18.0],
        [-7.0 / 18.0, 21.0 / 18.0, -21.0 / 18.0, 7.0 / 18.0],
    ],
};

/// Interpolated at nine Chebyshev nodes; 6e-7 from the definition at most.
pub(super) const LANCZOS3: Sixth = Kernel {
    at_zero: [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
    q: [
        [0.048913043, -0.27173913, -0.77717394, 1.2228261, -0.27173913, 0.048913043],
        [-0.22567426, 0.90578884, -1.1189809, 0.22768538, 0.18116195, 0.030018939],
        [0.27510306, -0.6700436, 1.2726731, -1.4206594, 0.7792102, -0.23628333],
        [0.069749966, -0.34253216, 0.54451203, -0.2490123, 0.12450432, -0.14722183],
        [-0.25333366, 0.45680353, -0.7469295, 0.8401191, -0.4772694, 0.18060996],
        [0.023405774, 0.13155407, -0.31551215, 0.13594325, -0.09501983, 0.1196289],
        [0.11008015, -0.20493266, 0.41595712, -0.48695365, 0.24821514, -0.082366094],
        [0.0016411182, -0.08866532, 0.16472022, -0.059048444, 0.025553778, -0.044201348],
        [-0.051561527, 0.10379536, -0.20762587, 0.23991147, -0.12464284, 0.040123403],
    ],
};

impl<const T: usize, const D: usize> Kernel<T, D> {
    /// Whether a whole-pixel position gives that pixel.
    pub fn interpolates(&self) -> bool {
        self.at_zero[T / 2 - 1] == 1.0
    }

    /// The weight of pixel `tap` at t.
    #[inline(always)]
    pub fn weight(&self, tap: usize, t: f32) -> f32 {
        let s = t - 0.5;
        let mut q = self.q[D - 1][tap];
        for d in (0..D - 1).rev() {
            q = q.mul_add(s, self.q[d][tap]);
        }
        t.mul_add(q, self.at_zero[tap])
    }

    /// The weights at t.
    #[inline(always)]
    pub fn weights(&self, t: f32) -> [f32; T] {
        let mut weights = [0.0; T];
        for (tap, weight) in weights.iter_mut().enumerate() {
            *weight = self.weight(tap, t);
        }
        weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<const T: usize, const D: usize>(kernel: &Kernel<T, D>, tolerance: f64, exact: impl Fn(f64) -> f64) {
        for step in 0..1000 {
            let t = step as f32 / 1000.0;
            let first = 1.0 - (T / 2) as f64;
            let at = |tap: usize| exact(f64::from(t) - first - tap as f64);
            let sum: f64 = (0..T).map(at).sum();
            for (tap, weight) in kernel.weights(t).into_iter().enumerate() {
                let expected = at(tap) / sum;
                assert!((f64::from(weight) - expected).abs() < tolerance, "{t} {tap}: {weight}, not {expected}");
            }
        }
    }

    #[test]
    fn weights_are_the_filters() {
        check(&LINEAR, 1e-7, |x| (1.0 - x.abs()).max(0.0));
        check(&CUBIC, 2e-7, |x| match x.abs() {
            x if x < 1.0 => 1.5 * x * x * x - 2.5 * x * x + 1.0,
            x if x < 2.0 => -0.5 * x * x * x + 2.5 * x * x - 4.0 * x + 2.0,
            _ => 0.0,
        });
        check(&MITCHELL, 2e-7, |x| match x.abs() {
            x if x < 1.0 => (7.0 * x * x * x - 12.0 * x * x + 16.0 / 3.0) / 6.0,
            x if x < 2.0 => (-7.0 / 3.0 * x * x * x + 12.0 * x * x - 20.0 * x + 32.0 / 3.0) / 6.0,
            _ => 0.0,
        });
        let sinc = |x: f64| if x == 0.0 { 1.0 } else { libm::sin(x) / x };
        let pi = std::f64::consts::PI;
        check(&LANCZOS3, 1e-6, |x| if x.abs() < 3.0 { sinc(pi * x) * sinc(pi * x / 3.0) } else { 0.0 });
    }
}
