//! Several processes on one cache, killed or not; `examples/disk_kills.rs` and `examples/disk_soak.rs` go on for longer.
//! Each test starts itself again for the processes it needs.

use std::process::Command;

use warploom_tests::disk_work::{Findings, LARGEST, Work, kill_writers, perform_if_ordered, soak};

fn again(test: &str) -> Command {
    let mut command = Command::new(std::env::current_exe().expect("this program"));
    command.args([&format!("disk_work::{test}"), "--exact", "--nocapture"]);
    command
}

fn kill(test: &str, is_torn: bool) -> Findings {
    let folder = tempfile::tempdir().expect("a folder");
    let findings = kill_writers(&Work::to_kill(folder.path().join("cache"), is_torn), 60, 2, &|| again(test));
    assert!(findings.from_disk > 0 && findings.evicted > 0, "{findings:?}");
    assert_eq!((findings.wrong, findings.complaints), (0, 0), "{findings:?}");
    findings
}

#[test]
fn killed_writers_leave_only_whole_entries() {
    if !perform_if_ordered() {
        assert_eq!(kill("killed_writers_leave_only_whole_entries", false).damaged, 0);
    }
}

#[test]
fn entries_that_are_torn_are_seen() {
    if !perform_if_ordered() {
        // Whether a kill tears an entry is chance.
        let is_seen = |_| kill("entries_that_are_torn_are_seen", true).damaged > 0;
        assert!((0..5).any(is_seen));
    }
}

#[test]
fn two_processes_share_a_cache_that_is_too_small() {
    if perform_if_ordered() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let work = Work::to_soak(folder.path().join("cache"), 3.0);
    let (findings, largest) = soak(&work, &|| again("two_processes_share_a_cache_that_is_too_small"));
    assert!(findings.from_disk > 0 && findings.evicted > 0, "{findings:?}");
    assert_eq!((findings.wrong, findings.damaged, findings.complaints), (0, 0, 0), "{findings:?}");
    assert!(largest <= work.cache_size + 2 * LARGEST, "{largest} bytes of {}", work.cache_size);
}
