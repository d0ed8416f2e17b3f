//! A folder with graphs and pictures, and the binary at work in it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value as Json;
use tempfile::TempDir;

/// A temporary folder that holds the graphs, the pictures and the cache of a test.
pub struct Desk(TempDir);

/// How a command ended.
#[derive(Debug)]
pub struct Ended {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Desk {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    pub fn path(&self, name: &str) -> PathBuf {
        // Resolved, since paths on standard output are; the system's folder for temporary files may be a link.
        self.0.path().canonicalize().expect("the folder is there").join(name)
    }

    /// Writes a file, whose folder is made.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("it lies in a folder")).expect("a folder");
        std::fs::write(&path, content).expect("a file");
        path
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn read_json(&self, name: &str) -> Json {
        serde_json::from_slice(&self.read(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Writes a graph of these nodes.
    pub fn graph(&self, name: &str, nodes: &str) -> PathBuf {
        self.write(name, format!("Graph(version: 1, nodes: {{\n{nodes}\n}})\n"))
    }

    /// Writes a graph of these nodes over frames.
    pub fn shot(&self, name: &str, frames: &str, nodes: &str) -> PathBuf {
        self.write(name, format!("Graph(version: 1, frames: \"{frames}\", nodes: {{\n{nodes}\n}})\n"))
    }

    /// Makes a picture file of a test card, a node such as `Checker(cell: 4.0)`, without touching the cache.
    pub fn card(&self, name: &str, node: &str) {
        let graph = format!(r#""card": {node}, "out": Save(image: "card", path: "{name}")"#);
        self.graph("card.ron", &graph);
        self.run("run card.ron --no-cache").expect(0);
        std::fs::remove_file(self.path("card.ron")).expect("it was written");
    }

    /// The binary, in this folder and with the cache in it.
    pub fn command<A: AsRef<std::ffi::OsStr>>(&self, args: impl IntoIterator<Item = A>) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_warploom"));
        command.args(args).current_dir(self.path(""));
        command.env("WARPLOOM_CACHE", self.path("cache")).env("XDG_CACHE_HOME", self.path("xdg"));
        command.env("HOME", self.path("home")).env_remove("NO_COLOR").stdin(Stdio::null());
        command
    }

    /// Runs a command line; its words are separated by spaces.
    pub fn run(&self, line: &str) -> Ended {
        self.command(line.split_whitespace()).output().expect("the binary starts").into()
    }

    /// Runs a command line and gives its report.
    pub fn report(&self, line: &str) -> Json {
        let ended = self.run(&format!("{line} --report report.json"));
        let report = self.read_json("report.json");
        std::fs::remove_file(self.path("report.json")).expect("it was written");
        assert_eq!(ended.code == 0, report["faults"] == Json::Array(Vec::new()), "{ended:?}");
        report
    }

    /// Names of the files in a folder, hidden ones too.
    pub fn files(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(folder)).into_iter().flatten();
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

impl From<Output> for Ended {
    fn from(output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).expect("what is said is UTF-8");
        let code = output.status.code().expect("no signal ended it");
        Self { code, stdout: text(output.stdout), stderr: text(output.stderr) }
    }
}

impl Ended {
    /// Checks the exit code.
    #[track_caller]
    pub fn expect(self, code: i32) -> Self {
        assert_eq!(self.code, code, "{self:?}");
        self
    }

    /// Checks the exit code and that standard error says each of `words`.
    #[track_caller]
    pub fn says(self, code: i32, words: &[&str]) -> Self {
        let ended = self.expect(code);
        words.iter().for_each(|word| assert!(ended.stderr.contains(word), "no {word:?} in {}", ended.stderr));
        ended
    }
}

/// The pairs of a report that ended so: `node`, or `node@frame`.
pub fn pairs(report: &Json, status: &str) -> BTreeSet<String> {
    let name = |pair: &Json| match pair["frame"].as_i64() {
        Some(frame) => format!("{}@{frame}", text(&pair["node"])),
        None => text(&pair["node"]).to_owned(),
    };
    let nodes = report["nodes"].as_array().expect("a list of pairs");
    nodes.iter().filter(|pair| pair["status"] == status).map(name).collect()
}

/// Checks which pairs of a report were executed.
#[track_caller]
pub fn executed<const N: usize>(report: &Json, expected: [&str; N]) {
    assert_eq!(pairs(report, "executed"), expected.map(str::to_owned).into(), "{:#}", report["nodes"]);
}

/// The first pair of a node.
pub fn pair<'a>(report: &'a Json, node: &str) -> &'a Json {
    let mut nodes = report["nodes"].as_array().expect("a list of pairs").iter();
    nodes.find(|pair| pair["node"] == node).unwrap_or_else(|| panic!("no pair of {node}"))
}

pub fn text(json: &Json) -> &str {
    json.as_str().unwrap_or_else(|| panic!("{json} is no text"))
}

pub fn keys(json: &Json) -> Vec<&str> {
    json.as_object().unwrap_or_else(|| panic!("{json} is no object")).keys().map(String::as_str).collect()
}

/// Nodes of the main job in small: a plate and a matte from files, a feature kept in shape along a bend.
pub const SMALL_JOB: &str = r#"
    "plate":  Load(path: "plate.png"),
    "matte":  Load(path: "matte.png"),
    "mask":   Threshold(image: "matte", channel: "R", above: 0.5),
    "parts":  Components(mask: "mask"),
    "grid":   Lattice(domain: "plate", cell: 4.0),
    "factor": FeatureFactor(grid: "grid", features: "parts"),
    "bend":   Arc(grid: "grid", angle: 60.0),
    "keep":   FeatureWarp(warp: "bend", factor: "factor"),
    "warped": Resample(image: "plate", warp: "keep", fit: true),
    "out":    Save(image: "warped", path: "out/small.png"),"#;

/// A desk with the small job as `job.ron`.
pub fn small_job() -> Desk {
    let desk = Desk::new();
    desk.card("plate.png", "Checker(size: (48, 48), cell: 6.0)");
    desk.card("matte.png", "Checker(size: (48, 48), cell: 24.0)");
    desk.graph("job.ron", SMALL_JOB);
    desk
}

pub fn graphs() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs"))
}
