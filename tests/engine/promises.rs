//! The promises one by one, where the random edits cannot reach or should be seen alone.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use warploom_core::diag::Code;
use warploom_core::engine::{
    Cancel, Engine, Event, From, Job, Observer, PairReport, Reason, Report, Settings, Stat, Status, StorePolicy,
};
use warploom_core::graph::{Options, check};
use warploom_core::registry::Registry;

use warploom_tests::io::{Meddled, Meddler, Op};

use crate::nodes::{COMPUTED, NODES};
use crate::random::plan;

/// A folder for a graph and its files; one at a time, because computations are counted.
struct Bench {
    folder: tempfile::TempDir,
    registry: Registry,
    _serial: std::sync::MutexGuard<'static, ()>,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        Self { folder, registry: Registry::new(NODES), _serial: crate::serial() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, engine: &Engine, nodes: &str) -> Report {
        self.run_job(engine, nodes, &Job::default())
    }

    fn run_job(&self, engine: &Engine, nodes: &str, job: &Job) -> Report {
        let text = format!("Graph(version: 1, frames: \"1-4\", nodes: {{\n{nodes}\n}})");
        engine.run(&plan(&text, self.folder.path(), &self.registry), job)
    }
}

fn engine(memory: u64) -> Engine {
    Engine::new(Settings { threads: 3, memory, ..Settings::default() })
}

const ROOMY: u64 = 1 << 30;

fn pair<'a>(report: &'a Report, node: &str, frame: Option<i64>) -> &'a PairReport {
    let found = report.nodes.iter().find(|pair| &*pair.node == node && pair.frame == frame);
    found.unwrap_or_else(|| panic!("no pair {node} at {frame:?}"))
}

fn executed(report: &Report) -> Vec<String> {
    let mut names: Vec<String> = (report.nodes.iter())
        .filter(|pair| pair.status == Status::Executed)
        .map(|pair| pair.frame.map_or(pair.node.to_string(), |frame| format!("{}@{frame}", pair.node)))
        .collect();
    names.sort();
    names
}

#[test]
fn an_equal_output_stops_what_a_change_started() {
    let (bench, engine) = (Bench::new(), engine(ROOMY));
    let graph = |value: f64| {
        format!(
            r#""a": Const(value: {value:?}), "b": Step(of: "a", at: 1.0), "c": Scale(of: "b", by: 3.0),
            "out": Write(of: "c", path: "out.#.txt")"#
        )
    };
    bench.run(&engine, &graph(2.0));
    assert_eq!(executed(&bench.run(&engine, &graph(5.0))), ["a", "b"]);
    assert_eq!(executed(&bench.run(&engine, &graph(0.5))), ["a", "b", "c", "out@1", "out@2", "out@3", "out@4"]);
}

#[test]
fn a_static_branch_runs_once_for_a_sequence() {
    let (bench, engine) = (Bench::new(), engine(ROOMY));
    let report = bench.run(
        &engine,
        r#""still": Const(value: 2.0), "twice": Scale(of: "still", by: 2.0),
        "moving": Frame(), "both": Sum(terms: ["twice", "moving"]), "out": Write(of: "both", path: "out.#.txt")"#,
    );
    assert_eq!(pair(&report, "twice", None).status, Status::Executed);
    assert_eq!(report.nodes.len(), 2 + 3 * 4);
}

#[test]
fn a_port_that_reads_one_channel_does_not_run_for_another() {
    let (bench, engine) = (Bench::new(), engine(ROOMY));
    let graph = |a: f64, b: f64, width: u32| {
        format!(
            r#""p": Picture(a: {a:?}, b: {b:?}, width: {width}), "pick": PickA(image: "p"), "size": Size(domain: "p"),
            "both": Sum(terms: ["pick", "size"]), "out": Write(of: "both", path: "out.#.txt")"#
        )
    };
    bench.run(&engine, &graph(1.0, 1.0, 1));
    assert_eq!(executed(&bench.run(&engine, &graph(1.0, 2.0, 1))), ["p"], "channel B is nobody's concern");
    let report = bench.run(&engine, &graph(3.0, 2.0, 1));
    assert_eq!(executed(&report)[..3], ["both", "out@1", "out@2"], "and the size is the same");
    assert_eq!(pair(&report, "size", None).status, Status::Reused);
}

