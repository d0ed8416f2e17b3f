//! From a graph file to a plan: read, check, plan.

pub mod check;
pub mod format;
pub mod frames;
pub mod plan;
pub mod read;
pub mod source;

pub use check::{Checked, Options, check};
pub use format::format;
