//! Every node type at work on large pictures and fine lattices.

use std::sync::{Arc, LazyLock};

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use tempfile::TempDir;
use warploom_core::engine::{Cancel, Engine, Job, Observer, Report, Settings};
use warploom_core::graph::check::{Options, check};
use warploom_core::node::{Context, Node, NodeError, Output, Outputs, WritePath};
use warploom_core::registry::{Registry, def};
use warploom_core::value::{BufferMut, Channel, Image, Kind, Mask, Plane, Raster, Rect, SampleType, Windows};
use warploom_nodes::NODES;

/// A picture and masks that are hard to pack and to take apart.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Grain {
    /// Width and height.
    pub size: [u32; 2],
    /// What it starts from.
    pub seed: u32,
}

impl Node for Grain {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] =
        &[Output::new("image", Kind::Image), Output::new("dots", Kind::Mask), Output::new("discs", Kind::Mask)];

    fn compute(&self, _: &Context) -> Result<Outputs, NodeError> {
        let window = Rect::at(0, 0, self.size[0] as usize, self.size[1] as usize);
        let plane = |sample: &(dyn Fn(usize, usize) -> f32 + Sync)| {
            let mut plane = BufferMut::<f32>::zeroed(window.width(), window.height());
            let (stride, width) = (plane.stride(), window.width());
            let rows = plane.samples_mut().par_chunks_mut(stride).enumerate();
            rows.for_each(|(y, row)| row[..width].iter_mut().enumerate().for_each(|(x, out)| *out = sample(x, y)));
            plane.freeze()
        };
        let channel = |(number, name): (u32, &str)| {
            let samples = plane(&|x, y| match name {
                "A" => 0.25 + 0.75 * noise(self.seed + number, x, y),
                _ => (x + y) as f32 / 9e3 + 0.1 * noise(self.seed + number, x, y),
            });
            Channel { name: name.into(), sample_type: SampleType::Float, plane: Plane::F32(samples) }
        };
        let image = Image::new(window, (0..).zip(["R", "G", "B", "A"]).map(channel).collect());
        let mask = |samples| Mask(Raster { windows: Windows::full(window), samples });
        let dots = mask(plane(&|x, y| noise(self.seed, x, y)));
        let discs = mask(plane(&|x, y| {
            let [dx, dy] = [x % 64, y % 64].map(|at| at as f32 - 32.0);
            if dx * dx + dy * dy < 300.0 { 1.0 } else { 0.0 }
        }));
        Ok(Outputs::new([image.into(), dots.into(), discs.into()]))
    }
}

/// A file with a mesh: a net of triangles.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Knit {
    /// An OBJ or a PLY.
    pub path: WritePath,
}

impl Node for Knit {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[];
    const SINK: bool = true;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        const SIDE: usize = 400;
        let nodes = || (0..SIDE * SIDE).map(|at| [at % SIDE, at / SIDE]);
        let cells = nodes().filter(|node| node.iter().all(|at| at + 1 < SIDE));
        let corners = |[x, y]: [usize; 2]| [y * SIDE + x, y * SIDE + x + 1, (y + 1) * SIDE + x + 1, (y + 1) * SIDE + x];
        let unit = |at: usize| at as f64 / SIDE as f64;
        let text: String = if self.path.path().extension().is_some_and(|extension| extension == "ply") {
            let header = "property float x\nproperty float y\nproperty float z\nproperty float u\nproperty float v\n";
            let (vertices, faces) = (SIDE * SIDE, (SIDE - 1) * (SIDE - 1));
            let start = format!("ply\nformat ascii 1.0\nelement vertex {vertices}\n{header}element face {faces}\n");
            let vertices = nodes().map(|[x, y]| format!("{x} {y} {} {} {}\n", (x * y) % 7, unit(x), unit(y)));
            let faces = cells.map(corners).map(|[a, b, c, d]| format!("4 {a} {b} {c} {d}\n"));
            let start = [start, "property list uchar int vertex_indices\nend_header\n".into()];
            start.into_iter().chain(vertices).chain(faces).collect()
        } else {
            let vertices = nodes().map(|[x, y]| format!("v {x} {y} {}\nvt {} {}\n", (x * y) % 7, unit(x), unit(y)));
            let faces = cells.map(corners).map(|corners| {
                let [a, b, c, d] = corners.map(|corner| corner + 1);
                format!("f {a}/{a} {b}/{b} {c}/{c} {d}/{d}\n")
            });
            vertices.chain(faces).collect()
        };
        cx.write(&self.path, text.as_bytes())?;
        Ok(Outputs::default())
    }
}

