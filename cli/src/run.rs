//! `warploom run`.

use std::collections::HashSet;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use warploom_core::diag::{Code, Fault};
use warploom_core::engine::{
    Cancel, DEFAULT_CACHE_SIZE, Engine, Existing, Job, Report, Settings, StorePolicy, cannot_write, peak_bytes, plain,
    resident_bytes, write_file,
};
use warploom_core::graph::frames::Folding;
use warploom_core::graph::plan::Plan;
use warploom_core::registry::Registry;

use crate::args::{self, EngineArgs, Progress, RunArgs, Store};
use crate::cache::folder;
use crate::dump::{self, Dump, Planned};
use crate::progress::Display;
use crate::terminal::{note, show, show_warnings};

/// The command.
pub fn run(args: &RunArgs, registry: &Registry) -> u8 {
    let stop = Stop::default();
    stop.on_signal();
    if args.watch {
        return crate::watch::watch(args, registry, &stop);
    }
    match prepare(args, registry) {
        Ok(work) => render(args, &engine(&args.engine), &work, stop.current()),
        Err(code) => code,
    }
}

/// A plan, and the files beside the graph's own.
pub struct Work {
    pub plan: Arc<Plan>,
    dumps: Vec<Planned>,
}

/// Reads and checks the graph; where that fails, shows why and gives the exit code.
pub fn prepare(args: &RunArgs, registry: &Registry) -> Result<Work, u8> {
    let dumps: Result<Vec<Dump>, Fault> = args.dump.iter().map(|text| Dump::parse(text)).collect();
    let dumps = dumps.map_err(|fault| refuse(args, vec![fault]))?;
    let dumped: Vec<String> = dumps.iter().map(|dump| dump.node.clone()).collect();
    let checked = crate::check::read(&args.file, &dumped, registry);
    if args.progress != Progress::None {
        show_warnings(&checked.warnings);
    }
    let Some(plan) = checked.plan.map(Arc::new) else { return Err(refuse(args, checked.faults)) };
    let dumps = outputs(args, &dumps, &plan).map_err(|faults| {
        faults.iter().for_each(|fault| show(fault, false));
        Code::Usage.exit_code()
    })?;
    Ok(Work { plan, dumps })
}

/// Runs the plan, shows what happens and gives the exit code.
pub fn render(args: &RunArgs, engine: &Engine, work: &Work, cancel: Cancel) -> u8 {
    let display = Display::new(args.progress);
    let job = Job {
        keep_going: args.keep_going,
        existing: existing(args.engine.existing),
        deliver: work.dumps.iter().map(|dump| dump.node).collect(),
        on_values: &|delivery| dump::write(&work.dumps, &delivery, |path| display.wrote(path)),
        observer: &display,
        cancel,
    };
    let report = engine.run(&work.plan, &job);
    display.summary(&report);
    if let Some(warning) = engine.take_cache_warning() {
        note(&format!("warning: {warning}"));
    }
    let code = exit_code(&report, args.keep_going);
    if write_report(args.report.as_deref(), &report) { code } else { Code::OutputUnwritable.exit_code() }
}

/// The dumps, once it is clear that neither they nor the report overwrite a file that the run reads or writes.
fn outputs(args: &RunArgs, dumps: &[Dump], plan: &Plan) -> Result<Vec<Planned>, Vec<Fault>> {
    if dumps.is_empty() && args.report.is_none() {
        return Ok(Vec::new());
    }
    let mut folding = Folding::default();
    let mut taken: HashSet<String> = plan.files().map(|(_, path)| folding.folded(&path.to_string_lossy())).collect();
    taken.insert(folding.folded(&plan.graph.to_string_lossy()));
    let planned = dump::plan(dumps, plan, &mut folding, &mut taken)?;
    let report = args.report.as_ref().and_then(|report| std::path::absolute(report).ok());
    match report.filter(|report| taken.contains(&folding.folded(&report.to_string_lossy()))) {
        Some(report) => {
            let message = format!("--report would overwrite {}", report.display());
            Err(vec![Fault::new(Code::Usage, message).hint("report to another file".to_owned())])
        }
        None => Ok(planned),
    }
}

