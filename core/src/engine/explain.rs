//! Why a pair ran, or would: what it is made of now, against what it was made of last time.
//!
//! Last times lie in a journal, a page per graph and frame. It is advisory and enters no key; without it the texts
//! alone are poorer.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::disk::{DiskTier, Table};
use super::pairs::Pairs;
use super::report::{Reason, Why};
use super::resolve::Params;
use super::store::Record;
use crate::graph::plan::{Plan, PlanNode};
use crate::schema::{Access, Shape};
use crate::value::{Digest, Hasher, Reads};

/// Why a sink whose key was known ran all the same.
pub(crate) enum Trigger {
    OutputMissing(PathBuf),
    OutputChanged(PathBuf),
}

/// What became of a pair, or would.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Outcome {
    /// It ran, or tried to.
    Ran,
    /// Its result was known and its bytes were not kept.
    Recomputed,
    /// It did not run.
    Stood,
}

/// What is known of a pair.
pub(crate) struct Facts<'a> {
    pub outcome: Outcome,
    /// None while an input is not known.
    pub key: Option<Digest>,
    pub record: Option<&'a Record>,
    pub files: &'a [(PathBuf, Digest)],
    pub trigger: Option<&'a Trigger>,
}

/// A run, or one that might be.
pub(crate) struct Course<'a> {
    pub plan: &'a Plan,
    pub pairs: &'a Pairs,
    pub facts: &'a dyn Fn(usize) -> Facts<'a>,
}

/// What a pair was made of when it was last resolved.
#[derive(Clone, Serialize, Deserialize)]
struct Entry {
    key: Option<Digest>,
    node_type: Arc<str>,
    version: u32,
    params: Params,
    /// Per connection: port, source and output, digests where they are known.
    inputs: Vec<(String, String, Vec<Option<Digest>>)>,
    files: Vec<(PathBuf, Digest)>,
    /// What was wanted of its outputs.
    #[serde(default)]
    wanted: Vec<Reads>,
}

/// Why a pair is another than last time, if it is.
type Change = Option<Box<Why>>;

type Entries = HashMap<String, Entry>;

/// The pages read so far.
#[derive(Default)]
pub(crate) struct Journal {
    pages: Mutex<HashMap<Digest, Page>>,
}

#[derive(Clone, Default)]
struct Page {
    /// Digest of the names and keys on it.
    fingerprint: Option<Digest>,
    entries: Arc<Entries>,
}

/// A page in the making.
struct Draft {
    hasher: blake3::Hasher,
    /// Whether something on it needs a reason.
    asks: bool,
    page: Option<Page>,
}

impl Journal {
    /// The reason of every pair that ran; then the journal is brought up to date.
    pub fn record(&self, course: &Course, disk: Option<&DiskTier>) -> Vec<Change> {
        let mut drafts = self.open(course, disk, |pages, name| pages.remove(name));
        let reasons = reasons(course, &mut drafts);
        let mut pages = self.pages.lock().unwrap_or_else(PoisonError::into_inner);
        for (frame, draft) in drafts {
            let Some(mut page) = draft.page else { continue };
            let fingerprint = Digest(*draft.hasher.finalize().as_bytes());
            page.fingerprint = Some(fingerprint);
            let name = page_name(course.plan, frame);
            if let Some(disk) = disk {
                let mut bytes = fingerprint.0.to_vec();
                let is_written = serde_json::to_writer(&mut bytes, &*page.entries).is_ok()
                    && disk.save_bytes(Table::Journal, &name, &bytes);
                if is_written && frame.is_some() {
                    // There may be thousands of frames, and they can be read again.
                    page.entries = Arc::default();
                }
            }
            pages.insert(name, page);
        }
        reasons
    }

    /// The reason of every pair that would run or be computed again. The journal stays as it is.
    pub fn foresee(&self, course: &Course, disk: Option<&DiskTier>) -> Vec<Change> {
        reasons(course, &mut self.open(course, disk, |pages, name| pages.get(name).cloned()))
    }

