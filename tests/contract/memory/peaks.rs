//! A node asks for what it allocates at its peak, no less and not much more.

use std::sync::atomic::{AtomicUsize, Ordering};

use warploom_core::engine::{Cancel, Event, Observer};
use warploom_core::value::cut_shelf;
use warploom_nodes::NODES;

use crate::scene::{Case, cases, engine, run, type_of};
use crate::{HEAP, serial};

/// Small change: rows, tables, stacks.
const SPARE: usize = 2_000_000;
/// Bytes that a node may ask for and not take: so few hold nothing up.
const EXCESS: usize = 8_000_000;

/// The peak of the heap while `it` computes, over what it was before.
#[derive(Default)]
struct Peak {
    before: AtomicUsize,
    bytes: AtomicUsize,
}

impl Observer for Peak {
    fn event(&self, event: Event<'_>) {
        match event {
            Event::Started { node: "it", .. } => {
                // Planes that are recycled are not seen, nor are those that others are given back for.
                cut_shelf(0);
                HEAP.reset_peak_usage();
                self.before.store(HEAP.current_usage(), Ordering::Relaxed);
            }
            Event::Finished { node: "it", .. } => {
                let bytes = HEAP.peak_usage() - self.before.load(Ordering::Relaxed);
                self.bytes.store(bytes, Ordering::Relaxed);
            }
            _ => {}
        }
    }
}

/// Bytes that the case's node took and asked for.
fn measure(case: &Case, threads: usize, size: [u32; 2]) -> (usize, usize) {
    let (folder, engine, peak) = (tempfile::tempdir().expect("a folder"), engine(threads), Peak::default());
    if let Some(before) = &case.before {
        let report = run(&folder, &engine, before, size, &(), Cancel::default());
        assert!(report.faults.is_empty(), "{before}: {:#?}", report.faults);
    }
    let report = run(&folder, &engine, &case.text, size, &peak, Cancel::default());
    let pair = report.nodes.iter().find(|pair| &*pair.node == "it").expect("it is in the graph");
    assert!(report.faults.is_empty(), "{}: {:#?}", case.text, report.faults);
    (peak.bytes.into_inner(), pair.peak_bytes as usize)
}

#[test]
fn every_node_asks_for_the_memory_it_takes() {
    let _serial = serial();
    let cases = cases();
    for (name, _) in NODES {
        assert!(cases.iter().any(|case| type_of(case) == *name), "{name} is not tried");
    }
    let mut problems = Vec::new();
    // Cases take turns in threads; a whole round is slow without all optimisations.
    let threads = |at: usize| if cfg!(debug_assertions) { vec![[1, 3][at % 2]] } else { vec![1, 3] };
    let tries = cases.iter().enumerate().flat_map(|(at, case)| threads(at).into_iter().map(move |count| (case, count)));
    for (number, (case, threads)) in tries.enumerate() {
        let (taken, asked) = measure(case, threads, [1296, 800 + number as u32]);
        let verdict = match () {
            () if taken > asked + asked / 10 + SPARE => "takes more than it asks for",
            () if asked > taken + taken / 2 + EXCESS => "asks for much more than it takes",
            () => "",
        };
        let [taken, asked] = [taken, asked].map(|bytes| bytes as f64 / 1e6);
        let before = case.before.as_deref().unwrap_or_default();
        let line = format!("{taken:8.1} MB of {asked:8.1}, {threads} threads, {} {before} {verdict}", case.text);
        println!("{line}");
        problems.extend((!verdict.is_empty()).then_some(line));
    }
    assert!(problems.is_empty(), "\n{}", problems.join("\n"));
}