#[test]
fn a_node_that_heeds_it_makes_what_is_wanted_and_no_more() {
    let (bench, engine) = (Bench::new(), engine(ROOMY));
    let graph = |a: f64, readers: &str| {
        let terms: Vec<&str> = readers.split(' ').collect();
        format!(
            r#""p": Plate(a: {a:?}, b: 2.0, width: 3), "size": Size(domain: "p"), "pick": PickA(image: "p"),
            "both": Both(image: "p"), "sum": Sum(terms: {terms:?}), "out": Write(of: "sum", path: "out.txt")"#
        )
    };
    let made = |report: &Report| pair(report, "p", None).stats["made"].clone();
    let report = bench.run(&engine, &graph(1.0, "size"));
    assert_eq!((made(&report), pair(&report, "p", None).bytes), ("".into(), 0), "windows are no plane");
    let report = bench.run(&engine, &graph(1.0, "size pick"));
    assert_eq!(
        (executed(&report), made(&report)),
        (vec!["out".into(), "p".into(), "pick".into(), "sum".into()], "A".into())
    );
    let why = pair(&report, "p", None).why.clone().expect("a reason");
    assert_eq!((why.code, why.node.as_str()), (Reason::Wanted, "p"));
    assert_eq!((why.old, why.new), (Some("windows".into()), Some("channels A".into())));
    assert_eq!(pair(&report, "size", None).status, Status::Reused, "what it looks at is as it was");
    let report = bench.run(&engine, &graph(1.0, "size pick both"));
    assert_eq!(
        (executed(&report), made(&report)),
        (vec!["both".into(), "out".into(), "p".into(), "sum".into()], "AB".into())
    );
    // Fewer readers, and other orders of them, are known already.
    assert_eq!(executed(&bench.run(&engine, &graph(1.0, "pick size"))), ["out", "sum"]);
    let report = bench.run(&engine, &graph(3.0, "size"));
    assert_eq!(executed(&report), ["out", "p"], "nothing looks at a; and the file holds the sum before");
}

#[test]
fn a_target_is_wanted_whole() {
    let (bench, engine) = (Bench::new(), engine(ROOMY));
    let text = r#"Graph(version: 1, nodes: { "p": Plate(a: 1.0, b: 2.0), "size": Size(domain: "p") })"#;
    let file = bench.path("graph.ron");
    let made = |targets: &[&str]| {
        let targets: Vec<String> = targets.iter().map(|target| target.to_string()).collect();
        let checked = check(text, &bench.registry, &Options { targets: &targets, ..Options::new(&file) });
        let report = engine.run(&Arc::new(checked.plan.expect("a plan")), &Job::default());
        pair(&report, "p", None).stats["made"].clone()
    };
    assert_eq!((made(&["size"]), made(&["p"]), made(&["p", "size"])), ("".into(), "AB".into(), "AB".into()));
}

#[test]
fn two_runs_that_want_one_value_compute_it_once() {
    let (bench, engine) = (Bench::new(), engine(ROOMY));
    let before = COMPUTED.load(Ordering::Relaxed);
    let graph = |name: &str| {
        format!(
            r#""a": Const(value: 1.0), "{name}": Slow(of: "a", milliseconds: 60), "twin": Slow(of: "a", milliseconds: 60),
            "sum": Sum(terms: ["{name}", "twin"]), "out": Write(of: "sum", path: "{name}.#.txt")"#
        )
    };
    let reports = std::thread::scope(|scope| {
        let runs = ["x", "y", "z"].map(|name| {
            scope.spawn({
                let (bench, engine) = (&bench, &engine);
                move || bench.run(engine, &graph(name))
            })
        });
        runs.map(|run| run.join().expect("no panic"))
    });
    assert!(reports.iter().all(|report| report.faults.is_empty()));
    let slow =
        reports.iter().flat_map(|r| &r.nodes).filter(|p| &*p.node_type == "Slow" && p.status == Status::Executed);
    assert_eq!(slow.count(), 1, "six pairs want one value");
    // Const, Slow, Sum once; each run writes its own four files.
    assert_eq!(COMPUTED.load(Ordering::Relaxed) - before, 3 + 3 * 4);
}

