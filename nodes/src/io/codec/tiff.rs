//! TIFF, by way of the tiff crate: it tells how alpha is associated, and has grey floats.

use std::borrow::Cow;
use std::io::Cursor;

use tiff::decoder::{ChunkType, Decoder, DecodingResult, Limits};
use tiff::encoder::{TiffEncoder, TiffValue, colortype};
use tiff::tags::{CompressionMethod, ExtraSamples, PhotometricInterpretation, SampleFormat, Tag, Type};
use tiff::{ColorType, TiffError, TiffResult};
use warploom_core::node::{ErrorClass, NodeError};
use warploom_core::value::{Image, SampleType};

use super::coding::Coding;
use super::host::{Host, Source};
use super::pixels::{Alpha, Pixels, Samples, deepest};
use super::{
    Depth, Encoding, WriteOptions, check_size, icc, rest, start, tags, turned_plane_bytes, unreadable, unsupported,
};

/// Reads the first picture of a TIFF: grey or RGB, with alpha or without, 8 or 16 bits or float.
pub fn read(bytes: &[u8], encoding: Encoding, host: &dyn Host) -> Result<Pixels, NodeError> {
    host.reserve(VALUE_BYTES * largest_list(bytes)?)?;
    let mut decoder = Decoder::new(Source::new(bytes, host)).map_err(tiff_error)?;
    let (width, height) = decoder.dimensions().map_err(tiff_error)?;
    check_size(width.into(), height.into())?;
    let (count, bits) = layout(&mut decoder)?;
    let is_float = bits == 32;
    let coding = Coding::of_file(encoding, is_float, || tags::tiff::coding(&mut decoder, count < 3, is_float, host))?;
    let orientation = tags::tiff::orientation(&mut decoder)?;
    let alpha = match (count, decoder.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples).map_err(tiff_error)?) {
        (1 | 3, _) => Alpha::None,
        (2, Some(extra)) if extra.first() == Some(&ExtraSamples::Unspecified.to_u16()) => {
            return Err(unsupported("its pixels have a second sample beside grey that is not said to be alpha")
                .hint("keep the grey alone: oiiotool in.tif --ch 0 -o out.tif"));
        }
        (_, Some(extra)) if extra.first() == Some(&ExtraSamples::AssociatedAlpha.to_u16()) => Alpha::Premultiplied,
        _ => Alpha::Straight,
    };
    let pixel_bytes = width as usize * height as usize * count * usize::from(bits / 8);
    // Beside the pixels the decoder holds one strip or tile: at most the picture, but for a tile's padding.
    let (chunk_width, chunk_height) = decoder.chunk_dimensions();
    let chunk_bytes = u128::from(chunk_width) * u128::from(chunk_height) * count as u128 * u128::from(bits / 8);
    let scratch = chunk_bytes.max(pixel_bytes as u128) + (1 << 20);
    // The scratch is free again before the planes are made.
    let planes = count as u128 * turned_plane_bytes(width as usize, height as usize);
    host.reserve(pixel_bytes as u128 + scratch.max(planes))?;
    let mut limits = Limits::default();
    limits.decoding_buffer_size = pixel_bytes;
    limits.intermediate_buffer_size = usize::try_from(scratch).unwrap_or(usize::MAX);
    let mut decoder = decoder.with_limits(limits.clone());
    let mut result = DecodingResult::U8(Vec::new());
    let layout = decoder.image_buffer_layout().map_err(tiff_error)?;
    let planar = layout.planes > 1;
    let read = if planar && decoder.get_chunk_type() == ChunkType::Tile {
        result.resize_to(&layout, &limits).map_err(tiff_error)?;
        read_planes(&mut decoder, &mut result, [width as usize, height as usize], usize::from(bits / 8))
    } else {
        decoder.read_image_to_buffer(&mut result).map(drop)
    };
    read.map_err(|error| damaged(error, &mut decoder))?;
    let samples = match result {
        DecodingResult::U8(samples) => Samples::U8(interleaved(samples, planar, count, host)?),
        DecodingResult::U16(samples) => Samples::U16(interleaved(samples, planar, count, host)?),
        DecodingResult::F32(samples) => Samples::F32(interleaved(samples, planar, count, host)?),
        _ => return Err(unsupported(format!("TIFF samples of {bits} bits of this sort cannot be read"))),
    };
    let pixels = Pixels { width: width as usize, height: height as usize, alpha, coding, samples };
    match pixels.samples_per_pixel() == count {
        true => pixels.upright(orientation, host),
        false => Err(unreadable("the file is damaged: it holds fewer samples than it says")),
    }
}

/// What is wrong with a file, or with its decoder: that loses the end of tiles of LZW at the picture's edge.
fn damaged(error: TiffError, decoder: &mut Decoder<Source>) -> NodeError {
    let compression = decoder.find_tag_unsigned::<u16>(Tag::Compression);
    let is_lzw = matches!(compression, Ok(Some(method)) if method == CompressionMethod::LZW.to_u16());
    let (size, tile) = (decoder.dimensions().unwrap_or((0, 0)), decoder.chunk_dimensions());
    let is_cut = !size.0.is_multiple_of(tile.0.max(1)) || !size.1.is_multiple_of(tile.1.max(1));
    match decoder.get_chunk_type() {
        ChunkType::Tile if is_lzw && is_cut => {
            unsupported("tiles of LZW cannot be read where they reach over the picture's edge")
                .hint("pack it otherwise: oiiotool in.tif --compression zip -o out.tif")
        }
        _ => tiff_error(error),
    }
}

