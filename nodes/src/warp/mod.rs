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
use warploom_core::node::{Context, NodeError, Output, Outputs};
use warploom_core::value::{Direction, Grid, Kind, Warp};

const WARP: &[Output] = &[Output::new("warp", Kind::Warp)];

/// The lattice to warp, once there is room for its positions.
fn lattice(cx: &Context, grid: &Grid) -> Result<Lattice, NodeError> {
    cx.reserve(grid.node_count() as u128 * size_of::<[f64; 2]>() as u128)?;
    Ok(crate::adapt::lattice(grid))
}

/// A forward warp with its certificate in the stats.
pub(crate) fn certified(grid: &Grid, positions: Positions) -> Outputs {
    let certificate = certify(&crate::adapt::lattice(grid), &positions);
    let warp = Warp { grid: *grid, direction: Direction::DstFromSrc, x: positions.x.into(), y: positions.y.into() };
    Outputs::from(warp)
        .stat("min_jacobian", certificate.min_jacobian)
        .stat("min_jacobian_cell", certificate.at_cell.to_vec())
        .stat("folds", certificate.folds)
}
