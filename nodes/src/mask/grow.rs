use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::mask;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Mask;

use crate::adapt::{stopped, view, view_mut, watch};

/// Grows a mask by a disc, or shrinks it.
///
/// Its data window stays; what lies outside neither grows in nor eats away.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Grow {
    /// Mask to change.
    pub mask: In<Mask>,
    /// The disc's radius; negative shrinks.
    #[schemars(range(min = -4096.0, max = 4096.0), extend("x-unit" = "px", "x-soft" = [-64.0, 64.0]))]
    pub by: f64,
}

impl Node for Grow {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::MASK;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let mask = cx.get(&self.mask);
        let grown = super::drawn(cx, mask.0.windows, |out| {
            mask::grow(view(&mask.0.samples), self.by, view_mut(out), &watch(cx)).map_err(stopped)
        })?;
        Ok(grown.into())
    }
}
