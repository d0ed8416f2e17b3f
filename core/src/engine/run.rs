//! Runs a plan: every pair whose result is not known and is needed, once, side by side.
//!
//! A pair goes through two stages. It is *resolved* when its outlines are known: its key is made from its inputs'
//! outlines and looked up, and only if it is unknown does it compute. Its *values* are gathered only for pairs that
//! compute; they come from memory, from disk, or by recomputing. Nothing here recurses over the graph and no worker
//! blocks on another: a pair that waits is parked and pushed again by whoever it waits for.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::context::{Artifact, Context, Control, cannot_read};
use super::explain::{Evidence, Trigger};
use super::key::Action;
use super::pairs::Pairs;
use super::report::{From, Status};
use super::store::{Record, Tier};
use super::{Engine, Event, Job};
use crate::diag::{Code, Fault};
use crate::graph::plan::{Plan, PlanNode};
use crate::node::{NodeError, Outputs, Request};
use crate::schema::Access;
use crate::value::{Digest, Outline, Value};

/// One run: what all workers share, and what a waker from another run may reach.
pub(crate) struct Shared {
    pub plan: Arc<Plan>,
    pub pairs: Pairs,
    state: Mutex<State>,
    wake: Condvar,
}

pub(crate) struct State {
    pub pairs: Vec<PairState>,
    pub faults: Vec<Fault>,
    ready: Vec<Task>,
    /// Tasks at work.
    running: usize,
    /// Pairs that wait for another pair with the same key, here or in another run.
    parked: usize,
    /// Frames admitted so far.
    admitted: usize,
    /// Targets per frame that are not done.
    open_targets: Vec<usize>,
    /// Frames admitted and not done.
    open_frames: usize,
    stopped: bool,
}

#[derive(Clone, Copy, Debug)]
enum Task {
    /// Make the key and look it up.
    Resolve(usize),
    /// Find the values of a resolved pair.
    Materialise(usize),
    /// Run the node; all its inputs' values are held.
    Compute(usize),
    /// Hand a target's values out.
    Deliver(usize),
}

/// What is known of a pair so far.
#[derive(Default)]
pub(crate) struct PairState {
    admitted: bool,
    /// Input edges whose pairs are not resolved.
    unresolved: usize,
    /// Inputs whose values it waits for.
    awaited: usize,
    /// Pairs that wait for this one's values.
    waiters: Vec<usize>,
    /// Pairs that may still want this one's values, once per edge.
    holds: usize,
    values: Option<Vec<Value>>,
    /// Whether its values are being looked for.
    materialising: bool,
    /// Whether this pair holds the work on its key.
    working: bool,
    /// Whether what it computes is known already.
    recompute: bool,
    done: bool,
    pub key: Option<Digest>,
    pub record: Option<Arc<Record>>,
    pub status: Option<Status>,
    pub from: Option<From>,
    pub seconds: f64,
    pub evidence: Option<Evidence>,
    pub trigger: Option<Trigger>,
}

impl Shared {
    /// `deliver`: nodes whose values are handed out.
    pub fn new(plan: Arc<Plan>, pairs: Pairs, deliver: &[usize]) -> Self {
        let mut states: Vec<PairState> = (pairs.list.iter())
            .map(|pair| PairState {
                unresolved: pair.inputs().count(),
                holds: pair.consumers.len(),
                ..PairState::default()
            })
            .collect();
        // What is handed out is held until then, as if by one consumer more.
        let targets = pairs.frames.iter().flat_map(|(_, targets)| targets);
        targets.filter(|&&at| deliver.contains(&pairs.list[at].node)).for_each(|&at| states[at].holds += 1);
        let open_targets = pairs.frames.iter().map(|(_, targets)| targets.len()).collect();
        let state = State {
            pairs: states,
            faults: Vec::new(),
            ready: Vec::new(),
            running: 0,
            parked: 0,
            admitted: 0,
            open_targets,
            open_frames: 0,
            stopped: false,
        };
        Self { plan, pairs, state: Mutex::new(state), wake: Condvar::new() }
    }

