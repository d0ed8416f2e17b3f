//! Node types at run time: what a graph may name, whoever made it.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::Value as Json;

use crate::engine::Context;
use crate::node::{Node, NodeError, Output, Outputs, Request};
use crate::schema::{self, Param, Shape};
use crate::value::Reads;

/// A node type: its declaration, and how to make a node of it.
pub struct NodeType {
    /// Its name in graph files.
    pub name: Arc<str>,
    /// See [`Node::VERSION`].
    pub version: u32,
    /// What it does.
    pub doc: String,
    /// Ports and parameters in the order of declaration.
    pub params: Vec<Param>,
    /// Output ports.
    pub outputs: &'static [Output],
    /// Whether it writes files.
    pub sink: bool,
    /// Whether it depends on the frame number itself.
    pub reads_frame: bool,
    /// Whether its bits hold on one processor family only.
    pub cpu_family: bool,
    /// Whether it makes no more of its outputs than is wanted.
    pub heeds_wanted: bool,
    /// The JSON Schema all of this was made from; a plugin's manifest has the same form.
    pub schema: Json,
    make: fn(&Json) -> Result<Box<dyn AnyNode>, serde_json::Error>,
}

/// A node with its parameters, ready to compute.
pub trait AnyNode: Send + Sync {
    /// See [`Node::reads`].
    fn reads(&self, port: &str) -> Reads;
    /// See [`Node::needs`].
    fn needs(&self, port: &str, request: &Request, shot: &[i64]) -> Vec<Request>;
    /// See [`Node::check`].
    fn check(&self) -> Result<(), NodeError>;
    /// See [`Node::compute`].
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError>;
}

impl<T: Node> AnyNode for T {
    fn reads(&self, port: &str) -> Reads {
        Node::reads(self, port)
    }

    fn needs(&self, port: &str, request: &Request, shot: &[i64]) -> Vec<Request> {
        Node::needs(self, port, request, shot)
    }

    fn check(&self) -> Result<(), NodeError> {
        Node::check(self)
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        Node::compute(self, cx)
    }
}

impl NodeType {
    /// The node type `T` under a name. A declaration that no graph file could use is the author's bug and panics.
    pub fn of<T: Node>(name: &str) -> Self {
        let schema = schemars::generate::SchemaSettings::draft2020_12()
            .with(|settings| settings.inline_subschemas = true)
            .into_generator()
            .into_root_schema_for::<T>()
            .to_value();
        let defaults = serde_json::to_value(T::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        let params = schema::params(&schema, &defaults).unwrap_or_else(|e| panic!("{name}.{e}"));
        Self {
            name: name.into(),
            version: T::VERSION,
            doc: schema.get("description").and_then(Json::as_str).unwrap_or_default().to_owned(),
            params,
            outputs: T::OUTPUTS,
            sink: T::SINK,
            reads_frame: T::READS_FRAME,
            cpu_family: T::CPU_FAMILY,
            heeds_wanted: T::HEEDS_WANTED,
            schema,
            make: |params| Ok(Box::new(serde_json::from_value::<T>(params.clone())?)),
        }
    }

    /// A node with checked parameters: every port a slot number, every parameter there.
    pub fn make(&self, params: &Json) -> Box<dyn AnyNode> {
        (self.make)(params).unwrap_or_else(|e| panic!("{}: checked parameters do not fit: {e}", self.name))
    }

    /// The port or parameter of that name.
    pub fn param(&self, name: &str) -> Option<&Param> {
        self.params.iter().find(|param| param.name == name)
    }

    /// Number of the output of that name.
    pub fn output(&self, name: &str) -> Option<usize> {
        self.outputs.iter().position(|output| output.name == name)
    }

    /// Ports in the order of declaration.
    pub fn ports(&self) -> impl Iterator<Item = (&Param, &schema::PortShape)> {
        self.params.iter().filter_map(|param| match &param.shape {
            Shape::Port(port) => Some((param, port)),
            _ => None,
        })
    }
}

/// A named node type in a list of nodes: `def::<Blur>("Blur")`.
pub type Definition = (&'static str, fn(&str) -> NodeType);

/// An entry of a list of nodes.
pub const fn def<T: Node>(name: &'static str) -> Definition {
    (name, NodeType::of::<T>)
}

/// Node types by name.
#[derive(Default)]
pub struct Registry {
    types: BTreeMap<String, Arc<NodeType>>,
}

impl Registry {
    /// All types of a list. Two of one name are the author's bug and panic.
    pub fn new(list: &[Definition]) -> Self {
        let mut registry = Self::default();
        for (name, make) in list {
            let before = registry.types.insert((*name).to_owned(), Arc::new(make(name)));
            assert!(before.is_none(), "two node types are named {name}");
        }
        registry
    }

    /// The type of that name.
    pub fn get(&self, name: &str) -> Option<&Arc<NodeType>> {
        self.types.get(name)
    }

    /// All types, by name.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<NodeType>> + Clone {
        self.types.values()
    }
}
