//! The engine against the oracle, over random graphs and random edits.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use warploom_core::engine::{
    Delivery, Engine, Existing, Explanation, Job, Report, Settings, Status, StorePolicy, Verdict,
};
use warploom_core::graph::plan::Plan;
use warploom_core::graph::{Options, check};
use warploom_core::registry::Registry;

use warploom_tests::Random;

use crate::model::{By, Edge, Model, Op, Seen, read_name, write_name};
use crate::nodes::{COMPUTED, NODES};

const FILES: usize = 2;

/// A few values, so that equal ones come up.
fn value(random: &mut Random) -> f64 {
    *random.pick(&[0.0, 1.0, 1.5, 2.0, -3.25, 7.0, 0.1])
}

/// Frames that a window around any frame of a run may ask for.
const READABLE: std::ops::RangeInclusive<i64> = -2..=12;

fn number_edge(model: &[Op], random: &mut Random) -> Edge {
    loop {
        let node = random.below(model.len());
        match model[node] {
            Op::Picture { .. } | Op::Plate { .. } | Op::Write { .. } => continue,
            Op::Split(_) => return Edge { node, output: random.below(2) },
            _ => return Edge { node, output: 0 },
        }
    }
}

fn picture_edge(model: &[Op], random: &mut Random) -> Option<Edge> {
    let pictures: Vec<usize> = (0..model.len()).filter(|&node| is_picture(&model[node])).collect();
    (!pictures.is_empty()).then(|| Edge { node: pictures[random.below(pictures.len())], output: 0 })
}

fn is_picture(op: &Op) -> bool {
    matches!(op, Op::Picture { .. } | Op::Plate { .. })
}

fn by(before: &[Op], random: &mut Random) -> By {
    match random.below(4) {
        0 => By::Keys(vec![(1, value(random)), (2 + random.below(3) as i64, value(random))]),
        1 => By::Link(number_edge(before, random)),
        _ => By::Constant(value(random)),
    }
}

/// A random operation that names only nodes in `before`.
fn operation(before: &[Op], random: &mut Random) -> Op {
    if before.is_empty() {
        return Op::Const(value(random));
    }
    let of = number_edge(before, random);
    match random.below(18) {
        0 => Op::Const(value(random)),
        1 | 2 => {
            let terms = (0..1 + random.below(3)).map(|_| number_edge(before, random)).collect();
            Op::Sum { terms, bias: value(random) }
        }
        3 => Op::Split(of),
        4 => Op::Frame,
        5 | 6 => Op::Step { of, at: value(random) },
        7 => Op::Window { of, radius: 1 + random.below(2) as u32 },
        8 => Op::Hold { of, frame: 1 + random.below(5) as i64 },
        9 => Op::Shot(of),
        10 | 11 => Op::Scale { of, by: by(before, random) },
        12 => Op::OrElse { of: (random.below(2) == 0).then_some(of), otherwise: value(random) },
        13 => Op::Read { file: random.below(FILES), per_frame: random.below(2) == 0 },
        14 => Op::Picture { a: by(before, random), b: value(random), width: 1 + random.below(2) as u32 },
        15 => Op::Plate { a: value(random), b: value(random), width: 1 + random.below(2) as u32 },
        _ => match (picture_edge(before, random), random.below(3)) {
            (Some(edge), 0) => Op::PickA(edge),
            (Some(edge), 1) => Op::Both(edge),
            (Some(edge), _) => Op::Size(edge),
            (None, _) => Op::Split(of),
        },
    }
}

fn model(random: &mut Random) -> Model {
    let count = 3 + random.below(9);
    let mut ops: Vec<Op> = Vec::new();
    for _ in 0..count {
        let op = operation(&ops, random);
        ops.push(op);
    }
    for file in 0..1 + random.below(2) {
        let of = number_edge(&ops, random);
        ops.push(Op::Write { of, file });
    }
    let names = (0..ops.len()).map(|node| format!("n{node}")).collect();
    let frames = (1..=1 + random.below(3) as i64).collect();
    Model { order: (0..ops.len()).collect(), ops, names, frames, layout: 1 }
}

