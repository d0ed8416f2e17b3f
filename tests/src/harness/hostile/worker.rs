//! The child process that decodes, and the parent's view of it.

use std::fmt;
use std::hint::black_box;
use std::io::{BufRead, BufReader};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};

use peak_alloc::PeakAlloc;
use rustix::time::{ClockId, clock_gettime};
use warploom_core::node::{ErrorClass, NodeError};
use warploom_nodes::io::codec::{Encoding, decode};

use super::{BUDGET, EXCESS, Limits, REFUSED, file, targets};

/// The variable that tells a child what to do: its job and the first and last number of its files.
const ASK: &str = "WARPLOOM_HOSTILE_IMAGES";

/// Stands before what a child says, whatever else is on the line.
const MARK: &str = "hostile@ ";

/// What the controls do, each in its own way.
pub const CONTROLS: [&str; 6] = ["panics", "takes", "computes", "is refused", "hangs", "ends the process"];

/// Which files a child decodes.
#[derive(Clone, Copy)]
pub struct Job {
    pub seed: u64,
    pub is_control: bool,
}

/// What decoding a file took.
pub struct Cost {
    /// `read`, or the class of the error.
    kind: String,
    /// Of the processor.
    pub seconds: f64,
    reserved: u64,
    peak: u64,
    /// What a panic said.
    panic: String,
}

impl Cost {
    /// Bytes beyond the reserve.
    pub fn excess(&self) -> u64 {
        self.peak.saturating_sub(self.reserved)
    }
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} {} {} {}", self.kind, self.seconds, self.reserved, self.peak, self.panic)
    }
}

/// How a file ended.
pub enum Ending {
    Decoded(Cost),
    /// The process is gone, or was silent for too long and is gone now.
    Gone(&'static str),
}

impl Ending {
    /// A word for it.
    pub fn kind(&self) -> &str {
        match self {
            Self::Decoded(cost) if cost.is_checked_overflow() => "stopped by a debug check",
            Self::Decoded(cost) if !cost.panic.is_empty() => "panicked",
            Self::Decoded(cost) => &cost.kind,
            Self::Gone(how) => how,
        }
    }

    /// What must not be, if it is so.
    pub fn fault(&self, limits: Limits) -> Option<String> {
        let cost = match self {
            Self::Gone(how) => return Some((*how).to_owned()),
            Self::Decoded(cost) => cost,
        };
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        if !cost.panic.is_empty() && !cost.is_checked_overflow() {
            Some(format!("panics: {}", cost.panic))
        } else if cost.excess() > EXCESS {
            Some(format!("takes {:.0} MiB beyond its {:.0}", mib(cost.excess()), mib(cost.reserved)))
        } else if cost.kind == "OverBudget" && cost.peak > REFUSED {
            Some(format!("is refused only after {:.0} MiB", mib(cost.peak)))
        } else if cost.seconds > limits.seconds {
            Some(format!("computes for {:.2} s", cost.seconds))
        } else {
            let known = ["read", "InputUnreadable", "InputUnsupported", "OverBudget"].contains(&&*cost.kind);
            (!known).then(|| format!("ends as {}", cost.kind))
        }
    }
}

impl Cost {
    /// Whether only the checks of a debug build stopped a library's arithmetic, which goes on in a release.
    fn is_checked_overflow(&self) -> bool {
        let is_overflow = self.panic.contains("attempt to ") && self.panic.contains(" overflow");
        cfg!(debug_assertions) && is_overflow && !self.panic.contains("nodes/")
    }

