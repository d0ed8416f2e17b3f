//! `--existing`: what becomes of outputs that are there.

use std::path::Path;
use std::time::{Duration, SystemTime};

use serde_json::{Value as Json, json};

use crate::desk::{Desk, executed, pair, pairs, small_job, text};

/// Cards 1 to 5, one per frame.
fn cards() -> Desk {
    let desk = Desk::new();
    desk.shot(
        "cards.ron",
        "1-5",
        r#""card": Checker(size: (8, 8), cell: Keys([(1, 1.0), (5, 5.0)])),
        "out": Save(image: "card", path: "out/card.#.png")"#,
    );
    desk
}

/// When a file was written, and its number where files have one.
fn stamp(path: &Path) -> (SystemTime, u64) {
    let metadata = path.metadata().expect("a file");
    #[cfg(unix)]
    let number = std::os::unix::fs::MetadataExt::ino(&metadata);
    #[cfg(not(unix))]
    let number = 0;
    (metadata.modified().expect("a time"), number)
}

/// Makes a file look old, so that writing it again shows.
fn age(path: &Path) {
    let file = std::fs::File::options().append(true).open(path).expect("a file");
    file.set_modified(SystemTime::now() - Duration::from_secs(3600)).expect("times can be set");
}

fn outputs(report: &Json) -> Vec<Json> {
    report["outputs"].as_array().expect("a list").clone()
}

#[test]
fn skip_lets_any_file_stand() {
    let desk = small_job();
    let path = desk.write("out/small.png", "rubbish");
    let ended = desk.run("run job.ron --existing skip --report r.json").says(0, &["0 executed, 1 reused"]);
    assert_eq!(ended.stdout, format!("{}\n", path.display()));
    assert_eq!(desk.read("out/small.png"), b"rubbish");
    let report = desk.read_json("r.json");
    executed(&report, []);
    assert_eq!(pairs(&report, "reused"), ["out".to_owned()].into());
    assert_eq!(pair(&report, "out")["from"], "file");
    assert_eq!(pairs(&report, "skipped").len(), 9, "nothing is asked for");
    assert_eq!(outputs(&report), [json!({ "node": "out", "frame": null, "path": path, "bytes": 7, "blake3": null })]);
    std::fs::remove_file(desk.path("plate.png")).expect("it was there");
    desk.run("run job.ron --existing skip").expect(0);
}

#[test]
fn skip_writes_what_is_missing() {
    let desk = cards();
    let rubbish = desk.write("out/card.2.png", "rubbish");
    desk.write("out/card.4.png", "");
    let ended = desk.run("run cards.ron --existing skip --report r.json").expect(0);
    let mut told: Vec<&str> = ended.stdout.lines().collect();
    told.sort_unstable();
    let every: Vec<String> = (1..=5).map(|f| desk.path(&format!("out/card.{f}.png")).display().to_string()).collect();
    assert_eq!(told, every);
    let report = desk.read_json("r.json");
    executed(&report, ["card@1", "out@1", "card@3", "out@3", "card@5", "out@5"]);
    assert_eq!(pairs(&report, "reused"), ["out@2".to_owned(), "out@4".to_owned()].into());
    assert_eq!((std::fs::read(rubbish).expect("a file"), desk.read("out/card.4.png")), (b"rubbish".into(), vec![]));
    for output in outputs(&report) {
        let stood = [json!(2), json!(4)].contains(&output["frame"]);
        assert_eq!(output["blake3"].is_null(), stood, "{output}");
        assert_eq!(output["bytes"], desk.read(&format!("out/card.{}.png", output["frame"])).len(), "{output}");
    }
    desk.run("run cards.ron").expect(0);
    assert_ne!(desk.read("out/card.2.png"), b"rubbish", "overwriting is the default");
}