#[test]
fn a_panicking_node_is_a_fault_and_its_siblings_finish() {
    let (bench, engine) = (Bench::new(), engine(ROOMY));
    let graph = r#""f": Frame(), "bad": Panic(of: "f", message: "boom"), "out": Write(of: "bad", path: "bad.#.txt"),
        "fine": Scale(of: "f", by: 2.0), "other": Write(of: "fine", path: "fine.#.txt")"#;
    let report = bench.run_job(&engine, graph, &Job { keep_going: true, ..Job::default() });
    let [fault] = &report.faults[..] else { panic!("{:#?}", report.faults) };
    assert_eq!((fault.code, fault.node.as_deref(), fault.frame), (Code::Panic, Some("bad"), Some(3)));
    assert!(fault.message.contains("boom") && fault.place.is_some(), "{}", fault.message);
    assert_eq!(pair(&report, "out", Some(3)).status, Status::Skipped);
    assert_eq!(report.frames_delivered, 3);
    for frame in 1..=4 {
        assert_eq!(pair(&report, "other", Some(frame)).status, Status::Executed);
        assert_eq!(bench.path(&format!("bad.{frame}.txt")).exists(), frame != 3);
    }
    let again = bench.run(&engine, graph);
    assert_eq!(executed(&again), Vec::<String>::new(), "what failed is tried again, what did not is known");
    assert_eq!(again.faults.len(), 1);
}

