use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::mesh;
use warploom_core::node::{Context, Node, NodeError, Output, Outputs};

/// A cylinder about the y axis, half of it below the origin.
///
/// A texture's width goes once around the axis and its height from the upper rim to the lower one; its middle faces +z.
/// The caps show the disc in the texture's middle.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Cylinder {
    /// Its radius.
    #[default(1.0)]
    #[schemars(range(min = 0.000001, max = 1000000.0), extend("x-soft" = [0.1, 10.0]))]
    pub radius: f64,
    /// Its height.
    #[default(2.0)]
    #[schemars(range(min = 0.000001, max = 1000000.0), extend("x-soft" = [0.1, 10.0]))]
    pub height: f64,
    /// Cells around the axis.
    #[default(96)]
    #[schemars(range(min = 3, max = 2048), extend("x-unit" = "cells", "x-soft" = [8, 256]))]
    pub segments: u32,
    /// Cells along the axis.
    #[default(1)]
    #[schemars(range(min = 1, max = 2048), extend("x-unit" = "cells", "x-soft" = [1, 64]))]
    pub rings: u32,
    /// Whether its ends are closed.
    #[default(true)]
    pub caps: bool,
}

impl Node for Cylinder {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::MESH;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let cap_rings = if self.caps { 2 } else { 0 };
        super::shape(cx, [self.segments, self.rings + cap_rings], |watch| {
            let (segments, rings) = (self.segments as usize, self.rings as usize);
            mesh::cylinder(self.radius, self.height, segments, rings, self.caps, watch)
        })
    }
}
