//! Warps out to files and back, and files that hold none.

use std::sync::{Arc, Mutex};

use tempfile::TempDir;
use warploom_core::diag::{Code, Fault};
use warploom_core::engine::{Delivery, Engine, Job, Report, Settings};
use warploom_core::graph::check::{Checked, Options, check};
use warploom_core::registry::Registry;
use warploom_core::value::{
    Attribute, Buffer, Channel, Direction, Image, Layer, Metadata, Plane, Rect, SampleType, Value, Warp,
};

use super::codec::{self, Compression, Depth, Encoding, WriteOptions};

const PRESETS: [&str; 5] = ["NukeStMap", "NukeIDistort", "OiioStWarp", "BlenderMapUv", "BlenderDisplace"];

pub(crate) fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

/// A graph of these nodes, of which `out` is to be run.
fn checked(folder: &TempDir, nodes: &str) -> Checked {
    let (registry, file) = (Registry::new(crate::NODES), folder.path().join("graph.ron"));
    let text = format!("Graph(version: 1, nodes: {{ {nodes} }})");
    let targets = ["out".to_owned()];
    check(&text, &registry, &Options { targets: &targets, ..Options::new(&file) })
}

/// Runs the node `out` of a graph of these nodes.
pub(crate) fn run(folder: &TempDir, nodes: &str) -> (Report, Vec<Value>) {
    let checked = checked(folder, nodes);
    let plan = Arc::new(checked.plan.unwrap_or_else(|| panic!("{nodes}\n{:#?}", checked.faults)));
    let (out, values) = (plan.node("out").expect("it is there"), Mutex::new(Vec::new()));
    let keep = |found: Delivery| {
        *values.lock().expect("no panic") = found.values.to_vec();
        Ok(())
    };
    let engine = Engine::new(Settings { threads: 2, memory: 1 << 30, ..Settings::default() });
    let report = engine.run(&plan, &Job { deliver: vec![out], on_values: &keep, ..Job::default() });
    (report, values.into_inner().expect("no panic"))
}

fn stat(report: &Report, name: &str) -> f64 {
    assert!(report.faults.is_empty(), "{:#?}", report.faults);
    let pair = report.nodes.iter().find(|pair| &*pair.node == "out").expect("it ran");
    pair.stats.get(name).and_then(serde_json::Value::as_f64).unwrap_or_else(|| panic!("no {name} in {:?}", pair.stats))
}

/// What the node `out` of a graph of these nodes is refused for, before it runs or when it does.
pub(crate) fn fault(folder: &TempDir, nodes: &str) -> Fault {
    let mut faults = checked(folder, nodes).faults;
    if faults.is_empty() {
        faults = run(folder, nodes).0.faults;
    }
    let [fault] = &faults[..] else { panic!("one fault: {nodes}\n{faults:#?}") };
    fault.clone()
}

/// What the node `out` of a graph of these nodes warns of.
pub(crate) fn warnings(folder: &TempDir, nodes: &str) -> Vec<String> {
    let (report, _) = run(folder, nodes);
    assert!(report.faults.is_empty(), "{nodes}\n{:#?}", report.faults);
    report.warnings.into_iter().filter(|told| told.node.as_deref() == Some("out")).map(|told| told.message).collect()
}

fn load(folder: &TempDir, text: &str) -> (Report, Arc<Warp>) {
    let (report, values) = run(folder, &format!("\"out\": LoadWarp({text})"));
    let Some(Value::Warp(warp)) = values.first() else { panic!("{text}: {:#?}", report.faults) };
    (report, warp.clone())
}

/// Writes a picture of these channels, each as its number's constant plus the channel's place.
fn write(folder: &TempDir, name: &str, display: Rect, data: Rect, channels: &[(&str, SampleType)]) {
    write_with(folder, name, display, data, channels, Compression::Zip, &|_, _, _| 0.25);
}

