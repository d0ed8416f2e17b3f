//! What a node author reads: a struct of ports and parameters is a node type.
//!
//! From that one declaration come the reading of graph files, the range checks, `warploom nodes NAME`, sliders and
//! the plugin manifest. See `core/docs/add-a-node.md` for a walk through a real node.

use std::borrow::Cow;
use std::marker::PhantomData;
use std::path::Path;
use std::sync::Arc;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

pub use crate::engine::Context;
pub use crate::value::Reads;
use crate::value::{Factor, Field, Given, Grid, Image, Kind, Labels, Mask, Mesh, Points, Rect, Value, Warp, Windows};

/// A node type: a struct whose fields are its ports ([`In`]) and parameters.
///
/// A node sees its inputs and parameters and nothing else: no clock, no environment, no file that is not a
/// parameter. What it returns is a function of what it sees; the cache rests on that.
pub trait Node: Serialize + DeserializeOwned + JsonSchema + Default + Send + Sync + 'static {
    /// Raised whenever the same inputs may give other bits than before.
    const VERSION: u32;
    /// Output ports, the first being what a bare `"node"` means. A sink has none.
    const OUTPUTS: &'static [Output];
    /// Whether it writes files.
    const SINK: bool = false;
    /// Whether its result depends on the frame number itself (not on Keys or `####`, which are values).
    const READS_FRAME: bool = false;
    /// Whether a library below it chooses instructions by the processor at hand, so that its bits hold on one
    /// processor family only.
    const CPU_FAMILY: bool = false;
    /// Whether it makes no more of its outputs than [`Context::wanted`] says, which then enters its key. What is left
    /// out is then nobody's: the value is `wanted` of the whole ([`Image::with_channels_only`]).
    const HEEDS_WANTED: bool = false;

    /// Which part of an image on `port` it looks at. May depend on constant parameters only.
    fn reads(&self, port: &str) -> Reads {
        let _ = port;
        Reads::All
    }

    /// Which requests it makes of `port` to answer `request`. May depend on constant parameters only; `shot` is the
    /// frames of the run. A request without a frame must be answered too: a node is static if, asked without a
    /// frame, it asks only static nodes without one.
    fn needs(&self, port: &str, request: &Request, shot: &[i64]) -> Vec<Request> {
        let _ = (port, shot);
        vec![request.clone()]
    }

    /// Refuses parameters that do not go together, so that nothing runs before they are mended. Ports cannot be looked
    /// at. Asked when a graph is checked, where all parameters are constant, and before every `compute`,
    /// where the first of several errors is told. Of several things that are wrong [`NodeError::all`] tells each.
    fn check(&self) -> Result<(), NodeError> {
        Ok(())
    }

    /// The outputs, in the order of `OUTPUTS`.
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError>;
}

/// What is asked of a node.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Request {
    /// The frame; none of what does not change over frames.
    pub frame: Option<i64>,
    /// Pixels of the full-resolution picture per pixel asked for, along each axis.
    pub scale: u32,
    /// The pixels asked for; none means all of them.
    pub region: Option<Rect>,
}

impl Request {
    /// All of the full-resolution picture at `frame`.
    pub fn whole(frame: Option<i64>) -> Self {
        Self { frame, scale: 1, region: None }
    }

    /// The same at another frame.
    pub fn at(&self, frame: Option<i64>) -> Self {
        Self { frame, ..self.clone() }
    }
}

/// An output port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Output {
    /// Its name; `"node.name"` in a graph file.
    pub name: &'static str,
    /// What comes out.
    pub kind: OutputKind,
}

/// The kind of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputKind {
    /// Always this kind.
    Is(Kind),
    /// The kind of what is connected to that port.
    SameAs(&'static str),
}

impl Output {
    /// An output of a fixed kind.
    pub const fn new(name: &'static str, kind: Kind) -> Self {
        Self { name, kind: OutputKind::Is(kind) }
    }

