//! What workers do with a pair: resolve it, find its values, compute it, hand it out.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Instant;

use super::context::{Artifact, Context, Control};
use super::memory::{Lease, Purpose};
use super::pairs::Pair;
use super::queue::Task;
use super::report::{From, Status};
use super::schedule::{State, Worker};
use super::store::{Kept, Record, Tier};
use super::{Event, Existing};
use crate::diag::{Code, Fault};
use crate::graph::plan::{Plan, Slot};
use crate::node::{ErrorClass, NodeError, Outputs};
use crate::schema::Access;
use crate::value::{Digest, Given, Outline, Value};

impl Worker<'_> {
    pub(super) fn perform(&self, task: Task, lease: Option<Arc<Lease>>) {
        match (task, lease) {
            (Task::Resolve(at), _) => self.resolve(at),
            (Task::Materialise(at), _) => self.materialise(at),
            (Task::Load(at), Some(lease)) => self.load(at, lease),
            (Task::Compute(at), Some(lease)) => self.compute(at, lease),
            (Task::Deliver(at), Some(lease)) => self.deliver(at, lease),
            (task, None) => unreachable!("{task:?} came without a lease"),
        }
    }

    fn resolve(&self, at: usize) {
        let key = match self.key(at) {
            Ok(key) => key,
            Err(fault) => return self.fail(at, fault),
        };
        let trigger = match self.known(at, &key) {
            Some(record) => match self.engine.changed(&record.artifacts) {
                None => return self.resolved(at, record),
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
        if let Some(record) = self.known(at, &key).filter(|record| self.engine.changed(&record.artifacts).is_none()) {
            self.engine.store.end_work(&key);
            return self.resolved(at, record);
        }
        let mut state = self.shared.lock();
        let pair = &mut state.pairs[at];
        pair.working = true;
        if trigger.is_some() {
            pair.files_mut().trigger = trigger;
        }
        self.gather(&mut state, at);
    }

    fn known(&self, at: usize, key: &Digest) -> Option<Arc<Record>> {
        self.engine.store.record(key).filter(|record| record.fits(&self.node(at).node_type))
    }

    /// The key; files are looked at, and their digests kept.
    fn key(&self, at: usize) -> Result<Digest, Fault> {
        let files = self.engine.files_read(&self.shared.plan, &self.pairs.list[at])?;
        let mut state = self.shared.lock();
        if let Some(key) = state.pairs[at].key.filter(|_| files.is_empty()) {
            return Ok(key);
        }
        let key = self.resolver(&state).key(at, &files, &mut Vec::new())?;
        let pair = &mut state.pairs[at];
        pair.key = Some(key);
        if !files.is_empty() {
            pair.files_mut().read = files;
        }
        Ok(key)
    }

    /// The pair's result was known.
    fn resolved(&self, at: usize, record: Arc<Record>) {
        let from = if self.node(at).node_type.sink { From::File } else { From::Record };
        let mut state = self.shared.lock();
        let mut resolvable = Vec::new();
        self.reuse(&mut state, at, record, from, &mut resolvable);
        self.cascade(&mut state, resolvable);
    }

    /// Targets of a frame whose files are there stand, whatever is in them: nothing is asked for them.
    pub(super) fn skip_standing(&self, state: &mut State, frame: usize) {
        for &at in &self.pairs.frames[frame].1 {
            let standing = self.engine.standing(&self.shared.plan, &self.pairs.list[at]);
            if standing.is_empty() {
                continue;
            }
            let (status, frame) = (Status::Reused, self.pairs.list[at].request.frame);
            self.job.observer.event(Event::Finished { node: &self.node(at).id, frame, status, seconds: 0.0 });
            for (path, bytes) in &standing {
                self.job.observer.event(Event::Output { path, bytes: *bytes, blake3: None, written: false });
            }
            let pair = &mut state.pairs[at];
            (pair.status, pair.from) = (Some(status), Some(From::File));
            pair.files_mut().standing = standing;
            self.dismiss(state, at);
            self.close_target(state, at);
        }
    }

    /// Recomputing takes no work on the key: a twin that waits for this very pair's inputs may hold it.
    fn materialise(&self, at: usize) {
        let record = self.shared.lock().pairs[at].record.clone().expect("only resolved pairs are asked for values");
        let store = &self.engine.store;
        if let Some(values) = store.values_at_hand(&record) {
            return self.found(at, values, From::Memory);
        }
        let is_on_disk = record.outputs.iter().all(|outline| store.has_value(outline).is_some());
        let mut state = self.shared.lock();
        match is_on_disk {
            true => state.push(Task::Load(at)),
            false => self.recompute(&mut state, at),
        }
    }

    fn load(&self, at: usize, lease: Arc<Lease>) {
        let record = self.shared.lock().pairs[at].record.clone().expect("only resolved pairs are loaded");
        let control = PairControl::new(self, at, lease);
        if let Err(error) = control.take(record.value_bytes().into(), Purpose::Planes) {
            return match control.starved.into_inner() {
                Some(_) => self.shared.lock().starved.push(Task::Load(at)),
                None => self.fail(at, node_fault(error)),
            };
        }
        let load = |outline: &Outline| self.engine.store.value(outline, &control.lease);
        let loaded: Option<Vec<_>> = self.engine.pool.install(|| record.outputs.iter().map(load).collect());
        match loaded {
            Some(values) => {
                let from_disk = values.iter().any(|(_, tier)| *tier == Tier::Disk);
                let values = values.into_iter().map(|(kept, _)| kept).collect();
                self.found(at, values, if from_disk { From::Disk } else { From::Memory });
            }
            None => self.recompute(&mut self.shared.lock(), at),
        }
    }

    fn recompute(&self, state: &mut State, at: usize) {
        state.pairs[at].recompute = true;
        for &input in self.pairs.inputs(at) {
            state.pairs[input].holds += 1;
        }
        self.gather(state, at);
    }

    fn found(&self, at: usize, values: Vec<Arc<Kept>>, from: From) {
        let mut state = self.shared.lock();
        // Where it came from first: after that it is in memory.
        if state.pairs[at].from == Some(From::Record) {
            state.pairs[at].from = Some(from);
        }
        self.hold(&mut state, at, values);
    }

    fn deliver(&self, at: usize, lease: Arc<Lease>) {
        let values = {
            let mut state = self.shared.lock();
            let Some(values) = state.pairs[at].values.clone() else {
                // They were let go of since.
                state.pairs[at].handed_out = false;
                return self.want(&mut state, at);
            };
            values
        };
        let control = PairControl::new(self, at, lease);
        let pair = &self.pairs.list[at];
        let values: Vec<Value> = values.iter().map(|kept| kept.value.clone()).collect();
        let delivery = super::Delivery {
            node: pair.node,
            frame: pair.request.frame,
            values: &values,
            reserve: &|bytes| match control.is_stopped() {
                true => Err(NodeError::new(ErrorClass::Cancelled, "stopped")),
                false => control.reserve(bytes, Purpose::Other),
            },
        };
        let delivered = self.engine.pool.install(|| (self.job.on_values)(delivery));
        let starved = control.starved.into_inner();
        let mut state = self.shared.lock();
        match delivered {
            Err(_) if let Some(needed) = starved => {
                state.pairs[at].handing_out = needed;
                return state.starved.push(Task::Deliver(at));
            }
            Err(fault) if fault.code == Code::Cancelled && self.job.cancel.is_cancelled() => return,
            Err(fault) => {
                self.add_fault(&mut state, at, fault);
                state.pairs[at].status = Some(Status::Failed);
            }
            Ok(()) => {}
        }
        self.release(&mut state, at);
        self.close_target(&mut state, at);
    }

    /// What the node sees of its inputs, as far as it reads them.
    fn given(&self, at: usize) -> Option<Vec<Vec<Given>>> {
        let state = self.shared.lock();
        let given = |slot: &Slot, from: usize| {
            let input = &state.pairs[from];
            let outline = &input.record.as_ref().expect("inputs are resolved").outputs[slot.output];
            slot.reads.without_value(outline).or_else(|| {
                let values = input.values.as_ref()?;
                Some(slot.reads.restrict(&values[slot.output].value))
            })
        };
        let slots = self.node(at).slots.iter().zip(self.pairs.slots(at));
        slots.map(|(slot, from)| from.iter().map(|&from| given(slot, from)).collect()).collect()
    }

    fn compute(&self, at: usize, lease: Arc<Lease>) {
        let (pair, node) = (&self.pairs.list[at], self.node(at));
        let params = match self.resolver(&self.shared.lock()).params(at) {
            Ok(params) => params,
            Err(fault) => return self.fail(at, fault),
        };
        let Some(inputs) = self.given(at) else {
            // They were let go of since.
            return self.gather(&mut self.shared.lock(), at);
        };
        if node.node_type.sink {
            let written = self.shared.plan.files_at(pair.node, pair.request.frame, Access::Write);
            self.engine.sweep(written.map(|(_, path)| path));
        }
        let files = self.shared.lock().pairs[at].files_read().to_vec();
        let control = PairControl::new(self, at, lease);
        let context = Context {
            inputs: &inputs,
            request: &pair.request,
            frame: pair.request.frame.filter(|_| node.node_type.reads_frame),
            files: &files,
            outputs: node.node_type.outputs,
            wanted: &node.wanted,
            io: &*self.engine.io,
            control: &control,
            existing: self.job.existing,
            artifacts: Mutex::default(),
        };
        self.job.observer.event(Event::Started { node: &node.id, frame: pair.request.frame });
        let computed = catch_unwind(AssertUnwindSafe(|| {
            self.engine.pool.install(|| {
                let start = Instant::now();
                let instance = node.node_type.make(&serde_json::Value::Object(params));
                instance.check()?;
                let outputs = instance.compute(&context)?;
                assert_eq!(outputs.values.len(), node.node_type.outputs.len(), "one value per declared output");
                let outlines: Vec<Outline> = outputs.values.iter().map(Outline::of).collect();
                Ok::<_, NodeError>((outputs, outlines, start.elapsed().as_secs_f64()))
            })
        }));
        let artifacts = context.artifacts.into_inner().unwrap_or_else(PoisonError::into_inner);
        // What it was given is not held for longer than it computes.
        drop(inputs);
        let starved = control.starved.into_inner();
        self.learn(at, starved.unwrap_or(0).max(control.lease.asked()));
        match computed {
            Ok(Ok((outputs, outlines, seconds))) => {
                self.computed(at, outputs, outlines, artifacts, seconds, &control.lease);
            }
            Ok(Err(_)) if starved.is_some() => self.shared.lock().starved.push(Task::Compute(at)),
            Ok(Err(error)) => self.fail(at, node_fault(error)),
            Err(panic) => self.fail(at, self.panic_fault(at, panic)),
        }
    }

    fn learn(&self, at: usize, asked: u64) {
        let mut state = self.shared.lock();
        let frame = state.pairs[at].frame;
        state.footprints.learn(self.pairs.list[at].node, frame, asked);
        state.pairs[at].peak = state.pairs[at].peak.max(asked);
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

    fn computed(
        &self,
        at: usize,
        outputs: Outputs,
        outlines: Vec<Outline>,
        artifacts: Vec<Artifact>,
        seconds: f64,
        lease: &Lease,
    ) {
        let (key, known) = {
            let mut state = self.shared.lock();
            let pair = &mut state.pairs[at];
            pair.seconds += seconds;
            (pair.key.expect("computed with a key"), if pair.recompute { pair.record.clone() } else { None })
        };
        if let Some(known) = &known
            && let Some(output) = (0..outlines.len()).find(|&i| outlines[i].digest != known.outputs[i].digest)
        {
            return self.fail(at, self.nondeterministic(at, output));
        }
        let Outputs { values, stats, warnings } = outputs;
        let insert = |(outline, value)| self.engine.store.insert_value(outline, value, seconds, lease);
        let kept: Vec<Arc<Kept>> = self.engine.pool.install(|| outlines.iter().zip(values).map(insert).collect());
        let is_recompute = known.is_some();
        let record = known.unwrap_or_else(|| {
            let record = Arc::new(Record { outputs: outlines, artifacts, stats, warnings, seconds });
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
        self.hold(&mut state, at, kept);
        if !is_recompute {
            let mut resolvable = Vec::new();
            self.publish(&mut state, at, record, &mut resolvable);
            self.cascade(&mut state, resolvable);
            state.freed.push(key);
        }
        self.release_inputs(&mut state, at);
    }

    fn nondeterministic(&self, at: usize, output: usize) -> Fault {
        let node = self.node(at);
        let name = node.node_type.outputs[output].name;
        let message = format!("`{}` gave another `{name}` than before from the same inputs", node.id);
        let hint = format!("{} is not deterministic: its results cannot be trusted to repeat", node.node_type.name);
        Fault::new(Code::Nondeterministic, message).hint(hint)
    }

    /// Tells of a pair, before its frame may be told of.
    pub(super) fn finished(&self, at: usize, status: Status, seconds: f64, record: &Record) {
        let (pair, node) = (&self.pairs.list[at], self.node(at));
        self.job.observer.event(Event::Finished { node: &node.id, frame: pair.request.frame, status, seconds });
        if status != Status::Recomputed {
            let warnings = record.warnings.iter().map(|text| warning(&self.shared.plan, pair, text));
            warnings.for_each(|warning| self.job.observer.event(Event::Warning(&warning)));
        }
        let written = status == Status::Executed && self.job.existing != Existing::Verify;
        for Artifact { path, bytes, blake3 } in &record.artifacts {
            self.job.observer.event(Event::Output { path, bytes: *bytes, blake3: Some(*blake3), written });
        }
    }
}

/// What a pair's node warns of.
pub(super) fn warning(plan: &Plan, pair: &Pair, text: &str) -> Fault {
    let mut warning = Fault::new(Code::Doubtful, text).node(&plan.nodes[pair.node].id);
    warning.frame = pair.request.frame;
    warning.place(Some(plan.place(pair.node, None)))
}

fn node_fault(error: NodeError) -> Fault {
    let mut fault = Fault::new(error.class.into(), error.message).hint(error.hint);
    fault.parameter = error.parameter.map(str::to_owned);
    fault
}

/// What a pair at work asks of the run.
pub(super) struct PairControl<'a> {
    pub worker: &'a Worker<'a>,
    pub at: usize,
    pub lease: Arc<Lease>,
    /// The memory it must begin with next time, if it was told to try again when there is some.
    pub starved: OnceLock<u64>,
}

impl<'a> PairControl<'a> {
    fn new(worker: &'a Worker<'a>, at: usize, lease: Arc<Lease>) -> Self {
        Self { worker, at, lease, starved: OnceLock::new() }
    }
}

impl Control for PairControl<'_> {
    fn progress(&self, part: f64) {
        let frame = self.worker.pairs.list[self.at].request.frame;
        self.worker.job.observer.event(Event::Progress { node: &self.worker.node(self.at).id, frame, part });
    }

    fn is_stopped(&self) -> bool {
        self.worker.job.cancel.is_cancelled()
    }

    fn reserve(&self, bytes: u128, purpose: Purpose) -> Result<(), NodeError> {
        self.take(bytes, purpose)
    }
}
