//! A run that is stopped.

use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use crate::desk::{Desk, Ended, pairs};

/// Far more frames than are waited for.
fn long_shot() -> Desk {
    let desk = Desk::new();
    desk.shot(
        "job.ron",
        "1-100000",
        r#""card": Checker(size: (128, 128), cell: 8.0), "grid": Lattice(domain: "card", cell: 8.0),
        "bend": Arc(grid: "grid", angle: Keys([(1, 1.0), (100000, 90.0)])), "warped": Resample(image: "card", warp: "bend"),
        "out": Save(image: "warped", path: "out/bend.#.png")"#,
    );
    desk
}

fn start(desk: &Desk) -> Child {
    let mut command = desk.command(["run", "job.ron", "--report", "report.json"]);
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the binary starts")
}

fn wait_for_frames(desk: &Desk, count: usize) {
    let start = Instant::now();
    while desk.files("out").len() < count {
        assert!(start.elapsed() < Duration::from_secs(60), "no frames come");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn signal(child: &Child, name: &str) {
    let line = format!("kill -{name} {}", child.id());
    assert!(std::process::Command::new("sh").args(["-c", &line]).status().expect("a shell").success());
}

fn stops_well(name: &str) {
    let desk = long_shot();
    let child = start(&desk);
    wait_for_frames(&desk, 3);
    signal(&child, name);
    let ended = Ended::from(child.wait_with_output().expect("it ends")).says(75, &["stopping", "stopped:"]);
    assert!(!ended.stderr.contains("error["), "{}", ended.stderr);

    let files = desk.files("out");
    assert!(files.iter().all(|file| file.ends_with(".png") && !file.starts_with('.')), "{files:?}");
    let frame = |file: &String| file.split('.').nth(1).and_then(|n| n.parse::<i64>().ok()).expect("a frame number");
    let done: Vec<i64> = files.iter().map(frame).collect();
    let report = desk.read_json("report.json");
    let written: Vec<i64> =
        report["outputs"].as_array().expect("a list").iter().filter_map(|output| output["frame"].as_i64()).collect();
    assert_eq!(written.len(), done.len(), "the report knows the frames that are there");
    assert_eq!(report["faults"], serde_json::json!([]));

    let last = done.iter().max().expect("some frames") + 2;
    let rest = desk.report(&format!("run job.ron --frames 1-{last}"));
    let missing = (1..=last).filter(|frame| !done.contains(frame)).map(|frame| format!("out@{frame}"));
    let saved = pairs(&rest, "executed").into_iter().filter(|pair| pair.starts_with("out@")).collect::<Vec<_>>();
    let mut missing: Vec<String> = missing.collect();
    missing.sort();
    assert_eq!(saved, missing, "a second run does what is missing");
}

#[test]
fn an_interrupt_keeps_finished_frames() {
    stops_well("INT");
}

#[test]
fn a_termination_keeps_finished_frames() {
    stops_well("TERM");
}

#[test]
fn a_limit_on_the_size_of_files_is_told() {
    let desk = Desk::new();
    desk.graph("job.ron", r#""card": Checker(size: (128, 128)), "out": Save(image: "card", path: "out/card.exr")"#);
    let line = r#"ulimit -f 4; exec "$0" run job.ron --no-cache"#;
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", line, env!("CARGO_BIN_EXE_warploom")]).current_dir(desk.path(""));
    let ended = Ended::from(shell.output().expect("a shell"));
    ended.says(6, &["error[output_unwritable]", "card.exr: file too large", "help: raise the limit", "ulimit -f"]);
    assert!(desk.files("out").is_empty(), "{:?}", desk.files("out"));
}
