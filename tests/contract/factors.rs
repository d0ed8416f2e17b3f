//! A factor serves the nodes of its own solver.

use std::path::Path;

use warploom_core::diag::Code;
use warploom_core::graph::{Options, check};

use crate::given::Which;
use crate::stage::{REGISTRY, Subject, node_types};

#[test]
fn another_solvers_factor_is_refused() {
    for (name, port, source, takes, gives) in [
        ("Handles", "factor", "factor", "HandleFactor", "FeatureFactor"),
        ("FeatureWarp", "factor", "pins", "FeatureFactor", "HandleFactor"),
        ("Similarity", "guide", "sets", "SimilarityGuide", "SimilarSets"),
        ("Detail", "sets", "pins", "SimilarSets", "HandleFactor"),
    ] {
        let node_type = node_types().find(|node_type| &*node_type.name == name).expect("it is in the list");
        let graph = Subject::new(node_type, Which::Plain).connected(port, source).graph();
        let options = Options { targets: &["it".to_owned()], ..Options::new(Path::new("graph.ron")) };
        let faults = check(&graph, &REGISTRY, &options).faults;
        let [fault] = &faults[..] else { panic!("one fault: {faults:#?}") };
        let message = format!(
            "`{port}` takes a node that gives the Factor of a {takes}; `{source}` gives the Factor of a {gives}"
        );
        assert_eq!((fault.code, &fault.message), (Code::WrongKind, &message), "{name}");
        assert!(fault.hint.as_deref().is_some_and(|hint| hint.ends_with("would fit")), "{name}");
        assert_eq!((fault.node.as_deref(), fault.parameter.as_deref()), (Some("it"), Some(port)), "{name}");
    }
}
