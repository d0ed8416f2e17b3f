//! From a plan to results: keys, the store, the run, and the reasons.

mod context;
mod disk;
mod explain;
mod files;
mod io;
mod key;
mod pairs;
mod report;
mod run;
mod schedule;
mod store;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

pub use context::{Artifact, Context};
pub use io::{Disk, Io, Stat, plain};
pub use report::{From, OutputReport, PairReport, Reason, Report, Status, Why, peak_bytes};
pub use store::StorePolicy;

use crate::diag::Fault;
use crate::graph::plan::Plan;
use crate::value::{Hasher, Value};
use disk::DiskTier;
use explain::Journal;
use files::FileMemos;
use pairs::Pairs;
use schedule::{PairState, Shared, Worker};
use store::Store;

/// How an engine is set up.
pub struct Settings {
    /// Threads that compute; at least 1.
    pub threads: usize,
    /// Memory budget in bytes: no pair may allocate more, and half of it holds values for reuse.
    pub memory: u64,
    /// Folder of the disk tier; none means values live in memory only.
    pub cache: Option<PathBuf>,
    /// Which values go to disk.
    pub store: StorePolicy,
    /// The file system.
    pub io: Arc<dyn Io>,
}

impl Default for Settings {
    fn default() -> Self {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        Self { threads, memory: default_memory(), cache: None, store: StorePolicy::Auto, io: Arc::new(Disk) }
    }
}

/// Three quarters of the memory that this process may use: the machine's, or its container's if that is less.
fn default_memory() -> u64 {
    let meminfo = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let machine = (meminfo.lines().find_map(|line| line.strip_prefix("MemTotal:")))
        .and_then(|line| line.trim().trim_end_matches("kB").trim().parse::<u64>().ok())
        .map_or(8 << 30, |kilobytes| kilobytes * 1024);
    let container = ["/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"]
        .iter()
        .filter_map(|path| std::fs::read_to_string(path).ok()?.trim().parse::<u64>().ok())
        .fold(machine, u64::min);
    container / 4 * 3
}

/// Runs plans and remembers their results. One engine may run several plans at once, from several threads.
pub struct Engine {
    store: Store,
    files: FileMemos,
    io: Arc<dyn Io>,
    pool: rayon::ThreadPool,
    threads: usize,
    memory: u64,
    journals: Mutex<HashMap<PathBuf, Journal>>,
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
        artifact: &'a Artifact,
        /// Whether this run wrote it.
        written: bool,
    },
    /// Something went wrong.
    Fault(&'a Fault),
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

/// What to do with the values of a node that are handed out: node, frame, one value per output.
pub type OnValues<'a> = &'a (dyn Fn(usize, Option<i64>, &[Value]) -> Result<(), Fault> + Sync);

/// How a plan is run.
pub struct Job<'a> {
    /// Whether new frames start after a fault.
    pub keep_going: bool,
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
            deliver: Vec::new(),
            on_values: &|_, _, _| Ok(()),
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
        let disk = settings.cache.map(|folder| DiskTier::new(&folder, settings.io.clone()));
        Self {
            store: Store::new(settings.memory / 2, disk, settings.store),
            files: FileMemos::default(),
            io: settings.io,
            pool: pool.expect("the system gives threads"),
            threads,
            memory: settings.memory,
            journals: Mutex::default(),
        }
    }

    /// Runs the targets of a plan over its frames.
    pub fn run(&self, plan: &Arc<Plan>, job: &Job) -> Report {
        let start = Instant::now();
        let pairs = Pairs::expand(plan);
        let frames = pairs.frames.len();
        job.observer.event(Event::Begun { frames, pairs: pairs.list.len() });
        let frame_of_target: HashMap<usize, usize> = (pairs.frames.iter().enumerate())
            .flat_map(|(frame, (_, targets))| targets.iter().map(move |&target| (target, frame)))
            .collect();
        let shared = Arc::new(Shared::new(plan.clone(), pairs, &job.deliver));
        let worker = Worker { engine: self, job, shared: &shared, frame_of_target: &frame_of_target };
        std::thread::scope(|scope| {
            (1..self.threads).for_each(|_| {
                scope.spawn(|| worker.work());
            });
            worker.work();
        });
        Worker::abandon(self, &shared);
        self.report(plan, job, &shared, start)
    }

    fn report(&self, plan: &Plan, job: &Job, shared: &Shared, start: Instant) -> Report {
        let mut state = shared.lock();
        let reasons = self.explain(plan, shared, &state.pairs);
        let mut nodes = Vec::new();
        let mut outputs = Vec::new();
        for at in shared.pairs.in_order(plan) {
            let (pair, known, why) = (&shared.pairs.list[at], &state.pairs[at], reasons[at].clone());
            let node = &plan.nodes[pair.node];
            let (status, frame) = (known.status.unwrap_or(Status::Skipped), pair.request.frame);
            let record = known.record.as_deref();
            nodes.push(PairReport {
                node: node.id.to_string(),
                node_type: node.node_type.name.clone(),
                frame,
                status,
                from: known.from,
                seconds: known.seconds,
                bytes: record.map_or(0, |record| record.outputs.iter().map(|outline| outline.bytes).sum()),
                peak_bytes: known.peak_bytes,
                why,
                stats: record.map(|record| record.stats.clone()).unwrap_or_default(),
            });
            outputs.extend(record.iter().flat_map(|record| &record.artifacts).map(|artifact| OutputReport {
                node: node.id.to_string(),
                frame,
                artifact: artifact.clone(),
            }));
        }
        let frames_delivered = shared.pairs.frames.iter().filter(|(_, targets)| state.has_delivered(targets)).count();
        let mut faults = std::mem::take(&mut state.faults);
        // In frame order, then in graph order, whichever was met first.
        let place = |fault: &Fault| {
            let frame = plan.frames.iter().position(|&frame| Some(frame) == fault.frame);
            (frame, fault.node.as_ref().and_then(|id| plan.order.iter().position(|&node| *plan.nodes[node].id == **id)))
        };
        faults.sort_by_cached_key(place);
        Report {
            schema: 1,
            graph: plan.graph.clone(),
            frames: plan.frames.clone(),
            seconds: start.elapsed().as_secs_f64(),
            peak_bytes: peak_bytes(),
            nodes,
            outputs,
            faults,
            frames_delivered,
            cancelled: job.cancel.is_cancelled(),
        }
    }

    fn explain(&self, plan: &Plan, shared: &Shared, states: &[PairState]) -> Vec<Option<Why>> {
        let mut journals = self.journals.lock().unwrap_or_else(PoisonError::into_inner);
        let name = Hasher::new("journal").text(&plan.graph.to_string_lossy()).finish();
        let journal = journals.entry(plan.graph.clone()).or_insert_with(|| {
            self.store.disk.as_ref().and_then(|disk| disk.load_json("journal", &name)).unwrap_or_default()
        });
        let reasons = journal.explain(plan, &shared.pairs, states);
        if let Some(disk) = &self.store.disk {
            disk.save_json("journal", &name, journal);
        }
        reasons
    }

    /// The one warning of the disk tier, if writing to it failed since this was last asked.
    pub fn take_cache_warning(&self) -> Option<String> {
        self.store.disk.as_ref()?.take_warning()
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
