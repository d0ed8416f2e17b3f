//! Encodings of pictures that are premultiplied already: those of EXR.

use rayon::prelude::*;
use warploom_algo::transfer;
use warploom_algo::view::ViewMut;
use warploom_core::node::NodeError;
use warploom_core::value::{Buffer, BufferMut, Image, Layer, Plane};

use super::host::Host;
use super::{Encoding, plane_bytes};

/// Channels that an encoding applies to.
const COLOR: [&str; 4] = ["R", "G", "B", "Y"];

/// A picture as read, made scene-linear.
pub fn decode(image: Image, encoding: Encoding, host: &dyn Host) -> Result<Image, NodeError> {
    match encoding {
        Encoding::Srgb => map_color(&image, transfer::srgb_to_linear, host),
        _ => Ok(image),
    }
}

/// The channels that those of these names are made of: straight colour is had by alpha.
pub fn needed(names: &[String], encoding: Encoding) -> Vec<String> {
    let of_alpha = encoding == Encoding::Srgb && names.iter().any(|name| COLOR.contains(&&**name));
    names.iter().cloned().chain(of_alpha.then(|| "A".to_owned())).collect()
}

/// A scene-linear picture as it is to be written.
pub fn encode(image: &Image, encoding: Encoding, host: &dyn Host) -> Result<Image, NodeError> {
    match encoding {
        Encoding::Srgb => map_color(image, transfer::linear_to_srgb, host),
        _ => Ok(image.clone()),
    }
}

/// `f` of the straight colour of the first layer.
fn map_color(image: &Image, f: fn(f32) -> f32, host: &dyn Host) -> Result<Image, NodeError> {
    let mut mapped = image.clone();
    let Some(primary) = mapped.layers.first_mut() else { return Ok(mapped) };
    let alpha = alpha_of(primary);
    for channel in primary.channels.iter_mut().filter(|channel| COLOR.contains(&&*channel.name)) {
        let Plane::F32(plane) = &channel.plane else { continue };
        host.reserve(plane_bytes(plane.width(), plane.height()))?;
        channel.plane = Plane::F32(fill(plane.width(), plane.height(), host, |y, row| {
            row.copy_from_slice(plane.row(y));
            match &alpha {
                Some(alpha) => transfer::map_premultiplied(row, alpha.row(y), f),
                None => row.iter_mut().for_each(|c| *c = f(*c)),
            }
        })?);
    }
    Ok(mapped)
}

fn alpha_of(layer: &Layer) -> Option<Buffer<f32>> {
    match &layer.channel("A")?.plane {
        Plane::F32(plane) => Some(plane.clone()),
        Plane::U32(_) => None,
    }
}

/// Rows between two looks at the host.
const BAND: usize = 8;

/// A plane of which `f(y, row)` writes each row, rows side by side.
pub fn fill(
    width: usize,
    height: usize,
    host: &dyn Host,
    f: impl Fn(usize, &mut [f32]) + Sync,
) -> Result<Buffer<f32>, NodeError> {
    let mut plane = BufferMut::zeroed(width, height);
    let stride = plane.stride();
    let bands = ViewMut::new(plane.samples_mut(), width, height, stride).bands(BAND);
    bands.into_par_iter().try_for_each(|(top, mut band)| {
        (0..band.height()).for_each(|row| f(top + row, band.row_mut(row)));
        host.go_on()
    })?;
    Ok(plane.freeze())
}
