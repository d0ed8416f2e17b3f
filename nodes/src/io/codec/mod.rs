//! Image files to pictures and back, in memory.
//!
//! Nothing here knows paths or nodes. Whatever a file claims is checked, and reserved with the caller, before memory
//! is taken for it; a decoder that panics is an unreadable file.

mod coding;
mod color;
mod exr;
mod format;
mod host;
mod icc;
mod pixels;
mod png;
mod raster;
mod tags;
mod tiff;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

pub use format::{EXTENSIONS, Format};
pub use host::Host;
pub(crate) use host::NodeHost;
use host::Within;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_core::node::{ErrorClass, NodeError, Reads};
use warploom_core::value::{Channel, Image, Layer, Plane, SampleType, Value, Windows};

/// How colour is stored in a file. Alpha is linear in every encoding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Encoding {
    /// What the file says of itself: by a profile, or tags. Where it says nothing, and when it is written: `Srgb`
    /// where a file holds integers, `Linear` where it holds floats.
    #[default]
    Auto,
    /// Scene-linear, Rec.709 primaries: no transfer function.
    Linear,
    /// The sRGB transfer function (IEC 61966-2-1).
    Srgb,
    /// Samples as they are: no transfer function, and straight alpha is not premultiplied nor the reverse.
    Raw,
}

/// How a file stores samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Depth {
    /// As each channel was read, in the nearest type of the format that loses nothing. EXR: 8-bit samples as half,
    /// 16-bit ones as float. TIFF: half as float. PNG: 8 bits for anything but 16-bit samples. JPEG: 8 bits.
    #[default]
    Auto,
    /// 8-bit integers.
    U8,
    /// 16-bit integers.
    U16,
    /// 16-bit floats.
    Half,
    /// 32-bit floats.
    Float,
}

/// How an EXR file is compressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Compression {
    /// As the file that was read if that way never loses anything, else `Zip`.
    #[default]
    Auto,
    /// Not at all.
    None,
    /// Run lengths, lossless.
    Rle,
    /// Deflate line by line, lossless.
    Zips,
    /// Deflate by 16 lines, lossless.
    Zip,
    /// Wavelets by 32 lines, lossless; small for grainy plates.
    Piz,
    /// Deflate by 16 lines; floats are cut to 24 bits, all else is lossless.
    Pxr24,
    /// Half samples at a fixed lossy rate.
    B44,
    /// As `B44`, with flat areas smaller.
    B44a,
    /// Lossy cosine transform by 32 lines; small, for looking.
    Dwaa,
    /// Lossy cosine transform by 256 lines; small, for looking.
    Dwab,
}

/// How a picture is to be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, SmartDefault)]
pub struct WriteOptions {
    /// How colour is stored.
    pub encoding: Encoding,
    /// How samples are stored.
    pub depth: Depth,
    /// How an EXR is compressed.
    pub compression: Compression,
    /// Quality of a JPEG, 1..=100.
    #[default(90)]
    pub quality: u8,
}

/// Longest side of a picture, px.
pub(crate) const MAX_SIDE: usize = 65_536;

/// The picture in the bytes of a file, whose format its first bytes tell.
///
/// The result is scene-linear, with Rec.709 primaries (an EXR's stay as they are), and premultiplied, unless `encoding` is `Raw`. Messages name no
/// path.
pub fn decode(bytes: &[u8], encoding: Encoding, host: &dyn Host) -> Result<Image, NodeError> {
    decode_wanted(bytes, encoding, &Reads::All, host)
}

/// What is wanted of the picture in the bytes of a file. Of an EXR other parts are not
/// unpacked.
pub fn decode_wanted(bytes: &[u8], encoding: Encoding, wanted: &Reads, host: &dyn Host) -> Result<Image, NodeError> {
    let whole = unpacked(bytes, encoding, wanted.channels(), host)?;
    Ok(match wanted.channels() {
        Some(names) => whole.with_channels_only(names),
        None => whole,
    })
}

