//! Bending onto a circle.

use crate::lattice::{Lattice, Positions};
use crate::{Interrupted, Watch};

/// Bends the lattice onto an arc of a circle, as type is set on an arc: the lower edge is the baseline.
///
/// With W the lattice's width, cx its middle, y1 its lower edge, th the angle in radians, t = th (x - cx) / W and
/// h = y1 - y the height over the baseline:
///
/// ```text
/// x' = cx + (x - cx) sin(t) / t       + h sin(t)
/// y' = y1 + (x - cx) (1 - cos(t)) / t - h cos(t)
/// ```
///
/// that is, the point at radius W / th + h and angle t of the circle around (cx, y1 + W / th).
///
/// * `lattice`: the nodes to move.
/// * `angle_deg`: the angle that the width comes to span, degrees. Positive arches upwards (the circle's centre
///   lies below), negative downwards; 0 is the identity; beyond 360 either way the arc runs over itself.
///
/// The baseline keeps its length at every angle. Negative angles fold what lies higher than the radius,
/// h > W / |th|; [`super::certify`] reports it.
///
/// Cost: linear in the nodes, rows side by side. Stops when `watch` says so.
pub fn arc(lattice: &Lattice, angle_deg: f64, watch: Watch) -> Result<Positions, Interrupted> {
    let [width, height] = lattice.size();
    let middle = lattice.center()[0];
    let baseline = lattice.origin[1] + height;
    let curvature = angle_deg.to_radians() / width;
    Positions::mapped(lattice, watch, |[x, y]| {
        let (along, up) = (x - middle, baseline - y);
        let t = along * curvature;
        let sin_half = libm::sin(0.5 * t);
        [
            x + (along * (sinc(t) - 1.0) + up * libm::sin(t)),
            y + (along * sin_half * sinc(0.5 * t) + up * 2.0 * sin_half * sin_half),
        ]
    })
}

/// sin(t) / t, by its series near 0.
fn sinc(t: f64) -> f64 {
    let square = t * t;
    // The first term left out, t^6 / 5040, is below rounding here.
    if square < 1e-5 { 1.0 - square / 6.0 * (1.0 - square / 20.0) } else { libm::sin(t) / t }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{assert_identity, fractional_lattices};
    use super::*;
    use crate::UNWATCHED;

    fn arc(lattice: &Lattice, angle_deg: f64) -> Positions {
        super::arc(lattice, angle_deg, UNWATCHED).expect("nobody stops it")
    }

    const LATTICE: Lattice = Lattice { origin: [-3.7, 12.3], spacing: [2.5, 1.1], nodes: [41, 11] };

    /// Middle and lower edge of `LATTICE`.
    fn foot() -> [f64; 2] {
        [LATTICE.center()[0], LATTICE.origin[1] + LATTICE.size()[1]]
    }

    #[test]
    fn identity_is_exact() {
        assert_identity(|lattice| arc(lattice, 0.0));
    }

    #[test]
    fn nodes_lie_on_circles_at_even_angles() {
        let [cx, y1] = foot();
        for degrees in [-200.0, -45.0, -1.0, 0.5, 60.0, 180.0, 359.0f64] {
            let radius = LATTICE.size()[0] / degrees.to_radians();
            let warped = arc(&LATTICE, degrees);
            for (i, (x, y)) in warped.x.iter().zip(&warped.y).enumerate() {
                let [rest_x, rest_y] = LATTICE.rest(i % LATTICE.nodes[0], i / LATTICE.nodes[0]);
                let (r, t) = (radius + y1 - rest_y, (rest_x - cx) / radius);
                assert!((x - (cx + r * t.sin())).abs() < 1e-9 * radius.abs(), "x of node {i} at {degrees} degrees");
                assert!((y - (y1 + radius - r * t.cos())).abs() < 1e-9 * radius.abs(), "y of node {i}");
            }
        }
    }

    #[test]
    fn baseline_keeps_its_length() {
        let lattice = Lattice { nodes: [4001, 2], spacing: [0.01, 1.0], ..LATTICE };
        for degrees in [-300.0, -10.0, 90.0, 360.0] {
            let warped = arc(&lattice, degrees);
            let length: f64 =
                (4001..8001).map(|i| (warped.x[i + 1] - warped.x[i]).hypot(warped.y[i + 1] - warped.y[i])).sum();
            assert!((length - 40.0).abs() < 1e-4, "{length} px long at {degrees} degrees");
        }
    }

    #[test]
    fn positive_angles_arch_upwards() {
        let last_row = LATTICE.nodes[0] * (LATTICE.nodes[1] - 1);
        for degrees in [10.0, 120.0] {
            let (up, down) = (arc(&LATTICE, degrees), arc(&LATTICE, -degrees));
            let (left, middle, right) = (last_row, last_row + 20, last_row + 40);
            assert!(up.y[left] > up.y[middle] + 1.0 && up.y[right] > up.y[middle] + 1.0);
            assert!(up.x[40] > up.x[right], "the upper edge fans out");
            // On the baseline the opposite angle is the mirror image.
            let [_, y1] = foot();
            for i in last_row..LATTICE.node_count() {
                assert!((up.y[i] - y1 + (down.y[i] - y1)).abs() < 1e-12 && (up.x[i] - down.x[i]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn series_joins_the_quotient() {
        for t in [3.1e-3, 3.16e-3, 3.17e-3, 1e-2f64] {
            assert!((sinc(t) - t.sin() / t).abs() < 3e-16, "sinc({t})");
            assert_eq!(sinc(t), sinc(-t));
        }
        assert_eq!(sinc(0.0), 1.0);
    }

    #[test]
    fn small_angles_bend_little() {
        for lattice in fractional_lattices() {
            let warped = arc(&lattice, 1e-9);
            let rest = Positions::from_map(&lattice, |p| p);
            let reach = 1e-10 * (lattice.size()[0] + lattice.size()[1]);
            assert!(warped.x.iter().zip(&rest.x).all(|(a, b)| (a - b).abs() < reach));
            assert!(warped.y.iter().zip(&rest.y).all(|(a, b)| (a - b).abs() < reach));
        }
    }
}
