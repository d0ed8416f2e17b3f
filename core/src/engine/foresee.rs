//! What a run would do, and why, without doing it.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use serde::Serialize;

use super::explain::{Course, Facts, Outcome, Trigger};
use super::report::{From, Why};
use super::resolve::Resolver;
use super::store::Record;
use super::{Engine, Existing};
use crate::diag::Fault;
use crate::graph::plan::Plan;
use crate::value::Digest;

/// What would become of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// It runs.
    Runs,
    /// An input will be computed and may come out as before.
    MayRun,
    /// Its result is known, or nobody needs it.
    Reused,
}

/// One pair of a run to come.
#[derive(Clone, Debug, Serialize)]
pub struct PairVerdict {
    /// The node's name.
    pub node: Arc<str>,
    /// Its type.
    #[serde(rename = "type")]
    pub node_type: Arc<str>,
    /// The frame; none of what is the same for all.
    pub frame: Option<i64>,
    /// What would become of it.
    pub verdict: Verdict,
    /// Where a known result comes from.
    pub from: Option<From>,
    /// Why it would run; none where it would not.
    pub why: Option<Box<Why>>,
}

/// What a run would do; the form of `warploom explain --format json`.
#[derive(Debug, Serialize)]
pub struct Explanation {
    /// Version of this form.
    pub schema: u32,
    /// The graph file.
    pub graph: PathBuf,
    /// Frames asked for.
    pub frames: Vec<i64>,
    /// Every pair in the upstream closure of the targets, inputs first.
    pub nodes: Vec<PairVerdict>,
    /// What is known to go wrong already, such as inputs that are missing.
    pub faults: Vec<Fault>,
}

/// What is known of a pair.
struct Foreseen {
    verdict: Verdict,
    key: Option<Digest>,
    record: Option<Arc<Record>>,
    from: Option<From>,
    files: Vec<(PathBuf, Digest)>,
    trigger: Option<Trigger>,
}

impl Foreseen {
    fn new(verdict: Verdict, files: Vec<(PathBuf, Digest)>) -> Self {
        Self { verdict, key: None, record: None, from: None, files, trigger: None }
    }
}

impl Engine {
    /// What [`Engine::run`] would do. Reads and hashes inputs, computes nothing, writes nothing but memos.
    pub fn explain(&self, plan: &Arc<Plan>, existing: Existing) -> Explanation {
        let pairs = plan.pairs();
        let (mut foreseen, faults) = self.foresee(plan, existing);
        let facts = |at: usize| {
            let pair = foreseen[at].as_ref().expect("every pair is looked at");
            Facts {
                outcome: if pair.verdict == Verdict::Reused { Outcome::Stood } else { Outcome::Ran },
                key: pair.key,
                record: pair.record.as_deref(),
                files: &pair.files,
                trigger: pair.trigger.as_ref(),
            }
        };
        let course = Course { plan, pairs, facts: &facts };
        let mut reasons = self.journal.foresee(&course, self.store.disk.as_ref());
        let verdict = |&at: &usize| {
            let node = &plan.nodes[pairs.list[at].node];
            let pair = foreseen[at].take().expect("every pair is looked at");
            PairVerdict {
                node: node.id.clone(),
                node_type: node.node_type.name.clone(),
                frame: pairs.list[at].request.frame,
                verdict: pair.verdict,
                from: pair.from,
                why: reasons[at].take(),
            }
        };
        let nodes = pairs.order.iter().map(verdict).collect();
        Explanation { schema: 1, graph: plan.graph.clone(), frames: plan.frames.clone(), nodes, faults }
    }

    fn foresee(&self, plan: &Plan, existing: Existing) -> (Vec<Option<Foreseen>>, Vec<Fault>) {
        let pairs = plan.pairs();
        let needed = self.needed(plan, existing);
        let mut foreseen: Vec<Option<Foreseen>> = (0..pairs.list.len()).map(|_| None).collect();
        let mut first_of_key: HashMap<Digest, usize> = HashMap::new();
        let mut faults = Vec::new();
        for &at in &pairs.order {
            let looked = match needed[at] {
                true => self.look(plan, &foreseen, at),
                false => Ok(Foreseen::new(Verdict::Reused, Vec::new())),
            };
            let mut looked = looked.unwrap_or_else(|fault| {
                faults.push(placed(plan, at, fault));
                Foreseen::new(Verdict::MayRun, Vec::new())
            });
            if !needed[at] {
                looked.from =
                    (existing == Existing::Skip && pairs.frame_of_target.contains_key(&at)).then_some(From::File);
            }
            if let (Verdict::Runs, Some(key)) = (looked.verdict, looked.key)
                && let Some(twin) = first_of_key.insert(key, at)
            {
                // One of the two runs, whichever comes first.
                looked.verdict = Verdict::MayRun;
                if let Some(twin) = &mut foreseen[twin] {
                    twin.verdict = Verdict::MayRun;
                }
            }
            foreseen[at] = Some(looked);
        }
        (foreseen, faults)
    }

    /// Which pairs a run asks for at all.
    fn needed(&self, plan: &Plan, existing: Existing) -> Vec<bool> {
        let pairs = plan.pairs();
        let mut needed = vec![existing != Existing::Skip; pairs.list.len()];
        if existing == Existing::Skip {
            let targets = pairs.frames.iter().flat_map(|(_, targets)| targets).copied();
            let mut stack: Vec<usize> = targets.filter(|&at| self.standing(plan, &pairs.list[at]).is_empty()).collect();
            while let Some(at) = stack.pop() {
                if !std::mem::replace(&mut needed[at], true) {
                    stack.extend(pairs.inputs(at));
                }
            }
        }
        needed
    }

    fn look(&self, plan: &Plan, foreseen: &[Option<Foreseen>], at: usize) -> Result<Foreseen, Fault> {
        let (pairs, pair) = (plan.pairs(), &plan.pairs().list[at]);
        let files = self.files_read(plan, pair)?;
        let known = |at: usize| foreseen[at].as_ref().and_then(|input| input.record.as_deref());
        if pairs.inputs(at).iter().any(|&input| known(input).is_none()) {
            return Ok(Foreseen::new(Verdict::MayRun, files));
        }
        let record = |at: usize| known(at).expect("all inputs are known");
        let key = Resolver { plan, pairs, record }.key(at, &files, &mut Vec::new())?;
        let node_type = &plan.nodes[pair.node].node_type;
        let known = self.store.record(&key).filter(|record| record.fits(node_type));
        let trigger = known.as_ref().and_then(|record| self.changed(&record.artifacts));
        let stands = known.is_some() && trigger.is_none();
        let from = if node_type.sink { From::File } else { From::Record };
        Ok(Foreseen {
            verdict: if stands { Verdict::Reused } else { Verdict::Runs },
            key: Some(key),
            record: known.filter(|_| stands),
            from: stands.then_some(from),
            files,
            trigger,
        })
    }
}

fn placed(plan: &Plan, at: usize, mut fault: Fault) -> Fault {
    let pair = &plan.pairs().list[at];
    fault.node.get_or_insert_with(|| plan.nodes[pair.node].id.to_string());
    fault.frame = pair.request.frame;
    fault.place.get_or_insert_with(|| plan.place(pair.node, fault.parameter.as_deref()));
    fault
}
