use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::Interrupted;
use warploom_algo::warp::{self, PerspectiveError};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

use crate::adapt::watch;

/// Pins the four corners of a rectangle elsewhere, in perspective: straight lines stay straight.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Perspective {
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// Where the upper left corner goes; it stays if not given.
    #[schemars(extend("x-unit" = "px"))]
    pub top_left: Option<[f64; 2]>,
    /// Where the upper right corner goes; it stays if not given.
    #[schemars(extend("x-unit" = "px"))]
    pub top_right: Option<[f64; 2]>,
    /// Where the lower right corner goes; it stays if not given.
    #[schemars(extend("x-unit" = "px"))]
    pub bottom_right: Option<[f64; 2]>,
    /// Where the lower left corner goes; it stays if not given.
    #[schemars(extend("x-unit" = "px"))]
    pub bottom_left: Option<[f64; 2]>,
    /// The rectangle whose corners these are: its left and upper edge, its width and height; the lattice's if not given.
    #[schemars(extend("x-unit" = "px"))]
    pub rectangle: Option<[f64; 4]>,
}

impl Node for Perspective {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let grid = cx.get(&self.grid);
        let lattice = super::lattice(cx, &grid)?;
        let [width, height] = lattice.size();
        let [left, top] = lattice.origin;
        let [left, top, width, height] = self.rectangle.unwrap_or([left, top, width, height]);
        let [right, bottom] = [left + width, top + height];
        if !(left < right && right.is_finite() && top < bottom && bottom.is_finite()) {
            let message = format!("a rectangle of {width} x {height} px at ({left}, {top}) has no area");
            return Err(NodeError::refused(message).at("rectangle").hint("width and height are positive"));
        }
        let pins = [self.top_left, self.top_right, self.bottom_right, self.bottom_left];
        let rest = [[left, top], [right, top], [right, bottom], [left, bottom]];
        let moves = [0, 1, 2, 3].map(|corner: usize| {
            let [x, y] = pins[corner].unwrap_or(rest[corner]);
            [x - rest[corner][0], y - rest[corner][1]]
        });
        let at_work = watch(cx);
        let pinned = warp::perspective(&lattice, [[left, top], [right, bottom]], moves, &at_work);
        let positions = pinned.map_err(|error| match error {
            PerspectiveError::Interrupted => at_work.error(Interrupted),
            PerspectiveError::Degenerate => NodeError::refused("three of the corners lie on one line")
                .hint("put the corners so that they span a convex quadrangle"),
            PerspectiveError::Horizon { at: [x, y] } => {
                let message = format!("the horizon runs through the lattice at ({x:.1}, {y:.1}) px");
                NodeError::refused(message).hint("make the quadrangle convex and its sides less convergent")
            }
        })?;
        super::certified(cx, &grid, positions)
    }
}
