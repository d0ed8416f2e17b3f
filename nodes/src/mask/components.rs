use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::components::{self, Connectivity as Neighbours};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Component, Kind, Labels, Mask, Raster, Rect, Value};

use crate::adapt::{view, view_mut, watched};

/// Numbers the connected parts of a mask (where it covers more than half), in the order of their first pixels.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Components {
    /// Mask to take apart.
    pub mask: In<Mask>,
    /// Which pixels are neighbours.
    pub connectivity: Connectivity,
    /// Smaller parts are background.
    #[schemars(extend("x-unit" = "px"))]
    pub min_area: u64,
}

/// Which pixels are neighbours.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Connectivity {
    /// Those that share an edge or a corner.
    #[default]
    Eight,
    /// Those that share an edge.
    Four,
}

impl Node for Components {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("labels", Kind::Labels), Output::new("count", Kind::Number)];

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let mask = cx.get(&self.mask);
        let windows = mask.0.windows;
        let (width, height) = (windows.data.width(), windows.data.height());
        if width as u128 * height as u128 > u128::from(u32::MAX) {
            return Err(NodeError::refused(format!(
                "the mask has {width} x {height} px; labels are for at most 4294967295 px"
            ))
            .at("mask")
            .hint("crop the mask"));
        }
        let connectivity = match self.connectivity {
            Connectivity::Eight => Neighbours::Eight,
            Connectivity::Four => Neighbours::Four,
        };
        let mut plane = cx.plane(width, height)?;
        let (x0, y0) = (windows.data.x0.into(), windows.data.y0.into());
        let (samples, out) = (view(&mask.0.samples), view_mut(&mut plane));
        let found = watched(cx, |watch| components::label(samples, connectivity, self.min_area, x0, y0, out, watch))?;
        let table: Vec<Component> = (found.iter().zip(1..)).map(|(component, label)| row(label, component)).collect();
        let count = table.len();
        let labels = Labels { raster: Raster { windows, samples: plane.freeze() }, table };
        Ok(Outputs::new([labels.into(), Value::Number(count as f64)]).stat("count", count))
    }
}

pub(crate) fn row(label: u32, component: &components::Component) -> Component {
    let [x0, y0, x1, y1] = component.bounds.map(|edge| edge as i32);
    Component { label, area: component.area, bounds: Rect { x0, y0, x1, y1 }, centroid: component.centroid }
}