/// The picture, with no less than the wanted channels of the first layer.
fn unpacked(bytes: &[u8], encoding: Encoding, wanted: Option<&[String]>, host: &dyn Host) -> Result<Image, NodeError> {
    let decoded = catch_unwind(AssertUnwindSafe(|| match bytes {
        [] => Err(unreadable("the file is empty")),
        _ if is_exr(bytes) => {
            let needed = wanted.map(|names| color::needed(names, encoding));
            exr::read(bytes, needed.as_deref(), &start(host)).and_then(|i| color::decode(i, encoding, &rest(host)))
        }
        [0x89, b'P', b'N', b'G', ..] => raster::read_png(bytes, encoding, &start(host))?.into_image(&rest(host)),
        [0xff, 0xd8, 0xff, ..] => raster::read_jpeg(bytes, encoding, &start(host))?.into_image(&rest(host)),
        [b'#', b'?', ..] => {
            let pixel_aspect = tags::hdr::pixel_aspect(bytes)?;
            let image = raster::read_hdr(bytes, encoding, &start(host))?.into_image(&rest(host))?;
            Ok(Image { pixel_aspect, ..image })
        }
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => {
            tiff::read(bytes, encoding, &start(host))?.into_image(&rest(host))
        }
        [_] | [_, _] | [_, _, _] => Err(unreadable("the file ends after less than 4 bytes")),
        _ => Err(unsupported("the file is of no format that can be read")
            .hint("EXR, PNG, JPEG, TIFF and Radiance HDR can be read")),
    }));
    let decoded = decoded.unwrap_or_else(|_| Err(unreadable("the file is damaged: its decoder broke down")));
    // A decoder that was stopped takes it for a fault of the file.
    decoded.map_err(|error| host.go_on().err().unwrap_or(error))
}

/// Whether the bytes of a file start as an OpenEXR file's do.
pub(crate) fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

/// The bytes of a file of the format that `extension` (without the dot, in any case) names.
///
/// EXR keeps every layer, channel, window and attribute. The other formats hold the display window of the primary
/// colour (`R`, `G`, `B`, or `Y`, of the first layer, and `A` where the format has alpha); everything else is left
/// out, and pixels outside the data window are 0. Formats without alpha get the colour as seen over black.
pub fn encode_image(
    image: &Image,
    extension: &str,
    options: &WriteOptions,
    host: &dyn Host,
) -> Result<Vec<u8>, NodeError> {
    host.go_on()?;
    match Format::of(extension, options)? {
        Format::Exr => exr::write(&color::encode(image, options.encoding, &start(host))?, options, &rest(host)),
        Format::Png => raster::write_png(image, options, host),
        Format::Jpeg => raster::write_jpeg(image, options, host),
        Format::Hdr => raster::write_hdr(image, options, host),
        Format::Tiff => tiff::write(image, options, host),
    }
}

/// A picture of a value that has pixels: a mask or field as channel `A`, float; labels as channel `id`, uint.
pub fn as_image(value: &Value) -> Option<Image> {
    let (windows, name, sample_type, plane) = match value {
        Value::Image(image) => return Some((**image).clone()),
        Value::Mask(mask) => (mask.0.windows, "A", SampleType::Float, Plane::F32(mask.0.samples.clone())),
        Value::Field(field) => (field.0.windows, "A", SampleType::Float, Plane::F32(field.0.samples.clone())),
        Value::Labels(labels) => {
            (labels.raster.windows, "id", SampleType::Uint, Plane::U32(labels.raster.samples.clone()))
        }
        _ => return None,
    };
    let Windows { display, data, pixel_aspect } = windows;
    let channels = vec![Channel { name: name.into(), sample_type, plane }];
    let layers = vec![Layer { name: "".into(), data, channels, metadata: Arc::default() }];
    Some(Image { display, pixel_aspect, metadata: Arc::default(), layers })
}

/// The host of the first half of the work.
fn start(host: &dyn Host) -> Within<'_> {
    Within { host, from: 0.0, to: 0.5 }
}

/// The host of the second half.
fn rest(host: &dyn Host) -> Within<'_> {
    Within { host, from: 0.5, to: 1.0 }
}

fn unreadable(message: impl Into<String>) -> NodeError {
    NodeError::new(ErrorClass::InputUnreadable, message)
}

fn unsupported(message: impl Into<String>) -> NodeError {
    NodeError::new(ErrorClass::InputUnsupported, message)
}

/// Bytes of a plane of 4-byte samples in rows of whole cache lines.
fn plane_bytes(width: usize, height: usize) -> u128 {
    width.next_multiple_of(16) as u128 * height as u128 * 4
}

/// Bytes of a plane, however the picture is turned.
fn turned_plane_bytes(width: usize, height: usize) -> u128 {
    plane_bytes(width, height).max(plane_bytes(height, width))
}

/// Refuses sizes that no picture has.
fn check_size(width: u64, height: u64) -> Result<(), NodeError> {
    let sides = 1..=MAX_SIDE as u64;
    if sides.contains(&width) && sides.contains(&height) {
        return Ok(());
    }
    Err(unsupported(format!("the picture is {width} x {height} px; a side may be 1 to {MAX_SIDE} px long")))
}

#[cfg(test)]
mod round_trips;
#[cfg(test)]
mod tests;
