//! Warps that follow handles: points and curves are dragged, the rest of the lattice keeps its shape as well as it can.
//!
//! The interactive mode of Gal, Sorkine and Cohen-Or, "Feature-aware texturing", 2006, section 3. Positions are complex
//! numbers z = x + i y, so a similarity of the plane is linear, z -> a z + b, and how far a cell is from one is a
//! Hermitian form of its corners. [`factor`] once per lattice. A [`drag`] prepares a set of handles once, whatever their
//! targets: these are added by a bordered system, not by factoring again. What it prepared serves the next one.
//!
//! What is solved for is the displacement from rest, so handles that stay where they are leave the lattice as it is.

mod cholesky;
mod constrained;
mod curve;
mod energy;
mod rows;

#[cfg(test)]
mod tests;

pub use curve::{along, side};

use crate::lattice::{Lattice, Positions};
use crate::room::Room;
use crate::{Interrupted, Watch};
use cholesky::Factor;
use constrained::{Constrained, Prepared, Solution};
use energy::{Number, corners, dirichlet, similarity, square};
use faer::sparse::FaerError;
use faer::{Mat, c64};
use rows::{Row, rows};

/// A cell turns by no angle where its linear part is below this share of its size.
const NO_TURN: f64 = 1e-9;

/// A point of a lattice, and where it is to go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Handle {
    /// The point, px, on the lattice.
    pub from: [f64; 2],
    /// Its target, px, anywhere.
    pub to: [f64; 2],
}

/// A side of a lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The first row of nodes.
    Top,
    /// The last column.
    Right,
    /// The last row.
    Bottom,
    /// The first column.
    Left,
}

/// What cells keep as well as they can.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Their shape.
    Similarity,
    /// Their shape and size.
    Rigid,
}

/// Why there is no factor or no warp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Error {
    /// The watch stopped it.
    Interrupted,
    /// The factor needs more entries than its index type counts.
    TooLarge,
    /// The memory for the factor or for a solution was refused.
    OutOfMemory,
    /// Rounding took the system's definiteness.
    NotPositiveDefinite,
    /// What was found for a system, or for the probe of a factor, does not solve it, however often it was refined.
    Inaccurate {
        /// Its relative residual.
        residual: f64,
    },
    /// A handle's or a curve's point lies outside the lattice.
    Outside {
        /// Index of the handle, or of the curve's corner.
        index: usize,
    },
    /// A target is not finite.
    NotFinite {
        /// Index of the handle.
        index: usize,
    },
    /// Two handles on one place have different targets.
    Contradiction {
        /// Index of one handle.
        first: usize,
        /// Index of the other, larger.
        second: usize,
    },
    /// The targets are so far away that positions overflow.
    Overflow,
}