/// One edit of the graph: a parameter, a wire, a name, an order, a layout, the frames.
fn edit(model: &mut Model, random: &mut Random) {
    match random.below(10) {
        0 => model.layout = random.next(),
        1 => {
            let node = random.below(model.names.len());
            model.names[node] = format!("m{}", random.next() % 1_000_000_007);
        }
        2 => {
            let (a, b) = (random.below(model.order.len()), random.below(model.order.len()));
            model.order.swap(a, b);
        }
        3 => model.frames = (1..=1 + random.below(4) as i64).collect(),
        4 => {
            // Another operation of the same kind of output.
            let node = random.below(model.ops.len());
            let (before, _) = model.ops.split_at(node);
            let new = operation(before, random);
            let narrow = |op: &Op| matches!(op, Op::Split(_));
            let old = &model.ops[node];
            if !matches!(old, Op::Write { .. }) && is_picture(old) == is_picture(&new) && (narrow(&new) || !narrow(old))
            {
                model.ops[node] = new;
            }
        }
        _ => {
            let node = random.below(model.ops.len());
            let number = value(random);
            let (before, rest) = model.ops.split_at_mut(node);
            let other = if before.is_empty() { None } else { Some(number_edge(before, random)) };
            match (&mut rest[0], other) {
                (Op::Const(v) | Op::Step { at: v, .. } | Op::Sum { bias: v, .. }, _) => *v = number,
                (Op::OrElse { otherwise, .. }, _) => *otherwise = number,
                (Op::Scale { by: factor, .. } | Op::Picture { a: factor, .. }, Some(_)) => *factor = by(before, random),
                (Op::Picture { b, .. }, None) => *b = number,
                (Op::Window { radius, .. }, _) => *radius = 1 + random.below(2) as u32,
                (Op::Hold { frame, .. }, _) => *frame = 1 + random.below(5) as i64,
                (Op::Split(of) | Op::Shot(of) | Op::Write { of, .. }, Some(other)) => *of = other,
                (Op::Read { file, .. }, _) => *file = random.below(FILES),
                _ => {}
            }
        }
    }
}

pub fn plan(text: &str, folder: &Path, registry: &Registry) -> Arc<Plan> {
    let file = folder.join("graph.ron");
    let checked = check(text, registry, &Options::new(&file));
    assert!(checked.faults.is_empty(), "{text}\n{:#?}", checked.faults);
    Arc::new(checked.plan.expect("a graph without faults has a plan"))
}

/// What the test knows beside the engine: every identity ever executed, and what each sink's file should hold.
struct Known {
    identities: HashSet<String>,
    /// Content on disk per written path, as far as anybody changed it.
    files: BTreeMap<String, String>,
}

/// Where an engine keeps results.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Setting {
    /// In memory, with room for all.
    Roomy,
    /// In memory, with room for hardly any value.
    Tight,
    /// On disk; every run is by an engine that has seen nothing.
    Processes,
    /// The same, with hardly any memory.
    TightProcesses,
}

impl Setting {
    fn is_tight(self) -> bool {
        matches!(self, Setting::Tight | Setting::TightProcesses)
    }

    fn engine(self, seed: u64, folder: &Path) -> Engine {
        let on_disk = matches!(self, Setting::Processes | Setting::TightProcesses);
        Engine::new(Settings {
            threads: [1, 2, 3, 8][(seed / 4) as usize % 4],
            memory: if self.is_tight() { 5000 } else { 1 << 30 },
            cache: on_disk.then(|| folder.join("cache")),
            store: if seed.is_multiple_of(3) { StorePolicy::Auto } else { StorePolicy::All },
            ..Settings::default()
        })
    }
}

