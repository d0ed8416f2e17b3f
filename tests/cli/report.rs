//! The form of `--report`.

use serde_json::{Value as Json, json};

use crate::desk::{Desk, executed, keys, pair, small_job, text};

const PAIR: [&str; 10] = ["node", "type", "frame", "status", "from", "seconds", "bytes", "peak_bytes", "why", "stats"];
const CACHE: [&str; 5] = ["hits", "misses", "damaged", "written_bytes", "evicted_bytes"];
const WHY: [&str; 7] = ["code", "node", "param", "old", "new", "at", "text"];
const FAULT: [&str; 8] = ["code", "node", "parameter", "frame", "file", "line", "column", "message"];

fn check_form(report: &Json) {
    let all = ["schema", "graph", "frames", "seconds", "peak_bytes", "cache", "nodes", "outputs", "warnings", "faults"];
    assert_eq!(keys(report), all);
    assert_eq!(report["schema"], 1);
    assert!(report["seconds"].is_f64() && report["peak_bytes"].is_u64());
    assert_eq!(keys(&report["cache"]), CACHE);
    let list = |name: &str| report[name].as_array().expect("a list").clone();
    for pair in list("nodes") {
        assert_eq!(keys(&pair), PAIR);
        assert!(pair["why"].is_null() || keys(&pair["why"]) == WHY, "{pair}");
        let ran = ["executed", "recomputed"].contains(&text(&pair["status"]));
        assert!(!ran || (pair["why"].is_object() && pair["from"].is_null()), "{pair}");
        assert_eq!(pair["status"] == "reused", pair["from"].is_string(), "{pair}");
    }
    list("outputs").iter().for_each(|output| assert_eq!(keys(output), ["node", "frame", "path", "bytes", "blake3"]));
    for fault in list("faults").into_iter().chain(list("warnings")) {
        assert_eq!(keys(&fault)[..8], FAULT);
        assert_eq!(keys(&fault)[8..], ["hint"]);
    }
}

#[test]
fn a_report_says_what_ran_and_why() {
    let desk = small_job();
    let report = desk.report("run job.ron");
    check_form(&report);
    assert_eq!(report["graph"], json!(desk.path("job.ron")));
    assert_eq!(report["frames"], json!([]));
    assert!(report["peak_bytes"].as_u64() > Some(1 << 20), "{}", report["peak_bytes"]);
    let bend = pair(&report, "bend");
    assert_eq!((&bend["type"], &bend["frame"], &bend["status"]), (&json!("Arc"), &Json::Null, &json!("executed")));
    assert_eq!(bend["bytes"], 13 * 13 * 2 * 8);
    assert_eq!(bend["why"]["code"], "first_run");
    assert_eq!(bend["why"]["at"], "job.ron:9:15");
}

#[test]
fn a_reason_stands_at_the_parameter() {
    let desk = small_job();
    desk.report("run job.ron");
    let edited = String::from_utf8(desk.read("job.ron")).expect("text").replace("angle: 60.0", "angle:  61.0");
    desk.write("job.ron", edited);
    let report = desk.report("run job.ron");
    check_form(&report);
    for node in ["bend", "keep", "warped", "out"] {
        let why = &pair(&report, node)["why"];
        assert_eq!(why["at"], "job.ron:9:41", "{node}: {why}");
        assert_eq!((&why["old"], &why["new"]), (&json!(60.0), &json!(61.0)));
        assert!(text(&why["text"]).contains("angle"), "{why}");
    }
}

#[test]
fn solvers_and_warps_measure_themselves() {
    let report = small_job().report("run job.ron");
    let factor = &pair(&report, "factor")["stats"];
    assert!(factor["unknowns"].as_u64() > Some(0), "{factor}");
    assert!(factor["seconds_setup"].is_f64() && factor["seconds_factor"].is_f64(), "{factor}");
    let warp = &pair(&report, "keep")["stats"];
    assert_eq!(warp["unknowns"], factor["unknowns"]);
    assert!(warp["residual"].as_f64() < Some(1e-9), "{warp}");
    assert!(warp["seconds_rhs"].is_f64() && warp["seconds_solve"].is_f64() && warp["min_jacobian"].is_f64(), "{warp}");
    assert!(warp["folds"].is_u64(), "{warp}");
    let components = warp["components"].as_array().expect("a list");
    assert!(!components.is_empty());
    components.iter().for_each(|c| assert_eq!(keys(c), ["label", "deviation_cells", "scale", "rotation_deg"]));
    let again = small_job();
    again.report("run job.ron");
    assert_eq!(pair(&again.report("run job.ron"), "keep")["stats"]["residual"], warp["residual"], "kept in the record");
}

