//! Envelopes with Bezier curves for edges.

use crate::lattice::{Lattice, Positions};
use crate::{Interrupted, Watch};

/// How far the control points of an envelope's four edges are moved, px; the default is the identity.
///
/// At rest each edge has its control points at its ends and thirds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Envelope {
    /// Upper left, upper right, lower right and lower left corner.
    pub corners: [[f64; 2]; 4],
    /// The inner points of the upper edge, from left to right.
    pub top: [[f64; 2]; 2],
    /// The inner points of the right edge, from top to bottom.
    pub right: [[f64; 2]; 2],
    /// The inner points of the lower edge, from left to right.
    pub bottom: [[f64; 2]; 2],
    /// The inner points of the left edge, from top to bottom.
    pub left: [[f64; 2]; 2],
}

/// Bends the lattice into an envelope: the Coons patch over four cubic Bezier curves.
///
/// With s and t from 0 to 1 across and down the lattice, and T(s), B(s), L(t), R(t) the Bezier curves over the moves
/// of the upper, lower, left and right edge's control points, p moves by
///
/// ```text
/// (1 - t) T(s) + t B(s) + (1 - s) L(t) + s R(t)
///   - (1 - s) (1 - t) d00 - s (1 - t) d10 - s t d11 - (1 - s) t d01
/// ```
///
/// d00 .. d01 being the corners' moves. The patch over moves is the patch over positions, as that leaves the
/// rectangle at rest in place.
///
/// * `lattice`: the nodes to move.
/// * `envelope`: any finite numbers, see [`Envelope`].
///
/// The patch may fold, also where its edges do not cross; [`super::certify`] reports it.
///
/// Cost: linear in the nodes, rows side by side. Stops when `watch` says so.
///
/// S. A. Coons, "Surfaces for Computer-Aided Design of Space Forms", MIT MAC-TR-41, 1967 (the bilinearly blended
/// patch).
pub fn envelope(lattice: &Lattice, envelope: &Envelope, watch: Watch) -> Result<Positions, Interrupted> {
    let size = lattice.size();
    let [d00, d10, d11, d01] = envelope.corners;
    let curve =
        |from: [f64; 2], [a, b]: [[f64; 2]; 2], to: [f64; 2], axis: usize| [from[axis], a[axis], b[axis], to[axis]];
    let edges = [0, 1].map(|axis| {
        [
            curve(d00, envelope.top, d10, axis),
            curve(d01, envelope.bottom, d11, axis),
            curve(d00, envelope.left, d01, axis),
            curve(d10, envelope.right, d11, axis),
        ]
    });
    Positions::mapped(lattice, watch, |[x, y]| {
        let [s, t] = [(x - lattice.origin[0]) / size[0], (y - lattice.origin[1]) / size[1]];
        let [dx, dy] = edges.map(|[top, bottom, left, right]| {
            let across = mix(t, bezier(top, s), bezier(bottom, s));
            let down = mix(s, bezier(left, t), bezier(right, t));
            across + down - mix(t, mix(s, top[0], top[3]), mix(s, bottom[0], bottom[3]))
        });
        [x + dx, y + dy]
    })
}

fn mix(t: f64, from: f64, to: f64) -> f64 {
    (1.0 - t) * from + t * to
}

/// The cubic with these control values at t.
fn bezier([a, b, c, d]: [f64; 4], t: f64) -> f64 {
    let r = 1.0 - t;
    r * r * r * a + 3.0 * r * r * t * b + 3.0 * r * t * t * c + t * t * t * d
}

#[cfg(test)]
mod tests {
    use super::super::tests::{assert_identity, assert_threads_agree};
    use super::*;
    use crate::UNWATCHED;

    const LATTICE: Lattice = Lattice { origin: [10.0, 20.0], spacing: [5.0, 4.0], nodes: [21, 16] };
    const BENT: Envelope = Envelope {
        corners: [[1.0, 2.0], [-3.0, 4.0], [5.0, -6.0], [-7.0, -8.0]],
        top: [[0.0, -20.0], [10.0, 15.0]],
        right: [[9.0, 3.0], [-9.0, 1.0]],
        bottom: [[-2.0, 12.0], [3.0, 7.0]],
        left: [[-11.0, 0.5], [6.0, -0.5]],
    };

