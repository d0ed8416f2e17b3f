//! Processes at work on one cache folder, killed or not, and what a reader finds there.

use std::collections::HashMap;
use std::ffi::OsString;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use warploom_core::engine::{Disk, Engine, From, Io, NewFile, Report, Settings, Stat, StorePolicy};

use crate::Random;
use crate::disk_nodes::{Values, plan, values};
use crate::disk_state::files_below;

/// Where a process finds its orders.
const ORDERS: &str = "WARPLOOM_DISK_WORK";

/// Different graphs that are worked on.
const SUBJECTS: u32 = 48;

/// Bytes that all values of all subjects take, roughly.
const WORKING_SET: u64 = 48 << 20;

/// The largest entry.
pub const LARGEST: u64 = (1 << 20) + (16 << 10);

/// What a process has to do.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Work {
    /// The cache.
    pub cache: PathBuf,
    /// Most bytes in it.
    pub cache_size: u64,
    /// Which subjects in which order.
    pub seed: u64,
    /// Threads of each engine.
    pub threads: usize,
    /// For how long.
    pub seconds: f64,
    /// Whether every value is compared with one made without a cache.
    pub compares: bool,
    /// Whether files get their names before they are whole.
    pub is_torn: bool,
}

/// What came of it.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Findings {
    /// Runs of subjects.
    pub runs: u64,
    /// Values that came from disk.
    pub from_disk: u64,
    /// Values that were not what they should be.
    pub wrong: u64,
    /// Entries that were not whole.
    pub damaged: u64,
    /// Bytes that were evicted.
    pub evicted: u64,
    /// Faults and warnings.
    pub complaints: u64,
    /// Temporary files of killed processes.
    pub left: u64,
}

impl std::ops::AddAssign for Findings {
    fn add_assign(&mut self, more: Self) {
        self.runs += more.runs;
        self.from_disk += more.from_disk;
        self.wrong += more.wrong;
        self.damaged += more.damaged;
        self.evicted += more.evicted;
        self.complaints += more.complaints;
        self.left += more.left;
    }
}

impl Work {
    /// Work of one of two processes on a cache that is far too small.
    pub fn to_soak(cache: PathBuf, seconds: f64) -> Self {
        let cache_size = WORKING_SET / 10;
        Self { cache, cache_size, seed: 1, threads: 8, seconds, compares: true, is_torn: false }
    }

    /// Work of processes that are killed.
    pub fn to_kill(cache: PathBuf, is_torn: bool) -> Self {
        let cache_size = WORKING_SET / 4;
        Self { cache, cache_size, seed: 1, threads: 2, seconds: 3600.0, compares: false, is_torn }
    }

    /// What this process was started for; none if it was started by a person.
    pub fn ordered() -> Option<Self> {
        let orders = std::env::var(ORDERS).ok()?;
        Some(serde_json::from_str(&orders).expect("orders are written by `start`"))
    }

    /// Starts a process that works on this: `command` runs a program that begins with [`perform_if_ordered`].
    pub fn start(&self, mut command: Command) -> Child {
        let orders = serde_json::to_string(self).expect("orders can be written");
        command.env(ORDERS, orders).stdin(Stdio::null()).stdout(Stdio::piped());
        command.spawn().expect("a process")
    }

    fn engine(&self) -> Engine {
        let io: Arc<dyn Io> = if self.is_torn { Arc::new(Torn) } else { Arc::new(Disk) };
        Engine::new(Settings {
            threads: self.threads,
            memory: 256 << 20,
            cache: Some(self.cache.clone()),
            cache_size: self.cache_size,
            store: StorePolicy::All,
            io,
        })
    }

    fn perform(&self) -> Findings {
        let (start, mut random) = (Instant::now(), Random(self.seed));
        let (mut scratch, mut findings) = (Scratch::default(), Findings::default());
        while start.elapsed().as_secs_f64() < self.seconds {
            let subject = random.below(SUBJECTS as usize) as u32;
            findings += match self.compares {
                true => scratch.compare(&self.engine(), &self.cache, subject),
                false => told(&run(&self.engine(), &self.cache, subject).1),
            };
        }
        findings
    }
}

/// Works and prints what came of it, if that is what this process was started for.
pub fn perform_if_ordered() -> bool {
    let Some(work) = Work::ordered() else { return false };
    let findings = serde_json::to_string(&work.perform()).expect("findings can be written");
    println!("\n{findings}");
    true
}

/// What a process that ended by itself found.
pub fn findings_of(mut child: Child) -> Findings {
    let mut text = String::new();
    child.stdout.take().expect("it is piped").read_to_string(&mut text).expect("it is text");
    assert!(child.wait().expect("it ends").success(), "{text}");
    let line = text.lines().find(|line| line.starts_with('{'));
    serde_json::from_str(line.expect("it tells what it found")).expect("findings are written by `perform_if_ordered`")
}

/// Subjects share what they begin with, four at a time. Values are of 4 KiB, 32 KiB, 256 KiB or 1 MiB.
fn run(engine: &Engine, folder: &Path, subject: u32) -> (Values, Report) {
    let (seed, by) = (subject / 4, subject % 4);
    let size = |at: u32| [22, 64, 181, 362][(at % 4) as usize];
    let nodes = format!(
        r#""a": Picture(seed: {seed}, size: {}), "b": Bend(seed: {seed}, size: {}),
        "s": Stir(of: ["a", "b"], by: {by}, size: {})"#,
        size(seed),
        size(seed + 1) * 7 / 10,
        size(subject)
    );
    values(engine, &plan(&nodes, "1-2", folder, &["a", "b", "s"]))
}

