use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::mask;
use warploom_core::node::{Context, Domain, In, Node, NodeError, Output, Outputs};

use crate::adapt::{view_mut, watched};

/// The loose selection that a person draws: a closed polygon, with even-odd inside and a soft outline.
///
/// Coverage is exact along rows and taken in sixteenths of a pixel across them.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Polygon {
    /// The picture whose display window is covered.
    pub domain: In<Domain>,
    /// Corners in order; the last is joined to the first.
    #[schemars(extend("x-unit" = "px", "x-required" = true))]
    pub points: Vec<[f64; 2]>,
    /// Width of the soft outline, half of it inside.
    #[schemars(range(min = 0.0, max = 10000.0), extend("x-unit" = "px", "x-soft" = [0.0, 64.0]))]
    pub feather: f64,
}

impl Node for Polygon {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::MASK;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let mut windows = cx.get(&self.domain);
        windows.data = windows.display;
        let (x0, y0) = (windows.data.x0.into(), windows.data.y0.into());
        let mask = super::drawn(cx, windows, |out| {
            watched(cx, |watch| mask::polygon(&self.points, self.feather, x0, y0, view_mut(out), watch))
        })?;
        Ok(mask.into())
    }
}
