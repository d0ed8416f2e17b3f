//! A checked graph: names resolved, defaults filled, order known. Whoever runs it needs no other knowledge.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use serde_json::Value as Json;

use super::frames;
use super::source::{At, Sources};
use crate::diag::{Code, Fault, Place};
use crate::engine::Pairs;
use crate::node::Request;
use crate::registry::{AnyNode, NodeType};
use crate::schema::{Access, IntRange, Range, Shape, shown};
use crate::value::{Digest, Reads};

/// A checked, ordered graph.
pub struct Plan {
    /// The graph file, absolute.
    pub graph: PathBuf,
    /// All nodes, in file order.
    pub nodes: Vec<PlanNode>,
    /// Nodes to run for, in file order.
    pub targets: Vec<usize>,
    /// The targets and all they need, each after its inputs.
    pub order: Vec<usize>,
    /// Frames of the run; empty if none were given.
    pub frames: Vec<i64>,
    /// The texts it was made from.
    pub sources: Sources,
    /// What it asks of which node, followed once.
    pub(crate) pairs: OnceLock<Pairs>,
}

/// A node of a plan.
pub struct PlanNode {
    /// Its name in the graph file.
    pub id: Arc<str>,
    /// Its type.
    pub node_type: Arc<NodeType>,
    /// Its parameters, to be filled in per request.
    pub params: Template,
    /// What feeds its ports, in the order of declaration and of lists.
    pub slots: Vec<Slot>,
    /// Number outputs that feed parameters.
    pub links: Vec<(usize, usize)>,
    /// The node with Keys and links at their defaults: answers `needs`.
    pub prototype: Box<dyn AnyNode>,
    /// Per output, what all who read it look at together. All of it where the type makes that in any case.
    pub wanted: Vec<Reads>,
    /// Whether it is the same for all frames.
    pub is_static: bool,
    /// Where its type's name stands.
    pub at: At,
    /// Where the parameters stand that are given.
    pub param_at: Vec<(String, At)>,
    /// What its keys begin with, where that is the same for all its pairs.
    pub(crate) recipe: OnceLock<Digest>,
}

/// One connection.
#[derive(Clone, Debug)]
pub struct Slot {
    /// The port.
    pub port: String,
    /// The node it comes from.
    pub source: usize,
    /// Which of its outputs.
    pub output: usize,
    /// What the node looks at.
    pub reads: Reads,
}

/// Parameters with places to be filled in at a frame.
#[derive(Clone, Debug, Default)]
pub struct Template {
    /// One entry per port (slot numbers) and parameter, in the order of declaration.
    pub json: serde_json::Map<String, Json>,
    /// Numbers that are not constant.
    pub holes: Vec<Hole>,
    /// Path parameters.
    pub paths: Vec<(String, Access)>,
}

impl Template {
    /// The parameter that each link feeds, in the order of links.
    pub fn links(&self) -> Vec<String> {
        let linked = self.holes.iter().filter(|hole| matches!(hole.source, Source::Link(_)));
        linked
            .map(|hole| match &hole.path[0] {
                Step::Field(name) => name.clone(),
                Step::Index(index) => index.to_string(),
            })
            .collect()
    }
}

/// A number that is not constant.
#[derive(Clone, Debug)]
pub struct Hole {
    /// Where in the JSON: the parameter, then fields and indices.
    pub path: Vec<Step>,
    /// Where the number comes from.
    pub source: Source,
    /// What it must be.
    pub shape: Shape,
    /// Where it stands.
    pub at: At,
}

/// A step into JSON.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Into an object.
    Field(String),
    /// Into an array.
    Index(usize),
}

/// Where a number that is not constant comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// Linear between keys, held outside.
    Keys(Vec<(i64, f64)>),
    /// Number of one of the node's links.
    Link(usize),
}

impl Plan {
    /// The node of that name.
    pub fn node(&self, id: &str) -> Option<usize> {
        self.nodes.iter().position(|node| &*node.id == id)
    }

    /// Every pair of a run.
    pub(crate) fn pairs(&self) -> &Pairs {
        self.pairs.get_or_init(|| Pairs::expand(self))
    }

    /// Where a parameter of a node stands, or the node if it is not given.
    pub fn place(&self, node: usize, param: Option<&str>) -> Place {
        let node = &self.nodes[node];
        let given = node.param_at.iter().find(|(name, _)| Some(name.as_str()) == param);
        self.sources.place(given.map_or(node.at, |(_, at)| *at))
    }

    /// What is really asked when `request` is made of `node`: static nodes have no frame.
    pub fn canonical(&self, node: usize, request: &Request) -> Request {
        if self.nodes[node].is_static { request.at(None) } else { request.clone() }
    }

