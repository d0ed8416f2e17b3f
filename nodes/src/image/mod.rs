//! Drawing, comparing and putting pictures together.

pub(crate) mod colour;
mod difference;
mod draw_grid;
mod over;
mod resample;

pub use difference::Difference;
pub use draw_grid::DrawGrid;
pub use over::Over;
pub use resample::Resample;

use warploom_algo::composite::{self, Placed, Plane as Placement};
use warploom_algo::view::ViewMut;
use warploom_core::node::{Context, NodeError, Output};
use warploom_core::value::{Buffer, BufferMut, Channel, Kind, Layer, Plane, Rect, Sample};

use crate::adapt::{view, view_mut};

const IMAGE: &[Output] = &[Output::new("image", Kind::Image)];

/// A layer's channel where it lies; nothing where there is no such channel of numbers.
pub(crate) fn placement<'a>(layer: &'a Layer, name: &str) -> Placement<'a> {
    match layer.channel(name).map(|channel| &channel.plane) {
        Some(Plane::F32(plane)) => {
            Placement::Samples(Placed { view: view(plane), x0: layer.data.x0.into(), y0: layer.data.y0.into() })
        }
        _ => Placement::Zero,
    }
}

/// A layer's alpha; a layer without one is opaque.
pub(crate) fn alpha(layer: &Layer) -> Placement<'_> {
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

/// Where planes come from.
struct Planes<'a> {
    cx: &'a Context<'a>,
    /// Whether their memory was asked for beforehand.
    reserved: bool,
}

impl Planes<'_> {
    fn make<T: Sample>(&self, window: &Rect) -> Result<BufferMut<T>, NodeError> {
        let (width, height) = (window.width(), window.height());
        match self.reserved {
            true => self.cx.go_on().map(|()| BufferMut::zeroed(width, height)),
            false => self.cx.plane(width, height),
        }
    }
}

/// The channels that the layers have, in the order in which they come up, in `window`. Those of numbers that it
/// `touches` are drawn by `draw`; others, and identities, which are never mixed, are the first layer's that has them.
fn combined(
    planes: &Planes,
    layers: &[&Layer],
    window: &Rect,
    touches: impl Fn(&str) -> bool,
    draw: impl Fn(&str, ViewMut<f32>),
) -> Result<Vec<Channel>, NodeError> {
    let mut channels: Vec<Channel> = Vec::new();
    for layer in layers {
        for channel in &layer.channels {
            if channels.iter().any(|known| known.name == channel.name) {
                continue;
            }
            let plane = match &channel.plane {
                Plane::U32(plane) => Plane::U32(moved(planes, plane, &layer.data, window)?),
                Plane::F32(plane) if !touches(&channel.name) => Plane::F32(moved(planes, plane, &layer.data, window)?),
                Plane::F32(_) => {
                    let mut plane = planes.make(window)?;
                    draw(&channel.name, view_mut(&mut plane));
                    Plane::F32(plane.freeze())
                }
            };
            channels.push(Channel { plane, ..channel.clone() });
        }
    }
    Ok(channels)
}

/// Samples in another window: shared if it is the same, else copied, with zeros where there are none.
fn moved<T: Sample>(planes: &Planes, plane: &Buffer<T>, from: &Rect, to: &Rect) -> Result<Buffer<T>, NodeError> {
    if from == to {
        return Ok(plane.clone());
    }
    let mut copy = planes.make(to)?;
    let source = Placed { view: view(plane), x0: from.x0.into(), y0: from.y0.into() };
    composite::copy(source, to.x0.into(), to.y0.into(), view_mut(&mut copy));
    Ok(copy.freeze())
}
