//! Runs under a memory budget, and inside a control group of the system.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use serde_json::Value as Json;

use super::Outcome;
use super::place::{Place, wait};

/// Peak resident memory may exceed the budget by this much: code, stacks, what the system's allocator keeps.
const TOLERANCE: f64 = 1.15;

const MIB: u64 = 1 << 20;

/// What is run; sizes of memory in MiB.
pub struct Load {
    /// Width and height of a frame.
    pub size: [usize; 2],
    /// Frames.
    pub frames: usize,
    /// Budgets under which all frames must come.
    pub budgets: &'static [u64],
    /// Thread counts.
    pub threads: &'static [usize],
    /// A budget under which no frame can come.
    pub too_small: u64,
    /// Limit of the control group.
    pub group: u64,
}

impl Load {
    /// The full check.
    pub fn full(frames: usize) -> Self {
        let budgets = &[700, 1024, 2048];
        Self { size: [4096, 2160], frames, budgets, threads: &[1, 2, 3, 8], too_small: 200, group: 1024 }
    }

    /// A few seconds' worth.
    pub fn small() -> Self {
        Self { size: [1500, 1000], frames: 8, budgets: &[144], threads: &[1, 8], too_small: 30, group: 224 }
    }

    /// A plate, and frames that lay it bent over itself.
    fn shot(&self, binary: &Path) -> Place {
        let ([width, height], frames, place) = (self.size, self.frames, Place::new(binary));
        place.shot(
            "plate.ron",
            "1",
            &format!(
                r#""card": Checker(size: ({width}, {height}), cell: 37.0, odd: (0.1, 0.2, 0.1, 0.5)),
                "ramp": Ramp(size: ({width}, {height}), to: ({width}.0, {height}.0), first: (0.0, 0.0, 0.0, 0.0)),
                "both": Over(images: ["ramp", "card"]),
                "out":  Save(image: "both", path: "plate.exr", depth: Half, compression: None),"#
            ),
        );
        place.shot(
            "shot.ron",
            &format!("1-{frames}"),
            &format!(
                r#""plate": Load(path: "plate.exr"), "grid": Lattice(domain: "plate", cell: 8.0),
                "bend":   Arc(grid: "grid", angle: Keys([(1, 1.0), ({frames}, 3.0)])),
                "warped": Resample(image: "plate", warp: "bend"),
                "both":   Over(images: ["warped", "plate"]),
                "out":    Save(image: "both", path: "out/frame.####.exr", depth: Half),"#
            ),
        );
        place.shot(
            "huge.ron",
            "1",
            r#""huge": Constant(size: (30000, 30000)), "out": Save(image: "huge", path: "out/huge.exr")"#,
        );
        let (code, _) = place.run("run plate.ron --no-cache");
        assert_eq!(code, Some(0), "{}", place.stderr());
        place
    }
}

/// A run that was watched.
struct Watched {
    code: Option<i32>,
    seconds: f64,
    /// Peak resident bytes: the larger of what the report says and what the system says.
    peak: u64,
    report: Json,
}

/// Runs frames under each budget on each number of threads, with and without a disk cache; then what cannot fit.
pub fn memory(binary: &Path, load: &Load) -> Outcome {
    let (place, mut outcome) = (load.shot(binary), Outcome::default());
    for budget in load.budgets {
        for threads in load.threads {
            for cache in ["--no-cache", "--cache cache"] {
                let line = format!("run shot.ron {cache} --threads {threads} --memory {budget}M");
                let watched = watch(&place, &line, None);
                outcome.check(watched.code == Some(0), || format!("`{line}`: {:?} {}", watched.code, place.stderr()));
                outcome.check(place.outputs().len() == load.frames, || format!("`{line}`: frames are missing"));
                bound(&mut outcome, &line, &watched, budget * MIB);
                clear(&place);
            }
        }
    }
    for (graph, budget) in [("shot.ron", load.too_small), ("huge.ron", 1024)] {
        let line = format!("run {graph} --no-cache --memory {budget}M");
        let watched = watch(&place, &line, None);
        let fault = &watched.report["faults"][0];
        let message = fault["message"].as_str().unwrap_or_default();
        let says_bytes = message.contains(" needs ") && message.contains(", more than the ");
        let is_refused = watched.code == Some(7) && fault["code"] == "over_budget" && fault["node"].is_string();
        outcome.check(is_refused && says_bytes, || format!("`{line}` cannot fit: {:?}, {fault}", watched.code));
        bound(&mut outcome, &line, &watched, budget * MIB);
        clear(&place);
    }
    outcome
}

