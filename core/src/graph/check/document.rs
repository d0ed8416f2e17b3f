//! The outer form of a graph file, and what `--set` puts over it.

use std::collections::HashMap;
use std::path::Path;

use super::{At, MAX_NODES, Options, Reporter, VERSION};
use crate::diag::{Code, Fault, closest, suggestion};
use crate::graph::frames::parse_frames;
use crate::graph::read::{self, Ron, Span, Spanned};
use crate::registry::{NodeType, Registry};
use std::sync::Arc;

/// A graph file taken apart; nothing in it is resolved yet.
pub(super) struct Graph<'a> {
    pub nodes: Vec<Entry<'a>>,
    /// Number of the (first) node of a name.
    pub index: HashMap<&'a str, usize>,
    /// Frames of the run: the flag's, else the file's.
    pub frames: Vec<i64>,
    /// Where the `nodes` stand, for faults about the whole.
    pub at: At,
}

/// One node of the file.
pub(super) struct Entry<'a> {
    pub id: &'a str,
    /// Where its type's name stands, or its value if it has none.
    pub at: At,
    /// Its type, if it has one that is known.
    pub node_type: Option<Arc<NodeType>>,
    /// Given parameters; nothing of a node that is not read whole.
    pub fields: Vec<Field<'a>>,
    /// Whether it can be checked.
    pub sound: bool,
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
    node: String,
    param: String,
    value: Spanned<Ron>,
    source: u32,
}

/// Reads a `--set` flag; its text becomes a source of its own.
pub(super) fn read_set(text: &str, report: &mut Reporter) -> Option<Set> {
    let source = report.sources.add(Path::new("--set"), text);
    let whole = At { source, span: Span { start: 0, end: text.len() as u32 } };
    let split = text.split_once('=').and_then(|(name, value)| {
        let (node, param) = name.split_once('.')?;
        Some((node.trim(), param.trim(), value))
    });
    let Some((node, param, value)) = split else {
        let hint = "for example --set bend.angle=75.0".to_owned();
        report.add(whole, Fault::new(Code::Usage, "a set has the form NODE.PARAM=VALUE").hint(hint));
        return None;
    };
    // Read with the name blanked out, so that offsets are those of the flag's text.
    let offset = text.len() - value.len();
    let reading = read::read(&format!("{}{value}", " ".repeat(offset)));
    for fault in &reading.faults {
        let found = Fault::new(Code::Syntax, fault.message.clone()).hint(fault.hint.clone());
        report.add(At { source, span: fault.span }, found);
    }
    let value = reading.tree.filter(|_| reading.faults.is_empty())?;
    Some(Set { node: node.to_owned(), param: param.to_owned(), value, source })
}

/// Takes the document apart.
pub(super) fn read_graph<'a>(
    tree: &'a Spanned<Ron>,
    registry: &Registry,
    sets: &'a [Set],
    options: &Options,
    report: &mut Reporter,
) -> Option<Graph<'a>> {
    let here = |span| At { source: 0, span };
    let fields = match &tree.value {
        Ron::Struct { name, fields } if name.as_ref().is_none_or(|name| name.value == "Graph") => fields,
        Ron::Broken => return None,
        _ => {
            let hint = "begin with Graph(version: 1, nodes: { .. })".to_owned();
            report.add(here(first_line(tree.span)), Fault::new(Code::Malformed, "this is not a graph").hint(hint));
            return None;
        }
    };
    let mut seen: HashMap<&str, &'a Spanned<Ron>> = HashMap::new();
    for (name, value) in fields {
        const KNOWN: [&str; 4] = ["version", "frames", "plugins", "nodes"];
        if matches!(value.value, Ron::Broken) {
            seen.entry(&name.value).or_insert(value);
        } else if !KNOWN.contains(&name.value.as_str()) {
            let fault = Fault::new(Code::Malformed, format!("a graph has no field `{}`", name.value));
            report.add(here(name.span), fault.hint(suggestion(&name.value, KNOWN)));
        } else if seen.insert(&name.value, value).is_some() {
            report.add(here(name.span), Fault::new(Code::Malformed, format!("`{}` is given twice", name.value)));
        }
    }
    read_version(seen.get("version").copied(), tree.span, report);
    read_plugins(seen.get("plugins").copied(), options, report);
    let frames = read_frames(seen.get("frames").copied(), options, report);
    let Some(nodes) = seen.get("nodes") else {
        report.add(here(first_line(tree.span)), Fault::new(Code::Malformed, "the graph has no `nodes`"));
        return None;
    };
    let at = here(first_line(nodes.span));
    let entries = match &nodes.value {
        Ron::Map(entries) => entries.as_slice(),
        Ron::Broken => return None,
        _ => {
            let fault = Fault::new(Code::Malformed, "`nodes` must be a map, { \"name\": Type(..), .. }");
            report.add(at, fault);
            return None;
        }
    };
    if entries.len() > MAX_NODES {
        let message = format!("{} nodes; a graph has at most {MAX_NODES}", entries.len());
        report.add(at, Fault::new(Code::TooLarge, message));
        return None;
    }
    let mut graph = Graph { nodes: Vec::with_capacity(entries.len()), index: HashMap::new(), frames, at };
    for (key, value) in entries {
        read_entry(key, value, registry, &mut graph, report);
    }
    apply_sets(sets, &mut graph, report);
    Some(graph)
}

