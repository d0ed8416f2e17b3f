//! What the engine costs beside the nodes' own work: `cargo bench -p warploom-tests --bench cost -- PATH-OF-WARPLOOM`.

mod command;
mod digests;
#[path = "../../engine/nodes.rs"]
mod nodes;
mod reuse;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use warploom_core::graph::plan::Plan;
use warploom_core::graph::{Options, check};
use warploom_core::registry::Registry;
use warploom_tests::harness::median;

fn main() {
    // Cargo adds a flag of its own.
    let binary = std::env::args().skip(1).find(|word| !word.starts_with('-')).map(PathBuf::from);
    reuse::reused_nodes();
    reuse::long_chain();
    match binary {
        Some(binary) => command::nothing_to_do(&binary.canonicalize().expect("the binary is there")),
        None => println!("cold command: left out, no path of warploom given"),
    }
    digests::main_job();
}

fn seconds<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}

/// The middle of `count` times, seconds.
fn median_seconds<T>(count: usize, mut work: impl FnMut() -> T) -> f64 {
    median(&(0..count).map(|_| seconds(&mut work).1).collect::<Vec<_>>())
}

/// The plan of a graph's text; without targets it runs the sinks.
fn plan(text: &str, file: &Path, registry: &Registry, targets: &[String], set: &[String]) -> Arc<Plan> {
    let checked = check(text, registry, &Options { targets, set, ..Options::new(file) });
    assert!(checked.faults.is_empty(), "{:#?}", checked.faults[0]);
    Arc::new(checked.plan.expect("a graph without faults has a plan"))
}
