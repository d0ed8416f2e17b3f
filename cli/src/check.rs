//! `warploom check`, and the reading of graph files for all commands.

use std::path::Path;

use serde_json::json;
use warploom_core::diag::{Code, Fault};
use warploom_core::engine::plain;
use warploom_core::graph::check::MAX_BYTES;
use warploom_core::graph::read::Span;
use warploom_core::graph::source::{At, Sources};
use warploom_core::graph::{Checked, Options, check as check_text};
use warploom_core::registry::Registry;

use crate::args::{CheckArgs, CheckFormat, GraphFile};
use crate::terminal::{counted, note, say, show, show_warnings};

/// Reads and checks a graph file; `dumps` are nodes that are targets besides.
pub fn read(file: &GraphFile, dumps: &[String], registry: &Registry) -> Checked {
    let text = match text(&file.graph) {
        Ok(text) => text,
        Err(fault) => return Checked { plan: None, faults: vec![*fault], warnings: Vec::new() },
    };
    let options = Options {
        set: &file.set,
        targets: &file.target,
        dumps,
        frames: file.frames.as_ref().map(|frames| frames.0.clone()),
        plugins: &file.plugins,
        variable: &|name| std::env::var(name).ok(),
        ..Options::new(&file.graph)
    };
    check_text(&text, registry, &options)
}

/// The text of a graph file.
pub fn text(path: &Path) -> Result<String, Box<Fault>> {
    let usage = |message: String| Box::new(Fault::new(Code::Usage, message));
    let unreadable = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::NotFound => usage(format!("the graph file {} does not exist", path.display())),
        _ => usage(format!("the graph file {} cannot be read: {}", path.display(), plain(&error))),
    };
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(usage(format!("the graph file {} is not a regular file", path.display())));
    }
    if metadata.len() > MAX_BYTES as u64 {
        let message = format!("{} has {} bytes; a graph file has at most {MAX_BYTES}", path.display(), metadata.len());
        return Err(Box::new(Fault::new(Code::TooLarge, message)));
    }
    let bytes = std::fs::read(path).map_err(unreadable)?;
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to() as u32;
        let mut sources = Sources::default();
        let source = sources.add(path, &String::from_utf8_lossy(error.as_bytes()));
        let place = sources.place(At { source, span: Span { start: at, end: at + 1 } });
        let fault = Fault::new(Code::Malformed, format!("byte {at} of the file is not UTF-8"));
        Box::new(fault.place(Some(place)).hint("save it as UTF-8".to_owned()))
    })
}

/// The command. Exit code 0 or 2.
pub fn check(args: &CheckArgs, registry: &Registry) -> u8 {
    let checked = read(&args.file, &[], registry);
    match args.format {
        CheckFormat::Json => {
            say(&json!({ "schema": 1, "faults": checked.faults, "warnings": checked.warnings }).to_string());
        }
        CheckFormat::Human => {
            show_warnings(&checked.warnings);
            checked.faults.iter().for_each(|fault| show(fault, false));
            match (&checked.plan, checked.faults.len()) {
                (Some(plan), _) => note(&format!(
                    "{}: {}, {} of them needed by {}",
                    args.file.graph.display(),
                    counted(plan.nodes.len(), "node"),
                    plan.order.len(),
                    counted(plan.targets.len(), "target"),
                )),
                (None, count) => note(&counted(count, "fault")),
            }
        }
    }
    if checked.faults.is_empty() { 0 } else { 2 }
}
