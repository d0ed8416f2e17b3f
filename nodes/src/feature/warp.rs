use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use smart_default::SmartDefault;
use warploom_algo::feature;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Direction, Factor, Kind, Warp};

use crate::adapt::{positions, watch};

/// Makes a warp keep features in shape while the rest of the picture follows it (Gal, Sorkine, Cohen-Or 2006).
///
/// The lattice's border stays where the warp puts it.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureWarp {
    /// The warp to rectify; on the lattice that the factor was made for.
    pub warp: In<Warp>,
    /// The prepared solver.
    pub factor: In<Factor>,
    /// What a feature may do.
    pub mode: Mode,
}

/// What a feature may do.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Mode {
    /// Turn, and take one scale from the warp: where it stretches, the smaller of the two.
    #[default]
    Similarity,
    /// Turn, and keep its size.
    Rigid,
}

/// Bytes per lattice node beside the warp's positions and the solve: fluxes, the result, and what is held still.
const BYTES_PER_NODE: u128 = 56;

impl Node for FeatureWarp {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("warp", Kind::Warp)];
    const CPU_FAMILY: bool = true;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (warp, factor) = (cx.get(&self.warp), cx.get(&self.factor));
        let solver = factor.solver.downcast_ref::<feature::FeatureFactor>();
        let solver = solver.ok_or_else(|| NodeError::refused("the factor is another solver's").at("factor"))?;
        if warp.direction != Direction::DstFromSrc {
            return Err(NodeError::refused("the warp says where pixels come from, not where they go").at("warp"));
        }
        if warp.grid != factor.grid {
            let ([wc, wr], [fc, fr]) = (warp.grid.nodes, factor.grid.nodes);
            let message =
                format!("the warp is on another lattice ({wc} x {wr} nodes) than the factor ({fc} x {fr} nodes)");
            return Err(NodeError::refused(message).at("warp").hint("feed both from one Lattice"));
        }
        let mode = match self.mode {
            Mode::Similarity => feature::Mode::Similarity,
            Mode::Rigid => feature::Mode::Rigid,
        };
        cx.reserve(warp.grid.node_count() as u128 * BYTES_PER_NODE)?;
        let start = Instant::now();
        let input = positions(cx, &warp)?;
        let at_work = watch(cx);
        let prepared = feature::rhs(solver, &input, mode, &at_work).map(|rhs| (rhs, start.elapsed()));
        let solved = prepared.and_then(|(rhs, prepared)| Ok((feature::solve(solver, &rhs, &at_work)?, prepared)));
        let (solved, prepared) = solved.map_err(|error| super::refusal(error, at_work))?;
        let seconds = start.elapsed();
        let components: Vec<_> = (solved.features.iter())
            .map(|fit| {
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
            })
            .collect();
        Ok(crate::warp::certified(cx, &warp.grid, solved.positions)?
            .stat("unknowns", solver.unknowns())
            .stat("residual", solved.residual)
            .stat("seconds_rhs", prepared.as_secs_f64())
            .stat("seconds_solve", (seconds - prepared).as_secs_f64())
            .stat("components", components))
    }
}