#[test]
fn without_keep_going_no_new_frame_starts_after_a_fault() {
    let bench = Bench::new();
    let engine = Engine::new(Settings { threads: 1, memory: ROOMY, ..Settings::default() });
    let report =
        bench.run(&engine, r#""f": Frame(), "bad": Panic(of: "f"), "out": Write(of: "bad", path: "bad.#.txt")"#);
    assert_eq!(report.frames_delivered, 2);
    assert!(report.nodes.iter().filter(|pair| pair.frame == Some(4)).all(|pair| pair.status == Status::Skipped));
}

#[test]
fn what_was_not_kept_is_recomputed_and_must_come_out_the_same() {
    let bench = Bench::new();
    let graph = |source: &str, by: f64| {
        format!(r#""a": {source}, "b": Scale(of: "a", by: {by:?}), "out": Write(of: "b", path: "out.#.txt")"#)
    };
    let honest = engine(16);
    bench.run(&honest, &graph("Frame()", 0.125));
    // No value of one node is one of another's, which would do for it.
    let report = bench.run(&honest, &graph("Frame()", 2.25));
    let recomputed = pair(&report, "a", Some(2));
    assert_eq!((recomputed.status, recomputed.from), (Status::Recomputed, None));
    assert_eq!(recomputed.why.as_ref().map(|why| why.code), Some(Reason::NotKept));
    assert_eq!(executed(&report).len(), 8, "b and out for each frame, and no more");

    let drifting = engine(0);
    bench.run(&drifting, &graph("Drift()", 1.0));
    let report = bench.run(&drifting, &graph("Drift()", 2.0));
    assert!(
        report.faults.iter().any(|fault| fault.code == Code::Nondeterministic && fault.node.as_deref() == Some("a"))
    );
}

#[test]
fn the_reasons_name_what_changed() {
    let (bench, engine) = (Bench::new(), engine(ROOMY));
    std::fs::write(bench.path("in.txt"), "4.0").expect("written");
    let graph = |by: f64, input: &str| {
        format!(
            r#""file": Read(path: "in.txt"), "other": Const(value: 4.5),
            "b": Scale(of: "{input}", by: {by:?}),
            "c": Sum(terms: ["b"]), "out": Write(of: "c", path: "out.#.txt")"#
        )
    };
    let first = bench.run(&engine, &graph(2.0, "file"));
    assert_eq!(pair(&first, "c", None).why.as_ref().map(|why| why.code), Some(Reason::FirstRun));

    let report = bench.run(&engine, &graph(3.0, "file"));
    for (node, frame) in [("b", None), ("c", None), ("out", Some(4))] {
        let why = pair(&report, node, frame).why.clone().expect("a reason");
        assert_eq!((why.code, why.node.as_str(), why.param.as_deref()), (Reason::Param, "b", Some("by")));
        assert_eq!((why.old, why.new), (Some(2.0.into()), Some(3.0.into())));
        let at = why.at.expect("a place");
        assert!(at.ends_with("graph.ron:3:40"), "{at}");
    }

    std::fs::write(bench.path("in.txt"), "5.0").expect("written");
    let report = bench.run(&engine, &graph(3.0, "file"));
    let why = pair(&report, "out", Some(1)).why.clone().expect("a reason");
    assert_eq!((why.code, why.node.as_str(), why.param.as_deref()), (Reason::File, "file", Some("path")));

    let why =
        bench.run(&engine, &graph(3.0, "other")).nodes.iter().find(|p| &*p.node == "c").and_then(|p| p.why.clone());
    let why = why.expect("a reason");
    assert_eq!((why.code, why.node.as_str()), (Reason::Input, "b"));
    assert_eq!((why.old, why.new), (Some("file.number".into()), Some("other.number".into())));

    std::fs::remove_file(bench.path("out.2.txt")).expect("removed");
    std::fs::write(bench.path("out.3.txt"), "mine").expect("written");
    let report = bench.run(&engine, &graph(3.0, "other"));
    assert_eq!(executed(&report), ["out@2", "out@3"]);
    let code = |frame| pair(&report, "out", Some(frame)).why.as_ref().map(|why| why.code);
    assert_eq!((code(2), code(3)), (Some(Reason::OutputMissing), Some(Reason::OutputChanged)));
    assert_eq!(pair(&report, "out", Some(1)).from, Some(From::File));
}

/// Cancels at the first progress, and counts what happens after.
struct CancelAtProgress {
    cancel: Cancel,
    started_after: AtomicU64,
}

impl Observer for CancelAtProgress {
    fn event(&self, event: Event<'_>) {
        match event {
            Event::Progress { .. } => self.cancel.cancel(),
            Event::Started { .. } if self.cancel.is_cancelled() => {
                self.started_after.fetch_add(1, Ordering::Relaxed);
            }
            _ => {}
        }
    }
}

#[test]
fn a_cancel_reaches_into_a_long_node_and_the_rest_can_be_done_later() {
    let (bench, engine) = (Bench::new(), engine(ROOMY));
    let graph =
        r#""f": Frame(), "slow": Slow(of: "f", milliseconds: 60000), "out": Write(of: "slow", path: "out.#.txt")"#;
    let cancel = Cancel::default();
    let observer = CancelAtProgress { cancel: cancel.clone(), started_after: AtomicU64::new(0) };
    let report = bench.run_job(&engine, graph, &Job { observer: &observer, cancel, ..Job::default() });
    assert!(report.cancelled && report.faults.is_empty());
    let outs = report.nodes.iter().filter(|pair| &*pair.node == "out");
    assert!(outs.map(|pair| pair.status).eq([Status::Skipped; 4]), "nothing after the cancel");
    let quick = graph.replace("60000", "1");
    assert_eq!(bench.run(&engine, &quick).frames_delivered, 4);
}

/// A file system whose clock stands still: an overwritten file differs in nothing but its content.
struct FrozenClock(i128);

impl Meddler for FrozenClock {
    fn stat(&self, _: &Path, stat: Stat) -> Stat {
        Stat { size: stat.size, modified: self.0, changed: self.0, inode: 1, device: 1 }
    }
}

#[test]
fn a_file_overwritten_within_one_tick_of_the_clock_is_seen() {
    let bench = Bench::new();
    let now =
        std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970").as_nanos() as i128;
    let engine = Engine::new(Settings { io: Arc::new(Meddled::new(FrozenClock(now))), ..Settings::default() });
    let graph = r#""file": Read(path: "in.txt"), "out": Write(of: "file", path: "out.#.txt")"#;
    for value in ["1.5", "2.5", "3.5"] {
        std::fs::write(bench.path("in.txt"), value).expect("written");
        bench.run(&engine, graph);
        assert_eq!(std::fs::read_to_string(bench.path("out.1.txt")).expect("written"), value);
    }
}

/// Counts whole reads, and refuses writes when told to.
#[derive(Default)]
struct Watched {
    reads: Mutex<HashMap<PathBuf, u32>>,
    full: AtomicBool,
}

impl Meddler for Watched {
    fn before(&self, op: Op, path: &Path) -> io::Result<()> {
        if op == Op::Open {
            *self.reads.lock().expect("no panic").entry(path.to_owned()).or_default() += 1;
        }
        let is_full = self.full.load(Ordering::Relaxed) && path.to_string_lossy().contains("cache");
        if op == Op::Write && is_full { Err(io::ErrorKind::StorageFull.into()) } else { Ok(()) }
    }
}

const DISK_GRAPH: &str = r#""a": Frame(), "b": Scale(of: "a", by: 2.0), "c": Sum(terms: ["b"]),
    "out": Write(of: "c", path: "out.#.txt")"#;

fn disk_engine(bench: &Bench, io: Arc<Meddled<Watched>>) -> Engine {
    Engine::new(Settings { cache: Some(bench.path("cache")), store: StorePolicy::All, io, ..Settings::default() })
}

#[test]
fn another_process_finds_everything_on_disk() {
    let bench = Bench::new();
    let first = bench.run(&disk_engine(&bench, Arc::default()), DISK_GRAPH);
    assert_eq!(executed(&first).len(), 16);
    let second = bench.run(&disk_engine(&bench, Arc::default()), DISK_GRAPH);
    assert_eq!(executed(&second), Vec::<String>::new());
    assert!(second.nodes.iter().all(|pair| matches!(pair.from, Some(From::Record | From::File))));
    let changed = bench.run(&disk_engine(&bench, Arc::default()), &DISK_GRAPH.replace("2.0", "32.0"));
    assert_eq!(executed(&changed).len(), 12);
    assert_eq!(pair(&changed, "a", Some(1)).from, Some(From::Disk));
    let why = pair(&changed, "out", Some(2)).why.clone().expect("a reason");
    assert_eq!((why.code, why.node.as_str()), (Reason::Param, "b"), "the journal is on disk too");
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    files.sort();
    files
}

#[test]
fn a_damaged_cache_changes_no_result() {
    let bench = Bench::new();
    bench.run(&disk_engine(&bench, Arc::default()), DISK_GRAPH);
    let changed = DISK_GRAPH.replace("2.0", "4.0");
    let damages: [fn(Vec<u8>) -> Vec<u8>; 4] = [
        |_| Vec::new(),
        |bytes| bytes[..bytes.len() / 2].to_vec(),
        |mut bytes| {
            let middle = bytes.len() / 2;
            bytes.get_mut(middle).into_iter().for_each(|byte| *byte ^= 1);
            bytes
        },
        |bytes| [b"foreign".to_vec(), bytes].concat(),
    ];
    for damage in damages {
        for file in files_below(&bench.path("cache")) {
            let bytes = std::fs::read(&file).expect("readable");
            std::fs::write(&file, damage(bytes)).expect("writable");
        }
        for graph in [&changed, DISK_GRAPH] {
            let report = bench.run(&disk_engine(&bench, Arc::default()), graph);
            assert!(report.faults.is_empty(), "{:#?}", report.faults);
            let by = if graph == DISK_GRAPH { 2.0 } else { 4.0 };
            for frame in 1..=4 {
                let written = std::fs::read_to_string(bench.path(&format!("out.{frame}.txt"))).expect("written");
                assert_eq!(written, format!("{:?}", frame as f64 * by));
            }
        }
    }
}

#[test]
fn a_full_disk_costs_one_warning_and_nothing_else() {
    let bench = Bench::new();
    let io = Arc::new(Meddled::<Watched>::default());
    io.full.store(true, Ordering::Relaxed);
    let engine = disk_engine(&bench, io);
    let report = bench.run(&engine, DISK_GRAPH);
    assert!(report.faults.is_empty() && report.frames_delivered == 4);
    assert!(engine.take_cache_warning().is_some_and(|text| text.contains("cache")));
    assert_eq!(engine.take_cache_warning(), None);
}

#[test]
fn a_settled_file_is_not_read_again() {
    let bench = Bench::new();
    let input = bench.path("in.txt");
    std::fs::write(&input, "1.0").expect("written");
    let old = std::time::SystemTime::now() - std::time::Duration::from_secs(60);
    std::fs::File::options().write(true).open(&input).and_then(|file| file.set_modified(old)).expect("set");
    // The file was changed (its attributes) just now, so a memo made now proves nothing: settle first.
    let io = Arc::new(Meddled::<Watched>::default());
    let engine = Engine::new(Settings { io: io.clone(), ..Settings::default() });
    let graph = r#""file": Read(path: "in.txt"), "out": Write(of: "file", path: "out.#.txt")"#;
    bench.run(&engine, graph);
    let reads = |io: &Meddled<Watched>| io.reads.lock().expect("no panic")[&input];
    let unsettled = reads(&io);
    bench.run(&engine, graph);
    assert_eq!(reads(&io), unsettled + 1, "changed less than 2 s before: read again");
    std::thread::sleep(std::time::Duration::from_millis(2100));
    bench.run(&engine, graph);
    let settled = reads(&io);
    bench.run(&engine, graph);
    assert_eq!(reads(&io), settled, "known");
}

#[test]
fn a_chain_of_a_hundred_thousand_nodes_runs() {
    let bench = Bench::new();
    let mut text = String::from("Graph(version: 1, nodes: {\n\"n0\": Const(value: 1.0),\n");
    let last = 99_998;
    for node in 1..=last {
        text += &format!("\"n{node}\": Step(of: \"n{}\", at: 0.5),\n", node - 1);
    }
    text += &format!("\"out\": Write(of: \"n{last}\", path: \"out.txt\")\n}})");
    let plan = plan(&text, bench.folder.path(), &bench.registry);
    let report =
        std::thread::Builder::new().stack_size(2 << 20).spawn(move || engine(ROOMY).run(&plan, &Job::default()));
    let report = report.expect("a thread").join().expect("no overflow");
    assert!(report.faults.is_empty());
    assert_eq!(report.nodes.len(), 100_000);
    // Step of 1.0 gives 1.0: from the second Step on, all are one action.
    assert_eq!(executed(&report).len(), 3);
}

/// A chain of steps of one value is one action: its pairs are twins, each fed by the other.
#[test]
fn twins_in_one_chain_do_not_wait_for_each_other() {
    let graph = |last: f64| {
        let mut text = String::from("\"n0\": Const(value: 1.0),");
        for node in 1..=20 {
            text += &format!("\"n{node}\": Step(of: \"n{}\", at: 0.5),", node - 1);
        }
        text + &format!("\"by\": Scale(of: \"n20\", by: {last:?}), \"out\": Write(of: \"by\", path: \"out.#.txt\")")
    };
    let (done, waiting) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let (bench, engine) = (Bench::new(), engine(0));
        bench.run(&engine, &graph(2.0));
        let report = bench.run(&engine, &graph(3.0));
        assert!(report.faults.is_empty() && report.frames_delivered == 4);
        done.send(()).expect("somebody waits");
    });
    let minute = std::time::Duration::from_secs(60);
    waiting.recv_timeout(minute).expect("the run comes to an end");
}