fn write_with(
    folder: &TempDir,
    name: &str,
    display: Rect,
    data: Rect,
    channels: &[(&str, SampleType)],
    compression: Compression,
    sample: &dyn Fn(&str, usize, usize) -> f32,
) {
    let (width, height) = (data.width(), data.height());
    let pixels = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let channels = channels.iter().map(|&(name, sample_type)| Channel {
        name: name.into(),
        sample_type,
        plane: match sample_type {
            SampleType::Uint => Plane::U32(Buffer::from_packed(&vec![7; width * height], width, height)),
            _ => {
                let samples: Vec<f32> = pixels().map(|(x, y)| sample(name, x, y)).collect();
                Plane::F32(Buffer::from_packed(&samples, width, height))
            }
        },
    });
    let layer = Layer { name: "".into(), data, channels: channels.collect(), metadata: Arc::default() };
    let image = Image { display, pixel_aspect: 1.0, metadata: Arc::default(), layers: vec![layer] };
    let options = WriteOptions { compression, depth: Depth::Auto, ..WriteOptions::default() };
    let bytes = codec::encode_image(&image, "exr", &options, &|_| Ok(())).expect("it can be written");
    std::fs::write(folder.path().join(name), bytes).expect("written");
}

fn written(folder: &TempDir, name: &str) -> Image {
    let bytes = std::fs::read(folder.path().join(name)).expect("it is there");
    codec::decode(&bytes, Encoding::Linear, &|_| Ok(())).expect("it can be read")
}

const FLOATS: [(&str, SampleType); 2] = [("R", SampleType::Float), ("G", SampleType::Float)];

#[test]
fn warps_come_back_where_they_were_for_every_preset() {
    // Exact inverses where there is a formula; `residual` judges the others.
    type Inverse = fn([f64; 2], [f64; 2]) -> [f64; 2];
    let turned: Inverse = |[x, y], [cx, cy]| {
        let (sin, cos) = 10.0_f64.to_radians().sin_cos();
        [cx + cos * (x - cx) + sin * (y - cy), cy - sin * (x - cx) + cos * (y - cy)]
    };
    let warps: [(&str, Option<Inverse>); 5] = [
        ("Affine(grid: \"grid\")", Some(|p, _| p)),
        ("Affine(grid: \"grid\", translate: (3.25, -7.5))", Some(|[x, y], _| [x - 3.25, y + 7.5])),
        ("Affine(grid: \"grid\", rotate: 10.0)", Some(turned)),
        ("Bulge(grid: \"grid\")", None),
        ("Turbulence(grid: \"grid\")", None),
    ];
    let folder = folder();
    for (x0, y0) in [(0, 0), (100, 50)] {
        let display = Rect::at(x0, y0, 90, 70);
        write(&folder, "plate.exr", display, display, &FLOATS);
        let center = [f64::from(x0) + 45.0, f64::from(y0) + 35.0];
        for ((warp, inverse), preset) in warps.iter().flat_map(|warp| PRESETS.map(|preset| (warp, preset))) {
            let file = format!("path: \"map.exr\", preset: {preset}");
            let graph = format!(
                r#""plate": Load(path: "plate.exr"), "grid": Lattice(domain: "plate", cell: 5.0, overscan: 64.0),
                   "warp": {warp}, "out": SaveWarp(warp: "warp", domain: "plate", overscan: 64, {file})"#
            );
            let (report, _) = run(&folder, &graph);
            assert_eq!((stat(&report, "pixels"), stat(&report, "without_source")), (218.0 * 198.0, 0.0), "{graph}");
            assert!(
                stat(&report, "rounding") <= 1e-4 && stat(&report, "residual") <= 1e-3,
                "{graph} {:?}",
                report.nodes
            );
            let (_, back) = load(&folder, &file);
            assert_eq!((back.direction, back.grid.nodes), (Direction::SrcFromDst, [218, 198]));
            assert_eq!((back.grid.origin, back.grid.spacing), ([center[0] - 108.5, center[1] - 98.5], [1.0, 1.0]));
            let Some(inverse) = inverse else { continue };
            for row in 0..198 {
                for column in 0..218 {
                    let at = [back.grid.origin[0] + column as f64, back.grid.origin[1] + row as f64];
                    let (expected, node) = (inverse(at, center), row * 218 + column);
                    let far = (back.x[node] - expected[0]).abs().max((back.y[node] - expected[1]).abs());
                    assert!(far <= 1e-3, "{graph}, {at:?}: {far}");
                }
            }
        }
    }
}

