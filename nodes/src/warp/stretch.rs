use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

/// Stretches along x and y about a centre.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Stretch {
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// Factor along x.
    #[default(1.0)]
    #[schemars(extend("x-soft" = [0.25, 4.0]))]
    pub x: f64,
    /// Factor along y.
    #[default(1.0)]
    #[schemars(extend("x-soft" = [0.25, 4.0]))]
    pub y: f64,
    /// What stays in place; the lattice's middle if not given.
    #[schemars(extend("x-unit" = "px"))]
    pub center: Option<[f64; 2]>,
}

impl Node for Stretch {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let grid = cx.get(&self.grid);
        super::warped(cx, &grid, |lattice, watch| {
            let center = self.center.unwrap_or(lattice.center());
            warp::stretch(lattice, [self.x, self.y], center, watch)
        })
    }
}
