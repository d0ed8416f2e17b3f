//! The cache folder: what is in it changes nothing but time.

use std::path::{Path, PathBuf};
use std::process::Stdio;

use crate::desk::{Desk, Ended, executed, pairs, small_job};

/// All files in a folder and those below it.
pub fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() { files.extend(files_below(&path)) } else { files.push(path) }
    }
    files
}

/// Fills a cache, lets `harm` loose on it and runs again with another angle.
fn survives(harm: impl Fn(&Path)) {
    let desk = small_job();
    desk.run("run job.ron --no-cache --set bend.angle=75.0").expect(0);
    let expected = desk.read("out/small.png");
    desk.run("run job.ron --store all").expect(0);
    let files = files_below(&desk.path("cache"));
    assert!(files.len() > 10, "records and values are kept: {files:?}");
    files.iter().for_each(|file| harm(file));
    let ended = desk.run("run job.ron --store all --set bend.angle=75.0").expect(0);
    assert!(!ended.stderr.contains("panicked"), "{}", ended.stderr);
    assert_eq!(desk.read("out/small.png"), expected);
    executed(&desk.report("run job.ron --store all --set bend.angle=75.0"), []);
}

#[test]
fn truncated_entries_are_misses() {
    survives(|file| {
        let bytes = std::fs::read(file).expect("a file");
        std::fs::write(file, &bytes[..bytes.len() / 2]).expect("a file");
    });
}

#[test]
fn garbled_entries_are_misses() {
    survives(|file| {
        let mut bytes = std::fs::read(file).expect("a file");
        let middle = bytes.len() / 2;
        bytes[middle] ^= 0x20;
        std::fs::write(file, bytes).expect("a file");
    });
}

#[test]
fn emptied_entries_are_misses() {
    survives(|file| std::fs::write(file, "").expect("a file"));
}

#[test]
fn removed_entries_are_misses() {
    survives(|file| std::fs::remove_file(file).expect("a file"));
}

#[test]
fn a_cache_that_cannot_be_written_is_a_warning() {
    let desk = small_job();
    desk.write("file", "no folder");
    let ended = desk.run("run job.ron --cache file/cache").says(0, &["warning:"]);
    assert_eq!(ended.stderr.matches("warning:").count(), 1, "{}", ended.stderr);
    assert!(desk.path("out/small.png").exists());
}

#[test]
fn the_flag_comes_before_the_variables() {
    let cache = |desk: &Desk, name: &str| desk.path(name).join("v2").exists();
    let desk = small_job();
    desk.run("run job.ron --cache flag").expect(0);
    assert!(cache(&desk, "flag") && !cache(&desk, "cache"));
    let without = |name: &str| {
        let mut command = desk.command(["run", "job.ron"]);
        command.env_remove("WARPLOOM_CACHE").env_remove(name);
        assert!(command.output().expect("the binary starts").status.success());
    };
    without("HOME");
    assert!(cache(&desk, "xdg/warploom") && !cache(&desk, "home/.cache/warploom"));
    without("XDG_CACHE_HOME");
    assert!(cache(&desk, "home/.cache/warploom") && !cache(&desk, "cache"));
}

#[test]
fn two_processes_share_a_cache() {
    let desk = small_job();
    let spawn = |name: &str| {
        let path = format!("out.path=\"{name}\"");
        let mut command = desk.command(["run", "job.ron", "--store", "all", "--set", &path]);
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the binary starts")
    };
    let children = ["a.png", "b.png", "a.png"].map(spawn);
    children.into_iter().for_each(|mut child| assert!(child.wait().expect("it ends").success()));
    assert_eq!(desk.read("a.png"), desk.read("b.png"));
    let third = desk.report("run job.ron --set out.path=\"c.png\"");
    executed(&third, ["out"]);
    assert_eq!(pairs(&third, "recomputed"), [].into());
}

/// Cards 1 to 12, of a quarter of a megabyte each.
fn cards() -> Desk {
    let desk = Desk::new();
    desk.shot(
        "cards.ron",
        "1-12",
        r#""card": Checker(size: (128, 128), cell: Keys([(1, 1.0), (12, 40.0)])),
        "out": Save(image: "card", path: "out/card.##.png")"#,
    );
    desk
}

const MIB: u64 = 1 << 20;

