//! What every node type keeps to: one loop over all of them.

#![allow(missing_docs)]

mod declarations;
mod digests;
mod factors;
mod given;
mod parameters;
mod pictures;
mod stage;
mod texts;
