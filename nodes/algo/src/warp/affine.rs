//! Affine warps.

use super::sin_cos_deg;
use crate::lattice::{Lattice, Positions};
use crate::{Interrupted, Watch};

/// Parameters of an affine map; the default is the identity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// Translation along x and y, px.
    pub translate: [f64; 2],
    /// Rotation in degrees, positive clockwise on screen.
    pub rotate_deg: f64,
    /// Factors along x and y; 1 changes nothing, negative ones mirror.
    pub scale: [f64; 2],
    /// Shear: x' = x + `shear[0]` y and y' = y + `shear[1]` x.
    pub shear: [f64; 2],
    /// The point that scale, shear and rotation leave in place, px.
    pub center: [f64; 2],
}

impl Default for Affine {
    fn default() -> Self {
        Self { translate: [0.0; 2], rotate_deg: 0.0, scale: [1.0; 2], shear: [0.0; 2], center: [0.0; 2] }
    }
}

/// Moves the lattice by an affine map: scale, then shear, then rotation about a centre, then translation.
///
/// p' = center + R H S (p - center) + translate, with
///
/// ```text
/// R = | cos a  -sin a |    H = | 1         shear[0] |    S = | scale[0]  0        |
///     | sin a   cos a |        | shear[1]  1        |        | 0         scale[1] |
/// ```
///
/// * `lattice`: the nodes to move.
/// * `parameters`: any finite numbers; see [`Affine`] for their units.
///
/// Rotations by multiples of 90 degrees are exact. A singular product (a scale of 0, or `shear[0] * shear[1]` = 1)
/// collapses the lattice onto a line or a point; [`super::certify`] reports it.
///
/// Cost: linear in the nodes, rows side by side. Stops when `watch` says so.
pub fn affine(lattice: &Lattice, parameters: &Affine, watch: Watch) -> Result<Positions, Interrupted> {
    let Affine { translate, rotate_deg, scale: [sx, sy], shear: [hx, hy], center } = *parameters;
    let (sin, cos) = sin_cos_deg(rotate_deg);
    let linear = [[(cos - sin * hy) * sx, (cos * hx - sin) * sy], [(sin + cos * hy) * sx, (sin * hx + cos) * sy]];
    Positions::mapped(lattice, watch, |[x, y]| {
        let [dx, dy] = [x - center[0], y - center[1]];
        [
            x + ((linear[0][0] - 1.0) * dx + linear[0][1] * dy + translate[0]),
            y + (linear[1][0] * dx + (linear[1][1] - 1.0) * dy + translate[1]),
        ]
    })
}

/// Stretches the lattice along x and y about a centre.
///
/// p' = center + factor (p - center), each axis by itself.
///
/// * `lattice`: the nodes to move.
/// * `factor`: along x and y, any finite numbers; 1 changes nothing, negative ones mirror.
/// * `center`: the point that stays, px.
///
/// A factor of 0 collapses the lattice onto a line; [`super::certify`] reports it.
///
/// Cost: linear in the nodes, rows side by side. Stops when `watch` says so.
pub fn stretch(lattice: &Lattice, factor: [f64; 2], center: [f64; 2], watch: Watch) -> Result<Positions, Interrupted> {
    affine(lattice, &Affine { scale: factor, center, ..Affine::default() }, watch)
}

#[cfg(test)]
mod tests {
    use super::super::certify;
    use super::super::tests::{assert_identity, fractional_lattices};
    use super::*;
    use crate::UNWATCHED;

    fn stretch(lattice: &Lattice, factor: [f64; 2], center: [f64; 2]) -> Positions {
        super::stretch(lattice, factor, center, UNWATCHED).expect("nobody stops it")
    }

    fn affine(lattice: &Lattice, parameters: &Affine) -> Positions {
        super::affine(lattice, parameters, UNWATCHED).expect("nobody stops it")
    }

    const UNIT: Lattice = Lattice { origin: [10.0, 20.0], spacing: [1.0, 1.0], nodes: [2, 2] };

    #[test]
    fn identity_is_exact() {
        assert_identity(|lattice| affine(lattice, &Affine { center: [3.1, -77.7], ..Affine::default() }));
        assert_identity(|lattice| affine(lattice, &Affine { rotate_deg: -720.0, ..Affine::default() }));
        assert_identity(|lattice| stretch(lattice, [1.0; 2], lattice.center()));
    }

    #[test]
    fn steps_come_in_order() {
        let parameters = Affine {
            translate: [100.0, 200.0],
            rotate_deg: 90.0,
            scale: [2.0, 3.0],
            shear: [1.0, 0.5],
            center: [10.0, 20.0],
        };
        let warped = affine(&UNIT, &parameters);
        // (1, 1) scales to (2, 3), shears to (5, 4), turns to (-4, 5); the centre only translates.
        assert_eq!((warped.x[0], warped.y[0]), (110.0, 220.0));
        assert_eq!((warped.x[3], warped.y[3]), (106.0, 225.0));
        // (1, 0) scales to (2, 0), shears to (2, 1), turns to (-1, 2).
        assert_eq!((warped.x[1], warped.y[1]), (109.0, 222.0));
    }

    #[test]
    fn positive_rotation_is_clockwise_on_screen() {
        let warped = affine(&UNIT, &Affine { rotate_deg: 30.0, center: UNIT.origin, ..Affine::default() });
        assert!((warped.x[1] - (10.0 + 0.75f64.sqrt())).abs() < 1e-14);
        assert!((warped.y[1] - 20.5).abs() < 1e-14, "what lay to the right turns downwards");
    }

    #[test]
    fn stretch_keeps_its_center() {
        let warped = stretch(&UNIT, [3.0, -2.0], [10.5, 21.0]);
        assert_eq!(warped.x, [9.0, 12.0, 9.0, 12.0]);
        assert_eq!(warped.y, [23.0, 23.0, 21.0, 21.0]);
    }

    #[test]
    fn jacobian_is_the_determinant_of_the_product() {
        for lattice in fractional_lattices() {
            let parameters = Affine { rotate_deg: 71.0, scale: [1.5, 0.8], shear: [0.3, -0.6], ..Affine::default() };
            let expected = 1.5 * 0.8 * (1.0 + 0.3 * 0.6);
            let found =
                certify(&lattice, &affine(&lattice, &parameters), UNWATCHED).expect("nobody stops it").min_jacobian;
            assert!((found - expected).abs() < 1e-7, "{found} is not {expected}");
        }
    }
}
