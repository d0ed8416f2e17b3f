//! The outer form of a graph file, and what `--set` puts over it.

use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::hints::found;
use super::{At, MAX_NODES, Options, Reporter, VERSION};
use crate::diag::{Code, Fault, closest, suggestion};
use crate::graph::frames::parse_frames;
use crate::graph::read::{self, Ron, Span, Spanned};
use crate::node::{Output, OutputKind};
use crate::registry::{NodeType, Registry};
use crate::schema::PortShape;
use std::sync::Arc;

const NODES_FORM: &str = "write nodes: { \"name\": Type(..), .. }";

/// A graph file taken apart; nothing in it is resolved yet.
pub(super) struct Graph<'a> {
    pub nodes: Vec<Entry<'a>>,
    /// Number of the (first) node of a name.
    pub index: HashMap<&'a str, usize>,
    /// Frames of the run: the flag's, else the file's.
    pub frames: Vec<i64>,
    /// Whether frames are given, if in a form that cannot be read.
    pub frames_given: bool,
    /// The graph file's, absolute: where relative paths begin.
    pub folder: PathBuf,
    /// Where the `nodes` stand, for faults about the whole.
    pub at: At,
}

impl<'a> Graph<'a> {
    /// The nearest name of a node other than number `except`, or all names of a few.
    pub fn suggestion(&self, written: &str, except: usize, report: &Reporter) -> Option<String> {
        let of_type = |index: &usize| {
            *index != except
                && self.nodes[*index].node_type.as_ref().is_some_and(|node_type| &*node_type.name == written)
        };
        if let Some(index) = self.looked_at(except, report).find(of_type) {
            return Some(format!("did you mean `{}`? `{written}` is its type", self.nodes[index].id));
        }
        let looked_at = self.looked_at(except, report);
        let is_all = looked_at.len() == self.nodes.len();
        let names: Vec<&str> = looked_at.filter(|&index| index != except).map(|index| self.nodes[index].id).collect();
        if let Some(name) = closest(written, names.iter().copied()) {
            return Some(format!("did you mean `{name}`?"));
        }
        // A name that is refused is no help.
        let listed = names.into_iter().filter(|name| is_id(name));
        match is_all {
            true => suggestion(written, listed).or_else(|| Some("the graph has no other node".to_owned())),
            false => Some(format!("it is none of the graph's {} nodes", self.nodes.len())),
        }
    }

    /// The node that `at` lies in, not counting its name.
    pub fn node_around(&self, at: u32) -> Option<&'a str> {
        let after = self.nodes.partition_point(|entry| entry.span.start <= at);
        let entry = &self.nodes[after.checked_sub(1)?];
        (at < entry.span.end).then_some(entry.id)
    }

    /// "`bend` or `keep` would fit", of a few nodes with an output for such a port.
    pub fn givers(&self, port: &PortShape, except: usize, report: &Reporter) -> Option<String> {
        let giver = |entry: &Entry| {
            let outputs = entry.node_type.as_ref()?.outputs;
            Some(match outputs.iter().position(|output| entry.gives(output, port))? {
                0 => format!("`{}`", entry.id),
                number => format!("`{}.{}`", entry.id, outputs[number].name),
            })
        };
        let others = self.looked_at(except, report).filter(|&index| index != except);
        let named = others.map(|index| (index, &self.nodes[index])).filter(|(i, entry)| self.index[entry.id] == *i);
        let names: Vec<String> = named.filter_map(|(_, entry)| giver(entry)).take(3).collect();
        match &names[..] {
            [] => None,
            [name] => Some(format!("{name} would fit")),
            [first @ .., last] => Some(format!("{} or {last} would fit", first.join(", "))),
        }
    }

    /// The nodes that a hint for number `near` looks at: all, but a few where searching all for very many faults
    /// would not end.
    fn looked_at(&self, near: usize, report: &Reporter) -> Range<usize> {
        let count = self.nodes.len();
        if count <= 1000 || report.count() < 20 {
            return 0..count;
        }
        let start = near.min(count).saturating_sub(10);
        start..(start + 20).min(count)
    }
}