    /// The pages that pairs of the course stand on, read as far as something on them changed.
    fn open(
        &self,
        course: &Course,
        disk: Option<&DiskTier>,
        take: impl Fn(&mut HashMap<Digest, Page>, &Digest) -> Option<Page>,
    ) -> BTreeMap<Option<i64>, Draft> {
        let mut drafts = sketch(course);
        let mut pages = self.pages.lock().unwrap_or_else(PoisonError::into_inner);
        for (&frame, draft) in &mut drafts {
            let name = page_name(course.plan, frame);
            let fingerprint = Digest(*draft.hasher.finalize().as_bytes());
            let stands = |page: &Page| page.fingerprint == Some(fingerprint) && !draft.asks;
            if pages.get(&name).is_some_and(stands) {
                continue;
            }
            let page = take(&mut pages, &name).filter(|page| !page.entries.is_empty());
            let page = page.or_else(|| {
                let bytes = disk?.load(Table::Journal, &name)?;
                let (written, json) = bytes.split_at_checked(32)?;
                let mut page = Page { fingerprint: written.try_into().ok().map(Digest), entries: Arc::default() };
                // One that stands is not read any further.
                if !stands(&page) {
                    page.entries = Arc::new(serde_json::from_slice(json).ok()?);
                }
                Some(page)
            });
            match page {
                Some(page) if stands(&page) => _ = pages.insert(name, page),
                page => draft.page = Some(page.unwrap_or_default()),
            }
        }
        drafts
    }
}

/// What stands on which page, as digests of names and keys.
fn sketch(course: &Course) -> BTreeMap<Option<i64>, Draft> {
    let mut drafts: BTreeMap<Option<i64>, Draft> = BTreeMap::new();
    for &at in &course.pairs.order {
        let (pair, facts) = (&course.pairs.list[at], (course.facts)(at));
        let draft = drafts.entry(pair.request.frame).or_insert_with(|| Draft {
            hasher: blake3::Hasher::new(),
            asks: false,
            page: None,
        });
        draft.asks |= facts.outcome != Outcome::Stood;
        if let (Some(key), Some(_)) = (facts.key, facts.record) {
            let id = course.plan.nodes[pair.node].id.as_bytes();
            draft.hasher.update(&(id.len() as u64).to_le_bytes()).update(id).update(&key.0);
        }
    }
    drafts
}

fn page_name(plan: &Plan, frame: Option<i64>) -> Digest {
    let mut hasher = Hasher::new("journal");
    hasher.text(&plan.graph.to_string_lossy()).int(frame.map_or(i128::MIN, i128::from));
    hasher.finish()
}

/// The reasons; the pages are brought up to date on the way.
fn reasons(course: &Course, drafts: &mut BTreeMap<Option<i64>, Draft>) -> Vec<Change> {
    let plan = course.plan;
    let mut changes: Vec<Change> = vec![None; course.pairs.list.len()];
    let mut reasons: Vec<Change> = vec![None; course.pairs.list.len()];
    for &at in &course.pairs.order {
        let pair = &course.pairs.list[at];
        let Some(page) = drafts.get_mut(&pair.request.frame).and_then(|draft| draft.page.as_mut()) else { continue };
        let (node, facts) = (&plan.nodes[pair.node], (course.facts)(at));
        let before = page.entries.get(&*node.id);
        if before.is_none_or(|before| before.key.is_none() || before.key != facts.key) {
            let now = entry(course, at, &facts);
            changes[at] = Some(match before {
                None => {
                    let text = format!("`{}` runs here for the first time", node.id);
                    reason_at(plan, pair.node, None, Reason::FirstRun, text)
                }
                Some(before) => own_change(course, at, before, &now, &changes)
                    .or_else(|| inherited(course.pairs, at, before, &now, &changes))
                    .or_else(|| rewired(plan, pair.node, before, &now))
                    .unwrap_or_else(|| otherwise(plan, pair.node, &now)),
            });
            if facts.record.is_some() {
                Arc::make_mut(&mut page.entries).insert(node.id.to_string(), now);
            }
        }
        if changes[at].is_none() && facts.outcome == Outcome::Ran && facts.trigger.is_none() {
            let text = format!("the record of `{}` is gone from the cache", node.id);
            changes[at] = Some(reason_at(plan, pair.node, None, Reason::Evicted, text));
        }
        reasons[at] = match facts.outcome {
            Outcome::Stood => None,
            Outcome::Ran => triggered(plan, pair.node, facts.trigger).or_else(|| changes[at].clone()),
            Outcome::Recomputed => {
                let text = format!("the result of `{}` is known, but its bytes were not kept", node.id);
                Some(reason_at(plan, pair.node, None, Reason::NotKept, text))
            }
        };
    }
    let known: std::collections::HashSet<&str> = plan.nodes.iter().map(|node| &*node.id).collect();
    for page in drafts.values_mut().filter_map(|draft| draft.page.as_mut()) {
        if page.entries.keys().any(|name| !known.contains(&**name)) {
            Arc::make_mut(&mut page.entries).retain(|name, _| known.contains(&**name));
        }
    }
    reasons
}

