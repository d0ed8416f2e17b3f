//! PNG, JPEG and Radiance HDR, by way of the image crate.

use std::io::Cursor;

use image::codecs::hdr::{HdrDecoder, HdrEncoder};
use image::codecs::jpeg::{JpegDecoder, JpegEncoder};
use image::codecs::png::PngDecoder;
use image::{DynamicImage, ImageBuffer, ImageDecoder, ImageEncoder, ImageError, Limits};
use rayon::prelude::*;
use warploom_core::node::NodeError;
use warploom_core::value::{Image, SampleType};

use super::coding::Coding;
use super::host::{Host, Sink, Source, joined};
use super::pixels::{Alpha, Pixels, Samples, deepest};
use super::{
    Depth, Encoding, WriteOptions, check_size, icc, png, rest, start, tags, turned_plane_bytes, unreadable, unsupported,
};

/// Room for what a decoder keeps beside the pixels: rows, tables, texts.
const SCRATCH: u64 = 16 << 20;

/// Reads a PNG: 8 or 16 bits, alpha straight; palettes and less than 8 bits become 8 bits.
pub fn read_png(bytes: &[u8], encoding: Encoding, host: &dyn Host) -> Result<Pixels, NodeError> {
    if let Some([width, height]) = png_size(bytes) {
        check_size(width.into(), height.into())?;
    }
    let coding = Coding::of_file(encoding, false, || tags::png::coding(bytes, host))?;
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(SCRATCH);
    let decoder = PngDecoder::with_limits(Source::new(bytes, host), limits).map_err(image_error)?;
    read(decoder, coding, host)?.upright(tags::png::orientation(bytes), host)
}

/// The size in a PNG's head, if there is one. The decoder takes one that is absurd for a want of memory.
fn png_size(bytes: &[u8]) -> Option<[u32; 2]> {
    let [b'I', b'H', b'D', b'R', size @ ..] = bytes.get(12..24)? else { return None };
    let (width, height) = (size.first_chunk()?, size.last_chunk()?);
    Some([width, height].map(|side| u32::from_be_bytes(*side)))
}

/// Reads a JPEG: 8 bits.
pub fn read_jpeg(bytes: &[u8], encoding: Encoding, host: &dyn Host) -> Result<Pixels, NodeError> {
    tags::jpeg::check(bytes)?;
    let coding = Coding::of_file(encoding, false, || tags::jpeg::coding(bytes, host))?;
    // The decoder copies the file. The coefficients of a progressive one take less than the planes that follow.
    host.reserve(bytes.len() as u128)?;
    let decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(image_error)?;
    read(decoder, coding, host)?.upright(tags::jpeg::orientation(bytes), host)
}

/// Reads a Radiance HDR: floats with a shared exponent.
pub fn read_hdr(bytes: &[u8], encoding: Encoding, host: &dyn Host) -> Result<Pixels, NodeError> {
    tags::hdr::check(bytes)?;
    let coding = Coding::of_file(encoding, true, || tags::hdr::coding(bytes))?;
    // What a line says is looked at here, and overruled where an encoding is given.
    read(HdrDecoder::new_nonstrict(Source::new(bytes, host)).map_err(image_error)?, coding, host)
}

/// Reads what `decoder` finds.
fn read(decoder: impl ImageDecoder, coding: Coding, host: &dyn Host) -> Result<Pixels, NodeError> {
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into())?;
    let planes = u128::from(decoder.color_type().channel_count()) * turned_plane_bytes(width as usize, height as usize);
    host.reserve(u128::from(decoder.total_bytes()) + planes)?;
    let has_alpha = decoder.color_type().has_alpha();
    let samples = match DynamicImage::from_decoder(decoder).map_err(image_error)? {
        DynamicImage::ImageLuma8(pixels) => Samples::U8(pixels.into_raw()),
        DynamicImage::ImageLumaA8(pixels) => Samples::U8(pixels.into_raw()),
        DynamicImage::ImageRgb8(pixels) => Samples::U8(pixels.into_raw()),
        DynamicImage::ImageRgba8(pixels) => Samples::U8(pixels.into_raw()),
        DynamicImage::ImageLuma16(pixels) => Samples::U16(pixels.into_raw()),
        DynamicImage::ImageLumaA16(pixels) => Samples::U16(pixels.into_raw()),
        DynamicImage::ImageRgb16(pixels) => Samples::U16(pixels.into_raw()),
        DynamicImage::ImageRgba16(pixels) => Samples::U16(pixels.into_raw()),
        DynamicImage::ImageRgb32F(pixels) => Samples::F32(pixels.into_raw()),
        DynamicImage::ImageRgba32F(pixels) => Samples::F32(pixels.into_raw()),
        other => return Err(unsupported(format!("pixels of type {:?} cannot be read", other.color()))),
    };
    let alpha = if has_alpha { Alpha::Straight } else { Alpha::None };
    Ok(Pixels { width: width as usize, height: height as usize, alpha, coding, samples })
}

