//! Ron is the arbiter of what RON is; people are the arbiters of what is said about it.

mod arbiter;
#[path = "../../../../../tests/src/graphs/dice.rs"]
mod dice;
mod messages;
mod speed;
