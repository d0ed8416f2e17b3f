//! Why a pair ran: what it was made of now, against what it was made of last time.
//!
//! The journal of last times is advisory. It enters no key; without it the texts alone are poorer.

use std::collections::HashMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::pairs::{Pair, Pairs};
use super::report::{Reason, Status, Why};
use super::schedule::PairState;
use crate::graph::plan::{Plan, PlanNode};
use crate::schema::{Access, Shape};
use crate::value::Digest;

/// What a pair's key was made of.
pub(crate) struct Evidence {
    pub params: serde_json::Map<String, Json>,
    /// Per slot, per request: digest of the part that is read.
    pub inputs: Vec<Vec<Digest>>,
    pub files: Vec<(PathBuf, Digest)>,
}

/// Why a sink whose key was known ran all the same.
pub(crate) enum Trigger {
    OutputMissing(PathBuf),
    OutputChanged(PathBuf),
}

/// What the pairs of a graph were made of when they were last resolved.
#[derive(Clone, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub(crate) struct Journal(HashMap<String, Entry>);

#[derive(Clone, Serialize, Deserialize)]
struct Entry {
    key: Digest,
    node_type: String,
    version: u32,
    params: serde_json::Map<String, Json>,
    /// Per connection: port, source and output, digests.
    inputs: Vec<(String, String, Vec<Digest>)>,
    files: Vec<(PathBuf, Digest)>,
}

fn name(node: &PlanNode, frame: Option<i64>) -> String {
    match frame {
        Some(frame) => format!("{}@{frame}", node.id),
        None => node.id.to_string(),
    }
}

impl Journal {
    /// The reason of every pair that ran, and the journal brought up to date.
    pub fn explain(&mut self, plan: &Plan, pairs: &Pairs, states: &[PairState]) -> Vec<Option<Why>> {
        let mut changes: Vec<Option<Why>> = (0..states.len()).map(|_| None).collect();
        let mut reasons: Vec<Option<Why>> = (0..states.len()).map(|_| None).collect();
        for at in pairs.in_order(plan) {
            let (pair, state) = (&pairs.list[at], &states[at]);
            let node = &plan.nodes[pair.node];
            let (Some(key), Some(evidence)) = (state.key, &state.evidence) else { continue };
            let now = Entry {
                key,
                node_type: node.node_type.name.clone(),
                version: node.node_type.version,
                params: evidence.params.clone(),
                inputs: connections(plan, node, evidence),
                files: evidence.files.clone(),
            };
            let name = name(node, pair.request.frame);
            let before = match state.record {
                Some(_) => self.0.insert(name, now.clone()),
                None => self.0.get(&name).cloned(),
            };
            changes[at] = match &before {
                None => {
                    let text = format!("`{}` runs here for the first time", node.id);
                    Some(plain(plan, pair.node, None, Reason::FirstRun, text))
                }
                Some(before) if before.key == key => None,
                Some(before) => Some(
                    own_change(plan, pair, before, &now, &changes)
                        .or_else(|| inherited(pair, before, &now, &changes))
                        .unwrap_or_else(|| rewired(plan, pair.node, before, &now)),
                ),
            };
            reasons[at] = match state.status {
                Some(Status::Executed | Status::Failed) => {
                    let text = format!("the record of `{}` is gone from the cache", node.id);
                    let reason = triggered(plan, pair.node, state).or_else(|| changes[at].clone());
                    Some(reason.unwrap_or_else(|| plain(plan, pair.node, None, Reason::Evicted, text)))
                }
                Some(Status::Recomputed) => {
                    let text = format!("the result of `{}` is known, but its bytes were not kept", node.id);
                    Some(plain(plan, pair.node, None, Reason::NotKept, text))
                }
                _ => None,
            };
        }
        let known: std::collections::HashSet<&str> = plan.nodes.iter().map(|node| &*node.id).collect();
        self.0.retain(|name, _| known.contains(name.split('@').next().unwrap_or_default()));
        reasons
    }
}

fn connections(plan: &Plan, node: &PlanNode, evidence: &Evidence) -> Vec<(String, String, Vec<Digest>)> {
    let slots = node.slots.iter().zip(&evidence.inputs);
    slots
        .map(|(slot, digests)| {
            let source = &plan.nodes[slot.source];
            let output = source.node_type.outputs[slot.output].name;
            (slot.port.clone(), format!("{}.{output}", source.id), digests.clone())
        })
        .collect()
}

