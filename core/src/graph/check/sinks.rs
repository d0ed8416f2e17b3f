//! Targets, frames and files: what a run would do, as far as that can be told beforehand.

use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};

use super::document::Graph;
use super::values::Draft;
use super::wiring::Wired;
use super::{At, Options, Reporter};
use crate::diag::{Code, Fault, suggestion};
use crate::graph::frames::{expand_pattern, has_pattern};
use crate::graph::plan::{Plan, PlanNode};
use crate::graph::source::Sources;
use crate::node::Request;
use crate::registry::AnyNode;
use crate::schema::Access;
use crate::value::Kind;

type Warnings = Vec<(At, Fault)>;

/// The last faults, and the plan if nothing is missing for it.
pub(super) fn finish(
    graph: Graph,
    mut wired: Wired,
    options: &Options,
    report: &mut Reporter,
) -> (Option<Plan>, Warnings) {
    let sinks: Vec<usize> = (0..graph.nodes.len())
        .filter(|&index| graph.nodes[index].node_type.as_ref().is_some_and(|node_type| node_type.sink))
        .collect();
    let targets = targets(&graph, &sinks, options, report);
    sink_conflicts(&graph, &wired, &sinks, report);
    let Some(order) = wired.order.take() else { return (None, Vec::new()) };
    let reached = reached(&wired, &targets);
    let warnings = unreached(&graph, &wired, &reached);
    // What a node asks of its inputs is known only of nodes that are whole: the others were reported already.
    let whole = |index: usize| {
        let draft = wired.drafts[index].as_ref()?;
        let complete = wired.slots[index].len() == draft.ports.len() && wired.links[index].len() == draft.links.len();
        complete.then_some(draft)
    };
    let all_whole = (0..graph.nodes.len()).all(|index| whole(index).is_some());
    if !all_whole || report.count() > 0 && !values_are_sound(report) {
        return (None, warnings);
    }
    let drafts: Vec<Draft> = wired.drafts.into_iter().flatten().collect();
    let prototypes: Vec<Box<dyn AnyNode>> = (drafts.iter())
        .map(|draft| draft.node_type.make(&serde_json::Value::Object(draft.params.json.clone())))
        .collect();
    let mut is_static = vec![true; drafts.len()];
    for &index in &order {
        let asks_static = |port: &str, source: usize, is_static: &[bool]| {
            let needs = prototypes[index].needs(port, &Request::whole(None), &graph.frames);
            needs.iter().all(|need| need.frame.is_some() || is_static[source])
        };
        is_static[index] = drafts[index].animated_at.is_none()
            && wired.slots[index].iter().all(|slot| asks_static(&slot.port, slot.source, &is_static))
            && wired.links[index].iter().all(|&(source, _)| is_static[source]);
    }
    frame_faults(&graph, &drafts, &is_static, &reached, report);

    let mut nodes = Vec::with_capacity(drafts.len());
    let rows = drafts.into_iter().zip(prototypes).zip(wired.slots).zip(wired.links).enumerate();
    for (index, (((draft, prototype), mut slots), links)) in rows {
        for slot in &mut slots {
            let windows_only = draft.node_type.ports().any(|(p, port)| p.name == slot.port && port.windows_only);
            let reads = if windows_only { crate::value::Reads::Windows } else { prototype.reads(&slot.port) };
            slot.reads = reads.for_kind(wired.kinds[slot.source][slot.output].unwrap_or(Kind::Image));
        }
        nodes.push(PlanNode {
            id: graph.nodes[index].id.into(),
            node_type: draft.node_type,
            params: draft.params,
            slots,
            links,
            prototype,
            is_static: is_static[index],
            at: draft.at,
            param_at: draft.param_at,
        });
    }
    let graph_file = std::path::absolute(options.file).unwrap_or_else(|_| options.file.to_owned());
    let order = order.into_iter().filter(|&index| reached[index]).collect();
    let plan = Plan { graph: graph_file, nodes, targets, order, frames: graph.frames, sources: Sources::default() };
    (Some(plan), warnings)
}

/// Whether node structs can be made: no fault that leaves a parameter without a value.
fn values_are_sound(report: &Reporter) -> bool {
    report
        .found
        .iter()
        .all(|(_, fault)| matches!(fault.code, Code::SinkConflict | Code::NoTarget | Code::MissingPlugin))
}

