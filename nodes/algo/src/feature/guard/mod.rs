//! Repair of feature-aware warps that fold.
//!
//! Least squares knows nothing of folds: where features need more room than the warp leaves them, or turn against
//! each other, cells of the literal solution turn over. [`guard`] gives the same functional's best warp that it can
//! find among those in which none does, or the literal solution with all scales shrunk by one factor.
//!
//! A cell's Jacobian is affine, so its four corners decide (see [`certify`]). From a start without folds a barrier on
//! the corners keeps every iterate of Newton's method free of them. The warp itself is such a start, and where it
//! folds the convex combination map of its boundary, if that is convex. For other boundaries a map without folds need
//! not exist, even where every corner of the lattice is convex; it is tried for all the same.

mod barrier;
mod bend;
mod boundary;
mod coarse;
mod functional;
mod newton;
mod shape;
mod start;
mod system;

#[cfg(test)]
mod tests;

use super::Error;
pub use super::rhs::{Freedom, Functional};
use crate::Watch;
use crate::lattice::{Positions, border};
use crate::poisson::Edges;
use crate::room::Room;
use crate::steps::Span;
use crate::warp::{Certificate, certify};
use bend::Bend;
use boundary::crossing;
use newton::Judge;
use shape::{Shape, in_single_precision};
use start::Start;

/// What gives way where features do not fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fit {
    /// The size of all features, by one factor.
    #[default]
    Shrink,
    /// Their shape, as little as weighted least squares can.
    Bend,
}

/// How a warp came to be free of folds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum How {
    /// The literal solution is, and was not touched.
    Literal,
    /// All scales were multiplied by this.
    Shrunk {
        /// In 0..1.
        factor: f64,
    },
    /// Features were bent.
    Bent {
        /// Steps of Newton's method on the lattice itself, those that looked for a start included.
        steps: usize,
    },
    /// Not at all: nothing that was to be tried reached the floor or left fewer folds, none of them worse. The literal
    /// solution.
    Kept,
}

/// Something that no warp without folds can have, or that keeps one from being certified.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Obstacle {
    /// The image of the boundary crosses or touches itself: the map is not one-to-one.
    BoundaryCrosses {
        /// First nodes, column and row, of two edges of the boundary that meet.
        nodes: [[usize; 2]; 2],
    },
    /// The nodes of a corner of a cell are pinned so that the cell folds there.
    PinnedCorner {
        /// Column and row of the corner's node; the first one in row-major order of the cells.
        node: [usize; 2],
        /// Its Jacobian, not positive.
        jacobian: f64,
        /// How many such corners there are.
        count: usize,
    },
    /// Two neighbours are pinned to one position.
    CollapsedEdge {
        /// Columns and rows of both.
        nodes: [[usize; 2]; 2],
    },
    /// Positions rounded to single precision do not reach the floor, though the positions do: the lattice is too fine
    /// or too far from the origin.
    SinglePrecision,
}

/// A warp that does not fold, or the best that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Guarded {
    /// Where the nodes go, px.
    pub positions: Positions,
    /// What was found and done.
    pub verdict: Verdict,
}

/// How free of folds a warp is, and how it came to be so.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The least corner Jacobian, of the mirror image where `mirrored`.
    pub min_jacobian: f64,
    /// Column and row of the cell where it is found.
    pub at_cell: [usize; 2],
    /// The least Jacobian that counts as free of folds.
    pub floor: f64,
    /// `min_jacobian` reaches the floor.
    pub reached: bool,
    /// The boundary runs the other way round: everything was repaired and is judged in a mirror.
    pub mirrored: bool,
    /// What was done; not enough where the floor was not reached.
    pub how: How,
    /// Cells that fold.
    pub folds: usize,
    /// Cells of the literal solution that fold.
    pub literal_folds: usize,
    /// Why no warp could do, as far as is known. Nothing known does not mean that there is one.
    pub obstacles: Vec<Obstacle>,
}

/// Solves are at most so many when features are shrunk.
const SOLVES: usize = 10;

/// Bytes per node of a shrunk solution, the best one, its rounding, and fluxes and freedom that it is solved with.
const SHRUNK_BYTES: usize = 104;

/// Part of the work that is done once features are shrunk.
const SHRUNK: f64 = 0.5;

