//! Predefined warps: where each lattice node goes.

mod affine;
mod arc;
mod stretch;
mod swirl;
mod wave;

pub use affine::Affine;
pub use arc::Arc;
pub use stretch::Stretch;
pub use swirl::Swirl;
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
    let certificate = watched(cx, |watch| certify(&crate::adapt::lattice(grid), &positions, watch))?;
    let warp = Warp { grid: *grid, direction: Direction::DstFromSrc, x: positions.x.into(), y: positions.y.into() };
    Ok(Outputs::from(warp)
        .stat("min_jacobian", certificate.min_jacobian)
        .stat("min_jacobian_cell", certificate.at_cell.to_vec())
        .stat("folds", certificate.folds))
}