impl From<Interrupted> for Error {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

impl From<FaerError> for Error {
    fn from(error: FaerError) -> Self {
        match error {
            FaerError::IndexOverflow => Self::TooLarge,
            _ => Self::OutOfMemory,
        }
    }
}

/// A lattice prepared for handles.
#[derive(Debug)]
pub struct HandleFactor {
    lattice: Lattice,
    similarity: Factor<c64>,
    rigid: Factor<f64>,
}

/// Handles prepared for a lattice, wherever they are dragged to.
#[derive(Debug)]
pub struct Held {
    from: Vec<[f64; 2]>,
    mode: Mode,
    /// None if fewer than two places are held: then there is nothing to solve.
    similar: Option<Prepared<c64>>,
    /// Of [`Mode::Rigid`].
    rigid: Option<Prepared<f64>>,
}

/// A warp that follows handles.
#[derive(Clone, Debug, PartialEq)]
pub struct HandleWarp {
    /// Where the nodes go, px.
    pub positions: Positions,
    /// Relative residual of the normal equations: |b - A x| over |b| + |A| |x|, largest entries.
    pub residual: f64,
    /// Handles on different places.
    pub constraints: usize,
    /// Those of them that do not depend on others. Fewer than all: least squares.
    pub rank: usize,
    /// The largest distance of a handle from its target, px.
    pub largest_miss: f64,
}

/// Prepares a lattice for handles.
///
/// Two matrices over all N nodes are factored, in the order of a nested dissection, and each is probed:
/// * complex, for `sum over cells of |(I - G G^+) z_Q|^2`, G = [1, v_Q] with v the corners at rest: how far cells are
///   from similarities. Its null space is that of all similarities, 1 and v, so two nodes are pinned;
/// * real, for Dirichlet's energy, with one node pinned: it sets rotated cells together.
///
/// * `lattice`: at least 2 x 2 nodes.
/// * `watch`: called between the phases; a phase runs to its end. Asked for all memory.
///
/// One thread, so the bits do not depend on the thread count. Time O(N^1.5), memory O(N log N).
///
/// Section 3 with T. Igarashi, T. Moscovich, J. F. Hughes, "As-rigid-as-possible shape manipulation", 2005.
pub fn factor(lattice: &Lattice, watch: Watch) -> Result<HandleFactor, Error> {
    assert!(lattice.cells().iter().all(|&cells| cells > 0), "{lattice:?} has no cells");
    // Inside, a pinned node gives less than at a corner.
    let pin = |quarters: usize| {
        let [column, row] = lattice.nodes.map(|count| count * quarters / 4);
        row * lattice.nodes[0] + column
    };
    watch.progress(0.0)?;
    let mut room = Room::new(watch);
    let similarity = Factor::new(similarity(lattice), vec![pin(1), pin(3)], 0, &mut room, watch)?;
    watch.progress(0.7)?;
    let rigid = Factor::new(dirichlet(lattice), vec![pin(2)], similarity.bytes(), &mut room, watch)?;
    Ok(HandleFactor { lattice: *lattice, similarity, rigid })
}

impl HandleFactor {
    /// Count of unknowns: nodes.
    pub fn unknowns(&self) -> usize {
        self.lattice.node_count()
    }

    /// Bytes held, approximately.
    pub fn bytes(&self) -> usize {
        self.similarity.bytes() + self.rigid.bytes()
    }
}

/// Of a factor's bytes the responses of the nodes to each handle may take one in so many to be kept; with more they are
/// solved for at each drag.
const RESPONSES: usize = 2;

/// Prepares handles, whatever their targets: `S = C K C^*` is factored, K the inverse of the lattice's matrix and
/// `C z = c` the handles' equations, and of few handles the columns of `K C^*` are kept: then a drag is a sum of these.
fn hold(factor: &HandleFactor, handles: &[Handle], mode: Mode, room: &mut Room, watch: Watch) -> Result<Held, Error> {
    let rows = rows(&factor.lattice, handles)?;
    let mut held = Held { from: handles.iter().map(|handle| handle.from).collect(), mode, similar: None, rigid: None };
    if rows.len() < 2 {
        return Ok(held);
    }
    let most = factor.similarity.bytes() / RESPONSES;
    let similar = Prepared::new(&factor.similarity, &rows, &similar_kernel(factor, &rows), most, 0, room, watch)?;
    if mode == Mode::Rigid {
        let (most, before) = (factor.rigid.bytes() / RESPONSES, similar.bytes());
        held.rigid = Some(Prepared::new(&factor.rigid, &rows, &rigid_kernel(), most, before, room, watch)?);
    }
    held.similar = Some(similar);
    Ok(held)
}

impl Held {
    /// Whether it was made for handles at the same places, in the same order and mode.
    pub fn holds(&self, handles: &[Handle], mode: Mode) -> bool {
        self.mode == mode && self.from.iter().eq(handles.iter().map(|handle| &handle.from))
    }

