//! Names to nodes, kinds along edges, and the order of it all.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use petgraph::graph::{DiGraph, NodeIndex};
use petgraph::{Direction, algo};

use super::Reporter;
use super::document::{Graph, is_id};
use super::values::{Draft, Reference};
use crate::diag::{Code, Fault};
use crate::graph::plan::Slot;
use crate::node::OutputKind;
use crate::schema::{Arity, PortShape};
use crate::value::{Kind, Reads};

/// Drafts with their connections.
pub(super) struct Wired {
    pub drafts: Vec<Option<Draft>>,
    /// Per node, its slots; the reads are filled in later.
    pub slots: Vec<Vec<Slot>>,
    /// Per node, source and output of its links.
    pub links: Vec<Vec<(usize, usize)>>,
    /// All nodes, each after its inputs but for those in a cycle, which is a fault.
    pub order: Vec<usize>,
    /// Per node and output, its kind where that is known.
    pub kinds: Vec<Vec<Option<Kind>>>,
}

/// What comes out of an output: its kind, and the node that made it, which others may only pass on.
#[derive(Clone, Copy)]
struct Given {
    kind: Kind,
    maker: usize,
}

impl Wired {
    /// What feeds a node.
    pub fn sources(&self, index: usize) -> impl Iterator<Item = usize> {
        let slots = self.slots[index].iter().map(|slot| slot.source);
        slots.chain(self.links[index].iter().map(|&(source, _)| source))
    }
}

/// An edge that has both ends.
struct Edge {
    from: usize,
    output: Option<usize>,
}

/// What feeds a node's ports, and its linked numbers.
type Incoming = (Vec<Option<Edge>>, Vec<Option<Edge>>);

pub(super) fn wire(graph: &Graph, drafts: Vec<Option<Draft>>, report: &mut Reporter) -> Wired {
    let mut edges: Vec<Incoming> = Vec::with_capacity(drafts.len());
    for (index, draft) in drafts.iter().enumerate() {
        let mut resolve = |reference: &Reference| resolve(graph, index, reference, report);
        edges.push(match draft {
            Some(draft) => {
                (draft.ports.iter().map(&mut resolve).collect(), draft.links.iter().map(&mut resolve).collect())
            }
            None => (Vec::new(), Vec::new()),
        });
    }
    let order = order(graph, &drafts, &edges, report);
    let given = given(graph, &drafts, &edges, &order, report);
    let kind = |given: Vec<Option<Given>>| given.into_iter().map(|given| Some(given?.kind)).collect();
    let kinds = given.into_iter().map(kind).collect();
    let slots = drafts.iter().zip(&edges).map(|(draft, (ports, _))| {
        let references = draft.iter().flat_map(|draft| &draft.ports);
        (references.zip(ports))
            .filter_map(|(reference, edge)| {
                let edge = edge.as_ref()?;
                let (port, output) = (reference.param.clone(), edge.output?);
                Some(Slot { port, source: edge.from, output, reads: Reads::All })
            })
            .collect()
    });
    let links = edges.iter().map(|(_, links)| {
        links.iter().filter_map(|edge| edge.as_ref().and_then(|edge| Some((edge.from, edge.output?)))).collect()
    });
    Wired { slots: slots.collect(), links: links.collect(), order, kinds, drafts }
}

