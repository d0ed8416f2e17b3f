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
    all.push(of(Format::Tiff)(("a profile".to_owned(), colored("tif"))));
    all
}

/// Baseline ones by our own writer; progressive ones and restart marks, which it does not write, as files.
fn jpegs() -> Vec<(String, Vec<u8>)> {
    let baseline = colored("jpg");
    let mut exif = vec![0xff, 0xe1, 0, 8 + EXIF.len() as u8];
    exif.extend(b"Exif\0\0");
    exif.extend(EXIF);
    let mut turned = baseline.clone();
    turned.splice(2..2, exif);
    vec![
        ("baseline".to_owned(), baseline),
        ("baseline grey".to_owned(), written(&["Y"], SampleType::U8, "jpg")),
        ("progressive, quartered colour".to_owned(), include_bytes!("progressive.jpg").to_vec()),
        ("progressive grey".to_owned(), include_bytes!("grey.jpg").to_vec()),
        ("halved colour, restart marks".to_owned(), include_bytes!("restart.jpg").to_vec()),
        ("turned by Exif".to_owned(), turned),
    ]
}

/// Exif that says: turn it to the right.
const EXIF: &[u8; 26] = b"MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";

/// A file of colours by our own writer, with a profile where the format has them.
fn colored(extension: &str) -> Vec<u8> {
    written(&["B", "G", "R"], SampleType::U8, extension)
}

/// The profile of sRGB, out of a JPEG of our own writer.
fn profile() -> Vec<u8> {
    const MARK: &[u8] = b"ICC_PROFILE\0\x01\x01";
    let file = colored("jpg");
    let at = file.windows(MARK.len()).position(|bytes| bytes == MARK).expect("it holds a profile");
    let length = usize::from(u16::from_be_bytes([file[at - 2], file[at - 1]]));
    file[at + MARK.len()..at - 2 + length].to_vec()
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
