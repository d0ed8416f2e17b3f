//! The inverse of a warp.

use super::certify;
use super::compose::{distance, interpolation_error};
use crate::lattice::{Lattice, Positions};
use crate::rect::Rect;
use crate::resample::{Map, Net, sources};
use crate::{Interrupted, Watch};
use rayon::prelude::*;

/// Why a warp has no inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InvertError {
    /// Told to stop.
    Interrupted,
    /// A cell folds, or a node of it is not finite.
    Folded {
        /// Its column and row.
        cell: [usize; 2],
        /// Count of such cells.
        folds: usize,
    },
}

impl From<Interrupted> for InvertError {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

/// An inverse on a lattice, and how well the lattice holds it.
#[derive(Clone, Debug, PartialEq)]
pub struct Inverted {
    /// Where the lattice's nodes come from.
    pub positions: Positions,
    /// Count of nodes within the image of the warp's own lattice, its border included; the others are continued.
    pub covered: usize,
    /// Largest distance between W(W^-1(p)) and p at the covered nodes, px.
    pub residual: f64,
    /// Largest distance between the exact inverse and what lies between the nodes, at the covered centres of cells, px.
    pub interpolation_error: f64,
}

/// A lattice over the image of a warp: over the bounding box of its nodes' positions, with as many nodes.
///
/// * `lattice`, `positions`: the warp, one position per node (asserted).
///
/// `None` where a position is not finite or the box has a side without length.
///
/// Cost: linear in the nodes.
pub fn image_lattice(lattice: &Lattice, positions: &Positions) -> Option<Lattice> {
    let ends = [&positions.x, &positions.y].map(|at| {
        assert_eq!(at.len(), lattice.node_count(), "one position per node");
        at.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [low.min(*at), high.max(*at)])
    });
    let spacing = [0, 1].map(|axis| (ends[axis][1] - ends[axis][0]) / lattice.cells()[axis] as f64);
    let finite = positions.x.iter().chain(&positions.y).all(|at| at.is_finite());
    let sound = finite && spacing.iter().all(|spacing| *spacing > 0.0 && spacing.is_finite());
    sound.then_some(Lattice { origin: ends.map(|[low, _]| low), spacing, ..*lattice })
}

/// The inverse of a warp, at the nodes of another lattice.
///
/// A node in the image of one of the warp's cells comes from where the exact inverse of the cell's bilinear map says;
/// where parts of the image overlap, the last cell in row-major order counts. A node outside comes from where the
/// continuation of the border cells' bilinear maps reaches it; where these fold or end, from the affine continuation
/// of the border cell nearest to it, at the nearest point of its edge.
///
/// * `lattice`, `positions`: the warp W, one position per node (asserted).
/// * `onto`: the lattice whose nodes are sought, in W's destination; see [`image_lattice`].
///
/// A warp with a fold has no inverse, one that mirrors all its cells has.
///
/// Cost: linear in the nodes of both lattices, and the nodes out of the continuation's reach times W's border. Takes
/// 16 bytes per node of each beside the result. Stops when `watch` says so.
///
/// The inverse of a bilinear map as in [`crate::resample`].
pub fn invert(lattice: &Lattice, positions: &Positions, onto: &Lattice, watch: Watch) -> Result<Inverted, InvertError> {
    refuse_folds(lattice, positions, watch)?;
    watch.reserve((lattice.node_count() + onto.node_count()) * size_of::<[f64; 2]>())?;
    let net = Net::new(lattice, positions);
    let mut found = in_pixels(lattice, positions, onto, 0.5, onto.nodes, watch)?;
    continue_affinely(&net, onto, &mut found, watch)?;
    let (covered, residual) = residual(&net, onto, &found, watch)?;
    let centers = in_pixels(lattice, positions, onto, 0.0, onto.cells(), watch)?;
    let exact = |column: usize, row: usize| {
        let i = row * onto.cells()[0] + column;
        let at = [centers.x[i], centers.y[i]];
        holds(lattice, at).then_some(at)
    };
    let interpolation_error = interpolation_error(onto, &found, exact, watch)?;
    Ok(Inverted { positions: found, covered, residual, interpolation_error })
}

