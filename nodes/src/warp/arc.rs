use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

/// Bends the lattice along an arc, as type is set on one: the lower edge is the baseline and keeps its length.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Arc {
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// What the lattice's width comes to span; positive arches upwards.
    #[default(30.0)]
    #[schemars(range(min = -360.0, max = 360.0), extend("x-unit" = "deg", "x-soft" = [-90.0, 90.0]))]
    pub angle: f64,
}

impl Node for Arc {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let grid = cx.get(&self.grid);
        super::warped(cx, &grid, |lattice, watch| warp::arc(lattice, self.angle, watch))
    }
}
