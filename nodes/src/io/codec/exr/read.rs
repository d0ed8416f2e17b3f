//! From the bytes of an OpenEXR file to a picture.

use std::sync::Arc;

use exr::compression::Compression;
use half::f16;
use rayon::prelude::*;
use warploom_core::node::NodeError;
use warploom_core::value::{BufferMut, Channel, Image, Layer, Metadata, Plane, SampleType};

use super::super::host::{Host, Within};
use super::super::{plane_bytes, unreadable};
use super::blocks::Blocks;
use super::half_bits;
use super::header::{self, ChannelHeader, Headers, Part};

/// Bytes taken while a block is unpacked: the copy, the result, and the decoder's own.
fn unpack_bytes(part: &Part, blocks: &Blocks) -> usize {
    match part.compression {
        Compression::DWAA(_) | Compression::DWAB(_) => {
            let samples = blocks.size[0] * blocks.size[1].min(blocks.picture[1]) * part.channels.len();
            6 * samples + blocks.max_bytes() * 3 / 2
        }
        _ => 4 * blocks.max_bytes(),
    }
}

/// Reads all parts, at full resolution; or, where only some channels are wanted, those of the first part alone, as far
/// as they are there. Blocks that hold nothing wanted are not looked at.
///
/// Attributes that all parts share become the picture's, the others their layer's. Samples stay as they are, half
/// as float; uint becomes `u32`.
pub fn read(bytes: &[u8], wanted: Option<&[String]>, host: &dyn Host) -> Result<Image, NodeError> {
    let headers = header::read(bytes, host)?;
    let parts = if wanted.is_some() { &headers.parts[..1] } else { &headers.parts };
    let mut table_at = headers.end;
    let mut sources = Vec::with_capacity(parts.len());
    for (number, part) in parts.iter().enumerate() {
        let is_wanted = |channel: &ChannelHeader| wanted.is_none_or(|names| names.contains(&channel.name));
        let picked = Picked { part, blocks: Blocks::of(part), channels: part.channels.iter().map(is_wanted).collect() };
        if picked.count() == 0 {
            sources.push((picked, None));
            continue;
        }
        let table = picked.table(bytes, &headers, table_at)?;
        table_at += table.len();
        host.reserve(picked.bytes())?;
        let number = headers.is_multi_part.then_some(number);
        let chunks = Chunks { bytes, table, number, top: part.data.y0, is_tiled: part.tile.is_some() };
        sources.push((picked, Some(chunks)));
    }
    let mut layers = Vec::with_capacity(sources.len());
    let part_of_all = 1.0 / sources.len() as f64;
    for (index, (picked, chunks)) in sources.iter().enumerate() {
        let host = Within { host, from: index as f64 * part_of_all, to: (index + 1) as f64 * part_of_all };
        let channels = chunks.as_ref().map_or(Ok(Vec::new()), |chunks| channels(picked, chunks, &host))?;
        let Part { name, data, metadata, .. } = picked.part;
        let metadata = Arc::new(metadata.clone());
        layers.push(Layer { name: name.as_str().into(), data: *data, channels, metadata });
    }
    let metadata = take_shared(&mut layers);
    let first = &headers.parts[0];
    Ok(Image { display: first.display, pixel_aspect: first.pixel_aspect, metadata: Arc::new(metadata), layers })
}

/// A part, how it is cut into blocks, and which of its channels are wanted.
struct Picked<'a> {
    part: &'a Part,
    blocks: Blocks,
    channels: Vec<bool>,
}

impl Picked<'_> {
    fn count(&self) -> usize {
        self.channels.iter().filter(|&&is_wanted| is_wanted).count()
    }

    /// The table of the offsets of its blocks.
    fn table<'b>(&self, bytes: &'b [u8], headers: &Headers, at: usize) -> Result<&'b [u8], NodeError> {
        let needed = self.blocks.count[0] * self.blocks.count[1];
        let entries = match headers.is_multi_part {
            true => self.part.chunk_count.filter(|&count| count >= needed).ok_or_else(|| damaged("its chunkCount"))?,
            false => needed,
        };
        entries.checked_mul(8).and_then(|size| bytes.get(at..)?.get(..size)).ok_or_else(ends)
    }

    /// Memory for its planes, and for blocks in work.
    fn bytes(&self) -> u128 {
        let in_work = self.blocks.count[1].min(rayon::current_num_threads());
        let scratch = unpack_bytes(self.part, &self.blocks) as u128 * in_work as u128;
        self.count() as u128 * plane_bytes(self.part.data.width(), self.part.data.height()) + scratch
    }
}

