//! Transverse waves.

use super::sin_cos_deg;
use crate::lattice::{Lattice, Positions};
use crate::{Interrupted, Watch};

/// Moves the lattice by a transverse sine wave.
///
/// With d = (cos a, sin a) the direction the wave runs in, n = (-sin a, cos a) its normal and
/// s = (p - origin) . d the distance along it:
///
/// p' = p + amplitude sin(2 pi s / wavelength + phase) n.
///
/// Displacement is a shear, so areas do not change: the Jacobian of the continuous warp is 1 everywhere.
///
/// * `lattice`: the nodes to move; s counts from its origin.
/// * `amplitude`: px, any finite number; 0 is the identity.
/// * `wavelength`: px, > 0 (asserted).
/// * `phase_deg`: degrees.
/// * `direction_deg`: degrees, positive clockwise on screen; 0 runs along +x and displaces along +y.
///
/// Wavelengths below two spacings are sampled too coarsely and alias.
///
/// Cost: linear in the nodes, rows side by side. Stops when `watch` says so.
pub fn wave(
    lattice: &Lattice,
    amplitude: f64,
    wavelength: f64,
    phase_deg: f64,
    direction_deg: f64,
    watch: Watch,
) -> Result<Positions, Interrupted> {
    assert!(wavelength > 0.0, "a wavelength of {wavelength} px is not positive");
    let (sin, cos) = sin_cos_deg(direction_deg);
    Positions::mapped(lattice, watch, |[x, y]| {
        let turns = ((x - lattice.origin[0]) * cos + (y - lattice.origin[1]) * sin) / wavelength;
        let (height, _) = sin_cos_deg(360.0 * (turns % 1.0) + phase_deg);
        [x - amplitude * height * sin, y + amplitude * height * cos]
    })
}

#[cfg(test)]
mod tests {
    use super::super::certify;
    use super::super::tests::assert_identity;
    use super::*;
    use crate::UNWATCHED;

    fn wave(lattice: &Lattice, amplitude: f64, wavelength: f64, phase_deg: f64, direction_deg: f64) -> Positions {
        super::wave(lattice, amplitude, wavelength, phase_deg, direction_deg, UNWATCHED).expect("nobody stops it")
    }

    const LATTICE: Lattice = Lattice { origin: [5.0, 7.0], spacing: [1.0, 2.0], nodes: [9, 3] };

    #[test]
    fn identity_is_exact() {
        assert_identity(|lattice| wave(lattice, 0.0, 3.3, 20.0, 33.0));
        assert_identity(|lattice| wave(lattice, 0.0, 1e-3, 0.0, 180.0));
    }

    #[test]
    fn quarter_waves_are_exact() {
        let along_x = wave(&LATTICE, 3.0, 4.0, 0.0, 0.0);
        assert_eq!(along_x.x, Positions::from_map(&LATTICE, |p| p).x);
        assert_eq!(along_x.y[..9], [7.0, 10.0, 7.0, 4.0, 7.0, 10.0, 7.0, 4.0, 7.0]);
        assert_eq!(along_x.y[9..12], [9.0, 12.0, 9.0]);
        // Running downwards, its normal points to the left.
        let along_y = wave(&LATTICE, 3.0, 8.0, 0.0, 90.0);
        assert_eq!(along_y.y, Positions::from_map(&LATTICE, |p| p).y);
        assert_eq!([along_y.x[0], along_y.x[9], along_y.x[18]], [5.0, 2.0, 5.0]);
    }

    #[test]
    fn phase_shifts_the_wave() {
        let shifted = wave(&LATTICE, 1.5, 5.0, 360.0 / 5.0, 0.0);
        let plain = wave(&LATTICE, 1.5, 5.0, 0.0, 0.0);
        for i in 0..8 {
            assert!((shifted.y[i] - plain.y[i + 1]).abs() < 1e-12, "a fifth of a turn is a fifth of a wave");
        }
    }

    #[test]
    fn opposite_directions_are_the_same_wave() {
        // Turning d by 180 degrees negates both s and n.
        let (one, other) = (wave(&LATTICE, 2.0, 3.7, 0.0, 25.0), wave(&LATTICE, 2.0, 3.7, 0.0, 205.0));
        for i in 0..LATTICE.node_count() {
            assert!((one.x[i] - other.x[i]).abs() < 1e-12 && (one.y[i] - other.y[i]).abs() < 1e-12);
        }
        let rest = Positions::from_map(&LATTICE, |p| p);
        let n = [-25f64.to_radians().sin(), 25f64.to_radians().cos()];
        for i in 0..LATTICE.node_count() {
            let [dx, dy] = [one.x[i] - rest.x[i], one.y[i] - rest.y[i]];
            assert!((dx * n[1] - dy * n[0]).abs() < 1e-12, "node {i} leaves its normal");
            assert!(dx.hypot(dy) <= 2.0 + 1e-12);
        }
    }

    #[test]
    fn areas_are_kept() {
        let lattice = Lattice { origin: [0.0; 2], spacing: [0.1, 0.1], nodes: [60, 50] };
        let certificate = certify(&lattice, &wave(&lattice, 1.0, 6.0, 10.0, 0.0), UNWATCHED).expect("nobody stops it");
        assert!((certificate.min_jacobian - 1.0).abs() < 1e-9, "{certificate:?}");
    }
}