/// Factors from 1/2 to 1/16 are tried for a first one that does.
const HALVINGS: usize = 4;

/// The literal solution of a feature-aware warp, or what comes near it without folds.
///
/// The floor is `0.01 min(1, J)`, J the least corner Jacobian of the base; where that is not positive, of the convex
/// combination map with the same pins; where that is not positive either, the floor is a ten thousandth of the mean
/// Jacobian or of 1. A result reaches it
/// - if the base has positive corner Jacobians only, or
/// - if exactly the frame is pinned or moves along directions, at least 3 x 3 nodes, and its image under the base is a
///   convex polygon, strictly convex at the four corners of the lattice (Tutte; nodes along its sides may be collinear).
///
/// Otherwise it is attempted: corners are lifted from below by the same barrier, its level rising with the lowest.
/// Where that fails, the literal solution is kept unless fewer cells of the repaired one fold and its least Jacobian is
/// no lower. What comes out is reported with the obstacles known; that there is no warp without folds is never concluded
/// from a failure. A base whose boundary runs the other way round is repaired in a mirror; where that fails, the same
/// rule keeps the literal solution, judged upright.
///
/// * `functional`: what the literal solution minimises. The base must be finite.
/// * `literal`: its minimiser, finite, one position per node. Returned bit for bit if it reaches the floor.
/// * `fit`: `Shrink` multiplies all scales by one factor below 1, the largest that bisection finds in at most 10
///   solves; the functional then is that of the shrunk features. Where no factor helps it goes on like `Bend`.
///   `Bend` lowers the functional itself: from nine tenths of the last stretch without folds on the way from the base
///   to the literal solution, by Newton's method with a barrier `mu b((J - f) / (d - f))` on corner Jacobians J,
///   `b(r) = -(r - 1)^2 ln r` for r < 1, that is felt below `d = 0.1 min(1, J of the start)` only. mu is a tenth of
///   the largest squared weight times a cell's area. Lattices of 33 nodes a side or more, pinned on their frame and
///   free inside, are bent halved first; that is the start where it does better.
/// * `may_bend`: whether features may bend; else what shrinking does not mend stays folded.
/// * `solve`: the literal solution with all scales multiplied by its argument.
/// * `watch`: asked before every solve and Newton step and between the phases of the first factorization.
///
/// Where the literal solution minimises the functional, which it does not if exact features made it, the functional of a
/// bent result is at most that of any point that reaches the floor between base and literal solution. A local minimum,
/// not the best warp. Positions rounded to f32 reach the floor too wherever those of the start do;
/// else `SinglePrecision` is told. Corners all of whose nodes are pinned are left out of the repair. With nothing to
/// move the result is the base.
///
/// Cost: the certificates where base and literal solution do not fold. A base that folds costs one sparse Cholesky
/// factorization of 2 n unknowns. Shrinking costs 10 solves, 4 where none helps; bending, which may follow them, one
/// such factorization for each Newton step: up to 200, up to 200 before them where no start without folds is known, and
/// up to 200 on each of the halved lattices, of a quarter, a sixteenth .. of the unknowns. A factorization takes
/// O(n^1.5) time and O(n log n) memory, on one thread: 0.13 s on a lattice of 200 x 200 nodes, where 40 to 100 steps are
/// the rule; on 1000 x 1000 nodes, by the growth of such factors, 50 to 100 times as long and 3 GB: there `Shrink` is the
/// cheaper choice.
///
/// The barrier: Schüller, Kavan, Panozzo and Sorkine-Hornung, "Locally injective mappings", 2013. The untangling
/// follows Garanzha et al., "Foldover-free maps in 50 lines of code", 2021, with the barrier in place of the
/// regularised determinant. The convex combination map: Floater, "One-to-one piecewise linear mappings over
/// triangulations", 2003.
pub fn guard(
    functional: &Functional,
    literal: &Positions,
    fit: Fit,
    may_bend: bool,
    solve: &dyn Fn(f64) -> Result<Positions, Error>,
    watch: Watch,
) -> Result<Guarded, Error> {
    functional.assert_shapes(literal);
    functional.first_not_finite(functional.base)?;
    functional.first_not_finite(literal)?;
    let border = border(functional.lattice.nodes);
    if boundary::doubled_area(functional.base, &border) >= 0.0 {
        return guard_upright(functional, literal, fit, may_bend, solve, watch);
    }
    let [x, y] = functional.fluxes;
    let negative = |edges: &[f64]| edges.iter().map(|value| -value).collect();
    let fluxes = [Edges { horizontal: negative(&x.horizontal), vertical: negative(&x.vertical) }, y.clone()];
    let mirrored_freedom = |freedom: &Freedom| match *freedom {
        Freedom::Along([x, y]) => Freedom::Along([-x, y]),
        other => other,
    };
    let freedom: Vec<Freedom> = functional.freedom.iter().map(mirrored_freedom).collect();
    let base = in_mirror(functional.base);
    let upright = Functional { fluxes: &fluxes, base: &base, freedom: &freedom, ..*functional };
    let solve = |factor: f64| solve(factor).map(|positions| in_mirror(&positions));
    let found = guard_upright(&upright, &in_mirror(literal), fit, may_bend, &solve, watch)?;
    let positions = in_mirror(&found.positions);
    let upright = |x: &Positions| certify(functional.lattice, x, watch);
    if found.verdict.reached || is_better(&upright(&positions)?, &upright(literal)?) {
        return Ok(Guarded { positions, verdict: Verdict { mirrored: true, ..found.verdict } });
    }
    let shape = Shape::new(functional.lattice, functional.freedom);
    let judge = Judge { shape: &shape, floor: found.verdict.floor, single: false };
    functional.report(&judge, literal.clone(), literal, How::Kept, watch)
}

