//! Damaged files and bombs through the real binary.

use std::collections::BTreeMap;
use std::path::Path;

use super::LIMITS;
use super::bombs::{Bomb, bombs};
use crate::harness::Outcome;
use crate::harness::place::{Place, wait};

const MIB: u64 = 1 << 20;

/// The budget of a run, MiB.
const BUDGET: u64 = 512;

/// Resident bytes that a run may have over its budget.
const EXCESS: u64 = 256 * MIB;

/// Resident bytes that a refused file may cost a run above what any run takes.
const REFUSED: u64 = 64 * MIB;

/// How a run that reads one file ended.
struct Seen {
    code: Option<i32>,
    /// Of the processor.
    seconds: f64,
    /// Peak resident bytes.
    peak: u64,
    message: String,
}

/// Reads the files of a folder, which are damaged; says how often each message came.
pub fn damaged(binary: &Path, folder: &Path) -> Outcome {
    let (place, mut outcome) = (place(binary), Outcome::default());
    let Ok(entries) = std::fs::read_dir(folder) else {
        outcome.figures.push(format!("damaged files: skipped, there is no {}", folder.display()));
        return outcome;
    };
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.retain(|path| path.extension().is_none_or(|extension| extension != "rst"));
    paths.sort();
    let mut kinds = BTreeMap::<String, usize>::new();
    let (mut slowest, mut largest): (f64, u64) = (0.0, 0);
    for path in &paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let seen = look(&place, &std::fs::read(path).expect("a file that can be read"));
        check(&mut outcome, &name, &seen, &[0, 3, 4]);
        *kinds.entry(format!("{:?} {}", seen.code, general(&seen.message))).or_default() += 1;
        (slowest, largest) = (slowest.max(seen.seconds), largest.max(seen.peak));
    }
    outcome.figures.push(format!(
        "damaged files: {}, slowest {slowest:.2} s, peak {} MiB at most",
        paths.len(),
        largest / MIB
    ));
    outcome.figures.extend(kinds.iter().map(|(kind, count)| format!("damaged files: {count:3} x {kind}")));
    outcome
}

/// Reads files that claim or unpack to more than there is.
pub fn explosive(binary: &Path) -> Outcome {
    let (place, mut outcome) = (place(binary), Outcome::default());
    let plain = look(&place, &super::seeds::png::file(super::bombs::SMALL, &[]));
    outcome.check(plain.code == Some(0), || format!("a good file is not read: {}", plain.message));
    for Bomb { name, bytes, codes } in bombs() {
        let seen = look(&place, &bytes);
        check(&mut outcome, &name, &seen, codes);
        let above = seen.peak.saturating_sub(plain.peak);
        outcome.figures.push(format!(
            "bombs: {name}, {} kB: {:?}, {:.2} s, {} MiB above a plain run: {}",
            bytes.len() / 1000,
            seen.code,
            seen.seconds,
            above / MIB,
            seen.message
        ));
        outcome.check(seen.code != Some(7) || above <= REFUSED, || format!("{name}: takes {} MiB", above / MIB));
    }
    outcome
}

fn place(binary: &Path) -> Place {
    let place = Place::new(binary);
    std::fs::write(place.path("load.ron"), r#"Graph(version: 1, nodes: { "picture": Load(path: "picture") })"#)
        .expect("a graph");
    place
}

/// Reads a file of this content.
fn look(place: &Place, bytes: &[u8]) -> Seen {
    std::fs::write(place.path("picture"), bytes).expect("room on the disk");
    // That of the file before would stand for a run that is killed.
    let _ = std::fs::remove_file(place.path("report.json"));
    let line =
        format!("run load.ron --target picture --no-cache --memory {BUDGET}M --report report.json --progress none");
    let mut child = place.command(&line).spawn().expect("the binary starts");
    let (proc, mut seconds) = (format!("/proc/{}/stat", child.id()), 0.0f64);
    let code = wait(&mut child, || seconds = seconds.max(cpu_seconds(&proc)));
    let report = place.report("report.json");
    let message = report["faults"][0]["message"].as_str().unwrap_or_default().to_owned();
    let peak = report["peak_bytes"].as_u64().unwrap_or(u64::MAX);
    Seen { code, seconds, peak, message }
}

fn check(outcome: &mut Outcome, name: &str, seen: &Seen, codes: &[i32]) {
    let Seen { code, seconds, peak, message } = seen;
    let is_expected = code.is_some_and(|code| codes.contains(&code));
    outcome.check(is_expected, || format!("{name}: {code:?} instead of {codes:?}: {message}"));
    let says_where = *code == Some(0) || *code == Some(7) || message.contains("picture: ");
    // Where the arithmetic of a library wraps around in a release, a debug build stops it.
    let is_known = cfg!(debug_assertions) || !message.contains("broke down");
    let is_known = is_known && !message.contains("panic") && !message.contains('\n');
    outcome.check(says_where && is_known, || format!("{name}: `{message}` does not say what is wrong"));
    outcome.check(*seconds <= LIMITS.seconds, || format!("{name}: computes for {seconds:.2} s"));
    outcome.check(*peak <= BUDGET * MIB + EXCESS, || format!("{name}: peak is {} MiB", peak / MIB));
}

/// A message without its path and numbers.
fn general(message: &str) -> String {
    let rest = message.split_once("picture: ").map_or(message, |(_, rest)| rest);
    let words = rest.split(' ').map(|word| if word.contains(|c: char| c.is_ascii_digit()) { "N" } else { word });
    words.collect::<Vec<_>>().join(" ")
}

/// Seconds that a process has computed; 0 once it has ended.
fn cpu_seconds(stat: &str) -> f64 {
    /// Of `/proc`, on every Linux there is.
    const TICKS_PER_SECOND: f64 = 100.0;
    let text = std::fs::read_to_string(stat).unwrap_or_default();
    // Behind the name of the program, which may hold spaces: 11 other fields, then user and system ticks.
    let words = text.rsplit_once(')').map_or("", |(_, rest)| rest).split_whitespace().skip(11).take(2);
    words.filter_map(|word| word.parse::<f64>().ok()).sum::<f64>() / TICKS_PER_SECOND
}
