use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

/// Turns the lattice about a centre, most there and not at all from a radius on.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Swirl {
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// Rotation at the centre, positive clockwise.
    #[default(90.0)]
    #[schemars(range(min = -3600.0, max = 3600.0), extend("x-unit" = "deg", "x-soft" = [-360.0, 360.0]))]
    pub angle: f64,
    /// Where the turning ends.
    #[default(256.0)]
    #[schemars(range(min = 0.01, max = 1000000.0), extend("x-unit" = "px", "x-soft" = [1.0, 2048.0]))]
    pub radius: f64,
    /// What is turned about; the lattice's middle if not given.
    #[schemars(extend("x-unit" = "px"))]
    pub center: Option<[f64; 2]>,
}

impl Node for Swirl {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let grid = cx.get(&self.grid);
        super::warped(cx, &grid, |lattice, watch| {
            let center = self.center.unwrap_or(lattice.center());
            warp::swirl(lattice, self.angle, self.radius, center, watch)
        })
    }
}
