//! How a run is shown while it goes on.

use std::collections::HashMap;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::{Value as Json, json};
use warploom_core::diag::Fault;
use warploom_core::engine::{Event, Observer, Report, Status};

use crate::args::Progress;
use crate::terminal::{counted, note, rendered, say, show};

/// Shows events in one dialect.
pub struct Display {
    dialect: Progress,
    bar: ProgressBar,
    frames: AtomicUsize,
    frames_done: AtomicUsize,
    pairs: AtomicUsize,
    pairs_done: AtomicUsize,
    /// The last that was shown.
    percent: Mutex<Option<usize>>,
    warned: Mutex<Warned>,
}

/// Warnings so far: a film's nodes warn in every frame, and the first frame's is enough.
#[derive(Default)]
struct Warned {
    /// The frame of each node's that were shown.
    shown: HashMap<String, Option<i64>>,
    left_out: usize,
}

impl Display {
    pub fn new(dialect: Progress) -> Self {
        let dialect = match dialect {
            Progress::Auto if std::io::stderr().is_terminal() => Progress::Human,
            Progress::Auto => Progress::Plain,
            given => given,
        };
        let target = match dialect {
            Progress::Human => ProgressDrawTarget::stderr(),
            _ => ProgressDrawTarget::hidden(),
        };
        let bar = ProgressBar::with_draw_target(Some(1), target);
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} frames  {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        if dialect == Progress::Human {
            bar.enable_steady_tick(Duration::from_millis(100));
        }
        let count = || AtomicUsize::new(0);
        Self {
            dialect,
            bar,
            frames: count(),
            frames_done: count(),
            pairs: count(),
            pairs_done: count(),
            percent: Mutex::new(None),
            warned: Mutex::default(),
        }
    }

    /// What is told at the end: for people a line about the whole run and how many warnings were left out, for farms
    /// that all is done.
    pub fn summary(&self, report: &Report) {
        self.bar.finish_and_clear();
        if report.faults.is_empty() && !report.cancelled {
            // Pairs above files that stay are never asked for.
            self.percent(100);
        }
        let left_out = self.warned().left_out;
        if left_out > 0 {
            let warnings = counted(left_out, "warning");
            note(&format!("{warnings} more of the same nodes at other frames; --report FILE lists all"));
        }
        if !matches!(self.dialect, Progress::Human | Progress::Plain) {
            return;
        }
        let count = |status: Status| report.nodes.iter().filter(|pair| pair.status == status).count();
        let mut parts =
            vec![format!("{} executed", count(Status::Executed)), format!("{} reused", count(Status::Reused))];
        for (status, word) in
            [(Status::Recomputed, "recomputed"), (Status::Failed, "failed"), (Status::Skipped, "skipped")]
        {
            if count(status) > 0 {
                parts.push(format!("{} {word}", count(status)));
            }
        }
        let stopped = if report.cancelled { "stopped: " } else { "" };
        note(&format!("{stopped}{} in {:.2} s", parts.join(", "), report.seconds));
    }

    /// Says that a file beside the graph's own was written.
    pub fn wrote(&self, path: &Path) {
        match self.dialect {
            Progress::Jsonl => say(&json!({ "event": "dump", "path": path }).to_string()),
            _ => self.bar.suspend(|| say(&path.display().to_string())),
        }
    }

    /// Percent of the pairs that are done.
    fn part_done(&self) -> usize {
        let (done, all) = (self.pairs_done.load(Ordering::Relaxed), self.pairs.load(Ordering::Relaxed).max(1));
        (100 * done / all).min(100)
    }

    /// Tells a farm how far the run is, once per percent. Farms look for these lines on standard output.
    fn percent(&self, percent: usize) {
        let mut shown = self.percent.lock().unwrap_or_else(PoisonError::into_inner);
        if shown.is_none_or(|shown| percent > shown) {
            *shown = Some(percent);
            match self.dialect {
                Progress::Openjd => say(&format!("openjd_progress: {percent}")),
                Progress::Percent => say(&format!("Progress: {percent}%")),
                _ => {}
            }
        }
    }