#[test]
fn verify_passes_what_is_equal_and_writes_nothing() {
    let desk = cards();
    desk.run("run cards.ron").expect(0);
    let paths: Vec<_> = (1..=5).map(|frame| desk.path(&format!("out/card.{frame}.png"))).collect();
    paths.iter().for_each(|path| age(path));
    let stamps = || paths.iter().map(|path| stamp(path)).collect::<Vec<_>>();
    let before = stamps();
    // With what is known, and computed anew.
    for words in ["", " --no-cache", " --cache other"] {
        let ended = desk.run(&format!("run cards.ron --existing verify{words}")).expect(0);
        assert_eq!(ended.stdout.lines().count(), 5, "{}", ended.stdout);
        assert_eq!(stamps(), before, "{words}");
    }
    assert_eq!(desk.files("out").len(), 5);
}

#[test]
fn verify_finds_a_changed_file() {
    let desk = cards();
    desk.run("run cards.ron").expect(0);
    let path = desk.path("out/card.3.png");
    std::fs::copy(desk.path("out/card.4.png"), &path).expect("a copy");
    age(&path);
    let before = stamp(&path);
    for words in ["", " --no-cache"] {
        let ended = desk.run(&format!("run cards.ron --existing verify --report r.json{words}"));
        ended.says(7, &["error[output_differs]", "frame 3", &path.display().to_string()]);
        assert_eq!(stamp(&path), before, "{words}");
        let report = desk.read_json("r.json");
        assert_eq!(report["faults"].as_array().map(Vec::len), Some(1));
        let fault = &report["faults"][0];
        let place = [&fault["code"], &fault["node"], &fault["frame"]];
        assert_eq!(place, [&json!("output_differs"), &json!("out"), &json!(3)]);
        assert!(text(&fault["message"]).contains(&path.display().to_string()), "{fault}");
        assert_eq!(pairs(&report, "failed"), ["out@3".to_owned()].into());
        assert!(outputs(&report).iter().all(|output| output["frame"] != 3), "it is none of its outputs");
    }
}

#[test]
fn verify_finds_a_missing_file_and_goes_on() {
    let desk = cards();
    desk.run("run cards.ron").expect(0);
    std::fs::remove_file(desk.path("out/card.2.png")).expect("it was written");
    desk.write("out/card.4.png", "rubbish");
    let missing = desk.path("out/card.2.png").display().to_string();
    desk.run("run cards.ron --existing verify --frames 2").says(7, &["error[output_differs]", "frame 2", &missing]);
    let ended = desk.run("run cards.ron --existing verify --keep-going --report r.json");
    ended.says(1, &["frame 2", "frame 4", "does not exist", "is not what this graph writes there"]);
    let report = desk.read_json("r.json");
    assert_eq!(pairs(&report, "failed"), ["out@2".to_owned(), "out@4".to_owned()].into());
    let verified: Vec<&Json> = report["outputs"].as_array().expect("a list").iter().map(|o| &o["frame"]).collect();
    assert_eq!(verified, [&json!(1), &json!(3), &json!(5)]);
    assert!(!desk.path("out/card.2.png").exists());
    assert_eq!(desk.read("out/card.4.png"), b"rubbish");
}

#[test]
fn verify_of_what_never_ran_makes_no_folder() {
    let desk = cards();
    desk.run("run cards.ron --existing verify --keep-going").says(7, &["output_differs"]);
    assert!(!desk.path("out").exists());
    desk.run("run cards.ron").expect(0);
    assert_eq!(desk.files("out").len(), 5, "what was only verified is not taken for written");
}

#[test]
fn overwrite_restores_changed_files() {
    let desk = cards();
    desk.run("run cards.ron").expect(0);
    let whole: Vec<Vec<u8>> = (1..=5).map(|frame| desk.read(&format!("out/card.{frame}.png"))).collect();
    desk.write("out/card.2.png", "rubbish");
    desk.write("out/card.5.png", &whole[0]);
    let untouched = stamp(&desk.path("out/card.3.png"));
    let report = desk.report("run cards.ron --existing overwrite");
    executed(&report, ["out@2", "out@5"]);
    let restored: Vec<Vec<u8>> = (1..=5).map(|frame| desk.read(&format!("out/card.{frame}.png"))).collect();
    assert_eq!(restored, whole);
    assert_eq!(stamp(&desk.path("out/card.3.png")), untouched);
    desk.run("run cards.ron --existing replace").says(2, &["--existing"]);
}
