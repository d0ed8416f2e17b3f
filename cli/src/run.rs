//! `warploom run`.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use warploom_core::diag::{Code, Fault};
use warploom_core::engine::{
    Cancel, Disk, Engine, Io, Job, Report, Settings, StorePolicy, default_cache, peak_bytes, plain,
};
use warploom_core::graph::frames::folded;
use warploom_core::graph::plan::Plan;
use warploom_core::registry::Registry;

use crate::args::{Progress, RunArgs, Store};
use crate::dump::{self, Dump, Planned};
use crate::progress::Display;
use crate::terminal::{note, show, show_warnings};

const STOPPED: u8 = 75;

/// The command.
pub fn run(args: &RunArgs, registry: &Registry) -> u8 {
    let dumps: Result<Vec<Dump>, Fault> = args.dump.iter().map(|text| Dump::parse(text)).collect();
    let dumps = match dumps {
        Ok(dumps) => dumps,
        Err(fault) => return refuse(args, vec![fault]),
    };
    let dumped: Vec<String> = dumps.iter().map(|dump| dump.node.clone()).collect();
    let checked = crate::check::read(&args.file, &dumped, registry);
    if args.progress != Progress::None {
        show_warnings(&checked.warnings);
    }
    let Some(plan) = checked.plan.map(Arc::new) else { return refuse(args, checked.faults) };
    let dumps = match outputs(args, &dumps, &plan) {
        Ok(dumps) => dumps,
        Err(faults) => {
            faults.iter().for_each(|fault| show(fault, false));
            return Code::Usage.exit_code();
        }
    };

    let cancel = Cancel::default();
    stop_on_signal(cancel.clone());
    let engine = Engine::new(settings(args));
    let display = Display::new(args.progress);
    let job = Job {
        keep_going: args.keep_going,
        deliver: dumps.iter().map(|dump| dump.node).collect(),
        on_values: &|node, frame, values| dump::write(&dumps, node, frame, values, |path| display.wrote(path)),
        observer: &display,
        cancel,
    };
    let report = engine.run(&plan, &job);
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
    let mut taken: HashSet<String> = plan.files().collect();
    taken.insert(folded(&plan.graph.to_string_lossy()));
    let planned = dump::plan(dumps, plan, &mut taken)?;
    let report = args.report.as_ref().and_then(|report| std::path::absolute(report).ok());
    match report.filter(|report| taken.contains(&folded(&report.to_string_lossy()))) {
        Some(report) => {
            let message = format!("--report would overwrite {}", report.display());
            Err(vec![Fault::new(Code::Usage, message).hint("report to another file".to_owned())])
        }
        None => Ok(planned),
    }
}

fn settings(args: &RunArgs) -> Settings {
    let cache = match (args.no_cache, &args.cache) {
        (true, _) => None,
        (false, Some(folder)) => Some(folder.clone()),
        (false, None) => default_cache(&|name| std::env::var(name).ok()),
    };
    let defaults = Settings::default();
    Settings {
        threads: args.threads.map_or(defaults.threads, usize::from),
        memory: args.memory.unwrap_or(defaults.memory),
        cache,
        store: match args.store {
            Store::Auto => StorePolicy::Auto,
            Store::All => StorePolicy::All,
        },
        io: defaults.io,
    }
}

/// Shows faults found before anything ran, and reports them.
fn refuse(args: &RunArgs, faults: Vec<Fault>) -> u8 {
    faults.iter().for_each(|fault| show(fault, false));
    let plugin_missing = faults.iter().any(|fault| fault.code == Code::MissingPlugin);
    let code = if plugin_missing { Code::MissingPlugin } else { Code::Usage };
    let report = Report {
        schema: 1,
        graph: std::path::absolute(&args.file.graph).unwrap_or_else(|_| args.file.graph.clone()),
        frames: args.file.frames.as_ref().map(|frames| frames.0.clone()).unwrap_or_default(),
        seconds: 0.0,
        peak_bytes: peak_bytes(),
        nodes: Vec::new(),
        outputs: Vec::new(),
        faults,
        frames_delivered: 0,
        cancelled: false,
    };
    if write_report(args.report.as_deref(), &report) { code.exit_code() } else { Code::OutputUnwritable.exit_code() }
}

/// The first signal asks the run to stop, the second ends the process.
fn stop_on_signal(cancel: Cancel) {
    let handler = move || {
        if cancel.is_cancelled() {
            std::process::exit(STOPPED.into());
        }
        cancel.cancel();
        note("stopping; finished frames stay. Again to stop at once");
    };
    // Without a handler a signal ends the process as it always does.
    let _ = ctrlc::set_handler(handler);
}

fn exit_code(report: &Report, keep_going: bool) -> u8 {
    match report.faults.first() {
        _ if report.cancelled => STOPPED,
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
    let written = Disk.write(&absolute, &text);
    if let Err(error) = &written {
        let message = format!("the report cannot be written to {}: {}", path.display(), plain(error));
        show(&Fault::new(Code::OutputUnwritable, message), false);
    }
    written.is_ok()
}
