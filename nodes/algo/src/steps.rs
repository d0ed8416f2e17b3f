//! Progress of work that is cut into parts.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::{Interrupted, Watch, Watcher};

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

/// A watch over one stretch of a longer work, of which it is told.
pub(crate) struct Span<'a> {
    watch: Watch<'a>,
    from: f64,
    to: f64,
}

impl<'a> Span<'a> {
    /// From one part done of the longer work to another.
    pub(crate) fn new(watch: Watch<'a>, from: f64, to: f64) -> Self {
        Self { watch, from, to }
    }
}

impl Watcher for Span<'_> {
    fn progress(&self, part: f64) -> Result<(), Interrupted> {
        self.watch.progress(self.from + part * (self.to - self.from))
    }

    fn go_on(&self) -> Result<(), Interrupted> {
        self.watch.go_on()
    }

    fn reserve(&self, bytes: usize) -> Result<(), Interrupted> {
        self.watch.reserve(bytes)
    }
}

/// A watch that gave the memory to what was done before, for what is done with it again. It is told no progress.
pub(crate) struct Paid<'a>(pub(crate) Watch<'a>);

impl Watcher for Paid<'_> {
    fn progress(&self, _: f64) -> Result<(), Interrupted> {
        self.0.go_on()
    }

    fn go_on(&self) -> Result<(), Interrupted> {
        self.0.go_on()
    }

    fn reserve(&self, _: usize) -> Result<(), Interrupted> {
        Ok(())
    }
}
