//! A page of each node type, and an index: what their declarations say, with examples and pictures where there are some.

use std::fmt::Write as _;
use std::fs;
use std::path::{Component, Path, PathBuf};

use warploom_core::graph::format;
use warploom_core::node::OutputKind;
use warploom_core::registry::{NodeType, Registry};
use warploom_core::schema::{Arity, Param, Shape};
use warploom_core::value::Kind;

use super::{default, output_kind};

/// Columns that a small picture is drawn on.
const ENLARGED: u32 = 256;

/// Where pages lie, and what they show.
pub struct Folders<'a> {
    /// The pages' own.
    pub out: &'a Path,
    /// `drop_shadow/graph.ron` in it is the example of a node type DropShadow, `graph.png` beside it what that gives.
    pub examples: Option<&'a Path>,
    /// `drop_shadow.png` in it is the node type's picture.
    pub pictures: Option<&'a Path>,
}

/// Name and text of each page: `README.md`, then one for each node type, by name.
///
/// Nothing is written. Examples and pictures that are not there are left out; the text depends on nothing else.
pub fn pages(registry: &Registry, folders: &Folders) -> Vec<(String, String)> {
    let own =
        registry.iter().map(|node_type| (format!("{}.md", node_type.name), linked(page(node_type, Some(folders)))));
    std::iter::once(("README.md".to_owned(), index(registry, folders))).chain(own).collect()
}

fn index(registry: &Registry, folders: &Folders) -> String {
    let mut text = "# Nodes\n\nEvery node type: first sources, which have no inputs, then by the kind of the first output, last those that\n\
        write files. `warploom nodes NAME` tells it in short at the prompt.\n\n\
        An input takes the name of a node, `\"plate\"`, or of one of its outputs, `\"parts.count\"`. A parameter that is a\n\
        number may change over frames, `Keys([(1001, 0.0), (1012, 60.0)])`, or be linked to a Number output, \
        `\"parts.count\"`;\nwhole numbers only where it is said. Lengths are pixels of the full picture, angles degrees, \
        clockwise on screen.\n"
        .to_owned();
    for (title, belongs) in families() {
        let members: Vec<&NodeType> = registry.iter().map(|t| &**t).filter(|t| family(t) == belongs).collect();
        if members.is_empty() {
            continue;
        }
        text += &format!("\n## {title}\n\n| | | |\n|---|---|---|\n");
        for node_type in members {
            let picture = picture(node_type, folders).map_or(String::new(), |path| {
                format!("<img src=\"{}\" width=\"64\" alt=\"\">", relative(folders.out, &path))
            });
            let summary = paragraphs(&node_type.doc).into_iter().next().unwrap_or_default();
            text += &format!("| {picture} | [{0}]({0}.md) | {1} |\n", node_type.name, cell(&summary));
        }
    }
    text
}

#[derive(Clone, Copy, PartialEq)]
enum Family {
    Source,
    Gives(Kind),
    /// Gives what it is given.
    Any,
    Sink,
}

fn family(node_type: &NodeType) -> Family {
    match node_type.outputs.first().map(|output| output.kind) {
        None => Family::Sink,
        _ if node_type.sink => Family::Sink,
        _ if node_type.ports().next().is_none() => Family::Source,
        Some(OutputKind::Is(kind)) => Family::Gives(kind),
        Some(OutputKind::SameAs(_)) => Family::Any,
    }
}

fn families() -> Vec<(&'static str, Family)> {
    let kinds = Kind::OWN.into_iter().map(|kind| (kind.name(), Family::Gives(kind)));
    let last = [("Same as an input", Family::Any), ("Sinks", Family::Sink)];
    std::iter::once(("Sources", Family::Source)).chain(kinds).chain(last).collect()
}

fn linked(page: String) -> String {
    page + "\n[All nodes](README.md)\n"
}