/// A reason at a node, or at one of its parameters.
fn plain(plan: &Plan, index: usize, param: Option<&str>, code: Reason, text: String) -> Why {
    let node = &plan.nodes[index];
    let at = Some(plan.place(index, param).to_string());
    Why { param: param.map(str::to_owned), code, node: node.id.to_string(), old: None, new: None, at, text }
}

/// A change of the node's own: its type, version, parameters or files.
fn own_change(plan: &Plan, pair: &Pair, before: &Entry, now: &Entry, changes: &[Option<Why>]) -> Option<Why> {
    let index = pair.node;
    let node = &plan.nodes[index];
    if (&before.node_type, before.version) != (&now.node_type, now.version) {
        let describe = |entry: &Entry| format!("{} {}", entry.node_type, entry.version);
        let (old, new) = (describe(before), describe(now));
        let text = format!("`{}` was of type {old} and is of type {new}", node.id);
        let why = plain(plan, index, None, Reason::Version, text);
        return Some(Why { old: Some(old.into()), new: Some(new.into()), ..why });
    }
    // A linked parameter's change is that of the node it is linked to.
    let links = node.params.links().into_iter().zip(&pair.links);
    let linked: Vec<String> = links.filter(|(_, from)| changes[**from].is_some()).map(|(name, _)| name).collect();
    for param in node.node_type.params.iter().filter(|param| !linked.contains(&param.name)) {
        let (old, new) = (before.params.get(&param.name), now.params.get(&param.name));
        let by_content = matches!(param.shape, Shape::Port(_) | Shape::Text(Some(Access::Read)));
        if old != new && !by_content {
            let (old, new) = (old.cloned().unwrap_or_default(), new.cloned().unwrap_or_default());
            let text = format!("`{}` of `{}` was {old} and is {new}", param.name, node.id);
            let why = plain(plan, index, Some(&param.name), Reason::Param, text);
            return Some(Why { old: Some(old), new: Some(new), ..why });
        }
    }
    let ((path, new), (_, old)) = now.files.iter().zip(&before.files).find(|(new, old)| new.1 != old.1)?;
    let param = node.params.paths.iter().find(|(_, access)| *access == Access::Read).map(|(name, _)| name.as_str());
    let why = plain(plan, index, param, Reason::File, format!("{} has other content", path.display()));
    Some(Why { old: Some(old.hex().into()), new: Some(new.hex().into()), ..why })
}

/// The change of the first input that changed, unless it is another input altogether.
fn inherited(pair: &Pair, before: &Entry, now: &Entry, changes: &[Option<Why>]) -> Option<Why> {
    for ((slot, new), old) in pair.slots.iter().zip(&now.inputs).zip(&before.inputs) {
        let changed = slot.iter().enumerate().find(|(answer, _)| old.2.get(*answer) != new.2.get(*answer));
        if let Some((_, &from)) = changed {
            return if old.1 == new.1 { changes[from].clone() } else { None };
        }
    }
    pair.links.iter().find_map(|&from| changes[from].clone())
}

/// Its ports are connected to something else.
fn rewired(plan: &Plan, index: usize, before: &Entry, now: &Entry) -> Why {
    let differs = |at: usize| before.inputs.get(at) != now.inputs.get(at);
    let at = (0..before.inputs.len().max(now.inputs.len())).find(|&at| differs(at)).unwrap_or_default();
    let source = |entry: &Entry| entry.inputs.get(at).map(|(_, source, _)| source.clone());
    let port = now.inputs.get(at).or(before.inputs.get(at)).map(|(port, _, _)| port.as_str());
    let text = format!("`{}` of `{}` is fed by something else", port.unwrap_or_default(), plan.nodes[index].id);
    let why = plain(plan, index, port, Reason::Input, text);
    Why { old: source(before).map(Json::from), new: source(now).map(Json::from), ..why }
}

fn triggered(plan: &Plan, index: usize, state: &PairState) -> Option<Why> {
    let (code, text) = match state.trigger.as_ref()? {
        Trigger::OutputMissing(path) => (Reason::OutputMissing, format!("{} is not there any more", path.display())),
        Trigger::OutputChanged(path) => {
            (Reason::OutputChanged, format!("{} is no longer what `{}` wrote", path.display(), plan.nodes[index].id))
        }
    };
    Some(plain(plan, index, None, code, text))
}
