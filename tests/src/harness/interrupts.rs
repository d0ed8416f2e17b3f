//! Runs that are stopped by SIGINT and SIGTERM at random moments, and finished by another run.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::{Duration, Instant};

use super::place::{Place, signal, wait};
use super::{Outcome, max, median};
use crate::Random;

const FRAMES: &str = "1-30";

const SHOT: &str = r#"
    "card":   Checker(size: (256, 160), cell: 16.0),
    "ramp":   Ramp(size: (256, 160), to: (256.0, 160.0), last: (0.2, 0.6, 0.4, 1.0)),
    "grid":   Lattice(domain: "card", cell: 8.0),
    "bend":   Arc(grid: "grid", angle: Keys([(1, 5.0), (30, 90.0)])),
    "warped": Resample(image: "card", warp: "bend"),
    "both":   Over(images: ["warped", "ramp"]),
    "exr":    Save(image: "both", path: "out/exr.####.exr"),
    "png":    Save(image: "both", path: "out/png.####.png"),"#;

/// What the file of a sink at a frame is called.
fn file_name(sink: &str, frame: i64) -> String {
    format!("{sink}.{frame:04}.{sink}")
}

/// From a signal to the end of the process.
const LIMIT: f64 = 2.0;

/// How a run is stopped.
#[derive(Clone, Copy)]
struct Stop {
    signal: &'static str,
    after: f64,
    twice: bool,
}

#[derive(Default)]
struct Tally {
    outcome: Outcome,
    /// Seconds from a signal to the end, and from two of them.
    once: Vec<f64>,
    twice: Vec<f64>,
    finished: usize,
    before_handler: usize,
    reruns_stopped: usize,
}

/// Stops `count` runs of a shot, and finishes each.
pub fn interrupts(binary: &Path, count: usize) -> Outcome {
    let (first, again) = (whole(binary), whole(binary));
    assert!(first.0.len() == 60 && first.0 == again.0, "whole runs agree");
    let (reference, seconds) = (first.0, first.1.min(again.1));

    let (mut random, mut tally) = (Random(11), Tally::default());
    for _ in 0..count {
        round(binary, &mut random, seconds, &reference, &mut tally);
    }
    let Tally { mut outcome, once, twice, finished, before_handler, reruns_stopped } = tally;
    let milliseconds = |seconds: f64| seconds * 1e3;
    outcome.figures.push(format!(
        "interrupts: {count} shots, {} stops ({finished} came after the last frame, {before_handler} before the first \
        handler, {reruns_stopped} were second runs); signal to exit: median {:.0} ms, max {:.0} ms; \
        {} stops by two signals: median {:.0} ms, max {:.0} ms; {} violations",
        once.len() + twice.len(),
        milliseconds(median(&once)),
        milliseconds(max(&once)),
        twice.len(),
        milliseconds(median(&twice)),
        milliseconds(max(&twice)),
        outcome.violations.len(),
    ));
    outcome
}

/// Outputs of a run that nobody stops, and its seconds.
fn whole(binary: &Path) -> (BTreeMap<String, Vec<u8>>, f64) {
    let place = Place::new(binary);
    place.shot("shot.ron", FRAMES, SHOT);
    let (code, seconds) = place.run("run shot.ron --threads 2 --progress none");
    assert_eq!(code, Some(0), "{}", place.stderr());
    (place.outputs(), seconds)
}

fn round(binary: &Path, random: &mut Random, seconds: f64, reference: &BTreeMap<String, Vec<u8>>, tally: &mut Tally) {
    let place = Place::new(binary);
    place.shot("shot.ron", FRAMES, SHOT);
    let (threads, store) = (*random.pick(&[1, 2, 3, 8]), *random.pick(&["auto", "all"]));
    let line = format!("run shot.ron --threads {threads} --store {store} --progress none --report report.json");
    let stop_count = 1 + usize::from(random.below(4) == 0);
    tally.reruns_stopped += stop_count - 1;
    let mut all_gentle = true;
    for at in 0..stop_count {
        let signal = *random.pick(&["INT", "TERM"]);
        let stop = Stop {
            signal,
            // The second run has less to do.
            after: random.between(0.0, if at == 0 { 1.0 } else { 0.5 }) * seconds,
            twice: random.below(4) == 0,
        };
        all_gentle &= stopped(&place, &line, stop, reference, tally);
    }
    finish(&place, &line, all_gentle, reference, &mut tally.outcome);
}

/// Starts a run and stops it; whether it had time to tidy up.
fn stopped(place: &Place, line: &str, stop: Stop, reference: &BTreeMap<String, Vec<u8>>, tally: &mut Tally) -> bool {
    let (before, old) = (place.outputs().len(), place.temporaries());
    let mut child = place.command(line).spawn().expect("the binary starts");
    std::thread::sleep(Duration::from_secs_f64(stop.after));
    let start = Instant::now();
    for _ in 0..1 + usize::from(stop.twice) {
        signal(&child, stop.signal);
    }
    let code = wait(&mut child, || {});
    let seconds = start.elapsed().as_secs_f64();
    let outputs = place.outputs();
    let at = || format!("SIG{} after {:.3} s of `{line}`", stop.signal, stop.after);
    match code {
        Some(75) if stop.twice => tally.twice.push(seconds),
        Some(75) => tally.once.push(seconds),
        Some(0) => tally.finished += 1,
        // Until the handler is there the system ends the process; nothing has been written by then.
        None if outputs.len() == before => tally.before_handler += 1,
        _ => tally.outcome.violations.push(format!("{}: exit code {code:?}: {}", at(), place.stderr())),
    }
    tally.outcome.check(seconds <= LIMIT, || format!("{}: ended {seconds:.2} s later", at()));
    for (name, bytes) in &outputs {
        tally.outcome.check(reference.get(name) == Some(bytes), || format!("{}: {name} is torn", at()));
    }
    let left: Vec<String> = place.temporaries().into_iter().filter(|name| !old.contains(name)).collect();
    tally.outcome.check(stop.twice || left.is_empty(), || format!("{}: left {left:?}", at()));
    !stop.twice
}

/// Runs to the end what was stopped: just the missing files are written.
fn finish(place: &Place, line: &str, all_gentle: bool, reference: &BTreeMap<String, Vec<u8>>, outcome: &mut Outcome) {
    let there = place.outputs();
    let missing: BTreeSet<&String> = reference.keys().filter(|name| !there.contains_key(*name)).collect();
    let (code, _) = place.run(line);
    outcome.check(code == Some(0), || format!("exit code {code:?} of a second `{line}`: {}", place.stderr()));
    let report = place.report("report.json");
    let sinks = report["nodes"].as_array().into_iter().flatten().filter(|pair| pair["status"] == "executed");
    let written: Vec<String> = sinks
        .filter_map(|pair| Some(file_name(pair["node"].as_str()?, pair["frame"].as_i64()?)))
        .filter(|name| reference.contains_key(name))
        .collect();
    let written: BTreeSet<&String> = written.iter().collect();
    // Who is ended at once may have written a file and not yet noted it.
    let as_expected = if all_gentle { written == missing } else { written.is_superset(&missing) };
    outcome.check(as_expected, || format!("a second `{line}` wrote {written:?}, missing were {missing:?}"));
    outcome.check(place.outputs() == *reference, || format!("outputs of a second `{line}` differ"));
    let temporaries = place.temporaries();
    outcome.check(temporaries.is_empty(), || format!("a second `{line}` leaves {temporaries:?}"));
}