fn targets(graph: &Graph, sinks: &[usize], options: &Options, report: &mut Reporter) -> Vec<usize> {
    let mut targets = if options.targets.is_empty() { sinks.to_vec() } else { Vec::new() };
    if options.targets.is_empty() && options.dumps.is_empty() {
        let all_known = graph.nodes.iter().all(|node| node.node_type.is_some());
        if sinks.is_empty() && all_known {
            let hint = "add a Save, or name a node with --target".to_owned();
            report.add(graph.at, Fault::new(Code::NoTarget, "nothing to run: the graph has no sink").hint(hint));
        }
    }
    let named = options.targets.iter().map(|id| ("--target", id)).chain(options.dumps.iter().map(|id| ("--dump", id)));
    for (flag, id) in named {
        match graph.index.get(id.as_str()) {
            Some(&index) => targets.push(index),
            None => {
                let source = report.sources.add(Path::new(flag), id);
                let span = crate::graph::read::Span { start: 0, end: id.len() as u32 };
                let fault = Fault::new(Code::UnknownNode, format!("there is no node `{id}`"));
                report.add(At { source, span }, fault.hint(suggestion(id, graph.index.keys().copied())));
            }
        }
    }
    targets.sort_unstable();
    targets.dedup();
    targets
}

/// Which nodes the targets need.
fn reached(wired: &Wired, targets: &[usize]) -> Vec<bool> {
    let mut reached = vec![false; wired.slots.len()];
    let mut stack = targets.to_vec();
    while let Some(index) = stack.pop() {
        if !std::mem::replace(&mut reached[index], true) {
            stack.extend(wired.slots[index].iter().map(|slot| slot.source));
            stack.extend(wired.links[index].iter().map(|&(source, _)| source));
        }
    }
    reached
}

fn unreached(graph: &Graph, wired: &Wired, reached: &[bool]) -> Warnings {
    let loose = (0..reached.len()).filter(|&index| !reached[index] && wired.drafts[index].is_some());
    loose
        .map(|index| {
            let id = graph.nodes[index].id;
            let fault = Fault::new(Code::Unreached, format!("no target needs `{id}`")).node(id);
            (graph.nodes[index].at, fault)
        })
        .collect()
}

fn written_path(draft: &Draft) -> Option<(&str, &str)> {
    let (name, _) = draft.params.paths.iter().find(|(_, access)| *access == Access::Write)?;
    Some((name, draft.params.json.get(name)?.as_str()?))
}

/// Two sinks on one path, over all frames.
fn sink_conflicts(graph: &Graph, wired: &Wired, sinks: &[usize], report: &mut Reporter) {
    let mut writers: HashMap<String, usize> = HashMap::new();
    for &index in sinks {
        let Some((draft, (param, path))) = wired.drafts[index].as_ref().and_then(|d| Some((d, written_path(d)?)))
        else {
            continue;
        };
        let frames: &[i64] = if has_pattern(path) { &graph.frames } else { &[] };
        let mut paths: Vec<String> = frames.iter().map(|&frame| expand_pattern(path, frame)).collect();
        if paths.is_empty() {
            paths.push(path.to_owned());
        }
        for path in paths {
            let other = *writers.entry(folded(&path)).or_insert(index);
            if other != index {
                let (id, other) = (graph.nodes[index].id, graph.nodes[other].id);
                let message = format!("`{other}` writes {path} too");
                let at = draft.param_at.iter().find(|(name, _)| name == param).map_or(draft.at, |(_, at)| *at);
                let fault = Fault::new(Code::SinkConflict, message).node(id).parameter(param);
                report.add(at, fault.hint("give each Save a path of its own".to_owned()));
                break;
            }
        }
    }
}

/// A path in the form in which two that may be one file are equal: `.` and `..` resolved, case folded.
fn folded(path: &str) -> String {
    let mut resolved = PathBuf::new();
    for part in Path::new(path).components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                resolved.pop();
            }
            part => resolved.push(part),
        }
    }
    resolved.to_string_lossy().to_lowercase()
}

fn frame_faults(graph: &Graph, drafts: &[Draft], is_static: &[bool], reached: &[bool], report: &mut Reporter) {
    let mut said = false;
    for (index, draft) in drafts.iter().enumerate().filter(|(index, _)| reached[*index]) {
        let id = graph.nodes[index].id;
        if let Some(at) = draft.animated_at.filter(|_| graph.frames.is_empty() && !said) {
            let hint = "add frames: \"1001-1100\" to the graph, or --frames 1001-1100".to_owned();
            let fault = Fault::new(Code::NoFrames, format!("`{id}` changes over frames, and no frames are given"));
            report.add(at, fault.node(id).hint(hint));
            said = true;
        }
        if let Some((param, path)) = written_path(draft)
            && !has_pattern(path)
            && !is_static[index]
            && graph.frames.len() > 1
        {
            let at = draft.param_at.iter().find(|(name, _)| name == param).map_or(draft.at, |(_, at)| *at);
            let message = format!("`{id}` would write {} frames to one file", graph.frames.len());
            let fault = Fault::new(Code::NeedsFramePattern, message).node(id).parameter(param);
            report.add(at, fault.hint("put #### where the frame number belongs".to_owned()));
        }
    }
}
