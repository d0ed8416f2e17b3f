use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_core::node::{Any, Context, In, Node, NodeError, Output, Outputs, Request};

/// Gives one frame of its input, whatever frame is asked for.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct FrameHold {
    /// What to hold.
    pub input: In<Any>,
    /// The frame.
    #[default(1)]
    pub frame: i64,
}

impl Node for FrameHold {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::same_as("output", "input")];

    fn needs(&self, _: &str, request: &Request, _: &[i64]) -> Vec<Request> {
        vec![request.at(Some(self.frame))]
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        Ok(cx.get(&self.input).into())
    }
}
