//! Targets, frames and files: what a run would do, as far as that can be told beforehand.

use std::collections::HashMap;
use std::path::Path;
use std::sync::OnceLock;

use serde_json::Value as Json;

use super::document::{Entry, Graph};
use super::values::Draft;
use super::wiring::Wired;
use super::{At, Options, Reporter};
use crate::diag::{Code, Fault};
use crate::graph::frames::{Folding, has_pattern, paths_over, split_folder};
use crate::graph::plan::{Plan, PlanNode};
use crate::graph::source::Sources;
use crate::node::Request;
use crate::registry::AnyNode;
use crate::schema::Access;
use crate::value::{Kind, Reads};

/// The last faults, and the plan if nothing is missing for it.
pub(super) fn finish(graph: Graph, wired: Wired, options: &Options, report: &mut Reporter) -> Option<Plan> {
    let sinks: Vec<usize> = (0..graph.nodes.len())
        .filter(|&index| graph.nodes[index].node_type.as_ref().is_some_and(|node_type| node_type.sink))
        .collect();
    let targets = targets(&graph, &sinks, options, report);
    sink_conflicts(&graph, &wired, &sinks, report);
    let reached = flood(&targets, |index| wired.sources(index).collect(), graph.nodes.len());
    // What feeds a node that is not whole cannot be told, nor then what nothing needs.
    let whole = |index: usize| wired.drafts[index].as_ref().is_some_and(|draft| is_whole(draft, &wired, index));
    let all_whole = !targets.is_empty() && (0..graph.nodes.len()).all(whole);
    if all_whole {
        unreached(&graph, &reached).into_iter().for_each(|(at, warning)| report.warn(at, warning));
    }
    let prototypes: Vec<Option<Box<dyn AnyNode>>> = (wired.drafts.iter())
        .map(|draft| draft.as_ref().map(|draft| draft.node_type.make(&Json::Object(draft.params.json.clone()))))
        .collect();
    let varies = frame_faults(&graph, &wired, &prototypes, &targets, report);
    if report.count() > 0 {
        return None;
    }
    let drafts: Vec<Draft> = wired.drafts.into_iter().flatten().collect();

    let mut nodes = Vec::with_capacity(drafts.len());
    let rows = drafts.into_iter().zip(prototypes.into_iter().flatten()).zip(wired.slots).zip(wired.links).enumerate();
    for (index, (((draft, prototype), mut slots), links)) in rows {
        for slot in &mut slots {
            let windows_only = draft.node_type.ports().any(|(p, port)| p.name == slot.port && port.windows_only);
            let reads = if windows_only { Reads::Windows } else { prototype.reads(&slot.port) };
            slot.reads = reads.for_kind(wired.kinds[slot.source][slot.output].unwrap_or(Kind::Image));
        }
        nodes.push(PlanNode {
            id: graph.nodes[index].id.into(),
            wanted: vec![Reads::All; draft.node_type.outputs.len()],
            node_type: draft.node_type,
            params: draft.params,
            slots,
            links,
            prototype,
            is_static: !varies[index],
            at: draft.at,
            param_at: draft.param_at,
            recipe: OnceLock::new(),
        });
    }
    let graph_file = std::path::absolute(options.file).unwrap_or_else(|_| options.file.to_owned());
    let order: Vec<usize> = wired.order.into_iter().filter(|&index| reached[index]).collect();
    tell_wanted(&mut nodes, &order, &targets);
    let (frames, sources) = (graph.frames, Sources::default());
    let plan = Plan { graph: graph_file, nodes, targets, order, frames, sources, pairs: OnceLock::new() };
    Some(plan)
}

