use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::composite::{Placed, Plane};
use warploom_algo::{edit, mask};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Buffer, Image, Kind, Layer};

use crate::adapt::{Strength, view, view_mut, window};
use crate::image::colour::colour;

/// Lays a texture upon a picture as strongly as a mask or field says: a of the texture, and 1 - a of what was there.
///
/// It changes R, G and B, or Y, of the first layer; alpha and all else pass through: the texture is laid atop, where the
/// picture is. Where the texture is transparent the picture stays. Of the texture its format is shown; unmoved, its
/// pixels lie on those of the same place.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Clone {
    /// Picture to change.
    pub base: In<Image>,
    /// a, pixel by pixel; 0 outside its data window.
    pub mask: In<Strength>,
    /// What is laid upon it. On a picture that has only Y, its luma.
    pub texture: In<Image>,
    /// How far the texture is moved, to the nearest whole px.
    #[schemars(inner(range(min = -16777216.0, max = 16777216.0)), extend("x-unit" = "px"))]
    pub offset: [f64; 2],
    /// Whether the texture repeats beyond its format; else nothing is laid there.
    #[default(true)]
    pub repeat: bool,
}

impl Node for Clone {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("image", Kind::Image)];

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (base, mask, texture) = (cx.get(&self.base), cx.get(&self.mask), cx.get(&self.texture));
        let layer = texture.primary();
        let planes = planes(cx, layer, super::is_grey(&base)?)?;
        let (data, offset) = (window(&layer.data), self.offset.map(|by| by.round() as i64));
        let cloned = super::edited(cx, &base, &mask, |channel, base, strength, out| {
            let samples = Placed { view: view(&planes[channel]), x0: data.x0, y0: data.y0 };
            let texture = edit::Texture {
                samples: Plane::Samples(samples),
                alpha: crate::image::alpha(layer),
                window: window(&texture.display),
                offset,
                repeat: self.repeat,
            };
            edit::lay(base, &texture, strength, out);
        })?;
        Ok(cloned.into())
    }
}

/// The planes of the texture's colour; all are its luma where only that is wanted.
fn planes(cx: &Context, layer: &Layer, luma: bool) -> Result<[Buffer<f32>; 3], NodeError> {
    let (names, planes) = colour(layer, "texture")?;
    if !luma || names.len() == 1 {
        return Ok(planes.map(Buffer::clone));
    }
    let mut plane = cx.plane(layer.data.width(), layer.data.height())?;
    let [r, g, b] = planes.map(view);
    mask::luma(r, g, b, view_mut(&mut plane));
    let plane = plane.freeze();
    Ok([plane.clone(), plane.clone(), plane])
}
