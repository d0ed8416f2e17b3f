//! `warploom nodes`: what node types there are, from their own declarations.

mod pages;

use std::path::Path;

use serde_json::{Value as Json, json};
use warploom_core::diag::{Code, Fault, suggestion};
use warploom_core::engine::{cannot_write, plain, write_file};
use warploom_core::node::OutputKind;
use warploom_core::registry::{NodeType, Registry};
use warploom_core::schema::{Param, Shape};

use crate::args::{NodesArgs, NodesFormat};
use crate::terminal::{say, show};

use pages::page;
pub use pages::{Folders, pages};

/// The command.
pub(crate) fn nodes(args: &NodesArgs, registry: &Registry) -> u8 {
    if let Some(out) = &args.out {
        return match write_pages(out, args, registry) {
            Ok(()) => 0,
            Err(fault) => {
                show(&fault, false);
                fault.code.exit_code()
            }
        };
    }
    let Some(name) = &args.name else {
        let all: Vec<&NodeType> = registry.iter().map(|node_type| &**node_type).collect();
        match args.format {
            NodesFormat::Json => say(&Json::Array(all.iter().map(|t| manifest(t)).collect()).to_string()),
            NodesFormat::Markdown => all.iter().for_each(|node_type| say(&page(node_type, None))),
            NodesFormat::Human => {
                let width = all.iter().map(|node_type| node_type.name.len()).max().unwrap_or_default();
                all.iter()
                    .for_each(|t| say(&format!("{:width$}  {}", t.name, t.doc.lines().next().unwrap_or_default())));
            }
        }
        return 0;
    };
    let Some(node_type) = registry.get(name) else {
        let hint = suggestion(name, registry.iter().map(|node_type| &*node_type.name));
        show(&Fault::new(Code::UnknownType, format!("there is no node type `{name}`")).hint(hint), false);
        return 2;
    };
    say(&match args.format {
        NodesFormat::Json => format!("{:#}", manifest(node_type)),
        NodesFormat::Markdown => page(node_type, None),
        NodesFormat::Human => human(node_type),
    });
    0
}

fn write_pages(out: &Path, args: &NodesArgs, registry: &Registry) -> Result<(), Fault> {
    if args.format != NodesFormat::Markdown {
        let fault = Fault::new(Code::Usage, "only pages are written to a folder");
        return Err(fault.hint("add --format markdown".to_owned()));
    }
    if let Some(folder) = [&args.examples, &args.pictures].into_iter().flatten().find(|folder| !folder.is_dir()) {
        let fault = Fault::new(Code::InputUnreadable, format!("the folder {} does not exist", folder.display()));
        return Err(fault.hint("give one that does, or leave it out".to_owned()));
    }
    let folders = Folders { out, examples: args.examples.as_deref(), pictures: args.pictures.as_deref() };
    for (name, text) in pages(registry, &folders) {
        let path = std::path::absolute(out).unwrap_or_else(|_| out.to_owned()).join(name);
        let title = |text: &str| text.lines().next().unwrap_or_default().to_owned();
        if std::fs::read_to_string(&path).is_ok_and(|there| title(&there) != title(&text)) {
            let fault = Fault::new(Code::OutputUnwritable, format!("{} is there, and is no such page", path.display()));
            return Err(fault.hint("write pages to a folder of their own".to_owned()));
        }
        write_file(&path, text.as_bytes()).map_err(|error| {
            let message = format!("{} cannot be written: {}", path.display(), plain(&error));
            Fault::new(Code::OutputUnwritable, message).hint(cannot_write(&error).to_owned())
        })?;
        say(&path.display().to_string());
    }
    Ok(())
}

fn output_kind(kind: OutputKind) -> String {
    match kind {
        OutputKind::Is(kind) => kind.to_string(),
        OutputKind::SameAs(port) => format!("same as {port}"),
    }
}

/// The form of a plugin's manifest.
fn manifest(node_type: &NodeType) -> Json {
    let outputs: Vec<_> = (node_type.outputs.iter())
        .map(|output| json!({ "name": output.name, "kind": output_kind(output.kind) }))
        .collect();
    let mut schema = node_type.schema.clone();
    // A value that stands in while a node is made is no default of what must be given.
    for param in node_type.params.iter().filter(|param| param.required) {
        if let Some(property) = schema["properties"][&param.name].as_object_mut() {
            property.shift_remove("default");
        }
    }
    json!({
        "name": node_type.name,
        "version": node_type.version,
        "outputs": outputs,
        "sink": node_type.sink,
        "reads_frame": node_type.reads_frame,
        "schema": schema,
    })
}

/// What stands for a parameter's default: nothing for ports and for what must be given.
fn default(param: &Param) -> Option<String> {
    if param.required || matches!(param.shape, Shape::Port(_)) { None } else { Some(param.default_as_written()) }
}

fn human(node_type: &NodeType) -> String {
    let mut text = format!("{} (version {})\n\n{}\n", node_type.name, node_type.version, indented(&node_type.doc, 2));
    let (ports, params): (Vec<&Param>, Vec<&Param>) =
        node_type.params.iter().partition(|param| matches!(param.shape, Shape::Port(_)));
    for (title, rows) in [("Inputs", ports), ("Parameters", params)] {
        if !rows.is_empty() {
            text += &format!("\n{title}:\n");
        }
        for param in rows {
            let takes = param.shape.describe(param.unit.as_deref());
            let default = match default(param) {
                Some(default) => format!("; default {default}"),
                None if param.required => "; required".into(),
                None => "; may be left out".into(),
            };
            text += &format!("  {}: {takes}{default}\n{}\n", param.name, indented(&param.doc, 6));
        }
    }
    if !node_type.outputs.is_empty() {
        text += "\nOutputs:\n";
    }
    for output in node_type.outputs {
        text += &format!("  {}: {}\n", output.name, output_kind(output.kind));
    }
    text.trim_end().to_owned()
}

fn indented(text: &str, by: usize) -> String {
    let lines = text.lines().map(|line| if line.is_empty() { String::new() } else { format!("{:by$}{line}", "") });
    lines.collect::<Vec<_>>().join("\n")
}
