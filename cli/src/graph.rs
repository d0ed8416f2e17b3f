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

/// An output of a node that is read by a port of another, or by a parameter that is linked to it.
struct Edge<'a> {
    from: usize,
    output: &'a str,
    to: usize,
    port: String,
    linked: bool,
}

fn edges(plan: &Plan) -> Vec<Edge<'_>> {
    let mut edges = Vec::new();
    for (to, node) in plan.nodes.iter().enumerate() {
        let edge = |from: usize, output: usize, port: String, linked: bool| {
            let output = plan.nodes[from].node_type.outputs[output].name;
            Edge { from, output, to, port, linked }
        };
        edges.extend(node.slots.iter().map(|slot| edge(slot.source, slot.output, slot.port.clone(), false)));
        let links = node.links.iter().zip(node.params.links());
        edges.extend(links.map(|(&(from, output), name)| edge(from, output, name, true)));
    }
    edges
}

/// Whether each node is a target.
fn targets(plan: &Plan) -> Vec<bool> {
    let mut is_target = vec![false; plan.nodes.len()];
    plan.targets.iter().for_each(|&target| is_target[target] = true);
    is_target
}

/// A text between double quotes of Graphviz's language, in which a backslash begins an escape.
fn dot_text(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

fn dot(plan: &Plan) -> String {
    let mut text = String::from("digraph {\n    rankdir=LR\n    node [shape=box]\n");
    for (index, (node, is_target)) in plan.nodes.iter().zip(targets(plan)).enumerate() {
        let shape = match (node.node_type.sink, is_target) {
            (true, _) => ", shape=cylinder",
            (false, true) => ", peripheries=2",
            (false, false) => "",
        };
        let (id, of) = (dot_text(&node.id), dot_text(&node.node_type.name));
        text += &format!("    n{index} [label=\"{id}\\n{of}\"{shape}]\n");
    }
    for edge in edges(plan) {
        let (from, to, style) = (edge.from, edge.to, if edge.linked { ", style=dashed" } else { "" });
        let (output, port) = (dot_text(edge.output), dot_text(&edge.port));
        text += &format!("    n{from} -> n{to} [taillabel=\"{output}\", headlabel=\"{port}\"{style}]\n");
    }
    text + "}\n"
}

/// A text between double quotes of Mermaid's language, which knows no escapes but these, and reads markup.
fn mermaid_text(text: &str) -> String {
    let mut quoted = String::new();
    for c in text.chars() {
        match c {
            '"' | '#' | '&' | '<' | '>' | '`' | '\\' | '\n' => quoted += &format!("#{};", u32::from(c)),
            c => quoted.push(c),
        }
    }
    quoted
}

fn mermaid(plan: &Plan) -> String {
    let mut text = String::from("flowchart LR\n");
    for (index, (node, is_target)) in plan.nodes.iter().zip(targets(plan)).enumerate() {
        let (open, close) = match (node.node_type.sink, is_target) {
            (true, _) => ("[(", ")]"),
            (false, true) => ("[[", "]]"),
            (false, false) => ("[", "]"),
        };
        let (id, of) = (mermaid_text(&node.id), mermaid_text(&node.node_type.name));
        text += &format!("    n{index}{open}\"{id}<br>{of}\"{close}\n");
    }
    for edge in edges(plan) {
        let (from, to) = (edge.from, edge.to);
        let (line, arrow) = if edge.linked { ("-.", ".->") } else { ("--", "-->") };
        let label = format!("{} to {}", mermaid_text(edge.output), mermaid_text(&edge.port));
        text += &format!("    n{from} {line} \"{label}\" {arrow} n{to}\n");
    }
    text
}

fn json(plan: &Plan) -> String {
    let nodes: Vec<_> = (plan.nodes.iter())
        .map(|node| json!({ "node": &*node.id, "type": node.node_type.name, "static": node.is_static }))
        .collect();
    let edges: Vec<_> = (edges(plan).into_iter())
        .map(|edge| {
            let (from, to) = (&*plan.nodes[edge.from].id, &*plan.nodes[edge.to].id);
            json!({ "from": from, "output": edge.output, "to": to, "port": edge.port, "linked": edge.linked })
        })
        .collect();
    let targets: Vec<_> = plan.targets.iter().map(|&target| &*plan.nodes[target].id).collect();
    json!({ "schema": 1, "nodes": nodes, "edges": edges, "targets": targets }).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_any_letters_stay_texts() {
        assert_eq!(dot_text("a\"b\\c\nü]"), r#"a\"b\\c\nü]"#);
        assert_eq!(mermaid_text("a\"b<c>#ü]"), "a#34;b#60;c#62;#35;ü]");
    }
}
