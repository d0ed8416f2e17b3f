//! The cache folder: what is in it changes nothing but time.

use std::path::{Path, PathBuf};
use std::process::Stdio;

use crate::desk::{Desk, executed, pairs, small_job};

fn files_below(folder: &Path) -> Vec<PathBuf> {
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
