//! Between interleaved samples, as most formats have them, and pictures.

use rayon::prelude::*;
use warploom_algo::colorimetry::REC_709;
use warploom_algo::transfer;
use warploom_core::node::NodeError;
use warploom_core::value::{Buffer, Channel, Image, Layer, Plane, Rect, SampleType};

use super::coding::Coding;
use super::color::fill;
use super::host::Host;
use super::{Depth, Encoding, MAX_SIDE};

/// Rows between two looks at the host.
const REPORT_ROWS: usize = 8;

/// Interleaved samples, row by row.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    U8(Vec<u8>),
    U16(Vec<u16>),
    F32(Vec<f32>),
}

/// What the last sample of each pixel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alpha {
    /// Colour like the others.
    None,
    /// Coverage; colour is not multiplied by it.
    Straight,
    /// Coverage; colour is multiplied by it, as stored.
    Premultiplied,
}

/// A picture of 1 or 3 colour samples per pixel, and perhaps alpha.
#[derive(Clone, Debug, PartialEq)]
pub struct Pixels {
    pub width: usize,
    pub height: usize,
    pub alpha: Alpha,
    pub coding: Coding,
    pub samples: Samples,
}

impl Pixels {
    fn len(&self) -> usize {
        match &self.samples {
            Samples::U8(samples) => samples.len(),
            Samples::U16(samples) => samples.len(),
            Samples::F32(samples) => samples.len(),
        }
    }

    /// Samples per pixel.
    pub fn samples_per_pixel(&self) -> usize {
        self.len() / (self.width * self.height)
    }

    /// Bytes of a sample.
    pub fn sample_bytes(&self) -> usize {
        match self.samples {
            Samples::U8(_) => 1,
            Samples::U16(_) => 2,
            Samples::F32(_) => 4,
        }
    }

    /// The pixels as they are to be seen, of `orientation` 1..=8 as Exif numbers it.
    ///
    /// The second copy takes no more than the planes of the picture will.
    pub fn upright(self, orientation: u16, host: &dyn Host) -> Result<Self, NodeError> {
        if orientation == 1 {
            return Ok(self);
        }
        let (width, height, count) = (self.width, self.height, self.samples_per_pixel());
        let samples = match self.samples {
            Samples::U8(samples) => Samples::U8(upright(&samples, width, height, count, orientation, host)?),
            Samples::U16(samples) => Samples::U16(upright(&samples, width, height, count, orientation, host)?),
            Samples::F32(samples) => Samples::F32(upright(&samples, width, height, count, orientation, host)?),
        };
        let (width, height) = if orientation < 5 { (width, height) } else { (height, width) };
        Ok(Self { width, height, samples, ..self })
    }

    /// The picture, scene-linear and premultiplied unless its coding is `Raw`. Its channels are `R`, `G`, `B` or
    /// `Y`, then `A`. Its planes are reserved by whoever read the pixels, before he took memory for these.
    pub fn into_image(self, host: &dyn Host) -> Result<Image, NodeError> {
        let count = self.samples_per_pixel();
        assert_eq!(count * self.width * self.height, self.len(), "{} x {} pixels", self.width, self.height);
        let (planes, sample_type) = match &self.samples {
            Samples::U8(samples) => (self.of_codes(samples, u8::MAX.into(), usize::from, host)?, SampleType::U8),
            Samples::U16(samples) => (self.of_codes(samples, u16::MAX, usize::from, host)?, SampleType::U16),
            Samples::F32(samples) => {
                let color = |c: usize, pixel: &[f32]| self.coding.linear(c, |k| pixel[k]);
                (self.planes(samples, color, |v| v, host)?, SampleType::Float)
            }
        };
        let names = names(count, self.alpha != Alpha::None);
        let channels = names.iter().zip(planes);
        let channels = channels.map(|(&name, plane)| Channel { name: name.into(), sample_type, plane });
        Ok(Image::new(Rect::at(0, 0, self.width, self.height), channels.collect()))
    }

