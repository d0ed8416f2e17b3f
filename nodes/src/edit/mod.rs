//! Edits of pictures where a strength says, such as that of Similarity (Brooks, Dodgson 2002).

mod clone;
mod paint;

pub use clone::Clone;
pub use paint::Paint;

use warploom_algo::composite::{Placed, Plane as Placement};
use warploom_algo::edit;
use warploom_algo::view::ViewMut;
use warploom_core::node::{Context, NodeError};
use warploom_core::value::{BufferMut, Image, Raster};

use crate::adapt::{view, view_mut};
use crate::image::colour::{colour, with_planes};

/// Whether a picture that is edited has Y alone for a colour.
fn is_grey(image: &Image) -> Result<bool, NodeError> {
    Ok(colour(image.primary(), "base")?.0.len() == 1)
}

/// A picture whose colour channels `draw(index, base, strength, out)` made anew where the strength is not 0.
fn edited(
    cx: &Context,
    image: &Image,
    mask: &Raster<f32>,
    draw: impl Fn(usize, &edit::Base, Placement, ViewMut<f32>),
) -> Result<Image, NodeError> {
    let layer = image.primary();
    let (names, planes) = colour(layer, "base")?;
    let (alpha, corner) = (crate::image::alpha(layer), [layer.data.x0.into(), layer.data.y0.into()]);
    let [x0, y0] = [mask.windows.data.x0, mask.windows.data.y0].map(i64::from);
    let strength = Placement::Samples(Placed { view: view(&mask.samples), x0, y0 });
    let mut out = cx.planes(names.len(), layer.data.width(), layer.data.height())?;
    for (index, out) in out.iter_mut().enumerate() {
        cx.progress(index as f64 / names.len() as f64)?;
        draw(index, &edit::Base { samples: view(planes[index]), corner, alpha }, strength, view_mut(out));
    }
    Ok(with_planes(image, names, out.into_iter().map(BufferMut::freeze)))
}
