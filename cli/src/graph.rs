//! `warploom graph`: the structure of a graph, for people and programs.

use serde_json::json;
use warploom_core::graph::plan::Plan;
use warploom_core::registry::Registry;

use crate::args::{GraphArgs, GraphFormat};
use crate::terminal::{say, show};

/// The command.
pub fn graph(args: &GraphArgs, registry: &Registry) -> u8 {
    let checked = crate::check::read(&args.file, &[], registry);
    let Some(plan) = checked.plan else {
        checked.faults.iter().for_each(|fault| show(fault, false));
        return 2;
    };
    say(match args.format {
        GraphFormat::Dot => dot(&plan),
        GraphFormat::Mermaid => mermaid(&plan),
        GraphFormat::Json => json(&plan),
    }
    .trim_end());
    0
}

/// Source node, its output, node, its port or linked parameter.
fn edges(plan: &Plan) -> Vec<(usize, &str, usize, String)> {
    let mut edges = Vec::new();
    for (index, node) in plan.nodes.iter().enumerate() {
        let output = |source: usize, output: usize| plan.nodes[source].node_type.outputs[output].name;
        edges.extend(node.slots.iter().map(|s| (s.source, output(s.source, s.output), index, s.port.clone())));
        let links = node.params.links();
        edges.extend(
            node.links.iter().zip(links).map(|(&(source, out), name)| (source, output(source, out), index, name)),
        );
    }
    edges
}

fn dot(plan: &Plan) -> String {
    let mut text = String::from("digraph {\n    rankdir=LR\n    node [shape=box]\n");
    for (index, node) in plan.nodes.iter().enumerate() {
        text += &format!("    n{index} [label=\"{}\\n{}\"]\n", node.id, node.node_type.name);
    }
    for (from, output, to, port) in edges(plan) {
        text += &format!("    n{from} -> n{to} [taillabel=\"{output}\", headlabel=\"{port}\"]\n");
    }
    text + "}\n"
}

fn mermaid(plan: &Plan) -> String {
    let mut text = String::from("flowchart LR\n");
    for (index, node) in plan.nodes.iter().enumerate() {
        text += &format!("    n{index}[\"{}<br>{}\"]\n", node.id, node.node_type.name);
    }
    for (from, output, to, port) in edges(plan) {
        text += &format!("    n{from} -- \"{output} to {port}\" --> n{to}\n");
    }
    text
}

fn json(plan: &Plan) -> String {
    let nodes: Vec<_> = (plan.nodes.iter())
        .map(|node| json!({ "node": &*node.id, "type": node.node_type.name, "static": node.is_static }))
        .collect();
    let edges: Vec<_> = (edges(plan).into_iter())
        .map(|(from, output, to, port)| {
            json!({ "from": &*plan.nodes[from].id, "output": output, "to": &*plan.nodes[to].id, "port": port })
        })
        .collect();
    let targets: Vec<_> = plan.targets.iter().map(|&target| &*plan.nodes[target].id).collect();
    json!({ "schema": 1, "nodes": nodes, "edges": edges, "targets": targets }).to_string()
}
