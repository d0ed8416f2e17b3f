//! Checks of texts and graphs that nobody would write.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use warploom_core::graph::frames::parse_frames;
use warploom_core::graph::plan::Plan;
use warploom_core::graph::{Options, check};
use warploom_core::registry::Registry;

use super::dice::Dice;
use super::{Good, broken, byte_mutation, files, token_mutation};
use crate::harness::Outcome;
use crate::{Random, cpu_seconds};

/// Longest that one case may compute.
const LONGEST: Duration = Duration::from_secs(1);
/// Most bytes of memory that all of it may take.
const MOST_MEMORY: u64 = 1 << 30;

/// The texts that mutations begin with.
pub struct Pool {
    good: Vec<String>,
    wrong: Vec<String>,
}

impl Pool {
    /// Good graphs of all node types, and the wrong ones of the fixtures.
    pub fn new(registry: &Registry) -> Self {
        let texts = |folder| files(folder).into_iter().map(|(_, text)| text);
        let made = (1..=60).map(|seed| Good::new(seed, registry).text);
        Self { good: made.chain(texts("check/good")).collect(), wrong: texts("check/faults").collect() }
    }

    /// One case: a text, and the flags it is checked with.
    fn case(&self, number: u64) -> Case {
        let mut random = Random(number.wrapping_mul(0xD129_0D3B_3F6E_55A3));
        let text = match random.below(16) {
            0 | 1 => {
                let tape: Vec<u32> = (0..200).map(|_| random.next() as u32).collect();
                Dice::new(&tape).text()
            }
            2 => (0..random.below(200)).map(|_| any_char(&mut random)).collect(),
            3 => random.pick(&self.good).clone(),
            4..7 => token_mutation(random.pick::<String>(&self.good), &mut random),
            7..10 => byte_mutation(random.pick::<String>(&self.good), &mut random),
            10..13 => token_mutation(random.pick::<String>(&self.wrong), &mut random),
            13 | 14 => byte_mutation(random.pick::<String>(&self.wrong), &mut random),
            _ => {
                let whole = random.pick(&self.good);
                let boundaries: Vec<usize> = whole.char_indices().map(|(at, _)| at).collect();
                whole[..*random.pick(&boundaries)].to_owned()
            }
        };
        let flags = if random.below(3) == 0 { Flags::random(&text, &mut random) } else { Flags::default() };
        Case { number, text, flags }
    }
}

/// Any sign, most of them such as graphs have.
fn any_char(random: &mut Random) -> char {
    match random.below(4) {
        0 => char::from_u32(random.below(0x11_0000) as u32).unwrap_or('\u{FFFD}'),
        1 => char::from(random.below(128) as u8),
        _ => {
            *random.pick(&['"', '\'', '(', ')', '{', '}', '[', ']', ':', ',', '.', '#', '\n', '/', '*', 'r', '1', '-'])
        }
    }
}

#[derive(Default)]
struct Flags {
    set: Vec<String>,
    targets: Vec<String>,
    dumps: Vec<String>,
    frames: Option<Vec<i64>>,
    plugins: Vec<PathBuf>,
    /// What every other variable holds.
    variable: String,
}

impl Flags {
    /// Flags that speak of what the text has, or nearly so.
    fn random(text: &str, random: &mut Random) -> Self {
        let words: Vec<&str> =
            text.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|w| !w.is_empty()).collect();
        let mut word = |random: &mut Random| match random.below(8) {
            0 => String::new(),
            1 => any_char(random).to_string(),
            _ if words.is_empty() => "out".to_owned(),
            _ => (*random.pick(&words)).to_owned(),
        };
        let values = [
            "60.0",
            "(64, 64)",
            "\"plate\"",
            "Keys([(1, 2.0), (2, 3.0)])",
            "[\"a\", 'b', r#\"c\"#]",
            "NaN",
            "-1e400",
            "Cubic",
        ];
        let set = |random: &mut Random, word: &mut dyn FnMut(&mut Random) -> String| {
            let whole = format!("{}.{}={}", word(random), word(random), random.pick(&values));
            match random.below(3) {
                0 => token_mutation(&whole, random),
                1 => byte_mutation(&whole, random),
                _ => whole,
            }
        };
        let frames = ["1", "1001-1012", "-5-5x3", "1,9223372036854775807", "1-3000", "-9223372036854775808"];
        let count = |random: &mut Random| random.below(3);
        Self {
            set: (0..count(random)).map(|_| set(random, &mut word)).collect(),
            targets: (0..count(random)).map(|_| word(random)).collect(),
            dumps: (0..count(random)).map(|_| word(random)).collect(),
            frames: (random.below(2) == 0).then(|| parse_frames(random.pick::<&str>(&frames)).expect("frames")),
            plugins: (0..count(random)).map(|_| word(random).into()).collect(),
            variable: any_char(random).to_string(),
        }
    }
}