/// A number in 0..1.
fn noise(seed: u32, x: usize, y: usize) -> f32 {
    let mut state = (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77) ^ seed << 20;
    state = (state ^ state >> 15).wrapping_mul(0x2C1B_3C6D);
    state = (state ^ state >> 12).wrapping_mul(0x297A_2D39);
    (state >> 8) as f32 / (1 << 24) as f32
}

static REGISTRY: LazyLock<Registry> =
    LazyLock::new(|| Registry::new(&[NODES, &[def::<Grain>("Grain"), def::<Knit>("Knit")]].concat()));

/// A node at work.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its type and parameters.
    pub text: String,
    /// What must run before it, to leave a file.
    pub before: Option<String>,
}

fn case(text: impl Into<String>) -> Case {
    Case { text: text.into(), before: None }
}

/// What makes a warp of a lattice.
const WARPS: [&str; 24] = [
    "Affine",
    "Arc",
    "ArcLower",
    "ArcUpper",
    "Arch",
    "BezierEnvelope",
    "Bulge",
    "Fish",
    "Fisheye",
    "Flag",
    "FreeLattice",
    "Inflate",
    "Lens",
    "Perspective",
    "Ripple",
    "Rise",
    "ShellLower",
    "ShellUpper",
    "Squeeze",
    "Stretch",
    "Swirl",
    "Turbulence",
    "Twist",
    "Wave",
];