    fn parse(text: &str) -> Option<Self> {
        let mut words = text.splitn(5, ' ');
        let mut next = || words.next();
        Some(Self {
            kind: next()?.to_owned(),
            seconds: next()?.parse().ok()?,
            reserved: next()?.parse().ok()?,
            peak: next()?.parse().ok()?,
            panic: next()?.to_owned(),
        })
    }
}

/// Has children decode files 0 to `count` and tells how each ended. A child that is gone is followed by another.
pub fn run(arguments: &[&str], job: Job, count: usize, limits: Limits, mut tell: impl FnMut(usize, Ending)) {
    let mut next = 0;
    while next < count {
        let before = next;
        let (mut child, words) = start(arguments, job, next, count);
        let gone = loop {
            match words.recv_timeout(limits.patience) {
                Ok(line) => {
                    let (index, cost) = line.split_once(' ').expect("a number and what came of it");
                    assert_eq!(index.parse(), Ok(next), "children go on where others ended");
                    if cost != "begins" {
                        tell(next, Ending::Decoded(Cost::parse(cost).expect("what a file cost")));
                        next += 1;
                    }
                }
                Err(RecvTimeoutError::Timeout) => break "hangs",
                Err(RecvTimeoutError::Disconnected) => break "ends the process",
            }
        };
        // It may have ended by itself.
        let _ = child.kill();
        child.wait().expect("a child of this process");
        if next < count {
            tell(next, Ending::Gone(gone));
            next += 1;
        }
        assert!(next > before);
    }
}

/// Starts a child; gives what it says.
fn start(arguments: &[&str], job: Job, from: usize, to: usize) -> (Child, Receiver<String>) {
    let mut command = Command::new(std::env::current_exe().expect("this executable"));
    command.args(arguments).env("RAYON_NUM_THREADS", "1");
    command.env(ASK, format!("{} {} {from} {to}", job.seed, job.is_control));
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("a child");
    let out = BufReader::new(child.stdout.take().expect("a pipe"));
    let (sender, words) = channel();
    std::thread::spawn(move || {
        for line in out.lines().map_while(Result::ok) {
            if let Some((_, said)) = line.split_once(MARK) {
                // The receiver is gone when the child was given up.
                let _ = sender.send(said.to_owned());
            }
        }
    });
    (child, words)
}

/// Does a child's work if this process is one.
pub fn work_if_asked(heap: &PeakAlloc) -> bool {
    let Ok(asked) = std::env::var(ASK) else { return false };
    let words: Vec<&str> = asked.split(' ').collect();
    let number = |at: usize| words[at].parse::<usize>().expect("a number");
    let (seed, is_control) = (number(0) as u64, words[1] == "true");
    let targets = if is_control { Vec::new() } else { targets() };
    std::panic::set_hook(Box::new(|info| {
        let text = info.to_string().replace('\n', " ");
        *PANIC.lock().unwrap_or_else(PoisonError::into_inner) = text;
    }));
    for index in number(2)..number(3) {
        println!("\n{MARK}{index} begins");
        let cost = match is_control {
            true => measured(heap, |reserve| misbehave(index, reserve)),
            false => {
                let bytes = file(&targets, seed, index);
                measured(heap, |reserve| decode(&bytes, Encoding::Auto, &reserve).map(drop))
            }
        };
        println!("\n{MARK}{index} {cost}");
    }
    true
}

/// What the last panic said.
static PANIC: Mutex<String> = Mutex::new(String::new());

fn measured<'a>(
    heap: &PeakAlloc,
    work: impl FnOnce(&'a (dyn Fn(u128) -> Result<(), NodeError> + Sync)) -> Result<(), NodeError>,
) -> Cost {
    let reserved: &AtomicU64 = Box::leak(Box::default());
    let reserve: &'a _ = Box::leak(Box::new(|bytes: u128| {
        let bytes = u64::try_from(bytes).unwrap_or(u64::MAX);
        let grant = |taken: u64| taken.checked_add(bytes).filter(|&sum| sum <= BUDGET);
        match reserved.fetch_update(Ordering::Relaxed, Ordering::Relaxed, grant) {
            Ok(_) => Ok(()),
            Err(_) => Err(NodeError::new(ErrorClass::OverBudget, "too much")),
        }
    }));
    PANIC.lock().unwrap_or_else(PoisonError::into_inner).clear();
    let before = heap.current_usage();
    heap.reset_peak_usage();
    let begun = cpu_seconds();
    let ended = work(reserve);
    let seconds = cpu_seconds() - begun;
    let kind = ended.map_or_else(|error| format!("{:?}", error.class), |()| "read".to_owned());
    let peak = heap.peak_usage().saturating_sub(before) as u64;
    let panic = PANIC.lock().unwrap_or_else(PoisonError::into_inner).clone();
    Cost { kind, seconds, reserved: reserved.load(Ordering::Relaxed), peak, panic }
}

/// Does what no decoder may.
fn misbehave(control: usize, reserve: &dyn Fn(u128) -> Result<(), NodeError>) -> Result<(), NodeError> {
    match CONTROLS[control] {
        "panics" => drop(catch_unwind(AssertUnwindSafe(|| panic!("as it should")))),
        "takes" => drop(black_box(vec![1u8; (EXCESS + EXCESS / 8) as usize])),
        "computes" => {
            let begun = cpu_seconds();
            while cpu_seconds() - begun < 0.1 {}
        }
        "is refused" => {
            reserve(u128::from(BUDGET / 2))?;
            let taken = black_box(vec![1u8; (REFUSED + REFUSED / 8) as usize]);
            return reserve(taken.len() as u128);
        }
        "hangs" => loop {
            std::thread::park();
        },
        _ => std::process::abort(),
    }
    Ok(())
}

/// Seconds that this process has computed.
fn cpu_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
