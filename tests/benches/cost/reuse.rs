//! A second run in one process, in which every node is known.

use std::fmt::Write;
use std::path::Path;

use warploom_core::engine::{Engine, Job, Settings, Status};
use warploom_core::registry::Registry;

use crate::nodes::NODES;
use crate::{median_seconds, plan, seconds};

/// A graph of `count` nodes, the last of which needs all others.
type Shape = fn(usize) -> String;

fn engine() -> Engine {
    Engine::new(Settings { cache: None, ..Settings::default() })
}

/// Adds a node: the sum of others, or a number if there are none.
fn sum(nodes: &mut String, at: usize, terms: impl Iterator<Item = usize>) {
    let terms: Vec<String> = terms.map(|term| format!("\"n{term}\"")).collect();
    let node = match terms.as_slice() {
        [] => format!("Const(value: {at}.0)"),
        // Another bias makes another key.
        terms => format!("Sum(terms: [{}], bias: {at}.5)", terms.join(", ")),
    };
    let _ = writeln!(nodes, "\"n{at}\": {node},");
}

fn chain(count: usize) -> String {
    let mut nodes = String::new();
    (0..count).for_each(|at| sum(&mut nodes, at, at.checked_sub(1).into_iter()));
    nodes
}

/// Every node is the sum of the two that come next in reverse order, as in a heap.
fn tree(count: usize) -> String {
    let mut nodes = String::new();
    for at in 0..count {
        let place = count - 1 - at;
        let terms: Vec<usize> = [2 * place + 1, 2 * place + 2].into_iter().filter(|&child| child < count).collect();
        sum(&mut nodes, at, terms.into_iter().map(|child| count - 1 - child));
    }
    nodes
}

fn layers(count: usize) -> String {
    const WIDTH: usize = 100;
    let mut nodes = String::new();
    for at in 0..count - 1 {
        let (layer, column) = (at / WIDTH, at % WIDTH);
        let above = (0..3).map(|step| (layer.wrapping_sub(1)).wrapping_mul(WIDTH) + (column + step) % WIDTH);
        sum(&mut nodes, at, above.filter(|_| layer > 0));
    }
    sum(&mut nodes, count - 1, count.saturating_sub(1 + WIDTH)..count - 1);
    nodes
}

fn graph(nodes: &str) -> String {
    format!("Graph(version: 1, nodes: {{\n{nodes}}})\n")
}

fn last(count: usize) -> [String; 1] {
    [format!("n{}", count - 1)]
}

pub fn reused_nodes() {
    const COUNTS: [usize; 5] = [1_250, 2_500, 5_000, 10_000, 20_000];
    const SHAPES: [(&str, Shape); 3] = [("chain", chain), ("tree", tree), ("layers", layers)];
    println!("warm second run, microseconds per reused node (median of 15)");
    println!("{:>10}{}", "nodes", COUNTS.map(|count| format!("{count:>9}")).concat());
    for (name, shape) in SHAPES {
        let costs = COUNTS.map(|count| format!("{:>9.2}", microseconds_per_node(shape, count)));
        println!("{name:>10}{}", costs.concat());
    }
}

fn microseconds_per_node(shape: Shape, count: usize) -> f64 {
    let registry = Registry::new(NODES);
    let plan = plan(&graph(&shape(count)), Path::new("/bench.ron"), &registry, &last(count), &[]);
    let engine = engine();
    let job = Job::default();
    let cold = engine.run(&plan, &job);
    assert!(cold.faults.is_empty() && cold.nodes.len() == count, "{:?}, {} nodes", cold.faults, cold.nodes.len());
    let warm = engine.run(&plan, &job);
    assert!(warm.nodes.iter().all(|pair| pair.status == Status::Reused));
    median_seconds(15, || engine.run(&plan, &job)) * 1e6 / count as f64
}

pub fn long_chain() {
    const COUNT: usize = 100_000;
    let (registry, text) = (Registry::new(NODES), graph(&chain(COUNT)));
    let (plan, check) = seconds(|| plan(&text, Path::new("/bench.ron"), &registry, &last(COUNT), &[]));
    let (engine, job) = (engine(), Job::default());
    let (report, cold) = seconds(|| engine.run(&plan, &job));
    assert!(report.faults.is_empty(), "{:?}", report.faults);
    let (_, warm) = seconds(|| engine.run(&plan, &job));
    println!("chain of {COUNT} nodes, seconds: check {check:.2}, cold run {cold:.2}, warm run {warm:.2}");
}
