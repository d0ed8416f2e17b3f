//! The mathematics of Warploom: pure functions over arrays.
//!
//! Functions take views over arrays and plain numbers and give arrays back. There is no shared ownership, no
//! logging, no clock and no global state here, and this package does not know the engine. Work runs side by side
//! on the caller's thread pool; results do not depend on its size.

pub mod card;
pub mod components;
pub mod composite;
pub mod draw;
pub mod feature;
pub mod lattice;
pub mod mask;
pub mod poisson;
pub mod rect;
pub mod resample;
mod steps;
pub mod transfer;
pub mod view;
pub mod warp;

/// A long computation was told to stop; nothing it wrote may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupted;

/// Called now and then by long computations with the part done, 0..=1; an error stops them.
pub type Watch<'a> = &'a (dyn Fn(f64) -> Result<(), Interrupted> + Sync);

/// A watch that never stops anything.
pub const UNWATCHED: Watch<'static> = &|_| Ok(());