/// Refuses folds; a map all of whose cells are mirrored has none.
///
/// * `lattice`, `positions`: the warp, one position per node (asserted).
///
/// A cell with a position that is not finite is a fold. Cost: linear in the nodes. Stops when `watch` says so.
pub fn refuse_folds(lattice: &Lattice, positions: &Positions, watch: Watch) -> Result<(), InvertError> {
    let found = certify(lattice, positions, watch)?;
    if found.folds == lattice.cells()[0] * lattice.cells()[1] {
        let [columns, rows] = lattice.cells();
        let net = Net::new(lattice, positions);
        let turned = |[a, b, c]: [[f64; 2]; 3]| {
            let [a, b, c] = [a, b, c].map(|[x, y]| robust::Coord { x, y });
            robust::orient2d(a, b, c) < 0.0
        };
        let mirrored = (0..rows).into_par_iter().all(|row| {
            (0..columns).all(|column| {
                let corners = net.corners([column, row]);
                (0..4).all(|i| turned([corners[i], corners[(i + 1) % 4], corners[(i + 2) % 4]]))
            })
        });
        if mirrored {
            return Ok(());
        }
    }
    match found.folds {
        0 => Ok(()),
        folds => Err(InvertError::Folded { cell: found.at_cell, folds }),
    }
}

/// Sources of the points `onto.origin + (column + 1/2 - shift, row + 1/2 - shift) spacings`: these are the centres of
/// the pixels (column, row) once the image is measured in spacings.
fn in_pixels(
    lattice: &Lattice,
    positions: &Positions,
    onto: &Lattice,
    shift: f64,
    count: [usize; 2],
    watch: Watch,
) -> Result<Positions, Interrupted> {
    let scaled = |at: &[f64], axis: usize| -> Vec<f64> {
        at.par_iter().map(|at| (at - onto.origin[axis]) / onto.spacing[axis] + shift).collect()
    };
    let scaled = Positions { x: scaled(&positions.x, 0), y: scaled(&positions.y, 1) };
    let map = Map::Forward { lattice, positions: &scaled };
    sources(&map, Rect::new(0, 0, count[0] as i64, count[1] as i64), watch)
}

/// Whether a point lies in the lattice's rectangle; on its border give or take rounding.
fn holds(lattice: &Lattice, at: [f64; 2]) -> bool {
    let size = lattice.size();
    (0..2).all(|axis| {
        let slack = 1e-9 * lattice.spacing[axis];
        let from = at[axis] - lattice.origin[axis];
        from >= -slack && from <= size[axis] + slack
    })
}

/// How many nodes come from within the lattice, and how far at most the warp takes these from where they are.
fn residual(net: &Net, onto: &Lattice, found: &Positions, watch: Watch) -> Result<(usize, f64), Interrupted> {
    let [columns, rows] = onto.nodes;
    let rows = (0..rows).into_par_iter().map(|row| {
        watch.go_on()?;
        let own =
            (0..columns).map(|column| (column, [found.x[row * columns + column], found.y[row * columns + column]]));
        Ok(own.filter(|(_, at)| holds(net.lattice, *at)).fold(
            (0, 0.0),
            |(count, worst): (usize, f64), (column, at)| {
                let there = net.position(net.place(0, at[0]), net.place(1, at[1]));
                (count + 1, worst.max(distance(there, onto.rest(column, row))))
            },
        ))
    });
    rows.try_reduce(|| (0, 0.0), |a, b| Ok((a.0 + b.0, a.1.max(b.1))))
}

/// Gives the nodes that nothing reaches the affine continuation of the nearest border cell.
fn continue_affinely(net: &Net, onto: &Lattice, found: &mut Positions, watch: Watch) -> Result<(), Interrupted> {
    if found.x.par_iter().all(|x| !x.is_nan()) {
        return Ok(());
    }
    let border = border(net);
    let columns = onto.nodes[0];
    let rows = found.x.par_chunks_mut(columns).zip(found.y.par_chunks_mut(columns)).enumerate();
    rows.try_for_each(|(row, (xs, ys))| {
        for (column, (x, y)) in xs.iter_mut().zip(ys).enumerate().filter(|(_, (x, _))| x.is_nan()) {
            [*x, *y] = nearest(&border, net, onto.rest(column, row));
        }
        watch.go_on()
    })
}

/// An edge of the border: its cell, and its ends in cells of the lattice and in the destination.
struct BorderEdge {
    cell: [usize; 2],
    rest: [[f64; 2]; 2],
    ends: [[f64; 2]; 2],
}

fn border(net: &Net) -> Vec<BorderEdge> {
    let [columns, rows] = net.lattice.cells();
    let edge = |cell: [usize; 2], corner: usize| {
        let corners = net.corners(cell);
        let at = |corner: usize| {
            let [du, dv] = [[0, 0], [1, 0], [1, 1], [0, 1]][corner % 4];
            [(cell[0] + du) as f64, (cell[1] + dv) as f64]
        };
        BorderEdge { cell, rest: [at(corner), at(corner + 1)], ends: [corners[corner], corners[(corner + 1) % 4]] }
    };
    let across = (0..columns).flat_map(|column| [edge([column, 0], 0), edge([column, rows - 1], 2)]);
    let down = (0..rows).flat_map(|row| [edge([0, row], 3), edge([columns - 1, row], 1)]);
    across.chain(down).collect()
}