fn damaged(what: &str) -> NodeError {
    unreadable(format!("the file is damaged: {what} is wrong"))
}

fn ends() -> NodeError {
    unreadable("the file ends early")
}

/// Takes the attributes that are the same in all layers out of them.
fn take_shared(layers: &mut [Layer]) -> Metadata {
    let mut shared = Metadata::clone(&layers[0].metadata);
    shared.retain(|name, attribute| layers.iter().all(|layer| layer.metadata.get(name) == Some(attribute)));
    for layer in layers {
        Arc::make_mut(&mut layer.metadata).retain(|name, _| !shared.contains_key(name));
    }
    shared
}

/// Where the blocks of a part lie in a file.
struct Chunks<'a> {
    bytes: &'a [u8],
    table: &'a [u8],
    number: Option<usize>,
    top: i32,
    is_tiled: bool,
}

impl<'a> Chunks<'a> {
    /// The packed bytes of the block in that column and row, the `index`th of the table. Before them stand the
    /// part's number (in multi-part files), the block's place and its size.
    fn packed(&self, index: usize, column: usize, row: usize, y: usize) -> Result<&'a [u8], NodeError> {
        let entry = self.table[8 * index..][..8].try_into().map_err(|_| ends())?;
        let start = usize::try_from(u64::from_le_bytes(entry)).map_err(|_| ends())?;
        if start == 0 {
            return Err(unreadable("the file was not written to its end: a block is missing"));
        }
        let place = match self.is_tiled {
            true => vec![column as i32, row as i32, 0, 0],
            false => vec![self.top + y as i32],
        };
        let expected = self.number.map(|number| number as i32).into_iter().chain(place);
        let mut rest = self.bytes.get(start..).ok_or_else(ends)?;
        let mut next = || -> Result<i32, NodeError> {
            let (number, tail) = rest.split_first_chunk().ok_or_else(ends)?;
            rest = tail;
            Ok(i32::from_le_bytes(*number))
        };
        for expected in expected {
            if next()? != expected {
                return Err(damaged("the place of a block"));
            }
        }
        let size = usize::try_from(next()?).map_err(|_| damaged("the size of a block"))?;
        rest.get(..size).ok_or_else(ends)
    }
}

/// Samples to write of a channel, whole rows from a row of blocks.
enum Band<'a> {
    Half(&'a mut [f32]),
    Float(&'a mut [f32]),
    Uint(&'a mut [u32]),
    /// None, of a channel with so many bytes per sample.
    Unwanted(usize),
}

impl Band<'_> {
    fn sample_bytes(&self) -> usize {
        match self {
            Band::Half(_) => 2,
            Band::Float(_) | Band::Uint(_) => 4,
            Band::Unwanted(bytes) => *bytes,
        }
    }
}

enum PlaneMut {
    F32(BufferMut<f32>),
    U32(BufferMut<u32>),
    Unwanted,
}

impl PlaneMut {
    fn freeze(self) -> Option<Plane> {
        match self {
            PlaneMut::F32(plane) => Some(Plane::F32(plane.freeze())),
            PlaneMut::U32(plane) => Some(Plane::U32(plane.freeze())),
            PlaneMut::Unwanted => None,
        }
    }
}

/// The planes to fill, one per channel of the part.
fn planes(picked: &Picked) -> Vec<PlaneMut> {
    let (width, height) = (picked.part.data.width(), picked.part.data.height());
    let channels = picked.part.channels.iter().zip(&picked.channels);
    let planes = channels.map(|(channel, &is_wanted)| match (is_wanted, channel.sample_type) {
        (false, _) => PlaneMut::Unwanted,
        (true, SampleType::Uint) => PlaneMut::U32(BufferMut::zeroed(width, height)),
        (true, _) => PlaneMut::F32(BufferMut::zeroed(width, height)),
    });
    planes.collect()
}

/// The planes cut into bands, per row of blocks one of each.
fn bands<'a>(planes: &'a mut [PlaneMut], picked: &Picked, stride: usize) -> Vec<Vec<Band<'a>>> {
    let (count, samples) = (picked.blocks.count[1], stride * picked.blocks.size[1]);
    let mut rows: Vec<Vec<Band>> = (0..count).map(|_| Vec::with_capacity(planes.len())).collect();
    for (plane, channel) in planes.iter_mut().zip(&picked.part.channels) {
        let is_half = channel.sample_type == SampleType::Half;
        match plane {
            PlaneMut::U32(plane) => {
                let bands = plane.samples_mut().chunks_mut(samples);
                rows.iter_mut().zip(bands).for_each(|(row, band)| row.push(Band::Uint(band)));
            }
            PlaneMut::F32(plane) => {
                let bands = plane.samples_mut().chunks_mut(samples);
                let band = |samples| if is_half { Band::Half(samples) } else { Band::Float(samples) };
                rows.iter_mut().zip(bands).for_each(|(row, samples)| row.push(band(samples)));
            }
            PlaneMut::Unwanted => rows.iter_mut().for_each(|row| row.push(Band::Unwanted(if is_half { 2 } else { 4 }))),
        }
    }
    rows
}

