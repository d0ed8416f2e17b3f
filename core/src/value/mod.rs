//! What flows on edges. Values are immutable and shared.

mod buffer;
mod codec;
mod digest;
mod heap;
mod image;
mod outline;
mod raster;
mod warp;

use std::any::Any;
use std::sync::Arc;

pub use buffer::cut_shelf;
pub(crate) use buffer::shelf_bytes;
pub use buffer::{Buffer, BufferMut, Companion, Sample, Storage};
pub use codec::{decode, encode};
pub use digest::{Digest, Hasher};
pub use heap::give_back_freed_memory;
pub use image::{Attribute, Channel, Image, Layer, Metadata, Plane, Rect, SampleType, Windows};
pub use outline::{Given, Outline, Reads};
pub use raster::{Component, Field, Labels, Mask, Raster};
pub use warp::{Direction, Factor, Grid, Warp};

/// The type of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// Layers of samples with windows and metadata.
    Image,
    /// Coverage per pixel.
    Mask,
    /// A number per pixel.
    Field,
    /// A component number per pixel, with a table.
    Labels,
    /// A regular lattice.
    Grid,
    /// A map on a lattice.
    Warp,
    /// A prefactored solver.
    Factor,
    /// Positions.
    Points,
    /// Triangles.
    Mesh,
    /// One number.
    Number,
    /// One piece of text.
    Text,
    /// A plugin's own kind, by its identifier.
    Plugin(&'static str),
}

impl Kind {
    /// The kinds every host knows.
    pub const OWN: [Kind; 11] = [
        Kind::Image,
        Kind::Mask,
        Kind::Field,
        Kind::Labels,
        Kind::Grid,
        Kind::Warp,
        Kind::Factor,
        Kind::Points,
        Kind::Mesh,
        Kind::Number,
        Kind::Text,
    ];

    /// Its name in schemas and messages.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Image => "Image",
            Kind::Mask => "Mask",
            Kind::Field => "Field",
            Kind::Labels => "Labels",
            Kind::Grid => "Grid",
            Kind::Warp => "Warp",
            Kind::Factor => "Factor",
            Kind::Points => "Points",
            Kind::Mesh => "Mesh",
            Kind::Number => "Number",
            Kind::Text => "Text",
            Kind::Plugin(name) => name,
        }
    }

    /// The kind of that name among those every host knows.
    pub fn from_name(name: &str) -> Option<Kind> {
        Kind::OWN.into_iter().find(|kind| kind.name() == name)
    }
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// Positions in px.
#[derive(Clone, Debug, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Points {
    /// One `[x, y]` per point.
    pub positions: Vec<[f64; 2]>,
}

/// Triangles with texture coordinates, in a space of their own: right-handed, y up.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Mesh {
    /// One `[x, y, z]` per vertex.
    pub positions: Vec<[f64; 3]>,
    /// One `[u, v]` per vertex, or none: `[0, 0]` is the picture's upper left corner, `[1, 1]` its lower right one.
    pub uvs: Vec<[f64; 2]>,
    /// One direction per vertex for smooth shading, or none.
    pub normals: Vec<[f64; 3]>,
    /// Three vertices per triangle, counter-clockwise as seen from the front.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("mesh");
        hasher
            .numbers(bytemuck::cast_slice(&self.positions))
            .numbers(bytemuck::cast_slice(&self.uvs))
            .bytes(bytemuck::cast_slice(&self.triangles))
            .numbers(bytemuck::cast_slice(&self.normals));
        hasher.finish()
    }

    fn bytes(&self) -> u64 {
        (size_of_val(self.positions.as_slice())
            + size_of_val(self.uvs.as_slice())
            + size_of_val(self.normals.as_slice())
            + size_of_val(self.triangles.as_slice())) as u64
    }
}

/// A plugin's own value.
#[derive(Clone)]
pub struct PluginValue {
    /// Identifier of its kind.
    pub kind: &'static str,
    /// Digest of its content, as the plugin says.
    pub digest: Digest,
    /// Memory it holds.
    pub bytes: u64,
    /// The value itself.
    pub payload: Arc<dyn Any + Send + Sync>,
}

/// What flows on an edge.
#[derive(Clone)]
pub enum Value {
    /// See [`Image`].
    Image(Arc<Image>),
    /// See [`Mask`].
    Mask(Arc<Mask>),
    /// See [`Field`].
    Field(Arc<Field>),
    /// See [`Labels`].
    Labels(Arc<Labels>),
    /// See [`Grid`].
    Grid(Arc<Grid>),
    /// See [`Warp`].
    Warp(Arc<Warp>),
    /// See [`Factor`].
    Factor(Arc<Factor>),
    /// See [`Points`].
    Points(Arc<Points>),
    /// See [`Mesh`].
    Mesh(Arc<Mesh>),
    /// One number.
    Number(f64),
    /// One piece of text.
    Text(Arc<str>),
    /// A plugin's own.
    Plugin(PluginValue),
}

