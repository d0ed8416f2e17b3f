//! The certificate that a warp does not fold.

use crate::lattice::{Lattice, Positions};
use crate::simd::vectorized;
use crate::{Interrupted, Watch};
use rayon::prelude::*;
use robust::{Coord, orient2d};

/// What [`certify`] finds. Without folds the warp is one-to-one on every cell and around every node inside; parts of
/// the lattice far from each other may still come to overlap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate {
    /// The least determinant of d dst / d src, 1 at rest; negative infinity where it cannot be told.
    pub min_jacobian: f64,
    /// Column and row of the cell where it is found, the first in row-major order.
    pub at_cell: [usize; 2],
    /// Cells with a corner where the determinant is not positive.
    pub folds: usize,
}

/// The least Jacobian determinant of a warp that is bilinear on every cell of its lattice.
///
/// In a cell, det(d dst / d src) of the bilinear map is an affine function of the source position, so its least
/// value lies at a corner: the four corners of all cells decide. At a corner it is the cross product of the two
/// edges that meet there over the product of the spacings.
///
/// * `lattice`: the source.
/// * `positions`: where its nodes go, px; one per node (asserted).
///
/// Short of overflow and underflow the sign of each cross product is exact, so a collapsed cell never passes for a
/// thin one. A cell with a position that is not finite, or with a cross product that overflows to NaN, is a fold with
/// a determinant of negative infinity. `min_jacobian` is never NaN, and positive exactly when `folds` is 0.
///
/// Cost: linear in the cells, rows side by side. Stops when `watch` says so.
///
/// J. R. Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", Discrete &
/// Computational Geometry 18, 1997 (the cross product).
pub fn certify(lattice: &Lattice, positions: &Positions, watch: Watch) -> Result<Certificate, Interrupted> {
    let Positions { x, y } = positions;
    assert!(x.len() == lattice.node_count() && y.len() == x.len(), "{} positions do not fit {lattice:?}", x.len());
    let [columns, rows] = lattice.cells();
    assert!(columns > 0 && rows > 0, "{lattice:?} has no cells");
    let nothing = Certificate { min_jacobian: f64::INFINITY, at_cell: [0, 0], folds: 0 };
    let of_row = |least: &mut Vec<f64>, row: usize| {
        least.resize(columns, 0.0);
        least_cross_products(lattice.nodes, positions, row, least);
        let certificate = least.iter().enumerate().fold(nothing, |sum, (column, least)| {
            let min_jacobian = least / lattice.spacing[0] / lattice.spacing[1];
            worse(sum, Certificate { min_jacobian, at_cell: [column, row], folds: usize::from(min_jacobian <= 0.0) })
        });
        watch.go_on().map(|()| certificate)
    };
    let by_row: Vec<Certificate> = (0..rows).into_par_iter().map_init(Vec::new, of_row).collect::<Result<_, _>>()?;
    Ok(by_row.into_iter().fold(nothing, worse))
}

/// Both certificates as one; of equal minima the first stays.
fn worse(first: Certificate, second: Certificate) -> Certificate {
    let least = if second.min_jacobian < first.min_jacobian { second } else { first };
    Certificate { folds: first.folds + second.folds, ..least }
}

/// Where the difference of two products is at least this share of their sum, rounding took neither its sign nor, as
/// `orient2d` gives it, its value (K. Ozaki et al., "Simple floating-point filters for the two-dimensional orientation
/// problem", 2016).
const SURE: f64 = 3.330_669_062_177_372_2e-16;

