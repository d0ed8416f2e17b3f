//! Progress of work that is cut into equal parts.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::{Interrupted, Watch};

/// Tells a watch how many of a known count of equal parts are done, whichever thread does them.
pub(crate) struct Steps<'a> {
    watch: Watch<'a>,
    total: usize,
    done: AtomicUsize,
}

impl<'a> Steps<'a> {
    /// None of `total` parts is done yet.
    pub(crate) fn new(watch: Watch<'a>, total: usize) -> Self {
        Self { watch, total, done: AtomicUsize::new(0) }
    }

    /// One more part is done.
    pub(crate) fn step(&self) -> Result<(), Interrupted> {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        self.watch.progress(done as f64 / self.total as f64)
    }
}
