use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::composite::{self, Placed};
use warploom_algo::mask::{self, Combination};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Buffer, Mask, Rect};

use crate::adapt::{view, view_mut};

/// Union, intersection or difference of masks.
///
/// The display window is the first mask's, the data window holds all of them.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Combine {
    /// Masks to combine.
    pub masks: Vec<In<Mask>>,
    /// How they are combined.
    pub mode: Mode,
}

/// How masks are combined.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Mode {
    /// What any of them covers.
    #[default]
    Union,
    /// What all of them cover.
    Intersection,
    /// What the first covers and no other does.
    Difference,
}

impl Node for Combine {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::MASK;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let masks = cx.get_all(&self.masks);
        let mut windows = masks[0].0.windows;
        windows.data = masks.iter().fold(windows.data, |data, mask| data.union(&mask.0.windows.data));
        let planes = masks.iter().map(|mask| placed(cx, mask, &windows.data)).collect::<Result<Vec<_>, _>>()?;
        let views: Vec<_> = planes.iter().map(view).collect();
        let combination = match self.mode {
            Mode::Union => Combination::Union,
            Mode::Intersection => Combination::Intersection,
            Mode::Difference => Combination::Difference,
        };
        let combined = super::drawn(cx, windows, |out| {
            mask::combine(combination, &views, view_mut(out));
            Ok(())
        })?;
        Ok(combined.into())
    }
}

/// The mask's samples in another data window.
fn placed(cx: &Context, mask: &Mask, window: &Rect) -> Result<Buffer<f32>, NodeError> {
    let data = mask.0.windows.data;
    if data == *window {
        return Ok(mask.0.samples.clone());
    }
    let mut plane = cx.plane(window.width(), window.height())?;
    let source = Placed { view: view(&mask.0.samples), x0: data.x0.into(), y0: data.y0.into() };
    composite::copy(source, window.x0.into(), window.y0.into(), view_mut(&mut plane));
    Ok(plane.freeze())
}
