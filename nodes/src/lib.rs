//! The nodes of Warploom.

pub mod io;

use warploom_core::registry::{Definition, def};

/// All nodes, by name.
pub const NODES: &[Definition] = &[def::<io::Load>("Load"), def::<io::Save>("Save")];
