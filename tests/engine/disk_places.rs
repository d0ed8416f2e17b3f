//! Caches in bad places: the run goes on with at most one warning, and its results are the same.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use tempfile::TempDir;
use warploom_core::engine::{CacheCounts, Disk, DiskTier, Engine, Io, Settings, StorePolicy};
use warploom_tests::disk_nodes::{Values, plan, values};
use warploom_tests::io::{Meddled, Meddler, Op};

/// A few frames of a few kinds, all of which go to disk.
const NODES: &str = r#""parts": Parts(size: 20), "bend": Bend(size: 20), "word": Word(),
    "stir": Stir(of: ["parts", "bend", "word"], size: 20)"#;

const TARGETS: [&str; 4] = ["parts", "bend", "word", "stir"];

struct Place {
    folder: TempDir,
    expected: Values,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let plan = plan(NODES, "1-3", folder.path(), &TARGETS);
        let (expected, _) = values(&Engine::new(Settings { memory: 1 << 26, ..Settings::default() }), &plan);
        assert_eq!(expected.len(), 12);
        Self { folder, expected }
    }

    fn cache(&self) -> PathBuf {
        self.folder.path().join("cache")
    }

    /// Runs in an engine of its own and demands the same values; what was had of the cache, and the warning.
    fn run(&self, io: Arc<dyn Io>) -> (CacheCounts, Option<String>) {
        let settings = Settings { threads: 2, memory: 1 << 26, store: StorePolicy::All, ..Settings::default() };
        let engine = Engine::new(Settings { cache: Some(self.cache()), io, ..settings });
        let (found, report) = values(&engine, &plan(NODES, "1-3", self.folder.path(), &TARGETS));
        assert!(report.faults.is_empty(), "{:#?}", report.faults);
        assert!(found == self.expected, "other values");
        let warning = engine.take_cache_warning();
        assert_eq!(engine.take_cache_warning(), None, "one is enough");
        (report.cache, warning)
    }
}

fn healthy() -> Arc<dyn Io> {
    Arc::new(Disk)
}

/// Lets nobody write, with an error of that number.
struct ReadOnly(i32);

impl Meddler for ReadOnly {
    fn before(&self, op: Op, _: &Path) -> io::Result<()> {
        match op {
            Op::Stat | Op::Open | Op::Read | Op::List => Ok(()),
            _ => Err(io::Error::from_raw_os_error(self.0)),
        }
    }
}

#[test]
fn a_cache_that_may_only_be_read_is_read() {
    const EACCES: i32 = 13;
    const EROFS: i32 = 30;
    for number in [EACCES, EROFS] {
        let place = Place::new();
        let (counts, warning) = place.run(Arc::new(Meddled::new(ReadOnly(number))));
        assert!(warning.is_some_and(|text| text.contains("cannot be written")));
        assert_eq!((counts.hits, counts.written_bytes), (0, 0));
        let (_, warning) = place.run(healthy());
        assert_eq!(warning, None);
        let (counts, warning) = place.run(Arc::new(Meddled::new(ReadOnly(number))));
        assert!(warning.is_some_and(|text| text.contains("cannot be written")), "their use cannot be noted");
        assert!(counts.hits >= 24 && counts.misses == 0, "{counts:?}");
    }
}

/// Removes the cache just before one of the operations on it.
struct Vanishing {
    cache: PathBuf,
    at: u64,
    operations: AtomicU64,
}

impl Meddler for Vanishing {
    fn before(&self, _: Op, path: &Path) -> io::Result<()> {
        let is_next = path.starts_with(&self.cache) && self.operations.fetch_add(1, Ordering::Relaxed) == self.at;
        // While others write there, it may not go at once.
        while is_next && std::fs::remove_dir_all(&self.cache).is_err_and(|error| error.kind() != ErrorKind::NotFound) {}
        Ok(())
    }
}