/// Reads planes of tiles, tile by tile. The crate's reader of whole pictures cuts the lowest tiles of the first plane
/// only, and panics at the last one.
fn read_planes(
    decoder: &mut Decoder<Source>,
    result: &mut DecodingResult,
    [width, height]: [usize; 2],
    sample_bytes: usize,
) -> TiffResult<()> {
    let (tile_width, tile_height) = decoder.chunk_dimensions();
    let (mut tile, mut index) = (Vec::new(), 0);
    for plane in result.as_buffer(0).as_bytes_mut().chunks_exact_mut(width * height * sample_bytes) {
        for top in (0..height).step_by(tile_height as usize) {
            for left in (0..width).step_by(tile_width as usize) {
                let (columns, rows) = decoder.chunk_data_dimensions(index);
                let row_bytes = columns as usize * sample_bytes;
                tile.resize(rows as usize * row_bytes, 0);
                decoder.read_chunk_bytes(index, &mut tile)?;
                for (y, row) in tile.chunks_exact(row_bytes).take(height - top).enumerate() {
                    plane[((top + y) * width + left) * sample_bytes..][..row_bytes].copy_from_slice(row);
                }
                index += 1;
            }
        }
    }
    Ok(())
}

/// Bytes that the decoder takes for a number of a list: as a value of any type, and as what it is wanted as,
/// beside the list before.
const VALUE_BYTES: u128 = 32 + 8 + 8;

/// Tags that the decoder reads, each as a list of as many numbers as the file says: sizes, depths, strips, tiles, sorts
/// of samples, orientation, primaries.
const READ: [u16; 22] =
    [256, 257, 258, 259, 262, 273, 274, 277, 278, 279, 284, 317, 318, 319, 322, 323, 324, 325, 338, 339, 347, 530];

/// The count of the longest list in the first directory, each of which must fit into the file: the decoder makes
/// room for as many numbers as it says.
fn largest_list(bytes: &[u8]) -> Result<u128, NodeError> {
    let is_big = matches!(bytes, [_, _, 43, ..] | [_, _, _, 43, ..]);
    let number = |at: usize, size: usize| -> Result<u64, NodeError> {
        let number =
            bytes.get(at..).and_then(|rest| rest.get(..size)).ok_or_else(|| unreadable("the file ends early"))?;
        let add = |sum: u64, &byte: &u8| sum << 8 | u64::from(byte);
        Ok(if bytes[0] == b'M' { number.iter().fold(0, add) } else { number.iter().rev().fold(0, add) })
    };
    let (word, counter) = if is_big { (8, 8) } else { (4, 2) };
    let directory = usize::try_from(number(word, word)?).unwrap_or(usize::MAX);
    let (entry_bytes, mut largest) = (4 + 2 * word, 0);
    for index in 0..number(directory, counter)? {
        let offset = usize::try_from(index).unwrap_or(usize::MAX).saturating_mul(entry_bytes);
        let at = directory.saturating_add(counter).saturating_add(offset);
        let (tag, count) = (number(at, 2)? as u16, number(at.saturating_add(4), word)?);
        if READ.contains(&tag) {
            if count > bytes.len() as u64 {
                return Err(unreadable(format!(
                    "the file is damaged: tag {tag} has {count} values in {} bytes",
                    bytes.len()
                )));
            }
            largest = largest.max(count.into());
        }
    }
    Ok(largest)
}

/// Samples per pixel and bits per sample.
fn layout(decoder: &mut Decoder<Source>) -> Result<(usize, u8), NodeError> {
    let color = decoder.colortype().map_err(tiff_error)?;
    let formats = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat).map_err(tiff_error)?;
    let is_float = formats.and_then(|formats| formats.first().copied()) == Some(SampleFormat::IEEEFP.to_u16());
    let white_is_zero = decoder.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation).map_err(tiff_error)?
        == Some(PhotometricInterpretation::WhiteIsZero.to_u16());
    let (count, bits) = match color {
        ColorType::Gray(bits) => (1, bits),
        ColorType::Multiband { bit_depth, num_samples: 2 } if !white_is_zero => (2, bit_depth),
        ColorType::RGB(bits) => (3, bits),
        ColorType::RGBA(bits) => (4, bits),
        other => {
            return Err(unsupported(format!("TIFF pixels of type {other:?} cannot be read"))
                .hint("convert it to RGB: oiiotool in.tif --ch R,G,B -o out.tif"));
        }
    };
    match (bits, is_float) {
        (8 | 16, false) | (32, true) => Ok((count, bits)),
        _ => {
            let sort = if is_float { "float" } else { "integer" };
            Err(unsupported(format!("TIFF samples of {bits} bits ({sort}) cannot be read"))
                .hint("8 and 16 bit integers and 32 bit floats can: oiiotool in.tif -d float -o out.tif"))
        }
    }
}

