//! From a plan to results: keys, the store, the run, and the reasons.

mod context;
mod disk;
mod explain;
mod files;
mod foresee;
mod io;
mod key;
mod memory;
mod pairs;
mod queue;
mod report;
mod resolve;
mod run;
mod schedule;
mod share;
mod signals;
mod store;
mod upkeep;

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

pub use context::{Artifact, Context};
pub use disk::{CacheCounts, DiskTier};
pub use foresee::{Explanation, PairVerdict, Verdict};
pub use io::{Disk, Io, NewFile, Stat, cannot_write, plain, write_file};
pub(crate) use pairs::Pairs;
pub use report::{From, OutputReport, PairReport, Reason, Report, Status, Why, peak_bytes, resident_bytes};
pub use signals::let_large_writes_fail;
pub use store::StorePolicy;
pub use upkeep::{CacheStat, CacheWork};

use crate::diag::{Code, Fault};
use crate::graph::plan::Plan;
use crate::node::NodeError;
use crate::schema::Access;
use crate::value::{Digest, Value};
use context::cannot_read;
use explain::{Course, Facts, Journal, Outcome, Trigger};
use files::FileMemos;
use memory::Memory;
use pairs::Pair;
use schedule::{Shared, State, Worker};
use store::Store;

/// How an engine is set up.
pub struct Settings {
    /// Threads that compute; at least 1.
    pub threads: usize,
    /// Most bytes that values, nodes at work and memory kept ready may take together.
    pub memory: u64,
    /// Folder of the disk tier; none means values live in memory only.
    pub cache: Option<PathBuf>,
    /// Most bytes that the disk tier may take.
    pub cache_size: u64,
    /// Which values go to disk.
    pub store: StorePolicy,
    /// The file system.
    pub io: Arc<dyn Io>,
}

/// Size of the disk tier where none is named.
pub const DEFAULT_CACHE_SIZE: u64 = 50 << 30;

/// Memory that a run takes for each of its pairs, roughly: the pair, its state, its line in the report.
const NOTES_PER_PAIR: u64 = 1024;

impl Default for Settings {
    fn default() -> Self {
        Self {
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            memory: memory::default_room(),
            cache: None,
            cache_size: DEFAULT_CACHE_SIZE,
            store: StorePolicy::Auto,
            io: Arc::new(Disk),
        }
    }
}

/// Runs plans and remembers their results. One engine may run several plans at once, from several threads; they share
/// its memory.
pub struct Engine {
    store: Store,
    files: FileMemos,
    io: Arc<dyn Io>,
    pool: rayon::ThreadPool,
    threads: usize,
    journal: Journal,
    /// Folders of outputs that were cleared of what killed processes left.
    swept: Mutex<HashSet<PathBuf>>,
}

/// A flag that stops a run.
#[derive(Clone, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// Stops the run soon: no node starts any more, nodes at work are told.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it was stopped.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Something that happened in a run. Events come from many threads, between other events of other pairs.
#[derive(Debug)]
pub enum Event<'a> {
    /// The run begins.
    Begun {
        /// Frames in which something is to be done, 1 if the run has none.
        frames: usize,
        /// Pairs that may run.
        pairs: usize,
    },
    /// A node begins to compute.
    Started {
        /// The node.
        node: &'a str,
        /// Its frame.
        frame: Option<i64>,
    },
    /// A node tells how far it is.
    Progress {
        /// The node.
        node: &'a str,
        /// Its frame.
        frame: Option<i64>,
        /// The part done, 0..=1.
        part: f64,
    },
    /// A pair is done.
    Finished {
        /// The node.
        node: &'a str,
        /// Its frame.
        frame: Option<i64>,
        /// What became of it.
        status: Status,
        /// Seconds it took.
        seconds: f64,
    },
    /// A sink's file is there.
    Output {
        /// The file.
        path: &'a Path,
        /// Its size.
        bytes: u64,
        /// Digest of its content; none where a file stands that was not looked into.
        blake3: Option<Digest>,
        /// Whether this run wrote it.
        written: bool,
    },
    /// Something went wrong.
    Fault(&'a Fault),
    /// A node has a result, and something to say of it.
    Warning(&'a Fault),
    /// All targets of a frame are done, well or badly.
    FrameDone {
        /// The frame; none for a run without frames.
        frame: Option<i64>,
        /// Whether they are all there.
        delivered: bool,
    },
}

/// Who wants to know what happens in a run.
pub trait Observer: Sync {
    /// Called as things happen, from any thread; it must not block for long.
    fn event(&self, event: Event<'_>);
}

impl Observer for () {
    fn event(&self, _: Event<'_>) {}
}

/// Values of a target that are handed out.
pub struct Delivery<'a> {
    /// The node.
    pub node: usize,
    /// The frame.
    pub frame: Option<i64>,
    /// One per output.
    pub values: &'a [Value],
    /// To be asked for so many bytes before they are allocated; pass its error on.
    pub reserve: &'a (dyn Fn(u128) -> Result<(), NodeError> + Sync),
}

/// What to do with values that are handed out.
pub type OnValues<'a> = &'a (dyn Fn(Delivery) -> Result<(), Fault> + Sync);

/// What is done where a sink's file is there already.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Existing {
    /// It is written again unless it is what would be written.
    #[default]
    Overwrite,
    /// It stands, whatever is in it.
    Skip,
    /// It must be what would be written; nothing is written.
    Verify,
}

/// How a plan is run.
pub struct Job<'a> {
    /// Whether new frames start after a fault.
    pub keep_going: bool,
    /// What is done where a sink's file is there already.
    pub existing: Existing,
    /// Targets whose values are handed to `on_values`.
    pub deliver: Vec<usize>,
    /// Receives them, from any thread.
    pub on_values: OnValues<'a>,
    /// Is told what happens.
    pub observer: &'a dyn Observer,
    /// Stops the run.
    pub cancel: Cancel,
}

