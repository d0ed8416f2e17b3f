//! Good graphs have no fault, and no mutation of one upsets the check.

use std::collections::BTreeSet;

use warploom_core::diag::Code;

use warploom_tests::graphs::{Good, Pool, files, fuzz};

use crate::{NODES, faults_of};

#[test]
fn a_hundred_graphs_check_clean() {
    let mut used = BTreeSet::new();
    for seed in 1..=100 {
        let good = Good::new(seed, &NODES);
        let checked = faults_of(&good.text);
        assert!(checked.faults.is_empty(), "{}\n{:#?}", good.text, checked.faults);
        assert!(checked.warnings.iter().all(|warning| warning.code == Code::Unreached), "{:#?}", checked.warnings);
        let plan = checked.plan.expect("a graph without faults has a plan");
        assert_eq!(plan.nodes.len(), good.made.len());
        used.extend(plan.nodes.iter().map(|node| node.node_type.name.to_string()));
    }
    let all: BTreeSet<String> = NODES.iter().map(|node_type| node_type.name.to_string()).collect();
    assert_eq!(used, all, "a hundred graphs use every node type");
}

#[test]
fn graphs_of_the_folder_check_clean() {
    let good = files("check/good");
    assert!(good.len() >= 2);
    for (name, text) in good {
        for text in [text.clone(), text.replace('\n', "\r\n"), text.replace("    ", "\t")] {
            let checked = faults_of(&text);
            assert!(checked.faults.is_empty() && checked.warnings.is_empty(), "{name}\n{:#?}", checked.faults);
        }
    }
}

/// The first cases of the harness that runs a million.
#[test]
fn nothing_that_is_checked_panics() {
    fuzz(&Pool::new(&NODES), &NODES, 0, 4000).expect_none();
}
