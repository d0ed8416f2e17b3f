//! Rotation that fades with the distance from its centre.

use crate::lattice::{Lattice, Positions};
use crate::{Interrupted, Watch};

/// Swirls the lattice about a centre.
///
/// With d the distance of p from the centre and u = d / radius, p turns about the centre by
/// angle (1 - u^2)^2 where u < 1 and stays where it is elsewhere. The falloff is 1 with slope 0 at the centre and
/// 0 with slope 0 at the radius, so the warp is C1. Distances from the centre do not change, so neither do areas:
/// the Jacobian of the continuous warp is 1 everywhere.
///
/// * `lattice`: the nodes to move.
/// * `angle_deg`: the turn at the centre, degrees, any finite number, positive clockwise on screen.
/// * `radius`: px, > 0 (asserted).
/// * `center`: px; it may lie outside the lattice.
///
/// The cells between the nodes are straight-edged: many turns on a coarse lattice fold;
/// [`super::certify`] reports it.
///
/// Cost: linear in the nodes, rows side by side. Stops when `watch` says so.
pub fn swirl(
    lattice: &Lattice,
    angle_deg: f64,
    radius: f64,
    center: [f64; 2],
    watch: Watch,
) -> Result<Positions, Interrupted> {
    assert!(radius > 0.0, "a swirl's radius of {radius} px is not positive");
    let angle = angle_deg.to_radians();
    Positions::mapped(lattice, watch, |[x, y]| {
        let [dx, dy] = [x - center[0], y - center[1]];
        let [ux, uy] = [dx / radius, dy / radius];
        let falloff = (1.0 - (ux * ux + uy * uy)).max(0.0);
        let (sin_half, cos_half) = libm::sincos(0.5 * angle * falloff * falloff);
        // R - I by half angles: cos a - 1 = -2 sin^2(a / 2), sin a = 2 sin(a / 2) cos(a / 2).
        let (sin, cos_less_one) = (2.0 * sin_half * cos_half, -2.0 * sin_half * sin_half);
        [x + (cos_less_one * dx - sin * dy), y + (sin * dx + cos_less_one * dy)]
    })
}

#[cfg(test)]
mod tests {
    use super::super::certify;
    use super::super::tests::assert_identity;
    use super::*;
    use crate::UNWATCHED;

    fn swirl(lattice: &Lattice, angle_deg: f64, radius: f64, center: [f64; 2]) -> Positions {
        super::swirl(lattice, angle_deg, radius, center, UNWATCHED).expect("nobody stops it")
    }

    const LATTICE: Lattice = Lattice { origin: [-8.0, -8.0], spacing: [0.25, 0.25], nodes: [65, 65] };

    #[test]
    fn identity_is_exact() {
        assert_identity(|lattice| swirl(lattice, 0.0, 5.0, lattice.center()));
        // Out of reach, any angle is the identity.
        assert_identity(|lattice| swirl(lattice, 300.0, 20.0, [-1e3, -1e3]));
    }

    #[test]
    fn each_node_turns_by_the_falloff() {
        let center = [0.6, -1.3];
        let warped = swirl(&LATTICE, 80.0, 6.0, center);
        for (i, (x, y)) in warped.x.iter().zip(&warped.y).enumerate() {
            let [rx, ry] = LATTICE.rest(i % 65, i / 65);
            let ([ax, ay], [bx, by]) = ([rx - center[0], ry - center[1]], [x - center[0], y - center[1]]);
            let distance = ax.hypot(ay);
            assert!((bx.hypot(by) - distance).abs() < 1e-13, "node {i} keeps its distance");
            let u = (distance / 6.0).min(1.0);
            let turn = (ax * by - ay * bx).atan2(ax * bx + ay * by).to_degrees();
            assert!((turn - 80.0 * (1.0 - u * u).powi(2)).abs() < 1e-9, "node {i} turned by {turn} degrees");
            assert!(u < 1.0 || [*x, *y] == [rx, ry], "node {i} is out of reach");
        }
    }

    #[test]
    fn positive_angles_turn_clockwise_on_screen() {
        let lattice = Lattice { origin: [0.0, 0.0], spacing: [1.0, 1.0], nodes: [2, 2] };
        let warped = swirl(&lattice, 90.0, 1e6, [0.0, 0.0]);
        assert!(warped.x[1].abs() < 1e-9 && (warped.y[1] - 1.0).abs() < 1e-9, "right turns down");
        assert!((warped.x[2] + 1.0).abs() < 1e-9 && warped.y[2].abs() < 1e-9, "down turns left");
    }

    #[test]
    fn the_rim_is_smooth() {
        // Displacement just inside the radius falls with the square of the distance from it.
        let displacement = |inside: f64| {
            let lattice = Lattice { origin: [4.0 - inside, 0.0], spacing: [1.0, 1.0], nodes: [2, 2] };
            let warped = swirl(&lattice, 90.0, 4.0, [0.0, 0.0]);
            (warped.x[0] - lattice.origin[0]).hypot(warped.y[0])
        };
        let ratio = displacement(1e-2) / displacement(1e-3);
        assert!((95.0..105.0).contains(&ratio), "ten times nearer moves {ratio} times less");
    }

    #[test]
    fn areas_are_kept() {
        let certificate =
            certify(&LATTICE, &swirl(&LATTICE, 60.0, 7.0, [0.1, 0.2]), UNWATCHED).expect("nobody stops it");
        assert!((certificate.min_jacobian - 1.0).abs() < 0.1, "{certificate:?}");
        assert_eq!(certificate.folds, 0);
    }
}
