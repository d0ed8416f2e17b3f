use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::composite;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{BufferMut, Image, Layer, Rect};

use super::Planes;

/// Lays pictures over each other, premultiplied; the first is in front.
///
/// Format, metadata and further layers are the last one's; the data window holds all of them. A picture without alpha
/// hides what lies behind it. Identities are not mixed: they are the hindmost picture's.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Over {
    /// Pictures, front to back.
    pub images: Vec<In<Image>>,
}

impl Node for Over {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::IMAGE;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let images = cx.get_all(&self.images);
        let (last, fronts) = images.split_last().ok_or_else(|| {
            NodeError::refused("there are no pictures; at least one is needed").at("images").hint("connect one")
        })?;
        let window = images.iter().fold(Rect::default(), |window, image| window.union(&image.primary().data));
        let channels = images.iter().flat_map(|image| &image.primary().channels).map(|channel| &channel.name);
        // Of all that is laid over each other two pictures are there at a time: what lies behind, and the next.
        let planes = channels.collect::<BTreeSet<_>>().len() * fronts.len().min(2);
        cx.reserve(planes as u128 * BufferMut::<f32>::bytes_for(window.width(), window.height()))?;
        let mut behind = (**last).clone();
        for (number, front) in fronts.iter().rev().enumerate() {
            cx.progress(number as f64 / fronts.len() as f64)?;
            behind = over(&Planes { cx, reserved: true }, front, behind)?;
        }
        Ok(behind.into())
    }
}

fn over(planes: &Planes, front: &Image, behind: Image) -> Result<Image, NodeError> {
    let (f, b) = (front.primary(), behind.primary());
    let data = f.data.union(&b.data);
    let (x0, y0) = (data.x0.into(), data.y0.into());
    let channels = super::combined(
        planes,
        &[b, f],
        &data,
        |_| true,
        |name, out| {
            let (front, back) = match name {
                "A" => (super::alpha(f), super::alpha(b)),
                name => (super::placement(f, name), super::placement(b, name)),
            };
            composite::over(front, super::alpha(f), back, x0, y0, out);
        },
    )?;
    let mut layers = behind.layers.clone();
    layers[0] = Layer { data, channels, ..b.clone() };
    Ok(Image { layers, ..behind })
}
