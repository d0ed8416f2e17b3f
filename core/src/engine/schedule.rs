//! Which pair is next: every pair whose result is not known and is needed, once, side by side.
//!
//! A pair goes through two stages. It is *resolved* when its outlines are known: its key is made from its inputs'
//! outlines and looked up, and only if it is unknown does it compute. Its *values* are gathered only for pairs that
//! compute; they come from memory, from disk, or by recomputing. Nothing here recurses over the graph and no worker
//! blocks on another: a pair that waits is parked and pushed again by whoever it waits for. Who gets memory stands in
//! `share`, what is done with a pair in `run`.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::explain::Trigger;
use super::memory::Lease;
use super::pairs::Pairs;
use super::queue::{Ready, Task};
use super::report::{From, Status};
use super::resolve::Resolver;
use super::store::{Kept, Record};
use super::{Engine, Event, Existing, Job};
use crate::diag::{Code, Fault};
use crate::graph::plan::{Plan, PlanNode};
use crate::value::{Digest, Reads};

/// One run: what all workers share, and what a waker from another run may reach.
pub(crate) struct Shared {
    pub plan: Arc<Plan>,
    /// Per node, whether its values are handed out.
    pub(super) delivers: Vec<bool>,
    state: Mutex<State>,
    wake: Condvar,
}

pub(crate) struct State {
    pub pairs: Vec<PairState>,
    pub faults: Vec<Fault>,
    pub(super) ready: Ready,
    /// Tasks that wait for memory.
    pub(super) starved: Vec<Task>,
    /// The pair for which values of others were let go of: only what serves it gets memory.
    pub(super) focus: Option<usize>,
    /// Tasks at work.
    running: usize,
    /// Workers that found nothing to do.
    sleeping: usize,
    /// Pairs that wait for another pair with the same key, here or in another run.
    pub(super) parked: usize,
    /// Frames admitted so far.
    admitted: usize,
    /// Targets per frame that are not done.
    open_targets: Vec<usize>,
    /// Frames admitted and not done.
    pub(super) open_frames: usize,
    stopped: bool,
    /// Pairs resolved so far.
    pub(super) resolved: usize,
    /// Keys whose work is given back as soon as the lock is free.
    pub(super) freed: Vec<Digest>,
    /// Values that are let go of as soon as the lock is free.
    pub(super) let_go: Vec<Arc<Kept>>,
    pub(super) footprints: super::share::Footprints,
}

/// What is known of a pair so far.
#[derive(Default)]
pub(crate) struct PairState {
    admitted: bool,
    /// The frame of the run in which it first came up.
    pub(super) frame: usize,
    /// Input edges whose pairs are not resolved.
    unresolved: usize,
    /// Inputs whose values it waits for.
    pub(super) awaited: usize,
    /// Pairs that wait for this one's values.
    pub(super) waiters: Vec<usize>,
    /// Pairs that may still want this one's values, once per edge.
    pub(super) holds: usize,
    pub(super) values: Option<Vec<Arc<Kept>>>,
    /// How often they were let go of for want of memory since so many pairs were resolved.
    pub(super) spilled: (usize, u8),
    /// Memory that handing them out is known to need.
    pub(super) handing_out: u64,
    /// Whether its values are being looked for.
    pub(super) materialising: bool,
    /// Whether its values are, or are about to be.
    pub(super) handed_out: bool,
    /// Whether it executes and holds the work on its key.
    pub(super) working: bool,
    /// Whether its values are computed again.
    pub(super) recompute: bool,
    /// Its values cannot be had: whoever wants them fails.
    lost: bool,
    pub(super) done: bool,
    /// Nobody will ask for it.
    dismissed: bool,
    pub key: Option<Digest>,
    pub record: Option<Arc<Record>>,
    pub status: Option<Status>,
    pub from: Option<From>,
    pub seconds: f64,
    /// Most memory it asked for, bytes.
    pub peak: u64,
    /// Of a pair that reads or writes files.
    pub files: Option<Box<PairFiles>>,
}

/// What is known of a pair's files.
#[derive(Default)]
pub(crate) struct PairFiles {
    /// Files it reads, and digests of their content.
    pub read: Vec<(PathBuf, Digest)>,
    /// Files of a sink that stand whatever is in them, and their sizes.
    pub standing: Vec<(PathBuf, u64)>,
    /// Why it runs though its key is known.
    pub trigger: Option<Trigger>,
}

