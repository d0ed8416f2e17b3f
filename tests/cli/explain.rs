//! `explain`: what a run would do, and why.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::SystemTime;

use serde_json::{Value as Json, json};

use crate::cache::files_below;
use crate::desk::{Desk, Ended, keys, pair, pairs, small_job, text};

const ALL: [&str; 10] = ["bend", "factor", "grid", "keep", "mask", "matte", "out", "parts", "plate", "warped"];
const LATE: &str = "explain job.ron --set bend.angle=75.0";

fn parsed(ended: &Ended) -> Json {
    serde_json::from_str(&ended.stdout).unwrap_or_else(|error| panic!("{error}: {ended:?}"))
}

fn explained(desk: &Desk, line: &str) -> Json {
    parsed(&desk.run(&format!("{line} --format json")).expect(0))
}

/// The pairs of an explanation that are judged so: `node`, or `node@frame`.
fn judged(explanation: &Json, verdict: &str) -> BTreeSet<String> {
    let name = |pair: &Json| match pair["frame"].as_i64() {
        Some(frame) => format!("{}@{frame}", text(&pair["node"])),
        None => text(&pair["node"]).to_owned(),
    };
    let nodes = explanation["nodes"].as_array().expect("a list of pairs");
    nodes.iter().filter(|pair| pair["verdict"] == verdict).map(name).collect()
}

fn names<const N: usize>(names: [&str; N]) -> BTreeSet<String> {
    names.map(str::to_owned).into()
}

#[track_caller]
fn expect<const R: usize, const M: usize>(explanation: &Json, runs: [&str; R], may_run: [&str; M]) {
    assert_eq!(judged(explanation, "runs"), names(runs), "{explanation:#}");
    assert_eq!(judged(explanation, "may_run"), names(may_run), "{explanation:#}");
    assert_eq!(judged(explanation, "reused").len() + R + M, ALL.len(), "{explanation:#}");
}

/// Explains, runs with the same words, and checks that the one foretold the other.
#[track_caller]
fn foretold(desk: &Desk, words: &str) -> Json {
    let explanation = explained(desk, &format!("explain {words}"));
    let executed = pairs(&desk.report(&format!("run {words}")), "executed");
    let (runs, may_run) = (judged(&explanation, "runs"), judged(&explanation, "may_run"));
    assert!(executed.is_superset(&runs), "{runs:?} would run, {executed:?} did");
    assert!(executed.is_subset(&(&runs | &may_run)), "{runs:?} would run, {may_run:?} may, {executed:?} did");
    explanation
}

#[test]
fn on_a_cold_cache_everything_runs_or_may() {
    let desk = small_job();
    let explanation = explained(&desk, "explain job.ron");
    assert_eq!(keys(&explanation), ["schema", "graph", "frames", "nodes", "faults"]);
    let head = [&explanation["schema"], &explanation["graph"], &explanation["frames"], &explanation["faults"]];
    assert_eq!(head, [&json!(1), &json!(desk.path("job.ron")), &json!([]), &json!([])]);
    for pair in explanation["nodes"].as_array().expect("a list") {
        assert_eq!(keys(pair), ["node", "type", "frame", "verdict", "from", "why"]);
        assert_eq!((&pair["why"]["code"], &pair["from"]), (&json!("first_run"), &Json::Null));
    }
    // Only what stands on files alone is sure to be new.
    assert_eq!(judged(&explanation, "runs"), names(["matte", "plate"]));
    assert_eq!(judged(&explanation, "may_run").len(), ALL.len() - 2);
    assert_eq!(pair(&explanation, "bend")["why"]["at"], "job.ron:9:15");

    let ended = desk.run("explain job.ron").says(0, &["2 would run, 8 may run, 0 reused"]);
    assert_eq!(ended.stdout.lines().count(), ALL.len(), "{}", ended.stdout);
    assert!(ended.stdout.contains("runs     plate   `plate` runs here for the first time (job.ron:3:15)\n"));
    assert!(ended.stdout.contains("may run  out     `out` runs here for the first time (job.ron:12:15)\n"));
    foretold(&desk, "job.ron");
}

#[test]
fn after_a_run_all_is_reused() {
    let desk = small_job();
    desk.run("run job.ron").expect(0);
    let explanation = foretold(&desk, "job.ron");
    assert_eq!(judged(&explanation, "reused"), names(ALL));
    for pair in explanation["nodes"].as_array().expect("a list") {
        let from = if pair["node"] == "out" { "file" } else { "record" };
        assert_eq!((&pair["from"], &pair["why"]), (&json!(from), &Json::Null), "{pair}");
    }
    let ended = desk.run("explain job.ron").says(0, &["0 would run, 0 may run, 10 reused"]);
    assert!(ended.stdout.lines().all(|line| line.starts_with("reused ")), "{}", ended.stdout);
}