/// One node of the file.
pub(super) struct Entry<'a> {
    pub id: &'a str,
    /// Where its type's name stands, or its value if it has none.
    pub at: At,
    /// What stands behind its name.
    pub span: Span,
    /// Its type, if it has one that is known.
    pub node_type: Option<Arc<NodeType>>,
    /// Given parameters; nothing of a node that is not read whole.
    pub fields: Vec<Field<'a>>,
    /// Whether it can be checked.
    pub sound: bool,
}

impl Entry<'_> {
    /// Whether one of its outputs always gives what a port takes.
    pub fn gives(&self, output: &Output, port: &PortShape) -> bool {
        let maker = self.node_type.as_ref().map(|node_type| &*node_type.name);
        matches!(output.kind, OutputKind::Is(kind) if port.takes(kind, maker))
    }
}

/// A parameter as given.
pub(super) struct Field<'a> {
    pub name: &'a str,
    pub name_at: At,
    pub value: &'a Spanned<Ron>,
    pub source: u32,
}

/// A `--set NODE.PARAM=RON`.
pub(super) struct Set {
    node: (String, Span),
    param: (String, Span),
    value: Spanned<Ron>,
    source: u32,
}

/// Reads a `--set` flag; its text becomes a source of its own.
pub(super) fn read_set(text: &str, report: &mut Reporter) -> Option<Set> {
    let source = report.sources.add(Path::new("--set"), text);
    let whole = At { source, span: Span { start: 0, end: text.len() as u32 } };
    let split = text.split_once('=').and_then(|(name, value)| {
        let (node, param) = name.split_once('.')?;
        Some((node.trim(), param.trim(), value)).filter(|(node, param, _)| !node.is_empty() && !param.is_empty())
    });
    let Some((node, param, value)) = split else {
        let hint = "for example --set bend.angle=75.0".to_owned();
        let message = format!("`--set {text}` has not the form NODE.PARAM=VALUE");
        report.add(whole, Fault::new(Code::Usage, message).hint(hint));
        return None;
    };
    // Read with the name blanked out, so that offsets are those of the flag's text.
    let offset = text.len() - value.len();
    let reading = read::read(&format!("{}{value}", " ".repeat(offset)));
    for fault in &reading.faults {
        let message = fault.message.replace("the end of the file", "its end");
        let found = Fault::new(Code::Syntax, message).hint(fault.hint.clone()).node(node).parameter(param);
        report.add(At { source, span: fault.span }, found);
    }
    let value = reading.tree.filter(|_| reading.faults.is_empty())?;
    let start = |name: &str| (name.as_ptr() as usize - text.as_ptr() as usize) as u32;
    let named = |name: &str| (name.to_owned(), Span { start: start(name), end: start(name) + name.len() as u32 });
    Some(Set { node: named(node), param: named(param), value, source })
}

fn here(span: Span) -> At {
    At { source: 0, span }
}

/// Takes the document apart.
pub(super) fn read_graph<'a>(
    tree: &'a Spanned<Ron>,
    registry: &Registry,
    sets: &'a [Set],
    options: &Options,
    report: &mut Reporter,
) -> Option<Graph<'a>> {
    let (graph_at, fields) = outer_fields(tree, report)?;
    let field = |name: &str| fields.get(name).copied();
    read_version(field("version"), graph_at, report);
    read_plugins(field("plugins"), options, report);
    let frames = read_frames(field("frames"), options, report);
    let (at, entries) = node_entries(field("nodes"), graph_at, report)?;
    let file = std::path::absolute(options.file).unwrap_or_else(|_| options.file.to_owned());
    let mut graph = Graph {
        nodes: Vec::with_capacity(entries.len()),
        index: HashMap::new(),
        frames,
        frames_given: options.frames.is_some() || field("frames").is_some(),
        folder: file.parent().unwrap_or(Path::new("")).to_owned(),
        at,
    };
    for (key, value) in entries {
        let Some(id) = read_id(key, report) else { continue };
        let entry = read_entry(id, value, registry, report);
        if graph.index.contains_key(id) {
            let fault = Fault::new(Code::DuplicateNode, format!("there is another node `{id}` above")).node(id);
            report.add(here(key.span), fault.hint("give one of them another name".to_owned()));
        } else {
            graph.index.insert(id, graph.nodes.len());
        }
        graph.nodes.push(entry);
    }
    apply_sets(sets, &mut graph, report);
    Some(graph)
}

