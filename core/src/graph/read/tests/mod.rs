//! Ron is the arbiter of what RON is; people are the arbiters of what is said about it.

pub(in crate::graph) mod arbiter;
pub(in crate::graph) mod dice;
mod messages;
mod speed;
