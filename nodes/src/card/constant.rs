use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::card;
use warploom_core::node::{Context, Node, NodeError, Output, Outputs};
use warploom_core::value::Kind;

/// A picture of one colour.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Constant {
    /// Width and height.
    #[default([512, 512])]
    #[schemars(inner(range(min = 1, max = 65536)), extend("x-unit" = "px"))]
    pub size: [u32; 2],
    /// Red, green, blue and alpha, scene-linear and premultiplied.
    #[default([0.18, 0.18, 0.18, 1.0])]
    #[schemars(inner(range(min = -1000000.0, max = 1000000.0)))]
    pub color: [f64; 4],
}

impl Node for Constant {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("image", Kind::Image)];

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let image = super::rgba(cx, self.size, |channel, plane| card::constant(plane, self.color[channel] as f32))?;
        Ok(image.into())
    }
}