/// The place for a fault about something long: its first byte.
fn first_line(span: Span) -> Span {
    Span { start: span.start, end: (span.start + 1).min(span.end) }
}

fn read_version(version: Option<&Spanned<Ron>>, whole: Span, report: &mut Reporter) {
    let Some(version) = version else {
        let fault = Fault::new(Code::Malformed, "the graph does not say its `version`");
        report.add(At { source: 0, span: first_line(whole) }, fault.hint("write version: 1".to_owned()));
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
        _ => report.add(at, Fault::new(Code::Malformed, format!("`version` must be {VERSION}"))),
    }
}

fn read_frames(frames: Option<&Spanned<Ron>>, options: &Options, report: &mut Reporter) -> Vec<i64> {
    let of_file = match frames.map(|frames| (&frames.value, frames.span)) {
        Some((Ron::Text(text), span)) => {
            let parsed = parse_frames(text);
            parsed.map_err(|m| report.add(At { source: 0, span }, Fault::new(Code::Malformed, m))).ok()
        }
        Some((Ron::Broken, _)) | None => None,
        Some((_, span)) => {
            let fault = Fault::new(Code::Malformed, "`frames` must be text, such as \"1001-1100\"");
            report.add(At { source: 0, span }, fault);
            None
        }
    };
    options.frames.clone().or(of_file).unwrap_or_default()
}

/// Plugins the graph asks for by identifier. None can be loaded yet, so each is missing.
fn read_plugins(plugins: Option<&Spanned<Ron>>, options: &Options, report: &mut Reporter) {
    let Some(plugins) = plugins else { return };
    let malformed = |span, report: &mut Reporter| {
        let fault = Fault::new(Code::Malformed, "`plugins` must be a list of identifiers, [\"com.acme.glow\"]");
        report.add(At { source: 0, span }, fault);
    };
    let Ron::List(items) = &plugins.value else { return malformed(plugins.span, report) };
    for item in items {
        let Ron::Text(id) = &item.value else {
            malformed(item.span, report);
            continue;
        };
        let folders: Vec<String> = options.plugins.iter().map(|folder| folder.display().to_string()).collect();
        let looked = if folders.is_empty() { "in no folder".into() } else { format!("in {}", folders.join(", ")) };
        let fault =
            Fault::new(Code::MissingPlugin, format!("the plugin `{id}` is missing; it was looked for {looked}"));
        report.add(At { source: 0, span: item.span }, fault.hint("name its folder with --plugins".to_owned()));
    }
}

fn is_id(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
}

fn read_entry<'a>(
    key: &'a Spanned<Ron>,
    value: &'a Spanned<Ron>,
    registry: &Registry,
    graph: &mut Graph<'a>,
    report: &mut Reporter,
) {
    let here = |span| At { source: 0, span };
    let id = match &key.value {
        Ron::Text(id) if is_id(id) => id.as_str(),
        Ron::Text(id) => {
            let message = format!("`{id}` cannot name a node: a name has letters, digits, `_` and `-`, no digit first");
            report.add(here(key.span), Fault::new(Code::Malformed, message).node(id));
            id.as_str()
        }
        Ron::Broken => return,
        _ => return report.add(here(key.span), Fault::new(Code::Malformed, "a node's name is text in double quotes")),
    };
    let mut entry = Entry { id, at: here(first_line(value.span)), node_type: None, fields: Vec::new(), sound: false };
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
                let names: Vec<&str> = registry.iter().map(|t| t.name.as_str()).collect();
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
            let fault = Fault::new(Code::Malformed, format!("`{name}` has no parentheses")).node(id);
            report.add(entry.at, fault.hint(format!("write {name}()")));
        }
        Ron::Tuple { name: Some(name), .. } => {
            entry.at = here(name.span);
            let fault = Fault::new(Code::Malformed, format!("parameters of `{}` have names", name.value)).node(id);
            report.add(entry.at, fault.hint(format!("write {}(name: value)", name.value)));
        }
        _ => {
            let fault = Fault::new(Code::Malformed, format!("`{id}` must be a node, Type(parameter: value, ..)"));
            report.add(entry.at, fault.node(id));
        }
    }
    if graph.index.contains_key(id) {
        let fault = Fault::new(Code::DuplicateNode, format!("there is another node `{id}` above")).node(id);
        report.add(here(key.span), fault.hint("give one of them another name".to_owned()));
    } else {
        graph.index.insert(id, graph.nodes.len());
    }
    graph.nodes.push(entry);
}

fn apply_sets<'a>(sets: &'a [Set], graph: &mut Graph<'a>, report: &mut Reporter) {
    for set in sets {
        let at = |start: usize, length: usize| At {
            source: set.source,
            span: Span { start: start as u32, end: (start + length) as u32 },
        };
        let Some(&index) = graph.index.get(set.node.as_str()) else {
            let fault = Fault::new(Code::UnknownNode, format!("there is no node `{}`", set.node));
            report.add(at(0, set.node.len()), fault.hint(suggestion(&set.node, graph.index.keys().copied())));
            continue;
        };
        let name_at = at(set.node.len() + 1, set.param.len());
        let field = Field { name: &set.param, name_at, value: &set.value, source: set.source };
        let fields = &mut graph.nodes[index].fields;
        fields.retain(|old| old.name != set.param);
        fields.push(field);
    }
}
