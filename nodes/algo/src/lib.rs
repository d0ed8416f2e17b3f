//! The mathematics of Warploom: pure functions over arrays.
//!
//! Functions take views over arrays and plain numbers and give arrays back. There is no shared ownership, no
//! logging, no clock and no global state here, and this package does not know the engine. Work runs side by side
//! on the caller's thread pool; results do not depend on its size.

mod bins;
pub mod card;
pub mod colorimetry;
pub mod components;
pub mod composite;
pub mod detail;
mod dissection;
pub mod draw;
pub mod edit;
pub mod exchange;
pub mod feature;
mod fourier;
pub mod handles;
pub mod lattice;
pub mod magnify;
pub mod mask;
pub mod mesh;
pub mod poisson;
pub mod rect;
pub mod resample;
mod room;
mod simd;
pub mod similarity;
mod steps;
pub mod transfer;
pub mod view;
pub mod warp;

/// A long computation was told to stop, or refused memory; nothing it wrote may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupted;

/// Whoever a long computation works for. A function of the part done is one that gives all memory asked for.
pub trait Watcher: Sync {
    /// Told the part done, 0..=1; an error stops the computation.
    fn progress(&self, part: f64) -> Result<(), Interrupted>;

    /// An error stops the computation.
    fn go_on(&self) -> Result<(), Interrupted>;

    /// Asked for bytes of scratch space whose size depends on the data, before they are taken; an error refuses them.
    fn reserve(&self, bytes: usize) -> Result<(), Interrupted>;
}

impl<F: Fn(f64) -> Result<(), Interrupted> + Sync> Watcher for F {
    fn progress(&self, part: f64) -> Result<(), Interrupted> {
        self(part)
    }

    fn go_on(&self) -> Result<(), Interrupted> {
        self(0.0)
    }

    fn reserve(&self, _: usize) -> Result<(), Interrupted> {
        Ok(())
    }
}

/// Asked now and then by long computations.
pub type Watch<'a> = &'a dyn Watcher;

/// A watch that never stops anything.
pub const UNWATCHED: Watch<'static> = &|_| Ok(());