struct Case {
    number: u64,
    text: String,
    flags: Flags,
}

impl Case {
    /// Checks the text, reads all that is told, and makes the nodes of a plan; what is not as it must be, in words.
    fn run(&self, registry: &Registry, plans: &AtomicU64) -> Option<String> {
        let flags = &self.flags;
        let is_set = |name: &str| name.len().is_multiple_of(2).then(|| flags.variable.clone());
        let options = Options {
            set: &flags.set,
            targets: &flags.targets,
            dumps: &flags.dumps,
            frames: flags.frames.clone(),
            plugins: &flags.plugins,
            variable: &is_set,
            ..Options::new(Path::new("graph.ron"))
        };
        let checked = check(&self.text, registry, &options);
        if let Some(plan) = &checked.plan {
            make_nodes(plan, self.number);
            plans.fetch_add(1, Ordering::Relaxed);
        }
        broken(&self.text, &checked)
    }

    /// Runs it, and says what was not as it must be: a panic, an answer or a time.
    fn tried(&self, registry: &Registry, plans: &AtomicU64) -> Option<String> {
        let begun = Instant::now();
        let wrong =
            catch_unwind(AssertUnwindSafe(|| self.run(registry, plans))).unwrap_or_else(|_| Some("a panic".to_owned()));
        // A machine at other work may be slow; what the case itself computes is not.
        let is_slow = begun.elapsed() > LONGEST && {
            let before = cpu_seconds().unwrap_or_default();
            self.run(registry, &AtomicU64::new(0));
            cpu_seconds().unwrap_or_default() - before > LONGEST.as_secs_f64()
        };
        let wrong = wrong.or_else(|| is_slow.then(|| format!("it took longer than {LONGEST:?}")))?;
        Some(format!("case {}: {wrong}\n{}\n--set {:?}", self.number, self.text, self.flags.set))
    }
}

/// Makes every node as a run would, linked numbers being anything.
fn make_nodes(plan: &Plan, number: u64) {
    let links = [0.0, 1.0, -1.0, 1e300, f64::NAN, 64.5];
    let first = plan.frames.first().copied();
    for (index, node) in plan.nodes.iter().enumerate() {
        let linked = vec![Some(links[(index + number as usize) % links.len()]); node.links.len()];
        let frame = first.filter(|_| !node.is_static);
        match plan.params_at(index, frame, &linked) {
            Ok(params) => drop(node.node_type.make(&params.into()).check()),
            Err(fault) => drop(fault.render(true, true, 80)),
        }
    }
}

/// Runs `count` cases from number `first` on, on all processors.
pub fn fuzz(pool: &Pool, registry: &Registry, first: u64, count: u64) -> Outcome {
    let (next, plans) = (AtomicU64::new(first), AtomicU64::new(0));
    let begun = Instant::now();
    let work = || {
        let mut wrong = Vec::new();
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= first + count {
                return wrong;
            }
            wrong.extend(pool.case(number).tried(registry, &plans));
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let violations = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("cases are caught")).collect()
    });
    let mut outcome = Outcome { figures: Vec::new(), violations };
    let plans = plans.into_inner();
    let (seconds, peak) = (begun.elapsed().as_secs_f64(), peak_bytes());
    outcome.figures.push(format!(
        "{count} cases from {first} on, {plans} of them graphs that can run, {threads} threads: {seconds:.1} s, {} MiB",
        peak >> 20
    ));
    // Cases that are all good, or all rubbish, would prove little.
    let share = plans as f64 / count as f64;
    outcome.check(count < 1000 || (0.02..0.98).contains(&share), || format!("{plans} of {count} cases can run"));
    outcome.check(peak <= MOST_MEMORY, || format!("{peak} bytes of memory, more than {MOST_MEMORY}"));
    outcome
}

/// The most that was resident; 0 where the system does not tell.
fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok()).unwrap_or_default() << 10
}