fn told(report: &Report) -> Findings {
    let from_disk = report.nodes.iter().filter(|pair| pair.from == Some(From::Disk)).count() as u64;
    Findings {
        runs: 1,
        from_disk,
        wrong: 0,
        damaged: report.cache.damaged,
        evicted: report.cache.evicted_bytes,
        complaints: report.faults.len() as u64,
        left: 0,
    }
}

/// What comes out without a cache.
#[derive(Default)]
struct Scratch(HashMap<u32, Values>);

impl Scratch {
    fn compare(&mut self, engine: &Engine, folder: &Path, subject: u32) -> Findings {
        let expected = self.0.entry(subject).or_insert_with(|| {
            let engine = Engine::new(Settings { threads: 1, memory: 256 << 20, ..Settings::default() });
            run(&engine, folder, subject).0
        });
        let (found, report) = run(engine, folder, subject);
        let mut findings = told(&report);
        findings.wrong = expected.iter().filter(|(of, bytes)| found.get(of) != Some(bytes)).count() as u64;
        let warning = engine.take_cache_warning();
        // Damage is counted by itself.
        if let Some(warning) = warning.filter(|_| findings.damaged == 0) {
            eprintln!("{warning}");
            findings.complaints += 1;
        }
        findings
    }
}

/// Bytes of all files below a folder.
pub fn size_of(folder: &Path) -> u64 {
    let size = |path: PathBuf| std::fs::symlink_metadata(path).map_or(0, |metadata| metadata.len());
    files_below(folder).into_iter().map(size).sum()
}

/// Lets `writers` processes work on `work.cache` and kills one after another, `kills` in all; after each kill somebody
/// reads.
pub fn kill_writers(work: &Work, kills: u32, writers: usize, command: &dyn Fn() -> Command) -> Findings {
    let mut random = Random(work.seed);
    let start = |random: &mut Random| {
        let work = Work { seed: random.next(), ..work.clone() };
        work.start(command())
    };
    let mut children: Vec<Child> = (0..writers).map(|_| start(&mut random)).collect();
    let reader = Work { is_torn: false, ..work.clone() };
    let (mut scratch, mut findings) = (Scratch::default(), Findings::default());
    for _ in 0..kills {
        std::thread::sleep(Duration::from_micros(2_000 + random.next() % 23_000));
        let victim = random.below(writers);
        end(&mut children[victim]);
        findings.left += left_by(&work.cache, children[victim].id());
        let subject = random.below(SUBJECTS as usize) as u32;
        findings += scratch.compare(&reader.engine(), &work.cache, subject);
        children[victim] = start(&mut random);
    }
    children.iter_mut().for_each(end);
    findings
}

/// How many temporary files a process left.
fn left_by(cache: &Path, process: u32) -> u64 {
    let owner = format!("-{process}-");
    let is_left = |name: &str| name.ends_with(".tmp") && name.contains(&owner);
    let files = files_below(cache);
    files.iter().filter(|file| file.file_name().and_then(|name| name.to_str()).is_some_and(is_left)).count() as u64
}

fn end(child: &mut Child) {
    child.kill().expect("it runs until it is killed");
    let status = child.wait().expect("it was killed");
    assert!(!status.success(), "it runs until it is killed");
}

/// Two processes of eight threads for `seconds`; what both found, and the largest size of the cache meanwhile.
pub fn soak(work: &Work, command: &dyn Fn() -> Command) -> (Findings, u64) {
    let seeds = [work.seed, work.seed + 1];
    let children = seeds.map(|seed| Work { seed, ..work.clone() }.start(command()));
    let (start, mut largest) = (Instant::now(), 0);
    while start.elapsed().as_secs_f64() < work.seconds + 0.5 {
        largest = largest.max(size_of(&work.cache));
        std::thread::sleep(Duration::from_millis(5));
    }
    let mut findings = Findings::default();
    children.into_iter().for_each(|child| findings += findings_of(child));
    (findings, largest.max(size_of(&work.cache)))
}

/// A file system on which a file has its name while it is still being written: what must not be.
struct Torn;

impl Io for Torn {
    fn stat(&self, path: &Path) -> io::Result<Stat> {
        Disk.stat(path)
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Read + Send>> {
        Disk.open(path)
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn NewFile>> {
        Disk.create(path)
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        let mut file = std::fs::File::create(to)?;
        for piece in std::fs::read(from)?.chunks(4096) {
            file.write_all(piece)?;
        }
        std::fs::remove_file(from)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        Disk.remove(path)
    }

    fn make_folder(&self, path: &Path) -> io::Result<()> {
        Disk.make_folder(path)
    }

    fn list(&self, folder: &Path) -> io::Result<Vec<OsString>> {
        Disk.list(folder)
    }

    fn has_our_clock(&self, path: &Path) -> bool {
        Disk.has_our_clock(path)
    }

    fn touch(&self, path: &Path) -> io::Result<()> {
        Disk.touch(path)
    }
}
