//! From a graph file to a plan: read, check, plan.

pub mod frames;
pub mod plan;