/// What a pair is made of now, as far as that is known.
fn entry(course: &Course, at: usize, facts: &Facts) -> Entry {
    let (pair, plan) = (&course.pairs.list[at], course.plan);
    let node = &plan.nodes[pair.node];
    let outline = |from: usize, output: usize| (course.facts)(from).record.map(|record| &record.outputs[output]);
    let links = course.pairs.links(at).iter().zip(&node.links);
    let links: Vec<Option<f64>> = links.map(|(&from, &(_, output))| outline(from, output)?.number).collect();
    let slots = node.slots.iter().zip(course.pairs.slots(at));
    let inputs = slots.map(|(slot, from)| {
        let source = &plan.nodes[slot.source];
        let output = source.node_type.outputs[slot.output].name;
        let digests = from.iter().map(|&from| Some(outline(from, slot.output)?.part(&slot.reads)));
        (slot.port.clone(), format!("{}.{output}", source.id), digests.collect())
    });
    Entry {
        key: facts.key,
        node_type: node.node_type.name.clone(),
        version: node.node_type.version,
        params: plan.params_at(pair.node, pair.request.frame, &links).unwrap_or_else(|_| node.params.json.clone()),
        inputs: inputs.collect(),
        files: facts.files.to_vec(),
        wanted: node.wanted.clone(),
    }
}

/// A reason at a node, or at one of its parameters.
fn reason_at(plan: &Plan, index: usize, param: Option<&str>, code: Reason, text: String) -> Box<Why> {
    let node = &plan.nodes[index];
    let at = Some(plan.place(index, param).to_string());
    Box::new(Why { param: param.map(str::to_owned), code, node: node.id.to_string(), old: None, new: None, at, text })
}

/// A change of the node's own: its type, version, parameters, files, or what is wanted of it.
fn own_change(course: &Course, at: usize, before: &Entry, now: &Entry, changes: &[Change]) -> Change {
    let (plan, index) = (course.plan, course.pairs.list[at].node);
    let node = &plan.nodes[index];
    if (&before.node_type, before.version) != (&now.node_type, now.version) {
        let describe = |entry: &Entry| format!("{} {}", entry.node_type, entry.version);
        let (old, new) = (describe(before), describe(now));
        let text = format!("`{}` was of type {old} and is of type {new}", node.id);
        let why = reason_at(plan, index, None, Reason::Version, text);
        return Some(Box::new(Why { old: Some(old.into()), new: Some(new.into()), ..*why }));
    }
    // A linked parameter's change is that of the node it is linked to.
    let links = node.params.links().into_iter().zip(course.pairs.links(at));
    let linked: Vec<String> = links.filter(|(_, from)| changes[**from].is_some()).map(|(name, _)| name).collect();
    for param in node.node_type.params.iter().filter(|param| !linked.contains(&param.name)) {
        let (old, new) = (before.params.get(&param.name), now.params.get(&param.name));
        let by_content = matches!(param.shape, Shape::Port(_) | Shape::Text(Some(Access::Read)));
        if old != new && !by_content {
            let (old, new) = (old.cloned().unwrap_or_default(), new.cloned().unwrap_or_default());
            let text = format!("`{}` of `{}` was {old} and is {new}", param.name, node.id);
            let why = reason_at(plan, index, Some(&param.name), Reason::Param, text);
            return Some(Box::new(Why { old: Some(old), new: Some(new), ..*why }));
        }
    }
    file_change(plan, index, before, now).or_else(|| wanted_change(plan, index, before, now))
}

