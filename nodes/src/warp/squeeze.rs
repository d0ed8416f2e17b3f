use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp::{self, Bend, Shape};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

use super::bends::Orientation;

/// Squeezes the left and right edges towards each other and bows the others outwards; the corners stay.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Squeeze {
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// How far, positive inwards.
    #[default(50.0)]
    #[schemars(range(min = -100.0, max = 100.0), extend("x-unit" = "percent"))]
    pub bend: f64,
    /// Along which axis; upright exchanges up with left and down with right.
    pub orientation: Orientation,
    /// How much taller the right end becomes than the middle.
    #[schemars(range(min = -100.0, max = 100.0), extend("x-unit" = "percent"))]
    pub horizontal_distortion: f64,
    /// How much wider the lower end becomes than the middle.
    #[schemars(range(min = -100.0, max = 100.0), extend("x-unit" = "percent"))]
    pub vertical_distortion: f64,
}

impl Node for Squeeze {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let bend = Bend {
            bend: self.bend,
            orientation: self.orientation.into(),
            horizontal_distortion: self.horizontal_distortion,
            vertical_distortion: self.vertical_distortion,
        };
        super::warped(cx, &cx.get(&self.grid), |lattice, watch| warp::bend(lattice, Shape::Squeeze, &bend, watch))
    }
}
