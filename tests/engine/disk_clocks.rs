//! Temporary files, clocks that are days apart, and entries that go while they are read.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};

use tempfile::TempDir;
use warploom_core::engine::{CacheCounts, Disk, DiskTier, Engine, Io, Settings, Stat, StorePolicy};
use warploom_tests::disk_nodes::{Values, plan, values};
use warploom_tests::disk_state::files_below;
use warploom_tests::disk_work::size_of;
use warploom_tests::io::{Meddled, Meddler, Op};

const DAY: i128 = 24 * 3600 * 1_000_000_000;

const BLOCK: u64 = 4096;

/// A file system whose clock is off, and which remembers what was made on it.
#[derive(Default)]
struct Clock {
    ahead: i128,
    made: Mutex<Vec<PathBuf>>,
}

impl Meddler for Clock {
    fn before(&self, op: Op, path: &Path) -> io::Result<()> {
        if op == Op::Create {
            self.made.lock().expect("no panic").push(path.to_owned());
        }
        Ok(())
    }

    fn stat(&self, _: &Path, stat: Stat) -> Stat {
        Stat { modified: stat.modified + self.ahead, changed: stat.changed + self.ahead, ..stat }
    }
}

fn clock(ahead: i128) -> Arc<Meddled<Clock>> {
    Arc::new(Meddled::new(Clock { ahead, ..Clock::default() }))
}

struct Stage(TempDir, AtomicU32);

