//! Predefined warps, warps made of warps, and the certificate that a warp does not fold.
//!
//! Every generator gives node positions `dst_from_src`: where a lattice's nodes go. Each is written as the rest
//! position plus a displacement, so parameters that mean "no change" give the rest positions bit for bit.

mod affine;
mod arc;
mod bend;
mod certify;
mod compose;
mod envelope;
mod free_lattice;
mod invert;
mod lens;
mod perspective;
mod ripple;
mod swirl;
mod turbulence;
mod wave;

pub use affine::{Affine, affine, stretch};
pub use arc::arc;
pub use bend::{Bend, Orientation, Shape, bend};
pub(crate) use certify::least_cross_products;
pub use certify::{Certificate, certify};
pub use compose::{Composed, blend, compose};
pub use envelope::{Envelope, envelope};
pub use free_lattice::{control_moves, free_lattice};
pub use invert::{InvertError, Inverted, image_lattice, invert, refuse_folds};
pub use lens::{half_diagonal, lens};
pub use perspective::{PerspectiveError, perspective};
pub use ripple::ripple;
pub use swirl::swirl;
pub use turbulence::{Turbulence, turbulence};
pub use wave::wave;

/// Sine and cosine of an angle in degrees, exact at multiples of 90.
fn sin_cos_deg(degrees: f64) -> (f64, f64) {
    let degrees = degrees % 360.0;
    let quarters = (degrees / 90.0).round();
    let (sin, cos) = libm::sincos((degrees - 90.0 * quarters).to_radians());
    match (quarters as i64).rem_euclid(4) {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::{Lattice, Positions};

    /// Lattices on which `center + (x - center)` does not give x back.
    pub(super) fn fractional_lattices() -> [Lattice; 3] {
        [
            Lattice { origin: [0.0, 0.0], spacing: [1.0 / 3.0, 0.7], nodes: [13, 9] },
            Lattice { origin: [-17.3, 100_000.1], spacing: [7.123, 0.011], nodes: [31, 22] },
            Lattice { origin: [0.5, -0.5], spacing: [16.1, 15.9], nodes: [2, 2] },
        ]
    }

    /// Asserts that `warp` gives the rest positions of all of these lattices bit for bit.
    pub(super) fn assert_identity(warp: impl Fn(&Lattice) -> Positions) {
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        for lattice in fractional_lattices() {
            let (rest, warped) = (Positions::from_map(&lattice, |p| p), warp(&lattice));
            assert_eq!(bits(&rest.x), bits(&warped.x));
            assert_eq!(bits(&rest.y), bits(&warped.y));
        }
    }

    /// Asserts that `warp` gives the same bits on any number of threads.
    pub(super) fn assert_threads_agree(warp: impl Fn() -> Positions + Send + Sync) {
        let bits = |Positions { x, y }: Positions| x.iter().chain(&y).map(|at| at.to_bits()).collect::<Vec<_>>();
        let expected = bits(warp());
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            assert_eq!(bits(pool.install(&warp)), expected, "{threads} threads");
        }
    }

    #[test]
    fn quarter_turns_are_exact() {
        for (degrees, expected) in
            [(0.0, (0.0, 1.0)), (90.0, (1.0, 0.0)), (180.0, (0.0, -1.0)), (270.0, (-1.0, 0.0)), (-90.0, (-1.0, 0.0))]
        {
            assert_eq!(sin_cos_deg(degrees), expected, "{degrees} degrees");
            assert_eq!(sin_cos_deg(degrees + 3600.0), expected, "{degrees} degrees and ten turns");
        }
    }

    #[test]
    fn other_angles_agree_with_radians() {
        for step in -1000..1000 {
            let degrees = 0.77 * f64::from(step);
            let (sin, cos) = sin_cos_deg(degrees);
            assert!((sin - degrees.to_radians().sin()).abs() < 1e-13, "{degrees} degrees");
            assert!((cos - degrees.to_radians().cos()).abs() < 1e-13, "{degrees} degrees");
        }
    }
}
