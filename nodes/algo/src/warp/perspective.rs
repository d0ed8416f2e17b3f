//! Pinning four corners.

use crate::lattice::{Lattice, Positions};
use crate::{Interrupted, Watch};

/// Why four corners give no perspective of a lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PerspectiveError {
    /// Told to stop.
    Interrupted,
    /// A corner and its two neighbours go to one line.
    Degenerate {
        /// Number of that corner, in the order of the moves.
        corner: usize,
    },
    /// The corners go out of reach of double precision.
    Overflow,
    /// The horizon runs through the rectangle or the lattice, there; what lies on it would go infinitely far.
    Horizon {
        /// Where, px.
        at: [f64; 2],
    },
    /// The whole lattice lies beyond the horizon.
    Beyond,
}

impl From<Interrupted> for PerspectiveError {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

/// Moves the lattice by the homography that moves the corners of a rectangle by given amounts.
///
/// With s and t from 0 to 1 across and down the rectangle, d00, d10, d11 and d01 the moves of its corners from the
/// upper left one on, clockwise, W and H its sides, and q00 .. q01 where the corners go:
///
/// ```text
/// D = d00 - d10 + d11 - d01,  e = q10 - q11,  f = q01 - q11
/// g = (D x f) / (e x f),  h = (e x D) / (e x f)
/// w(s, t) = 1 + g s + h t
/// x' = x + (W g s (1 - s) + sum of B w dx) / w(s, t)
/// y' = y + (H h t (1 - t) + sum of B w dy) / w(s, t)
/// ```
///
/// the sums being over the four corners, each with its own w and its bilinear weight B(s, t).
///
/// * `lattice`: the nodes to move.
/// * `rectangle`: its upper left and lower right corner, px; both sides > 0 (asserted). It may be another than the
///   lattice's.
/// * `moves`: of the upper left, upper right, lower right and lower left corner, px; zeros are the identity.
///
/// Three corners on one line, to within 1e-12 of their distances, are [`PerspectiveError::Degenerate`]. A concave or folded
/// quadrangle, and a convex one with a lattice that reaches beyond the horizon w = 0, are
/// [`PerspectiveError::Horizon`], a lattice all beyond it [`PerspectiveError::Beyond`]. A mirrored quadrangle mirrors
/// the lattice; [`super::certify`] reports it.
///
/// Cost: linear in the nodes, rows side by side. Stops when `watch` says so.
///
/// P. S. Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989, section 2.2.3.
pub fn perspective(
    lattice: &Lattice,
    rectangle: [[f64; 2]; 2],
    moves: [[f64; 2]; 4],
    watch: Watch,
) -> Result<Positions, PerspectiveError> {
    let [low, high] = rectangle;
    let size = [high[0] - low[0], high[1] - low[1]];
    assert!(size.iter().all(|side| *side > 0.0), "a rectangle of {size:?} px");
    let [g, h] = vanishing(size, &moves)?;
    let depth = |[s, t]: [f64; 2]| 1.0 + g * s + h * t;
    let unit = |[x, y]: [f64; 2]| [(x - low[0]) / size[0], (y - low[1]) / size[1]];
    let [width, height] = lattice.size();
    let far = [lattice.origin[0] + width, lattice.origin[1] + height];
    for [low, high] in [rectangle, [lattice.origin, far]] {
        assert_in_front([low, [high[0], low[1]], high, [low[0], high[1]]], |p| depth(unit(p)))?;
    }
    Ok(Positions::mapped(lattice, watch, |[x, y]| {
        let [s, t] = unit([x, y]);
        let weights = [
            (1.0 - s) * (1.0 - t),
            s * (1.0 - t) * depth([1.0, 0.0]),
            s * t * depth([1.0, 1.0]),
            (1.0 - s) * t * depth([0.0, 1.0]),
        ];
        let moved = |axis: usize| (0..4).fold(0.0, |sum, corner| sum + weights[corner] * moves[corner][axis]);
        let w = depth([s, t]);
        [x + (size[0] * g * s * (1.0 - s) + moved(0)) / w, y + (size[1] * h * t * (1.0 - t) + moved(1)) / w]
    })?)
}

/// Distance of a corner from a line, over the longer side there, up to which it lies on the line: corners are rounded.
const STRAIGHT: f64 = 1e-12;

/// g and h.
fn vanishing(size: [f64; 2], moves: &[[f64; 2]; 4]) -> Result<[f64; 2], PerspectiveError> {
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let rest = [[size[0], 0.0], [0.0, size[1]], [-size[0], 0.0], [0.0, -size[1]]];
    // The side that leads from a corner to the next.
    let side = |i: usize| [0, 1].map(|axis| rest[i % 4][axis] + (moves[(i + 1) % 4][axis] - moves[i % 4][axis]));
    let length = |[x, y]: [f64; 2]| (x * x + y * y).sqrt();
    for corner in 0..4 {
        let (before, after) = (side(corner + 3), side(corner));
        let longer = length(before).max(length(after));
        if !(longer * longer).is_finite() {
            return Err(PerspectiveError::Overflow);
        }
        if cross(before, after).abs() <= STRAIGHT * longer * longer {
            return Err(PerspectiveError::Degenerate { corner });
        }
    }
    let sum = [0, 1].map(|axis| moves[0][axis] - moves[1][axis] + moves[2][axis] - moves[3][axis]);
    let (e, f) = (side(1).map(|v| -v), side(2));
    let area = cross(e, f);
    let found = [cross(sum, f) / area, cross(e, sum) / area];
    if found.iter().all(|value| value.is_finite()) { Ok(found) } else { Err(PerspectiveError::Overflow) }
}

/// Refuses a rectangle with a corner where `depth`, affine, is not positive.
fn assert_in_front(corners: [[f64; 2]; 4], depth: impl Fn([f64; 2]) -> f64) -> Result<(), PerspectiveError> {
    let depths = corners.map(&depth);
    let Some(behind) = (0..4).find(|&i| depths[i].is_nan() || depths[i] <= 0.0) else { return Ok(()) };
    // Along an edge if there is one that crosses the horizon, else along the diagonal.
    let in_front = [1, 3, 2].into_iter().map(|step| (behind + step) % 4).find(|&i| depths[i] > 0.0);
    let in_front = in_front.ok_or(PerspectiveError::Beyond)?;
    let t = depths[in_front] / (depths[in_front] - depths[behind]);
    let at = [0, 1].map(|axis| corners[in_front][axis] + t * (corners[behind][axis] - corners[in_front][axis]));
    Err(PerspectiveError::Horizon { at })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{assert_identity, assert_threads_agree};
    use super::*;
    use crate::UNWATCHED;

    const LATTICE: Lattice = Lattice { origin: [10.0, 20.0], spacing: [5.0, 4.0], nodes: [21, 16] };
    const RECTANGLE: [[f64; 2]; 2] = [[10.0, 20.0], [110.0, 80.0]];
    const MOVES: [[f64; 2]; 4] = [[12.0, -3.0], [-30.0, 14.0], [5.0, 9.0], [-7.0, -11.0]];

    fn perspective(lattice: &Lattice, moves: [[f64; 2]; 4]) -> Result<Positions, PerspectiveError> {
        let [w, h] = lattice.size();
        let far = [lattice.origin[0] + w, lattice.origin[1] + h];
        super::perspective(lattice, [lattice.origin, far], moves, UNWATCHED)
    }

    #[test]
    fn identity_is_exact() {
        assert_identity(|lattice| perspective(lattice, [[0.0; 2]; 4]).expect("no horizon"));
    }

    #[test]
    fn corners_go_where_they_are_put() {
        let warped = perspective(&LATTICE, MOVES).expect("convex");
        for (node, corner, rest) in
            [(0, 0, [10.0, 20.0]), (20, 1, [110.0, 20.0]), (335, 2, [110.0, 80.0]), (315, 3, [10.0, 80.0])]
        {
            let expected = [rest[0] + MOVES[corner][0], rest[1] + MOVES[corner][1]];
            assert!((warped.x[node] - expected[0]).abs() < 1e-9 && (warped.y[node] - expected[1]).abs() < 1e-9);
        }
    }

    #[test]
    fn lines_stay_lines_and_cross_ratios_are_kept() {
        let warped = perspective(&LATTICE, MOVES).expect("convex");
        let at = |column: usize, row: usize| [warped.x[row * 21 + column], warped.y[row * 21 + column]];
        let cross =
            |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        for step in [[1, 0], [0, 1], [1, 1], [2, 1]] {
            let points = [0, 1, 3, 7].map(|i| at(i * step[0], i * step[1]));
            assert!(
                cross(points[0], points[1], points[3]).abs() < 1e-8
                    && cross(points[0], points[2], points[3]).abs() < 1e-8
            );
            let gap = |i: usize, j: usize| (points[i][0] - points[j][0]).hypot(points[i][1] - points[j][1]);
            let ratio = gap(0, 2) * gap(1, 3) / (gap(1, 2) * gap(0, 3));
            assert!((ratio - 3.0 * 6.0 / (2.0 * 7.0)).abs() < 1e-9, "cross ratio {ratio} along {step:?}");
        }
    }

    #[test]
    fn another_rectangle_gives_the_same_map() {
        let inner = Lattice { origin: [30.0, 32.0], nodes: [9, 6], ..LATTICE };
        let whole = perspective(&LATTICE, MOVES).expect("convex");
        let part = super::perspective(&inner, RECTANGLE, MOVES, UNWATCHED).expect("convex");
        for (i, (x, y)) in part.x.iter().zip(&part.y).enumerate() {
            let node = (i / 9 + 3) * 21 + i % 9 + 4;
            assert!((x - whole.x[node]).abs() < 1e-10 && (y - whole.y[node]).abs() < 1e-10);
        }
    }

    #[test]
    fn a_horizon_is_refused_where_it_runs() {
        // The lower right corner goes past the opposite diagonal: concave.
        let concave = [[0.0; 2], [0.0; 2], [-80.0, -50.0], [0.0; 2]];
        let Err(PerspectiveError::Horizon { at }) = perspective(&LATTICE, concave) else { panic!("a horizon") };
        assert!((10.0..=110.0).contains(&at[0]) && (20.0..=80.0).contains(&at[1]), "{at:?}");
        // The upper edge at half its width: w is 1 - t / 2.
        let narrow = [[25.0, 0.0], [-25.0, 0.0], [0.0; 2], [0.0; 2]];
        assert!(perspective(&LATTICE, narrow).is_ok());
        let [g, h] = vanishing([100.0, 60.0], &narrow).expect("convex");
        assert_eq!([g, h], [0.0, -0.5]);
        let low = Lattice { nodes: [21, 41], ..LATTICE };
        let refused = super::perspective(&low, RECTANGLE, narrow, UNWATCHED);
        let Err(PerspectiveError::Horizon { at }) = refused else { panic!("a horizon") };
        assert!((at[0] - 110.0).abs() < 1e-12 && (at[1] - 140.0).abs() < 1e-12, "{at:?}");
    }

    #[test]
    fn a_lattice_beyond_the_horizon_is_refused() {
        // w is 1 - t / 2, 0 at y = 140.
        let narrow = [[25.0, 0.0], [-25.0, 0.0], [0.0; 2], [0.0; 2]];
        let beyond = Lattice { origin: [10.0, 150.0], ..LATTICE };
        assert_eq!(super::perspective(&beyond, RECTANGLE, narrow, UNWATCHED), Err(PerspectiveError::Beyond));
        let diagonal = |[x, y]: [f64; 2]| 3.0 - x - y;
        let corners = [[1.0, 1.0], [4.0, 1.0], [4.0, 4.0], [1.0, 4.0]];
        assert_eq!(assert_in_front(corners, diagonal), Err(PerspectiveError::Horizon { at: [2.0, 1.0] }));
        let corners = [corners[2], corners[3], corners[0], corners[1]];
        assert_eq!(assert_in_front(corners, diagonal), Err(PerspectiveError::Horizon { at: [1.5, 1.5] }));
        assert_eq!(assert_in_front(corners, |p| diagonal(p) + 9.0), Ok(()));
    }

    #[test]
    fn three_corners_on_a_line_are_refused_whichever_they_are() {
        let goal = |corners: [[f64; 2]; 4]| {
            let rest = [[10.0, 20.0], [110.0, 20.0], [110.0, 80.0], [10.0, 80.0]];
            let moves = [0, 1, 2, 3].map(|i: usize| [corners[i][0] - rest[i][0], corners[i][1] - rest[i][1]]);
            super::perspective(&LATTICE, RECTANGLE, moves, UNWATCHED)
        };
        // A triangle, and a point of one of its sides; decimals, so that nothing is exactly on a line.
        let corners = [[20.1, 30.3], [90.7, 25.9], [40.3, 78.1]];
        let between = [0.7 * 20.1 + 0.3 * 40.3, 0.7 * 30.3 + 0.3 * 78.1];
        for corner in 0..4 {
            let mut turned = [between, corners[0], corners[1], corners[2]];
            turned.rotate_right(corner);
            assert_eq!(goal(turned), Err(PerspectiveError::Degenerate { corner }), "{turned:?}");
            turned[corner][0] -= 1e-6;
            assert!(goal(turned).is_ok(), "{turned:?}");
        }
        // Two corners in one place.
        assert_eq!(
            goal([corners[0], corners[0], corners[1], corners[2]]),
            Err(PerspectiveError::Degenerate { corner: 0 })
        );
    }

    #[test]
    fn corners_beyond_numbers_are_refused() {
        let huge = [[0.0; 2], [1e300, 0.0], [0.0, -1e300], [0.0; 2]];
        assert_eq!(perspective(&LATTICE, huge), Err(PerspectiveError::Overflow));
    }

    #[test]
    fn threads_do_not_change_it() {
        assert_threads_agree(|| perspective(&LATTICE, MOVES).expect("convex"));
    }
}
