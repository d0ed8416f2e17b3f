use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

/// Scales, shears and rotates about a centre, then moves.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Affine {
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// How far it is moved.
    #[schemars(extend("x-unit" = "px"))]
    pub translate: [f64; 2],
    /// Rotation, positive clockwise.
    #[schemars(extend("x-unit" = "deg", "x-soft" = [-180.0, 180.0]))]
    pub rotate: f64,
    /// Factors along x and y; negative ones mirror.
    #[default([1.0, 1.0])]
    pub scale: [f64; 2],
    /// Shift of x per unit of y, and of y per unit of x.
    pub shear: [f64; 2],
    /// What stays in place before the move; the lattice's middle if not given.
    #[schemars(extend("x-unit" = "px"))]
    pub center: Option<[f64; 2]>,
}

impl Node for Affine {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let grid = cx.get(&self.grid);
        super::warped(cx, &grid, |lattice, watch| {
            let parameters = warp::Affine {
                translate: self.translate,
                rotate_deg: self.rotate,
                scale: self.scale,
                shear: self.shear,
                center: self.center.unwrap_or(lattice.center()),
            };
            warp::affine(lattice, &parameters, watch)
        })
    }
}
