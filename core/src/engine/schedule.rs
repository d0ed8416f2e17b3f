//! Which pair is next: every pair whose result is not known and is needed, once, side by side.
//!
//! A pair goes through two stages. It is *resolved* when its outlines are known: its key is made from its inputs'
//! outlines and looked up, and only if it is unknown does it compute. Its *values* are gathered only for pairs that
//! compute; they come from memory, from disk, or by recomputing. Nothing here recurses over the graph and no worker
//! blocks on another: a pair that waits is parked and pushed again by whoever it waits for. What is done with a pair
//! stands in `run`.

use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::explain::{Evidence, Trigger};
use super::pairs::Pairs;
use super::report::{From, Status};
use super::store::Record;
use super::{Engine, Event, Job};
use crate::diag::{Code, Fault};
use crate::graph::plan::Plan;
use crate::value::{Digest, Reads, Value};

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
    pub(super) ready: Vec<Task>,
    /// Tasks at work.
    pub(super) running: usize,
    /// Pairs that wait for another pair with the same key, here or in another run.
    pub(super) parked: usize,
    /// Frames admitted so far.
    admitted: usize,
    /// Targets per frame that are not done.
    open_targets: Vec<usize>,
    /// Frames admitted and not done.
    open_frames: usize,
    stopped: bool,
    /// Keys whose work is given back as soon as the lock is free.
    pub(super) freed: Vec<Digest>,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Task {
    /// Make the key and look it up.
    Resolve(usize),
    /// Find the values of a resolved pair.
    Materialise(usize),
    /// Run the node; all its inputs' values are held.
    Compute(usize),
    /// Hand a target's values out.
    Deliver(usize),
}

impl Task {
    fn pair(self) -> usize {
        match self {
            Task::Resolve(at) | Task::Materialise(at) | Task::Compute(at) | Task::Deliver(at) => at,
        }
    }
}

/// What is known of a pair so far.
#[derive(Default)]
pub(crate) struct PairState {
    admitted: bool,
    /// Input edges whose pairs are not resolved.
    pub(super) unresolved: usize,
    /// Inputs whose values it waits for.
    pub(super) awaited: usize,
    /// Pairs that wait for this one's values.
    pub(super) waiters: Vec<usize>,
    /// Pairs that may still want this one's values, once per edge.
    pub(super) holds: usize,
    pub(super) values: Option<Vec<Value>>,
    /// Whether its values are being looked for.
    pub(super) materialising: bool,
    /// Whether it executes and holds the work on its key.
    pub(super) working: bool,
    /// Whether its values are computed again.
    pub(super) recompute: bool,
    /// Its values cannot be had: whoever wants them fails.
    pub(super) lost: bool,
    pub(super) done: bool,
    pub key: Option<Digest>,
    pub record: Option<Arc<Record>>,
    pub status: Option<Status>,
    pub from: Option<From>,
    pub seconds: f64,
    /// Most memory its node asked for.
    pub peak_bytes: u64,
    pub evidence: Option<Evidence>,
    pub trigger: Option<Trigger>,
}

