use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

/// Moves the lattice by waves that run outwards from a centre.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Ripple {
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// Largest displacement, along the radius.
    #[default(4.0)]
    #[schemars(range(min = -1000000.0, max = 1000000.0), extend("x-unit" = "px", "x-soft" = [-32.0, 32.0]))]
    pub amplitude: f64,
    /// Length of one wave.
    #[default(64.0)]
    #[schemars(range(min = 0.01, max = 1000000.0), extend("x-unit" = "px", "x-soft" = [8.0, 512.0]))]
    pub wavelength: f64,
    /// Where in the wave the centre is; growing phases make the waves run inwards.
    #[schemars(extend("x-unit" = "deg", "x-soft" = [-180.0, 180.0]))]
    pub phase: f64,
    /// What the waves run from; the lattice's middle if not given.
    #[schemars(extend("x-unit" = "px"))]
    pub center: Option<[f64; 2]>,
}

impl Node for Ripple {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        super::warped(cx, &cx.get(&self.grid), |lattice, watch| {
            let center = self.center.unwrap_or(lattice.center());
            warp::ripple(lattice, self.amplitude, self.wavelength, self.phase, center, watch)
        })
    }
}
