//! Two processes of eight threads on one cache of a tenth of what they make: `disk_soak [SECONDS]`.

use std::process::{Command, ExitCode};

use warploom_tests::disk_work::{LARGEST, Work, perform_if_ordered, soak};

fn main() -> ExitCode {
    if perform_if_ordered() {
        return ExitCode::SUCCESS;
    }
    let seconds = std::env::args().nth(1).and_then(|argument| argument.parse().ok()).unwrap_or(60.0);
    let folder = tempfile::tempdir().expect("a folder");
    let work = Work::to_soak(folder.path().join("cache"), seconds);
    let (findings, largest) = soak(&work, &|| Command::new(std::env::current_exe().expect("this program")));
    println!("{seconds} s: {findings:?}; at most {largest} bytes of {}", work.cache_size);
    let is_within = largest <= work.cache_size + 2 * LARGEST;
    let has_seen = findings.from_disk > 0 && findings.evicted > 0;
    let is_sound = findings.wrong == 0 && findings.damaged == 0 && findings.complaints == 0;
    if is_within && has_seen && is_sound { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