/// Bytes of the cache folder.
fn held(desk: &Desk) -> u64 {
    files_below(&desk.path("cache")).iter().map(|file| file.metadata().expect("a file").len()).sum()
}

/// How many entries of a table, or of all that is unfinished, `cache stat` counts.
fn counted(ended: &Ended, table: &str) -> u64 {
    let mut lines = ended.stdout.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
    let line = lines.find(|words| words[0] == table).unwrap_or_else(|| panic!("no {table}: {ended:?}"));
    line[1].parse().unwrap_or_else(|error| panic!("{error}: {line:?}"))
}

fn pictures(desk: &Desk) -> Vec<Vec<u8>> {
    desk.files("out").iter().map(|name| desk.read(&format!("out/{name}"))).collect()
}

fn damage(file: &Path) {
    let mut bytes = std::fs::read(file).expect("a file");
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(file, bytes).expect("a file");
}

#[test]
fn what_it_holds_is_told() {
    let desk = small_job();
    let empty = desk.run("cache stat").expect(0);
    assert_eq!(["records", "values", "files", "journal", "unfinished"].map(|table| counted(&empty, table)), [0; 5]);
    assert!(!desk.path("cache").exists(), "looking makes no folder");
    desk.run("run job.ron --store all").expect(0);
    let full = desk.run("cache stat --cache-size 8M").expect(0);
    assert!(full.stdout.contains(&desk.path("cache").display().to_string()), "{}", full.stdout);
    assert!(full.stdout.contains("of at most 8.0 M"), "{}", full.stdout);
    assert_eq!(["records", "journal", "unfinished"].map(|table| counted(&full, table)), [10, 1, 0]);
    let values = files_below(&desk.path("cache/v2/values")).len();
    assert_eq!((counted(&full, "values"), full.stderr.as_str()), (values as u64, ""));
    let elsewhere = desk.run("cache stat --cache other").expect(0);
    assert_eq!(counted(&elsewhere, "records"), 0);
}

#[test]
fn it_is_cut_to_a_size() {
    let desk = cards();
    desk.run("run cards.ron --store all").expect(0);
    assert!(held(&desk) > 2 * MIB, "{}", held(&desk));
    let (before, first) = (held(&desk), pictures(&desk));
    desk.run("cache gc").expect(0);
    assert_eq!(held(&desk), before, "it fits");
    let ended = desk.run("cache gc --cache-size 1M").expect(0);
    assert!(ended.stdout.contains("removed") && ended.stdout.contains("of at most 1.0 M"), "{}", ended.stdout);
    assert!(held(&desk) <= MIB, "{}", held(&desk));
    executed(&desk.report("run cards.ron"), []);
    desk.run("run cards.ron --no-cache").expect(0);
    assert_eq!(pictures(&desk), first);
}

#[test]
fn damaged_entries_are_found_and_removed() {
    let desk = small_job();
    desk.run("run job.ron --store all").expect(0);
    desk.run("cache verify").expect(0);
    let tables = ["records", "values", "journal"];
    let harmed = tables.map(|table| files_below(&desk.path("cache/v2").join(table)).swap_remove(0));
    harmed.iter().for_each(|file| damage(file));
    let ended = desk.run("cache verify").expect(7);
    assert!(ended.stdout.starts_with("3 of "), "{}", ended.stdout);
    assert!(harmed.iter().all(|file| !file.exists()));
    let ended = desk.run("cache verify").expect(0);
    assert!(ended.stdout.starts_with("0 of "), "{}", ended.stdout);
}

#[test]
fn it_is_emptied() {
    let desk = small_job();
    desk.run("run job.ron --store all").expect(0);
    let ended = desk.run("cache clear").expect(0);
    assert!(ended.stdout.starts_with("removed "), "{}", ended.stdout);
    assert_eq!(files_below(&desk.path("cache")).len(), 0);
    desk.run("cache clear").expect(0);
    desk.run("cache clear --cache nowhere").expect(0);
    assert_eq!(pairs(&desk.report("run job.ron"), "executed").len(), 10);
}

