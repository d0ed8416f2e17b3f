//! What a node type says of itself.

use warploom_core::node::OutputKind;
use warploom_core::schema::{self, Param, Shape};
use warploom_nodes::NODES;

use crate::given::Which;
use crate::stage::{Stage, Subject, engine, node_types};
use crate::texts;

/// Units that parameters may have; a number without one is a plain number.
const UNITS: [&str; 6] = ["px", "deg", "percent", "cells", "frames", "seconds"];

#[test]
fn names_are_unique_and_the_list_is_sorted() {
    for pair in NODES.windows(2) {
        assert!(pair[0].0 < pair[1].0, "{} before {}", pair[0].0, pair[1].0);
    }
    for node_type in node_types() {
        let name = &node_type.name;
        assert!(name.starts_with(|c: char| c.is_ascii_uppercase()), "{name}");
        assert!(name.chars().all(|c| c.is_ascii_alphanumeric()), "{name}");
        let outputs = node_type.outputs.iter().map(|output| output.name);
        for name in node_type.params.iter().map(|param| param.name.as_str()).chain(outputs.clone()) {
            assert!(name.chars().all(|c| c.is_ascii_lowercase() || c == '_'), "{}.{name}", node_type.name);
        }
        for (number, output) in outputs.enumerate() {
            assert_eq!(node_type.output(output), Some(number), "{}.{output} is one output", node_type.name);
        }
    }
}

#[test]
fn everything_is_documented() {
    for node_type in node_types() {
        assert_sentences(&node_type.name, &node_type.doc);
        node_type.params.iter().for_each(|param| assert_documented(&node_type.name, param));
    }
}

fn assert_documented(owner: &str, param: &Param) {
    let name = format!("{owner}.{}", param.name);
    assert_sentences(&name, &param.doc);
    match &param.shape {
        Shape::Struct(fields) => fields.iter().for_each(|field| assert_documented(&name, field)),
        Shape::Choice(variants) => {
            variants.iter().for_each(|variant| assert_sentences(&format!("{name}: {}", variant.name), &variant.doc));
        }
        _ => {}
    }
}

fn assert_sentences(name: &str, doc: &str) {
    assert!(doc.ends_with('.') && doc.len() > 5, "{name} is documented in sentences, found {doc:?}");
}

#[test]
fn units_are_known() {
    for node_type in node_types() {
        for param in &node_type.params {
            if let Some(unit) = &param.unit {
                assert!(UNITS.contains(&unit.as_str()), "{}.{} is in {unit}", node_type.name, param.name);
            }
        }
    }
}

#[test]
fn outputs_are_of_kinds_that_can_be() {
    for node_type in node_types() {
        assert_eq!(
            node_type.outputs.is_empty(),
            node_type.sink,
            "{}: a sink, and only a sink, gives nothing",
            node_type.name
        );
        for output in node_type.outputs {
            if let OutputKind::SameAs(port) = output.kind {
                let is_port = node_type.ports().any(|(param, _)| param.name == port);
                assert!(is_port, "{}.{} is of the kind of a port, not of {port}", node_type.name, output.name);
            }
        }
    }
}

#[test]
fn defaults_lie_in_their_ranges() {
    for node_type in node_types() {
        for param in node_type.params.iter().filter(|param| !param.required) {
            let name = format!("{}.{}", node_type.name, param.name);
            assert_legal(&name, &param.shape, &param.default);
        }
    }
}

fn assert_legal(name: &str, shape: &Shape, value: &serde_json::Value) {
    let number = || value.as_f64().unwrap_or_else(|| panic!("{name} is a number, not {value}"));
    match shape {
        Shape::Number(range) => assert!(range.holds(number()), "{name}: {value} is not {range}"),
        Shape::Integer { range, .. } => {
            let whole = value.as_i64().map(i128::from).or(value.as_u64().map(i128::from));
            assert!(
                whole.is_some_and(|whole| (range.min..=range.max).contains(&whole)),
                "{name}: {value}, not {range}"
            );
        }
        Shape::Tuple(shapes) => {
            assert_eq!(value.as_array().map(Vec::len), Some(shapes.len()), "{name}");
            shapes.iter().enumerate().for_each(|(index, shape)| assert_legal(name, shape, &value[index]));
        }
        Shape::Choice(variants) => {
            assert!(variants.iter().any(|variant| value == variant.name.as_str()), "{name}: {value}");
        }
        Shape::Optional(inner) if !value.is_null() => assert_legal(name, inner, value),
        Shape::List(item) => value.as_array().into_iter().flatten().for_each(|value| assert_legal(name, item, value)),
        Shape::Struct(fields) => {
            fields.iter().for_each(|field| assert_legal(name, &field.shape, &value[&field.name]));
        }
        Shape::Bool => assert!(value.is_boolean(), "{name}: {value}"),
        _ => {}
    }
}

/// What a plugin ships as text comes to the same parameters.
#[test]
fn schemas_survive_being_written() {
    for node_type in node_types() {
        let name = &node_type.name;
        let defaults: serde_json::Map<_, _> =
            node_type.params.iter().map(|param| (param.name.clone(), param.default.clone())).collect();
        let written = serde_json::to_string(&node_type.schema).expect("JSON");
        let read = serde_json::from_str(&written).expect("JSON");
        assert_eq!(schema::params(&read, &defaults.into()).as_ref(), Ok(&node_type.params), "{name}");
    }
}

/// From the struct's default to JSON to a graph file to a struct: the JSON and the key stay the same.
#[test]
fn defaults_may_be_written_out() {
    let stage = Stage::new();
    for node_type in node_types() {
        let name = &node_type.name;
        let left_out = Subject::new(node_type, Which::Plain);
        let mut written = left_out.clone();
        let optional = node_type.params.iter().filter(|p| !p.required && !matches!(p.shape, Shape::Port(_)));
        optional.for_each(|p| written = written.with(&p.name, &texts::text(&p.shape, &p.default)));
        let json = |subject: &Subject| {
            let checked = stage.check(&subject.graph(), None);
            let plan = checked.plan.unwrap_or_else(|| panic!("{}\n{:#?}", subject.graph(), checked.faults));
            plan.nodes[plan.node("it").expect("it is there")].params.json.clone()
        };
        assert_eq!(json(&left_out), json(&written), "{name}");
        for param in node_type.params.iter().filter(|param| !param.required && !param.default.is_null()) {
            assert_eq!(json(&written)[&param.name], param.default, "{name}.{}", param.name);
        }
        let engine = engine(2);
        let first = stage.run(&engine, &left_out);
        assert!(first.report.faults.is_empty(), "{name}: {:#?}", first.report.faults);
        let again = stage.run(&engine, &written);
        let executed = again.report.nodes.iter().filter(|p| p.status == warploom_core::engine::Status::Executed);
        assert_eq!(executed.count(), 0, "{name}: a default that is written out is the same value");
    }
}