/// An engine as the command line asks for it.
pub fn engine(args: &EngineArgs) -> Engine {
    let defaults = Settings::default();
    let cache = if args.no_cache { None } else { folder(&args.cache) };
    if cache.is_none() && !args.no_cache {
        note("warning: there is no folder for the cache; name one with --cache, or set WARPLOOM_CACHE");
    }
    Engine::new(Settings {
        threads: args.threads.map_or(defaults.threads, usize::from),
        // What the process takes without any picture comes off.
        memory: args.memory.unwrap_or(defaults.memory).saturating_sub(resident_bytes()),
        cache,
        cache_size: args.cache.cache_size.unwrap_or(DEFAULT_CACHE_SIZE),
        store: match args.store {
            Store::Auto => StorePolicy::Auto,
            Store::All => StorePolicy::All,
        },
        io: defaults.io,
    })
}

/// What is done with outputs that are there.
pub fn existing(existing: args::Existing) -> Existing {
    match existing {
        args::Existing::Overwrite => Existing::Overwrite,
        args::Existing::Skip => Existing::Skip,
        args::Existing::Verify => Existing::Verify,
    }
}

/// Shows faults found before anything ran, and reports them.
fn refuse(args: &RunArgs, faults: Vec<Fault>) -> u8 {
    faults.iter().for_each(|fault| show(fault, false));
    let code = refusal(&faults);
    let report = Report {
        schema: 1,
        graph: std::path::absolute(&args.file.graph).unwrap_or_else(|_| args.file.graph.clone()),
        frames: args.file.frames.as_ref().map(|frames| frames.0.clone()).unwrap_or_default(),
        seconds: 0.0,
        peak_bytes: peak_bytes(),
        cache: Default::default(),
        nodes: Vec::new(),
        outputs: Vec::new(),
        warnings: Vec::new(),
        faults,
        frames_delivered: 0,
        cancelled: false,
    };
    if write_report(args.report.as_deref(), &report) { code } else { Code::OutputUnwritable.exit_code() }
}

/// The exit code of a graph that does not check.
pub fn refusal(faults: &[Fault]) -> u8 {
    let plugin_missing = faults.iter().any(|fault| fault.code == Code::MissingPlugin);
    if plugin_missing { Code::MissingPlugin } else { Code::Usage }.exit_code()
}

/// What a signal stops.
#[derive(Clone, Default)]
pub struct Stop {
    /// Set for good by the first signal.
    signal: Cancel,
    current: Arc<Mutex<Cancel>>,
}

impl Stop {
    /// The exit code of whatever was stopped.
    pub const CODE: u8 = 75;

    /// The first signal asks the run to stop, the second ends the process.
    fn on_signal(&self) {
        let stop = self.clone();
        let handler = move || {
            if stop.is_signalled() {
                std::process::exit(Self::CODE.into());
            }
            stop.signal.cancel();
            stop.current.lock().unwrap_or_else(PoisonError::into_inner).cancel();
            note("stopping; finished frames stay. Again to stop at once");
        };
        // Without a handler a signal ends the process as it always does.
        let _ = ctrlc::set_handler(handler);
    }

    pub fn is_signalled(&self) -> bool {
        self.signal.is_cancelled()
    }

    /// What stops the run at hand.
    pub fn current(&self) -> Cancel {
        self.current.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// What stops the next run.
    pub fn next(&self) -> Cancel {
        let next = Cancel::default();
        *self.current.lock().unwrap_or_else(PoisonError::into_inner) = next.clone();
        if self.is_signalled() {
            // The signal came before it could find this one.
            next.cancel();
        }
        next
    }
}

fn exit_code(report: &Report, keep_going: bool) -> u8 {
    match report.faults.first() {
        _ if report.cancelled => Stop::CODE,
        None => 0,
        Some(_) if keep_going && report.frames_delivered > 0 => 1,
        Some(first) => first.code.exit_code(),
    }
}

/// Whether the report, if one is asked for, is written.
fn write_report(path: Option<&Path>, report: &Report) -> bool {
    let Some(path) = path else { return true };
    let text = serde_json::to_vec_pretty(report).unwrap_or_default();
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let written = write_file(&absolute, &text);
    if let Err(error) = &written {
        let message = format!("the report cannot be written to {}: {}", path.display(), plain(error));
        show(&Fault::new(Code::OutputUnwritable, message).hint(cannot_write(error).to_owned()), false);
    }
    written.is_ok()
}