/// Its readers look at other parts of an output.
fn wanted_change(plan: &Plan, index: usize, before: &Entry, now: &Entry) -> Change {
    let node = &plan.nodes[index];
    let mut outputs = node.node_type.outputs.iter().zip(before.wanted.iter().zip(&now.wanted));
    let (output, (old, new)) = outputs.find(|(_, (old, new))| old != new)?;
    let text = format!("readers of `{}.{}` looked at {old}, now they look at {new}", node.id, output.name);
    let why = reason_at(plan, index, None, Reason::Wanted, text);
    Some(Box::new(Why { old: Some(old.to_string().into()), new: Some(new.to_string().into()), ..*why }))
}

/// Another path, or another content there.
fn file_change(plan: &Plan, index: usize, before: &Entry, now: &Entry) -> Change {
    let param = read_param(&plan.nodes[index]);
    let Some(((path, new), (old_path, old))) = now.files.iter().zip(&before.files).find(|(new, old)| new.1 != old.1)
    else {
        // A file that cannot be read has no content.
        let (path, _) = before.files.first().filter(|_| now.files.is_empty())?;
        let text = format!("{} cannot be read any more", path.display());
        return Some(reason_at(plan, index, param, Reason::File, text));
    };
    if path != old_path {
        let (old, new) = (old_path.display().to_string(), path.display().to_string());
        let text = format!("`{}` of `{}` was {old} and is {new}", param.unwrap_or_default(), plan.nodes[index].id);
        let why = reason_at(plan, index, param, Reason::Param, text);
        return Some(Box::new(Why { old: Some(old.into()), new: Some(new.into()), ..*why }));
    }
    let why = reason_at(plan, index, param, Reason::File, format!("{} has other content", path.display()));
    Some(Box::new(Why { old: Some(old.hex().into()), new: Some(new.hex().into()), ..*why }))
}

fn read_param(node: &PlanNode) -> Option<&str> {
    node.params.paths.iter().find(|(_, access)| *access == Access::Read).map(|(name, _)| name.as_str())
}

/// The change of the first input that changed, or may, unless it is another input altogether.
fn inherited(pairs: &Pairs, at: usize, before: &Entry, now: &Entry, changes: &[Change]) -> Change {
    for ((slot, new), old) in pairs.slots(at).zip(&now.inputs).zip(&before.inputs) {
        let differs = |answer: usize| new.2[answer].is_none() || old.2.get(answer) != new.2.get(answer);
        let changed = slot.iter().enumerate().find(|(answer, _)| differs(*answer));
        if let Some((_, &from)) = changed {
            return if old.1 == new.1 { changes[from].clone() } else { None };
        }
    }
    pairs.links(at).iter().find_map(|&from| changes[from].clone())
}

/// Its ports are connected to something else.
fn rewired(plan: &Plan, index: usize, before: &Entry, now: &Entry) -> Change {
    let source =
        |entry: &Entry, at: usize| entry.inputs.get(at).map(|(port, source, _)| (port.clone(), source.clone()));
    let count = before.inputs.len().max(now.inputs.len());
    let at = (0..count).find(|&at| source(before, at) != source(now, at))?;
    let (old, new) = (source(before, at), source(now, at));
    let port = new.as_ref().or(old.as_ref()).map(|(port, _)| port.clone()).unwrap_or_default();
    let text = format!("`{port}` of `{}` is fed by something else", plan.nodes[index].id);
    let why = reason_at(plan, index, Some(&port), Reason::Input, text);
    let json = |source: Option<(String, String)>| source.map(|(_, source)| Json::from(source));
    Some(Box::new(Why { old: json(old), new: json(new), ..*why }))
}

/// All that a person may change is as it was: the program is another, or an input's content for no known reason.
fn otherwise(plan: &Plan, index: usize, now: &Entry) -> Box<Why> {
    let id = &plan.nodes[index].id;
    let (code, text) = match now.inputs.is_empty() {
        true => (Reason::Version, format!("`{id}` is made otherwise by this program or on this processor")),
        false => (Reason::Input, format!("an input of `{id}` has other content")),
    };
    reason_at(plan, index, None, code, text)
}

fn triggered(plan: &Plan, index: usize, trigger: Option<&Trigger>) -> Change {
    let (code, text) = match trigger? {
        Trigger::OutputMissing(path) => (Reason::OutputMissing, format!("{} is not there any more", path.display())),
        Trigger::OutputChanged(path) => {
            (Reason::OutputChanged, format!("{} is no longer what `{}` wrote", path.display(), plan.nodes[index].id))
        }
    };
    Some(reason_at(plan, index, None, code, text))
}
