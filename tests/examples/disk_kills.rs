//! Kills processes that write to one cache, and looks at what they leave: `disk_kills [KILLS] [WRITERS] [--torn]`.
//!
//! With `--torn` files get their names before they are whole; then damage must be seen, or this harness sees nothing.

use std::process::{Command, ExitCode};
use std::sync::Arc;
use std::time::Instant;

use warploom_core::engine::{Disk, DiskTier};
use warploom_tests::disk_work::{LARGEST, Work, kill_writers, perform_if_ordered, size_of};

fn main() -> ExitCode {
    if perform_if_ordered() {
        return ExitCode::SUCCESS;
    }
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let is_torn = arguments.iter().any(|argument| argument == "--torn");
    let mut numbers = arguments.iter().filter_map(|argument| argument.parse().ok());
    let (kills, writers) = (numbers.next().unwrap_or(1000), numbers.next().unwrap_or(2));
    let folder = tempfile::tempdir().expect("a folder");
    let work = Work::to_kill(folder.path().join("cache"), is_torn);
    let command = || Command::new(std::env::current_exe().expect("this program"));
    let start = Instant::now();
    let findings = kill_writers(&work, kills, writers as usize, &command);
    let seconds = start.elapsed().as_secs_f64();
    let size = size_of(&work.cache);
    let tier = DiskTier::new(&work.cache, Arc::new(Disk), work.cache_size);
    tier.collect().expect("removable");
    let (kept, _) = tier.stat().expect("readable").temporary;
    println!("{kills} kills of {writers} writers in {seconds:.1} s: {findings:?}");
    println!("{kept} temporary files are left after a collection; {size} of {} bytes", work.cache_size);
    let is_within = size <= work.cache_size + (1 + u64::from(writers)) * LARGEST;
    let has_seen = findings.from_disk > 0 && findings.left > 0;
    let is_sound = findings.wrong == 0 && findings.complaints == 0 && kept == 0 && is_within;
    match is_sound && has_seen && (findings.damaged > 0) == is_torn {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    }
}