    /// Every file that a run reads or writes.
    pub fn files(&self) -> impl Iterator<Item = (Access, PathBuf)> + '_ {
        self.pairs().list.iter().flat_map(move |pair| {
            [Access::Read, Access::Write].into_iter().flat_map(move |access| {
                self.files_at(pair.node, pair.request.frame, access).map(move |(_, path)| (access, path))
            })
        })
    }

    /// Parameters of a node at a frame; `links` are the values of the node's links, where they are known.
    pub fn params_at(
        &self,
        node: usize,
        frame: Option<i64>,
        links: &[Option<f64>],
    ) -> Result<serde_json::Map<String, Json>, Fault> {
        let params = &self.nodes[node].params;
        let mut json = params.json.clone();
        for hole in &params.holes {
            let value = match &hole.source {
                // A node with Keys is never asked without a frame: the check gave it one.
                Source::Keys(keys) => interpolate(keys, frame.unwrap_or_default()),
                Source::Link(link) => match links[*link] {
                    Some(value) => value,
                    None => continue,
                },
            };
            let filled = fill(&hole.shape, value).map_err(|allowed| {
                let name = match &hole.path[0] {
                    Step::Field(name) => name.as_str(),
                    Step::Index(_) => "",
                };
                let code = if value.is_finite() { Code::OutOfRange } else { Code::NotFinite };
                let unit = self.nodes[node].node_type.param(name).and_then(|param| param.unit.as_deref());
                let unit = unit.map(|unit| format!(" {unit}")).unwrap_or_default();
                let value = shown(value);
                Fault::new(code, format!("`{name}` comes to {value}{unit} here; it must be {allowed}{unit}"))
                    .parameter(name)
                    .place(Some(self.sources.place(hole.at)))
            })?;
            *target(&mut json, &hole.path) = filled;
        }
        for (name, _) in &params.paths {
            if let (Some(frame), Some(Json::String(path))) = (frame, json.get_mut(name)) {
                *path = self.path_at(path, frame);
            }
        }
        Ok(json)
    }

    fn path_at(&self, path: &str, frame: i64) -> String {
        let folder = self.graph.parent().unwrap_or(Path::new(""));
        let (folder, rest) = frames::split_folder(path, folder);
        format!("{folder}{}", frames::expand_pattern(rest, frame))
    }

    /// The files that a node reads or writes at a frame, and the parameters that name them. A path is text, and text
    /// is never linked.
    pub fn files_at(&self, node: usize, frame: Option<i64>, access: Access) -> impl Iterator<Item = (&str, PathBuf)> {
        let params = &self.nodes[node].params;
        let named = params.paths.iter().filter(move |(_, is)| *is == access);
        named.filter_map(move |(name, _)| {
            let path = params.json.get(name)?.as_str()?;
            Some((name.as_str(), frame.map_or_else(|| path.into(), |frame| self.path_at(path, frame).into())))
        })
    }
}

fn target<'a>(json: &'a mut serde_json::Map<String, Json>, path: &[Step]) -> &'a mut Json {
    let (Some(Step::Field(first)), rest) = (path.first(), path.get(1..).unwrap_or_default()) else {
        unreachable!("a hole lies in a parameter")
    };
    let mut at = &mut json[first.as_str()];
    for step in rest {
        at = match step {
            Step::Field(name) => &mut at[name.as_str()],
            Step::Index(index) => &mut at[*index],
        };
    }
    at
}

/// The number as the parameter takes it, or what is allowed.
fn fill(shape: &Shape, value: f64) -> Result<Json, String> {
    match shape {
        Shape::Number(range) if value.is_finite() && range.holds(value) => Ok(json_number(value)),
        Shape::Integer { range, .. } if value.is_finite() => {
            let IntRange { min, max } = *range;
            let whole = value.round() as i128;
            let fits = (min..=max).contains(&whole);
            if fits { Ok(json_integer(whole)) } else { Err(range.to_string()) }
        }
        Shape::Number(range) if *range == Range::default() => Err("finite".into()),
        Shape::Number(range) => Err(range.to_string()),
        other => Err(other.describe(None)),
    }
}

/// A JSON number that stays a float; -0.0 becomes 0.0. `value` is finite.
pub(crate) fn json_number(value: f64) -> Json {
    serde_json::Number::from_f64(value + 0.0).map_or(Json::Null, Json::Number)
}

/// A JSON number that stays whole; `value` fits i64 or u64, as integer parameters do.
pub(crate) fn json_integer(value: i128) -> Json {
    match (i64::try_from(value), u64::try_from(value)) {
        (Ok(value), _) => value.into(),
        (_, Ok(value)) => value.into(),
        _ => Json::Null,
    }
}

/// Linear between keys, held outside; `keys` rise and are not empty.
pub fn interpolate(keys: &[(i64, f64)], frame: i64) -> f64 {
    let after = keys.partition_point(|&(at, _)| at <= frame);
    match (after.checked_sub(1).map(|before| keys[before]), keys.get(after)) {
        (Some((f0, v0)), Some(&(f1, v1))) if v0 != v1 => {
            let distance = |from: i64, to: i64| (i128::from(to) - i128::from(from)) as f64;
            let part = distance(f0, frame) / distance(f0, f1);
            v0 * (1.0 - part) + v1 * part
        }
        (Some((_, value)), _) | (None, Some(&(_, value))) => value,
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_linear_between_and_held_outside() {
        let keys = [(1001, 0.0), (1011, 60.0), (1013, -2.0)];
        let at = |frame| interpolate(&keys, frame);
        assert_eq!(
            [at(900), at(1001), at(1006), at(1011), at(1012), at(1013), at(9999)],
            [0.0, 0.0, 30.0, 60.0, 29.0, -2.0, -2.0]
        );
        assert_eq!(interpolate(&[(5, 0.1), (9, 0.1)], 7), 0.1, "equal keys give their value to the bit");
    }
}
