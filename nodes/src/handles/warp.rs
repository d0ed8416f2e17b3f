use std::collections::HashMap;
use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::handles::{self, Error, Handle, Side};
use warploom_algo::lattice::Lattice;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::schema::shown;
use warploom_core::value::Factor;

use crate::adapt::{self, lattice, point, watch};

/// Drags points and curves of a lattice to new places; the rest follows and keeps its shape as well as it can.
///
/// Without handles the lattice stays, one point moves it as a whole, two points turn and scale it. Handles that cannot
/// all be met are met as nearly as can be; the stats tell the largest miss.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Handles {
    /// The lattice, prepared by HandleFactor.
    #[schemars(extend("x-maker" = "HandleFactor"))]
    pub factor: In<Factor>,
    /// Points to drag, or to hold where they are.
    pub points: Vec<Point>,
    /// Curves to drag, each held at one point of every cell that it crosses.
    pub polylines: Vec<Polyline>,
    /// Where the upper side goes, corners from left to right; free if empty.
    #[schemars(extend("x-unit" = "px"))]
    pub top: Vec<[f64; 2]>,
    /// Where the right side goes, corners from top to bottom; free if empty.
    #[schemars(extend("x-unit" = "px"))]
    pub right: Vec<[f64; 2]>,
    /// Where the lower side goes, corners from left to right; free if empty.
    #[schemars(extend("x-unit" = "px"))]
    pub bottom: Vec<[f64; 2]>,
    /// Where the left side goes, corners from top to bottom; free if empty.
    #[schemars(extend("x-unit" = "px"))]
    pub left: Vec<[f64; 2]>,
    /// What cells keep.
    pub mode: Mode,
}

/// A point to drag.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Point {
    /// Where it is, on the lattice.
    #[schemars(extend("x-unit" = "px", "x-required" = true))]
    pub from: [f64; 2],
    /// Where it goes.
    #[schemars(extend("x-unit" = "px", "x-required" = true))]
    pub to: [f64; 2],
}

/// A curve to drag.
///
/// With as many corners in `to` as in `from` they correspond corner by corner, else by the share of the length.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Polyline {
    /// Its corners in order, on the lattice, at least 2.
    #[schemars(extend("x-unit" = "px", "x-required" = true))]
    pub from: Vec<[f64; 2]>,
    /// Corners of where it goes, at least 2.
    #[schemars(extend("x-unit" = "px", "x-required" = true))]
    pub to: Vec<[f64; 2]>,
}

/// What cells keep as well as they can.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Mode {
    /// Their shape; they may turn and grow.
    #[default]
    Similarity,
    /// Their shape and size; they may turn.
    Rigid,
}

/// A miss that is worth a warning, px.
const LARGE_MISS: f64 = 1.0;

impl Node for Handles {
    const VERSION: u32 = 2;
    const OUTPUTS: &'static [Output] = crate::warp::WARP;
    const CPU_FAMILY: bool = true;

    fn check(&self) -> Result<(), NodeError> {
        let curves = self.polylines.iter().enumerate().flat_map(|(index, Polyline { from, to })| {
            [("from", from), ("to", to)]
                .map(|(end, corners)| at_least_two("polylines", &format!("polylines[{index}].{end}"), corners))
        });
        let sides = self.sides().into_iter().filter(|(.., to)| !to.is_empty());
        let sides = sides.map(|(name, _, to)| at_least_two(name, name, to));
        NodeError::all(curves.chain(sides).chain([self.one_target_each()]))
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let factor = cx.get(&self.factor);
        let solver: &super::Prepared = adapt::solver(&factor, "factor", "HandleFactor")?;
        let lattice = lattice(&factor.grid);
        let start = Instant::now();
        let dragged = self.dragged(&lattice)?;
        let mode = match self.mode {
            Mode::Similarity => handles::Mode::Similarity,
            Mode::Rigid => handles::Mode::Rigid,
        };
        let at_work = watch(cx);
        let solved = solver.drag(&dragged.handles, mode, &at_work).map_err(|error| {
            let blamed = dragged.blame(&lattice, error);
            blamed.unwrap_or_else(|| super::refusal(error, &factor.grid, at_work))
        })?;
        let seconds = start.elapsed();
        let miss = solved.largest_miss;
        let missed = (miss > LARGE_MISS).then(|| {
            format!(
                "the handles cannot all be met, and are missed by up to {miss:.1} px: drag fewer, or use smaller cells"
            )
        });
        Ok(crate::warp::certified(cx, &factor.grid, solved.positions)?
            .warning(missed)
            .stat("unknowns", solver.factor.unknowns())
            .stat("constraints", solved.constraints)
            .stat("rank", solved.rank)
            .stat("dependent_constraints", solved.constraints - solved.rank)
            .stat("largest_miss", solved.largest_miss)
            .stat("residual", solved.residual)
            .stat("seconds_solve", seconds.as_secs_f64()))
    }
}

