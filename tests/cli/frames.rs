//! Frame ranges.

use serde_json::{Value as Json, json};

use crate::desk::{Desk, executed, pair, pairs, text};

/// A still card bent by an animated angle, frames 1 to 5.
fn bend() -> Desk {
    let desk = Desk::new();
    desk.shot(
        "bend.ron",
        "1-5",
        r#""card": Checker(size: (24, 24), cell: 4.0), "grid": Lattice(domain: "card", cell: 8.0),
        "bend": Arc(grid: "grid", angle: Keys([(1, 10.0), (5, 50.0)])), "warped": Resample(image: "card", warp: "bend"),
        "out": Save(image: "warped", path: "out/bend.####.png")"#,
    );
    desk
}

/// Plates 1 to 5 in `in`, the one of `missing` left out, and a graph that copies them.
fn plates(missing: &[i64]) -> Desk {
    let desk = Desk::new();
    for frame in (1..=5).filter(|frame| !missing.contains(frame)) {
        desk.card(&format!("in/plate.{frame:04}.png"), &format!("Checker(size: (8, 8), cell: {frame}.0)"));
    }
    desk.shot(
        "copy.ron",
        "1-5",
        r#""plate": Load(path: "in/plate.####.png"), "out": Save(image: "plate", path: "out/copy.####.png")"#,
    );
    desk
}

#[test]
fn a_static_branch_executes_once() {
    let desk = bend();
    let report = desk.report("run bend.ron");
    assert_eq!(report["frames"], json!([1, 2, 3, 4, 5]));
    assert_eq!(pairs(&report, "executed").len(), 2 + 3 * 5);
    for node in ["card", "grid"] {
        assert_eq!(pair(&report, node)["frame"], Json::Null);
    }
    assert_eq!(desk.files("out"), (1..=5).map(|frame| format!("bend.{frame:04}.png")).collect::<Vec<_>>());
    executed(&desk.report("run bend.ron"), []);
}

#[test]
fn a_flag_overrides_the_range_of_the_file() {
    let desk = bend();
    let report = desk.report("run bend.ron --frames 1-5x2,12");
    assert_eq!(report["frames"], json!([1, 3, 5, 12]));
    assert_eq!(desk.files("out"), ["bend.0001.png", "bend.0003.png", "bend.0005.png", "bend.0012.png"]);
    assert_eq!(desk.read("out/bend.0005.png"), desk.read("out/bend.0012.png"), "keys hold outside");
    let ran = pairs(&report, "executed");
    assert_ne!(ran.contains("warped@5"), ran.contains("warped@12"), "one computes for both: {ran:?}");
    executed(&desk.report("run bend.ron --frames 2"), ["bend@2", "out@2", "warped@2"]);
    desk.report("run bend.ron --frames -2--1");
    assert!(desk.files("out").contains(&"bend.-0002.png".to_owned()), "{:?}", desk.files("out"));
}

#[test]
fn plates_go_in_and_out_by_frame() {
    let desk = plates(&[]);
    let ended = desk.run("run copy.ron").expect(0);
    let mut written: Vec<&str> = ended.stdout.lines().collect();
    written.sort_unstable();
    let expected: Vec<String> =
        (1..=5).map(|f| desk.path(&format!("out/copy.{f:04}.png")).display().to_string()).collect();
    assert_eq!(written, expected);
    desk.card("in/plate.0003.png", "Checker(size: (8, 8), cell: 6.0)");
    executed(&desk.report("run copy.ron"), ["out@3", "plate@3"]);
}

#[test]
fn without_keep_going_no_frame_starts_after_a_fault() {
    let desk = plates(&[3]);
    let missing = desk.path("in/plate.0003.png").display().to_string();
    desk.run("run copy.ron --threads 1 --report r.json").says(3, &["frame 3", &missing, "does not exist"]);
    assert_eq!(desk.files("out"), ["copy.0001.png", "copy.0002.png"]);
    let fault = &desk.read_json("r.json")["faults"][0];
    assert_eq!((&fault["frame"], &fault["node"]), (&json!(3), &json!("plate")));
    assert!(text(&fault["message"]).contains(&missing), "{fault}");
}