#[test]
fn a_cache_may_vanish_at_any_moment() {
    let mut warnings = 0;
    for at in (0..400).step_by(7) {
        let place = Place::new();
        let vanishing = |at| Arc::new(Meddled::new(Vanishing { cache: place.cache(), at, operations: 0.into() }));
        warnings += u64::from(place.run(vanishing(at)).1.is_some());
        place.run(vanishing(at / 4));
        place.run(healthy());
        let (counts, warning) = place.run(healthy());
        assert_eq!((warning, counts.misses, counts.damaged), (None, 0, 0), "vanished before operation {at}");
    }
    assert!(warnings > 0, "it was missed at least once");
}

#[test]
fn a_cache_may_be_removed_again_and_again() {
    let place = Place::new();
    let is_done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !is_done.load(Ordering::Relaxed) {
                // What is just being written there is removed the next time.
                let _ = std::fs::remove_dir_all(place.cache());
            }
        });
        for _ in 0..100 {
            place.run(healthy());
        }
        is_done.store(true, Ordering::Relaxed);
    });
    place.run(healthy());
    assert_eq!(place.run(healthy()).0.misses, 0);
}

/// A disk with room for so many bytes.
struct Full {
    room: u64,
    written: AtomicU64,
}

impl Full {
    fn left(&self) -> u64 {
        self.room.saturating_sub(self.written.load(Ordering::Relaxed))
    }
}

impl Meddler for Full {
    fn before(&self, op: Op, _: &Path) -> io::Result<()> {
        if op == Op::Write && self.left() == 0 { Err(ErrorKind::StorageFull.into()) } else { Ok(()) }
    }

    fn written(&self, _: &Path, length: usize) -> usize {
        let length = length.min(self.left() as usize).max(1);
        self.written.fetch_add(length as u64, Ordering::Relaxed);
        length
    }
}

#[test]
fn a_disk_may_be_full_from_any_byte_on() {
    let all = Place::new().run(healthy()).0.written_bytes;
    for room in (0..all).step_by(999) {
        let place = Place::new();
        let (counts, warning) = place.run(Arc::new(Meddled::new(Full { room, written: 0.into() })));
        // What was written is counted generously.
        assert!(warning.is_some() || counts.written_bytes >= all - 4096, "room for {room} bytes");
        let (counts, warning) = place.run(healthy());
        assert_eq!((counts.damaged, warning), (0, None), "what was begun was removed");
        let temporary = DiskTier::new(&place.cache(), healthy(), 1 << 30).stat().expect("readable").temporary;
        assert_eq!(temporary, (0, 0));
    }
}

#[test]
fn a_file_in_the_place_of_the_cache_is_left_alone() {
    let place = Place::new();
    std::fs::write(place.cache(), "mine").expect("written");
    let (counts, warning) = place.run(healthy());
    assert!(warning.is_some() && counts.hits == 0);
    assert_eq!(std::fs::read_to_string(place.cache()).expect("still there"), "mine");
}

/// What others put into the folders of a cache, as file servers do, is left alone and in nobody's way.
#[test]
fn folders_among_the_entries_are_left_alone() {
    let place = Place::new();
    place.run(healthy());
    let entries = warploom_tests::disk_state::files_below(&place.cache());
    let foreign = entries[0].parent().expect("a folder").join("@eaDir");
    std::fs::create_dir(&foreign).expect("made");
    let tier = DiskTier::new(&place.cache(), healthy(), 0);
    assert_eq!(tier.collect().expect("removable").left_bytes, 0);
    assert!(foreign.exists());
    assert_eq!(place.run(healthy()).1, None);
    tier.verify().expect("readable");
}

/// On a network a file that another machine removes ends in this error for whoever reads it.
struct Stale;

impl Meddler for Stale {
    fn before(&self, op: Op, _: &Path) -> io::Result<()> {
        if op == Op::Read { Err(ErrorKind::StaleNetworkFileHandle.into()) } else { Ok(()) }
    }
}

#[test]
fn what_another_machine_removes_is_a_miss() {
    let place = Place::new();
    place.run(healthy());
    let (counts, warning) = place.run(Arc::new(Meddled::new(Stale)));
    assert_eq!((counts.hits, warning), (0, None));
}