    /// The planes of codes `0..=max`, by tables of them.
    fn of_codes<T: Copy + Sync>(
        &self,
        samples: &[T],
        max: u16,
        at: fn(T) -> usize,
        host: &dyn Host,
    ) -> Result<Vec<Plane>, NodeError> {
        let plain = transfer::code_table(max);
        let alpha = |sample| plain[at(sample)];
        match &self.coding {
            Coding::Raw | Coding::Linear => self.planes(samples, |c, pixel| plain[at(pixel[c])], alpha, host),
            Coding::Srgb => {
                let table = transfer::srgb_table(max);
                self.planes(samples, |c, pixel| table[at(pixel[c])], alpha, host)
            }
            Coding::Profile(profile) => {
                host.reserve(3 * (u128::from(max) + 1) * size_of::<f64>() as u128)?;
                let levels = profile.levels(max);
                let color = |c, pixel: &[T]| profile.mixed(c, |k| levels[k][at(pixel[k])]);
                self.planes(samples, color, alpha, host)
            }
        }
    }

    /// Colour planes, then alpha by `plain`; `color(c, pixel)` is linear colour `c` of a pixel of straight ones.
    fn planes<T: Copy + Sync>(
        &self,
        samples: &[T],
        color: impl Fn(usize, &[T]) -> f32 + Sync,
        plain: impl Fn(T) -> f32 + Sync,
        host: &dyn Host,
    ) -> Result<Vec<Plane>, NodeError> {
        let (width, height, count) = (self.width, self.height, self.samples_per_pixel());
        let pixels_of = |y: usize| samples[y * width * count..][..width * count].chunks_exact(count);
        let color_count = if self.alpha == Alpha::None { count } else { count - 1 };
        let alpha = (color_count < count).then(|| {
            fill(width, height, host, |y, row| {
                row.iter_mut().zip(pixels_of(y)).for_each(|(v, pixel)| *v = plain(pixel[color_count]));
            })
        });
        let alpha: Option<Buffer<f32>> = alpha.transpose()?;
        let planes = (0..color_count).map(|c| {
            host.progress(c as f64 / count as f64)?;
            fill(width, height, host, |y, row| match self.alpha {
                // The tables are of codes of straight colour, so stored values that are not go through a function.
                Alpha::Premultiplied if !self.coding.is_linear() => {
                    row.iter_mut().zip(pixels_of(y)).for_each(|(v, pixel)| {
                        let alpha = plain(pixel[color_count]);
                        *v = self.coding.linear_premultiplied(c, alpha, |k| plain(pixel[k]));
                    });
                }
                _ => {
                    row.iter_mut().zip(pixels_of(y)).for_each(|(v, pixel)| *v = color(c, pixel));
                    if let (Alpha::Straight, Some(alpha)) = (self.alpha, &alpha)
                        && self.coding != Coding::Raw
                    {
                        transfer::premultiply(row, alpha.row(y));
                    }
                }
            })
        });
        planes.chain(alpha.clone().map(Ok)).map(|plane| plane.map(Plane::F32)).collect()
    }