impl PairState {
    /// Whether it is being computed, or its values are being found or handed out.
    pub(super) fn is_busy(&self) -> bool {
        self.working || self.recompute || self.materialising || self.handed_out && !self.done
    }

    pub fn files_mut(&mut self) -> &mut PairFiles {
        self.files.get_or_insert_default()
    }

    /// Files it reads, and digests of their content.
    pub fn files_read(&self) -> &[(PathBuf, Digest)] {
        self.files.as_ref().map_or(&[], |files| &files.read)
    }
}

impl State {
    /// Whether all of a frame's targets are there.
    pub fn has_delivered(&self, targets: &[usize]) -> bool {
        let is_there = |status| matches!(status, Some(Status::Executed | Status::Recomputed | Status::Reused));
        targets.iter().all(|&target| is_there(self.pairs[target].status))
    }

    pub(super) fn push(&mut self, task: Task) {
        self.ready.push(self.pairs[task.pair()].frame, task);
    }

    pub(super) fn drop_values(&mut self, at: usize) {
        let pair = &mut self.pairs[at];
        if let Some(values) = pair.values.take() {
            let bytes = values.iter().map(|kept| kept.value.bytes()).sum::<u64>();
            self.footprints.shrink(pair.frame, bytes);
            self.let_go.extend(values);
        }
    }
}

impl Shared {
    /// `deliver`: nodes whose values are handed out.
    pub fn new(plan: Arc<Plan>, deliver: &[usize]) -> Self {
        let pairs = plan.pairs();
        let mut delivers = vec![false; plan.nodes.len()];
        deliver.iter().for_each(|&node| delivers[node] = true);
        let state = |at| PairState {
            unresolved: pairs.inputs(at).len(),
            holds: pairs.consumers(at).len(),
            ..PairState::default()
        };
        let mut states: Vec<PairState> = (0..pairs.list.len()).map(state).collect();
        // What is handed out is held until then, as if by one consumer more.
        let targets = pairs.frames.iter().flat_map(|(_, targets)| targets);
        targets.filter(|&&at| delivers[pairs.list[at].node]).for_each(|&at| states[at].holds += 1);
        let open_targets = pairs.frames.iter().map(|(_, targets)| targets.len()).collect();
        let state = State {
            pairs: states,
            faults: Vec::new(),
            ready: Ready::default(),
            starved: Vec::new(),
            focus: None,
            running: 0,
            sleeping: 0,
            parked: 0,
            admitted: 0,
            open_targets,
            open_frames: 0,
            stopped: false,
            resolved: 0,
            freed: Vec::new(),
            let_go: Vec::new(),
            footprints: super::share::Footprints::new(plan.nodes.len(), pairs.frames.len()),
        };
        Self { plan, delivers, state: Mutex::new(state), wake: Condvar::new() }
    }

    pub fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn unpark(&self, task: Task) {
        let mut state = self.lock();
        state.parked -= 1;
        state.push(task);
        drop(state);
        self.wake.notify_one();
    }
}

/// A worker's view of the run.
pub(crate) struct Worker<'a> {
    pub engine: &'a Engine,
    pub job: &'a Job<'a>,
    pub shared: &'a Arc<Shared>,
    pub pairs: &'a Pairs,
}