impl Stage {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"), AtomicU32::new(1000))
    }

    fn cache(&self) -> PathBuf {
        self.0.path().join("cache")
    }

    fn tier(&self, io: Arc<dyn Io>, budget: u64) -> DiskTier {
        DiskTier::new(&self.cache(), io, budget)
    }

    fn run(&self, nodes: &str, targets: &[&str], io: Arc<dyn Io>, cache_size: u64) -> (Values, CacheCounts) {
        let settings = Settings { threads: 2, memory: 1 << 26, store: StorePolicy::All, ..Settings::default() };
        let engine = Engine::new(Settings { cache: Some(self.cache()), cache_size, io, ..settings });
        let (found, report) = values(&engine, &plan(nodes, "1-1", self.0.path(), targets));
        assert!(report.faults.is_empty(), "{:#?}", report.faults);
        assert_eq!(engine.take_cache_warning(), None);
        (found, report.cache)
    }

    /// A temporary file of a host and a process, beside an entry; none means this host, or this process.
    fn temporary(&self, host: Option<&str>, process: Option<u32>, bytes: usize) -> PathBuf {
        let seed = self.1.fetch_add(1, Ordering::Relaxed);
        let io = clock(0);
        let settings =
            Settings { cache: Some(self.cache()), store: StorePolicy::All, io: io.clone(), ..Settings::default() };
        let plan = plan(&format!(r#""word": Word(seed: {seed})"#), "1-1", self.0.path(), &["word"]);
        values(&Engine::new(settings), &plan);
        let made = io.made.lock().expect("no panic").pop().expect("something new is written");
        let name = made.file_name().and_then(|name| name.to_str()).expect("text");
        let mut parts: Vec<String> = name.split('-').map(str::to_owned).collect();
        parts[1] = host.unwrap_or(&parts[1]).to_owned();
        parts[2] = process.map_or(parts[2].clone(), |process| process.to_string());
        let path = made.with_file_name(parts.join("-"));
        std::fs::write(&path, vec![1; bytes]).expect("written");
        path
    }
}

/// The number of a process that has ended.
fn ended() -> u32 {
    let mut child = std::process::Command::new(std::env::current_exe().expect("this program"))
        .arg("--list")
        .stdout(std::process::Stdio::null())
        .spawn()
        .expect("a process");
    child.wait().expect("it ends");
    child.id()
}

fn age(file: &Path, hours: u64) {
    let then = SystemTime::now() - Duration::from_secs(3600 * hours);
    File::options().write(true).open(file).and_then(|file| file.set_modified(then)).expect("set");
}

#[test]
fn what_dead_processes_left_is_swept_and_nothing_else() {
    for sweep in [
        |stage: &Stage, io| _ = stage.tier(io, 1 << 30).collect().expect("removable"),
        |stage: &Stage, io| _ = stage.run(r#""dots": Dots()"#, &["dots"], io, 1 << 18),
    ] {
        for ahead in [0, DAY, -2 * DAY] {
            let stage = Stage::new();
            let own = stage.temporary(None, None, 10);
            let foreign = stage.temporary(Some("1"), Some(ended()), 10);
            let old = stage.temporary(Some("2"), None, 10);
            age(&old, 25);
            let young = stage.temporary(Some("3"), None, 10);
            age(&young, 23);
            // Last: whoever writes may sweep.
            let dead = stage.temporary(None, Some(ended()), 10);
            let are_there = || [&dead, &own, &foreign, &old, &young].map(|path| path.exists());
            assert_eq!(are_there(), [true; 5]);
            sweep(&stage, clock(ahead));
            assert_eq!(are_there(), [false, true, true, false, true], "by a clock {ahead} ns ahead");
            let of_now = files_below(&stage.cache()).len();
            stage.tier(clock(ahead), 1 << 30).collect().expect("removable");
            assert_eq!(files_below(&stage.cache()).len(), of_now, "looking at the clock leaves nothing");
        }
    }
}

#[test]
fn a_probe_of_the_clock_is_swept_too() {
    let stage = Stage::new();
    stage.temporary(Some("1"), None, 10);
    let io = clock(0);
    stage.tier(io.clone(), 1 << 30).collect().expect("removable");
    let probe = io.made.lock().expect("no panic").pop().expect("the clock was looked at");
    let name = probe.file_name().and_then(|name| name.to_str()).expect("text");
    let own = format!("-{}-", std::process::id());
    // As if the process had been killed right then.
    let left = probe.with_file_name(name.replace(&own, &format!("-{}-", ended())));
    std::fs::write(&left, "").expect("written");
    stage.tier(clock(0), 1 << 30).collect().expect("removable");
    assert!(!left.exists());
}

#[test]
fn temporary_files_count_in_the_size() {
    let stage = Stage::new();
    let budget = 64 * BLOCK;
    let live = stage.temporary(None, None, 56 * BLOCK as usize);
    let targets: Vec<String> = (0..20).map(|seed| format!("d{seed}")).collect();
    let nodes: Vec<String> =
        targets.iter().zip(0..).map(|(name, seed)| format!(r#""{name}": Dots(seed: {seed})"#)).collect();
    let targets: Vec<&str> = targets.iter().map(String::as_str).collect();
    let (_, counts) = stage.run(&nodes.join(","), &targets, clock(0), budget);
    assert!(live.exists() && counts.evicted_bytes > 0, "{counts:?}");
    let stat = stage.tier(clock(0), budget).stat().expect("readable");
    assert_eq!(stat.temporary, (1, 56 * BLOCK));
    assert!(stat.bytes() <= budget && size_of(&stage.cache()) <= budget, "{stat:?}");
}

/// Every time that decides is one of the file system: it stamps what is written and used, and it is asked what is now.
/// So machines with any clocks agree on what was used least lately.
#[test]
fn what_was_used_last_stays_whatever_the_clocks() {
    for ahead in [0, DAY, -DAY] {
        let stage = Stage::new();
        let run = |seed: u32, io| {
            let (_, counts) = stage.run(&format!(r#""parts": Parts(seed: {seed})"#), &["parts"], io, 1 << 30);
            std::thread::sleep(Duration::from_millis(30));
            counts
        };
        run(1, clock(ahead));
        run(2, clock(0));
        run(3, clock(-ahead));
        run(1, clock(-ahead));
        // Three values, three records, a page.
        assert_eq!(stage.tier(clock(ahead), 6 * BLOCK).collect().expect("removable").removed, 1);
        // A page, a record, and the value if it is there.
        let hits = [1, 2, 3].map(|seed| run(seed, clock(ahead)).hits);
        assert_eq!(hits, [3, 2, 3], "the second was not used for longest");
    }
}

#[test]
fn machines_whose_clocks_are_days_apart_share_a_cache() {
    let stage = Stage::new();
    let nodes = |by: u32| {
        format!(
            r#""parts": Parts(size: 20), "bend": Bend(size: 20), "word": Word(size: 30),
            "stir": Stir(of: ["parts", "bend", "word"], by: {by}, size: 20)"#
        )
    };
    let targets = ["parts", "bend", "word", "stir"];
    let mut hits = 0;
    for by in 0..40 {
        let engine = Engine::new(Settings { memory: 1 << 26, ..Settings::default() });
        let (expected, _) = values(&engine, &plan(&nodes(by / 2), "1-1", stage.0.path(), &targets));
        let ahead = [0, DAY, -DAY][by as usize % 3];
        let (found, counts) = stage.run(&nodes(by / 2), &targets, clock(ahead), 20 * BLOCK);
        assert!(found == expected, "by a clock {ahead} ns ahead");
        assert!(size_of(&stage.cache()) <= 20 * BLOCK);
        hits += counts.hits;
    }
    assert!(hits > 0);
}

/// One stamp for all, by a server's clock, which may be off: what is overwritten looks the same.
struct Tick(i128);

impl Meddler for Tick {
    fn stat(&self, path: &Path, stat: Stat) -> Stat {
        match path.ends_with("in.txt") {
            true => Stat { size: stat.size, modified: self.0, changed: self.0, inode: 1, device: 1 },
            false => stat,
        }
    }

    fn has_our_clock(&self, _: &Path) -> bool {
        false
    }
}

#[test]
fn a_plate_overwritten_within_one_tick_is_seen_past_every_memo() {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).expect("after 1970").as_nanos() as i128;
    for ahead in [0, DAY, -DAY] {
        let stage = Stage::new();
        let write = |text: &str| std::fs::write(stage.0.path().join("in.txt"), text).expect("written");
        let io = Arc::new(Meddled::new(Tick(now + ahead)));
        let engine = |cache| Engine::new(Settings { cache, memory: 1 << 26, io: io.clone(), ..Settings::default() });
        let remembers = engine(None);
        for text in ["first", "secnd", "third"] {
            write(text);
            let fresh = engine(Some(stage.cache()));
            for engine in [&remembers, &fresh] {
                let plan = plan(r#""plate": Plate(path: "in.txt")"#, "1-1", stage.0.path(), &["plate"]);
                let (found, report) = values(engine, &plan);
                assert!(report.faults.is_empty(), "{:#?}", report.faults);
                let bytes = found.values().next().expect("a value");
                assert!(String::from_utf8_lossy(bytes).contains(text), "{ahead}");
            }
        }
    }
}

#[test]
fn entries_go_while_others_load_them() {
    let stage = Stage::new();
    let nodes = r#""picture": Picture(size: 64), "cover": Cover(), "parts": Parts(), "bend": Bend(size: 40), "shape": Shape(),
        "stir": Stir(of: ["picture", "cover", "parts", "bend", "shape"])"#;
    let targets = ["picture", "cover", "parts", "bend", "shape", "stir"];
    let (expected, _) = stage.run(nodes, &targets, Arc::new(Disk), 1 << 30);
    let is_done = AtomicBool::new(false);
    let load = || {
        let (mut hits, mut misses) = (0, 0);
        while hits + misses < 5_000 {
            let (found, counts) = stage.run(nodes, &targets, Arc::new(Disk), 1 << 30);
            assert!(found == expected, "other values");
            assert_eq!(counts.damaged, 0);
            (hits, misses) = (hits + counts.hits, misses + counts.misses);
        }
        assert!(hits > 500 && misses > 50, "{hits} found, {misses} not");
    };
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !is_done.load(Ordering::Relaxed) {
                for blocks in [8, 4, 0] {
                    stage.tier(Arc::new(Disk), blocks * BLOCK).collect().expect("removable");
                    std::thread::sleep(Duration::from_millis(3));
                }
            }
        });
        let loading = [scope.spawn(load), scope.spawn(load)];
        let loaded = loading.map(|thread| thread.join());
        is_done.store(true, Ordering::Relaxed);
        loaded.into_iter().for_each(|thread| thread.expect("all loads are right"));
    });
}