impl State {
    /// Whether all of a frame's targets are there.
    pub fn has_delivered(&self, targets: &[usize]) -> bool {
        let is_there = |status| matches!(status, Some(Status::Executed | Status::Recomputed | Status::Reused));
        targets.iter().all(|&target| is_there(self.pairs[target].status))
    }
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
            freed: Vec::new(),
        };
        Self { plan, pairs, state: Mutex::new(state), wake: Condvar::new() }
    }

    pub fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn unpark(&self, task: Task) {
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
    pub frame_of_target: &'a HashMap<usize, usize>,
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
                    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| self.perform(task))) {
                        self.fail(task.pair(), self.panic_fault(task.pair(), panic));
                    }
                    state = self.shared.lock();
                    let freed = std::mem::take(&mut state.freed);
                    if !freed.is_empty() {
                        // Not under the lock: it wakes pairs of this run and of others.
                        drop(state);
                        freed.iter().for_each(|key| self.engine.store.end_work(key));
                        state = self.shared.lock();
                    }
                    state.running -= 1;
                    self.shared.wake.notify_all();
                }
                None if state.running == 0 && (state.stopped || state.parked == 0 && state.ready.is_empty()) => break,
                // A cancel sets no flag that wakes: look again now and then.
                None => {
                    let pause = Duration::from_millis(20);
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
            let frame = state.admitted;
            state.admitted += 1;
            if state.open_targets[frame] == 0 {
                // All of it was done on the way to earlier frames.
                self.frame_done(state, frame);
                continue;
            }
            state.open_frames += 1;
            let mut stack: Vec<usize> = self.shared.pairs.frames[frame].1.clone();
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

    /// Tells consumers that the pair's outlines are known.
    pub(super) fn publish(&self, state: &mut State, at: usize, record: Arc<Record>) {
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

    pub(super) fn is_delivered(&self, at: usize) -> bool {
        self.frame_of_target.contains_key(&at) && self.job.deliver.contains(&self.shared.pairs.list[at].node)
    }

    fn frame_done(&self, state: &State, frame: usize) {
        let (number, targets) = &self.shared.pairs.frames[frame];
        let delivered = state.has_delivered(targets);
        self.job.observer.event(Event::FrameDone { frame: *number, delivered });
    }

    /// A target is done: its frame may be.
    pub(super) fn close_target(&self, state: &mut State, at: usize) {
        if std::mem::replace(&mut state.pairs[at].done, true) {
            return;
        }
        if let Some(&frame) = self.frame_of_target.get(&at) {
            state.open_targets[frame] -= 1;
            if state.open_targets[frame] == 0 && frame < state.admitted {
                state.open_frames -= 1;
                self.frame_done(state, frame);
            }
        }
    }

    /// Looks for the values of a resolved pair, unless somebody does already.
    pub(super) fn want(&self, state: &mut State, at: usize) {
        if !std::mem::replace(&mut state.pairs[at].materialising, true) {
            state.ready.push(Task::Materialise(at));
        }
    }

    /// Arranges for the pair to compute once all its inputs' values are held. Of inputs that are read for their
    /// windows alone, the outline is enough.
    pub(super) fn gather(&self, state: &mut State, at: usize) {
        let pair = &self.shared.pairs.list[at];
        let slots = self.node(at).slots.iter().zip(&pair.slots);
        let mut inputs: Vec<usize> =
            slots.filter(|(slot, _)| slot.reads != Reads::Windows).flat_map(|(_, from)| from).copied().collect();
        inputs.sort_unstable();
        inputs.dedup();
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
            state.ready.push(Task::Compute(at));
        }
        self.shared.wake.notify_all();
    }

    /// Holds the pair's values for those who wait for them.
    pub(super) fn hold(&self, state: &mut State, at: usize, values: Vec<Value>) {
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

    pub(super) fn release_inputs(&self, state: &mut State, at: usize) {
        for input in self.shared.pairs.list[at].inputs() {
            self.release(state, input);
        }
    }

    pub(super) fn release(&self, state: &mut State, at: usize) {
        let pair = &mut state.pairs[at];
        pair.holds -= 1;
        if pair.holds == 0 {
            pair.values = None;
        }
    }

    pub(super) fn add_fault(&self, state: &mut State, at: usize, mut fault: Fault) {
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
    pub(super) fn fail(&self, at: usize, fault: Fault) {
        if fault.code == Code::Cancelled && self.job.cancel.is_cancelled() {
            return;
        }
        let mut state = self.shared.lock();
        self.add_fault(&mut state, at, fault);
        self.spread_failure(&mut state, at, Status::Failed);
        self.shared.wake.notify_all();
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
                for input in self.shared.pairs.list[at].inputs() {
                    state.pairs[input].waiters.retain(|&waiter| waiter != at);
                }
            }
            if holds_inputs {
                self.release_inputs(state, at);
            }
            self.close_target(state, at);
            stack.extend(waiters.into_iter().map(|waiter| (waiter, Status::Skipped)));
            if !was_resolved {
                let consumers = self.shared.pairs.list[at].consumers.iter().copied();
                stack.extend(consumers.filter(|&c| !state.pairs[c].done).map(|c| (c, Status::Skipped)));
            }
        }
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
