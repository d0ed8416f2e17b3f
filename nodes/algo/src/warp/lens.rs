//! Radial lens distortion.

use crate::lattice::{Lattice, Positions};
use crate::{Interrupted, Watch};

/// Distorts the lattice as a lens does, along the radii about its optical centre.
///
/// With r the distance of p from the centre over `radius`:
///
/// p' = center + (1 + k1 r^2 + k2 r^4 + k3 r^6) (p - center).
///
/// It gives the distorted position of each undistorted one; its inverse takes a lens's distortion away.
///
/// * `lattice`: the nodes to move.
/// * `k`: k1, k2 and k3, plain numbers, finite; positive ones push outwards (pincushion), negative ones pull inwards
///   (barrel), zeros are the identity.
/// * `radius`: the distance whose r is 1, px, > 0 (asserted); half the picture's diagonal is usual.
/// * `center`: px; it may lie outside the lattice.
///
/// The continuous warp does not fold where 1 + 3 k1 r^2 + 5 k2 r^4 + 7 k3 r^6 and 1 + k1 r^2 + k2 r^4 + k3 r^6 are
/// positive.
///
/// Cost: linear in the nodes, rows side by side. Stops when `watch` says so.
///
/// D. C. Brown, "Close-Range Camera Calibration", Photogrammetric Engineering 37, 1971 (the radial terms).
pub fn lens(
    lattice: &Lattice,
    k: [f64; 3],
    radius: f64,
    center: [f64; 2],
    watch: Watch,
) -> Result<Positions, Interrupted> {
    assert!(radius > 0.0, "a lens's radius of {radius} px is not positive");
    Positions::mapped(lattice, watch, |[x, y]| {
        let [dx, dy] = [x - center[0], y - center[1]];
        let [ux, uy] = [dx / radius, dy / radius];
        let square = ux * ux + uy * uy;
        let growth = square * (k[0] + square * (k[1] + square * k[2]));
        [x + growth * dx, y + growth * dy]
    })
}

/// Half the diagonal of the lattice's rectangle, px.
pub fn half_diagonal(lattice: &Lattice) -> f64 {
    let [width, height] = lattice.size();
    0.5 * libm::hypot(width, height)
}

#[cfg(test)]
mod tests {
    use super::super::certify;
    use super::super::tests::{assert_identity, assert_threads_agree};
    use super::*;
    use crate::UNWATCHED;

    const LATTICE: Lattice = Lattice { origin: [-4.0, -3.0], spacing: [0.25, 0.25], nodes: [33, 25] };

    fn lens(lattice: &Lattice, k: [f64; 3], radius: f64, center: [f64; 2]) -> Positions {
        super::lens(lattice, k, radius, center, UNWATCHED).expect("nobody stops it")
    }

    #[test]
    fn identity_is_exact() {
        assert_identity(|lattice| lens(lattice, [0.0; 3], 7.7, lattice.center()));
    }

    #[test]
    fn corners_move_by_the_polynomial() {
        // The corner (-4, -3) is 5 px from the middle: r is 1, then 2.
        let one = lens(&LATTICE, [0.1, 0.02, 0.003], 5.0, [0.0, 0.0]);
        assert!((one.x[0] + 4.0 * 1.123).abs() < 1e-14 && (one.y[0] + 3.0 * 1.123).abs() < 1e-14);
        let two = lens(&LATTICE, [0.1, 0.02, 0.003], 2.5, [0.0, 0.0]);
        assert!((two.x[0] + 4.0 * (1.0 + 0.4 + 0.32 + 0.192)).abs() < 1e-14);
    }

    #[test]
    fn it_folds_where_the_radial_derivative_vanishes() {
        // 1 - 3 k r^2 at the corners, where r is 1.
        for (k, folds) in [(-0.30, false), (-0.36, true)] {
            let warped = lens(&LATTICE, [k, 0.0, 0.0], 5.0, [0.0, 0.0]);
            assert_eq!(certify(&LATTICE, &warped, UNWATCHED).expect("nobody stops it").folds > 0, folds, "k1 = {k}");
        }
    }

    #[test]
    fn threads_do_not_change_it() {
        assert_threads_agree(|| lens(&LATTICE, [0.1, -0.2, 0.3], 5.0, [0.3, 0.1]));
    }
}
