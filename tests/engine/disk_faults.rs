//! Every operation on the cache folder fails in turn, in every way: results stay, and one warning tells of it.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use tempfile::TempDir;
use warploom_core::engine::{Engine, Job, Settings, Stat, StorePolicy};
use warploom_tests::disk_nodes::plan;
use warploom_tests::disk_state::Snapshot;
use warploom_tests::io::{Meddled, Meddler, Op};

/// Ways to fail, by their numbers on Linux and macOS alike.
const EINTR: i32 = 4;
const EIO: i32 = 5;
const EMFILE: i32 = 24;
const ENOSPC: i32 = 28;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Failure {
    Error(i32),
    /// A write takes one byte only.
    Short,
}

impl Failure {
    const ALL: [Failure; 5] = [Self::Error(EIO), Self::Error(ENOSPC), Self::Error(EMFILE), INTERRUPT, Self::Short];

    /// Whether whoever asks for it just goes on.
    fn is_invisible(self) -> bool {
        matches!(self, INTERRUPT | Failure::Short)
    }
}

const INTERRUPT: Failure = Failure::Error(EINTR);

/// Which operations fail, and how.
#[derive(Clone, Copy, Debug)]
struct Fault {
    first: u64,
    lasting: bool,
    failure: Failure,
}

impl Fault {
    fn hits(&self, operation: u64) -> bool {
        let Some(since) = operation.checked_sub(self.first) else { return false };
        // Whoever is interrupted tries again, and comes through now and then.
        since == 0 || self.lasting && (self.failure != INTERRUPT || since.is_multiple_of(2))
    }
}

/// What may happen from an operation on. Without optimisation the lasting failures take turns.
fn faults_from(first: u64) -> impl Iterator<Item = Fault> {
    let fault = move |lasting| move |failure| Fault { first, lasting, failure };
    let is_turn = move |at: &usize| !cfg!(debug_assertions) || *at == first as usize % Failure::ALL.len();
    let lasting = (0..Failure::ALL.len()).filter(is_turn).map(|at| Failure::ALL[at]);
    Failure::ALL.into_iter().map(fault(false)).chain(lasting.map(fault(true)))
}

/// Counts operations on the cache and lets some fail. Everything else looks old, so that memos of it are kept.
struct Faulty {
    cache: PathBuf,
    operations: AtomicU64,
    failed: AtomicU64,
    fault: Option<Fault>,
}

impl Faulty {
    fn fails_now(&self, operation: u64) -> Option<Failure> {
        let fault = self.fault.filter(|fault| fault.hits(operation))?;
        Some(fault.failure)
    }
}

impl Meddler for Faulty {
    fn before(&self, _: Op, path: &Path) -> io::Result<()> {
        if !path.starts_with(&self.cache) {
            return Ok(());
        }
        let operation = self.operations.fetch_add(1, Ordering::Relaxed);
        match self.fails_now(operation) {
            Some(Failure::Error(number)) => {
                self.failed.fetch_add(1, Ordering::Relaxed);
                Err(io::Error::from_raw_os_error(number))
            }
            _ => Ok(()),
        }
    }

    fn stat(&self, path: &Path, stat: Stat) -> Stat {
        let minute = if path.starts_with(&self.cache) { 0 } else { 60_000_000_000 };
        Stat { modified: stat.modified - minute, changed: stat.changed - minute, ..stat }
    }

    fn written(&self, path: &Path, length: usize) -> usize {
        let operation = self.operations.load(Ordering::Relaxed) - 1;
        let is_short = path.starts_with(&self.cache) && self.fails_now(operation) == Some(Failure::Short);
        if is_short { length.min(1) } else { length }
    }
}

/// A run on the cache, and what is in it before.
#[derive(Clone, Copy)]
struct Phase {
    by: u32,
    cache_size: u64,
}

struct Stage {
    folder: TempDir,
    phase: Phase,
}

impl Stage {
    fn new(phase: Phase) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("in.txt"), "plate").expect("written");
        Self { folder, phase }
    }

    /// A run in an engine of its own; how many operations there were and failed, and the warning.
    fn run(&self, phase: Phase, fault: Option<Fault>) -> (u64, u64, Option<String>) {
        let cache = self.folder.path().join("cache");
        let faulty = Faulty { cache: cache.clone(), operations: 0.into(), failed: 0.into(), fault };
        let io = Arc::new(Meddled::new(faulty));
        let engine = Engine::new(Settings {
            threads: 1,
            memory: 1 << 26,
            cache: Some(cache),
            cache_size: phase.cache_size,
            store: StorePolicy::All,
            io: io.clone(),
        });
        let nodes = format!(
            r#""plate": Plate(path: "in.txt"), "parts": Parts(), "both": Stir(of: ["plate", "parts"], by: {}),
            "out": Keep(of: "both", path: "out.bin")"#,
            phase.by
        );
        let report = engine.run(&plan(&nodes, "1-1", self.folder.path(), &[]), &Job::default());
        assert!(report.faults.is_empty() && report.frames_delivered == 1, "{fault:?} {:#?}", report.faults);
        let warning = engine.take_cache_warning();
        assert_eq!(engine.take_cache_warning(), None, "{fault:?}: one warning is enough");
        (io.operations.load(Ordering::Relaxed), io.failed.load(Ordering::Relaxed), warning)
    }

    fn output(&self) -> Vec<u8> {
        std::fs::read(self.folder.path().join("out.bin")).expect("written")
    }

    /// Lets every operation of the phase fail, on a fresh copy of what is there now.
    fn fail_everything(&self) {
        let before = Snapshot::of(self.folder.path());
        let (operations, _, warning) = self.run(self.phase, None);
        assert_eq!(warning, None);
        let expected = self.output();
        for fault in (0..operations).flat_map(faults_from) {
            before.restore();
            let (_, failed, warning) = self.run(self.phase, Some(fault));
            assert_eq!(self.output(), expected, "{fault:?}");
            assert!(failed > 0 || fault.failure == Failure::Short, "{fault:?} failed nothing");
            let is_told = !fault.failure.is_invisible();
            assert_eq!(warning.is_some(), is_told, "{fault:?}: {warning:?}");
            if fault.lasting || !cfg!(debug_assertions) {
                self.run_healthy(&expected, fault);
            }
        }
    }

    fn run_healthy(&self, expected: &[u8], fault: Fault) {
        std::fs::remove_file(self.folder.path().join("out.bin")).expect("removed");
        let (_, _, warning) = self.run(self.phase, None);
        assert_eq!(self.output(), expected, "a healthy run after {fault:?}");
        assert_eq!(warning, None, "a healthy run after {fault:?}");
    }
}

const ROOMY: u64 = 1 << 30;

#[test]
fn a_cold_run_bears_every_failure() {
    Stage::new(Phase { by: 1, cache_size: ROOMY }).fail_everything();
}

#[test]
fn a_warm_run_bears_every_failure() {
    let stage = Stage::new(Phase { by: 2, cache_size: ROOMY });
    stage.run(Phase { by: 1, cache_size: ROOMY }, None);
    stage.fail_everything();
}

#[test]
fn a_run_that_evicts_bears_every_failure() {
    let stage = Stage::new(Phase { by: 2, cache_size: 8 << 12 });
    stage.run(Phase { by: 1, cache_size: ROOMY }, None);
    // It may be somebody's on another machine: to judge it takes the clock of the file system.
    let parts = stage.folder.path().join("cache/v2/values/00");
    std::fs::create_dir_all(&parts).expect("made");
    std::fs::write(parts.join(".warploom-1-1-0-0.tmp"), "half").expect("written");
    stage.fail_everything();
}
