//! `--dump`: any value on any edge, as a file.

use serde_json::{Value as Json, json};

use crate::desk::{Desk, keys, pairs, small_job};

fn numbers(json: &Json) -> Vec<f64> {
    json.as_array().expect("a list").iter().map(|number| number.as_f64().expect("a number")).collect()
}

/// A channel of a dumped EXR, by way of a graph that finds where it lies above `bound`, as the pixels that do.
fn area_above(desk: &Desk, exr: &str, channel: &str, bound: f64) -> i64 {
    desk.graph(
        "look.ron",
        &format!(
            r#""in": Load(path: "{exr}"), "high": Threshold(image: "in", channel: "{channel}", above: {bound:?}),
            "parts": Components(mask: "high")"#
        ),
    );
    desk.run("run look.ron --no-cache --target parts --dump parts=look.json").expect(0);
    let table = desk.read_json("look.json")["components"].clone();
    table.as_array().expect("a list").iter().filter_map(|component| component["area"].as_i64()).sum()
}

#[test]
fn a_warp_goes_through_json_to_the_bit() {
    let desk = small_job();
    desk.run("run job.ron --dump keep=a.json --dump keep.warp=b.json --dump keep=c.exr").expect(0);
    let warp = desk.read_json("a.json");
    assert_eq!(keys(&warp), ["kind", "direction", "origin", "spacing", "nodes", "x", "y"]);
    assert_eq!((&warp["kind"], &warp["direction"]), (&json!("Warp"), &json!("dst_from_src")));
    assert_eq!(json!([warp["origin"], warp["spacing"], warp["nodes"]]), json!([[0.0, 0.0], [4.0, 4.0], [13, 13]]));
    assert_eq!(desk.read("a.json"), desk.read("b.json"));
    for axis in ["x", "y"] {
        let positions = numbers(&warp[axis]);
        assert_eq!(positions.len(), 13 * 13);
        let written: Vec<f64> = serde_json::from_str(&json!(positions).to_string()).expect("JSON");
        assert!(positions.iter().zip(&written).all(|(a, b)| a.to_bits() == b.to_bits()));
    }
    // The picture of it holds the same positions, a pixel per node.
    let high = numbers(&warp["x"]).iter().filter(|&&x| x as f32 > 24.0).count() as i64;
    assert!(high > 0 && high < 13 * 13);
    assert_eq!(area_above(&desk, "c.exr", "x", 24.0), high);
}

