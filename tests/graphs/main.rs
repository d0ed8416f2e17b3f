//! The example graphs, and the documents that quote the tree.

#![allow(missing_docs)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use warploom_core::engine::{Delivery, Engine, Job, Settings};
use warploom_core::graph::{Options, check};
use warploom_core::registry::Registry;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests lie below the root")
}

fn graphs() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(root().join("graphs")).expect("the examples");
    let mut graphs: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    graphs.retain(|path| path.extension().is_some_and(|extension| extension == "ron"));
    graphs.sort();
    assert!(!graphs.is_empty());
    graphs
}

/// Digests of all values and of all written files, by name.
fn results(graph: &Path, threads: usize) -> BTreeMap<String, String> {
    let folder = tempfile::tempdir().expect("a folder");
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
            format!("{}.path={:?}", node.id, folder.path().join(&*name))
        })
        .collect();
    let options = Options { targets: &targets, set: &set, ..Options::new(graph) };
    let plan = Arc::new(check(&text, &registry, &options).plan.expect("a plan"));

    let found = Mutex::new(BTreeMap::new());
    let deliver = (0..plan.nodes.len()).filter(|&node| !plan.nodes[node].node_type.sink).collect();
    let job = Job {
        deliver,
        on_values: &|Delivery { node, frame, values, .. }| {
            let mut found = found.lock().expect("no panic");
            for (output, value) in values.iter().enumerate() {
                found.insert(format!("{}.{output}@{frame:?}", plan.nodes[node].id), value.digest().hex());
            }
            Ok(())
        },
        ..Job::default()
    };
    let report = Engine::new(Settings { threads, ..Settings::default() }).run(&plan, &job);
    assert!(report.faults.is_empty(), "{}: {:#?}", graph.display(), report.faults);
    assert!(!report.outputs.is_empty(), "{} writes something", graph.display());
    let mut found = found.into_inner().expect("no panic");
    for output in &report.outputs {
        found.insert(format!("{}@{:?}", output.node, output.frame), output.blake3.expect("it was written").hex());
    }
    found
}

#[test]
fn every_example_gives_the_same_bits_on_any_number_of_threads() {
    for graph in graphs() {
        let one = results(&graph, 1);
        for threads in [2, 3, 8] {
            assert_eq!(one, results(&graph, threads), "{} on {threads} threads", graph.display());
        }
    }
}

#[test]
fn the_walk_through_a_node_quotes_the_tree() {
    let document = std::fs::read_to_string(root().join("core/docs/add-a-node.md")).expect("readable");
    let node = std::fs::read_to_string(root().join("nodes/src/mask/grow.rs")).expect("readable");
    assert!(document.contains(&node), "core/docs/add-a-node.md quotes nodes/src/mask/grow.rs whole");
    let list = std::fs::read_to_string(root().join("nodes/src/lib.rs")).expect("readable");
    let line = "    def::<mask::Grow>(\"Grow\"),";
    assert!(document.contains(line) && list.contains(line));
}

#[test]
fn links_in_documents_lead_somewhere() {
    let mut documents = vec![root().join("README.md")];
    for folder in ["core/docs", "core/docs/decisions"] {
        let entries = std::fs::read_dir(root().join(folder)).expect("a folder");
        documents.extend(entries.map(|entry| entry.expect("an entry").path()));
    }
    documents.retain(|path| path.extension().is_some_and(|extension| extension == "md"));
    for document in documents {
        let text = std::fs::read_to_string(&document).expect("readable");
        for (at, _) in text.match_indices("](") {
            let link = text[at + 2..].split(')').next().unwrap_or_default();
            let target = document.parent().expect("a folder").join(link.split('#').next().unwrap_or_default());
            assert!(link.starts_with("https://") || target.exists(), "{}: {link}", document.display());
        }
    }
}

#[test]
fn no_source_file_is_long_without_a_reason() {
    /// Longer than 600 lines, and why.
    const REASONS: [(&str, &str); 0] = [];
    let mut folders: Vec<PathBuf> = ["core", "nodes", "cli", "tests"].map(|name| root().join(name)).into();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let lines = std::fs::read_to_string(&path).expect("readable").lines().count();
                let has_reason = REASONS.iter().any(|(name, _)| path.ends_with(name));
                assert!(lines <= 600 || has_reason, "{} has {lines} lines", path.display());
            }
        }
    }
}
