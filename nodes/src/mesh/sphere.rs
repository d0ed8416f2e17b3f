use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::mesh;
use warploom_core::node::{Context, Node, NodeError, Output, Outputs};

/// A sphere about the origin.
///
/// A texture's width goes once around the y axis and its height from the upper pole to the lower one; its middle faces +z.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Sphere {
    /// Its radius.
    #[default(1.0)]
    #[schemars(range(min = 0.000001, max = 1000000.0), extend("x-soft" = [0.1, 10.0]))]
    pub radius: f64,
    /// Cells around the axis.
    #[default(96)]
    #[schemars(range(min = 3, max = 2048), extend("x-unit" = "cells", "x-soft" = [8, 256]))]
    pub segments: u32,
    /// Cells from pole to pole.
    #[default(48)]
    #[schemars(range(min = 2, max = 2048), extend("x-unit" = "cells", "x-soft" = [4, 128]))]
    pub rings: u32,
}

impl Node for Sphere {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::MESH;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        super::shape(cx, [self.segments, self.rings], |watch| {
            mesh::sphere(self.radius, self.segments as usize, self.rings as usize, watch)
        })
    }
}
