//! Masks, and the components of masks.

mod combine;
mod components;
mod grow;
mod polygon;
mod threshold;

pub use combine::Combine;
pub use components::Components;
pub(crate) use components::row as component_row;
pub use grow::Grow;
pub use polygon::Polygon;
pub use threshold::Threshold;

use warploom_core::node::{Context, NodeError, Output};
use warploom_core::value::{BufferMut, Kind, Mask, Raster, Windows};

const MASK: &[Output] = &[Output::new("mask", Kind::Mask)];

/// A mask in `windows` that `draw` fills.
fn drawn(
    cx: &Context,
    windows: Windows,
    draw: impl FnOnce(&mut BufferMut<f32>) -> Result<(), NodeError>,
) -> Result<Mask, NodeError> {
    let mut plane = cx.plane(windows.data.width(), windows.data.height())?;
    draw(&mut plane)?;
    Ok(Mask(Raster { windows, samples: plane.freeze() }))
}
