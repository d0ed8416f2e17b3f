use std::sync::Arc;
use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use smart_default::SmartDefault;
use warploom_algo::handles;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Factor, Grid, Hasher, Kind};

use crate::adapt::{lattice, watch};

/// Prepares a lattice for handles: the expensive part, which no change of the handles touches.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct HandleFactor {
    /// Lattice to drag; not a periodic one.
    pub grid: In<Grid>,
}

impl Node for HandleFactor {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("factor", Kind::Factor)];
    const CPU_FAMILY: bool = true;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let grid = cx.get(&self.grid);
        if grid.periodic != [false, false] {
            let error = NodeError::refused("the lattice is periodic; handles drag one with a border");
            return Err(error.at("grid").hint("use a Lattice with periodic: None"));
        }
        let start = Instant::now();
        let at_work = watch(cx);
        let factored = handles::factor(&lattice(&grid), &at_work);
        let factor = factored.map_err(|error| super::refusal(error, &grid, at_work))?;
        let unknowns = factor.unknowns();
        let prepared = super::Prepared::new(factor);
        let value = Factor {
            grid: *grid,
            structure: Hasher::new("handle factor").digest(&grid.digest()).finish(),
            bytes: prepared.bytes() as u64,
            summary: json!({ "kind": "Factor", "solver": "handles", "unknowns": unknowns }),
            solver: Arc::new(prepared),
        };
        Ok(Outputs::from(value).stat("unknowns", unknowns).stat("seconds_factor", start.elapsed().as_secs_f64()))
    }
}