/// Tells the nodes that heed it what those who run look at of their outputs. Targets are looked at whole.
fn tell_wanted(nodes: &mut [PlanNode], order: &[usize], targets: &[usize]) {
    let mut readers: Vec<Vec<Vec<&Reads>>> =
        nodes.iter().map(|node| vec![Vec::new(); node.node_type.outputs.len()]).collect();
    for &target in targets {
        readers[target].iter_mut().for_each(|readers| readers.push(&Reads::All));
    }
    for reader in order.iter().map(|&index| &nodes[index]) {
        reader.slots.iter().for_each(|slot| readers[slot.source][slot.output].push(&slot.reads));
        reader.links.iter().for_each(|&(source, output)| readers[source][output].push(&Reads::All));
    }
    let of_node = |outputs: Vec<Vec<&Reads>>| outputs.into_iter().map(Reads::union).collect();
    let wanted: Vec<Vec<Reads>> = readers.into_iter().map(of_node).collect();
    let heeding = nodes.iter_mut().zip(wanted).filter(|(node, _)| node.node_type.heeds_wanted);
    heeding.for_each(|(node, wanted)| node.wanted = wanted);
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
                report.add(At { source, span }, fault.hint(graph.suggestion(id, usize::MAX, report)));
            }
        }
    }
    targets.sort_unstable();
    targets.dedup();
    targets
}

/// What can be come to from `starts` by steps.
fn flood(starts: &[usize], step: impl Fn(usize) -> Vec<usize>, count: usize) -> Vec<bool> {
    let mut found = vec![false; count];
    let mut stack = starts.to_vec();
    while let Some(index) = stack.pop() {
        if !std::mem::replace(&mut found[index], true) {
            stack.extend(step(index));
        }
    }
    found
}

/// Whether all that should feed a node does.
fn is_whole(draft: &Draft, wired: &Wired, index: usize) -> bool {
    let (slots, links) = (&wired.slots[index], &wired.links[index]);
    let fed = |port: &str| slots.iter().any(|slot| slot.port == port);
    slots.len() == draft.ports.len()
        && links.len() == draft.links.len()
        && draft.node_type.ports().all(|(param, _)| !param.required || fed(&param.name))
}

fn unreached(graph: &Graph, reached: &[bool]) -> Vec<(At, Fault)> {
    // A second node of a name is a fault, and nothing can name it.
    let is_first = |index: usize| graph.index.get(graph.nodes[index].id) == Some(&index);
    let loose = graph.nodes.iter().enumerate().filter(|&(index, _)| !reached[index] && is_first(index));
    let warn = |(_, entry): (usize, &Entry)| {
        let hint = "connect it, or remove it".to_owned();
        let message = format!("no target needs `{}`", entry.id);
        (entry.at, Fault::new(Code::Unreached, message).node(entry.id).hint(hint))
    };
    loose.map(warn).collect()
}

/// The parameter that names the file a node writes, and the file: the graph's folder if it lies there, and the rest.
fn written_path<'a>(draft: &'a Draft, graph: &Graph) -> Option<(&'a str, (&'a str, &'a str))> {
    let (name, _) = draft.params.paths.iter().find(|(_, access)| *access == Access::Write)?;
    Some((name, split_folder(draft.params.json.get(name)?.as_str()?, &graph.folder)))
}

/// Two sinks on one path, or a sink on a path that a node reads, over all frames.
fn sink_conflicts(graph: &Graph, wired: &Wired, sinks: &[usize], report: &mut Reporter) {
    let (mut users, mut folding) = (HashMap::<String, usize>::new(), Folding::default());
    if !sinks.is_empty() {
        for (index, draft) in wired.drafts.iter().enumerate() {
            for (name, _) in draft.iter().flat_map(|d| &d.params.paths).filter(|(_, access)| *access == Access::Read) {
                let path = draft.as_ref().and_then(|draft| draft.params.json.get(name)?.as_str()).unwrap_or_default();
                paths_over(split_folder(path, &graph.folder), &graph.frames).for_each(|path| {
                    users.entry(folding.folded(&path)).or_insert(index);
                });
            }
        }
    }
    for &index in sinks {
        let Some(draft) = &wired.drafts[index] else { continue };
        let Some((param, path)) = written_path(draft, graph) else { continue };
        for path in paths_over(path, &graph.frames) {
            let other = *users.entry(folding.folded(&path)).or_insert(index);
            if other != index {
                let (does, hint) = match sinks.contains(&other) {
                    true => ("writes", "give each Save a path of its own"),
                    false => ("reads", "write to another file than the one that is read"),
                };
                let (id, other) = (graph.nodes[index].id, graph.nodes[other].id);
                let fault = Fault::new(Code::SinkConflict, format!("`{other}` {does} {path} too"));
                report.add(param_at(draft, param), fault.node(id).parameter(param).hint(hint.to_owned()));
                break;
            }
        }
    }
}