/// The source of `p` by the derivative at the nearest point of the border.
fn nearest(border: &[BorderEdge], net: &Net, p: [f64; 2]) -> [f64; 2] {
    let minus = |a: [f64; 2], b: [f64; 2]| [a[0] - b[0], a[1] - b[1]];
    let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
    let mut best = (f64::INFINITY, 0, 0.0);
    for (number, BorderEdge { ends: [a, b], .. }) in border.iter().enumerate() {
        let (along, to) = (minus(*b, *a), minus(p, *a));
        let t = (dot(along, to) / dot(along, along)).clamp(0.0, 1.0);
        let gap = minus(to, along.map(|step| t * step));
        if dot(gap, gap) < best.0 {
            best = (dot(gap, gap), number, t);
        }
    }
    let (_, number, t) = best;
    let BorderEdge { cell, rest, ends } = &border[number];
    let [p00, p10, p11, p01] = net.corners(*cell);
    let on_edge = |[a, b]: &[[f64; 2]; 2]| [0, 1].map(|axis| a[axis] + t * (b[axis] - a[axis]));
    let (rest, foot) = (on_edge(rest), on_edge(ends));
    let [u, v] = [rest[0] - cell[0] as f64, rest[1] - cell[1] as f64];
    let [du, dv] = [0, 1].map(|axis| {
        [
            (1.0 - v) * (p10[axis] - p00[axis]) + v * (p11[axis] - p01[axis]),
            (1.0 - u) * (p01[axis] - p00[axis]) + u * (p11[axis] - p10[axis]),
        ]
    });
    // du and dv are the rows (x, y) of the derivative; its columns are those along u and v.
    let gap = minus(p, foot);
    let jacobian = du[0] * dv[1] - du[1] * dv[0];
    let step = [(gap[0] * dv[1] - gap[1] * du[1]) / jacobian, (gap[1] * du[0] - gap[0] * dv[0]) / jacobian];
    [0, 1].map(|axis| net.lattice.origin[axis] + (rest[axis] + step[axis]) * net.lattice.spacing[axis])
}

#[cfg(test)]
mod tests {
    use super::super::tests::assert_threads_agree;
    use super::super::{Affine, affine, arc, compose, swirl, wave};
    use super::*;
    use crate::UNWATCHED;

    const LATTICE: Lattice = Lattice { origin: [10.0, 20.0], spacing: [2.0, 3.0], nodes: [31, 21] };

    fn inverse(lattice: &Lattice, positions: &Positions, onto: &Lattice) -> Inverted {
        invert(lattice, positions, onto, UNWATCHED).expect("no folds")
    }

    fn far(a: &Positions, b: &Positions) -> f64 {
        (0..a.x.len()).map(|i| distance([a.x[i], a.y[i]], [b.x[i], b.y[i]])).fold(0.0, f64::max)
    }

    fn turn(degrees: f64, scale: [f64; 2]) -> Affine {
        Affine { rotate_deg: degrees, scale, shear: [0.2, 0.1], translate: [5.0, -3.0], ..Affine::default() }
    }

    #[test]
    fn affine_maps_are_inverted_exactly_inside_and_outside() {
        for scale in [[1.5, 0.5], [1.5, -0.5]] {
            let there = affine(&LATTICE, &turn(33.0, scale), UNWATCHED).expect("nobody stops it");
            let onto = Lattice { origin: [-60.0, -50.0], spacing: [9.0, 11.0], nodes: [30, 30] };
            let back = inverse(&LATTICE, &there, &onto);
            let again = affine(&LATTICE, &turn(33.0, scale), UNWATCHED).expect("nobody stops it");
            let round = compose((&onto, &back.positions), (&LATTICE, &again), UNWATCHED).expect("nobody stops it");
            assert!(far(&round.positions, &Positions::from_map(&onto, |p| p)) < 1e-9);
            assert!(back.covered > 20 && back.covered < 200, "{} nodes are covered", back.covered);
            assert!(back.residual < 1e-10 && back.interpolation_error < 1e-10, "{back:?}");
        }
    }

    #[test]
    fn the_round_trip_errs_by_no_more_than_it_says() {
        for degrees in [-45.0, 25.0, 120.0] {
            let there = arc(&LATTICE, degrees, UNWATCHED).expect("nobody stops it");
            let onto = image_lattice(&LATTICE, &there).expect("finite");
            let back = inverse(&LATTICE, &there, &onto);
            assert!(back.residual < 1e-9, "{}", back.residual);
            // From the inverse's nodes through the warp: the identity where the warp reaches.
            let round = compose((&onto, &back.positions), (&LATTICE, &there), UNWATCHED).expect("nobody stops it");
            let own = (0..onto.node_count()).filter(|&i| holds(&LATTICE, [back.positions.x[i], back.positions.y[i]]));
            let worst = own
                .map(|i| distance([round.positions.x[i], round.positions.y[i]], onto.rest(i % 31, i / 31)))
                .fold(0.0, f64::max);
            assert!(worst <= back.residual + 1e-12, "{worst}");
            // From the warp's nodes through the inverse: the inverse lies between its nodes.
            let round = compose((&LATTICE, &there), (&onto, &back.positions), UNWATCHED).expect("nobody stops it");
            let worst = far(&round.positions, &Positions::from_map(&LATTICE, |p| p));
            assert!(worst < 4.0 * back.interpolation_error + 0.05, "{worst}, {}", back.interpolation_error);
        }
    }