    /// An output of the kind that is connected to `port`.
    pub const fn same_as(name: &'static str, port: &'static str) -> Self {
        Self { name, kind: OutputKind::SameAs(port) }
    }
}

/// What a node computed.
#[derive(Clone, Debug, Default)]
pub struct Outputs {
    /// One value per output port.
    pub values: Vec<Value>,
    /// What the node measured of itself; kept with the record and shown in the report.
    pub stats: serde_json::Map<String, serde_json::Value>,
    /// What the user should know though there is a result; kept with the record.
    pub warnings: Vec<String>,
}

impl Outputs {
    /// Outputs in the order of the node's `OUTPUTS`.
    pub fn new(values: impl IntoIterator<Item = Value>) -> Self {
        Self { values: values.into_iter().collect(), ..Self::default() }
    }

    /// Adds a measurement; numbers that are not finite become null.
    pub fn stat(mut self, name: &str, value: impl Into<serde_json::Value>) -> Self {
        self.stats.insert(name.to_owned(), value.into());
        self
    }

    /// Adds a warning, if there is one: what is not as the user would expect, with the value, the place and the mend.
    /// It is told whenever the outputs are made or reused.
    pub fn warning(mut self, text: impl Into<Option<String>>) -> Self {
        self.warnings.extend(text.into());
        self
    }
}

impl<V: Into<Value>> From<V> for Outputs {
    fn from(value: V) -> Self {
        Self::new([value.into()])
    }
}

/// Why a node could not answer. It does not name itself: the engine adds node, frame and place in the graph file.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeError {
    /// Whose trouble it is.
    pub class: ErrorClass,
    /// What is wrong, with the value and the allowed range.
    pub message: String,
    /// The parameter or port it is about.
    pub parameter: Option<&'static str>,
    /// How to mend it.
    pub hint: Option<String>,
    /// What else is wrong; see [`NodeError::all`].
    pub others: Vec<NodeError>,
}

/// Classes of trouble, each with an exit code of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorClass {
    /// The inputs do not fit together, or cannot be worked on.
    Refused,
    /// A file is missing or cannot be read.
    InputUnreadable,
    /// A file is sound but of a sort that is not supported.
    InputUnsupported,
    /// A file cannot be written.
    OutputUnwritable,
    /// A file that is to be verified is another, or is not there.
    OutputDiffers,
    /// More memory would be needed than the budget allows.
    OverBudget,
    /// The run was cancelled.
    Cancelled,
}

impl NodeError {
    /// An error of a class.
    pub fn new(class: ErrorClass, message: impl Into<String>) -> Self {
        Self { class, message: message.into(), parameter: None, hint: None, others: Vec::new() }
    }

    /// The inputs do not fit together, or cannot be worked on.
    pub fn refused(message: impl Into<String>) -> Self {
        Self::new(ErrorClass::Refused, message)
    }

    /// Everything that is wrong of several things looked at, for [`Node::check`]: each is told.
    pub fn all(checks: impl IntoIterator<Item = Result<(), NodeError>>) -> Result<(), NodeError> {
        let mut errors = checks.into_iter().filter_map(Result::err).flat_map(Self::each);
        match errors.next() {
            None => Ok(()),
            Some(first) => Err(Self { others: errors.collect(), ..first }),
        }
    }

    /// It, and what else is wrong.
    pub(crate) fn each(mut self) -> impl Iterator<Item = Self> {
        let others = std::mem::take(&mut self.others);
        std::iter::once(self).chain(others)
    }

    /// Names the parameter or port it is about.
    pub fn at(mut self, parameter: &'static str) -> Self {
        self.parameter = Some(parameter);
        self
    }

    /// Says how to mend it.
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

/// What may be connected to a port, and how the node sees it.
pub trait Port: 'static {
    /// What [`Context::get`] gives.
    type Seen;
    /// Kinds that may be connected.
    const KINDS: &'static [Kind];
    /// Whether only windows are seen, so that pixels do not enter the node's key.
    const WINDOWS_ONLY: bool = false;
    /// The view of what is given of a value of one of `KINDS`.
    fn see(given: &Given) -> Option<Self::Seen>;
}

