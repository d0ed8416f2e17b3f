//! A folder of its own, and the binary at work in it.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value as Json;
use tempfile::TempDir;

/// Longer than anything here takes: whatever is not done by then hangs.
const HANGS: Duration = Duration::from_secs(1800);

/// A temporary folder with a graph, its outputs in `out` and its cache.
pub struct Place {
    folder: TempDir,
    binary: PathBuf,
}

impl Place {
    /// An empty folder.
    pub fn new(binary: &Path) -> Self {
        Self { folder: tempfile::tempdir().expect("a folder"), binary: binary.to_owned() }
    }

    /// The path of a file in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a graph of these nodes over frames.
    pub fn shot(&self, name: &str, frames: &str, nodes: &str) {
        let text = format!("Graph(version: 1, frames: \"{frames}\", nodes: {{\n{nodes}\n}})\n");
        std::fs::write(self.path(name), text).expect("a graph");
    }

    /// A command line of the binary; its words are separated by spaces.
    pub fn command(&self, line: &str) -> Command {
        let mut command = Command::new(&self.binary);
        command.args(line.split_whitespace());
        self.prepare(&mut command);
        command
    }

    /// Sets the folder and the streams of a command; what it says goes to a file.
    pub fn prepare(&self, command: &mut Command) {
        command.current_dir(self.folder.path()).env("WARPLOOM_CACHE", self.path("cache"));
        let stderr = File::create(self.path("stderr.txt")).expect("a file");
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr);
    }

    /// Runs a command line; gives its exit code, none if a signal ended it, and the seconds it took.
    pub fn run(&self, line: &str) -> (Option<i32>, f64) {
        let start = Instant::now();
        let mut child = self.command(line).spawn().expect("the binary starts");
        (wait(&mut child, || {}), start.elapsed().as_secs_f64())
    }

    /// What the last command said.
    pub fn stderr(&self) -> String {
        std::fs::read_to_string(self.path("stderr.txt")).unwrap_or_default()
    }

    /// A report that a run wrote; null if it wrote none.
    pub fn report(&self, name: &str) -> Json {
        let text = std::fs::read(self.path(name)).unwrap_or_default();
        serde_json::from_slice(&text).unwrap_or_default()
    }

    /// The outputs by name, temporary files left out.
    pub fn outputs(&self) -> BTreeMap<String, Vec<u8>> {
        let finals = self.names().into_iter().filter(|name| !is_temporary(name));
        finals.map(|name| (name.clone(), std::fs::read(self.path("out").join(name)).expect("readable"))).collect()
    }

    /// Names of temporary files beside the outputs.
    pub fn temporaries(&self) -> Vec<String> {
        self.names().into_iter().filter(|name| is_temporary(name)).collect()
    }

    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.path("out")).into_iter().flatten();
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect()
    }
}

fn is_temporary(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(".tmp")
}

/// Waits for the end of a process and looks after it every millisecond; gives its exit code.
pub fn wait(child: &mut Child, mut look: impl FnMut()) -> Option<i32> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("a child of this process") {
            return status.code();
        }
        if start.elapsed() > HANGS {
            let _ = child.kill();
            panic!("process {} hangs", child.id());
        }
        look();
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Sends a signal, `INT` or `TERM`, to a process that may have ended.
pub fn signal(child: &Child, name: &str) {
    let mut command = Command::new("kill");
    command.args([&format!("-{name}"), &child.id().to_string()]).stderr(Stdio::null());
    command.status().expect("the command `kill`");
}
