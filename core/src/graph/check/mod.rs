//! From a tree to a plan: every fault in one pass, each where it stands.
//!
//! `document` takes the tree apart, `values` walks each value along its parameter's shape, `wiring` resolves
//! names, kinds and order, `sinks` looks at files and frames. A part that found a fault does not stop the next: a
//! node that cannot be checked further keeps its name, so that those who name it are not blamed.

mod document;
mod hints;
mod sinks;
mod values;
mod wiring;

use std::path::{Path, PathBuf};

use super::plan::Plan;
use super::read::{self, Ron, Spanned};
use super::source::{At, Sources};
use crate::diag::{Code, Fault, Place};
use crate::registry::Registry;

/// Largest graph file, bytes.
pub const MAX_BYTES: usize = 16 << 20;
/// Most nodes of a graph.
pub const MAX_NODES: usize = 100_000;
/// Newest version of the graph file's form.
pub const VERSION: u64 = 1;

/// What is asked of a check besides the text itself.
pub struct Options<'a> {
    /// The graph file, as places show it; relative paths in the graph start at its folder.
    pub file: &'a Path,
    /// `NODE.PARAM=RON`, each replacing a parameter.
    pub set: &'a [String],
    /// Nodes to run for; empty means all sinks.
    pub targets: &'a [String],
    /// Nodes to run for besides.
    pub dumps: &'a [String],
    /// Frames to run, if they are not those of the file.
    pub frames: Option<Vec<i64>>,
    /// Folders where plugins were looked for.
    pub plugins: &'a [PathBuf],
    /// Environment variables.
    pub variable: &'a dyn Fn(&str) -> Option<String>,
}

impl<'a> Options<'a> {
    /// No flags, no variables.
    pub fn new(file: &'a Path) -> Self {
        Self { file, set: &[], targets: &[], dumps: &[], frames: None, plugins: &[], variable: &|_| None }
    }
}

/// What a check found.
pub struct Checked {
    /// The plan, if there is no fault.
    pub plan: Option<Plan>,
    /// Everything wrong, in file order.
    pub faults: Vec<Fault>,
    /// Worth knowing, not wrong.
    pub warnings: Vec<Fault>,
}

/// Checks a graph file's text. Opens no file and runs nothing.
pub fn check(text: &str, registry: &Registry, options: &Options) -> Checked {
    let mut report = Reporter { sources: Sources::default(), found: Vec::new(), warned: Vec::new() };
    if text.len() > MAX_BYTES {
        let message = format!("the file has {} bytes; a graph file has at most {MAX_BYTES}", text.len());
        let hint = "is it a graph? if so, split it into several".to_owned();
        let start = Place { file: options.file.to_owned(), line: 1, column: 1, length: 0, text: String::new(), cut: 0 };
        let fault = Fault::new(Code::TooLarge, message).hint(hint).place(Some(start));
        return Checked { plan: None, faults: vec![fault], warnings: Vec::new() };
    }
    report.sources.add(options.file, text);
    let reading = read::read(text);
    let sets: Vec<document::Set> = options.set.iter().filter_map(|set| document::read_set(set, &mut report)).collect();
    // Of a bare word before other brackets the reading has told what is to be said.
    let told = |tree: &Spanned<Ron>| matches!(tree.value, Ron::Name(_)) && !reading.faults.is_empty();
    let tree = reading.tree.as_ref().filter(|tree| !told(tree));
    let graph = tree.and_then(|tree| document::read_graph(tree, registry, &sets, options, &mut report));
    for fault in &reading.faults {
        let at = fault.opened.unwrap_or(fault.span).start;
        let node = graph.as_ref().and_then(|graph| graph.node_around(at)).map(str::to_owned);
        let found = Fault { node, ..Fault::new(Code::Syntax, fault.message.clone()) };
        report.add(At { source: 0, span: fault.span }, found.hint(fault.hint.clone()));
    }
    let Some(graph) = graph else { return report.end(None) };
    let drafts = values::read_nodes(&graph, options, &mut report);
    let wired = wiring::wire(&graph, drafts, &mut report);
    let plan = sinks::finish(graph, wired, options, &mut report);
    report.end(plan)
}

/// Gathers faults with their places.
struct Reporter {
    sources: Sources,
    found: Vec<(At, Fault)>,
    /// Worth knowing, not wrong.
    warned: Vec<(At, Fault)>,
}

impl Reporter {
    fn add(&mut self, at: At, fault: Fault) {
        self.found.push((at, fault));
    }

    fn warn(&mut self, at: At, fault: Fault) {
        self.warned.push((at, fault));
    }

    fn count(&self) -> usize {
        self.found.len()
    }

    fn end(mut self, plan: Option<Plan>) -> Checked {
        for told in [&mut self.found, &mut self.warned] {
            told.sort_by_key(|(at, _)| (at.source, at.span.start));
        }
        let sources = &self.sources;
        let place = |(at, fault): (At, Fault)| fault.place(Some(sources.place(at)));
        let faults: Vec<Fault> = self.found.drain(..).map(place).collect();
        let warnings = self.warned.drain(..).map(place).collect();
        let plan = plan.filter(|_| faults.is_empty()).map(|plan| Plan { sources: self.sources, ..plan });
        Checked { plan, faults, warnings }
    }
}
