//! Headers of OpenEXR files: what parts there are, and their attributes.
//!
//! Layout: magic, version and flags; per part its attributes (name, type, size, value) up to an empty name; in a
//! multi-part file an empty header at the end; then a table of block offsets per part; then the blocks.

use std::collections::BTreeSet;

use exr::compression::Compression;
use warploom_core::node::NodeError;
use warploom_core::value::{Attribute, Metadata, Rect, SampleType};

use super::super::host::Host;
use super::super::{MAX_SIDE, unreadable, unsupported};

const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
const VERSION: u32 = 2;
const TILED: u32 = 1 << 9;
const LONG_NAMES: u32 = 1 << 10;
const DEEP: u32 = 1 << 11;
const MULTI_PART: u32 = 1 << 12;

/// Bytes that an attribute takes beside its value: names and its place among others.
pub const ATTRIBUTE: usize = 256;

const MAX_PARTS: usize = 256;
const MAX_CHANNELS: usize = 1024;
/// Windows lie within +-2^30, as in the OpenEXR library.
const MAX_COORDINATE: i32 = 1 << 30;

/// The attribute that tells the compression, which is also kept as metadata: it says what the source had.
pub const COMPRESSION: &str = "compression";

/// The attribute that lists the channels, which is kept as metadata too where it marks some as perceptually linear:
/// nothing else of a picture says that.
const CHANNELS: &str = "channels";

/// Attributes that say how a part is stored, made anew when it is written: parts are written as lines from top to bottom
/// (`lineOrder`, no `tiles`), at full resolution. `type` and `chunkCount` are written in files of several parts alone.
const STRUCTURAL: [&str; 10] = [
    CHANNELS,
    COMPRESSION,
    "chunkCount",
    "dataWindow",
    "displayWindow",
    "lineOrder",
    "name",
    "pixelAspectRatio",
    "tiles",
    "type",
];

/// One part of a file.
pub struct Part {
    pub name: String,
    pub display: Rect,
    pub data: Rect,
    pub pixel_aspect: f64,
    /// Sorted by name.
    pub channels: Vec<ChannelHeader>,
    pub compression: Compression,
    /// Columns and rows of a tile; none for scan lines.
    pub tile: Option<[usize; 2]>,
    /// Entries of the table of offsets, where the file says so.
    pub chunk_count: Option<usize>,
    /// Everything that does not say how it is stored.
    pub metadata: Metadata,
}

/// One channel of a part.
pub struct ChannelHeader {
    pub name: String,
    pub sample_type: SampleType,
    /// Perceptually linear: a hint for lossy compression.
    pub is_linear: bool,
}

/// All headers of a file.
pub struct Headers {
    pub parts: Vec<Part>,
    pub is_multi_part: bool,
    /// Where the first table of offsets starts.
    pub end: usize,
}

/// Reads all headers.
pub fn read(file: &[u8], host: &dyn Host) -> Result<Headers, NodeError> {
    let mut bytes = Bytes { file, at: MAGIC.len() };
    let version = bytes.u32()?;
    let unknown = version & !(0xff | TILED | LONG_NAMES | DEEP | MULTI_PART);
    if version & 0xff != VERSION || unknown != 0 {
        return Err(unsupported(format!("the file is of an unknown version of OpenEXR ({version:#x})")));
    }
    let is_multi_part = version & MULTI_PART != 0;
    let mut parts = Vec::new();
    loop {
        let attributes = bytes.attributes(host)?;
        if is_multi_part && attributes.is_empty() {
            break;
        }
        if parts.len() == MAX_PARTS {
            return Err(unsupported(format!("the file has more than {MAX_PARTS} parts")));
        }
        let part = part(attributes, version).and_then(|part| fits(part, parts.first()));
        parts.push(part.map_err(|e| in_part(e, &parts, is_multi_part))?);
        if !is_multi_part {
            break;
        }
    }
    if parts.is_empty() {
        return Err(unreadable("the file is damaged: it has no parts"));
    }
    Ok(Headers { parts, is_multi_part, end: bytes.at })
}

fn in_part(error: NodeError, before: &[Part], is_multi_part: bool) -> NodeError {
    match is_multi_part {
        true => NodeError { message: format!("part {}: {}", before.len() + 1, error.message), ..error },
        false => error,
    }
}

/// The part, if it has what all parts of a file share.
fn fits(part: Part, first: Option<&Part>) -> Result<Part, NodeError> {
    let shared = |part: &Part| (part.display, part.pixel_aspect);
    match first.is_none_or(|first| shared(first) == shared(&part)) {
        true => Ok(part),
        false => {
            let Rect { x0, y0, x1, y1 } = part.display;
            let message = format!(
                "{} has a display window ({x0}, {y0} to {x1}, {y1}) or pixel aspect ratio ({}) of its own",
                titled(&part.name),
                part.pixel_aspect
            );
            Err(unreadable(message)
                .hint("OpenEXR gives all parts of a file one; write the parts to files of their own"))
        }
    }
}

