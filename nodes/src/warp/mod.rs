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
pub use perspective::Perspective;
pub use ripple::Ripple;
pub use stretch::Stretch;
pub use swirl::Swirl;
pub use turbulence::Turbulence;
pub use wave::Wave;

use warploom_algo::lattice::{Lattice, Positions};
use warploom_algo::warp::certify;
use warploom_algo::{Interrupted, Watch};
use warploom_core::node::{Context, NodeError, Output, Outputs};
use warploom_core::value::{Direction, Grid, Kind, Warp};

use crate::adapt::watched;

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
    derived(cx, grid, Direction::DstFromSrc, positions)
}

/// A warp with the certificate of its positions, whichever way they point, in the stats.
pub(crate) fn derived(
    cx: &Context,
    grid: &Grid,
    direction: Direction,
    positions: Positions,
) -> Result<Outputs, NodeError> {
    let certificate = watched(cx, |watch| certify(&crate::adapt::lattice(grid), &positions, watch))?;
    let warp = Warp { grid: *grid, direction, x: positions.x.into(), y: positions.y.into() };
    Ok(Outputs::from(warp)
        .stat("min_jacobian", certificate.min_jacobian)
        .stat("min_jacobian_cell", certificate.at_cell.to_vec())
        .stat("folds", certificate.folds))
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
