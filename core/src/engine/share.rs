//! Who gets memory, and when: what keeps a run within its bound, whatever it is made of.
//!
//! A task that needs memory takes a lease. If there is no room, values that nobody holds are let go of; if that is not
//! enough it waits until another lease ends. A node that asks for more than there is while others are at work ends
//! and starts again later, with what it asked for taken in advance. What is alone and still has no room has the values
//! held for others let go of, which are found or computed again; only if that is not enough is it refused. Then whoever
//! it was done for comes first until it is done, or two could take each other's inputs away for ever. The oldest
//! frame comes first, so one task can always go on, and nothing waits for ever: values that were let go of again and
//! again while nothing came of it are not any more, so whoever needs their room is refused.

use super::memory::{Lease, Purpose};
use super::queue::Task;
use super::run::PairControl;
use super::schedule::{PairState, State, Worker};
use crate::diag::{Code, Fault};
use crate::node::{ErrorClass, NodeError};

/// How often a pair's values are let go of for others, while no pair is resolved, before that is taken for going round
/// in circles.
const MOST_SPILLS: u8 = 8;

/// What pairs and frames take, as far as this run has seen.
pub(crate) struct Footprints {
    /// Per node, most bytes one of its pairs asked for.
    asked: Vec<u64>,
    /// Per frame, bytes of values that are held.
    held: Vec<u64>,
    /// The same of all frames.
    all_held: u64,
    /// Most bytes that one frame took.
    largest: u64,
}

impl Footprints {
    pub fn new(nodes: usize, frames: usize) -> Self {
        Self { asked: vec![0; nodes], held: vec![0; frames], all_held: 0, largest: 0 }
    }

    pub fn grow(&mut self, frame: usize, bytes: u64) {
        self.held[frame] += bytes;
        self.all_held += bytes;
        self.largest = self.largest.max(self.held[frame]);
    }

    pub fn shrink(&mut self, frame: usize, bytes: u64) {
        self.held[frame] -= bytes;
        self.all_held -= bytes;
    }

    /// A pair of that node asked for so much.
    pub fn learn(&mut self, node: usize, frame: usize, asked: u64) {
        self.asked[node] = self.asked[node].max(asked);
        self.largest = self.largest.max(self.held[frame] + asked);
    }
}

/// The pair that is waited for in the end by whoever waits for `at`.
fn served(pairs: &[PairState], mut at: usize) -> usize {
    while let Some(&waiter) = pairs[at].waiters.first() {
        at = waiter;
    }
    at
}

/// Whether `at` is waited for by `focus`, or is it.
fn serves(state: &State, at: usize, focus: usize) -> bool {
    let mut stack = vec![at];
    while let Some(at) = stack.pop() {
        if at == focus {
            return true;
        }
        stack.extend(&state.pairs[at].waiters);
    }
    false
}

/// A few numbers are nothing to wait for, let alone to refuse a run for.
const PETTY: u64 = 1 << 16;

impl Worker<'_> {
    /// The next task, with the lease it needs.
    pub(super) fn next(&self, state: &mut State) -> Option<(Task, Option<Lease>)> {
        if state.focus.is_some_and(|focus| !state.pairs[focus].is_busy()) {
            state.focus = None;
            self.feed(state);
        }
        while let Some(task) = state.ready.pop() {
            if !task.needs_memory() {
                return Some((task, None));
            }
            let at = task.pair();
            if let Task::Compute(at) = task
                && self.needed(at).iter().any(|&input| state.pairs[input].values.is_none())
            {
                // They were let go of since.
                self.gather(state, at);
                continue;
            }
            let is_older = |other: &Task| state.pairs[other.pair()].frame < state.pairs[at].frame;
            let is_its_turn = match state.focus {
                Some(focus) => serves(state, at, focus),
                None => !state.starved.iter().any(is_older),
            };
            if is_its_turn && let Some(lease) = self.lease(state, task) {
                return Some((task, Some(lease)));
            }
            state.starved.push(task);
        }
        None
    }

    /// A lease of what a task is known to need; none if it has to wait for others.
    fn lease(&self, state: &mut State, task: Task) -> Option<Lease> {
        let store = &self.engine.store;
        let at = task.pair();
        let bytes = match task {
            Task::Compute(at) => state.footprints.asked[self.pairs.list[at].node],
            Task::Load(at) => state.pairs[at].record.as_ref().map_or(0, |record| record.value_bytes()),
            Task::Deliver(at) => state.pairs[at].handing_out,
            _ => 0,
        };
        let is_alone = store.memory.leases() == 0;
        let lease = store.memory.lease();
        if lease.advance(bytes) || store.make_room(bytes) && lease.advance(bytes) {
            return Some(lease);
        }
        if !is_alone {
            return None;
        }
        self.spill(state, at);
        if store.make_room(bytes) {
            lease.advance(bytes);
        }
        // If it was still too much, the task is refused when it asks.
        Some(lease)
    }

    /// Tasks that waited for memory try again.
    pub(super) fn feed(&self, state: &mut State) {
        for task in std::mem::take(&mut state.starved) {
            state.push(task);
        }
    }

    /// Lets go of all values that are held for others than `at`, to disk where there is one. Whether there were any.
    fn spill(&self, state: &mut State, at: usize) -> bool {
        state.focus.get_or_insert_with(|| served(&state.pairs, at));
        let needed = self.needed(at);
        // What is on its way out is as good as let go of.
        let mut spilled = !state.let_go.is_empty();
        for other in (0..state.pairs.len()).filter(|other| *other != at && needed.binary_search(other).is_err()) {
            let resolved = state.resolved;
            let pair = &mut state.pairs[other];
            if pair.values.is_none() {
                continue;
            }
            let spills = if pair.spilled.0 == resolved { pair.spilled.1 } else { 0 };
            if spills == MOST_SPILLS {
                continue;
            }
            pair.spilled = (resolved, spills + 1);
            let outlines = pair.record.iter().flat_map(|record| &record.outputs);
            outlines
                .zip(pair.values.iter().flatten())
                .for_each(|(outline, kept)| self.engine.store.rescue(outline, kept));
            state.drop_values(other);
            spilled = true;
        }
        state.let_go.clear();
        spilled
    }

    /// Whether another frame may begin: there is a thread for it, and room for what the largest so far took.
    pub(super) fn has_room_for_a_frame(&self, state: &State) -> bool {
        // What nobody holds is let go of for it, so it does not count.
        let Footprints { all_held, largest, .. } = state.footprints;
        let grown = all_held.max(largest.saturating_mul(state.open_frames as u64));
        let fits = grown.saturating_add(largest) <= self.engine.store.memory.room();
        state.open_frames == 0 || state.open_frames < self.engine.threads && fits
    }

    /// The fault of a pair whose inputs alone are more than there is room for.
    pub(super) fn beyond_all_room(&self, state: &State, at: usize, inputs: &[usize]) -> Option<Fault> {
        let room = self.engine.store.memory.room();
        // Those that are held have their room; they may share planes with each other.
        let missing = inputs.iter().filter(|&&input| state.pairs[input].values.is_none());
        let outlines = missing.filter_map(|&input| state.pairs[input].record.as_ref());
        let mut parts: Vec<_> =
            outlines.flat_map(|record| &record.outputs).map(|outline| (outline.digest, outline.bytes)).collect();
        parts.sort_unstable();
        parts.dedup();
        let bytes: u64 = parts.iter().map(|(_, bytes)| bytes).sum();
        if bytes <= room.max(PETTY) {
            return None;
        }
        let id = &self.node(at).id;
        let message = format!("the inputs of `{id}` take {}, more than {}", sized(bytes), budget(room));
        Some(Fault::new(Code::OverBudget, message).hint(HINT.to_owned()))
    }
}