fn damaged(what: &str) -> NodeError {
    unreadable(format!("the file is damaged: {what}"))
}

/// What is not read yet of a file.
struct Bytes<'a> {
    file: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], NodeError> {
        let taken = self.file.get(self.at..).and_then(|rest| rest.get(..count));
        self.at += taken.map_or(0, <[u8]>::len);
        taken.ok_or_else(|| unreadable("the file ends within its header"))
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], NodeError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    fn u32(&mut self) -> Result<u32, NodeError> {
        self.array().map(u32::from_le_bytes)
    }

    fn i32(&mut self) -> Result<i32, NodeError> {
        self.array().map(i32::from_le_bytes)
    }

    /// A text that ends with a zero byte; names are up to 255 bytes long.
    fn name(&mut self) -> Result<String, NodeError> {
        let rest = &self.file[self.at.min(self.file.len())..];
        let length = rest.iter().take(256).position(|&byte| byte == 0);
        let length = length.ok_or_else(|| match rest.len() < 256 {
            true => unreadable("the file ends within its header"),
            false => damaged("a name is longer than 255 bytes"),
        })?;
        let name = self.take(length + 1)?;
        text(&name[..length])
    }

    fn attributes(&mut self, host: &dyn Host) -> Result<Metadata, NodeError> {
        let mut attributes = Metadata::new();
        loop {
            let name = self.name()?;
            if name.is_empty() {
                return Ok(attributes);
            }
            let kind = self.name()?;
            let size = usize::try_from(self.i32()?).map_err(|_| damaged("an attribute is of negative size"))?;
            let value = self.take(size)?;
            // A second time for what is found to be shared by all parts.
            host.reserve(2 * (size + ATTRIBUTE) as u128)?;
            let bytes = value.to_vec();
            attributes.insert(name, Attribute { kind, bytes });
        }
    }
}

fn text(bytes: &[u8]) -> Result<String, NodeError> {
    String::from_utf8(bytes.to_vec()).map_err(|_| damaged("a name is not UTF-8 text"))
}

/// A part of its attributes.
fn part(mut attributes: Metadata, version: u32) -> Result<Part, NodeError> {
    let name = match attributes.get("name") {
        Some(name) => text(&name.bytes)?,
        None => String::new(),
    };
    let kind = attributes.get("type").map(|kind| kind.bytes.clone());
    let is_multi_part = version & MULTI_PART != 0;
    let is_tiled = match (is_multi_part, kind.as_deref()) {
        (_, Some(b"deepscanline" | b"deeptile")) => return Err(deep(&name)),
        _ if version & DEEP != 0 && !is_multi_part => return Err(deep(&name)),
        (true, Some(b"tiledimage")) => true,
        (true, Some(b"scanlineimage")) => false,
        (true, _) => return Err(damaged("a part is of no known type")),
        (false, _) => version & TILED != 0,
    };
    let display = window(required(&attributes, "displayWindow", "box2i")?)?;
    let data = window(required(&attributes, "dataWindow", "box2i")?)?;
    let chunk_count = match attributes.get("chunkCount") {
        Some(count) => Some(usize::try_from(int(&count.bytes)?).map_err(|_| damaged("chunkCount is negative"))?),
        None => None,
    };
    let part = Part {
        display,
        data,
        pixel_aspect: pixel_aspect(&attributes)?,
        channels: channels(required(&attributes, CHANNELS, "chlist")?, &name)?,
        compression: compression(&attributes, &name)?,
        tile: if is_tiled { Some(tile(required(&attributes, "tiles", "tiledesc")?)?) } else { None },
        chunk_count,
        name,
        metadata: Metadata::new(),
    };
    let marks = part.channels.iter().any(|channel| channel.is_linear);
    let tells = |name: &str| name == COMPRESSION || name == CHANNELS && marks || !STRUCTURAL.contains(&name);
    attributes.retain(|name, _| tells(name));
    Ok(Part { metadata: attributes, ..part })
}

fn titled(name: &str) -> String {
    if name.is_empty() { "the file".into() } else { format!("part `{name}`") }
}

fn deep(name: &str) -> NodeError {
    unsupported(format!("{} holds deep data", titled(name)))
        .hint("flatten it first: oiiotool -a in.exr --flatten -o out.exr")
}

fn required<'a>(attributes: &'a Metadata, name: &str, kind: &str) -> Result<&'a [u8], NodeError> {
    match attributes.get(name) {
        Some(attribute) if attribute.kind == kind => Ok(&attribute.bytes),
        Some(attribute) => Err(damaged(&format!("{name} is a {}, not a {kind}", attribute.kind.escape_debug()))),
        None => Err(damaged(&format!("it has no {name}"))),
    }
}

