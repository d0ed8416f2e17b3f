//! Warps that are dragged by handles (Gal, Sorkine, Cohen-Or 2006, section 3).

mod factor;
mod warp;

pub use factor::HandleFactor;
pub use warp::Handles;

use warploom_algo::Interrupted;
use warploom_algo::handles::Error;
use warploom_core::node::{ErrorClass, NodeError};

use crate::adapt::AtWork;

/// Why the solver gave nothing; what the handles are to blame for is told before.
fn refusal(error: Error, at_work: AtWork) -> NodeError {
    match error {
        Error::Interrupted => at_work.error(Interrupted),
        Error::TooLarge | Error::OutOfMemory => {
            NodeError::new(ErrorClass::OverBudget, "the lattice is too large for the solver").hint("use larger cells")
        }
        Error::Overflow => {
            NodeError::refused("the targets lie so far away that positions overflow").hint("move them nearer")
        }
        Error::Inaccurate { residual } => NodeError::refused(format!("the factor's relative residual is {residual:e}"))
            .hint("use cells that are nearer to squares"),
        other => NodeError::refused(format!("the system cannot be solved in double precision: {other:?}"))
            .hint("use cells that are nearer to squares, or fewer handles"),
    }
}
