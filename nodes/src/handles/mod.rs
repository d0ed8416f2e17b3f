//! Warps that are dragged by handles (Gal, Sorkine, Cohen-Or 2006, section 3).

mod factor;
mod warp;

pub use factor::HandleFactor;
pub use warp::Handles;

use warploom_algo::Interrupted;
use warploom_algo::handles::Error;
use warploom_core::node::NodeError;
use warploom_core::value::Grid;

use crate::adapt::{AtWork, described, too_large};

/// Why the solver gave nothing; what the handles are to blame for is told before.
fn refusal(error: Error, grid: &Grid, at_work: AtWork) -> NodeError {
    let squarer = "use cells that are nearer to squares, or fewer handles";
    match error {
        Error::Interrupted => at_work.error(Interrupted),
        Error::TooLarge | Error::OutOfMemory => too_large(grid),
        Error::Overflow => {
            NodeError::refused("the targets lie so far away that positions overflow").hint("move them nearer")
        }
        Error::Inaccurate { residual } => {
            let message =
                format!("in double precision the solution keeps a relative residual of {residual:e}, too large");
            NodeError::refused(message).hint(squarer)
        }
        Error::NotPositiveDefinite => {
            let message = format!(
                "of the lattice ({}), the system is not positive definite in double precision",
                described(grid)
            );
            NodeError::refused(message).hint(squarer)
        }
        Error::NotFinite { .. } | Error::Outside { .. } | Error::Contradiction { .. } => {
            unreachable!("{error:?} is told with the handle's name")
        }
    }
}
