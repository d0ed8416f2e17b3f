use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

/// Bends the lattice into an envelope with a cubic Bezier curve along each edge (a Coons patch).
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct BezierEnvelope {
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// How far the upper left corner is moved.
    #[schemars(extend("x-unit" = "px"))]
    pub top_left: [f64; 2],
    /// How far the upper right corner is moved.
    #[schemars(extend("x-unit" = "px"))]
    pub top_right: [f64; 2],
    /// How far the lower right corner is moved.
    #[schemars(extend("x-unit" = "px"))]
    pub bottom_right: [f64; 2],
    /// How far the lower left corner is moved.
    #[schemars(extend("x-unit" = "px"))]
    pub bottom_left: [f64; 2],
    /// How far the inner control points of the upper edge are moved, from left to right; at rest they divide it in thirds.
    #[schemars(extend("x-unit" = "px"))]
    pub top: [[f64; 2]; 2],
    /// How far the inner control points of the right edge are moved, from top to bottom; at rest they divide it in thirds.
    #[schemars(extend("x-unit" = "px"))]
    pub right: [[f64; 2]; 2],
    /// How far the inner control points of the lower edge are moved, from left to right; at rest they divide it in thirds.
    #[schemars(extend("x-unit" = "px"))]
    pub bottom: [[f64; 2]; 2],
    /// How far the inner control points of the left edge are moved, from top to bottom; at rest they divide it in thirds.
    #[schemars(extend("x-unit" = "px"))]
    pub left: [[f64; 2]; 2],
}

impl Node for BezierEnvelope {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let envelope = warp::Envelope {
            corners: [self.top_left, self.top_right, self.bottom_right, self.bottom_left],
            top: self.top,
            right: self.right,
            bottom: self.bottom,
            left: self.left,
        };
        super::warped(cx, &cx.get(&self.grid), |lattice, watch| warp::envelope(lattice, &envelope, watch))
    }
}
