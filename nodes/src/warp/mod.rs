//! Predefined warps: where each lattice node goes; and warps made of warps.

mod affine;
mod arc;
mod bends;
mod bezier_envelope;
mod blend;
mod compose;
mod free_lattice;
mod invert;
mod lens;
mod magnify;
mod perspective;
mod ripple;
mod stretch;
mod swirl;
mod turbulence;
mod wave;

pub use affine::Affine;
pub use arc::Arc;
pub use bends::{
    ArcLower, ArcUpper, Arch, Bulge, Fish, Fisheye, Flag, Inflate, Rise, ShellLower, ShellUpper, Squeeze, Twist,
};
pub use bezier_envelope::BezierEnvelope;
pub use blend::Blend;
pub use compose::Compose;
pub use free_lattice::{FreeLattice, Given};
pub use invert::{Gives, Invert};
pub use lens::Lens;
pub use magnify::Magnify;
pub use perspective::Perspective;
pub use ripple::Ripple;
pub use stretch::Stretch;
pub use swirl::Swirl;
pub use turbulence::Turbulence;
pub use wave::Wave;

use warploom_algo::lattice::{Lattice, Positions};
use warploom_algo::warp::{InvertError, certify, refuse_folds};
use warploom_algo::{Interrupted, Watch};
use warploom_core::node::{Context, NodeError, Output, Outputs};
use warploom_core::value::{Direction, Grid, Kind, Warp};

use crate::adapt::{point, watch, watched};

pub(crate) const WARP: &[Output] = &[Output::new("warp", Kind::Warp)];

/// The lattice to warp, once there is room for its positions.
fn lattice(cx: &Context, grid: &Grid) -> Result<Lattice, NodeError> {
    cx.reserve(grid.node_count() as u128 * size_of::<[f64; 2]>() as u128)?;
    Ok(crate::adapt::lattice(grid))
}

/// The warp that `map` makes of a lattice.
fn warped(
    cx: &Context,
    grid: &Grid,
    map: impl FnOnce(&Lattice, Watch) -> Result<Positions, Interrupted>,
) -> Result<Outputs, NodeError> {
    let lattice = lattice(cx, grid)?;
    let positions = watched(cx, |watch| map(&lattice, watch))?;
    certified(cx, grid, positions)
}

/// A forward warp with its certificate in the stats.
pub(crate) fn certified(cx: &Context, grid: &Grid, positions: Positions) -> Result<Outputs, NodeError> {
    derived(cx, grid, Direction::DstFromSrc, positions, Holes::None)
}

/// Whether nodes of a warp may have no position, which is NaN.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Holes {
    /// All have one.
    None,
    /// A map that was read has holes, and so has what is made of it.
    Kept,
}

impl Holes {
    /// Those of a warp that is made of these.
    fn of<'a>(warps: impl IntoIterator<Item = &'a Warp>) -> Self {
        let has_holes = warps.into_iter().any(|warp| warp.x.iter().any(|x| x.is_nan()));
        if has_holes { Self::Kept } else { Self::None }
    }
}

/// A warp with the certificate of its positions, whichever way they point, in the stats.
pub(crate) fn derived(
    cx: &Context,
    grid: &Grid,
    direction: Direction,
    positions: Positions,
    holes: Holes,
) -> Result<Outputs, NodeError> {
    check_reach(grid, &positions, holes)?;
    let lattice = crate::adapt::lattice(grid);
    let certificate = watched(cx, |watch| certify(&lattice, &positions, watch))?;
    let [columns, rows] = lattice.cells();
    let mirrored = certificate.folds == columns * rows && is_mirrored(cx, &lattice, &positions)?;
    let warp = Warp { grid: *grid, direction, x: positions.x.into(), y: positions.y.into() };
    let outputs = Outputs::from(warp)
        .stat("min_jacobian", certificate.min_jacobian)
        .stat("min_jacobian_cell", certificate.at_cell.to_vec())
        .stat("folds", certificate.folds);
    Ok(if mirrored { outputs.stat("mirrored", true) } else { outputs })
}

/// Farthest from the origin that a warp takes a node, px.
const REACH: f64 = 2_147_483_648.0;

/// Refuses positions that are no numbers, unless they may be, or too far away to be drawn.
fn check_reach(grid: &Grid, Positions { x, y }: &Positions, holes: Holes) -> Result<(), NodeError> {
    let is_within = |at: f64| at.abs() <= REACH || at.is_nan() && holes == Holes::Kept;
    let Some(node) = x.iter().zip(y).position(|(x, y)| !(is_within(*x) && is_within(*y))) else { return Ok(()) };
    let (place, to) = (place(grid, node), point([x[node], y[node]]));
    let message = format!("the warp takes the node at {place} to {to} px; positions reach to {REACH} px");
    Err(NodeError::refused(message).hint("make the warp weaker, or look at what feeds it"))
}

/// Whether a warp mirrors all of its cells and folds none.
fn is_mirrored(cx: &Context, lattice: &Lattice, positions: &Positions) -> Result<bool, NodeError> {
    let at_work = watch(cx);
    match refuse_folds(lattice, positions, &at_work) {
        Ok(()) => Ok(true),
        Err(InvertError::Folded { .. }) => Ok(false),
        Err(InvertError::Interrupted) => Err(at_work.error(Interrupted)),
    }
}

/// The column and row of a node, in words.
fn place(grid: &Grid, node: usize) -> String {
    format!("column {}, row {}", node % grid.nodes[0], node / grid.nodes[0])
}

/// Refuses a warp with nodes that have no position.
pub(crate) fn refuse_holes(warp: &Warp, port: &'static str) -> Result<(), NodeError> {
    let Some(first) = warp.x.iter().position(|x| x.is_nan()) else { return Ok(()) };
    let (count, all) = (warp.x.iter().filter(|x| x.is_nan()).count(), warp.grid.node_count());
    let place = place(&warp.grid, first);
    let message = format!("{count} of {all} nodes have no position (alpha 0), the first at {place}");
    let hint = "fill the map's holes, or take the numbers there as they are: LoadWarp(ignore_alpha: true)";
    Err(NodeError::refused(message).at(port).hint(hint))
}

/// Refuses two warps of which one says where pixels go and the other where they come from.
fn assert_alike(first: &Warp, second: &Warp, port: &'static str) -> Result<(), NodeError> {
    let says = |warp: &Warp| match warp.direction {
        Direction::DstFromSrc => "where pixels go",
        Direction::SrcFromDst => "where pixels come from",
    };
    if first.direction == second.direction {
        return Ok(());
    }
    let message = format!("it says {}, the other warp {}", says(second), says(first));
    Err(NodeError::refused(message).at(port).hint("turn one of them round with Invert(gives: OtherWay)"))
}
