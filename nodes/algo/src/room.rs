//! Scratch space of phases that follow each other.

use crate::{Interrupted, Watch};

/// Asks for scratch space: what one phase gives back the next may take, so the largest counts.
pub(crate) struct Room<'a> {
    watch: Watch<'a>,
    taken: usize,
    kept: usize,
}

impl<'a> Room<'a> {
    pub(crate) fn new(watch: Watch<'a>) -> Self {
        Self { watch, taken: 0, kept: 0 }
    }

    /// A phase begins that holds so many bytes at its peak.
    pub(crate) fn phase(&mut self, bytes: usize) -> Result<(), Interrupted> {
        let bytes = bytes.saturating_add(self.kept);
        if bytes > self.taken {
            self.watch.reserve(bytes - self.taken)?;
            self.taken = bytes;
        }
        Ok(())
    }

    /// Of the phase that ended so many bytes stay beside all that follow.
    pub(crate) fn keep(&mut self, bytes: usize) {
        self.kept += bytes;
    }
}
