//! A node that is told to stop does so soon.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use tempfile::TempDir;
use warploom_core::engine::{Cancel, Engine, Event, Observer};

use crate::scene::{Case, cases, engine, run};
use crate::serial;

/// Ten times what is promised: a time in a test only catches hangs. What a library does in one call that cannot be
/// entered (a block of an EXR, a JPEG's decoding, the solver's phases) is short enough at this size.
const LIMIT: Duration = Duration::from_secs(1);
const SIZE: [u32; 2] = [1280, 720];

/// Tells when `it` begins, and whether it ends.
#[derive(Default)]
struct Progress {
    begun: OnceLock<()>,
    ended: OnceLock<()>,
}

impl Observer for Progress {
    fn event(&self, event: Event<'_>) {
        let what = match event {
            Event::Started { node: "it", .. } => &self.begun,
            Event::Finished { node: "it", .. } => &self.ended,
            _ => return,
        };
        what.get_or_init(|| ());
    }
}

/// How long a run goes on that is told to stop `after` its node began; none if the node was done before.
fn latency(folder: &TempDir, engine: &Engine, case: &Case, after: Duration) -> Option<Duration> {
    let (progress, cancel) = (Progress::default(), Cancel::default());
    let stopped = std::thread::scope(|scope| {
        let stopper = scope.spawn(|| {
            progress.begun.wait();
            std::thread::sleep(after);
            cancel.cancel();
            Instant::now()
        });
        let report = run(folder, engine, &case.text, SIZE, &progress, cancel.clone());
        let ended = Instant::now();
        // Nobody waits for a node that never began.
        progress.begun.get_or_init(|| ());
        assert!(report.faults.is_empty(), "{}: {:#?}", case.text, report.faults);
        stopper.join().map(|stopped| ended.saturating_duration_since(stopped)).expect("it does not panic")
    });
    progress.ended.get().is_none().then_some(stopped)
}

#[test]
fn every_node_stops_when_told_to() {
    let _serial = serial();
    let (mut problems, mut stopped) = (Vec::new(), 0);
    for case in cases() {
        let (folder, engine) = (tempfile::tempdir().expect("a folder"), engine(1));
        if let Some(before) = &case.before {
            run(&folder, &engine, before, SIZE, &(), Cancel::default());
        }
        // Later and later, until the node is done before it is told.
        let delays = [1, 64].map(Duration::from_millis).into_iter();
        let latencies =
            delays.map_while(|after| latency(&folder, &engine, &case, after).map(|latency| (latency, after)));
        let Some((worst, after)) = latencies.max() else { continue };
        let line = format!("{worst:7.0?} after {after:.0?} {} {:?}", case.text, case.before);
        println!("{line}");
        stopped += 1;
        problems.extend((worst > LIMIT).then_some(line));
    }
    assert!(problems.is_empty(), "\n{}", problems.join("\n"));
    assert!(stopped > cases().len() / 2, "{stopped} nodes were at work when they were told to stop");
}
