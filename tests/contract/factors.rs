//! A factor serves the nodes of its own solver.

use warploom_core::diag::Code;

use crate::given::Which;
use crate::stage::{Stage, Subject, engine, node_types};

#[test]
fn another_solvers_factor_is_refused() {
    let (stage, engine) = (Stage::new(), engine(2));
    for (name, port, source, message) in [
        ("Handles", "factor", "factor", "the factor is another solver's (\"feature-aware\")"),
        ("FeatureWarp", "factor", "pins", "the factor is another solver's (\"handles\")"),
        ("Similarity", "guide", "sets", "the factor is another solver's (\"similar-sets\")"),
        ("Detail", "sets", "pins", "the factor is another solver's (\"handles\")"),
    ] {
        let node_type = node_types().find(|node_type| &*node_type.name == name).expect("it is in the list");
        let outcome = stage.run(&engine, &Subject::new(node_type, Which::Plain).connected(port, source));
        let [fault] = &outcome.report.faults[..] else { panic!("one fault: {:#?}", outcome.report.faults) };
        assert_eq!((fault.code, &*fault.message), (Code::Refused, message), "{name}");
        assert!(fault.hint.as_deref().is_some_and(|hint| hint.starts_with("connect a ")), "{name}");
        assert_eq!((fault.node.as_deref(), fault.parameter.as_deref()), (Some("it"), Some(port)), "{name}");
    }
}
