//! Drags a handle on a plate of 1920 x 1080 with cells of 5 px and times each step in process, from the changed
//! parameter to the resampled picture: `drag [STEPS [MEBIBYTES]]`, within so much memory. Prints what a step of each
//! graph takes, in milliseconds.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use warploom_core::engine::{Engine, Job, Settings, Status};
use warploom_core::graph::plan::Plan;
use warploom_core::graph::{Options, check};
use warploom_core::registry::Registry;
use warploom_nodes::NODES;

/// Eight handles, of which the first is dragged; in `kept` a part of the picture keeps its shape.
const GRAPH: &str = r#"Graph(version: 1, nodes: {
    "plate":    Checker(size: (1920, 1080)),
    "grid":     Lattice(domain: "plate", cell: 5.0, overscan: 60.0),
    "handles":  HandleFactor(grid: "grid"),
    "drag":     Handles(factor: "handles", points: POINTS),
    "mask":     Polygon(domain: "plate", points: [(500, 300), (800, 300), (800, 600), (500, 600)]),
    "parts":    Components(mask: "mask"),
    "features": FeatureFactor(grid: "grid", features: "parts"),
    "keep":     FeatureWarp(warp: "drag", factor: "features"),
    "dragged":  Resample(image: "plate", warp: "drag"),
    "kept":     Resample(image: "plate", warp: "keep"),
})"#;

fn main() -> Result<(), Box<dyn Error>> {
    let steps: usize = std::env::args().nth(1).map_or(Ok(100), |steps| steps.parse())?;
    let mebibytes: Option<u64> = std::env::args().nth(2).map(|mebibytes| mebibytes.parse()).transpose()?;
    let memory = mebibytes.map_or(Settings::default().memory, |mebibytes| mebibytes << 20);
    let registry = Registry::new(NODES);
    for target in ["dragged", "kept"] {
        let engine = Engine::new(Settings { threads: 2, memory, ..Settings::default() });
        let mut taken = Vec::new();
        for step in 0..=steps {
            let start = Instant::now();
            let report = engine.run(&plan(target, step, &registry)?, &Job::default());
            taken.push(start.elapsed().as_secs_f64() * 1e3);
            for pair in &report.nodes {
                assert_ne!(pair.status, Status::Failed, "{pair:?}");
                if step == steps {
                    println!("  {:<10} {:>8.1} ms  {:?}", pair.node, pair.seconds * 1e3, pair.status);
                }
            }
        }
        // The first step prepares the lattice, which no drag repeats.
        let cold = taken.remove(0);
        taken.sort_by(f64::total_cmp);
        let at = |part: f64| taken[((taken.len() - 1) as f64 * part).round() as usize];
        println!("{target}: median {:.1} ms, p95 {:.1} ms, first {cold:.0} ms", at(0.5), at(0.95));
    }
    Ok(())
}

/// The graph with the first handle one step further round a circle.
fn plan(target: &str, step: usize, registry: &Registry) -> Result<Arc<Plan>, Box<dyn Error>> {
    let angle = step as f64 * 0.1;
    let dragged = [600.0 + 40.0 * angle.cos(), 400.0 + 40.0 * angle.sin()];
    let still = [(0, 0), (1920, 0), (1920, 1080), (0, 1080), (960, 0), (960, 1080), (1400, 540)];
    let still: String = still.iter().map(|(x, y)| format!("(from: ({x}, {y}), to: ({x}, {y})), ")).collect();
    let points = format!("[(from: (600, 400), to: ({:?}, {:?})), {still}]", dragged[0], dragged[1]);
    let text = GRAPH.replace("POINTS", &points);
    let targets = [target.to_owned()];
    let checked = check(&text, registry, &Options { targets: &targets, ..Options::new(Path::new("drag.ron")) });
    let faults: String = checked.faults.iter().map(|fault| fault.render(false, false, 100)).collect();
    Ok(Arc::new(checked.plan.ok_or(faults)?))
}
