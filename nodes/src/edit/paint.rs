use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::edit;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Image, Kind};

use crate::adapt::Strength;
use crate::image::colour::luma;

/// Paints a picture as strongly as a mask or field says: a of a colour, and 1 - a of what was there.
///
/// It changes R, G and B, or Y, of the first layer; alpha and all else pass through, and what is painted covers as much as
/// the picture does there. Several edits in a row are several of these, on one guide or on the edited picture's.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Paint {
    /// Picture to paint.
    pub base: In<Image>,
    /// a, pixel by pixel; 0 outside its data window. Below 0 paint is taken away.
    pub mask: In<Strength>,
    /// What painting does.
    pub mode: Mode,
    /// Red, green and blue, scene-linear, not premultiplied; Y takes their luma.
    #[default([1.0, 1.0, 1.0])]
    #[schemars(inner(range(min = -1000000.0, max = 1000000.0)))]
    pub color: [f64; 3],
    /// What `Brightness` multiplies the picture by.
    #[default(2.0)]
    #[schemars(range(min = -1000000.0, max = 1000000.0), extend("x-soft" = [0.0, 4.0]))]
    pub scale: f64,
    /// What `Brightness` then adds to it, scene-linear.
    #[schemars(range(min = -1000000.0, max = 1000000.0), extend("x-soft" = [-1.0, 1.0]))]
    pub offset: f64,
}

/// What painting does.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Mode {
    /// Lays `color` on.
    #[default]
    Color,
    /// Scales and offsets what is there: all colours alike, and so its luma.
    Brightness,
}

impl Node for Paint {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("image", Kind::Image)];

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (base, mask) = (cx.get(&self.base), cx.get(&self.mask));
        let color = if super::is_grey(&base)? { [luma(self.color); 3] } else { self.color };
        let painted = super::edited(cx, &base, &mask, |channel, base, strength, out| {
            let paint = match self.mode {
                Mode::Color => edit::Paint::Color(color[channel] as f32),
                Mode::Brightness => edit::Paint::Brightness { scale: self.scale as f32, offset: self.offset as f32 },
            };
            edit::paint(base, paint, strength, out);
        })?;
        Ok(painted.into())
    }
}
