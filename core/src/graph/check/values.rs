//! Parameters along their shapes: types, ranges, names; Keys, links and paths lifted out.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use serde_json::Value as Json;

use super::document::{Entry, Graph};
use super::{At, Options, Reporter};
use crate::diag::{Code, Fault, suggestion};
use crate::graph::frames::{expand_variables, has_pattern};
use crate::graph::plan::{Hole, Source, Step, Template, json_integer, json_number};
use crate::graph::read::{Ron, Spanned};
use crate::registry::NodeType;
use crate::schema::{Access, Arity, Param, PortShape, Shape, Variant};

/// A node whose values are checked and whose names are not resolved yet.
pub(super) struct Draft {
    pub node_type: Arc<NodeType>,
    pub params: Template,
    /// What its ports name.
    pub ports: Vec<Reference>,
    /// What its linked numbers name; the first has link number 0.
    pub links: Vec<Reference>,
    pub param_at: Vec<(String, At)>,
    pub at: At,
    /// Where it first says something that changes over frames.
    pub animated_at: Option<At>,
}

/// A `"node"` or `"node.port"`.
pub(super) struct Reference {
    pub param: String,
    pub text: String,
    pub at: At,
    /// The port, if it is not a linked number.
    pub port: Option<PortShape>,
}

/// A draft per node; none where a node cannot be checked.
pub(super) fn read_nodes(graph: &Graph, options: &Options, report: &mut Reporter) -> Vec<Option<Draft>> {
    let folder = options.file.parent().unwrap_or(Path::new("")).to_owned();
    let folder = std::path::absolute(&folder).unwrap_or(folder);
    let read = |entry: &Entry, report: &mut Reporter| {
        let node_type = entry.node_type.clone().filter(|_| entry.sound)?;
        Some(read_node(entry, node_type, &folder, options, report))
    };
    graph.nodes.iter().map(|entry| read(entry, report)).collect()
}

fn read_node(
    entry: &Entry,
    node_type: Arc<NodeType>,
    folder: &Path,
    options: &Options,
    report: &mut Reporter,
) -> Draft {
    let mut given: HashMap<&str, (&Spanned<Ron>, At, u32)> = HashMap::new();
    for field in &entry.fields {
        let known = node_type.param(field.name);
        let fault = if known.is_none() {
            let names = node_type.params.iter().map(|param| param.name.as_str());
            let message = format!("`{}` has no parameter `{}`", node_type.name, field.name);
            Fault::new(Code::UnknownParameter, message).hint(suggestion(field.name, names))
        } else if given.insert(field.name, (field.value, field.name_at, field.source)).is_some() {
            Fault::new(Code::DuplicateParameter, format!("`{}` is given twice", field.name))
        } else {
            continue;
        };
        report.add(field.name_at, fault.node(entry.id).parameter(field.name));
    }
    let draft = Draft {
        node_type: node_type.clone(),
        params: Template::default(),
        ports: Vec::new(),
        links: Vec::new(),
        param_at: Vec::new(),
        at: entry.at,
        animated_at: None,
    };
    let mut walk = Walk { node: entry.id, param: "", source: 0, path: Vec::new(), folder, options, report, draft };
    for param in &node_type.params {
        walk.param = &param.name;
        walk.path = vec![Step::Field(param.name.clone())];
        let json = match given.get(param.name.as_str()) {
            Some((value, _, source)) => {
                walk.source = *source;
                walk.draft.param_at.push((param.name.clone(), At { source: *source, span: value.span }));
                walk.value(value, &param.shape, param.unit.as_deref()).unwrap_or(Json::Null)
            }
            None => {
                walk.absent(param, entry.at);
                if matches!(&param.shape, Shape::Port(port) if port.arity == Arity::List) {
                    Json::Array(Vec::new())
                } else if matches!(param.shape, Shape::Port(_)) {
                    Json::Null
                } else {
                    param.default.clone()
                }
            }
        };
        walk.draft.params.json.insert(param.name.clone(), json);
    }
    if node_type.reads_frame {
        walk.draft.animated_at.get_or_insert(entry.at);
    }
    walk.draft
}