impl Default for Job<'_> {
    fn default() -> Self {
        Self {
            keep_going: false,
            existing: Existing::Overwrite,
            deliver: Vec::new(),
            on_values: &|_| Ok(()),
            observer: &(),
            cancel: Cancel::default(),
        }
    }
}

impl Engine {
    /// An engine with empty memory.
    pub fn new(settings: Settings) -> Self {
        let threads = settings.threads.max(1);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|i| format!("compute-{i}")).build();
        let disk = settings.cache.map(|folder| DiskTier::new(&folder, settings.io.clone(), settings.cache_size));
        Self {
            store: Store::new(Memory::new(settings.memory), disk, settings.store),
            files: FileMemos::default(),
            io: settings.io,
            pool: pool.expect("the system gives threads"),
            threads,
            journal: Journal::default(),
            swept: Mutex::default(),
        }
    }

    /// Runs the targets of a plan over its frames.
    pub fn run(&self, plan: &Arc<Plan>, job: &Job) -> Report {
        let start = Instant::now();
        let pairs = plan.pairs();
        job.observer.event(Event::Begun { frames: pairs.frames.len(), pairs: pairs.list.len() });
        let shared = Arc::new(Shared::new(plan.clone(), &job.deliver));
        let worker = Worker { engine: self, job, shared: &shared, pairs };
        let _note = self.store.memory.note(pairs.list.len() as u64 * NOTES_PER_PAIR);
        std::thread::scope(|scope| {
            (1..self.threads).for_each(|_| {
                scope.spawn(|| worker.work());
            });
            worker.work();
        });
        Worker::abandon(self, &shared);
        self.store.settle();
        let report = self.report(plan, job, &mut shared.lock(), start);
        self.store.tidy();
        report
    }

    fn report(&self, plan: &Plan, job: &Job, state: &mut State, start: Instant) -> Report {
        let pairs = plan.pairs();
        let mut reasons = self.reasons(plan, state);
        let mut nodes = Vec::with_capacity(pairs.order.len());
        let (mut outputs, mut warnings) = (Vec::new(), Vec::new());
        for &at in &pairs.order {
            let (pair, known) = (&pairs.list[at], &state.pairs[at]);
            let node = &plan.nodes[pair.node];
            let frame = pair.request.frame;
            let record = known.record.as_deref();
            warnings.extend(record.iter().flat_map(|r| &r.warnings).map(|text| run::warning(plan, pair, text)));
            nodes.push(PairReport {
                node: node.id.clone(),
                node_type: node.node_type.name.clone(),
                frame,
                status: known.status.unwrap_or(Status::Skipped),
                from: known.from,
                seconds: known.seconds,
                bytes: record.map_or(0, |record| record.value_bytes()),
                peak_bytes: known.peak,
                why: reasons[at].take(),
                stats: record.map(|record| record.stats.clone()).unwrap_or_default(),
            });
            let written = record.iter().flat_map(|record| &record.artifacts);
            let written = written.map(|artifact| (&artifact.path, artifact.bytes, Some(artifact.blake3)));
            let standing =
                known.files.iter().flat_map(|files| &files.standing).map(|(path, bytes)| (path, *bytes, None));
            outputs.extend(written.chain(standing).map(|(path, bytes, blake3)| OutputReport {
                node: node.id.to_string(),
                frame,
                path: path.clone(),
                bytes,
                blake3,
            }));
        }
        let frames_delivered = pairs.frames.iter().filter(|(_, targets)| state.has_delivered(targets)).count();
        let mut faults = std::mem::take(&mut state.faults);
        // In frame order, then in graph order, whichever was met first.
        let place = |fault: &Fault| {
            let frame = plan.frames.iter().position(|&frame| Some(frame) == fault.frame);
            (frame, fault.node.as_ref().and_then(|id| plan.order.iter().position(|&node| *plan.nodes[node].id == **id)))
        };
        faults.sort_by_cached_key(place);
        if faults.is_empty() && frames_delivered < pairs.frames.len() && !job.cancel.is_cancelled() {
            let message = "the run ended before all frames were done, and nothing tells why";
            faults.push(
                Fault::new(Code::Panic, message).hint("this is a bug; please report it with the graph".to_owned()),
            );
        }
        Report {
            schema: 1,
            graph: plan.graph.clone(),
            frames: plan.frames.clone(),
            seconds: start.elapsed().as_secs_f64(),
            peak_bytes: peak_bytes(),
            cache: self.store.disk.as_ref().map(DiskTier::take_counts).unwrap_or_default(),
            nodes,
            outputs,
            warnings,
            faults,
            frames_delivered,
            cancelled: job.cancel.is_cancelled(),
        }
    }

    fn reasons(&self, plan: &Plan, state: &State) -> Vec<Option<Box<Why>>> {
        let facts = |at: usize| {
            let pair = &state.pairs[at];
            Facts {
                outcome: match pair.status {
                    Some(Status::Executed | Status::Failed) => Outcome::Ran,
                    Some(Status::Recomputed) => Outcome::Recomputed,
                    Some(Status::Reused | Status::Skipped) | None => Outcome::Stood,
                },
                key: pair.key,
                record: pair.record.as_deref(),
                files: pair.files_read(),
                trigger: pair.files.as_ref().and_then(|files| files.trigger.as_ref()),
            }
        };
        self.journal.record(&Course { plan, pairs: plan.pairs(), facts: &facts }, self.store.disk.as_ref())
    }

    /// The one warning of the disk tier, if something went wrong there since this was last asked.
    pub fn take_cache_warning(&self) -> Option<String> {
        self.store.disk.as_ref()?.take_warning()
    }

    /// Digest of the content of a file.
    fn digest(&self, path: &Path) -> std::io::Result<Digest> {
        self.files.digest(path, &*self.io, self.store.disk.as_ref())
    }

    /// The files that a pair reads, and digests of their content.
    fn files_read(&self, plan: &Plan, pair: &Pair) -> Result<Vec<(PathBuf, Digest)>, Fault> {
        let files = plan.files_at(pair.node, pair.request.frame, Access::Read);
        files
            .map(|(name, path)| match self.digest(&path) {
                Ok(digest) => Ok((path, digest)),
                Err(error) => Err(Fault::new(Code::InputUnreadable, cannot_read(&path, &error)).parameter(name)),
            })
            .collect()
    }

    /// Whether a sink's files are no longer what it wrote.
    fn changed(&self, artifacts: &[Artifact]) -> Option<Trigger> {
        artifacts.iter().find_map(|artifact| match self.digest(&artifact.path) {
            Ok(digest) if digest == artifact.blake3 => None,
            Ok(_) => Some(Trigger::OutputChanged(artifact.path.clone())),
            Err(_) => Some(Trigger::OutputMissing(artifact.path.clone())),
        })
    }

    /// The files that a pair would write, and their sizes, if all are there.
    fn standing(&self, plan: &Plan, pair: &Pair) -> Vec<(PathBuf, u64)> {
        let files = plan.files_at(pair.node, pair.request.frame, Access::Write);
        let found: Option<Vec<_>> =
            files.map(|(_, path)| io::stat(&*self.io, &path).ok().map(|stat| (path, stat.size))).collect();
        found.unwrap_or_default()
    }

    /// Clears the folders of files that are to be written of what killed processes left there, once.
    fn sweep(&self, files: impl Iterator<Item = PathBuf>) {
        for folder in files.filter_map(|file| file.parent().map(Path::to_owned)) {
            if self.swept.lock().unwrap_or_else(PoisonError::into_inner).insert(folder.clone()) {
                io::sweep(&*self.io, &folder);
            }
        }
    }
}

/// The folder of the disk tier where none is named: `WARPLOOM_CACHE`, else `warploom` in the user's cache folder.
pub fn default_cache(variable: &dyn Fn(&str) -> Option<String>) -> Option<PathBuf> {
    let set = |name: &str| variable(name).filter(|value| !value.is_empty());
    set("WARPLOOM_CACHE")
        .map(PathBuf::from)
        .or_else(|| set("XDG_CACHE_HOME").map(|folder| Path::new(&folder).join("warploom")))
        .or_else(|| set("HOME").map(|folder| Path::new(&folder).join(".cache/warploom")))
}