macro_rules! port_of_kind {
    ($($kind:ident),*) => {$(
        impl Port for $kind {
            type Seen = Arc<$kind>;
            const KINDS: &'static [Kind] = &[Kind::$kind];
            fn see(given: &Given) -> Option<Arc<$kind>> {
                match given {
                    Given::Value(Value::$kind(seen)) => Some(seen.clone()),
                    _ => None,
                }
            }
        }
    )*};
}

port_of_kind!(Image, Mask, Field, Labels, Grid, Warp, Factor, Points, Mesh);

impl Port for f64 {
    type Seen = f64;
    const KINDS: &'static [Kind] = &[Kind::Number];
    fn see(given: &Given) -> Option<f64> {
        match given {
            Given::Value(Value::Number(number)) => Some(*number),
            _ => None,
        }
    }
}

/// A port that sees where a picture lies and not what is in it.
pub struct Domain;

impl Port for Domain {
    type Seen = Windows;
    const KINDS: &'static [Kind] = &[Kind::Image, Kind::Mask, Kind::Field, Kind::Labels];
    const WINDOWS_ONLY: bool = true;
    fn see(given: &Given) -> Option<Windows> {
        match given {
            Given::Windows(windows) => Some(*windows),
            Given::Value(_) => None,
        }
    }
}

/// A port that takes anything that has pixels.
pub struct Raster;

impl Port for Raster {
    type Seen = Value;
    const KINDS: &'static [Kind] = Domain::KINDS;
    fn see(given: &Given) -> Option<Value> {
        Any::see(given)
    }
}

/// A port that takes a value of any kind.
pub struct Any;

impl Port for Any {
    type Seen = Value;
    const KINDS: &'static [Kind] = &Kind::OWN;
    fn see(given: &Given) -> Option<Value> {
        match given {
            Given::Value(value) => Some(value.clone()),
            Given::Windows(_) => None,
        }
    }
}

/// An input port. `Option<In<K>>` may stay unconnected, `Vec<In<K>>` takes a list.
pub struct In<K> {
    /// Which connection of the node feeds it; filled in when a graph is checked.
    pub(crate) slot: usize,
    kind: PhantomData<fn() -> K>,
}

impl<K> Clone for In<K> {
    fn clone(&self) -> Self {
        Self { slot: self.slot, kind: PhantomData }
    }
}

impl<K> Default for In<K> {
    fn default() -> Self {
        Self { slot: usize::MAX, kind: PhantomData }
    }
}

impl<K> Serialize for In<K> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u64(self.slot as u64)
    }
}

impl<'de, K> Deserialize<'de> for In<K> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Self { slot: u64::deserialize(deserializer)? as usize, kind: PhantomData })
    }
}

impl<K: Port> JsonSchema for In<K> {
    fn schema_name() -> Cow<'static, str> {
        "In".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let kinds: Vec<&str> = K::KINDS.iter().map(|kind| kind.name()).collect();
        match K::WINDOWS_ONLY {
            true => json_schema!({ "type": "string", "x-port": kinds, "x-reads": "windows" }),
            false => json_schema!({ "type": "string", "x-port": kinds }),
        }
    }
}

macro_rules! path_parameter {
    ($(#[$doc:meta])* $name:ident, $access:literal) => {
        $(#[$doc])*
        #[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub(crate) String);

        impl $name {
            /// The file, absolute, of the frame asked for.
            pub fn path(&self) -> &Path {
                Path::new(&self.0)
            }
        }

        impl JsonSchema for $name {
            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }

            fn inline_schema() -> bool {
                true
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "string", "x-path": $access, "x-required": true })
            }
        }
    };
}

path_parameter!(
    /// A file the node reads, relative to the graph file; `####` stands for the frame. Its content, not its name,
    /// enters the node's key.
    ReadPath,
    "read"
);
path_parameter!(
    /// A file the node writes, relative to the graph file; `####` stands for the frame.
    WritePath,
    "write"
);
