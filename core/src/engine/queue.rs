//! Tasks that can be done, and which comes first.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// What can be done with a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Task {
    /// Make the key and look it up.
    Resolve(usize),
    /// Find the values of a resolved pair.
    Materialise(usize),
    /// Read the values of a resolved pair from disk.
    Load(usize),
    /// Run the node; all its inputs' values are held.
    Compute(usize),
    /// Hand a target's values out.
    Deliver(usize),
}

impl Task {
    pub fn pair(self) -> usize {
        match self {
            Task::Resolve(at) | Task::Materialise(at) | Task::Load(at) | Task::Compute(at) | Task::Deliver(at) => at,
        }
    }

    pub fn needs_memory(self) -> bool {
        matches!(self, Task::Load(_) | Task::Compute(_) | Task::Deliver(_))
    }
}

/// Tasks that can be done: those of the oldest frame first, and of these the newest, so that what was begun is
/// finished before more is begun.
#[derive(Default)]
pub(crate) struct Ready {
    heap: BinaryHeap<(Reverse<usize>, u64, Queued)>,
    count: u64,
}

#[derive(PartialEq, Eq)]
struct Queued(Task);

impl PartialOrd for Queued {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Queued {
    fn cmp(&self, _: &Self) -> Ordering {
        // Never asked: no two tasks have one number.
        Ordering::Equal
    }
}

impl Ready {
    pub fn push(&mut self, frame: usize, task: Task) {
        self.count += 1;
        self.heap.push((Reverse(frame), self.count, Queued(task)));
    }

    pub fn pop(&mut self) -> Option<Task> {
        self.heap.pop().map(|(_, _, Queued(task))| task)
    }

    pub fn is_empty(&self) -> bool {
        self.heap.is_empty()
    }
}
