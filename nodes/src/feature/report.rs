//! What a feature-aware warp tells of itself.

use serde_json::{Value, json};
use warploom_algo::feature::FeatureFit;
use warploom_algo::feature::guard::{How, Obstacle, Verdict};
use warploom_algo::lattice::Positions;
use warploom_core::value::Grid;

use crate::adapt::described;

/// What became of a feature.
pub(super) fn component(fit: &FeatureFit) -> Value {
    let mut row = json!({
        "label": fit.label,
        "deviation_cells": fit.deviation_cells,
        "scale": fit.scale,
        "rotation_deg": fit.rotation_deg,
    });
    if fit.mirrored {
        row["mirrored"] = true.into();
    }
    row
}

/// What the guard found and did.
pub(super) fn guarded(verdict: &Verdict, grid: &Grid, positions: &Positions) -> Value {
    let mut report = json!({
        "how": match verdict.how {
            How::Literal => "literal",
            How::Shrunk { .. } => "shrunk",
            How::Bent { .. } => "bent",
            How::Kept => "kept",
        },
        "reached": verdict.reached,
        "floor": verdict.floor,
        "literal_folds": verdict.literal_folds,
    });
    match verdict.how {
        How::Shrunk { factor } => report["factor"] = factor.into(),
        How::Bent { steps } => report["steps"] = steps.into(),
        How::Literal | How::Kept => {}
    }
    if verdict.mirrored {
        report["mirrored"] = true.into();
    }
    if !verdict.obstacles.is_empty() {
        report["obstacles"] = verdict.obstacles.iter().map(|found| obstacle(found, grid, positions)).collect();
    }
    report
}

/// What is to be said of a guard that did not reach its floor, as it is `told` in the stats.
pub(super) fn unreached(verdict: &Verdict, told: &Value) -> Option<String> {
    let Verdict { reached, folds, min_jacobian, at_cell: [column, row], floor, .. } = *verdict;
    if reached {
        return None;
    }
    let what = match folds {
        0 => format!("the warp all but folds, with a Jacobian of {min_jacobian:e} and not {floor:e}"),
        _ => format!("the warp still folds in {folds} cells"),
    };
    let why = match told["obstacles"][0].as_str() {
        Some(first) => first.to_owned(),
        None => format!("most at column {column}, row {row}"),
    };
    Some(format!("{what}: {why}"))
}

/// Why no warp could do without folds, in words.
fn obstacle(obstacle: &Obstacle, grid: &Grid, positions: &Positions) -> Value {
    let place = |[column, row]: [usize; 2]| format!("column {column}, row {row}");
    let text = match *obstacle {
        Obstacle::BoundaryCrosses { nodes: [first, second] } => {
            format!("the border crosses or touches itself, after the nodes at {} and {}", place(first), place(second))
        }
        Obstacle::PinnedCorner { node, jacobian, count } => {
            format!("{count} corners are held folded, the first at {} with the Jacobian {jacobian:e}", place(node))
        }
        Obstacle::CollapsedEdge { nodes: [first, second] } => {
            format!("the nodes at {} and {} are held in one place", place(first), place(second))
        }
        Obstacle::SinglePrecision => {
            let far = positions.x.iter().chain(&positions.y).fold(0.0, |far: f64, at| far.max(at.abs())) as f32;
            let step = far.next_up() - far;
            format!(
                "rounded to single precision it folds: at {far} px from the origin positions are {step} px apart, and \
                 the lattice is {}",
                described(grid)
            )
        }
    };
    text.into()
}
