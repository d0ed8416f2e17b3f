//! `warploom run --watch`: a run per save.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use warploom_core::engine::{Disk, Engine, Io, Stat};
use warploom_core::graph::plan::Plan;
use warploom_core::registry::Registry;
use warploom_core::schema::Access;

use crate::args::RunArgs;
use crate::run::{Stop, Work, engine, prepare, render};
use crate::terminal::{note, output_is_closed};

/// How often files are looked at. Network file systems tell of no changes, so nothing better works everywhere.
const PAUSE: Duration = Duration::from_millis(100);

/// Runs, and runs again whenever the graph or a file it reads is another, until a signal comes. A graph with faults
/// leaves the last good one in force.
pub fn watch(args: &RunArgs, registry: &Registry, stop: &Stop) -> u8 {
    let engine = engine(&args.engine);
    let mut good: Option<Work> = None;
    loop {
        let graph = Look::at([args.file.graph.clone()]);
        let mut is_due = match prepare(args, registry) {
            Ok(work) => {
                good = Some(work);
                true
            }
            Err(_) => {
                if good.is_some() {
                    note("the graph has faults; what it was before stays in force");
                }
                false
            }
        };
        loop {
            let inputs = Look::at(good.iter().flat_map(|work| inputs(&work.plan)));
            let is_stale = || graph.is_stale() || inputs.is_stale();
            if let Some(work) = good.as_ref().filter(|_| is_due) {
                render_until(args, &engine, work, stop, &is_stale);
            }
            if output_is_closed() {
                return 0;
            }
            if !stop.is_signalled() {
                note("watching; an interrupt ends it");
            }
            while !stop.is_signalled() && !is_stale() {
                std::thread::sleep(PAUSE);
            }
            if stop.is_signalled() {
                return Stop::CODE;
            }
            if graph.is_stale() {
                graph.settle();
                break;
            }
            inputs.settle();
            is_due = true;
        }
    }
}

/// A run that ends early when what it is made of is another.
fn render_until(args: &RunArgs, engine: &Engine, work: &Work, stop: &Stop, is_stale: &(dyn Fn() -> bool + Sync)) {
    let cancel = stop.next();
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !is_over.load(Ordering::Relaxed) && !cancel.is_cancelled() {
                if is_stale() {
                    cancel.cancel();
                }
                std::thread::sleep(PAUSE);
            }
        });
        render(args, engine, work, cancel.clone());
        is_over.store(true, Ordering::Relaxed);
    });
}

fn inputs(plan: &Plan) -> impl Iterator<Item = PathBuf> + '_ {
    plan.files().filter(|(access, _)| *access == Access::Read).map(|(_, path)| path)
}

/// Files as they were when they were looked at.
struct Look(Vec<(PathBuf, Option<Stat>)>);

impl Look {
    fn at(files: impl IntoIterator<Item = PathBuf>) -> Self {
        Self(files.into_iter().map(|file| (file.clone(), Disk.stat(&file).ok())).collect())
    }

    fn is_stale(&self) -> bool {
        self.0.iter().any(|(file, stat)| Disk.stat(file).ok() != *stat)
    }

    /// Waits until nobody writes any more.
    fn settle(&self) {
        loop {
            let now = Self::at(self.0.iter().map(|(file, _)| file.clone()));
            std::thread::sleep(PAUSE);
            if !now.is_stale() {
                return;
            }
        }
    }
}