/// Fields by name, each as it is first given.
type Fields<'a> = HashMap<&'a str, &'a Spanned<Ron>>;

/// Where the graph's name stands, and its fields.
fn outer_fields<'a>(tree: &'a Spanned<Ron>, report: &mut Reporter) -> Option<(Span, Fields<'a>)> {
    let not_a_graph = |span, report: &mut Reporter| {
        let hint = "begin with Graph(version: 1, nodes: { .. })".to_owned();
        report.add(here(span), Fault::new(Code::Malformed, "this is not a graph").hint(hint));
    };
    let (name, fields) = match &tree.value {
        Ron::Struct { name, fields } => (name, fields),
        Ron::Broken => return None,
        _ => {
            not_a_graph(first_line(tree.span), report);
            return None;
        }
    };
    if let Some(name) = name.as_ref().filter(|name| name.value != "Graph") {
        not_a_graph(name.span, report);
        if !fields.iter().any(|(field, _)| field.value == "nodes") {
            return None;
        }
    }
    let mut seen: Fields = HashMap::new();
    for (name, value) in fields {
        const KNOWN: [&str; 4] = ["version", "frames", "plugins", "nodes"];
        if !KNOWN.contains(&name.value.as_str()) && !matches!(value.value, Ron::Broken) {
            let fault = Fault::new(Code::Malformed, format!("a graph has no field `{}`", name.value));
            report.add(here(name.span), fault.hint(suggestion(&name.value, KNOWN)));
        } else if seen.contains_key(name.value.as_str()) && !matches!(value.value, Ron::Broken) {
            let fault = Fault::new(Code::Malformed, format!("`{}` is given twice", name.value));
            report.add(here(name.span), fault.hint("keep one of them".to_owned()));
        } else {
            seen.entry(&name.value).or_insert(value);
        }
    }
    Some((name.as_ref().map_or(first_line(tree.span), |name| name.span), seen))
}

/// An entry of a map.
type Pair = (Spanned<Ron>, Spanned<Ron>);

/// Where the nodes begin, and their entries.
fn node_entries<'a>(nodes: Option<&'a Spanned<Ron>>, graph: Span, report: &mut Reporter) -> Option<(At, &'a [Pair])> {
    let Some(nodes) = nodes else {
        let fault = Fault::new(Code::Malformed, "the graph has no `nodes`");
        report.add(here(graph), fault.hint(NODES_FORM.to_owned()));
        return None;
    };
    let at = here(first_line(nodes.span));
    let fault = match &nodes.value {
        Ron::Map(entries) if entries.len() <= MAX_NODES => return Some((at, entries)),
        Ron::Map(entries) => {
            let message = format!("the graph has {} nodes; it may have at most {MAX_NODES}", entries.len());
            Fault::new(Code::TooLarge, message).hint("split it into several graphs".to_owned())
        }
        Ron::Broken => return None,
        other => {
            let message = format!("`nodes` must be a map in braces, found {}", found(other));
            Fault::new(Code::Malformed, message).hint(NODES_FORM.to_owned())
        }
    };
    report.add(at, fault);
    None
}

/// The place for a fault about something long: its first byte.
fn first_line(span: Span) -> Span {
    Span { start: span.start, end: (span.start + 1).min(span.end) }
}