/// Runs frames without a budget inside a control group, seen as such and as the whole machine's, as in a container.
pub fn in_control_group(binary: &Path, load: &Load) -> Outcome {
    let (place, mut outcome) = (load.shot(binary), Outcome::default());
    let group = match Group::new(load.group * MIB) {
        Ok(group) => group,
        Err(reason) => {
            outcome.figures.push(format!("memory in a control group: skipped, {reason}"));
            return outcome;
        }
    };
    for is_container in [false, true] {
        if is_container && !may_mount() {
            outcome.figures.push("memory in a container: skipped, mounts are not permitted".to_owned());
            continue;
        }
        let line = "run shot.ron --cache cache";
        let watched = watch(&place, line, Some((&group, is_container)));
        let name = if is_container { "container" } else { "control group" };
        let what = || format!("`{line}` in a {name} of {} MiB", load.group);
        let is_whole = watched.code == Some(0) && place.outputs().len() == load.frames;
        outcome.check(is_whole, || format!("{}: {:?} {}", what(), watched.code, place.stderr()));
        let used = ratio(&watched, load.group * MIB);
        outcome.figures.push(format!("memory: {used:.2} of the limit, {:.1} s: {}", watched.seconds, what()));
        clear(&place);
    }
    outcome
}

fn ratio(watched: &Watched, budget: u64) -> f64 {
    watched.peak as f64 / budget as f64
}

fn bound(outcome: &mut Outcome, line: &str, watched: &Watched, budget: u64) {
    let used = ratio(watched, budget);
    outcome.figures.push(format!("memory: {used:.2} of the budget, {:.1} s: `{line}`", watched.seconds));
    outcome.check(used <= TOLERANCE, || format!("`{line}`: peak is {used:.2} of the budget"));
    let peak = watched.report["peak_bytes"].as_u64();
    outcome.check(peak.is_some_and(|peak| peak > 0), || format!("`{line}` reports no peak"));
}

fn watch(place: &Place, line: &str, inside: Option<(&Group, bool)>) -> Watched {
    let line = format!("{line} --progress none --report report.json");
    let mut command = place.command(&line);
    if let Some((group, is_container)) = inside {
        command = group.around(&command, is_container);
        place.prepare(&mut command);
    }
    let start = Instant::now();
    let mut child = command.spawn().expect("the binary starts");
    let (status, mut peak) = (format!("/proc/{}/status", child.id()), 0);
    let code = wait(&mut child, || peak = peak.max(resident_peak(&status)));
    let report = place.report("report.json");
    let peak = peak.max(report["peak_bytes"].as_u64().unwrap_or(0));
    Watched { code, seconds: start.elapsed().as_secs_f64(), peak, report }
}

/// Peak resident bytes of a process at work; 0 once it has ended.
fn resident_peak(status: &str) -> u64 {
    let text = std::fs::read_to_string(status).unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()).unwrap_or(0) * 1024
}

/// Removes what a run made.
fn clear(place: &Place) {
    for name in ["out", "cache"] {
        // It may never have been made.
        let _ = std::fs::remove_dir_all(place.path(name));
    }
    let _ = std::fs::remove_file(place.path("report.json"));
}

/// Whether a process may be given mounts of its own.
fn may_mount() -> bool {
    Command::new("unshare").args(["--mount", "true"]).output().is_ok_and(|output| output.status.success())
}

/// A control group with a limit on memory, of either version; removed in the end.
struct Group {
    root: &'static str,
    folder: PathBuf,
}

impl Group {
    fn new(bytes: u64) -> Result<Self, String> {
        let versions = [("/sys/fs/cgroup/memory", "memory.limit_in_bytes"), ("/sys/fs/cgroup", "memory.max")];
        let mut reason = "there is none for memory".to_owned();
        for (root, limit) in versions {
            let folder = Path::new(root).join(format!("warploom-{}", std::process::id()));
            if let Err(error) = std::fs::create_dir(&folder) {
                reason = error.to_string();
                continue;
            }
            let group = Self { root, folder };
            match std::fs::write(group.folder.join(limit), bytes.to_string()) {
                Ok(()) => return Ok(group),
                Err(error) => reason = error.to_string(),
            }
        }
        Err(reason)
    }

    /// The same command inside the group. In a container the group stands in the place of the machine's.
    fn around(&self, command: &Command, is_container: bool) -> Command {
        let enter = r#"echo $$ > "$0/cgroup.procs""#;
        let mut outer = Command::new(if is_container { "unshare" } else { "sh" });
        match is_container {
            true => outer
                .args(["--mount", "sh", "-c"])
                .arg(format!(r#"{enter} && mount --bind "$0" {} && exec "$@""#, self.root)),
            false => outer.arg("-c").arg(format!(r#"{enter} && exec "$@""#)),
        };
        outer.arg(&self.folder).arg(command.get_program()).args(command.get_args());
        outer
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        // A group without processes is removed; nothing else could be done about one that is not.
        let _ = std::fs::remove_dir(&self.folder);
    }
}