    #[test]
    fn the_inverse_of_the_inverse_is_close() {
        let there = wave(&LATTICE, 2.0, 40.0, 10.0, 30.0, UNWATCHED).expect("nobody stops it");
        let wide = Lattice { origin: [0.0, 10.0], spacing: [0.5, 0.5], nodes: [161, 161] };
        let back = inverse(&LATTICE, &there, &wide);
        let again = inverse(&wide, &back.positions, &LATTICE);
        let off = far(&again.positions, &there);
        assert!(off < 3.0 * back.interpolation_error + 1e-9 && off < 0.2, "{off}, {}", back.interpolation_error);
    }

    #[test]
    fn one_bilinear_cell_is_inverted_exactly() {
        let cell = Lattice { origin: [3.0, 4.0], spacing: [10.0, 20.0], nodes: [2, 2] };
        let there = Positions { x: vec![0.0, 8.0, 1.0, 12.0], y: vec![0.0, 2.0, 9.0, 10.0] };
        let onto = Lattice { origin: [1.0, 1.5], spacing: [1.5, 1.25], nodes: [5, 5] };
        let back = inverse(&cell, &there, &onto);
        assert!(back.covered >= 24 && back.residual < 1e-12, "{back:?}");
        let corner = Lattice { origin: [0.0, 0.0], spacing: [12.0, 10.0], nodes: [2, 2] };
        let corners = inverse(&cell, &there, &corner).positions;
        assert!(distance([corners.x[0], corners.y[0]], [3.0, 4.0]) < 1e-9);
        assert!(distance([corners.x[3], corners.y[3]], [13.0, 24.0]) < 1e-9);
    }

    #[test]
    fn nodes_out_of_all_reach_are_continued_from_the_nearest_edge() {
        // The sides converge downwards: the continuation ends where they meet, 40 px below.
        let cell = Lattice { origin: [0.0, 0.0], spacing: [40.0, 20.0], nodes: [2, 2] };
        let there = Positions { x: vec![0.0, 40.0, 10.0, 30.0], y: vec![0.0, 0.0, 20.0, 20.0] };
        let onto = Lattice { origin: [15.0, 60.0], spacing: [10.0, 10.0], nodes: [2, 2] };
        let back = inverse(&cell, &there, &onto);
        assert_eq!(back.covered, 0);
        // At (15, 60) the nearest point is (15, 20), a quarter along the lower edge, where d/dv is (5, 20) a cell.
        let (u, v) = (0.25 + (0.0 - 5.0 * 2.0) / 20.0, 1.0 + 2.0);
        assert!(distance([back.positions.x[0], back.positions.y[0]], [u * 40.0, v * 20.0]) < 1e-9, "{back:?}");
    }

    #[test]
    fn folds_are_refused_by_their_cell() {
        let mut folded = Positions::from_map(&LATTICE, |p| p);
        folded.x[5 * 31 + 7] += 4.5;
        let found = invert(&LATTICE, &folded, &LATTICE, UNWATCHED);
        assert!(matches!(found, Err(InvertError::Folded { cell: [7, 4 | 5], folds: 2.. })), "{found:?}");
        folded.x[5 * 31 + 7] = f64::NAN;
        let found = invert(&LATTICE, &folded, &LATTICE, UNWATCHED);
        assert_eq!(found, Err(InvertError::Folded { cell: [6, 4], folds: 4 }));
        assert_eq!(image_lattice(&LATTICE, &folded), None);
        let point = Positions { x: vec![1.0; 651], y: vec![2.0; 651] };
        assert!(matches!(invert(&LATTICE, &point, &LATTICE, UNWATCHED), Err(InvertError::Folded { folds: 600, .. })));
    }

    #[test]
    fn threads_do_not_change_it() {
        let there = swirl(&LATTICE, 40.0, 30.0, LATTICE.center(), UNWATCHED).expect("nobody stops it");
        let onto = Lattice { origin: [-30.0, -30.0], spacing: [1.1, 1.3], nodes: [150, 140] };
        assert_threads_agree(|| inverse(&LATTICE, &there, &onto).positions);
    }
}