/// The least cross product of the edges along x and y at the corners of each cell of a row, of exact sign; negative
/// infinity where a corner is not finite or a product overflows to NaN.
///
/// * `nodes`: columns and rows of the lattice.
/// * `least`: one per cell of the row.
pub(crate) fn least_cross_products(nodes: [usize; 2], positions: &Positions, row: usize, least: &mut [f64]) {
    let (columns, Positions { x, y }) = (nodes[0], positions);
    let lines = row * columns..(row + 2) * columns;
    let ((x0, x1), (y0, y1)) = (x[lines.clone()].split_at(columns), y[lines].split_at(columns));
    let corners = |column: usize| {
        let next = column + 1;
        [(x0[column], y0[column]), (x0[next], y0[next]), (x1[next], y1[next]), (x1[column], y1[column])]
    };
    vectorized(
        #[inline(always)]
        || {
            for (column, least) in least.iter_mut().enumerate() {
                *least = quick_cross_product(corners(column));
            }
        },
    );
    for (column, least) in least.iter_mut().enumerate().filter(|(_, least)| !least.is_finite()) {
        *least = least_cross_product(corners(column).map(|(x, y)| Coord { x, y }));
    }
}

/// [`least_cross_product`], NaN where that takes more than a glance.
#[inline(always)]
fn quick_cross_product(corners: [(f64, f64); 4]) -> f64 {
    let (mut least, mut sure) = (f64::INFINITY, true);
    for i in 0..4 {
        let ((ax, ay), (bx, by), (cx, cy)) = (corners[i], corners[(i + 1) % 4], corners[(i + 3) % 4]);
        let (left, right) = ((ax - cx) * (by - cy), (ay - cy) * (bx - cx));
        let cross = left - right;
        sure &= cross.abs() >= SURE * (left + right).abs();
        least = if cross < least { cross } else { least };
    }
    if sure { least } else { f64::NAN }
}