/// Every pair that runs was foretold, every pair that was sure to run does, and both have a cause and its place.
fn foretold(explanation: &Explanation, report: &Report, text: &str) {
    let name = |node: &str, frame: Option<i64>| (node.to_owned(), frame);
    let verdicts: HashMap<_, _> =
        explanation.nodes.iter().map(|pair| (name(&pair.node, pair.frame), pair.verdict)).collect();
    assert_eq!(verdicts.len(), report.nodes.len(), "a verdict per pair\n{text}");
    for pair in &report.nodes {
        let (verdict, executed) = (verdicts[&name(&pair.node, pair.frame)], pair.status == Status::Executed);
        assert!(!executed || verdict != Verdict::Reused, "{} at {:?} was to be reused\n{text}", pair.node, pair.frame);
        assert!(executed || verdict != Verdict::Runs, "{} at {:?} was to run\n{text}", pair.node, pair.frame);
    }
    for pair in explanation.nodes.iter().filter(|pair| pair.verdict != Verdict::Reused) {
        let why = pair.why.as_ref().unwrap_or_else(|| panic!("{} runs for no reason\n{text}", pair.node));
        let at = why.at.as_deref().unwrap_or_default();
        let numbers: Vec<usize> = at.rsplit(':').take(2).filter_map(|part| part.parse().ok()).collect();
        assert!(numbers.len() == 2 && numbers.iter().all(|&n| n > 0) && !why.text.is_empty(), "{why:?}\n{text}");
    }
}

/// Runs and compares every promise with the oracle.
fn run_and_compare(
    engine: &Engine,
    setting: Setting,
    model: &Model,
    inputs: &BTreeMap<String, String>,
    known: &mut Known,
    folder: &Path,
    registry: &Registry,
) {
    let text = model.text();
    let plan = plan(&text, folder, registry);
    let explanation = engine.explain(&plan, Existing::Overwrite);
    let before = COMPUTED.load(Ordering::Relaxed);
    let report = engine.run(&plan, &Job::default());
    let computed = COMPUTED.load(Ordering::Relaxed) - before;
    assert!(report.faults.is_empty(), "{setting:?} {text}\n{:#?}", report.faults);
    foretold(&explanation, &report, &text);

    let mut memo = HashMap::new();
    let mut expected: HashSet<String> = HashSet::new();
    let closure = model.closure();
    let mut identity_of: HashMap<(String, Option<i64>), String> = HashMap::new();
    for &(node, frame) in &closure {
        let answer = model.answer(node, frame.unwrap_or(model.frames[0]), inputs, &mut memo);
        let is_needed = match (&model.ops[node], frame) {
            (Op::Write { file, .. }, Some(frame)) => {
                let wanted = format!("{:?}", number(&answer.values[0]));
                let path = write_name(*file, frame);
                let stands = known.files.insert(path, wanted.clone());
                !known.identities.contains(&answer.identity) || stands != Some(wanted)
            }
            _ => !known.identities.contains(&answer.identity),
        };
        if is_needed {
            expected.insert(answer.identity.clone());
        }
        identity_of.insert((model.names[node].clone(), frame), answer.identity);
    }
    compare(&report, &expected, &identity_of, setting, &text);
    if !setting.is_tight() {
        assert_eq!(computed, expected.len() as u64, "nothing computes but what is reported\n{text}");
    }
    known.identities.extend(expected);
    for (path, content) in &known.files {
        assert_eq!(&std::fs::read_to_string(folder.join(path)).expect("written"), content, "{path}\n{text}");
    }
}

fn number(seen: &Seen) -> f64 {
    match seen {
        Seen::Number(number) => *number,
        Seen::Picture { .. } => unreachable!("sinks write numbers"),
    }
}

fn compare(
    report: &Report,
    expected: &HashSet<String>,
    identity_of: &HashMap<(String, Option<i64>), String>,
    setting: Setting,
    text: &str,
) {
    assert_eq!(report.nodes.len(), identity_of.len(), "one entry for every pair\n{text}");
    let mut executed = HashSet::new();
    for pair in &report.nodes {
        let identity = &identity_of[&(pair.node.to_string(), pair.frame)];
        match pair.status {
            Status::Executed => {
                assert!(executed.insert(identity.clone()), "{identity} executed twice\n{text}");
                let why = pair.why.as_ref().expect("every executed pair has a reason");
                assert!(!why.text.is_empty() && why.at.is_some());
            }
            Status::Reused => {}
            // What is cheap to compute is not kept by policy, and nothing is where there is no room.
            Status::Recomputed if setting != Setting::Roomy => {}
            status => panic!("{} is {status:?} with all of memory at hand\n{text}", pair.node),
        }
    }
    assert_eq!(&executed, expected, "the executed set\n{text}");
}

