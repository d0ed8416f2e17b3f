//! The engine's promises.

#![allow(missing_docs)]

mod disk_clocks;
mod disk_damage;
mod disk_faults;
mod disk_places;
mod disk_work;
mod model;
mod nodes;
mod promises;
mod random;

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Tests that count how often nodes compute run one after another.
fn serial() -> MutexGuard<'static, ()> {
    static SERIAL: Mutex<()> = Mutex::new(());
    SERIAL.lock().unwrap_or_else(PoisonError::into_inner)
}