/// Each node type on its largest inputs.
pub fn cases() -> Vec<Case> {
    let warps = WARPS.map(|warp| format!("{warp}(grid: \"grid\")"));
    let cards = ["Checker", "Constant", "Ramp"].map(|card| format!("{card}(size: (WIDTH, HEIGHT))"));
    let others = [
        r#"Blend(warp: "wave")"#,
        r#"Blend(warp: "wave", from: "wild")"#,
        r#"Cylinder(segments: 900, rings: 700)"#,
        r#"Sphere(segments: 900, rings: 700)"#,
        r#"Torus(segments: 900, sides: 700)"#,
        r#"Render(mesh: "ball", texture: "a.image", size: (WIDTH, HEIGHT), distance: 2.5)"#,
        r#"Render(mesh: "ball", texture: "small", size: (320, 240), samples: 8, edge_u: Wrap)"#,
        r#"Clone(base: "a.image", mask: "a.dots", texture: "b.image", offset: (70.0, 30.0))"#,
        r#"Combine(masks: ["a.dots", "b.discs", "b.dots"])"#,
        r#"Components(mask: "a.discs")"#,
        r#"Components(mask: "a.dots", connectivity: Four)"#,
        r#"Compose(first: "wave", second: "bent")"#,
        r#"Compose(first: "bent", second: "fine")"#,
        r#"Detail(image: "drawn", warp: "larger", sets: "sets")"#,
        r#"Detail(image: "a.image", warp: "wave", sets: "small_sets")"#,
        r#"Detail(image: "small", warp: "larger", sets: "small_sets", method: Analogies)"#,
        r#"Difference(a: "a.image", b: "b.image")"#,
        r#"DrawGrid(image: "a.image", warp: "wave", every: 1)"#,
        r#"FeatureFactor(grid: "coarse", features: "labels")"#,
        r#"FeatureFactor(grid: "coarse", features: "labels", radius: 64.0)"#,
        r#"FeatureFactor(grid: "coarse", features: "labels", soft: "a.dots", boundary: Free)"#,
        r#"FeatureFactor(grid: "rough", features: "labels", boundary: Slide, exact: Similarity)"#,
        r#"FeatureWarp(warp: "bent", factor: "factor")"#,
        r#"FeatureWarp(warp: "bent", factor: "factor", blend: true, tolerance: 0.1)"#,
        r#"FeatureWarp(warp: "roughly", factor: "exact")"#,
        r#"FeatureWarp(warp: "narrow", factor: "loose", mode: Rigid)"#,
        r#"FeatureWarp(warp: "narrow", factor: "loose", mode: Rigid, when_it_does_not_fit: Bend)"#,
        r#"FrameHold(input: "a.image")"#,
        r#"Grow(mask: "a.dots", by: 12.5)"#,
        r#"HandleFactor(grid: "coarse")"#,
        r#"Handles(factor: "pins", points: [(from: (90.0, 80.0), to: (70.0, 99.0)), (from: (900.0, 80.0), to: (800.0, 9.0))])"#,
        r#"Handles(factor: "pins", top: [(0.0, 0.0), (600.0, -90.0), (1200.0, 0.0)], left: [(0.0, 0.0), (90.0, 700.0)], mode: Rigid)"#,
        r#"Invert(warp: "wave")"#,
        r#"Invert(warp: "bent", grid: "grid")"#,
        r#"Lattice(domain: "a.image", cell: 1.0)"#,
        r#"Magnify(strength: "a.discs", grid: "coarse")"#,
        r#"Magnify(strength: "a.dots", grid: "coarse", amount: 50.0, frame: Pin)"#,
        r#"Magnify(strength: "a.discs", grid: "coarse", method: Keahey, sweeps: 2, levels: 3)"#,
        r#"Over(images: ["a.image", "b.image"])"#,
        r#"Over(images: ["a.image", "b.image", "a.image", "b.image"])"#,
        r#"Paint(base: "a.image", mask: "a.dots", mode: Brightness)"#,
        r#"Polygon(domain: "a.image", points: [(3.0, 5.0), (900.0, 40.0), (70.0, 800.0)], feather: 40.0)"#,
        r#"Polygon(domain: "a.image", points: [(3.0, 5.0), (900.0, 40.0), (70.0, 800.0)])"#,
        r#"Resample(image: "a.image", warp: "wave")"#,
        r#"Resample(image: "a.image", warp: "wild", edge: Mirror)"#,
        r#"Resample(image: "a.dots", warp: "fine", fit: true)"#,
        r#"Resample(image: "a.image", warp: "tiny", filter: Ewa)"#,
        r#"Resample(image: "labels", warp: "wave")"#,
        r#"Resample(image: "specks", warp: "wave")"#,
        r#"SimilarSets(image: "a.image")"#,
        r#"SimilarSets(image: "a.image", encoding: Linear, levels: 1)"#,
        r#"Similarity(guide: "guide", at: [(9.5, 9.5)], quantile: 0.2, within: "a.dots")"#,
        r#"Similarity(guide: "guide", at: [(9.5, 9.5), (70.0, 80.0), (500.0, 300.0), (2.0, 2.0)])"#,
        r#"SimilarityGuide(image: "a.image")"#,
        r#"SimilarityGuide(image: "a.image", diameter: 21, levels: [3], boundary: Wrap)"#,
        r#"Threshold(image: "a.image", channel: "luma", above: 0.3)"#,
        r#"Threshold(image: "a.image", channel: "G", above: 0.3)"#,
    ];
    let saves = files().into_iter().flat_map(|file| {
        let save = format!("Save(image: \"a.image\", {file})");
        [case(save.clone()), Case { text: "Load(path: PATH)".into(), before: Some(save) }]
    });
    let maps =
        [("wave", "preset: OiioStWarp"), ("fine", "preset: NukeIDistort, inverse: true")].map(|(warp, choice)| {
            let save = format!("SaveWarp(warp: \"{warp}\", domain: \"a.image\", path: \"it.exr\", {choice})");
            [case(save.clone()), Case { text: format!("LoadWarp(path: PATH, {choice})"), before: Some(save) }]
        });
    let meshes = ["it.obj", "it.ply"].map(|path| {
        let knit = format!("Knit(path: {path:?})");
        Case { text: "LoadMesh(path: PATH)".into(), before: Some(knit) }
    });
    warps
        .into_iter()
        .chain(cards)
        .chain(others.map(str::to_owned))
        .map(case)
        .chain(saves)
        .chain(maps.into_iter().flatten())
        .chain(meshes)
        .collect()
}

