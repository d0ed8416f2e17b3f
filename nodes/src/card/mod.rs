//! Test cards.

mod checker;
mod constant;
mod ramp;

pub use checker::Checker;
pub use constant::Constant;
pub use ramp::Ramp;

use warploom_algo::view::ViewMut;
use warploom_core::node::{Context, NodeError};
use warploom_core::value::{Channel, Image, Plane, Rect, SampleType};

/// A picture with channels R, G, B, A at the origin; `draw` fills one channel's plane.
fn rgba(cx: &Context, size: [u32; 2], draw: impl Fn(usize, ViewMut<f32>)) -> Result<Image, NodeError> {
    let (width, height) = (size[0] as usize, size[1] as usize);
    let planes = cx.planes(4, width, height)?.into_iter().zip(["R", "G", "B", "A"]).enumerate();
    let drawn = planes.map(|(index, (mut plane, name))| {
        cx.progress(index as f64 / 4.0)?;
        draw(index, crate::adapt::view_mut(&mut plane));
        Ok(Channel { name: name.into(), sample_type: SampleType::Float, plane: Plane::F32(plane.freeze()) })
    });
    let channels = drawn.collect::<Result<_, NodeError>>()?;
    Ok(Image::new(Rect::at(0, 0, width, height), channels))
}
