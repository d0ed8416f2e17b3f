use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::Interrupted;
use warploom_algo::warp::{self, PerspectiveError};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::schema::shown;
use warploom_core::value::Grid;

use crate::adapt::{described, point, watch};

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

/// The corners as a graph names them, clockwise.
const CORNERS: [&str; 4] = ["top_left", "top_right", "bottom_right", "bottom_left"];

impl Node for Perspective {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn check(&self) -> Result<(), NodeError> {
        let Some([left, top, width, height]) = self.rectangle else { return Ok(()) };
        let has_area = |from: f64, size: f64| from < from + size && (from + size).is_finite();
        if has_area(left, width) && has_area(top, height) {
            return Ok(());
        }
        let (width, height) = (shown(width), shown(height));
        let message = format!("a rectangle of {width} x {height} px at {} px has no area", point([left, top]));
        Err(NodeError::refused(message).at("rectangle").hint("write (left, top, width, height), the last two above 0"))
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let grid = cx.get(&self.grid);
        let lattice = super::lattice(cx, &grid)?;
        let [width, height] = lattice.size();
        let [left, top] = lattice.origin;
        let [left, top, width, height] = self.rectangle.unwrap_or([left, top, width, height]);
        let [right, bottom] = [left + width, top + height];
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
            PerspectiveError::Degenerate { corner } => {
                let [one, two, three] = [corner + 3, corner, corner + 1].map(|corner| {
                    let ([x, y], [dx, dy]) = (rest[corner % 4], moves[corner % 4]);
                    format!("{} {}", CORNERS[corner % 4], point([x + dx, y + dy]))
                });
                NodeError::refused(format!("three corners lie on one line: {one}, {two} and {three} px"))
                    .hint("put the corners so that they span a convex quadrangle")
            }
            PerspectiveError::Overflow => {
                let far = moves.as_flattened().iter().fold(0.0, |far: f64, by| far.max(by.abs()));
                NodeError::refused(format!("a corner goes {far:e} px away, and positions overflow"))
                    .hint("put the corners nearer")
            }
            PerspectiveError::Horizon { at: [x, y] } => {
                let message = format!("the horizon runs through the lattice or the rectangle at ({x:.1}, {y:.1}) px");
                NodeError::refused(message).hint("make the quadrangle convex and its sides less convergent")
            }
            PerspectiveError::Beyond => {
                NodeError::refused(format!("the whole lattice ({}) lies beyond the horizon", described(&grid)))
                    .at("grid")
                    .hint("make the sides of the quadrangle less convergent, or warp a lattice nearer to it")
            }
        })?;
        super::certified(cx, &grid, positions)
    }
}