fn read_version(version: Option<&Spanned<Ron>>, graph: Span, report: &mut Reporter) {
    let Some(version) = version else {
        let fault = Fault::new(Code::Malformed, "the graph does not say its `version`");
        report.add(At { source: 0, span: graph }, fault.hint(format!("write version: {VERSION}")));
        return;
    };
    let at = At { source: 0, span: version.span };
    match &version.value {
        Ron::Int(number) if number.value() == i128::from(VERSION) => {}
        Ron::Int(number) if number.value() > i128::from(VERSION) => {
            let message = format!("the graph is of version {number}; this program reads up to version {VERSION}");
            report.add(at, Fault::new(Code::NewerVersion, message).hint("use a newer warploom".to_owned()));
        }
        Ron::Broken => {}
        other => {
            let message = format!("`version` must be {VERSION}, found {}", found(other));
            report.add(at, Fault::new(Code::Malformed, message).hint(format!("write version: {VERSION}")));
        }
    }
}

fn read_frames(frames: Option<&Spanned<Ron>>, options: &Options, report: &mut Reporter) -> Vec<i64> {
    let of_file = match frames.map(|frames| (&frames.value, frames.span)) {
        Some((Ron::Text(text), span)) => {
            let parsed = parse_frames(text);
            let hint = "for example frames: \"1001-1100\"".to_owned();
            parsed.map_err(|m| report.add(At { source: 0, span }, Fault::new(Code::Malformed, m).hint(hint))).ok()
        }
        Some((Ron::Broken, _)) | None => None,
        Some((other, span)) => {
            let fault = Fault::new(Code::Malformed, format!("`frames` must be text, found {}", found(other)));
            report.add(At { source: 0, span }, fault.hint("for example frames: \"1001-1100\"".to_owned()));
            None
        }
    };
    options.frames.clone().or(of_file).unwrap_or_default()
}

/// Plugins the graph asks for by identifier. None can be loaded yet, so each is missing.
fn read_plugins(plugins: Option<&Spanned<Ron>>, options: &Options, report: &mut Reporter) {
    let Some(plugins) = plugins else { return };
    let malformed = |value: &Spanned<Ron>, report: &mut Reporter| {
        let message = format!("`plugins` must be a list of identifiers, found {}", found(&value.value));
        let fault = Fault::new(Code::Malformed, message).hint("for example plugins: [\"com.acme.glow\"]".to_owned());
        report.add(At { source: 0, span: value.span }, fault);
    };
    let items = match &plugins.value {
        Ron::List(items) => items,
        Ron::Broken => return,
        _ => return malformed(plugins, report),
    };
    for item in items.iter().filter(|item| !matches!(item.value, Ron::Broken)) {
        let Ron::Text(id) = &item.value else {
            malformed(item, report);
            continue;
        };
        let folders: Vec<String> = options.plugins.iter().map(|folder| folder.display().to_string()).collect();
        let looked = if folders.is_empty() { "in no folder".into() } else { format!("in {}", folders.join(", ")) };
        let fault =
            Fault::new(Code::MissingPlugin, format!("the plugin `{id}` is missing; it was looked for {looked}"));
        report.add(At { source: 0, span: item.span }, fault.hint("name its folder with --plugins".to_owned()));
    }
}

/// The nearest text that may name a node.
fn as_id(text: &str) -> String {
    let kept = text.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' });
    let id: String = kept.collect();
    match id.is_empty() {
        true => "node".to_owned(),
        false if is_id(&id) => id,
        false => format!("_{id}"),
    }
}

pub(super) fn is_id(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
}

