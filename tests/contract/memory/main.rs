//! What every node type keeps to while it computes on something large: it asks before it takes memory, and stops
//! when told to. Runs by itself, for it counts what the whole process allocates.

#![allow(missing_docs)]

mod cancel;
mod peaks;
mod scene;

use std::sync::{Mutex, MutexGuard, PoisonError};

#[global_allocator]
static HEAP: peak_alloc::PeakAlloc = peak_alloc::PeakAlloc;

/// One test at a time.
fn serial() -> MutexGuard<'static, ()> {
    static SERIAL: Mutex<()> = Mutex::new(());
    SERIAL.lock().unwrap_or_else(PoisonError::into_inner)
}