/// What is asked without a frame must not change over frames, unless there are frames; and what changes cannot be
/// written to one file. Gives which nodes change.
fn frame_faults(
    graph: &Graph,
    wired: &Wired,
    prototypes: &[Option<Box<dyn AnyNode>>],
    targets: &[usize],
    report: &mut Reporter,
) -> Vec<bool> {
    let count = graph.nodes.len();
    let asked = frameless(graph, wired, prototypes);
    let mut askers: Vec<Vec<usize>> = vec![Vec::new(); count];
    for (index, sources) in asked.iter().enumerate() {
        sources.iter().for_each(|&source| askers[source].push(index));
    }
    let animated_at = |index: usize| wired.drafts[index].as_ref()?.animated_at.as_ref();
    let animated: Vec<usize> = (0..count).filter(|&index| animated_at(index).is_some()).collect();
    let varies = flood(&animated, |index| askers[index].clone(), count);
    let asked_by_targets = flood(targets, |index| asked[index].clone(), count);

    let first = animated.iter().find(|&&index| asked_by_targets[index]).filter(|_| !graph.frames_given);
    if let Some((&index, (at, param))) = first.and_then(|index| Some((index, animated_at(*index)?))) {
        let id = graph.nodes[index].id;
        let hint = "add frames: \"1001-1100\" to the graph, or --frames 1001-1100".to_owned();
        let message = format!("`{id}` changes over frames, and no frames are given");
        let fault = Fault { parameter: param.clone(), ..Fault::new(Code::NoFrames, message) };
        report.add(*at, fault.node(id).hint(hint));
    }
    for &index in targets.iter().filter(|&&index| varies[index] && graph.frames.len() > 1) {
        let Some(draft) = &wired.drafts[index] else { continue };
        let Some((param, _)) = written_path(draft, graph).filter(|(_, (_, path))| !has_pattern(path)) else { continue };
        let id = graph.nodes[index].id;
        let message = format!("`{id}` would write {} frames to one file", graph.frames.len());
        let fault = Fault::new(Code::NeedsFramePattern, message).node(id).parameter(param);
        report.add(param_at(draft, param), fault.hint("put #### where the frame number belongs".to_owned()));
    }
    varies
}

/// Per node, what it asks without a frame when it is itself asked so.
fn frameless(graph: &Graph, wired: &Wired, prototypes: &[Option<Box<dyn AnyNode>>]) -> Vec<Vec<usize>> {
    let asks = |index: usize, port: &str| {
        let needs = |node: &dyn AnyNode| node.needs(port, &Request::whole(None), &graph.frames);
        prototypes[index].as_deref().is_some_and(|node| needs(node).iter().any(|need| need.frame.is_none()))
    };
    let of = |index: usize| {
        let slots = wired.slots[index].iter().filter(|slot| asks(index, &slot.port)).map(|slot| slot.source);
        slots.chain(wired.links[index].iter().map(|&(source, _)| source)).collect()
    };
    (0..graph.nodes.len()).map(of).collect()
}

fn param_at(draft: &Draft, param: &str) -> At {
    draft.param_at.iter().find(|(name, _)| name == param).map_or(draft.at, |(_, at)| *at)
}
