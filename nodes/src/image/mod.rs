//! Drawing, comparing and putting pictures together.

mod difference;
mod draw_grid;
mod over;
mod resample;

pub use difference::Difference;
pub use draw_grid::DrawGrid;
pub use over::Over;
pub use resample::Resample;

use warploom_algo::composite::{Placed, Plane as Placement};
use warploom_core::node::{Context, NodeError, Output};
use warploom_core::value::{Channel, Kind, Layer, Plane, Rect};

use crate::adapt::view;

const IMAGE: &[Output] = &[Output::new("image", Kind::Image)];

/// A layer's channel where it lies; nothing where there is no such channel of numbers.
fn placement<'a>(layer: &'a Layer, name: &str) -> Placement<'a> {
    match layer.channel(name).map(|channel| &channel.plane) {
        Some(Plane::F32(plane)) => {
            Placement::Samples(Placed { view: view(plane), x0: layer.data.x0.into(), y0: layer.data.y0.into() })
        }
        _ => Placement::Zero,
    }
}

/// A layer's alpha; a layer without one is opaque.
fn alpha(layer: &Layer) -> Placement<'_> {
    match layer.channel("A") {
        Some(_) => placement(layer, "A"),
        None => Placement::Opaque {
            x0: layer.data.x0.into(),
            y0: layer.data.y0.into(),
            width: layer.data.width(),
            height: layer.data.height(),
        },
    }
}

/// The channels of numbers that any of the layers has, in the order in which they come up, each drawn by `draw` in
/// `window`.
fn combined(
    cx: &Context,
    layers: &[&Layer],
    window: &Rect,
    draw: impl Fn(&str, warploom_algo::view::ViewMut<f32>),
) -> Result<Vec<Channel>, NodeError> {
    let mut channels: Vec<Channel> = Vec::new();
    for channel in layers.iter().flat_map(|layer| &layer.channels) {
        let known = channels.iter().any(|known| known.name == channel.name);
        if known || matches!(channel.plane, Plane::U32(_)) {
            continue;
        }
        let mut plane = cx.plane(window.width(), window.height())?;
        draw(&channel.name, crate::adapt::view_mut(&mut plane));
        channels.push(Channel { plane: Plane::F32(plane.freeze()), ..channel.clone() });
    }
    Ok(channels)
}