const HINT: &str = "ask for less, or raise --memory";

fn budget(room: u64) -> String {
    format!("the {} that the memory budget leaves", sized(room))
}

/// As the flag takes it: M is 1024 squared, and G and T are 1024 times as much each.
fn sized(bytes: impl Into<u128>) -> String {
    let bytes = bytes.into() as f64;
    let (unit, power) =
        [("T", 40), ("G", 30)].into_iter().find(|(_, power)| bytes >= 2_f64.powi(*power)).unwrap_or(("M", 20));
    format!("{:.1}{unit}", bytes / 2_f64.powi(power))
}

impl PairControl<'_> {
    /// See `Control::reserve`.
    pub(super) fn take(&self, bytes: u128, purpose: Purpose) -> Result<(), NodeError> {
        let store = &self.worker.engine.store;
        let total = bytes + u128::from(self.lease.asked());
        if total <= u128::from(PETTY) {
            self.lease.grow_anyway(bytes as u64);
            return Ok(());
        }
        let Some(more) = u64::try_from(bytes).ok().filter(|_| total <= u128::from(store.memory.room())) else {
            return Err(self.refused(total));
        };
        loop {
            // Before it looks for room: another may end meanwhile and leave some.
            let is_alone = store.memory.leases() == 1;
            if self.lease.grow(more, purpose) {
                return Ok(());
            }
            if store.make_room(more) {
                continue;
            }
            if !is_alone {
                self.starved.get_or_init(|| total as u64);
                return Err(NodeError::new(ErrorClass::Cancelled, "it starts again when there is memory"));
            }
            if !self.worker.spill(&mut self.worker.shared.lock(), self.at) {
                return Err(self.refused(total));
            }
        }
    }

    fn refused(&self, total: u128) -> NodeError {
        let worker = self.worker;
        let inputs: u64 = {
            let state = worker.shared.lock();
            let held = worker.needed(self.at).into_iter().filter_map(|input| state.pairs[input].values.as_ref());
            held.flatten().map(|kept| kept.value.bytes()).sum()
        };
        let memory = &worker.engine.store.memory;
        let others = memory.used().saturating_sub(inputs).saturating_sub(self.lease.asked());
        let mut needs = format!("`{}` needs {}", worker.node(self.at).id, sized(total));
        if inputs > 0 {
            needs += &format!(" beside the {} of its inputs", sized(inputs));
        }
        // Where it would not fit alone it matters not what others hold.
        if others > PETTY && total + u128::from(inputs) <= u128::from(memory.room()) {
            needs += &format!(" and {} that others hold", sized(others));
        }
        let message = format!("{needs}, more than {}", budget(memory.room()));
        NodeError::new(ErrorClass::OverBudget, message).hint(HINT)
    }
}

#[cfg(test)]
mod tests {
    use super::sized;

    #[test]
    fn sizes_are_told_in_units_of_their_own() {
        let told = [1_u128 << 10, 3 << 19, 1023 << 20, 3 << 29, 5 << 40, 16 << 54].map(sized);
        assert_eq!(told, ["0.0M", "1.5M", "1023.0M", "1.5G", "5.0T", "262144.0T"]);
    }
}
