use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_core::node::{Context, Domain, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Grid, Kind};

/// A regular lattice over a picture's format.
///
/// It depends on the display window alone, so what is built on it survives a new picture.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Lattice {
    /// The picture whose display window is covered.
    pub domain: In<Domain>,
    /// Side of a cell; the nearest that divides each side into whole cells.
    #[schemars(range(min = 0.1, max = 65536.0), extend("x-unit" = "px", "x-soft" = [2.0, 64.0], "x-required" = true))]
    pub cell: f64,
    /// How far the lattice reaches beyond the format on every side.
    #[schemars(range(min = 0.0, max = 65536.0), extend("x-unit" = "px", "x-soft" = [0.0, 256.0]))]
    pub overscan: f64,
    /// Along which axes the picture repeats.
    pub periodic: Periodic,
}

/// Along which axes a lattice repeats.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Periodic {
    /// Along none.
    #[default]
    None,
    /// The right edge is the left one.
    X,
    /// The lower edge is the upper one.
    Y,
    /// Along both.
    Both,
}

/// Nodes of the largest lattice: what is made of them is numbered in 32 bits.
const MAX_NODES: u128 = 1 << 32;

impl Node for Lattice {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("grid", Kind::Grid)];

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let display = cx.get(&self.domain).display;
        if display.is_empty() {
            let error = NodeError::refused("the display window is empty; a lattice needs at least one pixel");
            return Err(error.at("domain").hint("connect a picture that has pixels"));
        }
        let size = [display.width(), display.height()].map(|side| side as f64 + 2.0 * self.overscan);
        let cells = size.map(|side| (side / self.cell + 0.5).floor().max(1.0));
        let [columns, rows] = cells.map(|count| count as u128 + 1);
        if columns * rows > MAX_NODES {
            let message = format!("the lattice would have {columns} x {rows} nodes; there may be at most {MAX_NODES}");
            return Err(NodeError::refused(message).at("cell").hint("use larger cells"));
        }
        let grid = Grid {
            origin: [f64::from(display.x0) - self.overscan, f64::from(display.y0) - self.overscan],
            spacing: [size[0] / cells[0], size[1] / cells[1]],
            nodes: cells.map(|count| count as usize + 1),
            periodic: [
                matches!(self.periodic, Periodic::X | Periodic::Both),
                matches!(self.periodic, Periodic::Y | Periodic::Both),
            ],
        };
        Ok(grid.into())
    }
}
