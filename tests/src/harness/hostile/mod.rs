//! Spoiled picture files. What a file can cause is an error that says so, soon, and in little memory.
//!
//! Decoders work in a child process, which says what it begins before it begins, so that one that hangs or aborts is
//! known too.

mod bombs;
pub mod files;
mod mutate;
mod repair;
mod seeds;
mod worker;

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use super::Outcome;
use crate::Random;
use mutate::Target;
pub use worker::work_if_asked;
use worker::{Ending, Job, run};

/// Bytes that a decoder may reserve in all.
const BUDGET: u64 = 64 << 20;
/// Bytes that it may take beyond what it reserved.
const EXCESS: u64 = 64 << 20;
/// Peak bytes of a file that is refused for what it claims.
const REFUSED: u64 = 64 << 20;

/// What a file may cost, and after how long without a word a child is taken to hang.
#[derive(Clone, Copy)]
struct Limits {
    seconds: f64,
    patience: Duration,
}

/// A decoder may compute for 2 s.
const LIMITS: Limits = Limits { seconds: 2.0, patience: Duration::from_secs(60) };

/// What came of the files of a format.
#[derive(Default)]
struct Tally {
    endings: BTreeMap<String, usize>,
    /// Seconds and the name of the file.
    slowest: (f64, String),
    /// Bytes and the name of the file.
    greediest: (u64, String),
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let total: usize = self.endings.values().sum();
        let endings: Vec<String> = self.endings.iter().map(|(ending, count)| format!("{count} {ending}")).collect();
        let (slowest, greediest) = (&self.slowest, &self.greediest);
        let excess = greediest.0 as f64 / f64::from(1 << 20);
        write!(f, "{total} files: {}; ", endings.join(", "))?;
        write!(f, "slowest {:.3} s ({}), most over the reserve {excess:.1} MiB ({})", slowest.0, slowest.1, greediest.1)
    }
}

/// Spoils good files in `count` ways of `seed` and has this executable decode them, started with `arguments`; it
/// must call [`work_if_asked`].
pub fn hostile(seed: u64, count: usize, arguments: &[&str]) -> Outcome {
    let (targets, mut outcome) = (targets(), Outcome::default());
    let mut tallies = BTreeMap::<String, Tally>::new();
    let count = count + targets.len();
    run(arguments, Job { seed, is_control: false }, count, LIMITS, |index, ending| {
        let target = target(&targets, index);
        let name = format!("{index}, {:?}: {}", target.seed.format, target.seed.name);
        let tally = tallies.entry(format!("{:?}", target.seed.format)).or_default();
        *tally.endings.entry(ending.kind().to_owned()).or_default() += 1;
        if let Ending::Decoded(cost) = &ending {
            tally.slowest = max(&tally.slowest, (cost.seconds, name.clone()));
            tally.greediest = max(&tally.greediest, (cost.excess(), name.clone()));
        }
        let is_whole = index < targets.len() && ending.kind() != "read";
        let fault = ending.fault(LIMITS).or_else(|| is_whole.then(|| "a good file is not read".to_owned()));
        if let Some(fault) = fault {
            let path = keep(seed, index, &file(&targets, seed, index));
            outcome.violations.push(format!("{fault}: {name}, seed {seed}, kept as {}", path.display()));
        }
    });
    outcome.figures.extend(tallies.iter().map(|(format, tally)| format!("hostile images: {format}: {tally}")));
    control(&mut outcome, arguments);
    outcome
}

/// Has decoders at work that do all that one must not: each must be found out.
fn control(outcome: &mut Outcome, arguments: &[&str]) {
    let limits = Limits { seconds: 0.05, patience: Duration::from_secs(5) };
    let mut faults = Vec::new();
    run(arguments, Job { seed: 0, is_control: true }, worker::CONTROLS.len(), limits, |_, ending| {
        faults.push(ending.fault(limits).unwrap_or_default());
    });
    for (control, fault) in worker::CONTROLS.iter().zip(&faults) {
        outcome.check(fault.starts_with(control), || format!("insensitive: `{fault}` of a decoder that {control}"));
    }
}

fn targets() -> Vec<Target> {
    seeds::seeds().into_iter().map(Target::new).collect()
}

/// The good file behind that number: first each, then those of each format in turn.
fn target(targets: &[Target], index: usize) -> &Target {
    if index < targets.len() {
        return &targets[index];
    }
    let formats: Vec<&[Target]> = targets.chunk_by(|a, b| a.seed.format == b.seed.format).collect();
    let format = formats[index % formats.len()];
    &format[index / formats.len() % format.len()]
}

/// The file of that number: first the good ones, then spoiled ones.
fn file(targets: &[Target], seed: u64, index: usize) -> Vec<u8> {
    let target = target(targets, index);
    match index < targets.len() {
        true => target.seed.bytes.clone(),
        false => target.spoiled(&mut Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(index as u64))),
    }
}

/// Writes a file that broke a promise to where it can be looked at.
fn keep(seed: u64, index: usize, file: &[u8]) -> PathBuf {
    let folder = std::env::temp_dir().join("warploom-hostile");
    let path = folder.join(format!("{seed}-{index}"));
    std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&path, file)).expect("room on the disk");
    path
}

fn max<T: PartialOrd + Copy>(one: &(T, String), other: (T, String)) -> (T, String) {
    if other.0 > one.0 { other } else { one.clone() }
}