    /// The display window of a picture's primary colour, with alpha if `keep_alpha` and there is one; `depth` is
    /// `U8`, `U16` or `Float`. Alpha is straight, unless `encoding` is `Raw`.
    pub fn of_image(
        image: &Image,
        depth: Depth,
        encoding: Encoding,
        keep_alpha: bool,
        host: &dyn Host,
    ) -> Result<Self, NodeError> {
        let (width, height) = (image.display.width(), image.display.height());
        if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
            let message = format!("the display window is {width} x {height} px; a side may be 1 to {MAX_SIDE} px long");
            return Err(NodeError::refused(message).at("image").hint("crop it, or draw it smaller"));
        }
        let color = primary_color(image.primary())?;
        let alpha = image.primary().channel("A").and_then(samples_of).filter(|_| keep_alpha);
        let sample_bytes = match depth {
            Depth::U8 => 1,
            Depth::U16 => 2,
            _ => 4,
        };
        let count = color.len() + usize::from(alpha.is_some());
        host.reserve((width * height * count * sample_bytes) as u128)?;
        let coding = Coding::named(encoding, depth == Depth::Float);
        let source = Source { image, color, alpha, straight: coding != Coding::Raw };
        let encoded = coding == Coding::Srgb;
        let samples = match depth {
            Depth::U8 => Samples::U8(source.codes(u8::MAX.into(), encoded, |code| code as u8, host)?),
            Depth::U16 => Samples::U16(source.codes(u16::MAX, encoded, |code| code, host)?),
            _ if encoded => Samples::F32(source.interleave(transfer::linear_to_srgb, |v| v, host)?),
            _ => Samples::F32(source.interleave(|v| v, |v| v, host)?),
        };
        let alpha = match (source.alpha, source.straight) {
            (None, _) => Alpha::None,
            (_, true) => Alpha::Straight,
            (_, false) => Alpha::Premultiplied,
        };
        // What the file says would be untrue of other primaries.
        let coding = if has_foreign_primaries(image) { Coding::Raw } else { coding };
        Ok(Self { width, height, alpha, coding, samples })
    }
}

/// Whether the chromaticities that an EXR's attribute tells are others than those of Rec.709.
fn has_foreign_primaries(image: &Image) -> bool {
    let [red, green, blue] = REC_709.primaries;
    let rec709 = [red, green, blue, REC_709.white];
    let told = image.metadata.get("chromaticities").or_else(|| image.primary().metadata.get("chromaticities"));
    told.is_some_and(|told| {
        let told = told.bytes.as_chunks().0.iter().map(|&number| f64::from(f32::from_le_bytes(number)));
        told.zip(rec709.as_flattened()).any(|(told, value)| (told - value).abs() > 1e-3)
    })
}

/// What of a picture goes into a file of one colour per pixel.
struct Source<'a> {
    image: &'a Image,
    color: Vec<&'a Buffer<f32>>,
    alpha: Option<&'a Buffer<f32>>,
    straight: bool,
}

impl Source<'_> {
    fn codes<T: Copy + Default + Send>(
        &self,
        max: u16,
        encoded: bool,
        narrow: fn(u16) -> T,
        host: &dyn Host,
    ) -> Result<Vec<T>, NodeError> {
        let plain = |value| narrow(transfer::code(value, max));
        if !encoded {
            return self.interleave(plain, plain, host);
        }
        let thresholds = transfer::srgb_thresholds(max);
        self.interleave(|value| narrow(transfer::srgb_code(&thresholds, value)), plain, host)
    }

    fn interleave<T: Copy + Default + Send>(
        &self,
        color: impl Fn(f32) -> T + Sync,
        plain: impl Fn(f32) -> T + Sync,
        host: &dyn Host,
    ) -> Result<Vec<T>, NodeError> {
        let (width, height) = (self.image.display.width(), self.image.display.height());
        let count = self.color.len() + usize::from(self.alpha.is_some());
        let mut samples = vec![T::default(); width * height * count];
        samples.par_chunks_mut(width * count).enumerate().try_for_each(|(y, pixels)| {
            if y % REPORT_ROWS == 0 {
                host.progress(y as f64 / height as f64)?;
            }
            let alpha = self.alpha.map(|alpha| self.display_row(alpha, y));
            for (c, plane) in self.color.iter().enumerate() {
                let mut row = self.display_row(plane, y);
                if let Some(alpha) = alpha.as_ref().filter(|_| self.straight) {
                    transfer::unpremultiply(&mut row, alpha);
                }
                pixels.iter_mut().skip(c).step_by(count).zip(row).for_each(|(sample, value)| *sample = color(value));
            }
            if let Some(alpha) = alpha {
                let slots = pixels.iter_mut().skip(count - 1).step_by(count);
                slots.zip(alpha).for_each(|(sample, value)| *sample = plain(value));
            }
            Ok(())
        })?;
        Ok(samples)
    }

    /// Row `y` of the display window, 0 outside the data window.
    fn display_row(&self, plane: &Buffer<f32>, y: usize) -> Vec<f32> {
        let (display, data) = (self.image.display, self.image.primary().data);
        let mut row = vec![0.0; display.width()];
        let data_y = i64::from(display.y0) + y as i64 - i64::from(data.y0);
        let (left, right) = (display.x0.max(data.x0), display.x1.min(data.x1));
        if left < right && (0..plane.height() as i64).contains(&data_y) {
            let from = &plane.row(data_y as usize)[(left - data.x0) as usize..(right - data.x0) as usize];
            row[(left - display.x0) as usize..][..from.len()].copy_from_slice(from);
        }
        row
    }
}