#[test]
fn a_map_of_where_pixels_go_comes_back_as_a_warp() {
    let folder = folder();
    let graph = |inverse: bool, warp: &str| {
        format!(
            r#""plate": Constant(size: (30, 20)), "grid": Lattice(domain: "plate", cell: 3.0),
               "moved": Affine(grid: "grid", translate: (3.25, -7.5), scale: (1.0, -1.0)), "back": Invert(warp: "moved", gives: OtherWay),
               "out": SaveWarp(warp: "{warp}", domain: "plate", path: "map.exr", inverse: {inverse})"#
        )
    };
    // The direction of the warp itself does not matter.
    for warp in ["moved", "back"] {
        for (inverse, direction) in [(false, Direction::SrcFromDst), (true, Direction::DstFromSrc)] {
            let (report, _) = run(&folder, &graph(inverse, warp));
            assert!(stat(&report, "residual") < 1e-3);
            let (_, back) = load(&folder, &format!("path: \"map.exr\", inverse: {inverse}"));
            assert_eq!((back.direction, back.grid.nodes), (direction, [30, 20]));
            let expected = if inverse { [0.5 + 3.25, 19.5 - 7.5] } else { [0.5 - 3.25, 20.0 - 8.0] };
            assert!((back.x[0] - expected[0]).abs() < 1e-4, "{warp} {inverse}: {}", back.x[0]);
            assert!((back.y[0] - expected[1]).abs() < 1e-4, "{warp} {inverse}: {}", back.y[0]);
        }
    }
}

#[test]
fn the_file_is_of_floats_named_by_the_preset_and_marked_as_data() {
    let folder = folder();
    write(&folder, "plate.exr", Rect::at(4, 2, 20, 10), Rect::at(0, 5, 8, 9), &FLOATS);
    let save = |more: &str| {
        let graph = format!(
            r#""plate": Load(path: "plate.exr"), "grid": Lattice(domain: "plate", cell: 5.0), "warp": Affine(grid: "grid"),
               "out": SaveWarp(warp: "warp", path: "map.exr", {more})"#
        );
        let (report, _) = run(&folder, &graph);
        assert!(report.faults.is_empty(), "{:#?}", report.faults);
        written(&folder, "map.exr")
    };
    for (preset, names) in [
        ("NukeStMap", ["A", "G", "R"]),
        ("NukeIDistort", ["A", "forward.u", "forward.v"]),
        ("OiioStWarp", ["A", "G", "R"]),
        ("BlenderMapUv", ["B", "G", "R"]),
        ("BlenderDisplace", ["A", "G", "R"]),
    ] {
        let image = save(&format!("domain: \"plate\", preset: {preset}"));
        let layer = &image.layers[0];
        // The format and the plate's pixels.
        assert_eq!((image.display, layer.data), (Rect::at(4, 2, 20, 10), Rect { x0: 0, y0: 2, x1: 24, y1: 14 }));
        let channels: Vec<_> = layer.channels.iter().map(|c| (&*c.name, c.sample_type)).collect();
        assert_eq!(channels, names.map(|name| (name, SampleType::Float)), "{preset}");
        assert_eq!(image.metadata["colorInteropID"], Attribute { kind: "string".into(), bytes: b"data".to_vec() });
        assert_eq!(image.metadata["compression"].bytes, [2]);
    }
    // Without a picture the lattice's rectangle counts.
    let image = save("overscan: 3, channels: (x: \"u\", y: \"v\", alpha: \"valid\")");
    assert_eq!((image.display, image.layers[0].data), (Rect::at(4, 2, 20, 10), Rect::at(1, -1, 26, 16)));
    assert!(image.layers[0].channel("u").is_some() && image.layers[0].channel("valid").is_some());
    // Another format than the picture's; positions still refer to the picture's.
    let image = save("domain: \"plate\", size: (40, 10)");
    assert_eq!((image.display, image.layers[0].data), (Rect::at(4, 2, 40, 10), Rect::at(4, 2, 40, 10)));
    let Plane::F32(u) = &image.layers[0].channel("R").expect("it is there").plane else { panic!("floats") };
    assert_eq!([u.row(0)[0], u.row(0)[39]], [0.5 / 20.0, 39.5 / 20.0]);
}