    fn envelope(lattice: &Lattice, parameters: &Envelope) -> Positions {
        super::envelope(lattice, parameters, UNWATCHED).expect("nobody stops it")
    }

    /// The Bezier curve by repeated halving of the way, over positions.
    fn de_casteljau(mut points: Vec<[f64; 2]>, t: f64) -> [f64; 2] {
        while points.len() > 1 {
            points = points.windows(2).map(|p| [0, 1].map(|i| p[0][i] + t * (p[1][i] - p[0][i]))).collect();
        }
        points[0]
    }

    #[test]
    fn identity_is_exact() {
        assert_identity(|lattice| envelope(lattice, &Envelope::default()));
    }

    #[test]
    fn edges_are_the_given_curves() {
        let warped = envelope(&LATTICE, &BENT);
        let plus = |[x, y]: [f64; 2], [dx, dy]: [f64; 2]| [x + dx, y + dy];
        let [thirds_x, thirds_y] = [[10.0 + 100.0 / 3.0, 10.0 + 200.0 / 3.0], [40.0, 60.0]];
        let corners = [[10.0, 20.0], [110.0, 20.0], [110.0, 80.0], [10.0, 80.0]];
        let c = [0, 1, 2, 3].map(|i| plus(corners[i], BENT.corners[i]));
        let lying =
            |from, y, [a, b]: [[f64; 2]; 2], to| vec![from, plus([thirds_x[0], y], a), plus([thirds_x[1], y], b), to];
        let standing =
            |from, x, [a, b]: [[f64; 2]; 2], to| vec![from, plus([x, thirds_y[0]], a), plus([x, thirds_y[1]], b), to];
        let (top, bottom) = (lying(c[0], 20.0, BENT.top, c[1]), lying(c[3], 80.0, BENT.bottom, c[2]));
        let (left, right) = (standing(c[0], 10.0, BENT.left, c[3]), standing(c[1], 110.0, BENT.right, c[2]));
        let near = |node: usize, expected: [f64; 2]| {
            let (dx, dy) = (warped.x[node] - expected[0], warped.y[node] - expected[1]);
            assert!(dx.abs() < 1e-12 && dy.abs() < 1e-12, "node {node} is {dx} {dy} off");
        };
        for column in 0..21 {
            near(column, de_casteljau(top.clone(), column as f64 / 20.0));
            near(15 * 21 + column, de_casteljau(bottom.clone(), column as f64 / 20.0));
        }
        for row in 0..16 {
            near(row * 21, de_casteljau(left.clone(), row as f64 / 15.0));
            near(row * 21 + 20, de_casteljau(right.clone(), row as f64 / 15.0));
        }
    }

    #[test]
    fn moves_of_corners_and_thirds_along_lines_are_bilinear() {
        let corners = [[1.0, 2.0], [-3.0, 4.0], [5.0, -6.0], [-7.0, -8.0]];
        let thirds = |a: [f64; 2], b: [f64; 2]| [1.0, 2.0].map(|i| [0, 1].map(|k| a[k] + i * (b[k] - a[k]) / 3.0));
        let [a, b, c, d] = corners;
        let straight =
            Envelope { corners, top: thirds(a, b), right: thirds(b, c), bottom: thirds(d, c), left: thirds(a, d) };
        let warped = envelope(&LATTICE, &straight);
        for i in 0..LATTICE.node_count() {
            let (s, t) = ((i % 21) as f64 / 20.0, (i / 21) as f64 / 15.0);
            let [x, y] = LATTICE.rest(i % 21, i / 21);
            let [dx, dy] = [0, 1].map(|k| mix(t, mix(s, a[k], b[k]), mix(s, d[k], c[k])));
            assert!((warped.x[i] - x - dx).abs() < 1e-12 && (warped.y[i] - y - dy).abs() < 1e-12);
        }
    }

    #[test]
    fn threads_do_not_change_it() {
        assert_threads_agree(|| envelope(&LATTICE, &BENT));
    }
}
