//! Parameters count, and are held to their ranges.

use warploom_core::diag::Code;
use warploom_core::engine::{Engine, Reason, Status};
use warploom_core::schema::{Access, Shape};

use crate::given::Which;
use crate::stage::{Stage, Subject, engine, node_types};
use crate::texts;

/// A node type's usual graph, and a change that must be seen.
fn assert_seen(stage: &Stage, engine: &Engine, usual: &Subject, changed: &Subject) -> bool {
    let graph = changed.graph();
    let status = stage.run(engine, changed).status();
    let seen = matches!(status, Some(Status::Executed | Status::Failed));
    let before = stage.run(engine, usual);
    for pair in before.report.nodes.iter().filter(|pair| pair.status == Status::Executed) {
        // The change has written to the very file that is wanted back.
        let rewritten = pair.why.as_ref().is_some_and(|why| why.code == Reason::OutputChanged);
        assert!(rewritten, "set back, {} executes: {:?}\n{graph}", pair.node, pair.why);
    }
    assert!(seen || changed.graph() == usual.graph() || is_default(stage, usual, changed), "{status:?}\n{graph}");
    status == Some(Status::Executed)
}

/// Whether parameters were only set to the values that they have.
fn is_default(stage: &Stage, usual: &Subject, changed: &Subject) -> bool {
    let params = |subject: &Subject| {
        let plan = stage.check(&subject.graph(), None).plan.expect("it ran");
        plan.nodes[plan.node("it").expect("it is in the graph")].params.json.clone()
    };
    changed.params == usual.params || params(changed) == params(usual)
}

#[test]
fn every_parameter_and_port_changes_the_key() {
    let stage = Stage::new();
    for node_type in node_types() {
        let engine = engine(2);
        let usual = Subject::new(node_type, Which::Odd);
        assert!(stage.run(&engine, &usual).report.faults.is_empty(), "{}", usual.graph());
        let changes = usual.reset(texts::others).into_iter().chain(usual.reconnected());
        let mut effective = std::collections::BTreeSet::new();
        for changed in changes.collect::<Vec<_>>() {
            if assert_seen(&stage, &engine, &usual, &changed) {
                let params = changed.params.iter().filter(|(name, text)| usual.params.get(*name) != Some(*text));
                let ports = changed.ports.iter().filter(|(name, source)| usual.ports[*name] != **source);
                effective.extend(params.map(|(name, _)| name.clone()).chain(ports.map(|(name, _)| name.clone())));
            }
        }
        let all: Vec<&str> = node_type.params.iter().map(|param| param.name.as_str()).collect();
        let missed: Vec<_> = all.iter().filter(|name| !effective.contains(**name)).collect();
        assert!(missed.is_empty(), "{}: nothing shows that {missed:?} can be changed", node_type.name);
    }
}

#[test]
fn files_count_by_content() {
    let stage = Stage::new();
    for node_type in node_types() {
        for param in node_type.params.iter().filter(|param| param.shape == Shape::Text(Some(Access::Read))) {
            let engine = engine(1);
            let usual = Subject::new(node_type, Which::Plain);
            assert_eq!(stage.run(&engine, &usual).status(), Some(Status::Executed), "{}", usual.graph());
            let copy = usual.with(&param.name, "\"in/Copy.exr\"");
            assert_eq!(stage.run(&engine, &copy).status(), Some(Status::Reused), "{}", copy.graph());
        }
    }
}

#[test]
fn values_beyond_the_hard_range_are_refused() {
    let stage = Stage::new();
    let mut checked = 0;
    for node_type in node_types() {
        let usual = Subject::new(node_type, Which::Plain);
        let refused = |subject: &Subject, code: Code| {
            let faults = stage.check(&subject.graph(), Some(vec![1])).faults;
            let found = faults.iter().find(|fault| fault.code == code && fault.node.as_deref() == Some("it"));
            let fault = found.unwrap_or_else(|| panic!("no {code:?}\n{}\n{faults:#?}", subject.graph()));
            let name = fault.parameter.as_deref().expect("it names the parameter");
            assert!(usual.params.get(name) != subject.params.get(name), "{fault:#?}\n{}", subject.graph());
            assert!(fault.place.is_some(), "{fault:#?}");
        };
        for subject in usual.reset(texts::beyond) {
            refused(&subject, Code::OutOfRange);
            checked += 1;
        }
        for subject in usual.reset(not_finite) {
            refused(&subject, Code::NotFinite);
        }
        for subject in usual.reset(|leaf| keys(leaf, texts::beyond(leaf))) {
            refused(&subject, Code::OutOfRange);
        }
    }
    assert!(checked > 40, "{checked} values were tried");
}

fn not_finite(leaf: &Shape) -> Vec<String> {
    match leaf {
        Shape::Number(_) => ["NaN", "inf", "-inf"].map(str::to_owned).into(),
        _ => Vec::new(),
    }
}

/// The values as Keys, where these are allowed.
fn keys(leaf: &Shape, values: Vec<String>) -> Vec<String> {
    match leaf {
        Shape::Number(_) | Shape::Integer { animatable: true, .. } => {
            values.iter().map(|value| format!("Keys([(1, {value})])")).collect()
        }
        _ => Vec::new(),
    }
}

#[test]
fn ends_of_the_hard_range_are_taken() {
    let stage = Stage::new();
    for node_type in node_types() {
        for subject in Subject::new(node_type, Which::Plain).reset(texts::extremes) {
            let faults = stage.check(&subject.graph(), None).faults;
            assert!(faults.is_empty(), "{}\n{faults:#?}", subject.graph());
        }
    }
}
