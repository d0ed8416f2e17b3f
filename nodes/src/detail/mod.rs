//! Detail for pictures that a warp magnified (Brooks, Dodgson 2002; Hertzmann et al. 2001).

mod resynthesis;
mod similar_sets;

pub use resynthesis::Detail;
pub use similar_sets::SimilarSets;

use warploom_core::node::NodeError;
use warploom_core::value::{Buffer, Layer, Plane};

/// The channels that carry a layer's colour: R, G and B, or Y alone.
const COLOUR: [&[&str]; 2] = [&["R", "G", "B"], &["Y"]];

/// The names and planes of a layer's colour; Y stands for all three.
fn colour(layer: &Layer) -> Result<(&'static [&'static str], [&Buffer<f32>; 3]), NodeError> {
    let plane = |name: &&str| match layer.channel(name).map(|channel| &channel.plane) {
        Some(Plane::F32(plane)) => Some(plane),
        _ => None,
    };
    let found = COLOUR.iter().find_map(|names| {
        let planes: Vec<&Buffer<f32>> = names.iter().filter_map(plane).collect();
        (planes.len() == names.len()).then(|| (*names, [0, 1, 2].map(|i| planes[i % planes.len()])))
    });
    found
        .ok_or_else(|| NodeError::refused("the picture needs channels R, G and B, or Y, that hold numbers").at("image"))
}
