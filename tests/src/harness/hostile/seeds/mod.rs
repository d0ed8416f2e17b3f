//! Good small files of every format and variation, to be spoiled.

mod exr;
mod hdr;
pub mod png;
pub mod tiff;

use warploom_core::value::{Buffer, Channel, Image, Plane, Rect, SampleType};
use warploom_nodes::io::codec::{WriteOptions, encode_image};

use crate::Random;

/// What a file is, which tells how it can be spoiled and mended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Format {
    /// OpenEXR.
    Exr,
    /// Radiance HDR.
    Hdr,
    /// JPEG.
    Jpeg,
    /// PNG.
    Png,
    /// TIFF.
    Tiff,
}

/// A good file.
pub struct Seed {
    /// Its format.
    pub format: Format,
    /// What is special about it.
    pub name: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// All good files, the same everywhere.
pub fn seeds() -> Vec<Seed> {
    let of = |format| move |(name, bytes)| Seed { format, name, bytes };
    let mut all: Vec<Seed> = exr::all().into_iter().map(of(Format::Exr)).collect();
    all.extend(hdr::all().into_iter().map(of(Format::Hdr)));
    all.extend(jpegs().into_iter().map(of(Format::Jpeg)));
    all.extend(png::all().into_iter().map(of(Format::Png)));
    all.extend(tiff::all().into_iter().map(of(Format::Tiff)));
    all
}

/// Baseline ones by our own writer; progressive ones, CMYK and restart marks, which it does not write, as files.
fn jpegs() -> Vec<(String, Vec<u8>)> {
    vec![
        ("baseline".to_owned(), written(&["B", "G", "R"], SampleType::U8, "jpg")),
        ("baseline grey".to_owned(), written(&["Y"], SampleType::U8, "jpg")),
        ("progressive, quartered colour".to_owned(), include_bytes!("progressive.jpg").to_vec()),
        ("progressive grey".to_owned(), include_bytes!("grey.jpg").to_vec()),
        ("halved colour, restart marks".to_owned(), include_bytes!("restart.jpg").to_vec()),
        ("CMYK".to_owned(), include_bytes!("cmyk.jpg").to_vec()),
    ]
}

/// A file by our own writer.
fn written(names: &[&str], sample_type: SampleType, extension: &str) -> Vec<u8> {
    let free = |_: u128| Ok(());
    encode_image(&picture(names, sample_type), extension, &WriteOptions::default(), &free).expect("it can be written")
}

/// A slope with a little noise on it, so that packing pays.
fn picture(names: &[&str], sample_type: SampleType) -> Image {
    let (width, height) = (24, 70);
    let mut random = Random(names.len() as u64);
    let channels = names.iter().map(|&name| {
        let value = |i: usize, noise: usize| (i % width + i / width) as f32 / 94.0 + noise as f32 / 256.0;
        let samples: Vec<f32> = (0..width * height).map(|i| value(i, random.below(4))).collect();
        Channel { name: name.into(), sample_type, plane: Plane::F32(Buffer::from_packed(&samples, width, height)) }
    });
    Image::new(Rect::at(0, 0, width, height), channels.collect())
}
