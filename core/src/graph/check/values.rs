//! Parameters along their shapes: types, ranges, names; Keys, links and paths lifted out.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use serde_json::Value as Json;

use super::document::{Entry, Field, Graph};
use super::hints::{found, instead, is_whole_in, mend, of_variants};
use super::{At, Options, Reporter};
use crate::diag::{Code, Fault, suggestion};
use crate::graph::frames::{expand_variables, foreign_pattern, has_pattern};
use crate::graph::plan::{Hole, Source, Step, Template, json_integer, json_number};
use crate::graph::read::{Ron, Spanned};
use crate::registry::NodeType;
use crate::schema::{Access, Arity, Param, PortShape, Shape, Variant, shown};

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
    /// Where it first says something that changes over frames, and the parameter if it is one that does.
    pub animated_at: Option<(At, Option<String>)>,
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
    let read = |entry: &Entry, report: &mut Reporter| {
        let node_type = entry.node_type.clone().filter(|_| entry.sound)?;
        Some(read_node(entry, node_type, &graph.folder, options, report))
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
    let mut given: HashMap<&str, Vec<&Field>> = HashMap::new();
    for field in &entry.fields {
        let values = given.entry(field.name).or_default();
        values.push(field);
        let fault = if node_type.param(field.name).is_none() {
            let names = node_type.params.iter().map(|param| param.name.as_str());
            let message = format!("`{}` has no parameter `{}`", node_type.name, field.name);
            Fault::new(Code::UnknownParameter, message).hint(suggestion(field.name, names))
        } else if values.len() > 1 {
            let hint = "keep one of them".to_owned();
            Fault::new(Code::DuplicateParameter, format!("`{}` is given twice", field.name)).hint(hint)
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
    let (path, found) = (Vec::new(), report.count());
    let mut walk = Walk { node: entry.id, param: "", declared: None, source: 0, path, folder, options, report, draft };
    for param in &node_type.params {
        walk.param = &param.name;
        walk.declared = Some(param);
        walk.path = vec![Step::Field(param.name.clone())];
        let values = given.get(param.name.as_str()).map_or(&[][..], Vec::as_slice);
        if values.is_empty() {
            walk.absent(param, entry.at);
        }
        // Of one that is given twice, each value is checked.
        let mut json = None;
        for field in values {
            walk.source = field.source;
            walk.draft.param_at.push((param.name.clone(), At { source: field.source, span: field.value.span }));
            json = walk.value(field.value, &param.shape, param.unit.as_deref());
        }
        walk.draft.params.json.insert(param.name.clone(), json.unwrap_or_else(|| stand_in(param)));
    }
    if node_type.reads_frame {
        walk.draft.animated_at.get_or_insert((entry.at, None));
    }
    let draft = walk.draft;
    if report.count() == found {
        check_together(entry, &draft, report);
    }
    draft
}

/// Lets the node refuse parameters that are right one by one.
fn check_together(entry: &Entry, draft: &Draft, report: &mut Reporter) {
    // Of numbers that are not known yet 0 stands for, which the node is not to judge.
    if !draft.params.holes.is_empty() {
        return;
    }
    let Err(error) = draft.node_type.make(&Json::Object(draft.params.json.clone())).check() else { return };
    for error in error.each() {
        let place = draft.param_at.iter().find(|(name, _)| Some(name.as_str()) == error.parameter);
        let fault = Fault::new(Code::Conflict, error.message).hint(error.hint).node(entry.id);
        let fault = Fault { parameter: error.parameter.map(str::to_owned), ..fault };
        report.add(place.map_or(entry.at, |(_, at)| *at), fault);
    }
}

/// What stands in the template for a parameter that is not given, or not rightly: a node can be made of it.
fn stand_in(param: &Param) -> Json {
    match &param.shape {
        Shape::Port(port) => match port.arity {
            Arity::One => 0.into(),
            Arity::Optional => Json::Null,
            Arity::List => Json::Array(Vec::new()),
        },
        _ => param.default.clone(),
    }
}

/// One node's values on the way.
struct Walk<'a> {
    node: &'a str,
    param: &'a str,
    declared: Option<&'a Param>,
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

    /// What to write in place of the whole parameter.
    fn mend(&self) -> Option<String> {
        self.declared.map(mend)
    }

    /// The parameter, and within it the item and the field, as messages name it; the last number of a row is not told.
    fn name(&self) -> String {
        let path = if let [path @ .., Step::Index(_)] = &self.path[..] { path } else { &self.path };
        let parts = path.iter().enumerate().map(|(at, step)| match step {
            Step::Field(name) if at == 0 => name.clone(),
            Step::Field(name) => format!(".{name}"),
            Step::Index(index) => format!("[{index}]"),
        });
        parts.collect()
    }

    fn animated(&mut self, at: At) {
        self.draft.animated_at.get_or_insert_with(|| (at, Some(self.param.to_owned())));
    }

    fn absent(&mut self, param: &Param, at: At) {
        if !param.required {
            return;
        }
        let what = param.shape.describe(param.unit.as_deref());
        let (code, message) = match param.shape {
            Shape::Port(_) => (Code::MissingInput, format!("`{}` is not connected; it takes {what}", param.name)),
            _ => (Code::MissingParameter, format!("`{}` is not given; it takes {what}", param.name)),
        };
        self.fault(at, code, message, Some(mend(param)));
    }

    fn mistyped<T>(&mut self, value: &Spanned<Ron>, shape: &Shape, unit: Option<&str>) -> Option<T> {
        let what = found(&value.value);
        let hint = instead(&value.value, shape).or_else(|| self.mend());
        let message = format!("`{}` takes {}, found {what}", self.name(), shape.describe(unit));
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
            (Shape::Struct(fields), Ron::Struct { name: None, fields: given }) => {
                self.fields(self.at(value), fields, given)
            }
            (Shape::Struct(fields), Ron::Unit) => self.fields(self.at(value), fields, &[]),
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

    fn fields(&mut self, whole: At, fields: &[Param], given: &[(Spanned<String>, Spanned<Ron>)]) -> Option<Json> {
        let mut sound = true;
        let mut seen: HashMap<&str, &Spanned<Ron>> = HashMap::new();
        for (name, value) in given {
            let at = At { source: self.source, span: name.span };
            if !fields.iter().any(|field| field.name == name.value) {
                let hint = suggestion(&name.value, fields.iter().map(|field| field.name.as_str()));
                self.fault(
                    at,
                    Code::UnknownParameter,
                    format!("`{}` has no field `{}`", self.name(), name.value),
                    hint,
                );
                sound = false;
            } else if seen.insert(&name.value, value).is_some() {
                let hint = Some("keep one of them".to_owned());
                self.fault(at, Code::DuplicateParameter, format!("`{}` is given twice", name.value), hint);
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
                None if field.required => {
                    let message = format!("`{}` needs a field `{}`", self.name(), field.name);
                    self.fault(whole, Code::MissingParameter, message, Some(mend(field)));
                    None
                }
                None => Some(field.default.clone()),
            };
            sound &= json.is_some();
            object.insert(field.name.clone(), json.unwrap_or_default());
        }
        sound.then_some(Json::Object(object))
    }

    fn choice(&mut self, value: &Spanned<Ron>, choice: &Shape, variants: &[Variant]) -> Option<Json> {
        let (name, at) = match &value.value {
            Ron::Name(name) => (name.as_str(), self.at(value)),
            Ron::Tuple { name: Some(name), .. } | Ron::Struct { name: Some(name), .. } if name.value != "Some" => {
                (name.value.as_str(), At { source: self.source, span: name.span })
            }
            _ => return self.mistyped(value, choice, None),
        };
        let Some(variant) = variants.iter().find(|variant| variant.name == name) else {
            let message = format!("`{}` takes {}, found `{name}`", self.name(), choice.describe(None));
            self.fault(at, Code::Mistyped, message, of_variants(name, variants));
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
                    _ => {
                        self.path.pop();
                        return self.mistyped(value, choice, None);
                    }
                };
                self.path.pop();
                content?
            }
            (Some(Shape::Struct(fields)), Ron::Struct { fields: given, .. }) => {
                self.path.push(Step::Field(name.to_owned()));
                let content = self.fields(at, fields, given);
                self.path.pop();
                content?
            }
            _ => return self.mistyped(value, choice, None),
        };
        Some(Json::Object([(name.to_owned(), content)].into_iter().collect()))
    }

    // ---- text and paths ----

    fn text(&mut self, value: &Spanned<Ron>, text: &str, access: Option<Access>) -> Option<Json> {
        let expanded = match expand_variables(text, self.options.variable) {
            Ok(expanded) => expanded,
            Err(names) => {
                for name in names {
                    let message = format!("the environment variable `{name}` is not set");
                    let hint = format!("set it before the run: export {name}=..");
                    self.fault(self.at(value), Code::MissingVariable, message, Some(hint));
                }
                return None;
            }
        };
        let Some(access) = access else { return Some(expanded.into()) };
        if expanded.is_empty() {
            let message = format!("`{}` is empty; it must name a file", self.param);
            self.fault(self.at(value), Code::OutOfRange, message, self.mend());
            return None;
        }
        if expanded.contains(char::is_control) {
            let message = format!("`{}` is {expanded:?}, which holds a control character", self.param);
            let hint = "a backslash itself is written `\\\\`; a path can use `/`".to_owned();
            self.fault(self.at(value), Code::OutOfRange, message, Some(hint));
            return None;
        }
        // The text as it is written: what a variable holds is not the author's.
        if let Some((part, instead)) = foreign_pattern(text) {
            let message = format!("`{}` is \"{text}\", in which `{part}` stands for itself", self.param);
            let warning = Fault::new(Code::Doubtful, message).node(self.node).parameter(self.param);
            self.report.warn(self.at(value), warning.hint(format!("for a frame or variable write {instead}")));
        }
        let extension = Path::new(&expanded).extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let allowed = self.draft.node_type.param(self.param).map_or(&[][..], |param| &param.extensions);
        if !allowed.is_empty() && !allowed.contains(&extension) {
            let allowed: Vec<String> = allowed.iter().map(|extension| format!(".{extension}")).collect();
            let message = format!("`{}` is \"{expanded}\"; it must end in {}", self.param, allowed.join(", "));
            let is_bare = allowed.iter().any(|extension| expanded.ends_with(&format!("/{extension}")));
            let hint = match is_bare {
                true => Some("a name stands before the point".to_owned()),
                false => suggestion(&format!(".{extension}"), allowed.iter().map(String::as_str)),
            };
            self.fault(self.at(value), Code::OutOfRange, message, hint);
            return None;
        }
        self.draft.params.paths.push((self.param.to_owned(), access));
        if has_pattern(&expanded) {
            self.animated(self.at(value));
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
                let message = format!("`{}` is an empty list; it takes {}", self.param, port.describe());
                self.fault(self.at(value), Code::MissingInput, message, self.mend());
                None
            }
            (Ron::List(items), Arity::List) => {
                let one = PortShape { arity: Arity::One, ..port.clone() };
                let slots: Vec<Option<Json>> = items.iter().map(|item| self.port(item, &one)).collect();
                slots.into_iter().collect::<Option<Vec<Json>>>().map(Json::Array)
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
                self.animated(At { source: self.source, span: name.span });
                self.hole(value, shape, Source::Keys(keys))
            }
            Ron::Tuple { name: Some(name), .. } if name.value == "Keys" => {
                let message = format!("`{}` cannot change over frames; it takes {}", self.name(), shape.describe(unit));
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
        match (shape, &value.value) {
            (Shape::Number(_), Ron::Int(int)) => self.float(value, int.as_f64(), shape, unit),
            (Shape::Number(_), Ron::Float(float)) => self.float(value, *float, shape, unit),
            (Shape::Integer { range, .. }, Ron::Int(int)) if (range.min..=range.max).contains(&int.value()) => {
                Some(json_integer(int.value()))
            }
            (Shape::Integer { range, .. }, Ron::Int(int)) => {
                let nearest = int.value().clamp(range.min, range.max);
                self.out_of_range(value, &int.to_string(), shape, unit, Some(nearest.to_string()))
            }
            (Shape::Integer { .. }, Ron::Float(float)) if !float.is_finite() => self.float(value, *float, shape, unit),
            // Digits too many for 64 bits are read as a float.
            (Shape::Integer { range, .. }, Ron::Float(float))
                if float.fract() == 0.0 && !is_whole_in(*float, range) =>
            {
                let nearest = if *float > 0.0 { range.max } else { range.min };
                let nearest = (nearest.abs() < 1 << 53).then(|| nearest.to_string());
                self.out_of_range(value, &shown(*float), shape, unit, nearest)
            }
            _ => self.mistyped(value, shape, unit),
        }
    }

    fn float(&mut self, value: &Spanned<Ron>, number: f64, shape: &Shape, unit: Option<&str>) -> Option<Json> {
        match shape {
            _ if !number.is_finite() => {
                let message = format!("`{}` is {number}; it must be finite: {}", self.name(), shape.describe(unit));
                let hint = self.mend();
                self.fault(self.at(value), Code::NotFinite, message, hint);
                None
            }
            Shape::Number(range) if !range.holds(number) => {
                let over = range.max.filter(|&max| number > max);
                let nearest = over.or(range.min.filter(|_| !range.above_min)).map(shown);
                self.out_of_range(value, &shown(number), shape, unit, nearest)
            }
            _ => Some(json_number(number)),
        }
    }

    fn out_of_range(
        &mut self,
        value: &Spanned<Ron>,
        number: &str,
        shape: &Shape,
        unit: Option<&str>,
        nearest: Option<String>,
    ) -> Option<Json> {
        let behind = unit.map(|unit| format!(" {unit}")).unwrap_or_default();
        let message = format!("`{}` is {number}{behind}; it must be {}", self.name(), shape.describe(unit));
        let hint = nearest.map(|nearest| format!("the nearest allowed is {nearest}")).or_else(|| self.mend());
        self.fault(self.at(value), Code::OutOfRange, message, hint);
        None
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
                    let before = keys.last().map_or(at, |(before, _)| *before);
                    let message = format!("the frames of Keys must rise; {at} stands behind {before}");
                    let hint = "sort the keys by frame, each frame once".to_owned();
                    self.fault(self.at(frame), Code::OutOfRange, message, Some(hint));
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
