//! The graph: its file is read, then checked, then made a plan.

pub mod read;