/// One node's values on the way.
struct Walk<'a> {
    node: &'a str,
    param: &'a str,
    source: u32,
    path: Vec<Step>,
    folder: &'a Path,
    options: &'a Options<'a>,
    report: &'a mut Reporter,
    draft: Draft,
}

impl Walk<'_> {
    fn at(&self, value: &Spanned<Ron>) -> At {
        At { source: self.source, span: value.span }
    }

    fn fault(&mut self, at: At, code: Code, message: String, hint: Option<String>) {
        let fault = Fault::new(code, message).node(self.node).parameter(self.param).hint(hint);
        self.report.add(at, fault);
    }

    fn absent(&mut self, param: &Param, at: At) {
        if !param.required {
            return;
        }
        let what = param.shape.describe(param.unit.as_deref());
        let (code, message) = match param.shape {
            Shape::Port(_) => (Code::MissingInput, format!("`{}` is not connected", param.name)),
            _ => (Code::MissingParameter, format!("`{}` is not given", param.name)),
        };
        self.fault(at, code, message, Some(format!("it takes {what}")));
    }

    fn mistyped<T>(&mut self, value: &Spanned<Ron>, shape: &Shape, unit: Option<&str>) -> Option<T> {
        let (what, hint) = (found(&value.value), bracket_hint(&value.value, shape));
        let message = format!("`{}` takes {}, found {what}", self.param, shape.describe(unit));
        self.fault(self.at(value), Code::Mistyped, message, hint);
        None
    }

    fn value(&mut self, value: &Spanned<Ron>, shape: &Shape, unit: Option<&str>) -> Option<Json> {
        match (shape, &value.value) {
            (Shape::Port(port), _) => self.port(value, port),
            (Shape::Optional(_), Ron::Name(name)) if name == "None" => Some(Json::Null),
            (Shape::Optional(inner), Ron::Tuple { name: Some(name), items }) if name.value == "Some" => {
                match &items[..] {
                    [item] => self.value(item, inner, unit),
                    _ => self.mistyped(value, shape, unit),
                }
            }
            (Shape::Optional(inner), _) => self.value(value, inner, unit),
            (Shape::Number(_) | Shape::Integer { .. }, _) => self.number(value, shape, unit),
            (Shape::Bool, Ron::Bool(flag)) => Some((*flag).into()),
            (Shape::Text(access), Ron::Text(text)) => self.text(value, text, *access),
            (Shape::Choice(variants), _) => self.choice(value, shape, variants),
            (Shape::Tuple(shapes), Ron::Tuple { name: None, items }) if items.len() == shapes.len() => {
                self.items(items.iter().zip(shapes), unit)
            }
            (Shape::List(item), Ron::List(items)) => self.items(items.iter().map(|value| (value, &**item)), unit),
            (Shape::Struct(fields), Ron::Struct { name: None, fields: given }) => self.fields(fields, given),
            (Shape::Struct(fields), Ron::Unit) => self.fields(fields, &[]),
            _ => self.mistyped(value, shape, unit),
        }
    }

    fn items<'v>(
        &mut self,
        items: impl Iterator<Item = (&'v Spanned<Ron>, &'v Shape)>,
        unit: Option<&str>,
    ) -> Option<Json> {
        let mut list = Vec::new();
        let mut sound = true;
        for (index, (value, shape)) in items.enumerate() {
            self.path.push(Step::Index(index));
            match self.value(value, shape, unit) {
                Some(json) => list.push(json),
                None => sound = false,
            }
            self.path.pop();
        }
        sound.then_some(Json::Array(list))
    }

    fn fields(&mut self, fields: &[Param], given: &[(Spanned<String>, Spanned<Ron>)]) -> Option<Json> {
        let mut sound = true;
        let mut seen: HashMap<&str, &Spanned<Ron>> = HashMap::new();
        for (name, value) in given {
            let at = At { source: self.source, span: name.span };
            if !fields.iter().any(|field| field.name == name.value) {
                let hint = suggestion(&name.value, fields.iter().map(|field| field.name.as_str()));
                self.fault(at, Code::UnknownParameter, format!("`{}` has no field `{}`", self.param, name.value), hint);
                sound = false;
            } else if seen.insert(&name.value, value).is_some() {
                self.fault(at, Code::DuplicateParameter, format!("`{}` is given twice", name.value), None);
                sound = false;
            }
        }
        let mut object = serde_json::Map::new();
        for field in fields {
            let json = match seen.get(field.name.as_str()) {
                Some(value) => {
                    self.path.push(Step::Field(field.name.clone()));
                    let json = self.value(value, &field.shape, field.unit.as_deref());
                    self.path.pop();
                    json
                }
                None => Some(field.default.clone()),
            };
            sound &= json.is_some();
            object.insert(field.name.clone(), json.unwrap_or_default());
        }
        sound.then_some(Json::Object(object))
    }

    fn choice(&mut self, value: &Spanned<Ron>, shape: &Shape, variants: &[Variant]) -> Option<Json> {
        let (name, at) = match &value.value {
            Ron::Name(name) => (name.as_str(), self.at(value)),
            Ron::Tuple { name: Some(name), .. } | Ron::Struct { name: Some(name), .. } => {
                (name.value.as_str(), At { source: self.source, span: name.span })
            }
            _ => return self.mistyped(value, shape, None),
        };
        let Some(variant) = variants.iter().find(|variant| variant.name == name) else {
            let hint = suggestion(name, variants.iter().map(|variant| variant.name.as_str()));
            self.fault(at, Code::Mistyped, format!("`{}` cannot be `{name}`", self.param), hint);
            return None;
        };
        let content = match (&variant.content, &value.value) {
            (None, Ron::Name(_)) => return Some(name.into()),
            (Some(shape), Ron::Tuple { items, .. }) => {
                self.path.push(Step::Field(name.to_owned()));
                let content = match (&items[..], shape) {
                    (_, Shape::Tuple(shapes)) if items.len() == shapes.len() && shapes.len() > 1 => {
                        self.items(items.iter().zip(shapes), None)
                    }
                    ([item], _) => self.value(item, shape, None),
                    _ => self.mistyped(value, shape, None),
                };
                self.path.pop();
                content?
            }
            (Some(Shape::Struct(fields)), Ron::Struct { fields: given, .. }) => {
                self.path.push(Step::Field(name.to_owned()));
                let content = self.fields(fields, given);
                self.path.pop();
                content?
            }
            _ => return self.mistyped(value, shape, None),
        };
        Some(Json::Object([(name.to_owned(), content)].into_iter().collect()))
    }

    // ---- text and paths ----

    fn text(&mut self, value: &Spanned<Ron>, text: &str, access: Option<Access>) -> Option<Json> {
        let expanded = match expand_variables(text, self.options.variable) {
            Ok(expanded) => expanded,
            Err(name) => {
                let message = format!("the environment variable `{name}` is not set");
                self.fault(self.at(value), Code::MissingVariable, message, Some(format!("set it: {name}=..")));
                return None;
            }
        };
        let Some(access) = access else { return Some(expanded.into()) };
        if expanded.is_empty() {
            self.fault(
                self.at(value),
                Code::OutOfRange,
                format!("`{}` is empty; it must name a file", self.param),
                None,
            );
            return None;
        }
        self.draft.params.paths.push((self.param.to_owned(), access));
        if has_pattern(&expanded) {
            self.draft.animated_at.get_or_insert(At { source: self.source, span: value.span });
        }
        Some(self.folder.join(expanded).to_string_lossy().into_owned().into())
    }

    // ---- ports and links ----

    fn port(&mut self, value: &Spanned<Ron>, port: &PortShape) -> Option<Json> {
        match (&value.value, port.arity) {
            (Ron::Text(text), Arity::One | Arity::Optional) => Some(self.connect(value, text, port)),
            (Ron::Text(text), Arity::List) => Some(Json::Array(vec![self.connect(value, text, port)])),
            (Ron::Name(name), Arity::Optional) if name == "None" => Some(Json::Null),
            (Ron::Tuple { name: Some(name), items }, Arity::Optional) if name.value == "Some" && items.len() == 1 => {
                self.port(&items[0], port)
            }
            (Ron::List(items), Arity::List) if items.is_empty() => {
                let (message, hint) =
                    (format!("`{}` is an empty list", self.param), format!("it takes {}", port.describe()));
                self.fault(self.at(value), Code::MissingInput, message, Some(hint));
                None
            }
            (Ron::List(items), Arity::List) => {
                let mut slots = Vec::new();
                for item in items {
                    match &item.value {
                        Ron::Text(text) => slots.push(self.connect(item, text, port)),
                        _ => return self.mistyped(item, &Shape::Port(port.clone()), None),
                    }
                }
                Some(Json::Array(slots))
            }
            _ => self.mistyped(value, &Shape::Port(port.clone()), None),
        }
    }

    fn connect(&mut self, value: &Spanned<Ron>, text: &str, port: &PortShape) -> Json {
        let reference = Reference {
            param: self.param.to_owned(),
            text: text.to_owned(),
            at: self.at(value),
            port: Some(port.clone()),
        };
        self.draft.ports.push(reference);
        (self.draft.ports.len() as u64 - 1).into()
    }

    // ---- numbers, Keys ----

    fn number(&mut self, value: &Spanned<Ron>, shape: &Shape, unit: Option<&str>) -> Option<Json> {
        let animatable = !matches!(shape, Shape::Integer { animatable: false, .. });
        match &value.value {
            Ron::Text(text) if animatable => {
                let reference =
                    Reference { param: self.param.to_owned(), text: text.clone(), at: self.at(value), port: None };
                self.draft.links.push(reference);
                self.hole(value, shape, Source::Link(self.draft.links.len() - 1))
            }
            Ron::Tuple { name: Some(name), items } if name.value == "Keys" && animatable => {
                let keys = self.keys(value, items, shape, unit)?;
                self.draft.animated_at.get_or_insert(At { source: self.source, span: name.span });
                self.hole(value, shape, Source::Keys(keys))
            }
            Ron::Tuple { name: Some(name), .. } if name.value == "Keys" => {
                let message = format!("`{}` cannot change over frames", self.param);
                self.fault(self.at(value), Code::Mistyped, message, Some("give one whole number".into()));
                None
            }
            _ => self.constant(value, shape, unit),
        }
    }

    /// The number stands in the template as 0 until it is known.
    fn hole(&mut self, value: &Spanned<Ron>, shape: &Shape, source: Source) -> Option<Json> {
        let at = self.at(value);
        self.draft.params.holes.push(Hole { path: self.path.clone(), source, shape: shape.clone(), at });
        Some(match shape {
            Shape::Integer { .. } => json_integer(0),
            _ => json_number(0.0),
        })
    }

    fn constant(&mut self, value: &Spanned<Ron>, shape: &Shape, unit: Option<&str>) -> Option<Json> {
        let unit_text = unit.map(|unit| format!(" {unit}")).unwrap_or_default();
        match (shape, &value.value) {
            (Shape::Number(range), Ron::Int(_) | Ron::Float(_)) => {
                let number = match &value.value {
                    Ron::Int(int) => int.as_f64(),
                    Ron::Float(float) => *float,
                    _ => return None,
                };
                if !number.is_finite() {
                    let message = format!("`{}` is {number}; it must be a finite number", self.param);
                    self.fault(self.at(value), Code::NotFinite, message, None);
                } else if !range.holds(number) {
                    let message = format!("`{}` is {number}{unit_text}; it must be {range}{unit_text}", self.param);
                    self.fault(self.at(value), Code::OutOfRange, message, None);
                } else {
                    return Some(json_number(number));
                }
                None
            }
            (Shape::Integer { range, .. }, Ron::Int(int)) => {
                if (range.min..=range.max).contains(&int.value()) {
                    return Some(json_integer(int.value()));
                }
                let message = format!("`{}` is {int}{unit_text}; it must be {range}{unit_text}", self.param);
                self.fault(self.at(value), Code::OutOfRange, message, None);
                None
            }
            (Shape::Integer { .. }, Ron::Float(float)) if !float.is_finite() => {
                let message = format!("`{}` is {float}; it must be a finite number", self.param);
                self.fault(self.at(value), Code::NotFinite, message, None);
                None
            }
            _ => self.mistyped(value, shape, unit),
        }
    }

    fn keys(
        &mut self,
        whole: &Spanned<Ron>,
        items: &[Spanned<Ron>],
        shape: &Shape,
        unit: Option<&str>,
    ) -> Option<Vec<(i64, f64)>> {
        let malformed = |walk: &mut Self, value: &Spanned<Ron>, message: &str| {
            let hint = "write Keys([(1001, 0.0), (1012, 60.0)])".to_owned();
            walk.fault(walk.at(value), Code::Mistyped, message.to_owned(), Some(hint));
        };
        let [Spanned { value: Ron::List(list), .. }] = items else {
            malformed(self, whole, "Keys takes one list of (frame, value) pairs");
            return None;
        };
        if list.is_empty() {
            malformed(self, whole, "Keys needs at least one (frame, value) pair");
            return None;
        }
        let mut keys: Vec<(i64, f64)> = Vec::with_capacity(list.len());
        let mut sound = true;
        for item in list {
            let pair = match &item.value {
                Ron::Tuple { name: None, items } => match &items[..] {
                    [frame, value] => Some((frame, value)),
                    _ => None,
                },
                _ => None,
            };
            let Some((frame, value)) = pair else {
                malformed(self, item, "a key is a (frame, value) pair");
                sound = false;
                continue;
            };
            let number = self.constant(value, shape, unit).and_then(|json| json.as_f64());
            let frame_number = match &frame.value {
                Ron::Int(int) => i64::try_from(int.value()).ok(),
                _ => None,
            };
            match frame_number {
                None => malformed(self, frame, "a key's frame is a whole number"),
                Some(at) if keys.last().is_some_and(|(before, _)| *before >= at) => {
                    let message = format!("the frames of Keys must rise; {at} does not");
                    self.fault(self.at(frame), Code::OutOfRange, message, None);
                }
                Some(at) => {
                    keys.push((at, number.unwrap_or_default()));
                    sound &= number.is_some();
                    continue;
                }
            }
            sound = false;
        }
        sound.then_some(keys)
    }
}

