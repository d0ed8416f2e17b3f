//! Warps that keep masked features in shape (Gal, Sorkine, Cohen-Or 2006).

mod factor;
mod report;
mod warp;

pub use factor::FeatureFactor;
pub use warp::FeatureWarp;

use warploom_algo::{Interrupted, feature, poisson};
use warploom_core::node::NodeError;
use warploom_core::value::Grid;

use crate::adapt::{AtWork, too_large};

/// What a FeatureFactor hands to a FeatureWarp.
struct Prepared {
    factor: feature::FeatureFactor,
    /// Labels of all features, rising; some may have no cells.
    labels: Vec<u32>,
}

/// Refuses overrides of labels that no feature has, and several for one label.
fn check_labels(wanted: impl Iterator<Item = u32>, known: &[u32]) -> Result<(), NodeError> {
    let wanted: Vec<u32> = wanted.collect();
    for (number, label) in wanted.iter().enumerate() {
        if known.binary_search(label).is_err() {
            let message = format!("there is no feature with the label {label}; there are {}", listed(known));
            return Err(NodeError::refused(message).at("overrides").hint("override labels that are there"));
        }
        if wanted[..number].contains(label) {
            let message = format!("label {label} is overridden twice");
            return Err(NodeError::refused(message).at("overrides").hint("put all of it into one override"));
        }
    }
    Ok(())
}

/// Labels in words, the first of them if there are many.
fn listed(labels: &[u32]) -> String {
    const SHOWN: usize = 20;
    let names: Vec<String> = labels.iter().take(SHOWN).map(u32::to_string).collect();
    match labels.len() {
        0 => "none".into(),
        count if count > SHOWN => format!("{count}, the first {}", names.join(", ")),
        _ => names.join(", "),
    }
}

fn refusal(error: feature::Error, grid: &Grid, at_work: AtWork) -> NodeError {
    use poisson::Error as Solver;
    match error {
        feature::Error::NotFinite { column, row } => {
            let message = format!("the warp's node at column {column}, row {row} is not finite");
            NodeError::refused(message).at("warp").hint("look at what feeds it; all positions must be numbers")
        }
        feature::Error::NoPins => NodeError::refused("features cover the whole border, and nothing holds the picture")
            .hint("use boundary: Pin in the factor and on_conflict: NoFold in the warp, or a smaller feature"),
        feature::Error::Poisson(Solver::Interrupted) => at_work.error(Interrupted),
        feature::Error::Poisson(Solver::TooLarge | Solver::OutOfMemory) => too_large(grid),
        feature::Error::Poisson(Solver::NotPositiveDefinite) => {
            NodeError::refused("the system is not positive definite in double precision").hint("use a smaller weight")
        }
        feature::Error::Poisson(Solver::Inaccurate { residual }) => {
            let message =
                format!("in double precision the solution keeps a relative residual of {residual:e}, too large");
            NodeError::refused(message).hint("use a smaller weight")
        }
    }
}
