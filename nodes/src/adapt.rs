//! Between the graph's values and the arrays that algorithms take.

use warploom_algo::Interrupted;
use warploom_algo::lattice::{Lattice, Positions};
use warploom_algo::view::{View, ViewMut};
use warploom_core::node::{Context, ErrorClass, NodeError};
use warploom_core::value::{Buffer, BufferMut, Grid, Sample, Warp};

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

pub fn positions(warp: &Warp) -> Positions {
    Positions { x: warp.x.to_vec(), y: warp.y.to_vec() }
}

/// How an algorithm asks whether to go on.
pub fn watch<'a>(cx: &'a Context) -> impl Fn(f64) -> Result<(), Interrupted> + Sync + 'a {
    |part| cx.progress(part).map_err(|_| Interrupted)
}

pub fn stopped(_: Interrupted) -> NodeError {
    NodeError::new(ErrorClass::Cancelled, "stopped")
}