fn resolve(graph: &Graph, index: usize, reference: &Reference, report: &mut Reporter) -> Option<Edge> {
    // A name with a dot is a fault of its own; it stands for the node all the same.
    let whole = reference.text.as_str();
    let (id, output) = match whole.split_once('.').filter(|_| !graph.index.contains_key(whole)) {
        Some((id, output)) => (id, Some(output)),
        None => (whole, None),
    };
    let fault = |code, message| Fault::new(code, message).node(graph.nodes[index].id).parameter(&reference.param);
    let Some(&from) = graph.index.get(id) else {
        let (message, hint) = match unlike_a_name(reference, id) {
            Some(hint) => (format!("\"{whole}\" names no node"), Some(hint)),
            None => (format!("there is no node `{id}`"), graph.suggestion(id, index, report)),
        };
        report.add(reference.at, fault(Code::UnknownNode, message).hint(hint));
        return None;
    };
    let Some(node_type) = &graph.nodes[from].node_type else { return Some(Edge { from, output: None }) };
    let found = match output {
        Some(name) => node_type.output(name),
        None => (!node_type.outputs.is_empty()).then_some(0),
    };
    if found.is_none() {
        let names = node_type.outputs.iter().map(|output| output.name);
        let (message, hint) = match output {
            Some(name) if !node_type.outputs.is_empty() => (
                format!("`{id}` of type {} has no output `{name}`", node_type.name),
                crate::diag::suggestion(name, names),
            ),
            _ => (
                format!("`{id}` of type {} has no outputs: it only writes", node_type.name),
                Some(format!("connect what feeds `{id}`")),
            ),
        };
        report.add(reference.at, fault(Code::UnknownOutput, message).hint(hint));
    }
    Some(Edge { from, output: found })
}

/// What to write instead of a text that was not meant to be a node's name, or is none at all.
fn unlike_a_name(reference: &Reference, id: &str) -> Option<String> {
    let text = reference.text.trim();
    let begins = |c: char| c.is_ascii_digit() || "+-.".contains(c);
    let takes_list = reference.port.as_ref().is_some_and(|port| port.arity == Arity::List);
    Some(match &reference.port {
        None if text.parse::<f64>().is_ok() => "a number stands without quotes".into(),
        None if text.starts_with("Keys") && text.contains('(') => "Keys stand without quotes".into(),
        None if !is_id(id) && text.starts_with(begins) && text.len() > 1 => {
            "a number stands without quotes and unit; nothing is computed here".into()
        }
        None if text.contains(['+', '*', '/', '(', '<', '>', '=']) => {
            "nothing is computed here: write a number, Keys, or \"node.port\"".into()
        }
        Some(_) if takes_list && text.contains(',') => {
            let names: Vec<String> = text.split(',').map(|name| format!("\"{}\"", name.trim())).collect();
            format!("use brackets: [{}]", names.join(", "))
        }
        _ if id.is_empty() => "write \"node\" or \"node.port\"".into(),
        _ => return None,
    })
}

/// A topological order, and one fault per knot of cycles.
fn order(graph: &Graph, drafts: &[Option<Draft>], edges: &[Incoming], report: &mut Reporter) -> Vec<usize> {
    let mut net = DiGraph::<(), ()>::with_capacity(edges.len(), edges.len());
    (0..edges.len()).for_each(|_| {
        net.add_node(());
    });
    for (index, (ports, links)) in edges.iter().enumerate() {
        for edge in ports.iter().chain(links).flatten() {
            net.add_edge(NodeIndex::new(edge.from), NodeIndex::new(index), ());
        }
    }
    if let Ok(order) = algo::toposort(&net, None) {
        return order.into_iter().map(NodeIndex::index).collect();
    }
    let knots = algo::kosaraju_scc(&net);
    for knot in &knots {
        let first = knot.iter().map(|node| node.index()).min().unwrap_or_default();
        let is_loop = knot.len() > 1 || net.contains_edge(knot[0], knot[0]);
        if let Some(draft) = drafts[first].as_ref().filter(|_| is_loop) {
            let cycle = cycle_through(&net, first);
            let names: Vec<String> = cycle.iter().map(|&node| format!("`{}`", graph.nodes[node].id)).collect();
            let message = format!("the nodes form a cycle: {} -> {}", names.join(" -> "), names[0]);
            let hint = match &names[..] {
                [only] => format!("disconnect {only} from itself"),
                [first, .., last] => format!("disconnect one of them from the next, for example {last} from {first}"),
                [] => String::new(),
            };
            report.add(draft.at, Fault::new(Code::Cycle, message).node(graph.nodes[first].id).hint(hint));
        }
    }
    knots.into_iter().rev().flatten().map(NodeIndex::index).collect()
}

