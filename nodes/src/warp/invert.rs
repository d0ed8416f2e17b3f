use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::Interrupted;
use warploom_algo::lattice::Lattice;
use warploom_algo::warp::{self, InvertError};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Direction, Grid, Warp};

use crate::adapt::{lattice, positions, watch};

/// The inverse of a warp: what it moved goes back.
///
/// It lies on a lattice over the warp's image, or on a given one; where the warp does not reach, its border cells
/// continue. In the stats, `covered` counts the nodes that it reaches, `residual` is how far
/// the warp takes them from where they started, and `interpolation_error` how far the inverse is off at the centres of
/// cells, px.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Invert {
    /// Warp to invert; it must not fold.
    pub warp: In<Warp>,
    /// Lattice of the inverse; if not connected, as many nodes over the box around the warped lattice.
    pub grid: Option<In<Grid>>,
    /// What comes out.
    pub gives: Gives,
}

/// What is made of the inverse map.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Gives {
    /// The inverse warp, pointing the same way as the warp.
    #[default]
    Inverse,
    /// The warp itself, pointing the other way: where pixels come from becomes where they go, or back.
    OtherWay,
}

impl Node for Invert {
    const VERSION: u32 = 2;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let warp = cx.get(&self.warp);
        super::refuse_holes(&warp, "warp")?;
        let (lattice, source) = (lattice(&warp.grid), positions(cx, &warp)?);
        let onto = match cx.get_optional(&self.grid) {
            Some(grid) => *grid,
            None => {
                let over = warp::image_lattice(&lattice, &source);
                let flat = || {
                    let error = NodeError::refused("the warp takes all nodes onto one line, and has no inverse");
                    error.at("warp").hint("let it keep some width and height")
                };
                let Lattice { origin, spacing, nodes } = over.ok_or_else(flat)?;
                Grid { origin, spacing, nodes, periodic: [false; 2] }
            }
        };
        let (sought, at_work) = (super::lattice(cx, &onto)?, watch(cx));
        let inverted = warp::invert(&lattice, &source, &sought, &at_work).map_err(|error| match error {
            InvertError::Interrupted => at_work.error(Interrupted),
            InvertError::Folded { cell: [column, row], folds } => {
                let message = format!("the warp folds in {folds} cells, most at column {column}, row {row}");
                let hint = "a folded warp has no inverse: bend it less, or look at what feeds it";
                NodeError::refused(message).at("warp").hint(hint)
            }
        })?;
        drop(source);
        let direction = match (self.gives, warp.direction) {
            (Gives::Inverse, direction) => direction,
            (Gives::OtherWay, Direction::DstFromSrc) => Direction::SrcFromDst,
            (Gives::OtherWay, Direction::SrcFromDst) => Direction::DstFromSrc,
        };
        let outputs = super::derived(cx, &onto, direction, inverted.positions, super::Holes::None)?;
        let warning = doubt(&outputs, onto.node_count() - inverted.covered, onto.node_count());
        Ok(outputs
            .warning(warning)
            .stat("covered", inverted.covered)
            .stat("residual", inverted.residual)
            .stat("interpolation_error", inverted.interpolation_error))
    }
}

/// What is to be said of an inverse that folds, of which so many nodes lie outside of the warp's image.
fn doubt(outputs: &Outputs, outside: usize, all: usize) -> Option<String> {
    let folds =
        outputs.stats["folds"].as_u64().filter(|folds| *folds > 0 && !outputs.stats.contains_key("mirrored"))?;
    Some(match outside {
        0 => {
            format!("the inverse folds in {folds} cells, which are too coarse for it: connect a `grid` of finer cells")
        }
        _ => format!(
            "the inverse folds in {folds} cells: {outside} of its {all} nodes lie outside of the warp's image, where it is \
             continued; warp a Lattice with more overscan, or connect a `grid` that the image covers"
        ),
    })
}