#[test]
fn what_is_too_coarse_or_folds_is_not_written() {
    let folder = folder();
    let graph = |warp: &str, more: &str| {
        format!(
            r#""plate": Constant(size: (40, 30)), "grid": Lattice(domain: "plate", cell: 5.0), "warp": {warp},
               "out": SaveWarp(warp: "warp", domain: "plate", path: "map.exr", {more})"#
        )
    };
    let (still, wild) =
        ("Affine(grid: \"grid\")", "Wave(grid: \"grid\", amplitude: 30.0, wavelength: 17.0, direction: 30.0)");
    for (warp, more, code, parameter, message) in [
        (still, "compression: Pxr24", Code::Conflict, "compression", "Pxr24 loses digits"),
        (still, "compression: Dwaa", Code::Conflict, "compression", "it may be None, Rle, Zips, Zip or Piz"),
        (still, "channels: (x: \"A\")", Code::Conflict, "channels", "not `A`, `G` and `A`"),
        (still, "channels: (y: \"\")", Code::Conflict, "channels", "1 to 255 bytes long without zeros; \"\" is not"),
        (still, "size: (65536, 9), overscan: 1", Code::Refused, "overscan", "the map would be 65538 x 11 px"),
        (wild, "overscan: 0", Code::Refused, "warp", "the warp folds in"),
    ] {
        let fault = fault(&folder, &graph(warp, more));
        assert_eq!((fault.code, fault.parameter.as_deref()), (code, Some(parameter)), "{fault:#?}");
        assert!(fault.message.contains(message) && fault.place.is_some(), "{fault:#?}");
        assert!(fault.hint.is_some(), "{fault:#?}");
        assert!(!folder.path().join("map.exr").exists());
    }
    let folded = fault(&folder, &graph(wild, ""));
    assert!(folded.message.contains("at column ") && folded.hint.expect("a mend").contains("frontmost: true"));
    let (report, _) = run(&folder, &graph(wild, "frontmost: true"));
    assert_eq!(stat(&report, "pixels"), 1200.0);
    // All cells mirrored is no fold.
    let (report, _) = run(&folder, &graph("Affine(grid: \"grid\", scale: (-1.0, 1.0))", ""));
    assert_eq!((stat(&report, "without_source"), stat(&report, "residual") < 1e-3), (0.0, true));
}