/// The name of a node. One that is not as it must be still names it, so that those who use it are not blamed.
fn read_id<'a>(key: &'a Spanned<Ron>, report: &mut Reporter) -> Option<&'a str> {
    let (id, message, hint) = match &key.value {
        Ron::Text(id) if is_id(id) => return Some(id),
        Ron::Text(id) => (
            Some(id.as_str()),
            format!(
                "{} cannot name a node: a name has letters a to z, digits, `_` and `-`, no digit or `-` first",
                if id.is_empty() { "an empty text".to_owned() } else { format!("`{id}`") }
            ),
            format!("for example \"{}\"", as_id(id)),
        ),
        Ron::Name(id) => {
            (Some(id.as_str()), "a node's name is text in double quotes".to_owned(), format!("write \"{id}\""))
        }
        Ron::Broken => return None,
        other => (
            None,
            format!("a node's name is text in double quotes, found {}", found(other)),
            "for example \"plate\": Load(..)".to_owned(),
        ),
    };
    let node = id.map(str::to_owned);
    report.add(here(key.span), Fault { node, ..Fault::new(Code::Malformed, message) }.hint(hint));
    id
}

fn read_entry<'a>(id: &'a str, value: &'a Spanned<Ron>, registry: &Registry, report: &mut Reporter) -> Entry<'a> {
    let at = here(first_line(value.span));
    let mut entry = Entry { id, at, span: value.span, node_type: None, fields: Vec::new(), sound: false };
    match &value.value {
        _ if read::has_broken(value) => {
            if let Ron::Struct { name: Some(name), .. } | Ron::Tuple { name: Some(name), .. } = &value.value {
                entry.at = here(name.span);
                entry.node_type = registry.get(&name.value).cloned();
            }
        }
        Ron::Struct { name: Some(name), fields } => {
            entry.at = here(name.span);
            entry.node_type = registry.get(&name.value).cloned();
            entry.sound = entry.node_type.is_some();
            if !entry.sound {
                let names: Vec<&str> = registry.iter().map(|t| &*t.name).collect();
                let hint = closest(&name.value, names).map(|name| format!("did you mean `{name}`?"));
                let hint = hint.unwrap_or_else(|| "`warploom nodes` lists them; plugins come with --plugins".into());
                let fault = Fault::new(Code::UnknownType, format!("there is no node type `{}`", name.value));
                report.add(entry.at, fault.node(id).hint(hint));
            }
            entry.fields = (fields.iter())
                .map(|(name, value)| Field { name: &name.value, name_at: here(name.span), value, source: 0 })
                .collect();
        }
        Ron::Name(name) => {
            entry.at = here(value.span);
            let fault = Fault::new(Code::Malformed, format!("`{name}` has no parentheses")).node(id);
            report.add(entry.at, fault.hint(format!("write {name}()")));
        }
        Ron::Tuple { name: Some(name), .. } => {
            entry.at = here(name.span);
            let fault = Fault::new(Code::Malformed, format!("parameters of `{}` have names", name.value)).node(id);
            let first = registry.get(&name.value).and_then(|node_type| node_type.params.first());
            let hint = first.map_or_else(
                || format!("write {}(name: value)", name.value),
                |param| format!("write {}({}: .., ..)", name.value, param.name),
            );
            report.add(entry.at, fault.hint(hint));
        }
        _ => {
            let message = format!("`{id}` must be a node, found {}", found(&value.value));
            let hint = "write Type(parameter: value, ..)".to_owned();
            report.add(entry.at, Fault::new(Code::Malformed, message).node(id).hint(hint));
        }
    }
    entry
}

fn apply_sets<'a>(sets: &'a [Set], graph: &mut Graph<'a>, report: &mut Reporter) {
    for set in sets {
        let ((node, node_span), (param, param_span)) = (&set.node, &set.param);
        let Some(&index) = graph.index.get(node.as_str()) else {
            let fault = Fault::new(Code::UnknownNode, format!("there is no node `{node}`"));
            let hint = graph.suggestion(node, usize::MAX, report);
            report.add(At { source: set.source, span: *node_span }, fault.hint(hint));
            continue;
        };
        let name_at = At { source: set.source, span: *param_span };
        let field = Field { name: param, name_at, value: &set.value, source: set.source };
        let fields = &mut graph.nodes[index].fields;
        fields.retain(|old| old.name != *param);
        fields.push(field);
    }
}