macro_rules! into_value {
    ($($kind:ident),*) => {$(
        impl From<$kind> for Value {
            fn from(value: $kind) -> Self {
                Value::$kind(Arc::new(value))
            }
        }
        impl From<Arc<$kind>> for Value {
            fn from(value: Arc<$kind>) -> Self {
                Value::$kind(value)
            }
        }
    )*};
}

into_value!(Image, Mask, Field, Labels, Grid, Warp, Factor, Points, Mesh);

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Value::Number(value)
    }
}

impl Value {
    /// Its kind.
    pub fn kind(&self) -> Kind {
        match self {
            Value::Image(_) => Kind::Image,
            Value::Mask(_) => Kind::Mask,
            Value::Field(_) => Kind::Field,
            Value::Labels(_) => Kind::Labels,
            Value::Grid(_) => Kind::Grid,
            Value::Warp(_) => Kind::Warp,
            Value::Factor(_) => Kind::Factor,
            Value::Points(_) => Kind::Points,
            Value::Mesh(_) => Kind::Mesh,
            Value::Number(_) => Kind::Number,
            Value::Text(_) => Kind::Text,
            Value::Plugin(value) => Kind::Plugin(value.kind),
        }
    }

    /// Digest of its content: equal values have equal digests, whoever made them.
    pub fn digest(&self) -> Digest {
        match self {
            Value::Image(image) => image.digest(),
            Value::Mask(mask) => mask.digest(),
            Value::Field(field) => field.digest(),
            Value::Labels(labels) => labels.digest(),
            Value::Grid(grid) => grid.digest(),
            Value::Warp(warp) => warp.digest(),
            Value::Factor(factor) => factor.structure,
            Value::Points(points) => Hasher::new("points").numbers(bytemuck::cast_slice(&points.positions)).finish(),
            Value::Mesh(mesh) => mesh.digest(),
            Value::Number(number) => Hasher::new("number").numbers(&[*number]).finish(),
            Value::Text(text) => Hasher::new("text").text(text).finish(),
            Value::Plugin(value) => value.digest,
        }
    }

    /// Where it lies, for the kinds that lie somewhere.
    pub fn windows(&self) -> Option<Windows> {
        match self {
            Value::Image(image) => Some(image.windows()),
            Value::Mask(mask) => Some(mask.0.windows),
            Value::Field(field) => Some(field.0.windows),
            Value::Labels(labels) => Some(labels.raster.windows),
            _ => None,
        }
    }

    /// Bytes of memory it holds.
    pub fn bytes(&self) -> u64 {
        match self {
            Value::Image(image) => image.bytes(),
            Value::Mask(mask) => mask.0.samples.bytes(),
            Value::Field(field) => field.0.samples.bytes(),
            Value::Labels(labels) => labels.raster.samples.bytes() + size_of_val(labels.table.as_slice()) as u64,
            Value::Grid(_) => size_of::<Grid>() as u64,
            Value::Warp(warp) => 16 * warp.x.len() as u64,
            Value::Factor(factor) => factor.bytes,
            Value::Points(points) => size_of_val(points.positions.as_slice()) as u64,
            Value::Mesh(mesh) => mesh.bytes(),
            Value::Number(_) => 8,
            Value::Text(text) => text.len() as u64,
            Value::Plugin(value) => value.bytes,
        }
    }

    /// Its planes of samples, in order; they share the samples.
    pub(crate) fn planes(&self) -> Vec<Plane> {
        match self {
            Value::Image(image) => {
                let channels = image.layers.iter().flat_map(|layer| &layer.channels);
                channels.map(|channel| channel.plane.clone()).collect()
            }
            Value::Mask(mask) => vec![Plane::F32(mask.0.samples.clone())],
            Value::Field(field) => vec![Plane::F32(field.0.samples.clone())],
            Value::Labels(labels) => vec![Plane::U32(labels.raster.samples.clone())],
            _ => Vec::new(),
        }
    }

    /// Whether its bytes can be written to disk; a solver and a plugin's own value live in memory only.
    pub fn is_storable(&self) -> bool {
        !matches!(self, Value::Factor(_) | Value::Plugin(_))
    }
}

impl std::fmt::Debug for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}({:?})", self.kind(), self.digest())
    }
}
