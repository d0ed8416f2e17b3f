//! The command on a large graph in which nothing is to be done.

use std::fmt::Write;
use std::path::Path;

use warploom_tests::harness::Place;

use crate::median_seconds;

/// 5,000 small pictures and a chain that lays each over the one before; with the file 10,000 nodes.
fn nodes() -> String {
    const PICTURES: usize = 5_000;
    let mut nodes = String::new();
    for at in 0..PICTURES {
        let red = at as f64 / PICTURES as f64;
        let _ = writeln!(nodes, "\"p{at}\": Constant(size: (8, 8), color: ({red:?}, 0.2, 0.3, 0.5)),");
    }
    for at in 1..PICTURES {
        let below = if at == 1 { "p0".to_owned() } else { format!("o{}", at - 1) };
        let _ = writeln!(nodes, "\"o{at}\": Over(images: [\"p{at}\", \"{below}\"]),");
    }
    let _ = writeln!(nodes, "\"out\": Save(image: \"o{}\", path: \"out/last.exr\"),", PICTURES - 1);
    nodes
}

pub fn nothing_to_do(binary: &Path) {
    let place = Place::new(binary);
    std::fs::write(place.path("large.ron"), format!("Graph(version: 1, nodes: {{\n{}}})\n", nodes())).expect("a graph");
    let run = |line: &str| {
        let (code, seconds) = place.run(line);
        assert_eq!(code, Some(0), "{}", place.stderr());
        seconds
    };
    let line = "run large.ron --cache cache --store all --progress none";
    let cold = run(line);
    run(&format!("{line} --report report.json"));
    let report = place.report("report.json");
    let pairs = report["nodes"].as_array().expect("a list of pairs");
    assert!(pairs.len() == 10_000 && pairs.iter().all(|pair| pair["status"] == "reused"), "{} pairs", pairs.len());
    let check = median_seconds(7, || run("check large.ron")) * 1e3;
    let warm = median_seconds(7, || run(line)) * 1e3;
    println!(
        "command on 10000 nodes (median of 7): nothing to do {warm:.0} ms, check alone {check:.0} ms; cold {cold:.1} s"
    );
}
