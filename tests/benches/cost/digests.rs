//! The part of digests in the example `feature_warp` at 4096 x 2160, with half-float EXR in and out.

use std::collections::HashSet;
use std::hint::black_box;
use std::path::Path;
use std::sync::Mutex;

use warploom_core::engine::{Engine, Job, Settings};
use warploom_core::registry::Registry;
use warploom_core::value::{Buffer, Digest, Plane, Sample, Value};

use crate::{plan, seconds};

/// Draws a picture of the example at full size.
const ENLARGE: &str = r#"Graph(version: 1, nodes: {
    "small": Load(path: "small.png", encoding: Raw), "grid": Lattice(domain: "small", cell: 64.0),
    "scale": Affine(grid: "grid", scale: (8.0, 4.21875), center: (0.0, 0.0)),
    "large": Resample(image: "small", warp: "scale", size: (4096, 2160)),
    "out":   Save(image: "large", path: "large.exr", depth: Half),
})"#;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests lie below the root")
}

fn engine() -> Engine {
    Engine::new(Settings { cache: None, ..Settings::default() })
}

fn enlarge(name: &str, file: &Path, registry: &Registry) {
    let small = root().join("graphs").join(name);
    let set = [format!("small.path={small:?}"), format!("out.path={file:?}")];
    let report = engine().run(&plan(ENLARGE, Path::new("/enlarge.ron"), registry, &[], &set), &Job::default());
    assert!(report.faults.is_empty(), "{:?}", report.faults);
}

pub fn main_job() {
    let folder = tempfile::tempdir().expect("a folder");
    let [plate, matte, out] = ["plate.exr", "matte.exr", "out.exr"].map(|name| folder.path().join(name));
    let registry = Registry::new(warploom_nodes::NODES);
    enlarge("astronaut.png", &plate, &registry);
    enlarge("astronaut_features.png", &matte, &registry);

    let graph = root().join("graphs/feature_warp.ron");
    let text = std::fs::read_to_string(&graph).expect("readable");
    let set = [("plate", &plate), ("matte", &matte), ("out", &out)].map(|(node, file)| format!("{node}.path={file:?}"));
    let values_of = plan(&text, &graph, &registry, &[], &set);
    let whole = engine();
    let (report, run) = seconds(|| whole.run(&values_of, &Job::default()));
    assert!(report.faults.is_empty(), "{:?}", report.faults);
    let (_, again) = seconds(|| whole.run(&values_of, &Job::default()));

    let values = Mutex::new(Vec::new());
    let targets: Vec<String> = values_of.nodes.iter().map(|node| node.id.to_string()).collect();
    let all = plan(&text, &graph, &registry, &targets, &set);
    let job = Job {
        deliver: (0..all.nodes.len()).filter(|&node| !all.nodes[node].node_type.sink).collect(),
        on_values: &|given| {
            values.lock().expect("no panic").extend_from_slice(given.values);
            Ok(())
        },
        ..Job::default()
    };
    assert!(whole.run(&all, &job).faults.is_empty());

    let values = values.lock().expect("no panic");
    let mut seen = HashSet::new();
    let buffers: f64 = values.iter().map(|value| digest_seconds(value, &mut seen)).sum();
    let files: f64 = [&plate, &matte, &out]
        .map(|file| seconds(|| Digest::of_bytes(&std::fs::read(file).expect("readable"))).1)
        .iter()
        .sum();
    println!(
        "feature_warp at 4096 x 2160: run {run:.2} s; digests of {} values {:.0} ms, of 3 files {:.0} ms, \
        a run with nothing to do {:.1} ms; together {:.1} % of the run",
        values.len(),
        buffers * 1e3,
        files * 1e3,
        again * 1e3,
        (buffers + files + again) / run * 100.0,
    );
}

/// Seconds to digest the samples of a value anew; buffers that were seen before cost nothing.
fn digest_seconds(value: &Value, seen: &mut HashSet<*const u8>) -> f64 {
    match value {
        Value::Image(image) => {
            let channels = image.layers.iter().flat_map(|layer| &layer.channels);
            channels
                .map(|channel| match &channel.plane {
                    Plane::F32(buffer) => buffer_seconds(buffer, seen),
                    Plane::U32(buffer) => buffer_seconds(buffer, seen),
                })
                .sum()
        }
        Value::Mask(mask) => buffer_seconds(&mask.0.samples, seen),
        Value::Field(field) => buffer_seconds(&field.0.samples, seen),
        Value::Labels(labels) => buffer_seconds(&labels.raster.samples, seen),
        // These remember no digest.
        other => seconds(|| black_box(other.digest())).1,
    }
}

fn buffer_seconds<T: Sample>(buffer: &Buffer<T>, seen: &mut HashSet<*const u8>) -> f64 {
    if !seen.insert(buffer.samples().as_ptr().cast()) {
        return 0.0;
    }
    let samples: Vec<T> = buffer.rows().flatten().copied().collect();
    let copy = Buffer::from_packed(&samples, buffer.width(), buffer.height());
    seconds(|| black_box(copy.digest())).1
}