#[test]
fn a_new_angle_reaches_four_nodes() {
    let desk = small_job();
    desk.run("run job.ron").expect(0);
    let explanation = explained(&desk, LATE);
    expect(&explanation, ["bend"], ["keep", "warped", "out"]);
    for node in ["bend", "keep", "warped", "out"] {
        let why = &pair(&explanation, node)["why"];
        let cause = [&why["code"], &why["node"], &why["param"], &why["old"], &why["new"], &why["at"]];
        let expected =
            [&json!("param"), &json!("bend"), &json!("angle"), &json!(60.0), &json!(75.0), &json!("--set:1:12")];
        assert_eq!(cause, expected, "{node}");
    }
    let ended = desk.run(LATE).says(0, &["1 would run, 3 may run, 6 reused"]);
    let line = "runs     bend    `angle` of `bend` was 60.0 and is 75.0 (--set:1:12)\n";
    assert!(ended.stdout.contains(line), "{}", ended.stdout);

    let edited = String::from_utf8(desk.read("job.ron")).expect("text").replace("angle: 60.0", "angle:  61.0");
    desk.write("job.ron", edited);
    let explanation = foretold(&desk, "job.ron");
    expect(&explanation, ["bend"], ["keep", "warped", "out"]);
    assert_eq!(pair(&explanation, "out")["why"]["at"], "job.ron:9:41");
}

#[test]
fn a_changed_plate_may_reach_all_that_stands_on_it() {
    let desk = small_job();
    desk.run("run job.ron").expect(0);
    desk.card("plate.png", "Checker(size: (48, 48), cell: 7.0)");
    let explanation = foretold(&desk, "job.ron");
    expect(&explanation, ["plate"], ["grid", "factor", "bend", "keep", "warped", "out"]);
    for node in ["plate", "grid", "out"] {
        let why = &pair(&explanation, node)["why"];
        let cause = [&why["code"], &why["node"], &why["param"], &why["at"]];
        assert_eq!(cause, ["file", "plate", "path", "job.ron:3:26"], "{node}: {why}");
    }
}

#[test]
fn a_matte_that_gives_the_same_mask_may_have_gone_further() {
    let desk = small_job();
    desk.run("run job.ron").expect(0);
    desk.card("matte.png", "Checker(size: (48, 48), cell: 24.0, even: (0.9, 0.9, 0.9, 1.0))");
    let explanation = foretold(&desk, "job.ron");
    expect(&explanation, ["matte"], ["mask", "parts", "factor", "keep", "warped", "out"]);
    assert_eq!(judged(&explained(&desk, "explain job.ron"), "reused"), names(ALL), "it did not");
}

#[test]
fn a_deleted_or_overwritten_output_runs_its_sink() {
    let desk = small_job();
    desk.run("run job.ron").expect(0);
    let harmed = |code: &str| {
        let explanation = foretold(&desk, "job.ron");
        expect(&explanation, ["out"], []);
        let why = &pair(&explanation, "out")["why"];
        assert_eq!([&why["code"], &why["node"], &why["at"]], [code, "out", "job.ron:12:15"], "{why}");
        assert!(text(&why["text"]).contains("out/small.png"), "{why}");
    };
    std::fs::remove_file(desk.path("out/small.png")).expect("it was written");
    harmed("output_missing");
    desk.write("out/small.png", "something else");
    harmed("output_changed");
}

#[test]
fn a_missing_plate_is_a_fault_and_the_rest_is_judged() {
    let desk = small_job();
    desk.run("run job.ron").expect(0);
    std::fs::remove_file(desk.path("plate.png")).expect("it was there");
    let ended = desk.run("explain job.ron --format json").expect(3);
    let explanation = parsed(&ended);
    let fault = &explanation["faults"][0];
    let place = [&fault["code"], &fault["node"], &fault["parameter"], &fault["line"], &fault["column"]];
    assert_eq!(place, [&json!("input_unreadable"), &json!("plate"), &json!("path"), &json!(3), &json!(26)]);
    assert_eq!(explanation["faults"].as_array().map(Vec::len), Some(1));
    expect(&explanation, [], ["plate", "grid", "factor", "bend", "keep", "warped", "out"]);
    let ended = desk.run("explain job.ron").says(3, &["error[input_unreadable]", "plate.png", "job.ron:3:26"]);
    assert_eq!(ended.stdout.lines().count(), ALL.len(), "{}", ended.stdout);
}

#[test]
fn reasons_name_what_they_speak_of() {
    let desk = small_job();
    desk.run("run job.ron").expect(0);
    std::fs::remove_file(desk.path("plate.png")).expect("it was there");
    let ended = desk.run("explain job.ron").expect(3);
    assert!(!ended.stdout.contains("``"), "{}", ended.stdout);
}