#[test]
fn bad_files_are_refused_with_the_mend() {
    let folder = folder();
    let (display, half) = (Rect::at(0, 0, 6, 4), [("R", SampleType::Half), ("G", SampleType::Half)]);
    let with_alpha = [FLOATS[0], FLOATS[1], ("A", SampleType::Float)];
    write(&folder, "half.exr", display, display, &half);
    write(&folder, "uint.exr", display, display, &[("R", SampleType::Uint), ("G", SampleType::Float)]);
    write(&folder, "grey.exr", display, display, &[("Y", SampleType::Float), ("Z", SampleType::Float)]);
    write(&folder, "two.exr", display, display, &FLOATS);
    let with = |name: &str, compression, sample: &dyn Fn(&str, usize, usize) -> f32| {
        write_with(&folder, name, display, display, &with_alpha, compression, sample);
    };
    with("nan.exr", Compression::Zip, &|name, x, y| if (name, y) == ("G", 2) && x > 3 { f32::NAN } else { 1.0 });
    with("bare.exr", Compression::Zip, &|name, _, _| if name == "A" { 0.0 } else { 0.5 });
    with("dwaa.exr", Compression::Dwaa, &|_, _, _| 0.5);
    std::fs::write(folder.path().join("empty.exr"), []).expect("written");
    std::fs::write(folder.path().join("text.exr"), "no picture").expect("written");
    let (unsupported, unreadable) = (Code::InputUnsupported, Code::InputUnreadable);
    for (text, code, parameter, message, hint) in [
        ("path: \"half.exr\"", unsupported, "path", "channel `R` holds 16-bit floats", "allow_half: true"),
        ("path: \"uint.exr\"", unsupported, "path", "channel `R` holds whole numbers", "32-bit floats"),
        ("path: \"dwaa.exr\"", unsupported, "path", "packed with loss (Dwaa)", "allow_lossy: true"),
        ("path: \"text.exr\"", unsupported, "path", "is no EXR", "write the map as an EXR of floats"),
        ("path: \"empty.exr\"", unreadable, "path", "the file is empty", ""),
        ("path: \"missing.exr\"", unreadable, "path", "missing.exr", ""),
        (
            "path: \"grey.exr\"",
            Code::Refused,
            "channels",
            "no layer has the channels `R` and `G`; there are `Y`, `Z`",
            "x: ",
        ),
        (
            "path: \"two.exr\", channels: (alpha: \"A\")",
            Code::Refused,
            "channels",
            "`A` is not in the layer",
            "ignore_alpha",
        ),
        (
            "path: \"nan.exr\"",
            Code::Refused,
            "path",
            "2 pixels have numbers in `R`, `G` that are not finite, the first at (4, 2)",
            "`A`",
        ),
        (
            "path: \"bare.exr\"",
            Code::Refused,
            "path",
            "no pixel has a position: channel `A` is 0",
            "ignore_alpha: true",
        ),
    ] {
        let fault = fault(&folder, &format!("\"out\": LoadWarp({text})"));
        assert_eq!((fault.code, fault.parameter.as_deref()), (code, Some(parameter)), "{text}: {fault:#?}");
        assert!(fault.message.contains(message) && fault.place.is_some(), "{text}: {fault:#?}");
        assert!(fault.message.contains(".exr"), "{text}: {fault:#?}");
        assert!(
            hint.is_empty() || fault.hint.as_deref().is_some_and(|given| given.contains(hint)),
            "{text}: {fault:#?}"
        );
    }
    for text in [
        "path: \"half.exr\", allow_half: true",
        "path: \"dwaa.exr\", allow_lossy: true",
        "path: \"grey.exr\", channels: (x: \"Y\", y: \"Z\")",
        "path: \"bare.exr\", ignore_alpha: true",
        "path: \"two.exr\"",
    ] {
        let (report, warp) = load(&folder, text);
        assert_eq!((stat(&report, "without_source"), warp.grid.nodes), (0.0, [6, 4]), "{text}");
        assert!(warp.x.iter().chain(warp.y.iter()).all(|at| at.is_finite()), "{text}");
    }
}

