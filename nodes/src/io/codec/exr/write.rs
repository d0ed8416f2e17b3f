//! From a picture to the bytes of an OpenEXR file.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use exr::compression::Compression as Packing;
use half::f16;
use rayon::prelude::*;
use warploom_core::node::NodeError;
use warploom_core::value::{Image, Layer, Metadata, Plane, Rect, SampleType};

use super::super::host::Host;
use super::super::{Compression, Depth, MAX_SIDE, WriteOptions};
use super::blocks::Blocks;
use super::half_bits;
use super::header::{self, ATTRIBUTE, COMPRESSION, ChannelHeader, Part};

/// Bytes of blocks that are packed side by side, if that is more than a block for each thread.
const BATCH_BYTES: usize = 4 << 20;

/// Bytes before a block: the number of its part, its row and its size.
const BLOCK_HEAD: usize = 12;

/// Writes all layers that have channels, each as a part of scan lines with its channels sorted by name. Parts of a
/// file must have names that differ: one that is empty or taken becomes `partN`. A layer without pixels becomes one
/// zero pixel at the top left of the display window, which looks the same.
///
/// Attributes come out as they are, but for those that say how samples lie in the file: tiles become lines, from top to
/// bottom, at full resolution, so `tiles`, `lineOrder`, `chunkCount` and `type` are made anew, and `compression` is as
/// the options say. `screenWindowCenter` and `screenWindowWidth`, which must be there, are added where they are missing.
pub fn write(image: &Image, options: &WriteOptions, host: &dyn Host) -> Result<Vec<u8>, NodeError> {
    let layers: Vec<&Layer> = image.layers.iter().filter(|layer| !layer.channels.is_empty()).collect();
    if layers.is_empty() {
        return Err(NodeError::refused("the picture has no channels; there is nothing to write")
            .at("image")
            .hint("connect a picture with channels"));
    }
    check_window(image.display)?;
    let mut names = BTreeSet::new();
    let mut sources = Vec::with_capacity(layers.len());
    for (number, layer) in layers.iter().enumerate() {
        let source = Source::of(layer, image, options, host)?;
        let mut name = source.part.name.clone();
        if layers.len() > 1 && (name.is_empty() || names.contains(&name)) {
            let taken = |name: &String| names.contains(name) || layers.iter().any(|layer| *layer.name == **name);
            name = (number + 1..).map(|n| format!("part{n}")).find(|name| !taken(name)).unwrap_or_default();
        }
        names.insert(name.clone());
        sources.push(Source { part: Part { name, ..source.part }, ..source });
    }
    assemble(&sources, host)
}

fn check_window(window: Rect) -> Result<(), NodeError> {
    let (width, height) = (window.width(), window.height());
    let far = [window.x0, window.y0, window.x1, window.y1].iter().any(|edge| edge.unsigned_abs() > 1 << 30);
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE || far {
        let message = format!(
            "a window of {width} x {height} px at ({}, {}) px does not fit EXR; a side may be 1 to {MAX_SIDE} px long, within \
             1073741824 px of the origin",
            window.x0, window.y0
        );
        return Err(NodeError::refused(message).at("image").hint("crop it, or move it nearer to the origin"));
    }
    Ok(())
}

/// A layer and the part it becomes.
struct Source<'a> {
    part: Part,
    /// In the order of the part's channels; none where there are no pixels.
    planes: Vec<Option<&'a Plane>>,
    blocks: Blocks,
}

impl<'a> Source<'a> {
    fn of(layer: &'a Layer, image: &Image, options: &WriteOptions, host: &dyn Host) -> Result<Self, NodeError> {
        let is_empty = layer.data.is_empty();
        let data = if is_empty { Rect::at(image.display.x0, image.display.y0, 1, 1) } else { layer.data };
        check_window(data)?;
        let mut channels: Vec<_> = layer.channels.iter().collect();
        channels.sort_by(|a, b| a.name.cmp(&b.name));
        if let Some(pair) = channels.windows(2).find(|pair| pair[0].name == pair[1].name) {
            return Err(NodeError::refused(format!("two channels of a layer are named {}", pair[0].name))
                .at("image")
                .hint("rename one where it is made"));
        }
        let planes = channels.iter().map(|channel| Some(&channel.plane).filter(|_| !is_empty)).collect();
        // Here, among a part's attributes, in its header, which grows by doubling, and in the file's.
        let attributes = image.metadata.values().chain(layer.metadata.values());
        host.reserve(attributes.map(|attribute| 6 * (attribute.bytes.len() + ATTRIBUTE) as u128).sum())?;
        let mut metadata = Metadata::clone(&image.metadata);
        metadata.extend(layer.metadata.iter().map(|(name, attribute)| (name.clone(), attribute.clone())));
        let linear = header::linear_channels(&metadata);
        let channels = channels.iter().map(|channel| ChannelHeader {
            name: channel.name.to_string(),
            sample_type: stored_type(&channel.plane, channel.sample_type, options.depth),
            is_linear: linear.iter().any(|name| **name == *channel.name),
        });
        let part = Part {
            name: layer.name.to_string(),
            display: image.display,
            data,
            pixel_aspect: image.pixel_aspect,
            channels: channels.collect(),
            compression: packing(options.compression, &metadata),
            tile: None,
            chunk_count: None,
            metadata,
        };
        let blocks = Blocks::of(&part);
        Ok(Self { part, planes, blocks })
    }

    /// Blocks that are packed side by side before they are put in the file.
    fn batch(&self) -> usize {
        rayon::current_num_threads().max(BATCH_BYTES / self.blocks.max_bytes()).min(self.blocks.count[1])
    }