/// The shortest cycle through a node, along edges from it, by breadth-first search.
fn cycle_through(net: &DiGraph<(), ()>, start: usize) -> Vec<usize> {
    let mut from: HashMap<usize, usize> = HashMap::new();
    let mut queue = std::collections::VecDeque::from([start]);
    while let Some(at) = queue.pop_front() {
        for next in net.neighbors_directed(NodeIndex::new(at), Direction::Outgoing) {
            if next.index() == start {
                let mut path = vec![at];
                while let Some(&before) = path.last().filter(|last| **last != start).and_then(|last| from.get(last)) {
                    path.push(before);
                }
                path.reverse();
                return path;
            }
            if let Entry::Vacant(unseen) = from.entry(next.index()) {
                unseen.insert(at);
                queue.push_back(next.index());
            }
        }
    }
    vec![start]
}

/// What all outputs give, and a fault per edge where it does not fit.
fn given(
    graph: &Graph,
    drafts: &[Option<Draft>],
    edges: &[Incoming],
    order: &[usize],
    report: &mut Reporter,
) -> Vec<Vec<Option<Given>>> {
    let mut given: Vec<Vec<Option<Given>>> = (graph.nodes.iter().enumerate())
        .map(|(maker, node)| {
            let outputs = node.node_type.iter().flat_map(|node_type| node_type.outputs);
            let fixed = |output: &crate::node::Output| match output.kind {
                OutputKind::Is(kind) => Some(Given { kind, maker }),
                OutputKind::SameAs(_) => None,
            };
            outputs.map(fixed).collect()
        })
        .collect();
    // In a cycle some kinds that are not fixed stay unknown.
    for &index in order {
        let Some(draft) = &drafts[index] else { continue };
        let (ports, links) = &edges[index];
        for (number, output) in draft.node_type.outputs.iter().enumerate() {
            if let OutputKind::SameAs(port) = output.kind {
                let fed = draft.ports.iter().zip(ports).find(|(reference, _)| reference.param == port);
                let edge = fed.and_then(|(_, edge)| edge.as_ref());
                given[index][number] = edge.and_then(|edge| given[edge.from][edge.output?]);
            }
        }
        let references = draft.ports.iter().zip(ports).chain(draft.links.iter().zip(links));
        for (reference, edge) in references {
            let Some(edge) = edge else { continue };
            if let Some(given) = edge.output.and_then(|output| given[edge.from][output]) {
                check_edge(graph, index, reference, given, edge.from, report);
            }
        }
    }
    given
}

fn check_edge(graph: &Graph, index: usize, reference: &Reference, given: Given, from: usize, report: &mut Reporter) {
    let number = PortShape::of(Kind::Number);
    let port = reference.port.as_ref().unwrap_or(&number);
    let maker = graph.nodes[given.maker].node_type.as_ref().map(|node_type| &*node_type.name);
    if port.takes(given.kind, maker) {
        return;
    }
    let takes = match &reference.port {
        Some(port) => PortShape::describe(port),
        None => "a number, or a node that gives Number".to_owned(),
    };
    let gives = match maker.filter(|_| given.kind == Kind::Factor && port.maker.is_some()) {
        Some(maker) => format!("the Factor of a {maker}"),
        None => given.kind.to_string(),
    };
    let message = format!("`{}` takes {takes}; `{}` gives {gives}", reference.param, reference.text);
    let node = &graph.nodes[from];
    let outputs = node.node_type.iter().flat_map(|node_type| node_type.outputs);
    let better = outputs.filter(|output| node.gives(output, port));
    let hint = better.map(|output| format!("did you mean \"{}.{}\"?", node.id, output.name)).next();
    let hint = hint.or_else(|| graph.givers(port, index, report)).unwrap_or_else(|| match &port.maker {
        Some(maker) => format!("add a {maker}"),
        None => {
            let kinds: Vec<&str> = port.kinds.iter().map(|kind| kind.name()).collect();
            format!("no node gives {} yet", kinds.join(" or "))
        }
    });
    let fault = Fault::new(Code::WrongKind, message).node(graph.nodes[index].id).parameter(&reference.param);
    report.add(reference.at, fault.hint(hint));
}
