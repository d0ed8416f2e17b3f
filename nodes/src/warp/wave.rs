use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

/// Sways the lattice across a direction in a sine wave.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Wave {
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// Largest displacement.
    #[default(10.0)]
    #[schemars(extend("x-unit" = "px", "x-soft" = [-100.0, 100.0]))]
    pub amplitude: f64,
    /// Length of one wave.
    #[default(128.0)]
    #[schemars(range(min = 0.01, max = 1000000.0), extend("x-unit" = "px", "x-soft" = [8.0, 1024.0]))]
    pub wavelength: f64,
    /// Where in the wave the lattice's origin is.
    #[schemars(extend("x-unit" = "deg", "x-soft" = [-180.0, 180.0]))]
    pub phase: f64,
    /// Where the wave travels, positive clockwise from the right; the lattice sways across it.
    #[schemars(extend("x-unit" = "deg", "x-soft" = [-180.0, 180.0]))]
    pub direction: f64,
}

impl Node for Wave {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let grid = cx.get(&self.grid);
        super::warped(cx, &grid, |lattice, watch| {
            warp::wave(lattice, self.amplitude, self.wavelength, self.phase, self.direction, watch)
        })
    }
}
