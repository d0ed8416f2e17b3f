//! Good graphs made from the declarations of the node types, each piece of their text known by its role.

use std::ops::Range;
use std::path::Path;

use warploom_core::diag::Code;
use warploom_core::graph::{Options, check};
use warploom_core::node::OutputKind;
use warploom_core::registry::{NodeType, Registry};
use warploom_core::schema::{Access, Arity, Param, PortShape, Shape};
use warploom_core::value::Kind;

use crate::Random;

/// What a piece of text is in its graph.
#[derive(Clone, Debug, PartialEq)]
pub enum Role {
    /// The name of a node type.
    Type,
    /// The name of a parameter.
    Parameter,
    /// The id in a reference, and what its port takes.
    Reference(PortShape),
    /// The output in a reference.
    Output,
    /// A choice, and all that the parameter takes.
    Variant(Vec<String>),
    /// A number with its least and greatest value.
    Number(Option<f64>, Option<f64>),
    /// A comma between two parameters.
    Comma,
}

/// A piece of the text.
#[derive(Clone, Debug)]
pub struct Piece {
    /// What it is.
    pub role: Role,
    /// Where it is, bytes.
    pub span: Range<usize>,
    /// Number of its node.
    pub node: usize,
    /// The parameter that it belongs to.
    pub param: String,
}

/// A node of a good graph; each comes after those that feed it, wherever it stands in the file.
pub struct Made {
    /// Its name.
    pub id: String,
    /// Its type.
    pub of: String,
    /// Its outputs.
    pub gives: Vec<Gives>,
}

/// What an output gives.
#[derive(Clone)]
pub struct Gives {
    /// The output.
    pub name: &'static str,
    /// The kind.
    pub kind: Kind,
    /// The type of the node that makes it, which others may only pass on.
    pub maker: String,
}

impl Gives {
    /// Whether a port takes it.
    pub fn fits(&self, port: &PortShape) -> bool {
        port.kinds.contains(&self.kind) && port.maker.as_ref().is_none_or(|maker| *maker == self.maker)
    }
}

/// A graph without faults.
pub struct Good {
    /// The file.
    pub text: String,
    /// Its pieces, node by node.
    pub pieces: Vec<Piece>,
    /// Its nodes, each after those that feed it.
    pub made: Vec<Made>,
}

const WORDS: [&str; 32] = [
    "plate", "matte", "parts", "lattice", "bend", "solver", "keep", "warped", "backdrop", "hero", "stripes", "edges",
    "feather", "holdout", "logo", "corners", "wobble", "texture", "cleanup", "preview", "shadow", "window", "garment",
    "outline", "fabric", "poster", "curtain", "ribbon", "marker", "banner", "canvas", "surface",
];

impl Good {
    /// The graph of a number.
    pub fn new(seed: u64, registry: &Registry) -> Self {
        let mut random = Random(seed);
        let types: Vec<&NodeType> = registry.iter().map(|node_type| &**node_type).collect();
        let (text, pieces, made) = Default::default();
        let mut maker = Maker { text, pieces, made, random: &mut random, registry };
        maker.nodes(&types);
        let Maker { text: body, pieces, made, .. } = maker;
        let mut order: Vec<usize> = (0..made.len()).collect();
        (1..order.len()).rev().for_each(|at| order.swap(at, random.below(at + 1)));
        let mut good = Self { text: "Graph(\n    version: 1,\n".into(), pieces: Vec::new(), made };
        good.text += "    frames: \"1001-1012\",\n    nodes: {\n";
        let lines: Vec<&str> = body.split_inclusive('\n').collect();
        for node in order {
            let from: usize = lines[..node].iter().map(|line| line.len()).sum();
            let to = good.text.len();
            let moved = |span: &Range<usize>| span.start - from + to..span.end - from + to;
            let of_node = pieces.iter().filter(|piece| piece.node == node);
            good.pieces.extend(of_node.map(|piece| Piece { span: moved(&piece.span), ..piece.clone() }));
            good.text += lines[node];
        }
        good.text += "    },\n)\n";
        good
    }

    /// A piece's text.
    pub fn said(&self, piece: &Piece) -> &str {
        &self.text[piece.span.clone()]
    }
}

