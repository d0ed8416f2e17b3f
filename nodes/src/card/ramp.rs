use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::card;
use warploom_core::node::{Context, Node, NodeError, Output, Outputs};
use warploom_core::value::Kind;

/// A linear change of colour from one point to another, held outside.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Ramp {
    /// Width and height.
    #[default([512, 512])]
    #[schemars(inner(range(min = 1, max = 65536)), extend("x-unit" = "px"))]
    pub size: [u32; 2],
    /// Where the first colour ends.
    #[schemars(extend("x-unit" = "px"))]
    pub from: [f64; 2],
    /// Where the last colour begins.
    #[default([512.0, 0.0])]
    #[schemars(extend("x-unit" = "px"))]
    pub to: [f64; 2],
    /// The first colour: red, green, blue and alpha, scene-linear and premultiplied.
    #[default([0.0, 0.0, 0.0, 1.0])]
    pub first: [f64; 4],
    /// The last colour.
    #[default([1.0, 1.0, 1.0, 1.0])]
    pub last: [f64; 4],
}

impl Node for Ramp {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("image", Kind::Image)];

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let image = super::rgba(cx, self.size, |channel, plane| {
            card::ramp(plane, 0, 0, self.from, self.to, self.first[channel], self.last[channel])
        })?;
        Ok(image.into())
    }
}