/// Parameters of Save: every format, depth and compression.
fn files() -> Vec<String> {
    let file = |extension: &str, more: &str| format!("path: \"it.{extension}\"{more}");
    let mut files = vec![file("jpg", ""), file("hdr", ""), file("hdr", ", encoding: Srgb")];
    for depth in ["U8", "U16"] {
        files.extend(["png", "tif"].map(|extension| file(extension, &format!(", depth: {depth}"))));
    }
    files.push(file("tif", ", depth: Float, encoding: Srgb"));
    files.push(file("exr", ", encoding: Srgb"));
    for compression in ["None", "Rle", "Zips", "Zip", "Piz", "Pxr24", "B44", "B44a", "Dwaa", "Dwab"] {
        for depth in ["Half", "Float"] {
            files.push(file("exr", &format!(", depth: {depth}, compression: {compression}")));
        }
    }
    files
}

/// The name of a case's node type.
pub fn type_of(case: &Case) -> &str {
    case.text.split('(').next().unwrap_or_default()
}

pub fn engine(threads: usize) -> Engine {
    Engine::new(Settings { threads, memory: 64 << 30, ..Settings::default() })
}

/// Runs the node `it` of a case; what it needs runs before it.
pub fn run(
    folder: &TempDir,
    engine: &Engine,
    text: &str,
    size: [u32; 2],
    observer: &dyn Observer,
    cancel: Cancel,
) -> Report {
    let [width, height] = size;
    let path = std::fs::read_dir(folder.path()).expect("a folder").flatten().next().map(|entry| entry.path());
    let text = text
        .replace("WIDTH", &width.to_string())
        .replace("HEIGHT", &height.to_string())
        .replace("PATH", &format!("{:?}", path.unwrap_or_default()));
    let graph = format!(
        r#"Graph(version: 1, nodes: {{
    "a": Grain(size: ({width}, {height}), seed: 1),
    "b": Grain(size: ({width}, {height}), seed: 9),
    "labels": Components(mask: "a.discs"),
    "specks": Components(mask: "a.dots", connectivity: Four),
    "grid": Lattice(domain: "a.image", cell: 2.0),
    "coarse": Lattice(domain: "a.image", cell: 3.0),
    "rough": Lattice(domain: "a.image", cell: 6.0),
    "pixels": Lattice(domain: "a.image", cell: 1.0),
    "wave": Wave(grid: "grid", amplitude: 6.0),
    "fine": Wave(grid: "pixels", amplitude: 6.0),
    "wild": Wave(grid: "grid", amplitude: 900.0, wavelength: 3.7, direction: 33.0),
    "bent": Wave(grid: "coarse", amplitude: 6.0),
    "roughly": Wave(grid: "rough", amplitude: 6.0),
    "tiny": Affine(grid: "grid", scale: (0.14, 0.16)),
    "narrow": Stretch(grid: "rough", x: 0.4),
    "factor": FeatureFactor(grid: "coarse", features: "labels"),
    "loose": FeatureFactor(grid: "rough", features: "labels"),
    "exact": FeatureFactor(grid: "rough", features: "labels", boundary: Slide, exact: Similarity),
    "pins": HandleFactor(grid: "coarse"),
    "ball": Sphere(segments: 400, rings: 300),
    "small": Checker(size: (64, 48)),
    "larger": Affine(grid: "grid", scale: (1.5, 1.5)),
    "drawn": Resample(image: "a.image", warp: "larger", crop: true),
    "sets": SimilarSets(image: "a.image"),
    "small_sets": SimilarSets(image: "small"),
    "guide": SimilarityGuide(image: "a.image"),
    "it": {text},
}})"#
    );
    let (file, targets) = (folder.path().join("graph.ron"), ["it".to_owned()]);
    let options = Options { targets: &targets, ..Options::new(&file) };
    let checked = check(&graph, &REGISTRY, &options);
    let plan = Arc::new(checked.plan.unwrap_or_else(|| panic!("{graph}\n{:#?}", checked.faults)));
    engine.run(&plan, &Job { observer, cancel, ..Job::default() })
}
