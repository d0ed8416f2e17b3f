//! Between the graph's values and the arrays that algorithms take.

use std::sync::{Mutex, PoisonError};

use warploom_algo::lattice::{self, Lattice, Positions};
use warploom_algo::rect::Rect as Window;
use warploom_algo::resample::Map;
use warploom_algo::view::{View, ViewMut};
use warploom_algo::{Interrupted, Watch, Watcher};
use warploom_core::node::{Context, ErrorClass, NodeError, Port};
use warploom_core::schema::shown;
use warploom_core::value::{
    Buffer, BufferMut, Direction, Factor, Given, Grid, Kind, Raster, Rect, Sample, Value, Warp,
};

pub fn view<T: Sample>(buffer: &Buffer<T>) -> View<'_, T> {
    View::new(buffer.samples(), buffer.width(), buffer.height(), buffer.stride())
}

pub fn view_mut<T: Sample>(buffer: &mut BufferMut<T>) -> ViewMut<'_, T> {
    let (width, height, stride) = (buffer.width(), buffer.height(), buffer.stride());
    ViewMut::new(buffer.samples_mut(), width, height, stride)
}

pub fn lattice(grid: &Grid) -> Lattice {
    Lattice { origin: grid.origin, spacing: grid.spacing, nodes: grid.nodes }
}

/// A lattice in words.
pub fn described(grid: &Grid) -> String {
    let ([columns, rows], [width, height]) = (grid.nodes, grid.spacing.map(shown));
    let periodic = match grid.periodic {
        [false, false] => "",
        [true, false] => ", periodic in x",
        [false, true] => ", periodic in y",
        [true, true] => ", periodic in x and y",
    };
    format!("{columns} x {rows} nodes, {width} x {height} px apart, from {}{periodic}", point(grid.origin))
}

/// A place in words.
pub fn point([x, y]: [f64; 2]) -> String {
    format!("({}, {})", shown(x), shown(y))
}

/// Refuses a warp whose lattice is another than `its`, that of what it is to go with.
pub fn check_lattice(warp: &Warp, port: &'static str, its: &Grid, partner: &str) -> Result<(), NodeError> {
    if warp.grid == *its {
        return Ok(());
    }
    let message = format!("it is on another lattice ({}) than {partner} ({})", described(&warp.grid), described(its));
    Err(NodeError::refused(message).at(port).hint("feed both from one Lattice"))
}

/// The solver that a factor holds, if it is one of `maker`'s.
pub fn solver<'a, T: 'static>(factor: &'a Factor, port: &'static str, maker: &str) -> Result<&'a T, NodeError> {
    factor.solver.downcast_ref().ok_or_else(|| {
        let message = format!("the factor is another solver's ({})", factor.summary["solver"]);
        NodeError::refused(message).at(port).hint(format!("connect a {maker}"))
    })
}

/// Why a solver did without an answer: the lattice needs more memory than there is, or more entries than it counts.
pub fn too_large(grid: &Grid) -> NodeError {
    let message = format!("the lattice ({}) is too large for the solver", described(grid));
    NodeError::new(ErrorClass::OverBudget, message).hint("use larger cells")
}

/// A warp's lattice and positions; one that repeats goes on beyond its borders.
pub fn repeated(cx: &Context, warp: &Warp) -> Result<(Lattice, Positions), NodeError> {
    let (lattice, positions) = (lattice(&warp.grid), positions(cx, warp)?);
    let Some((wider, all)) = lattice::repeated(&lattice, &positions, warp.grid.periodic) else {
        return Ok((lattice, positions));
    };
    cx.reserve(wider.node_count() as u128 * size_of::<[f64; 2]>() as u128)?;
    Ok((wider, all))
}

/// What a warp's lattice and positions say, whichever way they point.
pub fn map<'a>(direction: Direction, lattice: &'a Lattice, positions: &'a Positions) -> Map<'a> {
    match direction {
        Direction::DstFromSrc => Map::Forward { lattice, positions },
        Direction::SrcFromDst => Map::Backward { lattice, positions },
    }
}

/// The algorithms' rectangle.
pub fn window(rect: &Rect) -> Window {
    Window { x0: rect.x0.into(), y0: rect.y0.into(), x1: rect.x1.into(), y1: rect.y1.into() }
}

/// Farthest from the origin that pixels may lie, px.
pub const FARTHEST: i64 = 1 << 24;

/// A copy of the warp's positions, once there is room for it.
pub fn positions(cx: &Context, warp: &Warp) -> Result<Positions, NodeError> {
    cx.go_on()?;
    cx.reserve(warp.grid.node_count() as u128 * size_of::<[f64; 2]>() as u128)?;
    let x = warp.x.to_vec();
    cx.go_on()?;
    Ok(Positions { x, y: warp.y.to_vec() })
}

/// A node at work, as algorithms see it.
pub struct AtWork<'a> {
    cx: &'a Context<'a>,
    /// Why memory was refused.
    refusal: Mutex<Option<NodeError>>,
}

/// The node at work.
pub fn watch<'a>(cx: &'a Context) -> AtWork<'a> {
    AtWork { cx, refusal: Mutex::default() }
}

/// Why an algorithm was interrupted that asks for no memory.
pub fn stopped(_: Interrupted) -> NodeError {
    NodeError::new(ErrorClass::Cancelled, "stopped")
}

impl AtWork<'_> {
    /// Why the node interrupted an algorithm.
    pub fn error(self, interrupted: Interrupted) -> NodeError {
        let refusal = self.refusal.into_inner().unwrap_or_else(PoisonError::into_inner);
        refusal.unwrap_or_else(|| stopped(interrupted))
    }
}

impl Watcher for AtWork<'_> {
    fn progress(&self, part: f64) -> Result<(), Interrupted> {
        self.cx.progress(part).map_err(|_| Interrupted)
    }

    fn go_on(&self) -> Result<(), Interrupted> {
        self.cx.go_on().map_err(|_| Interrupted)
    }

    fn reserve(&self, bytes: usize) -> Result<(), Interrupted> {
        self.cx.reserve(bytes as u128).map_err(|error| {
            self.refusal.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
            Interrupted
        })
    }
}

/// Runs an algorithm that tells how far it is, and may be interrupted.
pub fn watched<T>(cx: &Context, run: impl FnOnce(Watch) -> Result<T, Interrupted>) -> Result<T, NodeError> {
    let at_work = watch(cx);
    run(&at_work).map_err(|interrupted| at_work.error(interrupted))
}

/// A number per pixel: a field, or a mask as one.
pub struct Strength;

impl Port for Strength {
    type Seen = Raster<f32>;
    const KINDS: &'static [Kind] = &[Kind::Field, Kind::Mask];
    fn see(given: &Given) -> Option<Self::Seen> {
        match given {
            Given::Value(Value::Field(field)) => Some(field.0.clone()),
            Given::Value(Value::Mask(mask)) => Some(mask.0.clone()),
            _ => None,
        }
    }
}
