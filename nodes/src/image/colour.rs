//! The channels that carry a layer's colour.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use warploom_algo::transfer;
use warploom_core::node::NodeError;
use warploom_core::value::{Buffer, Image, Layer, Plane};

/// The channels that carry a layer's colour: R, G and B, or Y alone.
pub(crate) const COLOUR: [&[&str]; 2] = [&["R", "G", "B"], &["Y"]];

/// The names and planes of the colour of the layer on a port; Y stands for all three.
pub(crate) fn colour<'a>(
    layer: &'a Layer,
    port: &'static str,
) -> Result<(&'static [&'static str], [&'a Buffer<f32>; 3]), NodeError> {
    let plane = |name: &&str| match layer.channel(name).map(|channel| &channel.plane) {
        Some(Plane::F32(plane)) => Some(plane),
        _ => None,
    };
    let found = COLOUR.iter().find_map(|names| {
        let planes: Vec<&Buffer<f32>> = names.iter().filter_map(plane).collect();
        (planes.len() == names.len()).then(|| (*names, [0, 1, 2].map(|i| planes[i % planes.len()])))
    });
    found.ok_or_else(|| {
        NodeError::refused(
            "the picture needs channels R, G and B, or Y, that hold numbers; its first layer has neither",
        )
        .at(port)
        .hint("connect a picture with colour")
    })
}

/// A picture with other planes for some channels of its first layer, which it has.
pub(crate) fn with_planes(image: &Image, names: &[&str], planes: impl IntoIterator<Item = Buffer<f32>>) -> Image {
    let mut layers = image.layers.clone();
    let mut channels = layers[0].channels.clone();
    for (name, plane) in names.iter().zip(planes) {
        let channel = channels.iter_mut().find(|channel| &*channel.name == *name).expect("the layer has it");
        channel.plane = Plane::F32(plane);
    }
    layers[0] = Layer { channels, ..layers[0].clone() };
    Image { layers, ..image.clone() }
}

/// Rec.709 luma of a colour.
pub(crate) fn luma([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// What is compared of scene-linear samples.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Encoding {
    /// Their sRGB encoding, near to how differences are seen.
    #[default]
    Srgb,
    /// Themselves.
    Linear,
}

impl From<Encoding> for transfer::Encoding {
    fn from(encoding: Encoding) -> Self {
        match encoding {
            Encoding::Srgb => Self::Srgb,
            Encoding::Linear => Self::Linear,
        }
    }
}
