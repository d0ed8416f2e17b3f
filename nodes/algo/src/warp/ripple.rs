//! Concentric waves.

use super::sin_cos_deg;
use crate::lattice::{Lattice, Positions};
use crate::{Interrupted, Watch};

/// Moves the lattice by waves that run outwards from a centre, as on water.
///
/// With d the distance of p from the centre:
///
/// p' = p + amplitude sin(2 pi d / wavelength + phase) (p - center) / sqrt(d^2 + (wavelength / 4)^2).
///
/// The last factor is the outward direction, faded to nothing at the centre, where it would have none.
///
/// * `lattice`: the nodes to move.
/// * `amplitude`: px, any finite number; 0 is the identity.
/// * `wavelength`: px, > 0 (asserted).
/// * `phase_deg`: degrees; growing phases make the waves run inwards.
/// * `center`: px; it may lie outside the lattice.
///
/// The continuous warp does not fold while |amplitude| < wavelength / (2 pi + 4), about a tenth of it. Wavelengths
/// below two spacings are sampled too coarsely and alias.
///
/// Cost: linear in the nodes, rows side by side. Stops when `watch` says so.
pub fn ripple(
    lattice: &Lattice,
    amplitude: f64,
    wavelength: f64,
    phase_deg: f64,
    center: [f64; 2],
    watch: Watch,
) -> Result<Positions, Interrupted> {
    assert!(wavelength > 0.0, "a wavelength of {wavelength} px is not positive");
    Positions::mapped(lattice, watch, |[x, y]| {
        let [dx, dy] = [(x - center[0]) / wavelength, (y - center[1]) / wavelength];
        let square = dx * dx + dy * dy;
        let (height, _) = sin_cos_deg(360.0 * (square.sqrt() % 1.0) + phase_deg);
        let scale = amplitude * height / (square + 0.0625).sqrt();
        [x + scale * dx, y + scale * dy]
    })
}

#[cfg(test)]
mod tests {
    use super::super::certify;
    use super::super::tests::{assert_identity, assert_threads_agree};
    use super::*;
    use crate::UNWATCHED;
    use std::f64::consts::TAU;

    const LATTICE: Lattice = Lattice { origin: [-8.0, -6.0], spacing: [0.25, 0.25], nodes: [65, 49] };

    fn ripple(lattice: &Lattice, amplitude: f64, wavelength: f64, phase_deg: f64, center: [f64; 2]) -> Positions {
        super::ripple(lattice, amplitude, wavelength, phase_deg, center, UNWATCHED).expect("nobody stops it")
    }

    #[test]
    fn identity_is_exact() {
        assert_identity(|lattice| ripple(lattice, 0.0, 3.3, 20.0, lattice.center()));
    }

    #[test]
    fn nodes_move_along_their_radius() {
        let center = [0.6, -1.3];
        let warped = ripple(&LATTICE, 0.7, 5.0, 30.0, center);
        for (i, (x, y)) in warped.x.iter().zip(&warped.y).enumerate() {
            let [rx, ry] = LATTICE.rest(i % 65, i / 65);
            let d = (rx - center[0]).hypot(ry - center[1]);
            let expected = d + 0.7 * (TAU * d / 5.0 + 30f64.to_radians()).sin() * d / d.hypot(1.25);
            let along = ((x - center[0]) * (rx - center[0]) + (y - center[1]) * (ry - center[1])) / d;
            assert!((along - expected).abs() < 1e-12, "node {i} at {along}, not {expected}");
        }
        assert_eq!(ripple(&LATTICE, 3.0, 5.0, 90.0, [0.0, 0.0]).x[24 * 65 + 32], 0.0, "the centre stays");
    }

    #[test]
    fn gentle_ripples_do_not_fold() {
        for wavelength in [1.5, 4.0, 30.0] {
            for phase in [0.0, 77.0, 200.0] {
                for sign in [-1.0, 1.0] {
                    let warped =
                        ripple(&LATTICE, sign * 0.99 * wavelength / (TAU + 4.0), wavelength, phase, [0.1, 0.2]);
                    assert_eq!(certify(&LATTICE, &warped, UNWATCHED).expect("nobody stops it").folds, 0);
                }
            }
        }
        let steep = ripple(&LATTICE, 2.0, 4.0, 0.0, [0.1, 0.2]);
        assert!(certify(&LATTICE, &steep, UNWATCHED).expect("nobody stops it").folds > 0);
    }

    #[test]
    fn threads_do_not_change_it() {
        assert_threads_agree(|| ripple(&LATTICE, 0.7, 5.0, 30.0, [0.3, 0.1]));
    }
}