#[test]
fn a_run_keeps_to_the_size() {
    let desk = cards();
    desk.run("run cards.ron --no-cache").expect(0);
    let expected = pictures(&desk);
    desk.run("run cards.ron --store all --cache whole").expect(0);
    let entries = files_below(&desk.path("whole"));
    let largest = entries.iter().map(|file| file.metadata().expect("a file").len()).max().expect("entries");
    for frames in ["1-6", "7-12", "1-12"] {
        std::fs::remove_dir_all(desk.path("out")).expect("it was written");
        let report = desk.report(&format!("run cards.ron --store all --cache-size 1M --frames {frames}"));
        assert_eq!(report["cache"]["damaged"], 0);
        assert!(held(&desk) <= MIB + largest, "{} after {frames}", held(&desk));
    }
    assert_eq!(pictures(&desk), expected);
}

#[test]
fn sizes_are_checked() {
    let desk = small_job();
    for size in ["3", "1K", "-1G", "8X", "G", "inf"] {
        for command in ["run job.ron", "explain job.ron", "cache gc", "cache stat"] {
            desk.run(&format!("{command} --cache-size={size}")).says(2, &["--cache-size", size]);
        }
    }
    desk.run("cache").expect(2);
    desk.run("cache prune").expect(2);
    assert!(!desk.path("out").exists() && !desk.path("cache").exists(), "nothing ran");
}

#[test]
fn damage_is_one_warning_and_counted() {
    let desk = small_job();
    desk.run("run job.ron").expect(0);
    let expected = desk.read("out/small.png");
    let records = files_below(&desk.path("cache/v2/records"));
    for count in [1, 3] {
        records[..count].iter().for_each(|file| damage(file));
        let ended = desk.run("run job.ron --report r.json").says(0, &["damaged"]);
        assert_eq!(ended.stderr.matches("warning:").count(), 1, "{}", ended.stderr);
        assert_eq!(desk.read_json("r.json")["cache"]["damaged"], count);
        assert_eq!(desk.read("out/small.png"), expected);
        let again = desk.run("run job.ron --report r.json").expect(0);
        assert!(!again.stderr.contains("warning:"), "{}", again.stderr);
        assert_eq!(desk.read_json("r.json")["cache"]["damaged"], 0);
    }
}

/// The name that a run gave a temporary file before it was killed.
#[cfg(target_os = "linux")]
fn orphan() -> String {
    use std::time::{Duration, Instant};
    let desk = cards();
    let mut command = desk.command(["run", "cards.ron", "--frames", "1-100000", "--no-cache"]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the binary starts");
    let (start, mut name) = (Instant::now(), None);
    while name.is_none() && start.elapsed() < Duration::from_secs(60) {
        name = desk.files("out").into_iter().find(|name| name.starts_with(".warploom-"));
    }
    child.kill().expect("it runs");
    child.wait().expect("it ends");
    let name = name.expect("files are written under other names first");
    let process = format!("-{}-", child.id());
    assert!(name.ends_with(".tmp") && name.contains(&process), "{name} is not of process {process}");
    name
}

#[test]
#[cfg(target_os = "linux")]
fn what_a_killed_process_left_is_swept() {
    let orphan = orphan();
    let owner: Vec<&str> = orphan.splitn(4, '-').collect();
    let living = format!("{}-{}-{}-{}", owner[0], owner[1], std::process::id(), owner[3]);
    let foreign = format!("{}-{}-{}-{}", owner[0], "1", owner[2], owner[3]);
    let left = [&orphan, &living, &foreign];

    let desk = small_job();
    desk.run("run job.ron").expect(0);
    left.iter().for_each(|name| _ = desk.write(&format!("out/{name}"), "part of a picture"));
    desk.run("run job.ron --set bend.angle=75.0").expect(0);
    // Behind the run, which collects if it has a value that is dear enough to be stored.
    left.iter().for_each(|name| _ = desk.write(&format!("cache/v2/values/ab/{name}"), "part of a value"));
    let mut kept = vec![living, foreign];
    kept.sort();
    let unfinished = |folder: &str| -> Vec<String> {
        desk.files(folder).into_iter().filter(|name| name.starts_with(".warploom-")).collect()
    };
    assert_eq!(unfinished("out"), kept, "others may be at work on theirs");

    assert_eq!(counted(&desk.run("cache stat").expect(0), "unfinished"), 3);
    desk.run("cache gc").expect(0);
    assert_eq!(unfinished("cache/v2/values/ab"), kept);
    assert_eq!(counted(&desk.run("cache stat").expect(0), "unfinished"), 2);
    executed(&desk.report("run job.ron --set bend.angle=75.0"), []);
}
