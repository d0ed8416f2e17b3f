//! What is said while a run goes on, and to whom.

use std::io::{BufRead, BufReader, Read};
use std::process::Stdio;

use serde_json::Value as Json;

use crate::desk::{Desk, Ended, SMALL_JOB, executed, keys, small_job};

/// A bend over four frames.
fn shot() -> Desk {
    let desk = Desk::new();
    desk.shot(
        "job.ron",
        "1-4",
        r#""card": Checker(size: (24, 24), cell: 4.0), "grid": Lattice(domain: "card", cell: 8.0),
        "bend": Arc(grid: "grid", angle: Keys([(1, 10.0), (4, 40.0)])), "warped": Resample(image: "card", warp: "bend"),
        "out": Save(image: "warped", path: "out/bend.####.png")"#,
    );
    desk
}

fn run(progress: &str) -> (Desk, Ended) {
    let desk = shot();
    let ended = desk.run(&format!("run job.ron --no-cache --progress {progress}")).expect(0);
    (desk, ended)
}

#[test]
fn a_pipe_gets_plain_lines() {
    for progress in ["auto", "human", "plain", "none"] {
        let (desk, ended) = run(progress);
        let controls = |text: &str| text.chars().any(|c| c.is_control() && c != '\n');
        assert!(!controls(&ended.stderr) && !controls(&ended.stdout), "{progress}: {ended:?}");
        let mut written: Vec<&str> = ended.stdout.lines().collect();
        written.sort_unstable();
        let paths: Vec<String> =
            (1..=4).map(|f| desk.path(&format!("out/bend.{f:04}.png")).display().to_string()).collect();
        assert_eq!(written, paths, "{progress}");
    }
}

#[test]
fn plain_says_each_frame_and_a_summary() {
    let (_desk, ended) = run("plain");
    (1..=4).for_each(|frame| assert!(ended.stderr.contains(&format!("frame {frame} done (")), "{}", ended.stderr));
    assert!(ended.stderr.contains("14 executed, 0 reused"), "{}", ended.stderr);
}

#[test]
fn none_says_nothing() {
    assert_eq!(run("none").1.stderr, "");
    let desk = small_job();
    std::fs::remove_file(desk.path("plate.png")).expect("it is there");
    desk.run("run job.ron --progress none").says(3, &["plate.png"]);
}

/// The numbers of the lines that begin so.
fn percents(stdout: &str, before: &str, behind: &str) -> Vec<u32> {
    let number = |line: &str| line.strip_prefix(before)?.strip_suffix(behind)?.parse().ok();
    stdout.lines().filter_map(number).collect()
}

#[test]
fn farms_see_percents_from_0_to_100() {
    for (progress, before, behind) in [("percent", "Progress: ", "%"), ("openjd", "openjd_progress: ", "")] {
        let desk = shot();
        for line in ["--no-cache", "", "", "--existing skip"] {
            let ended = desk.run(&format!("run job.ron --progress {progress} {line}")).expect(0);
            let percents = percents(&ended.stdout, before, behind);
            assert!(percents.is_sorted_by(|one, next| one < next), "{percents:?}");
            assert_eq!((percents.first(), percents.last()), (Some(&0), Some(&100)), "{line} {ended:?}");
            assert_eq!(ended.stderr, "");
            let strict = ["Error", "error:", "Exception", "Warning", "warning:"];
            assert!(!strict.iter().any(|word| ended.stdout.contains(word)), "{ended:?}");
        }
    }
    let (desk, ended) = run("percent");
    let paths = ended.stdout.lines().filter(|line| !line.starts_with("Progress: "));
    assert!(paths.map(std::path::Path::new).all(|path| path.starts_with(desk.path("out"))), "{ended:?}");
}

#[test]
fn lines_come_while_the_run_goes_on() {
    for (progress, from_stdout, first) in [
        ("plain", false, "frame "),
        ("percent", true, "Progress: 0%"),
        ("openjd", true, "openjd_progress: 0"),
        ("jsonl", true, "{\"event\":\"begun\""),
    ] {
        let desk = Desk::new();
        desk.shot(
            "job.ron",
            "1-100000",
            r#""card": Checker(size: (64, 64), cell: 8.0), "grid": Lattice(domain: "card", cell: 8.0),
            "bend": Arc(grid: "grid", angle: Keys([(1, 1.0), (100000, 90.0)])),
            "warped": Resample(image: "card", warp: "bend"), "out": Save(image: "warped", path: "out/bend.#.png")"#,
        );
        let mut command = desk.command(["run", "job.ron", "--no-cache", "--progress", progress]);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the binary starts");
        let (out, err) = (child.stdout.take().expect("a pipe"), child.stderr.take().expect("a pipe"));
        let pipe: Box<dyn Read> = if from_stdout { Box::new(out) } else { Box::new(err) };
        let line = BufReader::new(pipe).lines().next().expect("a line").expect("text");
        child.kill().expect("it can be stopped");
        let status = child.wait().expect("it ends");
        assert!(!status.success(), "{progress}: the first line came when all was done");
        assert!(line.starts_with(first), "{progress}: {line}");
    }
}

