//! From a plan to results: keys, the store, the run.

mod context;
mod io;

pub use context::{Artifact, Context};
pub use io::{Disk, Io, Stat};
