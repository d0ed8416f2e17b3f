use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::mesh;
use warploom_core::node::{Context, Node, NodeError, Output, Outputs};

/// A torus about the y axis.
///
/// A texture's width goes once around the axis; its height goes once around the tube, from the inmost circle over the upper
/// one. Its middle lies outmost and faces +z.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Torus {
    /// From the axis to the middle of the tube.
    #[default(1.0)]
    #[schemars(range(min = 0.000001, max = 1000000.0), extend("x-soft" = [0.1, 10.0]))]
    pub radius: f64,
    /// Radius of the tube, at most the other one.
    #[default(0.4)]
    #[schemars(range(min = 0.000001, max = 1000000.0), extend("x-soft" = [0.1, 10.0]))]
    pub tube: f64,
    /// Cells around the axis.
    #[default(128)]
    #[schemars(range(min = 3, max = 2048), extend("x-unit" = "cells", "x-soft" = [8, 256]))]
    pub segments: u32,
    /// Cells around the tube.
    #[default(64)]
    #[schemars(range(min = 3, max = 2048), extend("x-unit" = "cells", "x-soft" = [8, 128]))]
    pub sides: u32,
}

impl Node for Torus {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::MESH;

    fn check(&self) -> Result<(), NodeError> {
        if self.tube <= self.radius {
            return Ok(());
        }
        let message = format!("the tube's radius {} is larger than the radius {}", self.tube, self.radius);
        Err(NodeError::refused(message).at("tube").hint("a tube of at most the radius does not cut itself"))
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        super::shape(cx, [self.segments, self.sides], |watch| {
            mesh::torus(self.radius, self.tube, self.segments as usize, self.sides as usize, watch)
        })
    }
}
