//! The main job, graphs/feature_warp.ron: what a change executes, and what it does not.

use crate::desk::{Desk, SMALL_JOB, executed, graphs, pair, pairs, small_job};

const ALL: [&str; 10] = ["bend", "factor", "grid", "keep", "mask", "matte", "out", "parts", "plate", "warped"];

/// A copy of the graph with its pictures.
fn photograph() -> Desk {
    let desk = Desk::new();
    for name in ["feature_warp.ron", "astronaut.png", "astronaut_features.png"] {
        let bytes = std::fs::read(graphs().join(name)).expect("it is in the repository");
        desk.write(&format!("graphs/{name}"), bytes);
    }
    desk
}

const RUN: &str = "run graphs/feature_warp.ron";
const PICTURE: &str = "graphs/out/feature_warp.png";

#[test]
fn a_new_angle_executes_the_four_nodes_that_it_reaches() {
    let desk = photograph();
    let path = desk.path(PICTURE);
    assert_eq!(desk.run(&format!("{RUN} --report r.json")).expect(0).stdout, format!("{}\n", path.display()));
    executed(&desk.read_json("r.json"), ALL);
    let first = desk.read(PICTURE);

    let again = desk.report(RUN);
    executed(&again, []);
    assert_eq!(pairs(&again, "reused"), ALL.map(str::to_owned).into());

    let turned = desk.report(&format!("{RUN} --set bend.angle=75.0"));
    executed(&turned, ["bend", "keep", "out", "warped"]);
    assert_ne!(desk.read(PICTURE), first);
    let why = &pair(&turned, "out")["why"];
    let cause = [&why["code"], &why["node"], &why["param"], &why["old"], &why["new"]];
    assert_eq!(cause.map(|part| part.to_string()), ["\"param\"", "\"bend\"", "\"angle\"", "60.0", "75.0"]);

    let back = desk.report(RUN);
    executed(&back, ["out"]);
    assert_eq!(pair(&back, "out")["why"]["code"], "output_changed");
    assert_eq!(desk.read(PICTURE), first);
}

#[test]
fn thread_counts_and_the_cache_do_not_change_the_picture() {
    let desk = photograph();
    let report = desk.report(&format!("{RUN} --no-cache --threads 1"));
    executed(&report, ALL);
    assert_eq!(desk.files(""), ["graphs"], "no cache folder is made");
    let first = desk.read(PICTURE);
    executed(&desk.report(&format!("{RUN} --no-cache --threads 3")), ALL);
    assert_eq!(desk.read(PICTURE), first);
}

#[test]
fn a_second_process_recomputes_what_is_held_in_memory_only() {
    let desk = photograph();
    executed(&desk.report(&format!("{RUN} --store all")), ALL);
    let turned = desk.report(&format!("{RUN} --store all --set bend.angle=75.0"));
    executed(&turned, ["bend", "keep", "out", "warped"]);
    assert_eq!(pairs(&turned, "recomputed"), ["factor".to_owned()].into());
    assert_eq!(pair(&turned, "factor")["why"]["code"], "not_kept");
    assert_eq!(pair(&turned, "plate")["from"], "disk");
    assert_eq!(pair(&turned, "mask")["from"], "record");
}

#[test]
fn a_deleted_picture_is_written_again() {
    let desk = small_job();
    executed(&desk.report("run job.ron"), ALL);
    let first = desk.read("out/small.png");
    std::fs::remove_dir_all(desk.path("out")).expect("it was written");
    let report = desk.report("run job.ron");
    executed(&report, ["out"]);
    assert_eq!(pair(&report, "out")["why"]["code"], "output_missing");
    assert_eq!(desk.read("out/small.png"), first);
}

#[test]
fn names_order_and_comments_execute_nothing() {
    let desk = small_job();
    desk.report("run job.ron");
    let mut lines: Vec<&str> = SMALL_JOB.lines().filter(|line| !line.is_empty()).collect();
    lines.reverse();
    let renamed = lines.join(" // a remark\n\n").replace("\"bend\"", "\"curve\"").replace("60.0", "6e1");
    desk.graph("job.ron", &renamed);
    executed(&desk.report("run job.ron"), []);
    desk.write("other/plate.png", desk.read("plate.png"));
    executed(&desk.report("run job.ron --set plate.path=\"other/plate.png\""), []);
}

#[test]
fn a_plate_is_known_by_its_content() {
    let desk = small_job();
    desk.report("run job.ron");
    let plate = std::fs::File::options().append(true).open(desk.path("plate.png")).expect("a file");
    plate.set_modified(std::time::SystemTime::now()).expect("times can be set");
    executed(&desk.report("run job.ron"), []);

    desk.card("plate.png", "Checker(size: (48, 48), cell: 7.0)");
    let other = desk.report("run job.ron");
    // The lattice asks for the plate's size only, which is the same.
    executed(&other, ["out", "plate", "warped"]);
    let why = &pair(&other, "out")["why"];
    assert_eq!((&why["code"], &why["node"]), (&"file".into(), &"plate".into()));

    desk.card("plate.png", "Checker(size: (52, 48), cell: 7.0)");
    let larger = desk.report("run job.ron");
    executed(&larger, ["bend", "factor", "grid", "keep", "out", "plate", "warped"]);
}

#[test]
fn a_matte_that_gives_the_same_mask_goes_no_further() {
    let desk = small_job();
    desk.report("run job.ron");
    desk.card("matte.png", "Checker(size: (48, 48), cell: 24.0, even: (0.9, 0.9, 0.9, 1.0))");
    executed(&desk.report("run job.ron"), ["mask", "matte"]);
}
