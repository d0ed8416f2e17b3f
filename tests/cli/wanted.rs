//! What no node looks at of a plate is not unpacked.

use serde_json::json;

use crate::desk::{Desk, executed, pair};

/// A desk with a plate as an EXR, and a graph that looks at it in three ways.
fn desk() -> Desk {
    let desk = Desk::new();
    desk.card("plate.exr", "Checker(size: (48, 32), cell: 6.0)");
    desk.graph(
        "job.ron",
        r#"
    "plate": Load(path: "plate.exr"),
    "grid":  Lattice(domain: "plate", cell: 4.0),
    "mask":  Threshold(image: "plate", channel: "R", above: 0.5),
    "parts": Components(mask: "mask"),
    "out":   Save(image: "plate", path: "out.exr"),"#,
    );
    desk
}

#[test]
fn a_lattice_lies_over_a_plate_whose_pixels_are_damaged() {
    let desk = desk();
    desk.run("run job.ron --no-cache --target grid --dump grid=sound.json").expect(0);
    let mut plate = desk.read("plate.exr");
    let end = plate.len() - 20;
    plate[end..].fill(0xa5);
    desk.write("plate.exr", plate);
    desk.run("run job.ron --no-cache --target grid --dump grid=grid.json").expect(0);
    assert_eq!(desk.read("grid.json"), desk.read("sound.json"));
    desk.run("run job.ron --no-cache --target mask").says(3, &["plate.exr", "damaged"]);
}

#[test]
fn a_plate_is_read_again_for_a_reader_that_looks_at_more_and_nothing_else_runs() {
    let desk = desk();
    let bytes = |report: &serde_json::Value| pair(report, "plate")["bytes"].as_u64().expect("a number");
    let plane = 48 * 32 * 4;
    let report = desk.report("run job.ron --target grid");
    assert_eq!(bytes(&report), 0);
    let report = desk.report("run job.ron --target grid --target parts");
    executed(&report, ["mask", "parts", "plate"]);
    assert_eq!(bytes(&report), plane, "a plane of R");
    let why = &pair(&report, "plate")["why"];
    assert_eq!(json!([why["code"], why["old"], why["new"]]), json!(["wanted", "windows", "channels R"]));

    let words = "job.ron --target grid --target parts --target out";
    let foretold = desk.run(&format!("explain {words}")).expect(0).stdout;
    assert!(foretold.contains("now they look at all"), "{foretold}");
    let report = desk.report(&format!("run {words}"));
    executed(&report, ["out", "plate"]);
    assert!(bytes(&report) >= 3 * plane);
    executed(&desk.report("run job.ron --target grid --target parts"), []);
}