#[test]
fn what_has_no_position_is_not_drawn_and_leaves_the_rest() {
    let folder = folder();
    let display = Rect::at(0, 0, 6, 4);
    let channels = [FLOATS[0], FLOATS[1], ("A", SampleType::Float)];
    // The identity with a hole at (2, 1).
    let sample = |name: &str, x: usize, y: usize| match name {
        "R" => (x as f32 + 0.5) / 6.0,
        "G" => (y as f32 + 0.5) / 4.0,
        _ => f32::from(u8::from((x, y) != (2, 1))),
    };
    write_with(&folder, "map.exr", display, display, &channels, Compression::Zip, &sample);
    let load = "\"map\": LoadWarp(path: \"map.exr\", preset: OiioStWarp)";
    let graph = format!(
        "\"white\": Constant(size: (6, 4), color: (1.0, 1.0, 1.0, 1.0)), {load}, \"out\": Resample(image: \"white\", warp: \"map\")"
    );
    let (report, values) = run(&folder, &graph);
    let Some(Value::Image(image)) = values.first() else { panic!("{:#?}", report.faults) };
    let Plane::F32(alpha) = &image.layers[0].channel("A").expect("a card has it").plane else { panic!("floats") };
    for (y, row) in alpha.rows().enumerate() {
        for (x, &alpha) in row.iter().enumerate() {
            assert!((alpha - sample("A", x, y)).abs() < 1e-5, "({x}, {y}): {alpha}");
        }
    }
    let (report, _) =
        run(&folder, &format!("{load}, \"out\": SaveWarp(warp: \"map\", path: \"again.exr\", preset: OiioStWarp)"));
    assert_eq!(stat(&report, "without_source"), 1.0);
    for node in ["Invert(warp: \"map\")", "SaveWarp(warp: \"map\", path: \"back.exr\", inverse: true)"] {
        let fault = fault(&folder, &format!("{load}, \"out\": {node}"));
        assert_eq!(fault.message, "1 of 24 nodes have no position (alpha 0), the first at column 2, row 1");
        assert!(fault.hint.expect("a mend").contains("ignore_alpha: true"));
    }
    // What is made of it has the hole too.
    for node in ["Blend(warp: \"map\", amount: 0.5)", "Compose(first: \"map\", second: \"map\")"] {
        let (report, values) = run(&folder, &format!("{load}, \"out\": {node}"));
        let Some(Value::Warp(warp)) = values.first() else { panic!("{:#?}", report.faults) };
        assert!(warp.x[8].is_nan() && warp.x[23].is_finite(), "{node}");
    }
    // What was read is written bit for bit; the hole has a position outside.
    let (before, after) = (written(&folder, "map.exr"), written(&folder, "again.exr"));
    for (a, b) in before.layers[0].channels.iter().zip(&after.layers[0].channels) {
        let (Plane::F32(before), Plane::F32(after)) = (&a.plane, &b.plane) else { panic!("floats") };
        for (at, (a_bits, b_bits)) in before.rows().flatten().zip(after.rows().flatten()).enumerate() {
            let expected = if at == 8 && &*a.name != "A" { -1.0 } else { *a_bits };
            assert_eq!(b_bits.to_bits(), expected.to_bits(), "{} at {at}", a.name);
        }
    }
}

/// A file may hold more than the map: parts, and metadata of no concern.
#[test]
fn the_first_layer_with_the_channels_counts() {
    let folder = folder();
    let data = Rect::at(-2, 1, 3, 2);
    let channel = |name: &str, value: f32| Channel {
        name: name.into(),
        sample_type: SampleType::Float,
        plane: Plane::F32(Buffer::from_packed(&[value; 6], 3, 2)),
    };
    let layer =
        |name: &str, channels: Vec<Channel>| Layer { name: name.into(), data, channels, metadata: Arc::default() };
    let layers = vec![
        layer("beauty", vec![channel("R", 9.0), channel("B", 9.0)]),
        layer("map", vec![channel("R", 0.5), channel("G", 0.25)]),
    ];
    let (display, metadata) = (Rect::at(0, 0, 8, 4), Arc::new(Metadata::new()));
    let image = Image { display, pixel_aspect: 1.0, metadata, layers };
    let bytes = codec::encode_image(&image, "exr", &WriteOptions::default(), &|_| Ok(())).expect("it can be written");
    std::fs::write(folder.path().join("map.exr"), bytes).expect("written");
    let (_, warp) = load(&folder, "path: \"map.exr\"");
    assert_eq!((warp.grid.origin, warp.grid.nodes, warp.x[0], warp.y[5]), ([-1.5, 1.5], [3, 2], 4.0, 3.0));
    // Fractions of another picture's format.
    let graph = "\"big\": Constant(size: (80, 40)), \"out\": LoadWarp(path: \"map.exr\", domain: \"big\")";
    let (report, values) = run(&folder, graph);
    let Some(Value::Warp(warp)) = values.first() else { panic!("{:#?}", report.faults) };
    assert_eq!((warp.x[0], warp.y[5]), (40.0, 30.0));
}