/// Writes a PNG of 8 or 16 bits, alpha straight.
pub fn write_png(image: &Image, options: &WriteOptions, host: &dyn Host) -> Result<Vec<u8>, NodeError> {
    let depth = match (options.depth, deepest(image)) {
        (Depth::Auto, SampleType::U16) => Depth::U16,
        (Depth::Auto, _) => Depth::U8,
        (depth, _) => depth,
    };
    let pixels = Pixels::of_image(image, depth, options.encoding, true, &start(host))?;
    png::encode(&pixels, &rest(host))
}

/// Writes a JPEG of 8 bits.
pub fn write_jpeg(image: &Image, options: &WriteOptions, host: &dyn Host) -> Result<Vec<u8>, NodeError> {
    let pixels = Pixels::of_image(image, Depth::U8, options.encoding, false, &start(host))?;
    let profile = icc::written(&pixels.coding, pixels.samples_per_pixel() == 1);
    write(pixels, &rest(host), |image, out| {
        let mut encoder = JpegEncoder::new_with_quality(out, options.quality.clamp(1, 100));
        profile.map_or(Ok(()), |profile| encoder.set_icc_profile(profile)).map_err(ImageError::Unsupported)?;
        image.write_with_encoder(encoder)
    })
}

/// Samples between two looks at the host.
const RUN: usize = 1 << 18;

/// Just above the smallest number and below the largest that RGBE holds with all its digits.
const HDR_MIN: f32 = 3.0e-39;
const HDR_MAX: f32 = 1.0e38;

/// Writes a Radiance HDR; grey becomes three equal colours.
pub fn write_hdr(image: &Image, options: &WriteOptions, host: &dyn Host) -> Result<Vec<u8>, NodeError> {
    let mut pixels = Pixels::of_image(image, Depth::Float, options.encoding, false, &start(host))?;
    if let (1, Samples::F32(samples)) = (pixels.samples_per_pixel(), &mut pixels.samples) {
        host.reserve(3 * size_of_val(samples.as_slice()) as u128)?;
        *samples = samples.iter().flat_map(|&y| [y; 3]).collect();
    }
    if let Samples::F32(samples) = &mut pixels.samples {
        // The format's exponent ends below 2^127; it has no place for what is negative, tinier, or no number.
        samples.par_chunks_mut(RUN).try_for_each(|run| {
            run.iter_mut().for_each(|sample| *sample = if *sample > HDR_MIN { sample.min(HDR_MAX) } else { 0.0 });
            host.go_on()
        })?;
    }
    write(pixels, &rest(host), |image, out| image.write_with_encoder(HdrEncoder::new(out)))
}

fn write(
    pixels: Pixels,
    host: &dyn Host,
    encode: impl FnOnce(DynamicImage, &mut Sink) -> Result<(), ImageError>,
) -> Result<Vec<u8>, NodeError> {
    let mut sink = Sink::new(host);
    let encoded = encode(dynamic(pixels), &mut sink);
    let pieces = sink.pieces()?;
    encoded.map_err(|e| NodeError::refused(format!("cannot be encoded: {e}")))?;
    joined(pieces, host)
}

fn dynamic(pixels: Pixels) -> DynamicImage {
    let (width, height) = (pixels.width as u32, pixels.height as u32);
    let count = pixels.samples_per_pixel();
    macro_rules! of {
        ($variant:ident, $samples:expr) => {
            ImageBuffer::from_raw(width, height, $samples).map(DynamicImage::$variant)
        };
    }
    let image = match (pixels.samples, count) {
        (Samples::U8(samples), 1) => of!(ImageLuma8, samples),
        (Samples::U8(samples), 2) => of!(ImageLumaA8, samples),
        (Samples::U8(samples), 3) => of!(ImageRgb8, samples),
        (Samples::U8(samples), _) => of!(ImageRgba8, samples),
        (Samples::U16(samples), 1) => of!(ImageLuma16, samples),
        (Samples::U16(samples), 2) => of!(ImageLumaA16, samples),
        (Samples::U16(samples), 3) => of!(ImageRgb16, samples),
        (Samples::U16(samples), _) => of!(ImageRgba16, samples),
        (Samples::F32(samples), _) => of!(ImageRgb32F, samples),
    };
    image.expect("a sample count that fits the size")
}

fn image_error(error: ImageError) -> NodeError {
    let message = error.to_string().replace('\n', " ");
    match error {
        ImageError::Unsupported(_) => unsupported(message),
        ImageError::Limits(_) => unreadable("the file is damaged: it unpacks to more than it says"),
        ImageError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => unreadable("the file ends early"),
        _ => unreadable(format!("the file is damaged: {message}")),
    }
}