fn int(bytes: &[u8]) -> Result<i32, NodeError> {
    Bytes { file: bytes, at: 0 }.i32()
}

fn window(bytes: &[u8]) -> Result<Rect, NodeError> {
    let mut bytes = Bytes { file: bytes, at: 0 };
    let edges = [bytes.i32()?, bytes.i32()?, bytes.i32()?, bytes.i32()?];
    if edges.iter().any(|edge| !(-MAX_COORDINATE..MAX_COORDINATE).contains(edge)) {
        return Err(damaged(&format!("a window reaches too far: {edges:?}")));
    }
    let [x0, y0, x1, y1] = edges;
    let window = Rect { x0, y0, x1: x1 + 1, y1: y1 + 1 };
    if window.is_empty() {
        return Err(damaged(&format!("a window is empty: {edges:?}")));
    }
    if window.width().max(window.height()) > MAX_SIDE {
        let (width, height) = (window.width(), window.height());
        return Err(unsupported(format!("a window is {width} x {height} px; a side may be 1 to {MAX_SIDE} px long")));
    }
    Ok(window)
}

fn pixel_aspect(attributes: &Metadata) -> Result<f64, NodeError> {
    if !attributes.contains_key("pixelAspectRatio") {
        return Ok(1.0);
    }
    let mut bytes = Bytes { file: required(attributes, "pixelAspectRatio", "float")?, at: 0 };
    let aspect = f32::from_le_bytes(bytes.array()?);
    match aspect.is_normal() && aspect > 0.0 {
        true => Ok(aspect.into()),
        false => Err(damaged(&format!("the pixel aspect ratio is {aspect}"))),
    }
}

fn compression(attributes: &Metadata, name: &str) -> Result<Compression, NodeError> {
    let code = required(attributes, COMPRESSION, COMPRESSION)?.first().copied();
    compression_of(code.ok_or_else(|| damaged("it has no compression"))?).map_err(|unknown| {
        unsupported(format!("{} is packed with {unknown}, which cannot be read", titled(name)))
            .hint("pack it another way: oiiotool in.exr --compression zip -o out.exr")
    })
}

/// The compression of that number; the error names one that cannot be read.
pub fn compression_of(code: u8) -> Result<Compression, String> {
    Ok(match code {
        0 => Compression::Uncompressed,
        1 => Compression::RLE,
        2 => Compression::ZIP1,
        3 => Compression::ZIP16,
        4 => Compression::PIZ,
        5 => Compression::PXR24,
        6 => Compression::B44,
        7 => Compression::B44A,
        8 => Compression::DWAA(None),
        9 => Compression::DWAB(None),
        10 | 11 => return Err("HTJ2K compression".into()),
        other => return Err(format!("unknown compression {other}")),
    })
}

fn compression_code(compression: Compression) -> u8 {
    (0..=9).find(|&code| compression_of(code).is_ok_and(|c| same(c, compression))).unwrap_or_default()
}

/// Equal but for parameters.
fn same(a: Compression, b: Compression) -> bool {
    std::mem::discriminant(&a) == std::mem::discriminant(&b)
}

fn tile(bytes: &[u8]) -> Result<[usize; 2], NodeError> {
    let mut bytes = Bytes { file: bytes, at: 0 };
    let size = [bytes.u32()?, bytes.u32()?];
    match size.iter().all(|&side| (1..=i32::MAX as u32).contains(&side)) {
        true => Ok(size.map(|side| side as usize)),
        false => Err(damaged(&format!("tiles are {} x {} px", size[0], size[1]))),
    }
}

fn channels(bytes: &[u8], part: &str) -> Result<Vec<ChannelHeader>, NodeError> {
    let mut bytes = Bytes { file: bytes, at: 0 };
    let mut channels: Vec<ChannelHeader> = Vec::new();
    loop {
        let name = bytes.name()?;
        if name.is_empty() {
            break;
        }
        let sample_type = match bytes.u32()? {
            0 => SampleType::Uint,
            1 => SampleType::Half,
            2 => SampleType::Float,
            other => return Err(damaged(&format!("channel {} is of type {other}", name.escape_debug()))),
        };
        let is_linear = bytes.u32()? & 0xff != 0;
        let sampling = [bytes.i32()?, bytes.i32()?];
        if sampling != [1, 1] {
            let message = format!("{} has subsampled channels ({} and more)", titled(part), name.escape_debug());
            return Err(unsupported(message).hint("have the program that made it write R, G, B"));
        }
        if channels.len() == MAX_CHANNELS {
            return Err(unsupported(format!("{} has more than {MAX_CHANNELS} channels", titled(part))));
        }
        channels.push(ChannelHeader { name, sample_type, is_linear });
    }
    // Samples lie in this order whatever that of the list.
    channels.sort_by(|a, b| a.name.cmp(&b.name));
    match channels.windows(2).find(|pair| pair[0].name == pair[1].name) {
        Some(pair) => Err(damaged(&format!("channel {} is there twice", pair[0].name.escape_debug()))),
        None if channels.is_empty() => Err(damaged("it has no channels")),
        None => Ok(channels),
    }
}

