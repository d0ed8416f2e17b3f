//! The example graphs, and the documents that quote the tree.

#![allow(missing_docs)]

mod determinism;
mod pictures;

use std::path::{Path, PathBuf};

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