fn guard_upright(
    functional: &Functional,
    literal: &Positions,
    fit: Fit,
    may_bend: bool,
    solve: &dyn Fn(f64) -> Result<Positions, Error>,
    watch: Watch,
) -> Result<Guarded, Error> {
    let shape = Shape::new(functional.lattice, functional.freedom);
    let mut room = Room::new(watch);
    let start = Start::find(functional, &shape, &mut room, watch)?;
    let floor = start.floor(functional);
    let single = match &start {
        Start::Free { positions, .. } => shape.least_exactly(&in_single_precision(positions)) >= floor,
        Start::Folded { .. } => false,
    };
    let judge = Judge { shape: &shape, floor, single };
    let reaches = |x: &Positions| {
        Ok::<_, Error>(judge.accepts(x) && certify(functional.lattice, x, watch)?.min_jacobian >= floor)
    };
    let report = |positions: Positions, how: How| functional.report(&judge, positions, literal, how, watch);
    if reaches(literal)? {
        return report(literal.clone(), How::Literal);
    }
    if fit == Fit::Shrink {
        room.phase(functional.lattice.node_count() * SHRUNK_BYTES)?;
        if let Some((factor, positions)) = shrink(&reaches, solve, &Span::new(watch, 0.0, SHRUNK))? {
            return report(positions, How::Shrunk { factor });
        }
    }
    if !may_bend {
        return report(literal.clone(), How::Kept);
    }
    let (positions, steps) =
        Bend { functional, shape: &shape, literal, floor }.bend(start, &mut room, &Span::new(watch, SHRUNK, 1.0))?;
    let bent = report(positions, How::Bent { steps })?;
    if bent.verdict.reached {
        return Ok(bent);
    }
    let certified = |x: &Positions| certify(functional.lattice, x, watch);
    match is_better(&certified(&bent.positions)?, &certified(literal)?) {
        true => Ok(bent),
        false => report(literal.clone(), How::Kept),
    }
}

/// Fewer cells fold, and none worse. Corners that are held may be the worst of both.
fn is_better(repaired: &Certificate, literal: &Certificate) -> bool {
    repaired.folds < literal.folds && repaired.min_jacobian >= literal.min_jacobian
}

