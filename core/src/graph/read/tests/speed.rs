//! Reading takes time in proportion to the text, whatever the text. The times only catch hangs.

use std::fmt::Write;
use std::time::{Duration, Instant};

use super::super::{MOST_FAULTS, read};

/// A graph of `count` nodes, 118 bytes each.
fn graph(count: usize) -> String {
    let mut text = "Graph(version: 1, nodes: {\n".to_owned();
    for node in 0..count {
        let line = format!(
            "\"node{node}\": FeatureWarp(warp: \"node{}\", angle: {}.25, mode: Similarity, ",
            node / 2,
            node % 90
        );
        let _ = writeln!(text, "{line}{}: 12.5),", "x".repeat(109 - line.len()));
    }
    text + "})\n"
}

#[test]
fn many_nodes() {
    for count in [10_000, 100_000] {
        let text = graph(count);
        assert_eq!(text.lines().nth(1).map(|line| line.len() + 1), Some(118));
        let start = Instant::now();
        let reading = read(&text);
        let seconds = start.elapsed();
        println!("{count} nodes: {seconds:?}");
        assert!(reading.faults.is_empty());
        assert!(seconds < Duration::from_micros(60) * count as u32, "{count} nodes: {seconds:?}");
    }
}

#[test]
fn garbage_costs_no_more() {
    let pieces = [
        "]",
        "(",
        "\"",
        "\\\"\n",
        "r#\"\n",
        "x: \"\n",
        "(}",
        "/*",
        "[\"a\": F(",
        "\n\"a\": (",
        "“",
        "'",
        "1.2.3 ",
        "{a:(x,]",
        "\"\n\\",
    ];
    for piece in pieces {
        let text = format!("{{\"a\": (b: {}", piece.repeat(1_000_000 / piece.len()));
        let start = Instant::now();
        let faults = read(&text).faults.len();
        let seconds = start.elapsed();
        println!("{piece:?}: {faults} faults, {seconds:?}");
        assert!((1..=MOST_FAULTS).contains(&faults), "{piece:?}: {faults}");
        assert!(seconds < Duration::from_secs(3), "{piece:?}: {seconds:?}");
    }
}