#[test]
fn with_keep_going_the_other_frames_are_delivered() {
    let desk = plates(&[2, 4]);
    desk.run("run copy.ron --keep-going --report r.json").says(1, &["frame 2", "frame 4"]);
    assert_eq!(desk.files("out"), ["copy.0001.png", "copy.0003.png", "copy.0005.png"]);
    let report = desk.read_json("r.json");
    let frames: Vec<i64> =
        report["faults"].as_array().expect("a list").iter().filter_map(|fault| fault["frame"].as_i64()).collect();
    assert_eq!(frames, [2, 4], "in the order of frames");
    assert_eq!(pairs(&report, "failed"), ["plate@2".to_owned(), "plate@4".to_owned()].into());
    desk.card("in/plate.0002.png", "Checker(size: (8, 8), cell: 2.0)");
    desk.card("in/plate.0004.png", "Checker(size: (8, 8), cell: 4.0)");
    executed(&desk.report("run copy.ron"), ["out@2", "out@4", "plate@2", "plate@4"]);
}

#[test]
fn frames_beside_damaged_ones_and_bombs_are_delivered() {
    let desk = plates(&[]);
    let mut damaged = desk.read("in/plate.0003.png");
    // The last byte of the packed pixels: behind it are its chunk's checksum and the chunk of the end.
    let last = damaged.len() - 17;
    damaged[last] ^= 0x55;
    desk.write("in/plate.0003.png", damaged);
    // A sound head of 65536 x 65536 pixels: width and height, then the checksum of the chunk.
    let mut bomb = desk.read("in/plate.0005.png");
    bomb[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    let sum = crc(&bomb[12..29]);
    bomb[29..33].copy_from_slice(&sum.to_be_bytes());
    desk.write("in/plate.0005.png", bomb);
    let ended = desk.run("run copy.ron --keep-going --memory 512M --report r.json");
    ended.says(1, &["frame 3", "frame 5", "in/plate.0003.png", "in/plate.0005.png"]);
    assert_eq!(desk.files("out"), ["copy.0001.png", "copy.0002.png", "copy.0004.png"]);
    let report = desk.read_json("r.json");
    let faults: Vec<_> = report["faults"].as_array().expect("a list").iter().collect();
    let codes = faults.iter().map(|fault| (fault["frame"].as_i64(), text(&fault["code"]))).collect::<Vec<_>>();
    assert_eq!(codes, [(Some(3), "input_unreadable"), (Some(5), "over_budget")]);
    assert!(faults.iter().all(|fault| fault["node"] == "plate"), "{faults:?}");
}

/// The checksum of a PNG's chunks (CRC-32).
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| sum >> 1 ^ (0xedb8_8320 & (sum & 1).wrapping_neg()))
    })
}

#[test]
fn where_no_frame_is_delivered_the_first_fault_decides() {
    let desk = plates(&[2, 3, 4]);
    desk.write("in/plate.0003.png", "GIF89a is not read");
    desk.run("run copy.ron --frames 2-4 --keep-going").expect(3);
    desk.run("run copy.ron --frames 3,2,4 --keep-going").expect(4);
}

#[test]
fn moving_graphs_need_frames_and_patterns() {
    let desk = Desk::new();
    let nodes = |path: &str| {
        format!(
            r#""card": Checker(size: (8, 8), cell: Keys([(1, 1.0), (2, 2.0)])), "out": Save(image: "card", path: "{path}")"#
        )
    };
    desk.graph("a.ron", &nodes("o.####.png"));
    desk.run("run a.ron").says(2, &["no_frames"]);
    desk.run("run a.ron --frames 1-2").expect(0);
    desk.shot("b.ron", "1-2", &nodes("o.png"));
    desk.run("run b.ron").says(2, &["needs_frame_pattern"]);
    desk.run("run b.ron --frames 2").expect(0);
    desk.run("run b.ron --frames 2-1").says(2, &["backwards"]);
}