/// Unpacks the wanted channels of a part, rows of blocks side by side.
fn channels(picked: &Picked, chunks: &Chunks, host: &dyn Host) -> Result<Vec<Channel>, NodeError> {
    let (part, blocks) = (picked.part, &picked.blocks);
    let mut planes = planes(picked);
    let stride = part.data.width().next_multiple_of(16);
    let done: Vec<Result<(), NodeError>> = bands(&mut planes, picked, stride)
        .par_iter_mut()
        .enumerate()
        .map(|(row, bands)| {
            host.progress(row as f64 / blocks.count[1] as f64)?;
            (0..blocks.count[0]).try_for_each(|column| {
                host.go_on()?;
                unpack(blocks, chunks, column, row, stride, bands)
            })
        })
        .collect();
    host.go_on()?;
    // The first error from the top, whichever thread met one first.
    done.into_iter().collect::<Result<(), _>>()?;
    let channels = planes.into_iter().zip(&part.channels).filter_map(|(plane, channel)| {
        let plane = plane.freeze()?;
        Some(Channel { name: channel.name.as_str().into(), sample_type: channel.sample_type, plane })
    });
    Ok(channels.collect())
}

/// Unpacks one block into the bands of its row.
fn unpack(
    blocks: &Blocks,
    chunks: &Chunks,
    column: usize,
    row: usize,
    stride: usize,
    bands: &mut [Band],
) -> Result<(), NodeError> {
    let rectangle @ [x, y, width, height] = blocks.rectangle(column, row);
    let packed = chunks.packed(row * blocks.count[0] + column, column, row, y)?;
    let samples = blocks.unpack(packed, rectangle).map_err(|e| unreadable(format!("the file is damaged: {e}")))?;
    let mut rest = &samples[..];
    let mut halves = vec![f16::ZERO; width];
    for line in 0..height {
        let at = line * stride + x;
        for band in &mut *bands {
            let (stored, tail) =
                rest.split_at_checked(width * band.sample_bytes()).ok_or_else(|| damaged("a block"))?;
            rest = tail;
            match band {
                Band::Half(band) => {
                    let words = stored.as_chunks().0.iter();
                    halves.iter_mut().zip(words).for_each(|(half, &word)| *half = f16::from_ne_bytes(word));
                    half_bits::widen(&halves, &mut band[at..at + width]);
                }
                Band::Float(band) => {
                    let words = stored.as_chunks().0.iter();
                    band[at..].iter_mut().zip(words).for_each(|(value, &word)| *value = f32::from_ne_bytes(word));
                }
                Band::Uint(band) => {
                    let words = stored.as_chunks().0.iter();
                    band[at..].iter_mut().zip(words).for_each(|(value, &word)| *value = u32::from_ne_bytes(word));
                }
                Band::Unwanted(_) => {}
            }
        }
    }
    Ok(())
}
