use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

/// Moves the lattice by smooth noise.
///
/// The noise hangs on the picture's origin, so a lattice with overscan sees the same.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Turbulence {
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// Largest displacement along each axis.
    #[default(10.0)]
    #[schemars(range(min = -1000000.0, max = 1000000.0), extend("x-unit" = "px", "x-soft" = [0.0, 100.0]))]
    pub amount: f64,
    /// Size of the largest swells.
    #[default(128.0)]
    #[schemars(range(min = 0.01, max = 1000000.0), extend("x-unit" = "px", "x-soft" = [8.0, 1024.0]))]
    pub scale: f64,
    /// Octaves of noise, each of half the size and height of the one before.
    #[default(1)]
    #[schemars(range(min = 1, max = 16))]
    pub octaves: u32,
    /// Other seeds give other noise.
    #[schemars(extend("x-animatable" = true))]
    pub seed: u32,
}

impl Node for Turbulence {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let Self { amount, scale, octaves, seed, .. } = *self;
        let parameters = warp::Turbulence { amount, scale, octaves, seed };
        super::warped(cx, &cx.get(&self.grid), |lattice, watch| warp::turbulence(lattice, &parameters, watch))
    }
}