    /// Bytes held, approximately.
    pub fn bytes(&self) -> usize {
        let prepared =
            self.similar.as_ref().map_or(0, Prepared::bytes) + self.rigid.as_ref().map_or(0, Prepared::bytes);
        prepared + self.from.len() * size_of::<[f64; 2]>()
    }
}

/// The warp that takes handles to their targets and changes the lattice least.
///
/// `Similarity` minimises `sum over cells of |(I - G G^+) z_Q|^2` under `sum of n_k z_k = c` for every handle, n the
/// bilinear weights of its cell's corners. `Rigid` goes on from there: R_Q is the rotation of the similarity that fits
/// cell Q best, and `sum over cells and their edges e = (p, q) of c_e |z_q - z_p - R_Q (v_q - v_p)|^2` is minimised
/// under the same constraints, c = hy / hx along x and hx / hy along y.
///
/// * `kept`: what an earlier drag of this factor prepared. It serves if its handles were at the same places, in the same
///   order and mode; the bits are those of a drag without it.
/// * `handles`: the places and their targets; see [`along`] and [`side`] for curves.
/// * `mode`: what cells are to keep.
/// * `watch`: called between the phases. Asked for all memory, `kept` aside.
///
/// Returns what it prepared as well, if `kept` did not serve.
///
/// Without handles the lattice stays at rest, one handle moves it as a whole, two give exactly the similarity through
/// them (`Similarity`). Handles that imply a similarity (in `Rigid`, a rigid motion) give it. Handles on one place
/// with one target count once; with two they are refused. Handles that depend on each other, three in a row in one
/// cell for instance, are met as well as they can be in the least squares sense.
///
/// k handles on N nodes cost O(k N) if `kept` has their responses, else a solve, O(N log N + k^2); `Rigid` twice that
/// and one more solve. Refined while the relative residual is above 1e-12. What is prepared costs
/// O(k N^0.5 log N + k^2 N^0.5 + k^3), a dense matrix of k x k, and a solve for each of few handles.
pub fn drag(
    factor: &HandleFactor,
    kept: Option<&Held>,
    handles: &[Handle],
    mode: Mode,
    watch: Watch,
) -> Result<(HandleWarp, Option<Held>), Error> {
    let mut room = Room::new(watch);
    if let Some(held) = kept.filter(|held| held.holds(handles, mode)) {
        return Ok((solve(factor, held, handles, &mut room, watch)?, None));
    }
    let held = hold(factor, handles, mode, &mut room, watch)?;
    room.keep(held.bytes());
    Ok((solve(factor, &held, handles, &mut room, watch)?, Some(held)))
}

/// The warp, of handles that are held.
fn solve(
    factor: &HandleFactor,
    held: &Held,
    handles: &[Handle],
    room: &mut Room,
    watch: Watch,
) -> Result<HandleWarp, Error> {
    let lattice = &factor.lattice;
    let rows = rows(lattice, handles)?;
    assert!(held.holds(handles, held.mode), "the handles are held at other places");
    let field = lattice.node_count() * size_of::<c64>();
    // At the end the displacement and the positions.
    room.phase(2 * field)?;
    let (mut residual, mut rank) = (0.0, rows.len());
    let moved = match (&rows[..], &held.similar) {
        (rows, Some(prepared)) => {
            let mut solution = similar(factor, rows, prepared, room, watch)?;
            if let Some(prepared) = &held.rigid {
                watch.progress(0.5)?;
                let rigid = made_rigid(factor, rows, prepared, &solution.fields, room, watch)?;
                (solution.residual, solution.rank) = (solution.residual.max(rigid.residual), rigid.rank);
                let step = |node| c64::new(rigid.fields[(node, 0)], rigid.fields[(node, 1)]);
                let fields = solution.fields.col_as_slice_mut(0);
                fields.iter_mut().enumerate().for_each(|(node, value)| *value += step(node));
            }
            (residual, rank) = (solution.residual, solution.rank);
            solution.fields
        }
        ([Row { by: [x, y], .. }], None) => Mat::from_fn(lattice.node_count(), 1, |_, _| c64::new(*x, *y)),
        (_, None) => Mat::zeros(lattice.node_count(), 1),
    };
    let moved = moved.col_as_slice(0);
    let positions = displaced(lattice, moved);
    if !positions.x.iter().chain(&positions.y).all(|value| value.is_finite()) {
        return Err(Error::Overflow);
    }
    let miss = |row: &Row| {
        let there = row.pulls().fold(c64::ZERO, |sum, (node, weight)| sum + moved[node] * weight);
        (there - c64::new(row.by[0], row.by[1])).modulus()
    };
    let largest_miss = rows.iter().map(miss).fold(0.0, f64::max);
    Ok(HandleWarp { positions, residual, constraints: rows.len(), rank, largest_miss })
}

/// What the similarity's energy does not see: 1, and the place relative to the handles.
fn similar_kernel(factor: &HandleFactor, rows: &[Row]) -> [Box<dyn Fn(usize) -> c64 + Sync>; 2] {
    let ((centre, size), lattice) = (spread(rows), factor.lattice);
    let rest = move |node: usize| {
        let [x, y] = lattice.rest(node % lattice.nodes[0], node / lattice.nodes[0]);
        (c64::new(x, y) - centre) / size
    };
    [Box::new(|_| c64::ONE), Box::new(rest)]
}

/// What Dirichlet's energy does not see.
fn rigid_kernel() -> [Box<dyn Fn(usize) -> f64 + Sync>; 1] {
    [Box::new(|_| 1.0)]
}

/// The displacement as similar as possible.
fn similar(
    factor: &HandleFactor,
    rows: &[Row],
    prepared: &Prepared<c64>,
    room: &mut Room,
    watch: Watch,
) -> Result<Solution<c64>, Error> {
    let moves = Mat::from_fn(rows.len(), 1, |row, _| c64::new(rows[row].by[0], rows[row].by[1]));
    let kernel = similar_kernel(factor, rows);
    let constrained = Constrained { factor: &factor.similarity, rows, kernel: &kernel, prepared };
    room.phase(constrained.bytes())?;
    constrained.solve(None, &moves, 0.0, watch)
}

/// What is to be added to a displacement so that cells keep their size: they turn as they did.
fn made_rigid(
    factor: &HandleFactor,
    rows: &[Row],
    prepared: &Prepared<f64>,
    moved: &Mat<c64>,
    room: &mut Room,
    watch: Watch,
) -> Result<Solution<f64>, Error> {
    let (lattice, moved) = (&factor.lattice, moved.col_as_slice(0));
    let n = lattice.node_count();
    let unit = corners(lattice);
    let (size, scale) = (square(&unit), lattice.spacing[0].max(lattice.spacing[1]));
    // By how much the rotation of a cell moves its corners more than the displacement does.
    let asked = |nodes: [usize; 4]| {
        let d = nodes.map(|node| moved[node]);
        let linear = unit.iter().zip(d).fold(c64::ZERO, |sum, (u, d)| sum + u.conj() * d) / (size * scale);
        let (linear, length) = (linear + c64::ONE, (linear + c64::ONE).modulus());
        let turn = if length > NO_TURN { linear / length } else { c64::ONE };
        std::array::from_fn(|k| (turn - c64::ONE) * unit[k] * scale - d[k])
    };
    // The displacement and the loads.
    let before = 2 * n * size_of::<c64>();
    let kernel = rigid_kernel();
    let constrained = Constrained { factor: &factor.rigid, rows, kernel: &kernel, prepared };
    room.phase(before + constrained.bytes())?;
    let mut loads = Mat::zeros(n, 2);
    let energy = &factor.rigid.energy;
    energy.add_gradients(loads.col_as_slice_mut(0), |nodes| asked(nodes).map(|step: c64| step.re));
    energy.add_gradients(loads.col_as_slice_mut(1), |nodes| asked(nodes).map(|step: c64| step.im));
    let (held, furthest) = (Mat::zeros(rows.len(), 2), moved.iter().map(|d| d.modulus()).fold(0.0, f64::max));
    constrained.solve(Some(&loads), &held, furthest, watch)
}

/// Middle of the handles, and their mean distance from it.
fn spread(rows: &[Row]) -> (c64, f64) {
    let at = |row: &Row| c64::new(row.at[0], row.at[1]);
    let count = rows.len() as f64;
    let centre = rows.iter().fold(c64::ZERO, |sum, row| sum + at(row)) / count;
    (centre, rows.iter().map(|row| (at(row) - centre).modulus()).sum::<f64>() / count)
}

fn displaced(lattice: &Lattice, moved: &[c64]) -> Positions {
    let columns = lattice.nodes[0];
    let rest = |node: usize| lattice.rest(node % columns, node / columns);
    let at = |axis: usize| moved.iter().enumerate().map(move |(node, d)| rest(node)[axis] + [d.re, d.im][axis]);
    Positions { x: at(0).collect(), y: at(1).collect() }
}
