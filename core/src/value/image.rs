//! Pictures: windows, layers, channels, metadata.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Buffer, Digest, Hasher};

/// A half-open rectangle of pixels, `x0 <= x < x1`, y down. Empty where `x1 <= x0` or `y1 <= y0`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Default, serde::Serialize, serde::Deserialize)]
pub struct Rect {
    /// Left edge.
    pub x0: i32,
    /// Top edge.
    pub y0: i32,
    /// Right edge, exclusive.
    pub x1: i32,
    /// Bottom edge, exclusive.
    pub y1: i32,
}

impl Rect {
    /// The rectangle of `width` x `height` pixels at `(x0, y0)`.
    pub fn at(x0: i32, y0: i32, width: usize, height: usize) -> Self {
        Self { x0, y0, x1: x0 + width as i32, y1: y0 + height as i32 }
    }

    /// Columns, 0 when empty.
    pub fn width(&self) -> usize {
        (i64::from(self.x1) - i64::from(self.x0)).max(0) as usize
    }

    /// Rows, 0 when empty.
    pub fn height(&self) -> usize {
        (i64::from(self.y1) - i64::from(self.y0)).max(0) as usize
    }

    /// True if it holds no pixel.
    pub fn is_empty(&self) -> bool {
        self.width() == 0 || self.height() == 0
    }

    /// The smallest rectangle that holds both; an empty one adds nothing.
    pub fn union(&self, other: &Self) -> Self {
        match (self.is_empty(), other.is_empty()) {
            (true, _) => *other,
            (_, true) => *self,
            _ => Self {
                x0: self.x0.min(other.x0),
                y0: self.y0.min(other.y0),
                x1: self.x1.max(other.x1),
                y1: self.y1.max(other.y1),
            },
        }
    }

    pub(crate) fn hash_into(&self, hasher: &mut Hasher) {
        for edge in [self.x0, self.y0, self.x1, self.y1] {
            hasher.int(edge.into());
        }
    }
}

/// Where a picture lies: what a node that carries no pixels needs to know of one.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Windows {
    /// The picture's format.
    pub display: Rect,
    /// The pixels there are (of the first layer).
    pub data: Rect,
    /// Width over height of a pixel.
    pub pixel_aspect: f64,
}

impl Windows {
    /// Display and data window alike, square pixels.
    pub fn full(display: Rect) -> Self {
        Self { display, data: display, pixel_aspect: 1.0 }
    }

    /// Digest of the three.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("windows");
        self.display.hash_into(&mut hasher);
        self.data.hash_into(&mut hasher);
        hasher.number(self.pixel_aspect).finish()
    }
}

/// How a file stores a channel's samples; in memory they are `f32`, or `u32` for `Uint`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum SampleType {
    /// 16-bit float.
    Half,
    /// 32-bit float.
    Float,
    /// 32-bit unsigned integer: identities, no arithmetic.
    Uint,
    /// 8-bit integer, 0..=255 standing for 0..=1.
    U8,
    /// 16-bit integer, 0..=65535 standing for 0..=1.
    U16,
}

/// A plane of samples: numbers, or identities that no arithmetic may touch.
#[derive(Clone, Debug, PartialEq)]
pub enum Plane {
    /// Scene-linear, premultiplied where it is colour.
    F32(Buffer<f32>),
    /// Identities.
    U32(Buffer<u32>),
}

impl Plane {
    /// Digest of the samples.
    pub fn digest(&self) -> Digest {
        match self {
            Plane::F32(buffer) => buffer.digest(),
            Plane::U32(buffer) => buffer.digest(),
        }
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> u64 {
        match self {
            Plane::F32(buffer) => buffer.bytes(),
            Plane::U32(buffer) => buffer.bytes(),
        }
    }

    /// See [`Buffer::is_accompanied`].
    pub(crate) fn is_accompanied(&self) -> bool {
        match self {
            Plane::F32(buffer) => buffer.is_accompanied(),
            Plane::U32(buffer) => buffer.is_accompanied(),
        }
    }

    /// See [`Buffer::accompany`].
    pub(crate) fn accompany(&self, companion: super::Companion) {
        match self {
            Plane::F32(buffer) => buffer.accompany(companion),
            Plane::U32(buffer) => buffer.accompany(companion),
        }
    }
}

/// One named plane of a layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name as in the file, `R`, `A`, `diffuse.G`.
    pub name: Arc<str>,
    /// How a file stores it.
    pub sample_type: SampleType,
    /// The samples, of the layer's data window.
    pub plane: Plane,
}