/// The page of a node type; without folders it shows no example and no picture.
pub(super) fn page(node_type: &NodeType, folders: Option<&Folders>) -> String {
    let mut text = format!("# {}\n\n{}\n", node_type.name, node_type.doc);
    if let Some(folders) = folders {
        if let Some(path) = own_picture(node_type, folders) {
            text += &format!("\n![{}]({})\n", node_type.name, relative(folders.out, &path));
        }
        text += &example(node_type, folders).unwrap_or_default();
    }
    let (ports, params): (Vec<&Param>, Vec<&Param>) =
        node_type.params.iter().partition(|param| matches!(param.shape, Shape::Port(_)));
    if !ports.is_empty() {
        text += "\n## Inputs\n\n| input | takes | meaning |\n|---|---|---|\n";
    }
    for port in ports {
        let _ = writeln!(text, "| `{}` | {} | {} |", port.name, cell(&port_takes(port)), meaning(port));
    }
    if !params.is_empty() {
        text += "\n## Parameters\n\n| parameter | takes | default | meaning |\n|---|---|---|---|\n";
    }
    for param in params {
        let default = default(param).map_or("must be given".to_owned(), |default| format!("`{default}`"));
        let takes = cell(&takes(node_type, param));
        let _ = writeln!(text, "| `{}` | {takes} | {} | {} |", param.name, cell(&default), meaning(param));
    }
    if !node_type.outputs.is_empty() {
        text += "\n## Outputs\n\n| output | kind |\n|---|---|\n";
    }
    for output in node_type.outputs {
        let _ = writeln!(text, "| `{}` | {} |", output.name, output_kind(output.kind));
    }
    text + &format!("\n{}\n", facts(node_type))
}

fn port_takes(port: &Param) -> String {
    let Shape::Port(shape) = &port.shape else { return String::new() };
    let left_out = if shape.arity == Arity::Optional { "; may be left out" } else { "" };
    let windows = if shape.windows_only { "; where it lies, not its pixels" } else { "" };
    format!("{}{windows}{left_out}", shape.describe())
}

fn takes(node_type: &NodeType, param: &Param) -> String {
    let mut text = param.shape.describe(param.unit.as_deref());
    if let Some([least, most]) = node_type.schema["properties"][&param.name]["x-soft"].as_array().map(Vec::as_slice) {
        let plain = |limit: &serde_json::Value| limit.as_f64().unwrap_or_default();
        text += &format!("; mostly {} to {}", plain(least), plain(most));
    }
    if matches!(param.shape, Shape::Integer { animatable: true, .. }) {
        text += "; may change over frames or be linked";
    }
    if !param.extensions.is_empty() {
        text += &format!("; ends with .{}", param.extensions.join(", ."));
    }
    text
}

/// What a port or parameter is for, and the names that it knows.
fn meaning(param: &Param) -> String {
    let mut lines = paragraphs(&param.doc);
    details(&param.shape, &mut lines);
    lines.iter().map(|line| cell(line)).collect::<Vec<_>>().join("<br>")
}

fn details(shape: &Shape, lines: &mut Vec<String>) {
    match shape {
        Shape::Choice(variants) => {
            for variant in variants {
                let takes = variant.content.as_ref().map_or(String::new(), |c| format!("({})", c.describe(None)));
                lines.push(format!("`{}`{takes}: {}", variant.name, variant.doc));
                variant.content.iter().for_each(|content| details(content, lines));
            }
        }
        Shape::Struct(fields) => {
            for field in fields {
                let takes = field.shape.describe(field.unit.as_deref());
                lines.push(format!("`{}` ({takes}): {}", field.name, field.doc));
            }
        }
        Shape::List(inner) | Shape::Optional(inner) => details(inner, lines),
        _ => {}
    }
}