#[test]
fn jsonl_is_an_object_per_line() {
    let (_desk, ended) = run("jsonl");
    assert_eq!(ended.stderr, "");
    let events: Vec<Json> =
        ended.stdout.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}"))).collect();
    let count = |name: &str| events.iter().filter(|event| event["event"] == name).count();
    assert_eq!((count("begun"), count("output"), count("frame_done"), count("fault")), (1, 4, 4, 0));
    assert_eq!((count("started"), count("finished")), (14, 14));
    assert_eq!(keys(&events[0]), ["event", "frames", "pairs"]);
    assert_eq!((&events[0]["frames"], &events[0]["pairs"]), (&4.into(), &14.into()));
}

#[test]
fn jsonl_tells_faults() {
    let desk = small_job();
    std::fs::remove_file(desk.path("plate.png")).expect("it is there");
    let ended = desk.run("run job.ron --progress jsonl").expect(3);
    let events: Vec<Json> = ended.stdout.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let fault = &events.iter().find(|event| event["event"] == "fault").expect("it is told")["fault"];
    assert_eq!((&fault["code"], &fault["node"]), (&"input_unreadable".into(), &"plate".into()));
}

#[test]
fn openjd_lines() {
    let (_desk, ended) = run("openjd");
    let lines: Vec<&str> = ended.stdout.lines().collect();
    assert_eq!(lines[0], "openjd_progress: 0");
    assert!(lines.contains(&"openjd_status: warped (frame 3)") && lines.contains(&"openjd_status: card"), "{lines:?}");
    let desk = small_job();
    std::fs::remove_file(desk.path("plate.png")).expect("it is there");
    let ended = desk.run("run job.ron --progress openjd").says(3, &["error[input_unreadable]", "job.ron:"]);
    assert!(
        ended.stdout.lines().any(|line| line.starts_with("openjd_fail: ") && line.contains("plate.png")),
        "{ended:?}"
    );
}

#[test]
fn openjd_lines_stay_one_line() {
    let desk = Desk::new();
    let nodes = r#""plate": Load(path: "plate.png"), "out": Save(image: "plate", path: "out.png")"#;
    desk.graph("two\nlines/job.ron", nodes);
    let ended: Ended =
        desk.command(["run", "two\nlines/job.ron", "--progress", "openjd"]).output().expect("it runs").into();
    let ended = ended.expect(3);
    assert!(ended.stdout.lines().all(|line| line.starts_with("openjd_")), "{ended:?}");
    assert!(ended.stdout.contains("lines/plate.png"), "{ended:?}");
}

#[test]
fn a_closed_pipe_is_a_quiet_end() {
    let desk = small_job();
    for line in [
        "run job.ron",
        "run job.ron --progress jsonl",
        "run job.ron --progress openjd",
        "check job.ron --format json",
        "nodes",
        "nodes --format json",
        "graph job.ron --format dot",
        "completions bash",
        "man",
        "--help",
        "--version",
    ] {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let output = desk.command(line.split_whitespace()).stdout(writer).output().expect("the binary starts");
        let ended = Ended::from(output).expect(0);
        assert!(!ended.stderr.contains("panic"), "{line}: {}", ended.stderr);
    }
    executed(&desk.report("run job.ron"), []);
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let mut command = desk.command(["run", "job.ron", "--no-cache"]);
    let status = command.stdout(std::process::Stdio::null()).stderr(writer).status().expect("the binary starts");
    assert!(status.success());
}

/// An exact feature that touches the border, along a bend over three frames.
fn doubtful() -> Desk {
    let desk = small_job();
    let nodes = SMALL_JOB.replace(r#"features: "parts""#, r#"features: "parts", exact: Similarity"#);
    let nodes = nodes.replace("angle: 60.0", "angle: Keys([(1, 10.0), (3, 30.0)])").replace("small.png", "small.#.png");
    desk.shot("job.ron", "1-3", &nodes);
    desk
}

#[test]
fn a_warning_is_shown_once_per_node_and_kept_with_the_result() {
    let desk = doubtful();
    for progress in ["auto", "plain", "human", "percent", "openjd"] {
        let ended = desk.run(&format!("run job.ron --progress {progress}")).expect(0);
        let shown = ended.stderr.matches("warning[doubtful]").count();
        assert_eq!((shown, ended.stderr.matches("exact features keep to the border").count()), (1, 1), "{ended:?}");
        assert!(ended.stderr.contains("job.ron:10:"), "{}", ended.stderr);
        assert!(ended.stderr.contains("2 warnings more of the same nodes at other frames"), "{}", ended.stderr);
    }
    assert_eq!(desk.run("run job.ron --progress none").expect(0).stderr, "");
    let report = desk.report("run job.ron");
    let warnings = report["warnings"].as_array().expect("a list");
    let told: Vec<_> = warnings.iter().map(|told| (&told["node"], &told["code"], &told["frame"])).collect();
    let of = |frame: u64| (Json::from("keep"), Json::from("doubtful"), Json::from(frame));
    let expected = [of(1), of(2), of(3)];
    assert_eq!(told, expected.each_ref().map(|(node, code, frame)| (node, code, frame)));
}

#[test]
fn jsonl_tells_all_warnings() {
    let ended = doubtful().run("run job.ron --progress jsonl").expect(0);
    let told = ended.stdout.lines().filter(|line| line.contains(r#""event":"warning""#));
    assert_eq!(told.count(), 3, "{ended:?}");
}