impl Channel {
    /// Digest of all but its name.
    pub fn digest(&self) -> Digest {
        Hasher::new("channel").int(self.sample_type as i128).digest(&self.plane.digest()).finish()
    }
}

/// The planes of one part of a file; all cover `data`.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Name of the part; empty where the file gives none.
    pub name: Arc<str>,
    /// The pixels there are.
    pub data: Rect,
    /// In file order; names differ.
    pub channels: Vec<Channel>,
    /// Attributes of this part.
    pub metadata: Arc<Metadata>,
}

impl Layer {
    /// The channel of that name.
    pub fn channel(&self, name: &str) -> Option<&Channel> {
        self.channels.iter().find(|channel| &*channel.name == name)
    }
}

/// An attribute that Warploom carries and does not interpret, in OpenEXR's form: a type name and little-endian bytes.
#[derive(Clone, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct Attribute {
    /// OpenEXR's name of the type, `string`, `float`, `timecode`.
    pub kind: String,
    /// The value as OpenEXR writes it.
    pub bytes: Vec<u8>,
}

/// Attributes by name.
pub type Metadata = BTreeMap<String, Attribute>;

/// A picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// The format, shared by all layers.
    pub display: Rect,
    /// Width over height of a pixel, positive.
    pub pixel_aspect: f64,
    /// Attributes of the whole file.
    pub metadata: Arc<Metadata>,
    /// Parts; the first is the one that colour nodes work on. Never empty.
    pub layers: Vec<Layer>,
}

impl Image {
    /// A one-layer picture with square pixels whose data window is its display window.
    pub fn new(display: Rect, channels: Vec<Channel>) -> Self {
        let layer = Layer { name: "".into(), data: display, channels, metadata: Arc::default() };
        Self { display, pixel_aspect: 1.0, metadata: Arc::default(), layers: vec![layer] }
    }

    /// The layer that colour nodes work on.
    pub fn primary(&self) -> &Layer {
        &self.layers[0]
    }

    /// Where the picture lies.
    pub fn windows(&self) -> Windows {
        Windows { display: self.display, data: self.primary().data, pixel_aspect: self.pixel_aspect }
    }

    /// The picture with those channels of its first layer alone, without names of layers and metadata.
    pub fn with_channels_only(&self, names: &[String]) -> Self {
        let primary = self.primary();
        let channels = primary.channels.iter().filter(|c| names.iter().any(|name| **name == *c.name)).cloned();
        let (data, channels) = (primary.data, channels.collect());
        let layer = Layer { name: "".into(), data, channels, metadata: Arc::default() };
        Self { layers: vec![layer], metadata: Arc::default(), ..self.clone() }
    }

    /// Digest of windows, metadata and every channel, as a tree: shared planes are hashed once.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("image");
        hasher.digest(&self.windows().digest());
        hash_metadata(&mut hasher, &self.metadata);
        hasher.int(self.layers.len() as i128);
        for layer in &self.layers {
            hasher.text(&layer.name);
            layer.data.hash_into(&mut hasher);
            hash_metadata(&mut hasher, &layer.metadata);
            hasher.int(layer.channels.len() as i128);
            for channel in &layer.channels {
                hasher.text(&channel.name).digest(&channel.digest());
            }
        }
        hasher.finish()
    }

    /// Bytes of memory of all planes.
    pub fn bytes(&self) -> u64 {
        self.layers.iter().flat_map(|layer| &layer.channels).map(|channel| channel.plane.bytes()).sum()
    }
}

fn hash_metadata(hasher: &mut Hasher, metadata: &Metadata) {
    hasher.int(metadata.len() as i128);
    for (name, attribute) in metadata {
        hasher.text(name).text(&attribute.kind).bytes(&attribute.bytes);
    }
}
