//! Exit codes.

use crate::desk::{Desk, SMALL_JOB, small_job};

/// A desk with `copy.ron`, which saves what it loads from `plate`.
fn copy(plate: impl AsRef<[u8]>) -> Desk {
    let desk = Desk::new();
    desk.write("plate", plate);
    desk.graph("copy.ron", r#""plate": Load(path: "plate"), "out": Save(image: "plate", path: "out.png")"#);
    desk
}

#[test]
fn usage_is_2() {
    let desk = small_job();
    desk.run("run job.ron --sett bend.angle=1.0").says(2, &["--set"]);
    desk.run("run").says(2, &["GRAPH"]);
    desk.run("").expect(2);
    desk.run("run none.ron").says(2, &["none.ron does not exist"]);
    desk.run("check none.ron").says(2, &["none.ron does not exist"]);
    desk.run("run out").expect(2);
    desk.run("run .").says(2, &["not a regular file"]);
    desk.run("run job.ron --memory 3").says(2, &["16M"]);
    desk.run("run job.ron --threads 0").expect(2);
    desk.run("run job.ron --target oot").says(2, &["did you mean `out`?"]);
    desk.run("run job.ron --set bend.angel=1.0").says(2, &["did you mean `angle`?"]);
    desk.run("run job.ron --set bend.angle").expect(2);
    desk.write("latin1.ron", b"Graph(version: 1, // caf\xe9\n)");
    desk.run("run latin1.ron").says(2, &["UTF-8"]);
    assert!(!desk.path("out").exists() && !desk.path("cache").exists(), "nothing ran");
}

#[test]
fn a_wrong_graph_is_2_with_all_its_faults() {
    let desk = Desk::new();
    desk.graph(
        "bad.ron",
        "\"a\": Chekcer(),\n\"b\": Checker(cel: 3.0, size: (0, 4)),\n\"c\": Save(image: \"b\", path: 3)",
    );
    let line = ["bad.ron:2:6", "Checker", "bad.ron:3:14", "`cell`", "bad.ron:3:", "bad.ron:4:"];
    desk.run("run bad.ron").says(2, &line);
    desk.run("check bad.ron").says(2, &line).says(2, &["faults"]);
}

#[test]
fn unreadable_inputs_are_3() {
    let desk = small_job();
    let whole = desk.read("plate.png");
    desk.write("plate.png", &whole[..whole.len() / 2]);
    let plate = desk.path("plate.png").display().to_string();
    desk.run("run job.ron").says(3, &["error[input_unreadable]", &plate]);
    std::fs::remove_file(&plate).expect("it is there");
    desk.run("run job.ron").says(3, &[&plate, "does not exist", "job.ron:3:26"]);
    std::fs::create_dir(&plate).expect("a folder");
    desk.run("run job.ron").says(3, &["not a regular file"]);
    copy("").run("run copy.ron").says(3, &["empty"]);
}

#[test]
fn unsupported_inputs_are_4() {
    copy("GIF89a").run("run copy.ron").says(4, &["input_unsupported", "EXR, PNG, JPEG"]);
    copy(deep_exr()).run("run copy.ron").says(4, &["input_unsupported", "deep"]);
}

/// The header of an EXR with a list of samples per pixel.
fn deep_exr() -> Vec<u8> {
    let mut file = vec![0x76, 0x2f, 0x31, 0x01, 2, 0x08, 0, 0];
    let window: Vec<u8> = [0i32, 0, 3, 3].iter().flat_map(|side| side.to_le_bytes()).collect();
    let one = 1f32.to_le_bytes();
    let mut channels = b"Z\0".to_vec();
    channels.extend([2i32, 0, 1, 1].iter().flat_map(|number| number.to_le_bytes()));
    channels.push(0);
    let attributes: [(&str, &str, &[u8]); 12] = [
        ("channels", "chlist", &channels),
        ("chunkCount", "int", &4i32.to_le_bytes()),
        ("compression", "compression", &[0]),
        ("dataWindow", "box2i", &window),
        ("displayWindow", "box2i", &window),
        ("lineOrder", "lineOrder", &[0]),
        ("maxSamplesPerPixel", "int", &1i32.to_le_bytes()),
        ("pixelAspectRatio", "float", &one),
        ("screenWindowCenter", "v2f", &[0; 8]),
        ("screenWindowWidth", "float", &one),
        ("type", "string", b"deepscanline"),
        ("version", "int", &1i32.to_le_bytes()),
    ];
    for (name, kind, value) in attributes {
        file.extend([name.as_bytes(), b"\0", kind.as_bytes(), b"\0"].concat());
        file.extend((value.len() as i32).to_le_bytes());
        file.extend(value);
    }
    file.push(0);
    file.extend([0; 4 * 8]);
    file
}

#[test]
fn a_missing_plugin_is_5() {
    let desk = Desk::new();
    let nodes = r#"nodes: { "a": Checker(), "out": Save(image: "a", path: "a.png") }"#;
    desk.write("plug.ron", format!("Graph(version: 1, plugins: [\"com.example.glow\"], {nodes})"));
    desk.run("run plug.ron --plugins shelf").says(5, &["missing_plugin", "com.example.glow", "shelf"]);
    desk.run("check plug.ron").says(2, &["com.example.glow"]);
}

#[test]
fn unwritable_outputs_are_6() {
    let desk = small_job();
    desk.write("out", "a file where a folder should be");
    let picture = desk.path("out/small.png").display().to_string();
    desk.run("run job.ron").says(6, &["output_unwritable", &picture, "help: a file has the name of a folder"]);
    desk.run("run job.ron --set out.path=\"fine.png\" --report out/r.json").says(6, &["report"]);
    assert!(desk.path("fine.png").exists());
    std::fs::create_dir(desk.path("folder.png")).expect("a folder");
    desk.run("run job.ron --set out.path=\"folder.png\"").says(6, &["folder.png", "help: a folder has that name"]);
    assert!(!desk.files("").iter().any(|name| name.ends_with(".tmp")), "{:?}", desk.files(""));
}

#[test]
fn refusals_are_7() {
    let desk = small_job();
    let other = SMALL_JOB.replace(r#"Arc(grid: "grid""#, r#"Arc(grid: "other""#);
    desk.graph("job.ron", &(other + r#""other": Lattice(domain: "plate", cell: 6.0)"#));
    desk.run("run job.ron").says(7, &["error[refused]", "another lattice", "9 x 9", "13 x 13", "job.ron:10"]);
    desk.graph("big.ron", r#""big": Constant(size: (4000, 4000)), "out": Save(image: "big", path: "big.exr")"#);
    let size = "`big` needs 244.1M, more than the ";
    let planes = "leaves, for 4 planes of 4000 x 4000";
    desk.run("run big.ron --memory 16M").says(7, &["over_budget", size, planes, "--memory"]);
    assert!(!desk.path("big.exr").exists());
}
