//! What is wrong with a graph file: every fault, in one run, where it stands, and how to mend it.

#![allow(missing_docs)]

mod fixtures;
mod format;
mod forms;
mod good;
mod limits;
mod probe;
mod typos;

use std::path::Path;
use std::sync::LazyLock;

use warploom_core::graph::{Checked, Options, check};
use warploom_core::registry::Registry;

/// The node types of the house.
static NODES: LazyLock<Registry> = LazyLock::new(|| Registry::new(warploom_nodes::NODES));

/// A check without flags.
fn faults_of(text: &str) -> Checked {
    check(text, &NODES, &Options::new(Path::new("graph.ron")))
}