/// Pixels that are put together between two looks at the host.
const RUN: usize = 1 << 16;

/// Pixel by pixel, from plane by plane; the second copy takes no more than the planes of the picture will.
fn interleaved<T: Copy>(samples: Vec<T>, planar: bool, count: usize, host: &dyn Host) -> Result<Vec<T>, NodeError> {
    if !planar {
        return Ok(samples);
    }
    let plane = samples.len() / count;
    let mut pixels = Vec::with_capacity(plane * count);
    for start in (0..plane).step_by(RUN) {
        host.go_on()?;
        let run = start..plane.min(start + RUN);
        pixels.extend(run.flat_map(|i| (0..count).map(move |c| (i, c))).map(|(i, c)| samples[c * plane + i]));
    }
    Ok(pixels)
}

/// Writes a TIFF without compression; alpha is marked as straight, or as premultiplied where samples are `Raw`.
pub fn write(image: &Image, options: &WriteOptions, host: &dyn Host) -> Result<Vec<u8>, NodeError> {
    let depth = match (options.depth, deepest(image)) {
        (Depth::Auto, SampleType::U8) => Depth::U8,
        (Depth::Auto, SampleType::U16) => Depth::U16,
        (Depth::Auto, _) => Depth::Float,
        (depth, _) => depth,
    };
    let pixels = Pixels::of_image(image, depth, options.encoding, true, &start(host))?;
    let is_grey = pixels.samples_per_pixel() < 3;
    let written = match (&pixels.samples, is_grey) {
        (Samples::U8(samples), true) => encode::<colortype::Gray8>(&pixels, samples, &rest(host)),
        (Samples::U8(samples), false) => encode::<colortype::RGB8>(&pixels, samples, &rest(host)),
        (Samples::U16(samples), true) => encode::<colortype::Gray16>(&pixels, samples, &rest(host)),
        (Samples::U16(samples), false) => encode::<colortype::RGB16>(&pixels, samples, &rest(host)),
        (Samples::F32(samples), true) => encode::<colortype::Gray32Float>(&pixels, samples, &rest(host)),
        (Samples::F32(samples), false) => encode::<colortype::RGB32Float>(&pixels, samples, &rest(host)),
    }?;
    written.map_err(|e| NodeError::refused(format!("cannot be encoded: {e}")))
}

/// Room for a TIFF's tables, which have 16 bytes a strip of a megabyte.
const TABLES: usize = 1 << 18;

fn encode<C: colortype::ColorType>(
    pixels: &Pixels,
    samples: &[C::Inner],
    host: &dyn Host,
) -> Result<Result<Vec<u8>, TiffError>, NodeError>
where
    [C::Inner]: TiffValue,
{
    let size = size_of_val(samples) + TABLES;
    host.reserve(size as u128)?;
    let mut bytes = Cursor::new(Vec::with_capacity(size));
    let mut write = || {
        let mut encoder = TiffEncoder::new(&mut bytes)?;
        let mut picture = encoder.new_image::<C>(pixels.width as u32, pixels.height as u32)?;
        if let Some(profile) = icc::written(&pixels.coding, pixels.samples_per_pixel() < 3) {
            picture.encoder().write_tag(Tag::IccProfile, Untyped(&profile))?;
        }
        match pixels.alpha {
            Alpha::None => {}
            Alpha::Straight => picture.extra_samples(&[ExtraSamples::UnassociatedAlpha])?,
            Alpha::Premultiplied => picture.extra_samples(&[ExtraSamples::AssociatedAlpha])?,
        }
        let mut rest = samples;
        while !rest.is_empty() && host.progress(1.0 - rest.len() as f64 / samples.len() as f64).is_ok() {
            let (strip, tail) = rest.split_at(picture.next_strip_sample_count() as usize);
            picture.write_strip(strip)?;
            rest = tail;
        }
        picture.finish()
    };
    let written = write();
    host.go_on()?;
    Ok(written.map(|()| bytes.into_inner()))
}

/// Bytes that a TIFF calls undefined, as it wants profiles to be.
struct Untyped<'a>(&'a [u8]);

impl TiffValue for Untyped<'_> {
    const BYTE_LEN: u8 = 1;
    const FIELD_TYPE: Type = Type::UNDEFINED;

    fn count(&self) -> usize {
        self.0.len()
    }

    fn data(&self) -> Cow<'_, [u8]> {
        Cow::Borrowed(self.0)
    }
}

pub fn tiff_error(error: TiffError) -> NodeError {
    let message = error.to_string().replace('\n', " ");
    match error {
        TiffError::UnsupportedError(_) => unsupported(message),
        TiffError::LimitsExceeded => NodeError::new(ErrorClass::OverBudget, "more memory is needed than it declares"),
        TiffError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => unreadable("the file ends early"),
        _ => unreadable(format!("the file is damaged: {message}")),
    }
}
