//! What workers do with a pair: resolve it, find its values, compute it, hand it out.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use super::Event;
use super::context::{Artifact, Context, Control, cannot_read};
use super::explain::{Evidence, Trigger};
use super::key::Action;
use super::report::{From, Status};
use super::schedule::{Task, Worker};
use super::store::{Record, Tier};
use crate::diag::{Code, Fault};
use crate::graph::plan::{PlanNode, Slot};
use crate::node::{NodeError, Outputs};
use crate::schema::Access;
use crate::value::{Digest, Given, Outline, Value};

impl Worker<'_> {
    pub(super) fn perform(&self, task: Task) {
        match task {
            Task::Resolve(at) => self.resolve(at),
            Task::Materialise(at) => self.materialise(at),
            Task::Compute(at) => self.compute(at),
            Task::Deliver(at) => self.deliver(at),
        }
    }

    pub(super) fn node(&self, at: usize) -> &PlanNode {
        &self.shared.plan.nodes[self.shared.pairs.list[at].node]
    }

    fn resolve(&self, at: usize) {
        let (key, evidence) = match self.evidence(at) {
            Ok(found) => found,
            Err(fault) => return self.fail(at, fault),
        };
        let trigger = match self.known(at, &key) {
            Some(record) => match self.artifacts_changed(&record) {
                None => return self.resolved(at, key, evidence, record),
                trigger => trigger,
            },
            None => None,
        };
        let shared = self.shared.clone();
        self.shared.lock().parked += 1;
        if !self.engine.store.take_work(key, move || shared.unpark(Task::Resolve(at))) {
            return;
        }
        self.shared.lock().parked -= 1;
        // Somebody may have finished it since it was looked up.
        if let Some(record) = self.known(at, &key).filter(|record| self.artifacts_changed(record).is_none()) {
            self.engine.store.end_work(&key);
            return self.resolved(at, key, evidence, record);
        }
        let mut state = self.shared.lock();
        let pair = &mut state.pairs[at];
        (pair.key, pair.evidence, pair.trigger, pair.working) = (Some(key), Some(evidence), trigger, true);
        self.gather(&mut state, at);
    }

    /// The record of a key, if it can be this node's.
    fn known(&self, at: usize, key: &Digest) -> Option<Arc<Record>> {
        let outputs = self.node(at).node_type.outputs.len();
        self.engine.store.record(key).filter(|record| record.outputs.len() == outputs)
    }

    /// The key, and what it was made of.
    fn evidence(&self, at: usize) -> Result<(Digest, Evidence), Fault> {
        let (pair, node) = (&self.shared.pairs.list[at], self.node(at));
        let (links, inputs) = {
            let state = self.shared.lock();
            let record = |pair: usize| state.pairs[pair].record.as_ref().expect("inputs are resolved first");
            let links: Vec<f64> = (pair.links.iter().zip(&node.links))
                .map(|(&from, &(_, output))| record(from).outputs[output].number.unwrap_or(f64::NAN))
                .collect();
            let inputs: Vec<Vec<Digest>> = (node.slots.iter().zip(&pair.slots))
                .map(|(slot, from)| from.iter().map(|&p| record(p).outputs[slot.output].part(&slot.reads)).collect())
                .collect();
            (links, inputs)
        };
        let params = self.shared.plan.params_at(pair.node, pair.request.frame, &links)?;
        let mut files = Vec::new();
        for (name, access) in &node.params.paths {
            if *access == Access::Read {
                let path = PathBuf::from(params[name].as_str().unwrap_or_default());
                let digest = self.engine.files.digest(&path, &*self.engine.io, self.engine.store.disk.as_ref());
                let digest = digest
                    .map_err(|error| Fault::new(Code::InputUnreadable, cannot_read(&path, &error)).parameter(name))?;
                files.push((path, digest));
            }
        }
        let digests: Vec<Digest> = files.iter().map(|(_, digest)| *digest).collect();
        let action = Action { node, request: &pair.request, params: &params, inputs: &inputs, files: &digests };
        Ok((action.key(), Evidence { params, inputs, files }))
    }

    /// Whether a sink's files are no longer what it wrote.
    fn artifacts_changed(&self, record: &Record) -> Option<Trigger> {
        record.artifacts.iter().find_map(|artifact| {
            match self.engine.files.digest(&artifact.path, &*self.engine.io, self.engine.store.disk.as_ref()) {
                Ok(digest) if digest == artifact.blake3 => None,
                Ok(_) => Some(Trigger::OutputChanged(artifact.path.clone())),
                Err(_) => Some(Trigger::OutputMissing(artifact.path.clone())),
            }
        })
    }

    /// The pair's result was known.
    fn resolved(&self, at: usize, key: Digest, evidence: Evidence, record: Arc<Record>) {
        self.finished(at, Status::Reused, 0.0, &record);
        let mut state = self.shared.lock();
        let is_sink = self.node(at).node_type.sink;
        let pair = &mut state.pairs[at];
        (pair.key, pair.evidence, pair.status) = (Some(key), Some(evidence), Some(Status::Reused));
        pair.from = Some(if is_sink { From::File } else { From::Record });
        self.publish(&mut state, at, record);
        self.release_inputs(&mut state, at);
    }

    /// Recomputing takes no work on the key: a twin that waits for this very pair's inputs may hold it.
    fn materialise(&self, at: usize) {
        let record = self.shared.lock().pairs[at].record.clone().expect("only resolved pairs are asked for values");
        if let Some((values, from)) = self.engine.pool.install(|| self.load(&record)) {
            return self.loaded(at, values, from);
        }
        let mut state = self.shared.lock();
        state.pairs[at].recompute = true;
        for input in self.shared.pairs.list[at].inputs() {
            state.pairs[input].holds += 1;
        }
        self.gather(&mut state, at);
    }

    fn load(&self, record: &Record) -> Option<(Vec<Value>, From)> {
        let mut from = From::Memory;
        let mut values = Vec::with_capacity(record.outputs.len());
        for outline in &record.outputs {
            let (value, tier) = self.engine.store.value(outline)?;
            if tier == Tier::Disk {
                from = From::Disk;
            }
            values.push(value);
        }
        Some((values, from))
    }

    fn loaded(&self, at: usize, values: Vec<Value>, from: From) {
        let mut state = self.shared.lock();
        // Where it came from first: after that it is in memory.
        if state.pairs[at].from == Some(From::Record) {
            state.pairs[at].from = Some(from);
        }
        self.hold(&mut state, at, values);
    }

    fn deliver(&self, at: usize) {
        let values = self.shared.lock().pairs[at].values.clone().expect("held for delivery");
        let pair = &self.shared.pairs.list[at];
        let delivered = self.engine.pool.install(|| (self.job.on_values)(pair.node, pair.request.frame, &values));
        let mut state = self.shared.lock();
        if let Err(fault) = delivered {
            self.add_fault(&mut state, at, fault);
            state.pairs[at].status = Some(Status::Failed);
        }
        self.release(&mut state, at);
        self.close_target(&mut state, at);
    }

    fn compute(&self, at: usize) {
        let (pair, node) = (&self.shared.pairs.list[at], self.node(at));
        let (inputs, params, files) = {
            let state = self.shared.lock();
            let given = |slot: &Slot, from: usize| {
                let input = &state.pairs[from];
                let outline = &input.record.as_ref().expect("inputs are resolved").outputs[slot.output];
                slot.reads.without_value(outline).unwrap_or_else(|| {
                    let values = input.values.as_ref().expect("inputs are held");
                    slot.reads.restrict(&values[slot.output])
                })
            };
            let inputs: Vec<Vec<Given>> = (node.slots.iter().zip(&pair.slots))
                .map(|(slot, from)| from.iter().map(|&from| given(slot, from)).collect())
                .collect();
            let evidence = state.pairs[at].evidence.as_ref().expect("resolved before it computes");
            (inputs, evidence.params.clone(), evidence.files.clone())
        };
        let control = PairControl { worker: self, at };
        let context = Context {
            inputs: &inputs,
            request: &pair.request,
            frame: pair.request.frame.filter(|_| node.node_type.reads_frame),
            files: &files,
            io: &*self.engine.io,
            control: &control,
            budget: self.engine.memory,
            allocated: AtomicU64::new(0),
            artifacts: Mutex::default(),
        };
        self.job.observer.event(Event::Started { node: &node.id, frame: pair.request.frame });
        let computed = catch_unwind(AssertUnwindSafe(|| {
            self.engine.pool.install(|| {
                let start = Instant::now();
                let instance = node.node_type.make(&serde_json::Value::Object(params));
                let outputs = instance.compute(&context)?;
                assert_eq!(outputs.values.len(), node.node_type.outputs.len(), "one value per declared output");
                let outlines: Vec<Outline> = outputs.values.iter().map(Outline::of).collect();
                Ok::<_, NodeError>((outputs, outlines, start.elapsed().as_secs_f64()))
            })
        }));
        let asked = context.allocated.into_inner();
        {
            let mut state = self.shared.lock();
            state.pairs[at].peak_bytes = state.pairs[at].peak_bytes.max(asked);
        }
        let artifacts = context.artifacts.into_inner().unwrap_or_else(PoisonError::into_inner);
        match computed {
            Ok(Ok((outputs, outlines, seconds))) => self.computed(at, outputs, outlines, artifacts, seconds),
            Ok(Err(error)) => self.fail(at, node_fault(error)),
            Err(panic) => self.fail(at, self.panic_fault(at, panic)),
        }
    }

    /// The fault for a panic on the way of a pair.
    pub(super) fn panic_fault(&self, at: usize, panic: Box<dyn std::any::Any + Send>) -> Fault {
        let node = self.node(at);
        let text = (panic.downcast_ref::<&str>().map(|text| text.to_string()))
            .or_else(|| panic.downcast_ref::<String>().cloned())
            .unwrap_or_default();
        let message = format!("`{}` of type {} panicked: {text}", node.id, node.node_type.name);
        Fault::new(Code::Panic, message).hint("this is a bug; please report it with the graph".to_owned())
    }

    fn computed(&self, at: usize, outputs: Outputs, outlines: Vec<Outline>, artifacts: Vec<Artifact>, seconds: f64) {
        let node = self.node(at);
        let (key, known) = {
            let mut state = self.shared.lock();
            let pair = &mut state.pairs[at];
            pair.seconds += seconds;
            (pair.key.expect("computed with a key"), if pair.recompute { pair.record.clone() } else { None })
        };
        if let Some(known) = &known
            && let Some(output) = (0..outlines.len()).find(|&i| outlines[i].digest != known.outputs[i].digest)
        {
            let name = node.node_type.outputs[output].name;
            let message = format!("`{}` gave another `{name}` than before from the same inputs", node.id);
            let hint = format!("{} is not deterministic: its results cannot be trusted to repeat", node.node_type.name);
            return self.fail(at, Fault::new(Code::Nondeterministic, message).hint(hint));
        }
        self.engine.pool.install(|| {
            for (outline, value) in outlines.iter().zip(&outputs.values) {
                self.engine.store.insert_value(outline, value, seconds);
            }
        });
        let is_recompute = known.is_some();
        let record = known.unwrap_or_else(|| {
            let record = Arc::new(Record { outputs: outlines, artifacts, stats: outputs.stats, seconds });
            self.engine.store.insert_record(key, record.clone());
            record
        });
        let status = if is_recompute { Status::Recomputed } else { Status::Executed };
        self.finished(at, status, seconds, &record);
        let mut state = self.shared.lock();
        let pair = &mut state.pairs[at];
        (pair.working, pair.recompute, pair.from) = (false, false, None);
        // What ran first and was computed again for want of memory counts as executed.
        if pair.status != Some(Status::Executed) {
            pair.status = Some(status);
        }
        self.hold(&mut state, at, outputs.values);
        if !is_recompute {
            self.publish(&mut state, at, record);
            state.freed.push(key);
        }
        self.release_inputs(&mut state, at);
    }

    /// Tells of a pair, before its frame may be told of.
    fn finished(&self, at: usize, status: Status, seconds: f64, record: &Record) {
        let (pair, node) = (&self.shared.pairs.list[at], self.node(at));
        self.job.observer.event(Event::Finished { node: &node.id, frame: pair.request.frame, status, seconds });
        for artifact in &record.artifacts {
            self.job.observer.event(Event::Output { artifact, written: status == Status::Executed });
        }
    }
}

fn node_fault(error: NodeError) -> Fault {
    let mut fault = Fault::new(error.class.into(), error.message).hint(error.hint);
    fault.parameter = error.parameter.map(str::to_owned);
    fault
}

struct PairControl<'a> {
    worker: &'a Worker<'a>,
    at: usize,
}

impl Control for PairControl<'_> {
    fn progress(&self, part: f64) {
        let frame = self.worker.shared.pairs.list[self.at].request.frame;
        self.worker.job.observer.event(Event::Progress { node: &self.worker.node(self.at).id, frame, part });
    }

    fn is_stopped(&self) -> bool {
        self.worker.job.cancel.is_cancelled()
    }
}