    pub fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn unpark(&self, task: Task) {
        let mut state = self.lock();
        state.parked -= 1;
        state.ready.push(task);
        drop(state);
        self.wake.notify_all();
    }
}

/// A worker's view of the run.
pub(crate) struct Worker<'a> {
    pub engine: &'a Engine,
    pub job: &'a Job<'a>,
    pub shared: &'a Arc<Shared>,
    /// Frame number within the run per target pair.
    pub frame_of_target: &'a std::collections::HashMap<usize, usize>,
}

impl Worker<'_> {
    /// Takes tasks until the run is over.
    pub fn work(&self) {
        let mut state = self.shared.lock();
        loop {
            self.admit(&mut state);
            if self.job.cancel.is_cancelled() {
                state.stopped = true;
            }
            let task = if state.stopped { None } else { state.ready.pop() };
            match task {
                Some(task) => {
                    state.running += 1;
                    drop(state);
                    self.perform(task);
                    state = self.shared.lock();
                    state.running -= 1;
                    self.shared.wake.notify_all();
                }
                None if state.running == 0 && (state.stopped || state.parked == 0 && state.ready.is_empty()) => break,
                // A cancel sets no flag that wakes: look again now and then.
                None => {
                    let pause = std::time::Duration::from_millis(20);
                    state = self.shared.wake.wait_timeout(state, pause).unwrap_or_else(PoisonError::into_inner).0;
                }
            }
        }
        drop(state);
        self.shared.wake.notify_all();
    }

    /// Lets new frames in while fewer than the window are open.
    fn admit(&self, state: &mut State) {
        let window = self.engine.threads;
        while state.open_frames < window
            && state.admitted < self.shared.pairs.frames.len()
            && (self.job.keep_going || state.faults.is_empty())
        {
            let (number, targets) = &self.shared.pairs.frames[state.admitted];
            state.admitted += 1;
            if state.open_targets[state.admitted - 1] == 0 {
                // All of it was done on the way to earlier frames.
                self.job.observer.event(Event::FrameDone { frame: *number });
                continue;
            }
            state.open_frames += 1;
            let mut stack: Vec<usize> = targets.clone();
            while let Some(at) = stack.pop() {
                let pair = &mut state.pairs[at];
                if std::mem::replace(&mut pair.admitted, true) {
                    continue;
                }
                if pair.unresolved == 0 && !pair.done {
                    state.ready.push(Task::Resolve(at));
                }
                stack.extend(self.shared.pairs.list[at].inputs());
            }
            self.shared.wake.notify_all();
        }
    }

    fn perform(&self, task: Task) {
        match task {
            Task::Resolve(at) => self.resolve(at),
            Task::Materialise(at) => self.materialise(at),
            Task::Compute(at) => self.compute(at),
            Task::Deliver(at) => self.deliver(at),
        }
    }

    fn node(&self, at: usize) -> &PlanNode {
        &self.shared.plan.nodes[self.shared.pairs.list[at].node]
    }

    // ---- resolve ----

    fn resolve(&self, at: usize) {
        let (key, evidence) = match self.evidence(at) {
            Ok(found) => found,
            Err(fault) => return self.fail(at, fault),
        };
        let trigger = match self.engine.store.record(&key) {
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
        if let Some(record) = self.engine.store.record(&key).filter(|record| self.artifacts_changed(record).is_none()) {
            self.engine.store.end_work(&key);
            return self.resolved(at, key, evidence, record);
        }
        let mut state = self.shared.lock();
        let pair = &mut state.pairs[at];
        (pair.key, pair.evidence, pair.trigger, pair.working) = (Some(key), Some(evidence), trigger, true);
        self.gather(&mut state, at);
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
            match self.engine.files.digest(&artifact.path, &*self.engine.io, None) {
                Ok(digest) if digest == artifact.blake3 => None,
                Ok(_) => Some(Trigger::OutputChanged(artifact.path.clone())),
                Err(_) => Some(Trigger::OutputMissing(artifact.path.clone())),
            }
        })
    }

    /// The pair's result was known.
    fn resolved(&self, at: usize, key: Digest, evidence: Evidence, record: Arc<Record>) {
        let mut state = self.shared.lock();
        let is_sink = self.node(at).node_type.sink;
        let pair = &mut state.pairs[at];
        (pair.key, pair.evidence, pair.status) = (Some(key), Some(evidence), Some(Status::Reused));
        pair.from = Some(if is_sink { From::File } else { From::Record });
        self.publish(&mut state, at, record);
        self.release_inputs(&mut state, at);
        drop(state);
        self.finished(at);
    }

    /// Tells consumers that the pair's outlines are known.
    fn publish(&self, state: &mut State, at: usize, record: Arc<Record>) {
        state.pairs[at].record = Some(record);
        for &consumer in &self.shared.pairs.list[at].consumers {
            let waiting = &mut state.pairs[consumer];
            waiting.unresolved -= 1;
            if waiting.unresolved == 0 && waiting.admitted && !waiting.done {
                state.ready.push(Task::Resolve(consumer));
            }
        }
        if self.is_delivered(at) {
            match state.pairs[at].values.is_some() {
                true => state.ready.push(Task::Deliver(at)),
                false => self.want(state, at),
            }
        } else {
            self.close_target(state, at);
        }
        self.shared.wake.notify_all();
    }

    fn is_delivered(&self, at: usize) -> bool {
        self.frame_of_target.contains_key(&at) && self.job.deliver.contains(&self.shared.pairs.list[at].node)
    }

    /// A target is done: its frame may be.
    fn close_target(&self, state: &mut State, at: usize) {
        if std::mem::replace(&mut state.pairs[at].done, true) {
            return;
        }
        if let Some(&frame) = self.frame_of_target.get(&at) {
            state.open_targets[frame] -= 1;
            if state.open_targets[frame] == 0 && frame < state.admitted {
                state.open_frames -= 1;
                let (number, _) = self.shared.pairs.frames[frame];
                self.job.observer.event(Event::FrameDone { frame: number });
            }
        }
    }

    // ---- values ----

    /// Looks for the values of a resolved pair, unless somebody does already.
    fn want(&self, state: &mut State, at: usize) {
        if !std::mem::replace(&mut state.pairs[at].materialising, true) {
            state.ready.push(Task::Materialise(at));
        }
    }

    /// Arranges for the pair to compute once all its inputs' values are held.
    fn gather(&self, state: &mut State, at: usize) {
        let mut inputs: Vec<usize> = self.shared.pairs.list[at].slots.iter().flatten().copied().collect();
        inputs.sort_unstable();
        inputs.dedup();
        inputs.retain(|&input| state.pairs[input].values.is_none());
        state.pairs[at].awaited = inputs.len();
        for &input in &inputs {
            state.pairs[input].waiters.push(at);
            self.want(state, input);
        }
        if inputs.is_empty() {
            state.ready.push(Task::Compute(at));
        }
        self.shared.wake.notify_all();
    }

    fn materialise(&self, at: usize) {
        let (key, record) = {
            let state = self.shared.lock();
            let pair = &state.pairs[at];
            let known = pair.key.zip(pair.record.clone());
            known.expect("only resolved pairs are asked for values")
        };
        if let Some((values, from)) = self.load(&record) {
            return self.loaded(at, values, from);
        }
        let shared = self.shared.clone();
        self.shared.lock().parked += 1;
        if !self.engine.store.take_work(key, move || shared.unpark(Task::Materialise(at))) {
            return;
        }
        self.shared.lock().parked -= 1;
        if let Some((values, from)) = self.load(&record) {
            self.engine.store.end_work(&key);
            return self.loaded(at, values, from);
        }
        let mut state = self.shared.lock();
        let pair = &mut state.pairs[at];
        (pair.working, pair.recompute) = (true, true);
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
        if state.pairs[at].status == Some(Status::Reused) {
            state.pairs[at].from = Some(from);
        }
        self.hold(&mut state, at, values);
    }

    /// Holds the pair's values for those who wait for them.
    fn hold(&self, state: &mut State, at: usize, values: Vec<Value>) {
        let pair = &mut state.pairs[at];
        pair.materialising = false;
        let waiters = std::mem::take(&mut pair.waiters);
        if pair.holds > 0 {
            pair.values = Some(values);
        }
        for waiter in waiters {
            state.pairs[waiter].awaited -= 1;
            if state.pairs[waiter].awaited == 0 {
                state.ready.push(Task::Compute(waiter));
            }
        }
        if state.pairs[at].record.is_some() && !state.pairs[at].done && self.is_delivered(at) {
            state.ready.push(Task::Deliver(at));
        }
        self.shared.wake.notify_all();
    }

    fn release_inputs(&self, state: &mut State, at: usize) {
        for input in self.shared.pairs.list[at].inputs() {
            self.release(state, input);
        }
    }

    fn release(&self, state: &mut State, at: usize) {
        let pair = &mut state.pairs[at];
        pair.holds -= 1;
        if pair.holds == 0 {
            pair.values = None;
        }
    }

    fn deliver(&self, at: usize) {
        let values = self.shared.lock().pairs[at].values.clone().expect("held for delivery");
        let pair = &self.shared.pairs.list[at];
        let frame = self.shared.pairs.frames[self.frame_of_target[&at]].0.filter(|_| pair.request.frame.is_some());
        let delivered = (self.job.on_values)(pair.node, frame, &values);
        let mut state = self.shared.lock();
        if let Err(fault) = delivered {
            self.add_fault(&mut state, at, fault);
        }
        self.release(&mut state, at);
        self.close_target(&mut state, at);
    }

    // ---- compute ----

    fn compute(&self, at: usize) {
        let (pair, node) = (&self.shared.pairs.list[at], self.node(at));
        let (inputs, params, files) = {
            let state = self.shared.lock();
            let inputs: Vec<Vec<(Request, Value)>> = (node.slots.iter().zip(&pair.slots))
                .map(|(slot, from)| {
                    let answer = |&p: &usize| {
                        let values = state.pairs[p].values.as_ref().expect("inputs are held");
                        (self.shared.pairs.list[p].request.clone(), slot.reads.restrict(&values[slot.output]))
                    };
                    from.iter().map(answer).collect()
                })
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
        let start = Instant::now();
        let computed = catch_unwind(AssertUnwindSafe(|| {
            self.engine.pool.install(|| {
                let instance = node.node_type.make(&serde_json::Value::Object(params));
                let outputs = instance.compute(&context)?;
                let outlines: Vec<Outline> = outputs.values.iter().map(Outline::of).collect();
                Ok::<_, NodeError>((outputs, outlines))
            })
        }));
        let seconds = start.elapsed().as_secs_f64();
        let artifacts = context.artifacts.into_inner().unwrap_or_else(PoisonError::into_inner);
        match computed {
            Ok(Ok((outputs, outlines))) => self.computed(at, outputs, outlines, artifacts, seconds),
            Ok(Err(error)) => self.fail(at, node_fault(error)),
            Err(panic) => {
                let text = (panic.downcast_ref::<&str>().map(|text| text.to_string()))
                    .or_else(|| panic.downcast_ref::<String>().cloned())
                    .unwrap_or_default();
                let message = format!("`{}` of type {} panicked: {text}", node.id, node.node_type.name);
                let hint = "this is a bug of the node; please report it with the graph".to_owned();
                self.fail(at, Fault::new(Code::Panic, message).hint(hint));
            }
        }
    }

    fn computed(&self, at: usize, outputs: Outputs, outlines: Vec<Outline>, artifacts: Vec<Artifact>, seconds: f64) {
        let node = self.node(at);
        assert_eq!(outlines.len(), node.node_type.outputs.len(), "{} outputs", node.node_type.name);
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
        for (outline, value) in outlines.iter().zip(&outputs.values) {
            self.engine.store.insert_value(outline, value, seconds);
        }
        let is_recompute = known.is_some();
        let record = known.unwrap_or_else(|| {
            let record = Arc::new(Record { outputs: outlines, artifacts, stats: outputs.stats, seconds });
            self.engine.store.insert_record(key, record.clone());
            record
        });
        let mut state = self.shared.lock();
        let pair = &mut state.pairs[at];
        (pair.working, pair.recompute) = (false, false);
        if pair.status != Some(Status::Executed) {
            pair.status = Some(if is_recompute { Status::Recomputed } else { Status::Executed });
        }
        pair.from = None;
        self.hold(&mut state, at, outputs.values);
        if !is_recompute {
            self.publish(&mut state, at, record);
        }
        self.release_inputs(&mut state, at);
        drop(state);
        self.engine.store.end_work(&key);
        self.finished(at);
    }

    fn finished(&self, at: usize) {
        let (pair, node) = (&self.shared.pairs.list[at], self.node(at));
        let (status, seconds, record) = {
            let state = self.shared.lock();
            (state.pairs[at].status, state.pairs[at].seconds, state.pairs[at].record.clone())
        };
        let Some(status) = status else { return };
        self.job.observer.event(Event::Finished { node: &node.id, frame: pair.request.frame, status, seconds });
        for artifact in record.iter().flat_map(|record| &record.artifacts) {
            self.job.observer.event(Event::Output { artifact, written: status == Status::Executed });
        }
    }

    // ---- faults ----

    fn add_fault(&self, state: &mut State, at: usize, mut fault: Fault) {
        let (pair, node) = (&self.shared.pairs.list[at], self.node(at));
        fault.node.get_or_insert_with(|| node.id.to_string());
        fault.frame = fault.frame.or(pair.request.frame);
        if fault.place.is_none() {
            fault.place = Some(self.shared.plan.place(pair.node, fault.parameter.as_deref()));
        }
        self.job.observer.event(Event::Fault(&fault));
        state.faults.push(fault);
    }

    /// The pair ends in a fault, and everything that waits for it with it. In a stopped run it just does not end.
    fn fail(&self, at: usize, fault: Fault) {
        if fault.code == Code::Cancelled && self.job.cancel.is_cancelled() {
            return;
        }
        let mut state = self.shared.lock();
        self.add_fault(&mut state, at, fault);
        let mut freed = Vec::new();
        let mut stack = vec![(at, Status::Failed)];
        while let Some((at, status)) = stack.pop() {
            let pair = &mut state.pairs[at];
            let waiters = std::mem::take(&mut pair.waiters);
            pair.materialising = false;
            if std::mem::take(&mut pair.working) {
                freed.extend(pair.key);
                self.release_inputs(&mut state, at);
            } else if !state.pairs[at].done && state.pairs[at].record.is_none() {
                self.release_inputs(&mut state, at);
            }
            let pair = &mut state.pairs[at];
            let was_resolved = pair.record.is_some();
            if status == Status::Failed || !was_resolved {
                pair.status = Some(status);
            }
            self.close_target(&mut state, at);
            stack.extend(waiters.into_iter().map(|waiter| (waiter, Status::Skipped)));
            if !was_resolved {
                let consumers = self.shared.pairs.list[at].consumers.iter().copied();
                stack.extend(consumers.filter(|&c| !state.pairs[c].done).map(|c| (c, Status::Skipped)));
            }
        }
        drop(state);
        self.shared.wake.notify_all();
        freed.iter().for_each(|key| self.engine.store.end_work(key));
    }

    /// Gives back work that a stopped run had taken and not done.
    pub fn abandon(engine: &Engine, shared: &Shared) {
        let keys: Vec<Digest> = {
            let mut state = shared.lock();
            let abandoned = |pair: &mut PairState| pair.key.filter(|_| std::mem::take(&mut pair.working));
            state.pairs.iter_mut().filter_map(abandoned).collect()
        };
        keys.iter().for_each(|key| engine.store.end_work(key));
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
    fn progress(&self, part: f64) -> bool {
        if self.worker.job.cancel.is_cancelled() {
            return false;
        }
        let frame = self.worker.shared.pairs.list[self.at].request.frame;
        self.worker.job.observer.event(Event::Progress { node: &self.worker.node(self.at).id, frame, part });
        true
    }
}
