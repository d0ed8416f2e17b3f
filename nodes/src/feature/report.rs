//! What a feature-aware warp tells of itself.

use serde_json::{Value, json};
use warploom_algo::feature::FeatureFit;
use warploom_algo::feature::guard::{Guarded, How, Obstacle};
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
pub(super) fn guarded(guarded: &Guarded, grid: &Grid) -> Value {
    let mut report = json!({
        "how": match guarded.how {
            How::Literal => "literal",
            How::Shrunk { .. } => "shrunk",
            How::Bent { .. } => "bent",
            How::Kept => "kept",
        },
        "reached": guarded.reached,
        "floor": guarded.floor,
        "literal_folds": guarded.literal_folds,
    });
    match guarded.how {
        How::Shrunk { factor } => report["factor"] = factor.into(),
        How::Bent { steps } => report["steps"] = steps.into(),
        How::Literal | How::Kept => {}
    }
    if guarded.mirrored {
        report["mirrored"] = true.into();
    }
    if !guarded.obstacles.is_empty() {
        report["obstacles"] = guarded.obstacles.iter().map(|found| obstacle(found, grid)).collect();
    }
    report
}

/// Why no warp could do without folds, in words.
fn obstacle(obstacle: &Obstacle, grid: &Grid) -> Value {
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
            format!("in single precision the lattice ({}) is too fine to be free of folds", described(grid))
        }
    };
    text.into()
}