#[test]
fn a_broken_graph_is_2() {
    let desk = Desk::new();
    desk.graph("bad.ron", r#""a": Chekcer(), "out": Save(image: "a", path: "a.png")"#);
    let ended = desk.run("explain bad.ron").says(2, &["bad.ron:2:6", "Checker"]);
    assert_eq!(ended.stdout, "");
    desk.run("explain none.ron").says(2, &["none.ron does not exist"]);
    let ended = desk.run("explain bad.ron --format json").expect(2);
    let json: Json = serde_json::from_str(&ended.stdout).expect("JSON");
    assert_eq!((&json["nodes"], &json["faults"][0]["line"]), (&serde_json::json!([]), &serde_json::json!(2)));
}

#[test]
fn without_the_journal_only_the_reasons_are_poorer() {
    let desk = small_job();
    desk.run("run job.ron").expect(0);
    let verdicts = |explanation: &Json| -> Vec<[Json; 4]> {
        let nodes = explanation["nodes"].as_array().expect("a list").iter();
        nodes.map(|pair| ["node", "frame", "verdict", "from"].map(|key| pair[key].clone())).collect()
    };
    let (still, late) = (explained(&desk, "explain job.ron"), explained(&desk, LATE));
    std::fs::remove_dir_all(desk.path("cache/v2/journal")).expect("it was written");
    assert_eq!(explained(&desk, "explain job.ron"), still);
    let poorer = explained(&desk, LATE);
    assert_eq!(verdicts(&poorer), verdicts(&late));
    assert_eq!(pair(&late, "out")["why"]["code"], "param");
    assert_eq!(pair(&poorer, "out")["why"]["code"], "first_run");
    foretold(&desk, "job.ron --set bend.angle=75.0");
}

#[test]
fn what_is_to_be_skipped_needs_nothing() {
    let desk = small_job();
    desk.write("out/small.png", "rubbish");
    let explanation = foretold(&desk, "job.ron --existing skip");
    assert_eq!(judged(&explanation, "reused"), names(ALL));
    assert_eq!(pair(&explanation, "out")["from"], "file");
    assert_eq!(pair(&explanation, "warped")["from"], Json::Null);
    std::fs::remove_file(desk.path("out/small.png")).expect("it was there");
    let explanation = foretold(&desk, "job.ron --existing skip");
    assert_eq!(judged(&explanation, "reused"), [].into());
}

#[test]
fn nobody_wrote_what_is_skipped() {
    let desk = small_job();
    desk.write("out/small.png", "rubbish");
    let ended = desk.run("explain job.ron --existing skip").expect(0);
    assert!(!ended.stdout.contains("as it was written"), "{}", ended.stdout);
}

#[test]
fn without_a_cache_nothing_is_known() {
    let desk = small_job();
    desk.run("run job.ron").expect(0);
    let explanation = foretold(&desk, "job.ron --no-cache");
    assert_eq!(judged(&explanation, "runs"), names(["matte", "plate"]));
    assert_eq!(judged(&explanation, "reused"), [].into());
}

/// Every file but the memos, with its content and when it was written.
fn snapshot(desk: &Desk) -> Vec<(PathBuf, Vec<u8>, SystemTime)> {
    let files = files_below(&desk.path("")).into_iter().filter(|file| !file.starts_with(desk.path("cache/v2/files")));
    let stamped = files.map(|file| {
        let modified = file.metadata().and_then(|metadata| metadata.modified()).expect("a file");
        (file.clone(), std::fs::read(&file).expect("a file"), modified)
    });
    let mut stamped: Vec<_> = stamped.collect();
    stamped.sort();
    stamped
}

#[test]
fn it_runs_and_writes_nothing() {
    let desk = small_job();
    let cold = snapshot(&desk);
    desk.run("explain job.ron").expect(0);
    assert_eq!(snapshot(&desk), cold);
    desk.run("run job.ron --store all").expect(0);
    let warm = snapshot(&desk);
    for words in ["", " --set bend.angle=75.0", " --existing verify", " --existing skip", " --no-cache"] {
        desk.run(&format!("explain job.ron{words}")).expect(0);
        assert_eq!(snapshot(&desk), warm, "{words}");
    }
    std::fs::remove_dir_all(desk.path("out")).expect("it was written");
    desk.run("explain job.ron").expect(0);
    assert!(!desk.path("out").exists());
}

#[test]
fn frames_are_judged_one_by_one() {
    let desk = Desk::new();
    desk.shot(
        "shot.ron",
        "1-4",
        r#""card": Checker(size: (8, 8), cell: Keys([(1, 1.0), (3, 4.0)])),
        "out": Save(image: "card", path: "out/card.#.png")"#,
    );
    let explanation = explained(&desk, "explain shot.ron");
    assert_eq!(explanation["frames"], json!([1, 2, 3, 4]));
    // Keys hold after the last: frames 3 and 4 are the same card, and one of them computes for both.
    assert_eq!(judged(&explanation, "runs"), names(["card@1", "card@2"]));
    desk.run("run shot.ron --frames 1-2").expect(0);
    let explanation = foretold(&desk, "shot.ron --frames 1-3");
    assert_eq!(judged(&explanation, "runs"), names(["card@3"]));
    assert_eq!(judged(&explanation, "may_run"), names(["out@3"]));
    let explanation = foretold(&desk, "shot.ron");
    assert_eq!(judged(&explanation, "runs"), names(["out@4"]), "its file has another name");
    assert_eq!(judged(&foretold(&desk, "shot.ron"), "reused").len(), 8);
}