/// Writes the nodes, one a line.
struct Maker<'a> {
    text: String,
    pieces: Vec<Piece>,
    made: Vec<Made>,
    random: &'a mut Random,
    registry: &'a Registry,
}

impl Maker<'_> {
    fn nodes(&mut self, types: &[&NodeType]) {
        // Graphs grow with the list, so that a fixed number of them uses all of it.
        let count = 4 + self.random.below(types.len() / 2);
        while self.made.len() < count {
            let possible: Vec<&&NodeType> = types.iter().filter(|t| !t.sink && self.can_feed(t)).collect();
            let unused: Vec<&&NodeType> =
                possible.iter().copied().filter(|t| self.made.iter().all(|made| *made.of != *t.name)).collect();
            let choice = if unused.is_empty() || self.random.below(4) == 0 { possible } else { unused };
            // Of two the one with more ports: what needs much would come up rarely.
            let (one, other) = (*self.random.pick(&choice), *self.random.pick(&choice));
            self.node(if one.ports().count() > other.ports().count() { one } else { other });
        }
        let sinks: Vec<&&NodeType> = types.iter().filter(|t| t.sink && self.can_feed(t)).collect();
        if sinks.is_empty() {
            let card = types.iter().find(|t| &*t.name == "Constant").expect("a card");
            self.node(card);
        }
        let sinks: Vec<&&NodeType> = types.iter().filter(|t| t.sink && self.can_feed(t)).collect();
        for _ in 0..1 + self.random.below(2) {
            let sink = **self.random.pick(&sinks);
            self.node(sink);
        }
    }

    fn can_feed(&self, node_type: &NodeType) -> bool {
        node_type.ports().all(|(_, port)| port.arity == Arity::Optional || !self.givers(port).is_empty())
    }

    /// Node and output, by number, of all outputs that a port takes.
    fn givers(&self, port: &PortShape) -> Vec<(usize, usize)> {
        let outputs = self.made.iter().enumerate().flat_map(|(node, made)| {
            made.gives.iter().enumerate().filter(|(_, gives)| gives.fits(port)).map(move |(output, _)| (node, output))
        });
        outputs.collect()
    }

    /// A node whose parameters go together.
    fn node(&mut self, node_type: &NodeType) {
        let (text, pieces) = (self.text.len(), self.pieces.len());
        for _ in 0..1000 {
            let made = self.draw(node_type);
            let graph = format!("Graph(version: 1, frames: \"1001-1012\", nodes: {{ {} }})", &self.text[text..]);
            let checked = check(&graph, self.registry, &Options::new(Path::new("graph.ron")));
            if checked.faults.iter().all(|fault| fault.code != Code::Conflict) {
                return self.made.push(made);
            }
            self.text.truncate(text);
            self.pieces.truncate(pieces);
        }
        panic!("no parameters of {} go together", node_type.name);
    }

    fn draw(&mut self, node_type: &NodeType) -> Made {
        let number = self.made.len();
        let word = WORDS[(self.random.below(8) + number * 5) % WORDS.len()];
        let taken = self.made.iter().any(|made| made.id == word);
        let id = if taken { format!("{word}_{number}") } else { word.to_owned() };
        self.text += &format!("        \"{id}\": ");
        self.piece(Role::Type, "", &node_type.name);
        self.text.push('(');
        let mut fed = Vec::new();
        let mut first = true;
        for param in &node_type.params {
            let starved = matches!(&param.shape, Shape::Port(port) if self.givers(port).is_empty());
            if !param.required && (starved || self.random.below(2) == 0) {
                continue;
            }
            if !std::mem::take(&mut first) {
                self.piece(Role::Comma, &param.name, ",");
                self.text.push(' ');
            }
            self.piece(Role::Parameter, &param.name, &param.name);
            self.text += ": ";
            self.value(&id, param, &param.shape, &mut fed);
        }
        self.text += "),\n";
        let gives = node_type.outputs.iter().map(|output| match output.kind {
            OutputKind::Is(kind) => Gives { name: output.name, kind, maker: node_type.name.to_string() },
            OutputKind::SameAs(port) => {
                let (_, gives) = fed.iter().find(|(name, _)| name == port).expect("the port is required");
                Gives { name: output.name, ..gives.clone() }
            }
        });
        Made { id, of: node_type.name.to_string(), gives: gives.collect() }
    }

    fn piece(&mut self, role: Role, param: &str, text: &str) {
        let start = self.text.len();
        self.text += text;
        let node = self.made.len();
        self.pieces.push(Piece { role, span: start..self.text.len(), node, param: param.to_owned() });
    }

    fn value(&mut self, id: &str, param: &Param, shape: &Shape, fed: &mut Vec<(String, Gives)>) {
        match shape {
            Shape::Port(port) if port.arity == Arity::List => {
                self.text.push('[');
                for at in 0..1 + self.random.below(3) {
                    self.text += if at > 0 { ", " } else { "" };
                    self.reference(param, port, fed);
                }
                self.text.push(']');
            }
            Shape::Port(port) => self.reference(param, port, fed),
            Shape::Number(range) => {
                let (min, max) = (range.min.unwrap_or(-100.0), range.max.unwrap_or(100.0).min(9999.0));
                let min = if range.above_min { min + 0.01 } else { min };
                let number = self.random.between(min, max);
                match self.random.below(8) {
                    0 => {
                        let other = self.random.between(min, max);
                        self.text += &format!("Keys([(1001, {number:?}), (1012, {other:?})])");
                    }
                    1 if !self.givers(&PortShape::of(Kind::Number)).is_empty() => {
                        self.reference(param, &PortShape::of(Kind::Number), fed);
                    }
                    _ => self.piece(Role::Number(range.min, range.max), &param.name, &format!("{number:?}")),
                }
            }
            Shape::Integer { range, .. } => {
                let limits = [range.min, range.max].map(|limit| Some(limit as f64).filter(|l| l.abs() < 1e9));
                let number = range.min.max(0) + self.random.below(64) as i128;
                let role = Role::Number(limits[0], limits[1]);
                self.piece(role, &param.name, &number.min(range.max).to_string());
            }
            Shape::Bool => self.text += *self.random.pick(&["true", "false"]),
            Shape::Text(None) => self.text += *self.random.pick(&["\"A\"", "\"luma\"", "r#\"über\"#"]),
            Shape::Text(Some(Access::Read)) => self.text += "\"plates/sh010.####.exr\"",
            Shape::Text(Some(Access::Write)) => self.text += &format!("\"out/{id}.####.exr\""),
            Shape::Choice(variants) => {
                let plain: Vec<&str> =
                    variants.iter().filter(|v| v.content.is_none()).map(|v| v.name.as_str()).collect();
                let name = *self.random.pick(&plain);
                let names = variants.iter().map(|variant| variant.name.clone()).collect();
                self.piece(Role::Variant(names), &param.name, name);
            }
            Shape::Tuple(items) => {
                self.text.push('(');
                for (at, item) in items.iter().enumerate() {
                    self.text += if at > 0 { ", " } else { "" };
                    self.value(id, param, item, fed);
                }
                self.text.push(')');
            }
            Shape::List(item) => {
                self.text.push('[');
                for at in 0..1 + self.random.below(3) {
                    self.text += if at > 0 { ", " } else { "" };
                    self.value(id, param, item, fed);
                }
                self.text.push(']');
            }
            Shape::Optional(inner) => match self.random.below(4) {
                0 => self.text += "None",
                1 => {
                    self.text += "Some(";
                    self.value(id, param, inner, fed);
                    self.text.push(')');
                }
                _ => self.value(id, param, inner, fed),
            },
            Shape::Struct(fields) => {
                self.text.push('(');
                for (at, field) in fields.iter().filter(|field| field.required).enumerate() {
                    self.text += &format!("{}{}: ", if at > 0 { ", " } else { "" }, field.name);
                    self.value(id, field, &field.shape, fed);
                }
                self.text.push(')');
            }
        }
    }

    fn reference(&mut self, param: &Param, port: &PortShape, fed: &mut Vec<(String, Gives)>) {
        let givers = self.givers(port);
        let &(node, output) = self.random.pick(&givers);
        let gives = self.made[node].gives[output].clone();
        let id = self.made[node].id.clone();
        self.text.push('"');
        self.piece(Role::Reference(port.clone()), &param.name, &id);
        if output > 0 || self.random.below(4) == 0 {
            self.text.push('.');
            self.piece(Role::Output, &param.name, gives.name);
        }
        self.text.push('"');
        fed.push((param.name.clone(), gives));
    }
}
