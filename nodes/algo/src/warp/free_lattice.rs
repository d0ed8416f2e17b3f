//! Free-form deformation by a lattice of control points.

use crate::lattice::{Lattice, Positions};
use crate::{Interrupted, Watch};

/// Deforms the lattice smoothly with a few control points: the uniform cubic B-spline over their moves.
///
/// Control point (i, j) of `count[0]` x `count[1]` rests at `i / (count[0] - 1)` of the width and `j / (count[1] - 1)`
/// of the height. With s = (x - origin) / control spacing, i its whole part (at most count - 2), f its fraction, and
/// the uniform cubic B-spline weights
///
/// ```text
/// B0 = (1 - f)^3 / 6,  B1 = (3 f^3 - 6 f^2 + 4) / 6,  B2 = (-3 f^3 + 3 f^2 + 3 f + 1) / 6,  B3 = f^3 / 6
/// ```
///
/// p moves by the sum over k, l = 0..4 of Bk Bl d(i + k - 1, j + l - 1). The moves d beyond the border continue
/// linearly: d(-1) = 2 d(0) - d(1), and so on. So the deformation is C2, a control point moves what lies less than two
/// control spacings away, corners go exactly where their control points go, and affine moves give affine warps.
///
/// * `lattice`: the nodes to move.
/// * `count`: columns and rows of control points, at least 2 each (asserted).
/// * `moves`: of each control point, px, row-major, any finite numbers; zeros are the identity.
///
/// Moves beyond about half the control spacing against each other may fold; [`super::certify`] reports it.
///
/// Cost: 16 products per node and axis, rows side by side. Stops when `watch` says so.
///
/// S. Lee, G. Wolberg, S. Y. Shin, "Scattered Data Interpolation with Multilevel B-Splines", IEEE TVCG 3, 1997,
/// equation 1.
pub fn free_lattice(
    lattice: &Lattice,
    count: [usize; 2],
    moves: &[[f64; 2]],
    watch: Watch,
) -> Result<Positions, Interrupted> {
    assert!(count.iter().all(|&count| count >= 2), "{count:?} control points are no lattice");
    assert_eq!(moves.len(), count[0] * count[1], "one move per control point");
    let size = lattice.size();
    let place = |axis: usize, at: f64| {
        Spline::at((at - lattice.origin[axis]) / size[axis] * (count[axis] - 1) as f64, count[axis])
    };
    Positions::mapped(lattice, watch, |[x, y]| {
        let (across, down) = (place(0, x), place(1, y));
        let mut sum = [0.0; 2];
        for (row, weight) in down.nodes() {
            for axis in 0..2 {
                let along = across.nodes().fold(0.0, |sum, (column, w)| sum + w * moves[row * count[0] + column][axis]);
                sum[axis] += weight * along;
            }
        }
        [x + sum[0], y + sum[1]]
    })
}

/// The moves of control points of [`free_lattice`] from where they are to go.
///
/// * `lattice`, `count`: as for [`free_lattice`].
/// * `positions`: of the first control points, px, row-major; no more than there are (asserted).
///
/// Cost: linear in the positions.
pub fn control_moves(lattice: &Lattice, count: [usize; 2], positions: &[[f64; 2]]) -> Vec<[f64; 2]> {
    assert!(positions.len() <= count[0] * count[1], "more positions than control points");
    let size = lattice.size();
    let moved = |(i, position): (usize, &[f64; 2])| {
        let at = [i % count[0], i / count[0]];
        [0, 1].map(|axis| {
            position[axis] - lattice.origin[axis] - size[axis] * (at[axis] as f64 / (count[axis] - 1) as f64)
        })
    };
    positions.iter().enumerate().map(moved).collect()
}

/// Weights of up to four neighbouring control values, the linear continuation folded into them.
struct Spline {
    first: usize,
    weights: [f64; 4],
    len: usize,
}

impl Spline {
    fn at(s: f64, count: usize) -> Self {
        let cell = (s.max(0.0) as usize).min(count - 2);
        let f = s - cell as f64;
        let (square, cube, r) = (f * f, f * f * f, 1.0 - f);
        let mut weights = [
            r * r * r / 6.0,
            (3.0 * cube - 6.0 * square + 4.0) / 6.0,
            (-3.0 * cube + 3.0 * square + 3.0 * f + 1.0) / 6.0,
            cube / 6.0,
        ];
        let (mut first, mut len) = (0, 4);
        if cell + 2 == count {
            weights[2] += 2.0 * weights[3];
            weights[1] -= weights[3];
            len = 3;
        }
        if cell == 0 {
            weights[1] += 2.0 * weights[0];
            weights[2] -= weights[0];
            (first, len) = (1, len - 1);
            weights.rotate_left(1);
        }
        Self { first: cell + first - 1, weights, len }
    }

