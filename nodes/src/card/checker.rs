use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::card;
use warploom_core::node::{Context, Node, NodeError, Output, Outputs};
use warploom_core::value::Kind;

/// Squares of two colours in turn.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Checker {
    /// Width and height.
    #[default([512, 512])]
    #[schemars(inner(range(min = 1, max = 65536)), extend("x-unit" = "px"))]
    pub size: [u32; 2],
    /// Side of a square.
    #[default(32.0)]
    #[schemars(range(min = 0.01, max = 65536.0), extend("x-unit" = "px", "x-soft" = [1.0, 256.0]))]
    pub cell: f64,
    /// Colour of the square at the origin: red, green, blue and alpha, scene-linear and premultiplied.
    #[default([0.8, 0.8, 0.8, 1.0])]
    pub even: [f64; 4],
    /// Colour of its neighbours.
    #[default([0.1, 0.1, 0.1, 1.0])]
    pub odd: [f64; 4],
}

impl Node for Checker {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("image", Kind::Image)];

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let image = super::rgba(cx, self.size, |channel, plane| {
            card::checker(plane, 0, 0, self.cell, self.even[channel] as f32, self.odd[channel] as f32)
        })?;
        Ok(image.into())
    }
}