    fn warned(&self) -> MutexGuard<'_, Warned> {
        self.warned.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn warn(&self, warning: &Fault) {
        if self.dialect == Progress::None {
            return;
        }
        let mut warned = self.warned();
        let node = warning.node.clone().unwrap_or_default();
        match *warned.shown.entry(node).or_insert(warning.frame) == warning.frame {
            true => self.bar.suspend(|| show(warning, true)),
            false => warned.left_out += 1,
        }
    }

    fn frame_done(&self, frame: Option<i64>, delivered: bool) {
        let done = self.frames_done.fetch_add(1, Ordering::Relaxed) + 1;
        self.bar.inc(1);
        let all = self.frames.load(Ordering::Relaxed);
        if let (Progress::Plain, Some(frame)) = (self.dialect, frame) {
            let what = if delivered { "done" } else { "failed" };
            note(&format!("frame {frame} {what} ({done} of {all})"));
        }
    }
}

impl Observer for Display {
    fn event(&self, event: Event<'_>) {
        if self.dialect == Progress::Jsonl {
            say(&json_event(&event).to_string());
        }
        match event {
            Event::Begun { frames, pairs } => {
                self.frames.store(frames, Ordering::Relaxed);
                self.pairs.store(pairs, Ordering::Relaxed);
                self.bar.set_length(frames as u64);
                self.percent(self.part_done());
            }
            Event::Started { node, frame } => match (self.dialect, frame) {
                (Progress::Human, Some(frame)) => self.bar.set_message(format!("{node} (frame {frame})")),
                (Progress::Human, None) => self.bar.set_message(node.to_owned()),
                (Progress::Openjd, Some(frame)) => say(&format!("openjd_status: {node} (frame {frame})")),
                (Progress::Openjd, None) => say(&format!("openjd_status: {node}")),
                _ => {}
            },
            Event::Progress { node, part, .. } => {
                if self.dialect == Progress::Human {
                    self.bar.set_message(format!("{node} {:.0} %", part * 100.0));
                }
            }
            Event::Finished { status, .. } => {
                if status != Status::Recomputed {
                    self.pairs_done.fetch_add(1, Ordering::Relaxed);
                }
                self.percent(self.part_done());
            }
            Event::Output { path, .. } => {
                if self.dialect != Progress::Jsonl {
                    self.bar.suspend(|| say(&path.display().to_string()));
                }
            }
            Event::Fault(fault) => {
                if self.dialect == Progress::Openjd {
                    let of = fault.node.iter().map(|node| format!("{node}: ")).collect::<String>();
                    let at = fault.frame.map_or(String::new(), |frame| format!("frame {frame}: "));
                    say(&format!("openjd_fail: {}", one_line(&format!("{at}{of}{}", fault.message))));
                }
                self.bar.suspend(|| note(&rendered(fault, false)));
            }
            Event::Warning(warning) => self.warn(warning),
            Event::FrameDone { frame, delivered } => self.frame_done(frame, delivered),
        }
    }
}

/// The text with spaces for whatever a reader may take for the end of a line.
fn one_line(text: &str) -> String {
    text.replace(|c: char| c.is_control() || matches!(c, '\u{2028}' | '\u{2029}'), " ")
}

fn json_event(event: &Event<'_>) -> Json {
    match event {
        Event::Begun { frames, pairs } => json!({ "event": "begun", "frames": frames, "pairs": pairs }),
        Event::Started { node, frame } => json!({ "event": "started", "node": node, "frame": frame }),
        Event::Progress { node, frame, part } => {
            json!({ "event": "progress", "node": node, "frame": frame, "part": part })
        }
        Event::Finished { node, frame, status, seconds } => {
            json!({ "event": "finished", "node": node, "frame": frame, "status": status, "seconds": seconds })
        }
        Event::Output { path, bytes, blake3, written } => json!({
            "event": "output", "path": path, "bytes": bytes, "blake3": blake3, "written": written,
        }),
        Event::Fault(fault) => json!({ "event": "fault", "fault": fault }),
        Event::Warning(warning) => json!({ "event": "warning", "warning": warning }),
        Event::FrameDone { frame, delivered } => {
            json!({ "event": "frame_done", "frame": frame, "delivered": delivered })
        }
    }
}