/// The least cross product of the edges along x and y at the corners of a cell, given clockwise on screen.
fn least_cross_product(corners: [Coord<f64>; 4]) -> f64 {
    if !corners.iter().all(|p| p.x.is_finite() && p.y.is_finite()) {
        return f64::NEG_INFINITY;
    }
    (0..4)
        .map(|i| orient2d(corners[i], corners[(i + 1) % 4], corners[(i + 3) % 4]))
        .map(|cross| if cross.is_nan() { f64::NEG_INFINITY } else { cross })
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UNWATCHED;
    use proptest::prelude::*;

    fn certify(lattice: &Lattice, positions: &Positions) -> Certificate {
        super::certify(lattice, positions, UNWATCHED).expect("nobody stops it")
    }

    const UNIT: Lattice = Lattice { origin: [0.0, 0.0], spacing: [1.0, 1.0], nodes: [5, 5] };

    fn rest(lattice: &Lattice) -> Positions {
        Positions::from_map(lattice, |p| p)
    }

    #[test]
    fn rest_is_one() {
        assert_eq!(certify(&UNIT, &rest(&UNIT)), Certificate { min_jacobian: 1.0, at_cell: [0, 0], folds: 0 });
        let lattice = Lattice { origin: [3.3, -9.1], spacing: [0.3, 17.7], nodes: [6, 4] };
        assert!((certify(&lattice, &rest(&lattice)).min_jacobian - 1.0).abs() < 1e-12);
    }

    #[test]
    fn mirroring_folds_every_cell() {
        let mirrored = Positions::from_map(&UNIT, |[x, y]| [-2.0 * x, y]);
        assert_eq!(certify(&UNIT, &mirrored), Certificate { min_jacobian: -2.0, at_cell: [0, 0], folds: 16 });
    }

    #[test]
    fn one_node_dragged_over_its_cell_folds_its_neighbours() {
        // Node (2, 2) goes past the far corner (3, 3) of its cell.
        let mut positions = rest(&UNIT);
        (positions.x[12], positions.y[12]) = (3.5, 3.5);
        let certificate = certify(&UNIT, &positions);
        assert_eq!(certificate.at_cell, [2, 2]);
        // There the edges become (-0.5, -1.5) and (-1.5, -0.5); the cells above and to the left fold at their far ends.
        assert_eq!((certificate.min_jacobian, certificate.folds), (-2.0, 3));
    }

    #[test]
    fn a_collapsed_cell_is_a_fold_and_a_thin_one_is_not() {
        let cell = Lattice { nodes: [2, 2], ..UNIT };
        let along = |rise: f64| Positions { x: vec![0.1, 0.4, 0.3, 0.6], y: vec![0.1, 0.4, 0.3 + rise, 0.6 + rise] };
        assert_eq!(certify(&cell, &along(0.0)).folds, 1);
        let thin = certify(&cell, &along(1e-15));
        assert!(thin.folds == 0 && thin.min_jacobian > 0.0 && thin.min_jacobian < 1e-14, "{thin:?}");
    }

    #[test]
    fn positions_that_are_not_finite_are_folds() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut positions = rest(&UNIT);
            positions.y[4] = bad;
            let expected = Certificate { min_jacobian: f64::NEG_INFINITY, at_cell: [3, 0], folds: 1 };
            assert_eq!(certify(&UNIT, &positions), expected);
            positions.x[12] = bad;
            assert_eq!(certify(&UNIT, &positions).folds, 5);
        }
        let huge = Positions::from_map(&UNIT, |[x, y]| [1e300 * (x + y), 1e300 * (x - y)]);
        assert!(!certify(&UNIT, &huge).min_jacobian.is_nan());
    }

    /// The glance gives the bits of the exact product, and leaves to it what it cannot tell.
    #[test]
    fn quick_products_are_the_exact_ones() {
        let lattice = Lattice { nodes: [203, 3], ..UNIT };
        let mut positions = Positions::from_map(&lattice, |[x, y]| [x + 0.1 * (7.0 * y).sin(), y + (0.3 * x).sin()]);
        // On one line but for rounding, and far from finite.
        for (node, x) in positions.x.iter_mut().enumerate().filter(|(node, _)| node % 7 == 3) {
            *x = positions.y[node] * (1.0 / 3.0);
        }
        (positions.x[11], positions.y[40], positions.x[70]) = (f64::NAN, 1e200, f64::INFINITY);
        let mut least = vec![0.0; 202];
        let mut glances = 0;
        for row in 0..2 {
            least_cross_products(lattice.nodes, &positions, row, &mut least);
            for (column, found) in least.iter().enumerate() {
                let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(dc, dr)| {
                    let node = (row + dr) * 203 + column + dc;
                    Coord { x: positions.x[node], y: positions.y[node] }
                });
                glances += usize::from(quick_cross_product(corners.map(|p| (p.x, p.y))).is_finite());
                assert_eq!(found.to_bits(), least_cross_product(corners).to_bits(), "{column} {row}");
            }
        }
        assert!(glances > 200 && glances < 404, "{glances}");
    }

    #[test]
    fn threads_do_not_change_it() {
        let lattice = Lattice { nodes: [37, 41], ..UNIT };
        let positions = Positions::from_map(&lattice, |[x, y]| [x + (9.0 * y).sin(), y + (7.0 * x * y).cos()]);
        let expected = certify(&lattice, &positions);
        assert!(expected.folds > 10 && expected.folds < 1000);
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            assert_eq!(pool.install(|| certify(&lattice, &positions)), expected);
        }
    }

    proptest! {
        #[test]
        fn no_point_of_a_cell_lies_below_the_corners(
            dst in proptest::array::uniform8(-3.0..3.0f64), u in 0.0..1.0f64, v in 0.0..1.0f64,
        ) {
            let cell = Lattice { spacing: [0.7, 1.9], nodes: [2, 2], ..UNIT };
            let [x, y] = [dst[..4].to_vec(), dst[4..].to_vec()];
            // Derivatives of the bilinear map in u and v.
            let du = |p: &[f64]| (p[1] - p[0]) * (1.0 - v) + (p[3] - p[2]) * v;
            let dv = |p: &[f64]| (p[2] - p[0]) * (1.0 - u) + (p[3] - p[1]) * u;
            let inside = (du(&x) * dv(&y) - du(&y) * dv(&x)) / (0.7 * 1.9);
            let found = certify(&cell, &Positions { x, y });
            prop_assert!(inside >= found.min_jacobian - 1e-9, "{inside} lies below {found:?}");
            prop_assert_eq!(found.folds == 0, found.min_jacobian > 0.0);
        }
    }
}
