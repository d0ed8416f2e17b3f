use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

/// Deforms smoothly with a few control points, evenly spread from edge to edge: a uniform cubic B-spline.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct FreeLattice {
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// Columns of control points.
    #[default(4)]
    #[schemars(range(min = 2, max = 256))]
    pub columns: u32,
    /// Rows of control points.
    #[default(4)]
    #[schemars(range(min = 2, max = 256))]
    pub rows: u32,
    /// The control points, row by row from the upper left one; those after the last one given stay.
    #[schemars(extend("x-unit" = "px"))]
    pub points: Vec<[f64; 2]>,
    /// What the points say.
    pub given: Given,
}

/// What control points are given as.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Given {
    /// How far each is moved.
    #[default]
    Displacements,
    /// Where each goes.
    Positions,
}

impl Node for FreeLattice {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn check(&self) -> Result<(), NodeError> {
        let Self { columns, rows, points, .. } = self;
        if points.len() as u64 <= u64::from(*columns) * u64::from(*rows) {
            return Ok(());
        }
        let message = format!("{} points are more than {columns} x {rows} control points", points.len());
        Err(NodeError::refused(message).at("points").hint("give as many, or raise `columns` or `rows`"))
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let grid = cx.get(&self.grid);
        let count = [self.columns, self.rows].map(|count| count as usize);
        let lattice = crate::adapt::lattice(&grid);
        let mut moves = match self.given {
            Given::Displacements => self.points.clone(),
            Given::Positions => warp::control_moves(&lattice, count, &self.points),
        };
        moves.resize(count[0] * count[1], [0.0; 2]);
        super::warped(cx, &grid, |lattice, watch| warp::free_lattice(lattice, count, &moves, watch))
    }
}
