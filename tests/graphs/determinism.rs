//! Every example gives the same bits on any number of threads, from any state of the cache.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use warploom_core::engine::{Delivery, Engine, Job, Settings, Status, StorePolicy};
use warploom_core::graph::plan::Plan;
use warploom_core::graph::{Options, check};
use warploom_core::registry::Registry;
use warploom_core::value::Digest;

/// Digests of all values and of all written files, by name.
type Results = BTreeMap<String, String>;

/// The plan of an example that runs all its nodes and writes to `folder`.
pub fn plan(graph: &Path, folder: &Path) -> Arc<Plan> {
    let text = std::fs::read_to_string(graph).expect("readable");
    let registry = Registry::new(warploom_nodes::NODES);
    let checked = check(&text, &registry, &Options::new(graph));
    assert!(checked.faults.is_empty(), "{}: {:#?}", graph.display(), checked.faults);
    assert!(checked.warnings.is_empty(), "{}: {:#?}", graph.display(), checked.warnings);
    let plan = checked.plan.expect("a graph without faults has a plan");

    let targets: Vec<String> = plan.nodes.iter().map(|node| node.id.to_string()).collect();
    let sinks = plan.nodes.iter().filter(|node| node.node_type.sink);
    let set: Vec<String> = sinks
        .map(|node| {
            let path = node.params.json["path"].as_str().expect("a sink's path");
            let name = Path::new(path).file_name().expect("a file").to_string_lossy();
            format!("{}.path={:?}", node.id, folder.join(&*name))
        })
        .collect();
    let options = Options { targets: &targets, set: &set, ..Options::new(graph) };
    Arc::new(check(&text, &registry, &options).plan.expect("a plan"))
}

/// Runs a plan; its files are removed, so that a next run writes them again. A warm run does nothing else.
fn results(engine: &Engine, plan: &Arc<Plan>, is_warm: bool) -> Results {
    let found = Mutex::new(Results::new());
    let job = Job {
        deliver: (0..plan.nodes.len()).filter(|&node| !plan.nodes[node].node_type.sink).collect(),
        on_values: &|Delivery { node, frame, values, .. }| {
            let mut found = found.lock().expect("no panic");
            for (output, value) in values.iter().enumerate() {
                found.insert(format!("{}.{output}@{frame:?}", plan.nodes[node].id), value.digest().hex());
            }
            Ok(())
        },
        ..Job::default()
    };
    let report = engine.run(plan, &job);
    assert!(report.faults.is_empty(), "{}: {:#?}", plan.graph.display(), report.faults);
    assert!(!report.outputs.is_empty(), "{} writes something", plan.graph.display());
    let is_sink = |node: &str| report.outputs.iter().any(|output| output.node == node);
    let is_reused = report.nodes.iter().all(|pair| pair.status != Status::Executed || is_sink(&pair.node));
    assert_eq!(is_reused, is_warm, "{}: {:#?}", plan.graph.display(), report.nodes);
    let mut found = found.lock().expect("no panic").clone();
    assert!(found.len() >= job.deliver.len(), "each node's values are handed out");
    for output in &report.outputs {
        let bytes = std::fs::read(&output.path).expect("it is written");
        found.insert(format!("{}@{:?}", output.node, output.frame), Digest::of_bytes(&bytes).hex());
        std::fs::remove_file(&output.path).expect("it is there");
    }
    found
}

/// Results of a graph without a disk tier, twice, and with one, empty and then full.
fn of_all_caches(graph: &Path, threads: usize) -> [(&'static str, Results); 4] {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = plan(graph, &folder.path().join("out"));
    let engine = |cache: Option<PathBuf>| {
        Engine::new(Settings { threads, cache, store: StorePolicy::All, ..Settings::default() })
    };
    let cache = Some(folder.path().join("cache"));
    let memory = engine(None);
    let off = results(&memory, &plan, false);
    let warm_memory = results(&memory, &plan, true);
    let cold = results(&engine(cache.clone()), &plan, false);
    let warm_disk = results(&engine(cache), &plan, true);
    [("off", off), ("warm memory", warm_memory), ("cold", cold), ("warm disk", warm_disk)]
}

#[test]
fn every_example_gives_the_same_bits_on_any_number_of_threads_from_any_cache() {
    for graph in super::graphs() {
        let mut expected = None;
        for threads in [1, 2, 3, 8] {
            for (cache, results) in of_all_caches(&graph, threads) {
                let expected = expected.get_or_insert_with(|| results.clone());
                assert_eq!(*expected, results, "{} on {threads} threads, cache {cache}", graph.display());
            }
        }
    }
}