/// The largest factor on all scales that bisection finds to reach the floor.
fn shrink(
    reaches: &dyn Fn(&Positions) -> Result<bool, Error>,
    solve: &dyn Fn(f64) -> Result<Positions, Error>,
    watch: Watch,
) -> Result<Option<(f64, Positions)>, Error> {
    let (mut high, mut best, mut factor) = (1.0, None::<(f64, Positions)>, 0.5);
    for solves in 0..SOLVES {
        watch.progress(solves as f64 / SOLVES as f64)?;
        let positions = solve(factor)?;
        if reaches(&positions)? {
            best = Some((factor, positions));
        } else {
            high = factor;
        }
        factor = match &best {
            Some((low, _)) => 0.5 * (low + high),
            None if solves + 1 == HALVINGS => return Ok(None),
            None => 0.5 * factor,
        };
    }
    Ok(best)
}

impl Functional<'_> {
    fn assert_shapes(&self, literal: &Positions) {
        let [columns, rows] = self.lattice.nodes;
        assert!(columns >= 2 && rows >= 2, "{columns} x {rows} nodes");
        let (horizontal, vertical) = ((columns - 1) * rows, columns * (rows - 1));
        for edges in [self.conductances, &self.fluxes[0], &self.fluxes[1]] {
            assert_eq!((edges.horizontal.len(), edges.vertical.len()), (horizontal, vertical), "edges");
        }
        for values in [&self.base.x, &self.base.y, &literal.x, &literal.y] {
            assert_eq!(values.len(), columns * rows, "positions");
        }
        assert_eq!(self.freedom.len(), columns * rows, "freedoms");
    }

    fn first_not_finite(&self, x: &Positions) -> Result<(), Error> {
        let [columns, rows] = self.lattice.nodes;
        match (0..columns * rows).find(|&node| !(x.x[node].is_finite() && x.y[node].is_finite())) {
            Some(node) => Err(Error::NotFinite { column: node % columns, row: node / columns }),
            None => Ok(()),
        }
    }

    /// The first edge of which both nodes are pinned, and to one position.
    fn pinned_edge_at_one_place(&self, x: &Positions) -> Option<[usize; 2]> {
        let pinned = |node: usize| self.freedom[node] == Freedom::Pinned;
        let collapsed = |&[p, q]: &[usize; 2]| pinned(p) && pinned(q) && x.x[p] == x.x[q] && x.y[p] == x.y[q];
        let edges = self.horizontal().chain(self.vertical());
        edges.map(|(_, from, to)| [from, to]).find(collapsed)
    }

    fn report(
        &self,
        judge: &Judge,
        positions: Positions,
        literal: &Positions,
        how: How,
        watch: Watch,
    ) -> Result<Guarded, Error> {
        let found = certify(self.lattice, &positions, watch)?;
        let rounded = certify(self.lattice, &in_single_precision(&positions), watch)?;
        let reached = found.min_jacobian >= judge.floor;
        let mut obstacles = self.obstacles(judge.shape, &positions);
        if reached && rounded.min_jacobian < judge.floor {
            obstacles.push(Obstacle::SinglePrecision);
        }
        let verdict = Verdict {
            min_jacobian: found.min_jacobian,
            at_cell: found.at_cell,
            floor: judge.floor,
            reached,
            mirrored: false,
            how,
            folds: found.folds,
            literal_folds: certify(self.lattice, literal, watch)?.folds,
            obstacles,
        };
        Ok(Guarded { positions, verdict })
    }

    fn obstacles(&self, shape: &Shape, x: &Positions) -> Vec<Obstacle> {
        let place = |node: usize| [node % self.lattice.nodes[0], node / self.lattice.nodes[0]];
        let crosses =
            crossing(x, &border(self.lattice.nodes)).map(|nodes| Obstacle::BoundaryCrosses { nodes: nodes.map(place) });
        let mut folded = shape.fixed().filter(|&corner| shape::exact_cross(x, corner) <= 0.0).peekable();
        let first = folded.peek().copied();
        let count = folded.count();
        let corner = first.map(|corner| Obstacle::PinnedCorner {
            node: place(corner[0]),
            jacobian: shape.jacobian(x, corner),
            count,
        });
        let collapsed = self.pinned_edge_at_one_place(x);
        let collapsed = collapsed.map(|nodes| Obstacle::CollapsedEdge { nodes: nodes.map(place) });
        [crosses, corner, collapsed].into_iter().flatten().collect()
    }
}

fn in_mirror(x: &Positions) -> Positions {
    Positions { x: x.x.iter().map(|x| -x).collect(), y: x.y.clone() }
}