impl Handles {
    /// Parameter, side and where it goes.
    fn sides(&self) -> [(&'static str, Side, &Vec<[f64; 2]>); 4] {
        [
            ("top", Side::Top, &self.top),
            ("right", Side::Right, &self.right),
            ("bottom", Side::Bottom, &self.bottom),
            ("left", Side::Left, &self.left),
        ]
    }

    /// Refuses points that are one and go to two places.
    fn one_target_each(&self) -> Result<(), NodeError> {
        let mut first: HashMap<[u64; 2], usize> = HashMap::new();
        for (index, &Point { from, to }) in self.points.iter().enumerate() {
            // Adding 0 makes -0 and 0 one place.
            let before = *first.entry(from.map(|at| (at + 0.0).to_bits())).or_insert(index);
            if self.points[before].to != to {
                let names = [before, index].map(|index| format!("points[{index}]"));
                return Err(two_targets(&names, "points", from, [self.points[before].to, to]));
            }
        }
        Ok(())
    }

    /// All handles, curves as points.
    fn dragged(&self, lattice: &Lattice) -> Result<Dragged, NodeError> {
        let mut dragged = Dragged::default();
        for (index, &Point { from, to }) in self.points.iter().enumerate() {
            dragged.add("points", format!("points[{index}]"), [Handle { from, to }]);
        }
        for (index, Polyline { from, to }) in self.polylines.iter().enumerate() {
            let name = format!("polylines[{index}]");
            let held = handles::along(lattice, from, to).map_err(|error| match error {
                Error::Outside { index } => {
                    outside(lattice, "polylines", &format!("{name}.from[{index}]"), from[index])
                }
                other => unreachable!("{other:?} of a curve"),
            })?;
            dragged.add("polylines", name, held);
        }
        for (name, side, to) in self.sides().into_iter().filter(|(.., to)| !to.is_empty()) {
            dragged.add(name, name.to_owned(), handles::side(lattice, side, to));
        }
        Ok(dragged)
    }
}

/// Handles, and what each came from.
#[derive(Default)]
struct Dragged {
    handles: Vec<Handle>,
    /// Parameter, the item's name, and the count of handles up to its end.
    items: Vec<(&'static str, String, usize)>,
}

impl Dragged {
    fn add(&mut self, parameter: &'static str, name: String, handles: impl IntoIterator<Item = Handle>) {
        self.handles.extend(handles);
        self.items.push((parameter, name, self.handles.len()));
    }

    fn item(&self, handle: usize) -> (&'static str, &str) {
        let (parameter, name, _) = &self.items[self.items.partition_point(|(.., end)| *end <= handle)];
        (parameter, name)
    }

    /// The error that handles are to blame for.
    fn blame(&self, lattice: &Lattice, error: Error) -> Option<NodeError> {
        match error {
            Error::Outside { index } => {
                let (parameter, name) = self.item(index);
                Some(outside(lattice, parameter, &format!("{name}.from"), self.handles[index].from))
            }
            Error::NotFinite { index } => {
                let ((parameter, name), to) = (self.item(index), self.handles[index].to);
                let message = format!("{name} goes to {}, which is not finite", point(to));
                Some(NodeError::refused(message).at(parameter).hint("give it a finite target"))
            }
            Error::Contradiction { first, second } => {
                let ((_, one), (parameter, other)) = (self.item(first), self.item(second));
                let [one, other] = [one, other].map(str::to_owned);
                let [first, second] = [&self.handles[first], &self.handles[second]];
                Some(two_targets(&[one, other], parameter, first.from, [first.to, second.to]))
            }
            _ => None,
        }
    }
}

fn two_targets(names: &[String; 2], parameter: &'static str, from: [f64; 2], to: [[f64; 2]; 2]) -> NodeError {
    let ([one, other], [to, elsewhere]) = (names, to.map(point));
    let message = format!("{one} and {other} drag the place {} to two targets, {to} and {elsewhere} px", point(from));
    NodeError::refused(message).at(parameter).hint("give them one target, or move one of them")
}

fn at_least_two(parameter: &'static str, name: &str, corners: &[[f64; 2]]) -> Result<(), NodeError> {
    if corners.len() >= 2 {
        return Ok(());
    }
    let count = if corners.is_empty() { "no corners" } else { "1 corner" };
    let message = format!("{name} has {count}; a curve has at least 2");
    Err(NodeError::refused(message).at(parameter).hint("drag a single point by `points`"))
}

fn outside(lattice: &Lattice, parameter: &'static str, name: &str, at: [f64; 2]) -> NodeError {
    let ([left, top], [width, height]) = (lattice.origin, lattice.size());
    let [left, right, top, bottom] = [left, left + width, top, top + height].map(shown);
    let message = format!(
        "{name} is {} px, outside the lattice: x must be from {left} to {right} px, y from {top} to {bottom} px",
        point(at)
    );
    NodeError::refused(message).at(parameter).hint("move it inside, or give the Lattice overscan")
}