#[test]
fn a_port_that_reads_windows_needs_no_value() {
    let (bench, engine) = (Bench::new(), engine(ROOMY));
    let graph = |reader: &str| {
        format!(r#""p": Picture(a: 2.0, width: 3), "r": {reader}, "out": Write(of: "r", path: "out.#.txt")"#)
    };
    bench.run(&engine, &graph(r#"PickA(image: "p")"#));
    let report = bench.run(&engine, &graph(r#"Size(domain: "p")"#));
    assert_eq!(pair(&report, "r", None).status, Status::Executed);
    let picture = pair(&report, "p", None);
    assert_eq!((picture.status, picture.from), (Status::Reused, Some(From::Record)), "its outline is enough");
}

/// Two nodes want a value that cannot be had any more, one of them late: both are skipped, and the run ends.
#[test]
fn a_lost_value_skips_whoever_wants_it() {
    let (done, waiting) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let (bench, engine) = (Bench::new(), engine(0));
        let graph = |by: f64, wait: u64| {
            format!(
                r#""drift": Drift(), "one": Const(value: 1.0), "slow": Slow(of: "one", milliseconds: 30),
                "c": Sum(terms: ["drift", "slow"]), "late": Slow(of: "one", milliseconds: {wait}),
                "soon": Scale(of: "c", by: {by:?}), "then": Sum(terms: ["c", "late"], bias: {by:?}),
                "x": Write(of: "soon", path: "x.#.txt"), "y": Write(of: "then", path: "y.#.txt")"#
            )
        };
        assert!(bench.run(&engine, &graph(1.0, 1)).faults.is_empty());
        let report = bench.run(&engine, &graph(2.0, 120));
        let [fault] = &report.faults[..] else { panic!("{:#?}", report.faults) };
        assert_eq!((fault.code, fault.node.as_deref()), (Code::Nondeterministic, Some("drift")));
        for (node, frame) in [("soon", None), ("then", None), ("x", Some(1)), ("y", Some(1))] {
            assert_eq!(pair(&report, node, frame).status, Status::Skipped, "{node}");
        }
        done.send(()).expect("somebody waits");
    });
    let minute = std::time::Duration::from_secs(60);
    waiting.recv_timeout(minute).expect("the run comes to an end");
}