/// Names of the channels that a part's source marked as perceptually linear.
pub fn linear_channels(metadata: &Metadata) -> Vec<String> {
    let listed = metadata.get(CHANNELS).and_then(|list| channels(&list.bytes, "").ok()).unwrap_or_default();
    listed.into_iter().filter(|channel| channel.is_linear).map(|channel| channel.name).collect()
}

/// Writes magic, version and all headers.
pub fn write(parts: &[&Part], chunk_counts: &[usize]) -> Result<Vec<u8>, NodeError> {
    let is_multi_part = parts.len() > 1;
    let mut body = Vec::new();
    let mut names = BTreeSet::new();
    for (part, &count) in parts.iter().copied().zip(chunk_counts) {
        for (name, attribute) in attributes_of(part, is_multi_part.then_some(count))? {
            push_name(&mut body, &name)?;
            push_name(&mut body, &attribute.kind)?;
            body.extend_from_slice(&(attribute.bytes.len() as i32).to_le_bytes());
            body.extend_from_slice(&attribute.bytes);
            names.extend([name.len(), attribute.kind.len()]);
        }
        names.extend(part.channels.iter().map(|channel| channel.name.len()));
        body.push(0);
    }
    if is_multi_part {
        body.push(0);
    }
    let long_names = if names.last().is_some_and(|&length| length > 31) { LONG_NAMES } else { 0 };
    let flags = VERSION | long_names | if is_multi_part { MULTI_PART } else { 0 };
    let mut bytes = MAGIC.to_vec();
    bytes.extend_from_slice(&flags.to_le_bytes());
    bytes.append(&mut body);
    Ok(bytes)
}

/// All attributes of a part of scan lines, by name.
fn attributes_of(part: &Part, chunk_count: Option<usize>) -> Result<Metadata, NodeError> {
    let mut attributes = part.metadata.clone();
    attributes.retain(|name, _| !STRUCTURAL.contains(&&**name));
    let mut set = |name: &str, kind: &str, bytes: Vec<u8>| {
        attributes.insert(name.to_owned(), Attribute { kind: kind.to_owned(), bytes });
    };
    let mut channels = Vec::new();
    for channel in &part.channels {
        push_name(&mut channels, &channel.name)?;
        let code: u32 = match channel.sample_type {
            SampleType::Uint => 0,
            SampleType::Half => 1,
            _ => 2,
        };
        for number in [code, channel.is_linear.into(), 1, 1] {
            channels.extend_from_slice(&number.to_le_bytes());
        }
    }
    channels.push(0);
    set(CHANNELS, "chlist", channels);
    set(COMPRESSION, COMPRESSION, vec![compression_code(part.compression)]);
    set("dataWindow", "box2i", window_bytes(part.data));
    set("displayWindow", "box2i", window_bytes(part.display));
    set("lineOrder", "lineOrder", vec![0]);
    set("pixelAspectRatio", "float", (part.pixel_aspect as f32).to_le_bytes().to_vec());
    if !part.name.is_empty() {
        set("name", "string", part.name.as_bytes().to_vec());
    }
    if let Some(count) = chunk_count {
        set("type", "string", b"scanlineimage".to_vec());
        set("chunkCount", "int", (count as i32).to_le_bytes().to_vec());
    }
    let mut default = |name: &str, kind: &str, bytes: Vec<u8>| {
        attributes.entry(name.to_owned()).or_insert(Attribute { kind: kind.to_owned(), bytes });
    };
    default("screenWindowCenter", "v2f", vec![0; 8]);
    default("screenWindowWidth", "float", 1.0f32.to_le_bytes().to_vec());
    Ok(attributes)
}

fn window_bytes(window: Rect) -> Vec<u8> {
    [window.x0, window.y0, window.x1 - 1, window.y1 - 1].iter().flat_map(|edge| edge.to_le_bytes()).collect()
}

fn push_name(bytes: &mut Vec<u8>, name: &str) -> Result<(), NodeError> {
    if name.is_empty() || name.len() > 255 || name.contains('\0') {
        let message = format!("OpenEXR names are 1 to 255 bytes long without zeros; {name:?} is not");
        return Err(NodeError::refused(message).at("image").hint("rename the layer or channel where it is made"));
    }
    bytes.extend_from_slice(name.as_bytes());
    bytes.push(0);
    Ok(())
}