#[test]
fn masks_and_labels() {
    let desk = small_job();
    let dumps = "--dump mask=mask.exr --dump parts=parts.json --dump parts=parts.exr --dump parts.count=count.json";
    desk.run(&format!("run job.ron {dumps}")).expect(0);
    let table = desk.read_json("parts.json");
    assert_eq!((&table["kind"], keys(&table)), (&json!("Labels"), vec!["kind", "components"]));
    // Two squares that meet at a corner.
    let components = table["components"].as_array().expect("a list");
    assert_eq!(components.len(), 1);
    assert_eq!(keys(&components[0]), ["label", "area", "bounds", "centroid"]);
    assert_eq!((&components[0]["area"], &components[0]["centroid"]), (&json!(2 * 24 * 24), &json!([24.0, 24.0])));
    assert_eq!(area_above(&desk, "mask.exr", "A", 0.5), 2 * 24 * 24);
    assert_eq!(desk.read_json("count.json"), json!({ "kind": "Number", "value": 1.0 }));
    assert_eq!(desk.read("parts.exr")[..4], [0x76, 0x2f, 0x31, 0x01]);
    desk.graph("ids.ron", r#""in": Load(path: "parts.exr"), "m": Threshold(image: "in", channel: "id", above: 0.0)"#);
    desk.run("run ids.ron --target m").says(7, &["channel id holds identities"]);
}

#[test]
fn lattices_factors_and_pictures() {
    let desk = small_job();
    desk.run("run job.ron --dump grid=grid.json --dump factor=factor.json --dump warped=warped.png").expect(0);
    let grid = desk.read_json("grid.json");
    assert_eq!(
        (&grid["kind"], &grid["nodes"], &grid["periodic"]),
        (&json!("Grid"), &json!([13, 13]), &json!([false, false]))
    );
    assert!(grid.get("x").is_none() && grid["spacing"] == json!([4.0, 4.0]));
    let factor = desk.read_json("factor.json");
    assert_eq!(factor["kind"], "Factor");
    assert!(factor["unknowns"].as_u64() > Some(0), "{factor}");
    assert_eq!(desk.read("warped.png"), desk.read("out/small.png"));
}

#[test]
fn a_dump_makes_its_node_a_target_besides() {
    let desk = small_job();
    desk.graph("loose.ron", &(crate::desk::SMALL_JOB.to_owned() + r#""loose": Swirl(grid: "grid", angle: 9.0)"#));
    desk.run("run loose.ron --dump loose=deep/er/loose.json").expect(0);
    assert!(desk.path("deep/er/loose.json").exists() && desk.path("out/small.png").exists());
    let report = desk.report("run loose.ron --target grid --dump bend=bend.json");
    assert_eq!(report["nodes"].as_array().map(Vec::len), Some(3), "plate, grid and bend: {report:#}");
    // Its value is wanted again, though nothing executes.
    std::fs::remove_file(desk.path("bend.json")).expect("it was written");
    assert_eq!(pairs(&desk.report("run loose.ron --dump bend=bend.json"), "executed"), [].into());
    assert!(desk.path("bend.json").exists());
}

/// A still lattice and an angle that moves over frames 1 to 3.
fn shot() -> Desk {
    let desk = Desk::new();
    desk.shot(
        "bend.ron",
        "1-3",
        r#""card": Checker(size: (24, 24)), "grid": Lattice(domain: "card", cell: 8.0),
        "bend": Arc(grid: "grid", angle: Keys([(1, 10.0), (3, 50.0)]))"#,
    );
    desk
}

#[test]
fn over_a_range_the_path_needs_a_pattern() {
    let desk = shot();
    desk.run("run bend.ron --dump bend=bend.json").says(2, &["3 frames", "####"]);
    desk.run("run bend.ron --dump bend=bend.####.json").expect(0);
    let frames = ["bend.0001.json", "bend.0002.json", "bend.0003.json"];
    assert!(frames.iter().all(|name| desk.path(name).exists()));
    assert_ne!(desk.read(frames[0]), desk.read(frames[1]));
    desk.run("run bend.ron --frames 2 --dump bend=one.json").expect(0);
    assert_eq!(desk.read("one.json"), desk.read(frames[1]));
}

#[test]
fn a_still_value_is_dumped_once_or_for_each_frame() {
    let desk = shot();
    desk.run("run bend.ron --dump bend=b.####.json --dump grid=grid.json --dump grid=grid.##.json").expect(0);
    for name in ["grid.01.json", "grid.02.json", "grid.03.json"] {
        assert_eq!(desk.read(name), desk.read("grid.json"));
    }
    assert!(!desk.path("grid.##.json").exists());
    small_job().run("run job.ron --dump grid=grid.##.json").says(2, &["no frames"]);
}

#[test]
fn dumps_that_cannot_be_are_refused_before_anything_runs() {
    let desk = small_job();
    let refused = |dump: &str, words: &[&str]| {
        desk.run(&format!("run job.ron --dump {dump}")).says(2, words);
    };
    refused("keep", &["NODE.PORT=FILE"]);
    refused("=a.json", &["NODE.PORT=FILE"]);
    refused("kep=a.json", &["did you mean `keep`?"]);
    refused("parts.cuont=a.json", &["labels", "count"]);
    refused("out=a.json", &["Save", "only writes"]);
    refused("keep=a.png", &["Warp", ".png", "exr or json"]);
    refused("mask=a.png", &["Mask", ".png", "exr"]);
    refused("grid=grid", &["Grid", "json"]);
    refused("plate=plate.gif", &["Image", ".gif", "png"]);
    refused("keep=a.json --dump bend=./a.json", &["a.json", "already"]);
    assert!(!desk.path("out").exists() && !desk.path("cache").exists(), "nothing ran");
}

#[test]
fn a_dump_that_cannot_be_written_is_6() {
    let desk = small_job();
    desk.write("file", "no folder");
    desk.run("run job.ron --dump keep=file/keep.json").says(6, &["output_unwritable", "keep.json"]);
}