/// The planes that stand for a picture's colour.
fn primary_color(layer: &Layer) -> Result<Vec<&Buffer<f32>>, NodeError> {
    let all = |names: &[&str]| -> Option<Vec<_>> {
        names.iter().map(|name| layer.channel(name).and_then(samples_of)).collect()
    };
    all(&["R", "G", "B"]).or_else(|| all(&["Y"])).ok_or_else(|| {
        let names: Vec<&str> = layer.channels.iter().map(|channel| &*channel.name).collect();
        let there = if names.is_empty() { "none".into() } else { names.join(", ") };
        NodeError::refused(format!("this format needs channels R, G, B or Y of the first layer; there is {there}"))
            .at("image")
            .hint("write an .exr, which holds any channel")
    })
}

fn samples_of(channel: &Channel) -> Option<&Buffer<f32>> {
    match &channel.plane {
        Plane::F32(plane) => Some(plane),
        Plane::U32(_) => None,
    }
}

fn names(count: usize, has_alpha: bool) -> &'static [&'static str] {
    match (count, has_alpha) {
        (1, _) => &["Y"],
        (2, _) => &["Y", "A"],
        (_, false) => &["R", "G", "B"],
        (_, true) => &["R", "G", "B", "A"],
    }
}

/// Samples as they are to be seen, of `width` x `height` pixels as they are stored.
fn upright<T: Copy>(
    samples: &[T],
    width: usize,
    height: usize,
    count: usize,
    orientation: u16,
    host: &dyn Host,
) -> Result<Vec<T>, NodeError> {
    let (across, down) = if orientation < 5 { (width, height) } else { (height, width) };
    let stored = |x: usize, y: usize| match orientation {
        2 => (width - 1 - x, y),
        3 => (width - 1 - x, height - 1 - y),
        4 => (x, height - 1 - y),
        5 => (y, x),
        6 => (y, height - 1 - x),
        7 => (width - 1 - y, height - 1 - x),
        8 => (width - 1 - y, x),
        _ => (x, y),
    };
    let mut turned = Vec::with_capacity(samples.len());
    for y in 0..down {
        host.go_on()?;
        for (x, y) in (0..across).map(|x| stored(x, y)) {
            turned.extend_from_slice(&samples[(y * width + x) * count..][..count]);
        }
    }
    Ok(turned)
}

/// The deepest way the picture's colour was stored.
pub fn deepest(image: &Image) -> SampleType {
    let colors = image.primary().channels.iter().filter(|channel| matches!(&*channel.name, "R" | "G" | "B" | "Y"));
    let order = [SampleType::U8, SampleType::U16, SampleType::Half, SampleType::Float];
    let rank = |sample_type| order.iter().position(|&other| other == sample_type).unwrap_or(0);
    order[colors.map(|channel| rank(channel.sample_type)).max().unwrap_or(0)]
}