/// The paragraphs of a text, each as one line.
fn paragraphs(text: &str) -> Vec<String> {
    text.split("\n\n").map(|lines| lines.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

/// A text as it stands in a table.
fn cell(text: &str) -> String {
    text.replace('\n', " ").replace('|', "\\|")
}

fn facts(node_type: &NodeType) -> String {
    let facts = [
        (true, format!("Version {}.", node_type.version)),
        (node_type.sink, "Writes files.".to_owned()),
        (node_type.reads_frame, "Depends on the frame number itself.".to_owned()),
        (node_type.cpu_family, "The last bits may differ on another family of processors.".to_owned()),
    ];
    facts.into_iter().filter(|(is_so, _)| *is_so).map(|(_, fact)| fact).collect::<Vec<_>>().join(" ")
}

/// The example graph, what stands above it, and its picture.
fn example(node_type: &NodeType, folders: &Folders) -> Option<String> {
    let path = folders.examples?.join(snake_case(&node_type.name)).join("graph.ron");
    let graph = fs::read_to_string(&path).ok()?;
    // One that cannot be formatted is shown as it is.
    let graph = format(&path, &graph).unwrap_or(graph);
    let head = graph.lines().take_while(|line| line.starts_with("//")).count();
    let says = |line: &&str| !line.starts_with("// tolerance:");
    let caption: Vec<&str> =
        graph.lines().take(head).filter(says).map(|line| line.trim_start_matches('/').trim()).collect();
    let body: Vec<&str> = graph.lines().skip(head).collect();
    let mut text = format!("\n## Example\n\n{}\n\n```ron\n{}\n```\n", caption.join("\n"), body.join("\n").trim());
    if let Some((path, width)) = example_picture(node_type, folders) {
        let shown = (ENLARGED / width.max(1)).max(1) * width;
        text += &format!(
            "\n<img src=\"{}\" width=\"{shown}\" style=\"image-rendering: pixelated\" alt=\"what the example gives\">\n",
            relative(folders.out, &path)
        );
    }
    Some(text)
}

/// The picture for the index.
fn picture(node_type: &NodeType, folders: &Folders) -> Option<PathBuf> {
    own_picture(node_type, folders).or_else(|| example_picture(node_type, folders).map(|(path, _)| path))
}

fn own_picture(node_type: &NodeType, folders: &Folders) -> Option<PathBuf> {
    let path = folders.pictures?.join(format!("{}.png", snake_case(&node_type.name)));
    path.exists().then_some(path)
}

/// The picture beside the example, and its width.
fn example_picture(node_type: &NodeType, folders: &Folders) -> Option<(PathBuf, u32)> {
    let path = folders.examples?.join(snake_case(&node_type.name)).join("graph.png");
    // A PNG begins with its signature and the chunk IHDR, which begins with the width.
    let head = fs::read(&path).ok()?;
    let width = head.get(16..20)?.try_into().ok()?;
    Some((path, u32::from_be_bytes(width)))
}

/// `DropShadow` as `drop_shadow`.
fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    for letter in name.chars() {
        if letter.is_ascii_uppercase() && !snake.is_empty() {
            snake.push('_');
        }
        snake.push(letter.to_ascii_lowercase());
    }
    snake
}

/// The way from a folder to a file, as a link.
fn relative(from: &Path, to: &Path) -> String {
    let whole = |path: &Path| {
        let mut parts: Vec<String> = Vec::new();
        for part in std::path::absolute(path).unwrap_or_else(|_| path.to_owned()).components() {
            match part {
                Component::ParentDir => drop(parts.pop()),
                part => parts.push(part.as_os_str().to_string_lossy().into_owned()),
            }
        }
        parts
    };
    let (from, to) = (whole(from), whole(to));
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = from[common..].iter().map(|_| "..".to_owned());
    up.chain(to[common..].iter().cloned()).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_lead_from_the_page_to_the_file() {
        let link = |from, to| relative(Path::new(from), Path::new(to));
        assert_eq!(link("/a/docs/nodes", "/a/tests/x.png"), "../../tests/x.png");
        assert_eq!(link("/a/docs/../nodes", "/a/nodes/x.png"), "x.png");
        assert_eq!(link("docs", "docs/x.png"), "x.png");
    }

    #[test]
    fn texts_do_not_break_tables() {
        assert_eq!(cell("a | b\nc"), "a \\| b c");
        assert_eq!(paragraphs("one\ntwo\n\nthree"), ["one two", "three"]);
        assert_eq!(snake_case("DropShadow"), "drop_shadow");
    }
}
