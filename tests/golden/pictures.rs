//! Values as pictures for people, and pictures side by side.

use std::path::Path;

use image::{ImageFormat, Rgba, RgbaImage};
use warploom_core::value::{Buffer, Channel, Image, Labels, Plane, SampleType, Value};
use warploom_nodes::io::codec::{self, Depth, Encoding, WriteOptions};

/// A value as PNG: colour through the sRGB transfer, coverage and numbers as they are, labels in colours.
pub fn png(value: &Value) -> Result<Vec<u8>, String> {
    let mut image = codec::as_image(value).ok_or_else(|| format!("a {} is no picture", value.kind()))?;
    let encoding = match value {
        Value::Image(_) => Encoding::Srgb,
        Value::Labels(labels) => {
            image.layers[0].channels = colors(labels);
            Encoding::Raw
        }
        _ => {
            image.layers[0].channels[0].name = "Y".into();
            Encoding::Raw
        }
    };
    encode(&image, encoding)
}

/// A written file as PNG: as it is if it is one.
pub fn of_file(bytes: &[u8]) -> Result<Vec<u8>, String> {
    if bytes.starts_with(b"\x89PNG") {
        return Ok(bytes.to_vec());
    }
    let image = codec::decode(bytes, Encoding::Auto, &|_| Ok(())).map_err(|error| error.message)?;
    png(&image.into())
}

fn encode(image: &Image, encoding: Encoding) -> Result<Vec<u8>, String> {
    let options = WriteOptions { encoding, depth: Depth::U8, ..WriteOptions::default() };
    codec::encode_image(image, "png", &options, &|_| Ok(())).map_err(|error| error.message)
}

/// Black for background, then colours that neighbours in number do not share.
fn colors(labels: &Labels) -> Vec<Channel> {
    const COLORS: [[f32; 3]; 6] =
        [[1.0, 0.2, 0.2], [0.2, 1.0, 0.2], [0.3, 0.3, 1.0], [1.0, 1.0, 0.2], [1.0, 0.2, 1.0], [0.2, 1.0, 1.0]];
    let samples = &labels.raster.samples;
    let channel = |(index, name): (usize, &str)| {
        let color = |label: &u32| label.checked_sub(1).map_or(0.0, |at| COLORS[at as usize % COLORS.len()][index]);
        let colored: Vec<f32> = samples.rows().flatten().map(color).collect();
        let plane = Plane::F32(Buffer::from_packed(&colored, samples.width(), samples.height()));
        Channel { name: name.into(), sample_type: SampleType::Float, plane }
    };
    ["R", "G", "B"].into_iter().enumerate().map(channel).collect()
}

pub fn read(bytes: &[u8]) -> Result<RgbaImage, String> {
    let image = image::load_from_memory_with_format(bytes, ImageFormat::Png).map_err(|error| error.to_string())?;
    Ok(image.to_rgba8())
}

/// Largest difference of any sample, white being 1; infinite where the sizes differ.
pub fn difference(a: &RgbaImage, b: &RgbaImage) -> f64 {
    if a.dimensions() != b.dimensions() {
        return f64::INFINITY;
    }
    let largest = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| a.abs_diff(*b)).max();
    f64::from(largest.unwrap_or(0)) / 255.0
}

/// Writes expected, actual and (strengthened) difference side by side, enlarged.
pub fn show(expected: &RgbaImage, actual: &RgbaImage, path: &Path) -> Result<(), String> {
    const ENLARGED: u32 = 6;
    const GAP: u32 = 2;
    let (width, height) = (expected.width().max(actual.width()), expected.height().max(actual.height()));
    let pixel = |image: &RgbaImage, x: u32, y: u32| image.get_pixel_checked(x, y).map_or([0; 4], |pixel| pixel.0);
    let panel = RgbaImage::from_fn((3 * width + 2 * GAP) * ENLARGED, height * ENLARGED, |x, y| {
        let (panel, x, y) = (x / ENLARGED / (width + GAP), x / ENLARGED % (width + GAP), y / ENLARGED);
        let [left, right] = [pixel(expected, x, y), pixel(actual, x, y)];
        Rgba(match panel {
            _ if x >= width => [0; 4],
            0 => left,
            1 => right,
            _ => {
                let apart = |at: usize| left[at].abs_diff(right[at]).saturating_mul(8);
                let alpha = apart(3);
                [apart(0).max(alpha), apart(1).max(alpha), apart(2).max(alpha), 255]
            }
        })
    });
    std::fs::create_dir_all(path.parent().unwrap_or(path)).map_err(|error| error.to_string())?;
    panel.save_with_format(path, ImageFormat::Png).map_err(|error| error.to_string())
}