    /// Control points with their weights.
    fn nodes(&self) -> impl Iterator<Item = (usize, f64)> {
        (self.first..).zip(self.weights).take(self.len)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{assert_identity, assert_threads_agree};
    use super::*;
    use crate::UNWATCHED;

    const LATTICE: Lattice = Lattice { origin: [10.0, 20.0], spacing: [2.5, 4.0], nodes: [41, 16] };

    fn free(lattice: &Lattice, count: [usize; 2], moves: &[[f64; 2]]) -> Positions {
        free_lattice(lattice, count, moves, UNWATCHED).expect("nobody stops it")
    }

    /// Moves of the control points of `LATTICE` by a function of where they rest.
    fn moves(count: [usize; 2], by: impl Fn([f64; 2]) -> [f64; 2]) -> Vec<[f64; 2]> {
        let [w, h] = LATTICE.size();
        let rest = |i: usize| {
            let (column, row) = (i % count[0], i / count[0]);
            [10.0 + w * column as f64 / (count[0] - 1) as f64, 20.0 + h * row as f64 / (count[1] - 1) as f64]
        };
        (0..count[0] * count[1]).map(|i| by(rest(i))).collect()
    }

    #[test]
    fn identity_is_exact() {
        assert_identity(|lattice| free(lattice, [5, 3], &[[0.0; 2]; 15]));
    }

    #[test]
    fn affine_moves_are_reproduced() {
        let affine = |[x, y]: [f64; 2]| [0.3 * x - 0.7 * y + 5.0, 0.2 * x + 0.1 * y - 3.0];
        for count in [[2, 2], [3, 2], [4, 5], [9, 3]] {
            let warped = free(&LATTICE, count, &moves(count, affine));
            for i in 0..LATTICE.node_count() {
                let rest = LATTICE.rest(i % 41, i / 41);
                let [dx, dy] = affine(rest);
                assert!((warped.x[i] - rest[0] - dx).abs() < 1e-11 && (warped.y[i] - rest[1] - dy).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn one_point_moves_its_surroundings_by_the_spline() {
        let mut one = [[0.0; 2]; 6 * 6];
        one[2 * 6 + 2] = [9.0, -18.0];
        let warped = free(&LATTICE, [6, 6], &one);
        // Control spacing is 20 by 12 px, that is 8 by 3 cells.
        let moved = |column: usize, row: usize| {
            let i = row * 41 + column;
            let [x, y] = LATTICE.rest(column, row);
            [warped.x[i] - x, warped.y[i] - y]
        };
        let near = |found: [f64; 2], expected: f64| {
            assert!(
                (found[0] - 9.0 * expected).abs() < 1e-12 && (found[1] + 18.0 * expected).abs() < 1e-12,
                "{found:?}"
            );
        };
        near(moved(16, 6), 4.0 / 9.0);
        near(moved(8, 6), 1.0 / 9.0);
        near(moved(24, 9), 1.0 / 36.0);
        near(moved(20, 6), 2.0 / 3.0 * (3.0 / 8.0 - 1.5 + 4.0) / 6.0);
        assert_eq!(moved(33, 6), [0.0; 2], "two spacings away nothing moves");
    }

    #[test]
    fn corners_follow_their_points() {
        let count = [4, 3];
        let wild: Vec<[f64; 2]> = (0..12).map(|i| [(i * 7 % 5) as f64 - 2.0, (i * 3 % 7) as f64]).collect();
        let warped = free(&LATTICE, count, &wild);
        for (node, point) in [(0, 0), (40, 3), (15 * 41, 8), (15 * 41 + 40, 11)] {
            let [x, y] = LATTICE.rest(node % 41, node / 41);
            assert!((warped.x[node] - x - wild[point][0]).abs() < 1e-12);
            assert!((warped.y[node] - y - wild[point][1]).abs() < 1e-12);
        }
    }

    #[test]
    fn positions_are_moves_from_rest() {
        let count = [3, 2];
        let positions = [[10.0, 20.0], [61.0, 18.0], [110.0, 20.0], [12.0, 80.0]];
        let expected = [[0.0, 0.0], [1.0, -2.0], [0.0, 0.0], [2.0, 0.0]];
        assert_eq!(control_moves(&LATTICE, count, &positions), expected);
    }

    #[test]
    fn threads_do_not_change_it() {
        let wild = moves([5, 4], |[x, y]| [(x * y) % 3.0, (x + y) % 2.0]);
        assert_threads_agree(|| free(&LATTICE, [5, 4], &wild));
    }
}