impl<'a> Worker<'a> {
    pub(super) fn node(&self, at: usize) -> &'a PlanNode {
        &self.shared.plan.nodes[self.pairs.list[at].node]
    }

    /// What pairs are made of, as far as `state` knows.
    pub(super) fn resolver<'s>(&'s self, state: &'s State) -> Resolver<'s, impl Fn(usize) -> &'s Record> {
        let record = |at: usize| &**state.pairs[at].record.as_ref().expect("inputs are resolved first");
        Resolver { plan: &self.shared.plan, pairs: self.pairs, record }
    }

    /// Takes tasks until the run is over.
    pub fn work(&self) {
        let mut state = self.shared.lock();
        loop {
            self.admit(&mut state);
            if self.job.cancel.is_cancelled() {
                state.stopped = true;
            }
            let task = if state.stopped { None } else { self.next(&mut state) };
            if task.is_none() && !state.freed.is_empty() {
                // Looking for a task may end some, and that may make others.
                state = self.clear(state);
                continue;
            }
            match task {
                Some((task, lease)) => {
                    state.running += 1;
                    if state.sleeping > 0 && !state.ready.is_empty() {
                        self.shared.wake.notify_one();
                    }
                    drop(state);
                    state = self.finish(task, lease);
                }
                None if state.running == 0 && (state.stopped || self.is_over(&state)) => break,
                // A cancel sets no flag that wakes, nor does memory that another run gives back: look now and then.
                None => {
                    state.sleeping += 1;
                    let pause = Duration::from_millis(20);
                    state = self.shared.wake.wait_timeout(state, pause).unwrap_or_else(PoisonError::into_inner).0;
                    state.sleeping -= 1;
                    if state.running == 0 {
                        // Whoever comes first would have gone on by now.
                        state.focus = None;
                    }
                    self.feed(&mut state);
                }
            }
        }
        drop(state);
        self.shared.wake.notify_all();
    }

    fn is_over(&self, state: &State) -> bool {
        state.parked == 0 && state.ready.is_empty() && state.starved.is_empty()
    }

    /// Does a task, and what had to wait for the lock to be free.
    fn finish(&self, task: Task, lease: Option<Lease>) -> MutexGuard<'_, State> {
        // It ends after what the task let go of, so that whoever is alone then has all the room there is.
        let lease = lease.map(Arc::new);
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| self.perform(task, lease.clone()))) {
            self.fail(task.pair(), self.panic_fault(task.pair(), panic));
        }
        let mut state = self.clear(self.shared.lock());
        drop(lease);
        state.running -= 1;
        if task.needs_memory() {
            self.feed(&mut state);
        }
        state
    }

    /// Gives back keys and lets go of values. Not under the lock: the first wakes pairs of this run and of others, the
    /// second takes time.
    fn clear<'s>(&'s self, mut state: MutexGuard<'s, State>) -> MutexGuard<'s, State> {
        while !state.freed.is_empty() || !state.let_go.is_empty() {
            let (freed, let_go) = (std::mem::take(&mut state.freed), std::mem::take(&mut state.let_go));
            drop(state);
            freed.iter().for_each(|key| self.engine.store.end_work(key));
            drop(let_go);
            self.engine.store.settle();
            state = self.shared.lock();
        }
        state
    }

    /// Lets new frames in while fewer than the window are open and there is memory for one more.
    fn admit(&self, state: &mut State) {
        while state.admitted < self.pairs.frames.len()
            && (self.job.keep_going || state.faults.is_empty())
            && !self.job.cancel.is_cancelled()
            && self.has_room_for_a_frame(state)
        {
            let frame = state.admitted;
            state.admitted += 1;
            if self.job.existing == Existing::Skip {
                self.skip_standing(state, frame);
            }
            if state.open_targets[frame] == 0 {
                // All of it was done on the way to earlier frames.
                self.frame_done(state, frame);
                continue;
            }
            state.open_frames += 1;
            let mut resolvable = Vec::new();
            let mut stack: Vec<usize> = self.pairs.frames[frame].1.clone();
            while let Some(at) = stack.pop() {
                let pair = &mut state.pairs[at];
                if pair.done || std::mem::replace(&mut pair.admitted, true) {
                    continue;
                }
                pair.frame = frame;
                if pair.unresolved == 0 {
                    resolvable.push(at);
                }
                stack.extend(self.pairs.inputs(at));
            }
            self.cascade(state, resolvable);
        }
    }

    /// Resolves pairs whose inputs are, and whatever that makes resolvable, as far as their records are in memory and
    /// no file has to be looked at. What is left becomes tasks.
    pub(super) fn cascade(&self, state: &mut State, mut resolvable: Vec<usize>) {
        let mut scratch = Vec::new();
        while let Some(at) = resolvable.pop() {
            match self.at_hand(state, at, &mut scratch) {
                Some(record) => self.reuse(state, at, record, From::Record, &mut resolvable),
                None => state.push(Task::Resolve(at)),
            }
        }
    }

    fn at_hand(&self, state: &mut State, at: usize, scratch: &mut Vec<u8>) -> Option<Arc<Record>> {
        let node = self.node(at);
        if !node.params.paths.is_empty() {
            return None;
        }
        let key = self.resolver(state).key(at, &[], scratch).ok()?;
        state.pairs[at].key = Some(key);
        self.engine.store.record_at_hand(&key).filter(|record| record.fits(&node.node_type))
    }

    /// The pair's result was known.
    pub(super) fn reuse(
        &self,
        state: &mut State,
        at: usize,
        record: Arc<Record>,
        from: From,
        resolvable: &mut Vec<usize>,
    ) {
        self.finished(at, Status::Reused, 0.0, &record);
        let pair = &mut state.pairs[at];
        (pair.status, pair.from) = (Some(Status::Reused), Some(from));
        self.publish(state, at, record, resolvable);
        self.release_inputs(state, at);
    }

    /// Tells consumers that the pair's outlines are known; those that wait for nothing else become resolvable.
    pub(super) fn publish(&self, state: &mut State, at: usize, record: Arc<Record>, resolvable: &mut Vec<usize>) {
        state.pairs[at].record = Some(record);
        state.resolved += 1;
        for &consumer in self.pairs.consumers(at) {
            let waiting = &mut state.pairs[consumer];
            waiting.unresolved -= 1;
            if waiting.unresolved == 0 && waiting.admitted && !waiting.done {
                resolvable.push(consumer);
            }
        }
        if self.is_delivered(at) {
            match state.pairs[at].values.is_some() {
                true => self.hand_out(state, at),
                false => self.want(state, at),
            }
        } else {
            self.close_target(state, at);
        }
    }

    pub(super) fn is_delivered(&self, at: usize) -> bool {
        self.shared.delivers[self.pairs.list[at].node] && self.pairs.frame_of_target.contains_key(&at)
    }

    fn frame_done(&self, state: &State, frame: usize) {
        let (number, targets) = &self.pairs.frames[frame];
        let delivered = state.has_delivered(targets);
        self.job.observer.event(Event::FrameDone { frame: *number, delivered });
    }

    /// A target is done: its frame may be.
    pub(super) fn close_target(&self, state: &mut State, at: usize) {
        if std::mem::replace(&mut state.pairs[at].done, true) {
            return;
        }
        if let Some(&frame) = self.pairs.frame_of_target.get(&at) {
            state.open_targets[frame] -= 1;
            if state.open_targets[frame] == 0 && frame < state.admitted && state.pairs[at].admitted {
                state.open_frames -= 1;
                self.frame_done(state, frame);
            }
        }
    }

    /// Looks for the values of a resolved pair, unless somebody does already.
    pub(super) fn want(&self, state: &mut State, at: usize) {
        if !std::mem::replace(&mut state.pairs[at].materialising, true) {
            state.push(Task::Materialise(at));
        }
    }

    /// The pairs whose values a pair needs. Of inputs that are read for their windows alone, the outline is enough.
    pub(super) fn needed(&self, at: usize) -> Vec<usize> {
        let slots = self.node(at).slots.iter().zip(self.pairs.slots(at));
        let mut inputs: Vec<usize> =
            slots.filter(|(slot, _)| slot.reads != Reads::Windows).flat_map(|(_, from)| from).copied().collect();
        inputs.sort_unstable();
        inputs.dedup();
        inputs
    }

    /// Arranges for the pair to compute once all its inputs' values are held.
    pub(super) fn gather(&self, state: &mut State, at: usize) {
        let mut inputs = self.needed(at);
        if let Some(fault) = self.beyond_all_room(state, at, &inputs) {
            return self.fail_under(state, at, fault);
        }
        inputs.retain(|&input| state.pairs[input].values.is_none());
        if inputs.iter().any(|&input| state.pairs[input].lost) {
            return self.spread_failure(state, at, Status::Skipped);
        }
        state.pairs[at].awaited = inputs.len();
        for &input in &inputs {
            state.pairs[input].waiters.push(at);
            self.want(state, input);
        }
        if inputs.is_empty() {
            state.push(Task::Compute(at));
        }
    }

    /// Holds the pair's values for those who wait for them.
    pub(super) fn hold(&self, state: &mut State, at: usize, values: Vec<Arc<Kept>>) {
        let pair = &mut state.pairs[at];
        pair.materialising = false;
        let waiters = std::mem::take(&mut pair.waiters);
        match pair.holds > 0 && pair.values.is_none() {
            true => {
                let bytes = values.iter().map(|kept| kept.value.bytes()).sum();
                pair.values = Some(values);
                let frame = pair.frame;
                state.footprints.grow(frame, bytes);
            }
            false => state.let_go.extend(values),
        }
        for waiter in waiters {
            state.pairs[waiter].awaited -= 1;
            if state.pairs[waiter].awaited == 0 {
                state.push(Task::Compute(waiter));
            }
        }
        if state.pairs[at].record.is_some() && !state.pairs[at].done && self.is_delivered(at) {
            self.hand_out(state, at);
        }
    }

    fn hand_out(&self, state: &mut State, at: usize) {
        if !std::mem::replace(&mut state.pairs[at].handed_out, true) {
            state.push(Task::Deliver(at));
        }
    }

    pub(super) fn release_inputs(&self, state: &mut State, at: usize) {
        for &input in self.pairs.inputs(at) {
            self.release(state, input);
        }
    }

    pub(super) fn release(&self, state: &mut State, at: usize) {
        let pair = &mut state.pairs[at];
        pair.holds -= 1;
        if pair.holds == 0 {
            state.drop_values(at);
        }
    }

    /// A target is not run: what nobody else needs of what it needs is not held for it.
    pub(super) fn dismiss(&self, state: &mut State, target: usize) {
        let mut stack = vec![target];
        while let Some(at) = stack.pop() {
            for &input in self.pairs.inputs(at) {
                self.release(state, input);
                let pair = &mut state.pairs[input];
                let is_idle = pair.holds == 0 && !pair.admitted && !pair.done && !pair.dismissed;
                if is_idle && !self.pairs.frame_of_target.contains_key(&input) {
                    pair.dismissed = true;
                    stack.push(input);
                }
            }
        }
    }

    pub(super) fn add_fault(&self, state: &mut State, at: usize, mut fault: Fault) {
        let (pair, node) = (&self.pairs.list[at], self.node(at));
        fault.node.get_or_insert_with(|| node.id.to_string());
        fault.frame = fault.frame.or(pair.request.frame);
        if fault.place.is_none() {
            fault.place = Some(self.shared.plan.place(pair.node, fault.parameter.as_deref()));
        }
        self.job.observer.event(Event::Fault(&fault));
        state.faults.push(fault);
    }

    /// The pair ends in a fault, and everything that waits for it with it. In a stopped run it just does not end.
    pub(super) fn fail(&self, at: usize, fault: Fault) {
        self.fail_under(&mut self.shared.lock(), at, fault);
    }

    fn fail_under(&self, state: &mut State, at: usize, fault: Fault) {
        if fault.code == Code::Cancelled && self.job.cancel.is_cancelled() {
            return;
        }
        self.add_fault(state, at, fault);
        self.spread_failure(state, at, Status::Failed);
    }

    fn spread_failure(&self, state: &mut State, at: usize, status: Status) {
        let mut stack = vec![(at, status)];
        while let Some((at, status)) = stack.pop() {
            let pair = &mut state.pairs[at];
            let waiters = std::mem::take(&mut pair.waiters);
            let was_resolved = pair.record.is_some();
            (pair.materialising, pair.lost) = (false, true);
            if status == Status::Failed || !pair.done {
                pair.status = Some(status);
            }
            if std::mem::take(&mut pair.working) {
                state.freed.extend(state.pairs[at].key);
            }
            let pair = &mut state.pairs[at];
            let holds_inputs = std::mem::take(&mut pair.recompute) || !pair.done && !was_resolved;
            if std::mem::take(&mut pair.awaited) > 0 {
                for &input in self.pairs.inputs(at) {
                    state.pairs[input].waiters.retain(|&waiter| waiter != at);
                }
            }
            if holds_inputs {
                self.release_inputs(state, at);
            }
            self.close_target(state, at);
            stack.extend(waiters.into_iter().map(|waiter| (waiter, Status::Skipped)));
            if !was_resolved {
                let consumers = self.pairs.consumers(at).iter().copied();
                stack.extend(consumers.filter(|&c| !state.pairs[c].done).map(|c| (c, Status::Skipped)));
            }
        }
    }

    /// Gives back work that a stopped run had taken and not done.
    pub fn abandon(engine: &Engine, shared: &Shared) {
        let keys: Vec<Digest> = {
            let mut state = shared.lock();
            // Somebody who waits for another run may keep this one's state for long.
            (0..state.pairs.len()).for_each(|at| state.drop_values(at));
            state.let_go.clear();
            let abandoned = |pair: &mut PairState| pair.key.filter(|_| std::mem::take(&mut pair.working));
            let mut keys: Vec<Digest> = state.pairs.iter_mut().filter_map(abandoned).collect();
            keys.append(&mut state.freed);
            keys
        };
        keys.iter().for_each(|key| engine.store.end_work(key));
    }
}
