//! Times similarity: the map of a raw picture on one thread, or the whole loop of a texture that is warped in process.
//!
//! Usage: similar map PLANES SIZE REPEATS OUT | similar loop PICTURE STEPS
//!
//! PLANES: R, G, B of u8, SIZE times SIZE each. Prints per repeat the processor seconds of the codes of scene-linear
//! samples, of the guide, of a point's distances and of the opacity, for a diameter of 5 and levels 0 and 1; OUT is the
//! distances, f32, little-endian.
//! PICTURE: a file that Load reads. Each step selects another point, magnifies what is similar by cells of 4 px and draws
//! it, on 2 threads. Every tenth picture is compared, bit for bit, with that of a new engine.

use std::error::Error;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use rustix::time::{ClockId, clock_gettime};
use warploom_algo::UNWATCHED;
use warploom_algo::similarity::{Boundary, codes, distances, guide, opacity};
use warploom_algo::transfer::Encoding;
use warploom_algo::transfer::srgb_table;
use warploom_algo::view::{View, ViewMut};
use warploom_core::engine::{Delivery, Engine, Job, Settings, Status};
use warploom_core::graph::plan::Plan;
use warploom_core::graph::{Options, check};
use warploom_core::registry::Registry;
use warploom_nodes::NODES;

const GRAPH: &str = r#"Graph(version: 1, nodes: {
    "picture": Load(path: "PICTURE"),
    "guide":   SimilarityGuide(image: "picture", levels: [1, 2]),
    "map":     Similarity(guide: "guide", at: [POINT], quantile: 0.1, strength: 0.85),
    "grid":    Lattice(domain: "picture", cell: 4.0),
    "warp":    Magnify(strength: "map", grid: "grid"),
    "drawn":   Resample(image: "picture", warp: "warp"),
})"#;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["map", planes, size, repeats, out] => map(planes, size.parse()?, repeats.parse()?, out),
        ["loop", picture, steps] => select(picture, steps.parse()?),
        _ => Err("see the head of similar.rs".into()),
    }
}

fn map(planes: &str, size: usize, repeats: usize, out: &str) -> Result<(), Box<dyn Error>> {
    let bytes = std::fs::read(planes)?;
    let planes: Vec<View<u8>> = bytes.chunks(size * size).map(|plane| View::packed(plane, size, size)).collect();
    let planes: [View<u8>; 3] = planes.try_into().map_err(|_| "three planes are needed")?;
    let table = srgb_table(255);
    let linear = planes.map(|plane| plane.rows().flatten().map(|code| table[usize::from(*code)]).collect::<Vec<f32>>());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let (mut found, mut strength) = (vec![0.0; size * size], vec![0.0; size * size]);
    for _ in 0..repeats {
        let start = processor_seconds();
        for (linear, plane) in linear.iter().zip(&planes) {
            let samples = View::packed(linear, size, size);
            let again = pool.install(|| codes(samples, Encoding::Srgb, 1.0, UNWATCHED)).expect("unwatched");
            assert!(again.chunks(size).eq(plane.rows()), "codes come back");
        }
        let coded = processor_seconds();
        let ready = pool.install(|| guide(&planes, 5, &[0, 1], Boundary::Mirror, UNWATCHED)).expect("unwatched");
        let guided = processor_seconds();
        let view = ViewMut::packed(&mut found, size, size);
        pool.install(|| distances(&ready, &[[size / 3, size / 4]], view, UNWATCHED)).expect("unwatched");
        let mapped = processor_seconds();
        let (distances, view) = (View::packed(&found, size, size), ViewMut::packed(&mut strength, size, size));
        pool.install(|| opacity(distances, 8e5, 0.75, view));
        println!("{} {} {} {}", coded - start, guided - coded, mapped - guided, processor_seconds() - mapped);
    }
    let bytes: Vec<u8> = found.iter().flat_map(|value| value.to_le_bytes()).collect();
    Ok(std::fs::write(out, bytes)?)
}

fn select(picture: &str, steps: usize) -> Result<(), Box<dyn Error>> {
    let path = std::fs::canonicalize(picture)?.to_string_lossy().into_owned();
    let registry = Registry::new(NODES);
    let new_engine = || Engine::new(Settings { threads: 2, ..Settings::default() });
    let (engine, mut taken) = (new_engine(), Vec::new());
    for step in 0..=steps {
        let start = Instant::now();
        let plan = plan(&path, step, &registry)?;
        let warm = drawn(&engine, &plan, step == steps);
        taken.push(start.elapsed().as_secs_f64() * 1e3);
        assert!(step % 10 != 0 || warm == drawn(&new_engine(), &plan, false), "step {step}: a cold run differs");
    }
    // The first step prepares what no point changes.
    let first = taken.remove(0);
    taken.sort_by(f64::total_cmp);
    let at = |part: f64| taken[((taken.len() - 1) as f64 * part).round() as usize];
    let (median, rate) = (at(0.5), 1e3 / at(0.5));
    println!("select: median {median:.1} ms ({rate:.0} per second), p95 {:.1} ms, first {first:.0} ms", at(0.95));
    Ok(())
}

/// The digest of the picture.
fn drawn(engine: &Engine, plan: &Arc<Plan>, told: bool) -> String {
    let digest = Mutex::new(String::new());
    let keep = |found: Delivery| {
        *digest.lock().expect("no panic") = found.values[0].digest().hex();
        Ok(())
    };
    let deliver = vec![plan.node("drawn").expect("it is in the graph")];
    let report = engine.run(plan, &Job { deliver, on_values: &keep, ..Job::default() });
    for pair in &report.nodes {
        assert_ne!(pair.status, Status::Failed, "{:?}", report.faults);
        if told {
            println!("  {:<8} {:>7.2} ms  {:?}", pair.node, pair.seconds * 1e3, pair.status);
        }
    }
    digest.into_inner().expect("no panic")
}

/// The graph with the point of a step.
fn plan(picture: &str, step: usize, registry: &Registry) -> Result<Arc<Plan>, Box<dyn Error>> {
    let point = format!("({}.5, {}.5)", step * 37 % 512, step * 101 % 512);
    let text = GRAPH.replace("PICTURE", picture).replace("POINT", &point);
    let targets = ["drawn".to_owned()];
    let checked = check(&text, registry, &Options { targets: &targets, ..Options::new(Path::new("similar.ron")) });
    let faults: String = checked.faults.iter().map(|fault| fault.render(false, false, 100)).collect();
    Ok(Arc::new(checked.plan.ok_or(faults)?))
}

fn processor_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
