//! Warps that keep masked features in shape (Gal, Sorkine, Cohen-Or 2006).

mod factor;
mod warp;

pub use factor::FeatureFactor;
pub use warp::FeatureWarp;

use warploom_algo::{Interrupted, feature, poisson};
use warploom_core::node::{ErrorClass, NodeError};

use crate::adapt::AtWork;

fn refusal(error: feature::Error, at_work: AtWork) -> NodeError {
    use poisson::Error as Solver;
    match error {
        feature::Error::NotFinite { column, row } => {
            let message = format!("the warp's node at column {column}, row {row} is not finite");
            NodeError::refused(message).at("warp").hint("look at what feeds it; all positions must be numbers")
        }
        feature::Error::Poisson(Solver::Interrupted) => at_work.error(Interrupted),
        feature::Error::Poisson(Solver::TooLarge | Solver::OutOfMemory) => {
            NodeError::new(ErrorClass::OverBudget, "the lattice is too large for the solver").hint("use larger cells")
        }
        feature::Error::Poisson(Solver::NotPositiveDefinite) => {
            NodeError::refused("the system is not positive definite in double precision").hint("use a smaller weight")
        }
        feature::Error::Poisson(Solver::Inaccurate { residual }) => {
            NodeError::refused(format!("the solution's relative residual is {residual:e}")).hint("use a smaller weight")
        }
    }
}