#[test]
fn outputs_have_the_digest_of_their_content() {
    let desk = small_job();
    let twin =
        r#", "twin": Save(image: "warped", path: "out/twin.png"), "other": Save(image: "plate", path: "other.png")"#;
    desk.graph("job.ron", &(crate::desk::SMALL_JOB.trim_end_matches(',').to_owned() + twin));
    let report = desk.report("run job.ron");
    let output = |node: &str| {
        let found = report["outputs"].as_array().expect("a list").iter().find(|output| output["node"] == node);
        found.unwrap_or_else(|| panic!("no output of {node}")).clone()
    };
    let (out, twin, other) = (output("out"), output("twin"), output("other"));
    assert_eq!(out["path"], json!(desk.path("out/small.png")));
    assert_eq!(out["bytes"], desk.read("out/small.png").len());
    assert_eq!(desk.read("out/small.png"), desk.read("out/twin.png"));
    assert_eq!(out["blake3"], twin["blake3"]);
    assert_ne!(out["blake3"], other["blake3"]);
    let digest = text(&out["blake3"]);
    assert!(digest.len() == 64 && digest.chars().all(|c| c.is_ascii_hexdigit() && !c.is_uppercase()), "{digest}");
    let again = desk.report("run job.ron");
    executed(&again, []);
    assert_eq!(again["outputs"], report["outputs"], "a file that stands is an output too");
}

#[test]
fn a_failed_run_is_reported() {
    let desk = small_job();
    std::fs::remove_file(desk.path("matte.png")).expect("it was there");
    let report = desk.report("run job.ron --threads 1");
    check_form(&report);
    let fault = &report["faults"][0];
    assert_eq!((&fault["code"], &fault["node"]), (&json!("input_unreadable"), &json!("matte")));
    assert_eq!((&fault["parameter"], &fault["line"]), (&json!("path"), &json!(4)));
    assert!(text(&fault["message"]).contains("matte.png"), "{fault}");
    assert_eq!(pair(&report, "matte")["status"], "failed");
    assert_eq!(pair(&report, "out")["status"], "skipped");
}

#[test]
fn a_refused_run_is_reported() {
    let desk = Desk::new();
    desk.graph("bad.ron", r#""a": Arc(grid: "nowhere", angel: 3.0)"#);
    let report = desk.report("run bad.ron --frames 1-3");
    check_form(&report);
    let codes: Vec<&str> = report["faults"].as_array().expect("a list").iter().map(|f| text(&f["code"])).collect();
    assert!(codes.contains(&"unknown_node") && codes.contains(&"unknown_parameter"), "{codes:?}");
    assert_eq!((&report["nodes"], &report["frames"]), (&json!([]), &json!([1, 2, 3])));
}

#[test]
fn what_was_had_of_the_cache_is_counted() {
    let desk = small_job();
    let counts = |line: &str| {
        let report = desk.report(line);
        check_form(&report);
        CACHE.map(|name| report["cache"][name].as_u64().unwrap_or_else(|| panic!("{name} is no count")))
    };
    let [hits, misses, damaged, written, evicted] = counts("run job.ron");
    assert_eq!((hits, damaged, evicted), (0, 0, 0));
    assert!(misses >= 10 && written > 0, "a record is looked for and kept per node: {misses}, {written}");
    let [hits, _, damaged, _, evicted] = counts("run job.ron");
    assert!(hits >= 10, "{hits}");
    assert_eq!((damaged, evicted), (0, 0));
    assert_eq!(counts("run job.ron --no-cache"), [0; 5]);
}

#[test]
fn pairs_tell_the_memory_they_took() {
    let desk = small_job();
    let report = desk.report("run job.ron");
    for node in ["plate", "mask", "parts", "bend", "factor", "keep", "warped"] {
        let pair = pair(&report, node);
        assert!(pair["bytes"].as_u64() > Some(0) && pair["peak_bytes"].as_u64() >= pair["bytes"].as_u64(), "{pair}");
    }
    let factor = pair(&report, "factor");
    assert!(factor["peak_bytes"].as_u64() > factor["bytes"].as_u64(), "a solver takes more than it gives: {factor}");
    let again = desk.report("run job.ron");
    assert!(again["nodes"].as_array().expect("a list").iter().all(|pair| pair["peak_bytes"] == 0), "{again}");
}