/// What stands there, in words.
fn found(value: &Ron) -> String {
    match value {
        Ron::Unit => "`()`".into(),
        Ron::Bool(flag) => format!("`{flag}`"),
        Ron::Int(int) => format!("`{int}`"),
        Ron::Float(float) => format!("`{float:?}`"),
        Ron::Char(c) => format!("the character `{c}`"),
        Ron::Text(text) if text.chars().count() <= 40 => format!("the text \"{text}\""),
        Ron::Text(_) => "text".into(),
        Ron::Bytes(_) => "bytes".into(),
        Ron::Range => "a range".into(),
        Ron::Name(name) => format!("`{name}`"),
        Ron::List(items) => format!("a list of {}", items.len()),
        Ron::Map(_) => "a map".into(),
        Ron::Struct { name: Some(name), .. } | Ron::Tuple { name: Some(name), .. } => format!("`{}(..)`", name.value),
        Ron::Struct { .. } => "fields".into(),
        Ron::Tuple { items, .. } => format!("{} values in parentheses", items.len()),
        Ron::Broken => "something unreadable".into(),
    }
}

fn bracket_hint(value: &Ron, shape: &Shape) -> Option<String> {
    Some(match (shape, value) {
        (Shape::Tuple(_), Ron::List(_)) => "use parentheses: (a, b)".into(),
        (Shape::List(_), Ron::Tuple { .. }) => "use brackets: [a, b]".into(),
        (Shape::Text(_), Ron::Name(name)) => format!("put it in double quotes: \"{name}\""),
        (Shape::Choice(_), Ron::Text(text)) => format!("without quotes: {text}"),
        (Shape::Port(_), Ron::Name(name)) => format!("nodes are named in double quotes: \"{name}\""),
        (Shape::Port(port), Ron::List(_)) if port.arity != Arity::List => "connect one node, without brackets".into(),
        (Shape::Integer { .. }, Ron::Float(_)) => "give a whole number, without a point".into(),
        (Shape::Integer { animatable: false, .. }, Ron::Text(_)) => "this number cannot be linked".into(),
        (Shape::Bool, Ron::Int(_)) => "write true or false".into(),
        _ => return None,
    })
}