#[test]
fn a_thousand_edit_sequences_execute_just_what_is_needed() {
    let _serial = crate::serial();
    let registry = Registry::new(NODES);
    let sequences = if cfg!(debug_assertions) { 1000 } else { 5000 };
    let settings = [Setting::Roomy, Setting::Tight, Setting::Processes, Setting::TightProcesses];
    for seed in 0..sequences {
        let folder = tempfile::tempdir().expect("a folder");
        let mut random = Random(seed);
        let mut inputs = BTreeMap::new();
        for file in 0..FILES {
            let names =
                std::iter::once(read_name(file, None)).chain(READABLE.map(|frame| read_name(file, Some(frame))));
            names.for_each(|name| {
                inputs.insert(name, format!("{:?}", value(&mut random)));
            });
        }
        std::fs::create_dir_all(folder.path().join("in")).expect("a folder");
        let write = |name: &str, content: &str| std::fs::write(folder.path().join(name), content).expect("written");
        inputs.iter().for_each(|(name, content)| write(name, content));

        let setting = settings[seed as usize % 4];
        let mut engine = setting.engine(seed, folder.path());
        let mut known = Known { identities: HashSet::new(), files: BTreeMap::new() };
        let mut history = vec![model(&mut random)];
        for _ in 0..6 {
            let current = history.last().expect("never empty").clone();
            if !matches!(setting, Setting::Roomy | Setting::Tight) {
                engine = setting.engine(seed, folder.path());
                if random.below(4) == 0 {
                    // The journal is for people alone.
                    let _ = std::fs::remove_dir_all(folder.path().join("cache/v2/journal"));
                }
            }
            run_and_compare(&engine, setting, &current, &inputs, &mut known, folder.path(), &registry);
            let mut next = current;
            match random.below(8) {
                // Undo.
                0 => next = history[random.below(history.len())].clone(),
                // A plate overwritten in place, at once and with as many bytes.
                1 => {
                    let name = inputs.keys().nth(random.below(inputs.len())).expect("files").clone();
                    let content = format!("{:?}", value(&mut random));
                    write(&name, &content);
                    inputs.insert(name, content);
                }
                // An output removed, or overwritten by somebody.
                2 if !known.files.is_empty() => {
                    let name = known.files.keys().nth(random.below(known.files.len())).expect("files").clone();
                    if random.below(2) == 0 {
                        std::fs::remove_file(folder.path().join(&name)).expect("removed");
                        known.files.remove(&name);
                    } else {
                        write(&name, "9.75");
                        known.files.insert(name, "9.75".into());
                    }
                }
                _ => edit(&mut next, &mut random),
            }
            // Files that the next graph does not write keep what they hold.
            history.push(next);
        }
        // Every output is what a cold engine writes.
        let last = history[history.len() - 2].clone();
        let warm: BTreeMap<String, Vec<u8>> = outputs(&engine, &last, folder.path(), &registry);
        let cold: BTreeMap<String, Vec<u8>> =
            outputs(&Setting::Roomy.engine(seed, folder.path()), &last, folder.path(), &registry);
        assert_eq!(warm, cold, "seed {seed}\n{}", last.text());
    }
}

/// All values of the run, as bytes of their digests, by node, output and frame.
fn outputs(engine: &Engine, model: &Model, folder: &Path, registry: &Registry) -> BTreeMap<String, Vec<u8>> {
    let file = folder.join("graph.ron");
    let targets: Vec<String> = model.names.clone();
    let checked = check(&model.text(), registry, &Options { targets: &targets, ..Options::new(&file) });
    let plan = Arc::new(checked.plan.expect("a plan"));
    let found = std::sync::Mutex::new(BTreeMap::new());
    let deliver = (0..plan.nodes.len()).collect();
    let collect = |Delivery { node, frame, values, .. }: Delivery| {
        for (output, value) in values.iter().enumerate() {
            let name = format!("{}.{output}@{frame:?}", plan.nodes[node].id);
            found.lock().expect("no panic").insert(name, value.digest().0.to_vec());
        }
        Ok(())
    };
    let job = Job { deliver, on_values: &collect, ..Job::default() };
    let report = engine.run(&plan, &job);
    assert!(report.faults.is_empty(), "{:#?}", report.faults);
    found.into_inner().expect("no panic")
}
