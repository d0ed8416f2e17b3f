//! Graphs at the edge of what is read: very long, very deep, very wrong.

use warploom_core::diag::Fault;
use warploom_core::graph::check::{MAX_BYTES, MAX_NODES};

use crate::faults_of;

fn graph(nodes: &str) -> String {
    format!("Graph(version: 1, nodes: {{\n{nodes}}})\n")
}

/// A card, held over and over, and saved: so many nodes, each fed by the one before it.
fn chain(count: usize) -> String {
    let mut nodes = String::from("\"n0\": Constant(),\n");
    for number in 1..count - 1 {
        nodes += &format!("\"n{number}\": FrameHold(input: \"n{}\"),\n", number - 1);
    }
    graph(&(nodes + &format!("\"out\": Save(image: \"n{}\", path: \"out.exr\"),\n", count - 2)))
}

fn one(faults: &[Fault]) -> (&str, usize, usize, &str) {
    let [fault] = faults else { panic!("{faults:#?}") };
    let place = fault.place.as_ref().expect("a place");
    (fault.code.name(), place.line, place.column, &fault.message)
}

#[test]
fn a_chain_of_as_many_nodes_as_there_may_be() {
    let checked = faults_of(&chain(MAX_NODES));
    assert!(checked.faults.is_empty() && checked.warnings.is_empty(), "{:#?}", checked.faults.first());
    let plan = checked.plan.expect("a plan");
    assert_eq!(plan.order.len(), MAX_NODES);
    let mut done = vec![false; MAX_NODES];
    for &node in &plan.order {
        assert!(plan.nodes[node].slots.iter().all(|slot| done[slot.source]), "each after its inputs");
        done[node] = true;
    }
}

#[test]
fn one_node_too_many() {
    let checked = faults_of(&chain(MAX_NODES + 1));
    let (code, line, column, message) = one(&checked.faults);
    assert_eq!((code, line, column), ("too_large", 1, 26));
    assert!(message.contains("100001 nodes") && message.contains("at most 100000"), "{message}");
}

#[test]
fn one_byte_too_many() {
    let small = graph("\"card\": Constant(), \"out\": Save(image: \"card\", path: \"out.exr\")");
    let full = format!("//{}\n{small}", "x".repeat(MAX_BYTES - 3 - small.len()));
    assert_eq!(full.len(), 16 << 20);
    assert!(faults_of(&full).faults.is_empty());
    let checked = faults_of(&format!("{full} "));
    let (code, line, column, message) = one(&checked.faults);
    assert_eq!((code, line, column), ("too_large", 1, 1));
    assert!(message.contains("16777217 bytes") && message.contains("at most 16777216"), "{message}");
}

#[test]
fn brackets_however_deep() {
    for (open, close) in [("[", "]"), ("(", ")"), ("{1:", "}"), ("Some(", ")"), ("a(b:", ")")] {
        for depth in [50, 200, 100_000] {
            let value = format!("{}1{}", open.repeat(depth), close.repeat(depth));
            let nodes = format!("\"a\": Constant(size: {value}),\n\"b\": Constant(size: (0, 1))");
            let faults = faults_of(&graph(&nodes)).faults;
            assert!(faults.iter().any(|fault| fault.node.as_deref() == Some("a")), "{open} {depth}: {faults:#?}");
            assert!(depth > 50 || faults.iter().any(|fault| fault.node.as_deref() == Some("b")), "{open} {depth}");
            assert!(!faults_of(&open.repeat(depth)).faults.is_empty());
        }
    }
}

#[test]
fn a_cycle_of_any_length_is_printed_whole() {
    let count = 30_000;
    let node = |number: usize| format!("\"n{number}\": FrameHold(input: \"n{}\"),\n", (number + count - 1) % count);
    let text = graph(
        &((0..count).map(node).collect::<String>() + "\"c\": Constant(), \"o\": Save(image: \"c\", path: \"o.exr\")"),
    );
    let checked = faults_of(&text);
    let (code, line, column, message) = one(&checked.faults);
    assert_eq!((code, line, column), ("cycle", 2, 7));
    assert_eq!(message.matches(" -> ").count(), count);
    assert!(message.contains("cycle: `n0` -> `n1` -> ") && message.ends_with("`n29999` -> `n0`"));
}

/// All are found, and hints do not make the time grow with their square.
#[test]
fn as_many_faults_as_nodes() {
    let count = 50_000;
    let nodes: String = (0..count).map(|n| format!("\"node{n}\": Over(images: [\"noed{n}\"], x: 1),\n")).collect();
    let faults = faults_of(&graph(&nodes)).faults;
    assert_eq!(faults.len(), 2 * count + 1, "an unknown node and parameter each, and no sink");
    assert!(faults.iter().all(|fault| fault.hint.is_some()));
}

/// A fault names its file whatever the text around it is.
#[test]
fn a_text_of_one_long_line() {
    let filler = "\"é\", ".repeat(200_000);
    let text = format!("Graph(version: 1, x: [{filler}], nodes: {{\"a\": Grow(mask: \"b\", by: 5000)}})");
    let faults = faults_of(&text).faults;
    let at = text.find("5000").expect("it is there");
    let column = text[..at].chars().count() + 1;
    assert!(faults.iter().any(|fault| fault.place.as_ref().is_some_and(|place| place.column == column)));
}

#[test]
fn a_long_line_full_of_faults_is_not_kept_whole_for_each() {
    let nodes: String =
        (0..4000).map(|number| format!("\"n{number}\": FrameHold(input: \"gone{number}\"), ")).collect();
    let checked = faults_of(&format!("Graph(version: 1, nodes: {{ {nodes} }})"));
    let places: Vec<_> = checked.faults.iter().filter_map(|fault| fault.place.as_ref()).collect();
    assert!(places.len() >= 4000);
    assert!(places.iter().all(|place| place.text.chars().count() <= 240));
    let last = checked.faults.iter().rfind(|fault| fault.node.as_deref() == Some("n3999")).expect("a fault");
    let place = last.place.as_ref().expect("a place");
    assert!(last.render(false, false, 100).contains(&format!("graph.ron:1:{}", place.column)));
}
