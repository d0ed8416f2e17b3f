use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

/// Distorts as a lens does, along the radii about its centre; `Invert` takes a distortion away.
///
/// It says where undistorted pixels go: a distance r becomes r (1 + k1 r^2 + k2 r^4 + k3 r^6).
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Lens {
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// k1, k2 and k3, for the second, fourth and sixth power of the distance; positive ones push outwards (pincushion),
    /// negative ones pull inwards (barrel).
    #[schemars(inner(range(min = -10.0, max = 10.0)), extend("x-soft" = [-0.5, 0.5]))]
    pub k: [f64; 3],
    /// The distance that counts as 1; half the lattice's diagonal if not given.
    #[schemars(range(min = 0.01, max = 1000000.0), extend("x-unit" = "px", "x-soft" = [16.0, 4096.0]))]
    pub radius: Option<f64>,
    /// The optical centre; the lattice's middle if not given.
    #[schemars(extend("x-unit" = "px"))]
    pub center: Option<[f64; 2]>,
}

impl Node for Lens {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        super::warped(cx, &cx.get(&self.grid), |lattice, watch| {
            let center = self.center.unwrap_or(lattice.center());
            let radius = self.radius.unwrap_or_else(|| warp::half_diagonal(lattice));
            warp::lens(lattice, self.k, radius, center, watch)
        })
    }
}
