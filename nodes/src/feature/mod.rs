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

/// Refuses several overrides for one label.
fn once_each(mut labels: Vec<u32>) -> Result<(), NodeError> {
    labels.sort_unstable();
    let Some(pair) = labels.windows(2).find(|pair| pair[0] == pair[1]) else { return Ok(()) };
    let message = format!("label {} is overridden twice", pair[0]);
    Err(NodeError::refused(message).at("overrides").hint("put all of it into one override"))
}

/// Refuses overrides of labels that no feature has.
fn check_labels(mut wanted: impl Iterator<Item = u32>, known: &[u32]) -> Result<(), NodeError> {
    let Some(label) = wanted.find(|label| known.binary_search(label).is_err()) else { return Ok(()) };
    let message = format!("there is no feature with the label {label}; {}", listed(known));
    Err(NodeError::refused(message).at("overrides").hint("override labels that are there"))
}

/// The labels of all features in words.
fn listed(labels: &[u32]) -> String {
    let numbers = numbers(labels);
    match labels.len() {
        0 => "there are none".into(),
        1 => format!("the one feature has the label {numbers}"),
        2..=SHOWN => format!("the features have the labels {numbers}"),
        count => format!("the {count} features have the labels {numbers}"),
    }
}

/// So many labels are shown at most.
const SHOWN: usize = 20;

/// Labels, rising; the first of them if there are many.
fn numbers(labels: &[u32]) -> String {
    let named = |labels: &[u32]| labels.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    match labels {
        [] | [_] => named(labels),
        [first, .., last] if labels.len() > 2 && (last - first) as usize + 1 == labels.len() => {
            format!("{first} to {last}")
        }
        many if many.len() > SHOWN => format!("{}, ..", named(&many[..SHOWN])),
        [others @ .., last] => format!("{} and {last}", named(others)),
    }
}

/// What keeps a feature-aware warp from being made; `mend` says what to do where nothing holds the picture.
fn refusal(error: feature::Error, mend: &str, grid: &Grid, at_work: AtWork) -> NodeError {
    use poisson::Error as Solver;
    match error {
        feature::Error::NotFinite { column, row } => {
            let message = format!("the warp's node at column {column}, row {row} is not finite");
            NodeError::refused(message).at("warp").hint("look at what feeds it; all positions must be numbers")
        }
        feature::Error::NoPins => {
            NodeError::refused("features cover the whole border, and nothing holds the picture").hint(mend)
        }
        feature::Error::Contradiction { labels: [first, second], scales } => {
            let [one, other] = scales.map(|scale| scale.map_or("the warp's".into(), |scale| scale.to_string()));
            NodeError::refused(format!(
                "labels {first} and {second} touch and are one; their overrides differ: scale {one} and {other}"
            ))
            .at("overrides")
            .hint("give both one override, or leave a cell between them")
        }
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

#[cfg(test)]
mod tests {
    use super::listed;

    #[test]
    fn labels_are_told_in_words() {
        for (labels, words) in [
            (vec![], "there are none"),
            (vec![3], "the one feature has the label 3"),
            (vec![1, 2], "the features have the labels 1 and 2"),
            ((1..8).collect(), "the features have the labels 1 to 7"),
            (vec![1, 3, 9], "the features have the labels 1, 3 and 9"),
            ((1..31).collect(), "the 30 features have the labels 1 to 30"),
        ] {
            assert_eq!(listed(&labels), words);
        }
        let odd: Vec<u32> = (0..30).map(|index| 2 * index + 1).collect();
        assert!(listed(&odd).starts_with("the 30 features have the labels 1, 3, 5,"), "{}", listed(&odd));
        assert!(listed(&odd).ends_with("37, 39, .."), "{}", listed(&odd));
    }
}