    /// Bytes taken at the peak of packing: by blocks in work, and by those of the batch that are packed.
    fn scratch(&self) -> usize {
        let in_work = rayon::current_num_threads().min(self.batch());
        (in_work * pack_factor(self.part.compression) + self.batch() - in_work) * self.blocks.max_bytes()
    }

    /// The packed bytes of a block of rows.
    fn pack(&self, row: usize) -> Result<Vec<u8>, NodeError> {
        let rectangle @ [_, y, width, height] = self.blocks.rectangle(0, row);
        let mut samples = Vec::with_capacity(self.blocks.max_bytes());
        let mut halves = vec![f16::ZERO; width];
        for y in y..y + height {
            for (channel, plane) in self.part.channels.iter().zip(&self.planes) {
                match (plane, channel.sample_type) {
                    (None, SampleType::Half) => samples.extend([0; 2]),
                    (None, _) => samples.extend([0; 4]),
                    (Some(Plane::U32(plane)), _) => samples.extend(plane.row(y).iter().flat_map(|v| v.to_ne_bytes())),
                    (Some(Plane::F32(plane)), SampleType::Half) => {
                        half_bits::narrow(plane.row(y), &mut halves);
                        samples.extend(halves.iter().flat_map(|v| v.to_ne_bytes()));
                    }
                    (Some(Plane::F32(plane)), _) => samples.extend(plane.row(y).iter().flat_map(|v| v.to_ne_bytes())),
                }
            }
        }
        let packed = self.blocks.pack(samples, rectangle);
        packed.map_err(|e| NodeError::refused(format!("cannot be packed: {e}")).at("compression"))
    }
}

/// How a channel is stored. Identities are stored as they are whatever the depth.
fn stored_type(plane: &Plane, sample_type: SampleType, depth: Depth) -> SampleType {
    match (plane, depth, sample_type) {
        (Plane::U32(_), _, _) => SampleType::Uint,
        (_, Depth::Half, _) | (_, Depth::Auto, SampleType::Half | SampleType::U8) => SampleType::Half,
        _ => SampleType::Float,
    }
}

fn packing(compression: Compression, metadata: &Metadata) -> Packing {
    // The attribute of OpenEXR itself; 45 is its default.
    let level =
        metadata.get("dwaCompressionLevel").and_then(|level| Some(f32::from_le_bytes(*level.bytes.first_chunk()?)));
    match compression {
        Compression::Auto => {
            let source =
                metadata.get(COMPRESSION).and_then(|source| header::compression_of(*source.bytes.first()?).ok());
            source.filter(|source| !source.may_loose_data()).unwrap_or(Packing::ZIP16)
        }
        Compression::None => Packing::Uncompressed,
        Compression::Rle => Packing::RLE,
        Compression::Zips => Packing::ZIP1,
        Compression::Zip => Packing::ZIP16,
        Compression::Piz => Packing::PIZ,
        Compression::Pxr24 => Packing::PXR24,
        Compression::B44 => Packing::B44,
        Compression::B44a => Packing::B44A,
        Compression::Dwaa => Packing::DWAA(level),
        Compression::Dwab => Packing::DWAB(level),
    }
}

/// Bytes taken per byte of a block while it is packed: its samples and the encoder's own.
fn pack_factor(compression: Packing) -> usize {
    match compression {
        Packing::PIZ => 8,
        Packing::DWAA(_) | Packing::DWAB(_) => 6,
        _ => 4,
    }
}

/// Headers, tables of offsets, blocks. No block becomes larger when it is packed.
fn assemble(sources: &[Source], host: &dyn Host) -> Result<Vec<u8>, NodeError> {
    let counts: Vec<usize> = sources.iter().map(|source| source.blocks.count[1]).collect();
    let parts: Vec<&Part> = sources.iter().map(|source| &source.part).collect();
    let mut file = header::write(&parts, &counts)?;
    let total: usize = counts.iter().sum();
    let size: usize = sources.iter().map(|s| s.part.data.height() * s.blocks.max_bytes() / s.blocks.size[1]).sum();
    let room = size + total * (8 + BLOCK_HEAD);
    host.reserve((room + sources.iter().map(Source::scratch).max().unwrap_or(0)) as u128)?;
    file.reserve_exact(room);
    let mut table_at = file.len();
    file.resize(table_at + 8 * total, 0);
    let done = AtomicUsize::new(0);
    for (number, source) in sources.iter().enumerate() {
        let pack = |&row: &usize| {
            host.progress(done.fetch_add(1, Ordering::Relaxed) as f64 / total as f64)?;
            let mut packed = source.pack(row)?;
            // Some encoders leave much more room than they fill.
            packed.shrink_to(source.blocks.max_bytes());
            Ok(packed)
        };
        let rows: Vec<usize> = (0..source.blocks.count[1]).collect();
        for batch in rows.chunks(source.batch()) {
            let packed: Vec<Result<Vec<u8>, NodeError>> = batch.par_iter().map(pack).collect();
            for (&row, packed) in batch.iter().zip(packed) {
                let (packed, offset) = (packed?, file.len() as u64);
                file[table_at..][..8].copy_from_slice(&offset.to_le_bytes());
                table_at += 8;
                if sources.len() > 1 {
                    file.extend_from_slice(&(number as i32).to_le_bytes());
                }
                let y = source.part.data.y0 + source.blocks.rectangle(0, row)[1] as i32;
                file.extend_from_slice(&y.to_le_bytes());
                let size = i32::try_from(packed.len())
                    .map_err(|_| NodeError::refused("a block passes 2 GiB").hint("use another compression"))?;
                file.extend_from_slice(&size.to_le_bytes());
                file.extend_from_slice(&packed);
            }
        }
    }
    Ok(file)
}
