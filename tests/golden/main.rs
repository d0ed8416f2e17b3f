//! What every node type draws, picture by picture: `golden/NODE/ISSUE.ron` gives `golden/NODE/ISSUE.png`.
//!
//! A graph's node `out` is the picture; masks are shown in grey, labels in colours, a sink's file as written, an EXR
//! through the sRGB transfer. The largest difference allowed, white being 1, stands in the graph as
//! `// tolerance: 0.004`. A failure leaves `expected | actual | difference` in the target folder.
//! `UPDATE_GOLDEN=NODE` rewrites that node's pictures: look at them before they are committed.

#![allow(missing_docs)]

mod pictures;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use warploom_core::engine::{Delivery, Engine, Job, Settings};
use warploom_core::graph::check::{Options, check};
use warploom_core::graph::plan::Plan;
use warploom_core::registry::Registry;
use warploom_core::value::Value;
use warploom_nodes::NODES;

/// Longest side of an expected picture.
const MAX_SIDE: u32 = 64;

/// One graph and the picture it must give.
struct Golden {
    /// Folder: the node type in snake case.
    node: String,
    /// File without extension.
    issue: String,
    graph: PathBuf,
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("golden")
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let mut entries: Vec<PathBuf> = entries.collect();
    entries.sort();
    entries
}

fn goldens() -> Vec<Golden> {
    let name = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folders = entries(&folder()).into_iter().filter(|path| path.is_dir());
    let graphs = folders.flat_map(|folder| {
        let graphs = entries(&folder).into_iter().filter(|path| path.extension().is_some_and(|e| e == "ron"));
        graphs.map(move |graph| Golden { node: name(&folder), issue: name(&graph), graph })
    });
    graphs.collect()
}

fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    for letter in name.chars() {
        if letter.is_ascii_uppercase() && !snake.is_empty() {
            snake.push('_');
        }
        snake.push(letter.to_ascii_lowercase());
    }
    snake
}

impl Golden {
    fn expected(&self) -> PathBuf {
        self.graph.with_extension("png")
    }

    /// Where the graph may write, and where a failure is shown.
    fn scratch(&self) -> PathBuf {
        Path::new(env!("CARGO_TARGET_TMPDIR")).join("golden").join(&self.node)
    }

    fn text(&self) -> String {
        std::fs::read_to_string(&self.graph).expect("the graph is text")
    }

    fn tolerance(&self) -> Result<f64, String> {
        let text = self.text();
        let given = text.lines().find_map(|line| line.strip_prefix("// tolerance:"));
        let missing = || "a line `// tolerance: 0.004` is missing".to_owned();
        given.ok_or_else(missing)?.trim().parse().map_err(|error| format!("tolerance: {error}"))
    }

    fn plan(&self, registry: &Registry) -> Result<Plan, String> {
        let out = self.scratch().to_string_lossy().into_owned();
        let variable = |name: &str| (name == "OUT").then(|| out.clone());
        let options = Options { targets: &["out".to_owned()], variable: &variable, ..Options::new(&self.graph) };
        let checked = check(&self.text(), registry, &options);
        let rendered: Vec<String> =
            checked.faults.iter().chain(&checked.warnings).map(|fault| fault.render(false, false, 120)).collect();
        match (checked.plan, &rendered[..]) {
            (Some(plan), []) => Ok(plan),
            _ => Err(rendered.join("\n")),
        }
    }

    /// The bytes of the PNG that the graph gives now.
    fn render(&self, engine: &Engine, registry: &Registry) -> Result<Vec<u8>, String> {
        let plan = Arc::new(self.plan(registry)?);
        let out = plan.node("out").ok_or("there is no node `out`")?;
        let values: Mutex<Vec<Value>> = Mutex::default();
        let keep = |found: Delivery| {
            values.lock().expect("no panic").extend(found.values.first().cloned());
            Ok(())
        };
        let report = engine.run(&plan, &Job { deliver: vec![out], on_values: &keep, ..Job::default() });
        if let Some(fault) = report.faults.first() {
            return Err(fault.render(false, false, 120));
        }
        let values = values.into_inner().expect("no panic");
        match (&values[..], &report.outputs[..]) {
            ([value], []) => pictures::png(value),
            ([], [file]) => pictures::of_file(&std::fs::read(&file.path).map_err(|error| error.to_string())?),
            _ => Err(format!("{} values and {} files; one is shown", values.len(), report.outputs.len())),
        }
    }

    fn compare(&self, actual: &[u8]) -> Result<(), String> {
        let expected = std::fs::read(self.expected()).map_err(|_| "there is no expected picture".to_owned())?;
        let [expected, actual] = [&expected, actual].map(pictures::read);
        let (expected, actual) = (expected?, actual?);
        if expected.width().max(expected.height()) > MAX_SIDE {
            return Err(format!("the picture is larger than {MAX_SIDE} px"));
        }
        let (difference, tolerance) = (pictures::difference(&expected, &actual), self.tolerance()?);
        if difference <= tolerance {
            return Ok(());
        }
        let shown = self.scratch().join(format!("{}.png", self.issue));
        pictures::show(&expected, &actual, &shown)?;
        Err(format!("differs by {difference:.4}, allowed are {tolerance}; see {}", shown.display()))
    }
}

#[test]
fn every_picture_is_as_expected() {
    let registry = Registry::new(NODES);
    let engine = Engine::new(Settings { threads: 2, memory: 1 << 30, ..Settings::default() });
    let update = std::env::var("UPDATE_GOLDEN").unwrap_or_default();
    let mut failures = Vec::new();
    for golden in goldens() {
        let checked = golden.render(&engine, &registry).and_then(|actual| {
            if golden.node == update {
                std::fs::write(golden.expected(), &actual).map_err(|error| error.to_string())?;
            }
            golden.compare(&actual)
        });
        if let Err(problem) = checked {
            failures.push(format!("{}/{}: {problem}", golden.node, golden.issue));
        }
    }
    assert!(failures.is_empty(), "UPDATE_GOLDEN=NODE rewrites\n{}", failures.join("\n"));
}

#[test]
fn every_node_has_a_golden_and_every_golden_a_node() {
    let registry = Registry::new(NODES);
    let goldens = goldens();
    for (name, _) in NODES {
        let found = goldens.iter().find(|golden| golden.node == snake_case(name) && golden.issue == "graph");
        assert!(found.is_some(), "golden/{}/graph.ron is missing", snake_case(name));
    }
    for golden in &goldens {
        let plan = golden.plan(&registry).unwrap_or_else(|faults| panic!("{faults}"));
        let used = plan.nodes.iter().any(|node| snake_case(&node.node_type.name) == golden.node);
        assert!(used, "{} has no node of the type its folder names", golden.graph.display());
        assert!(golden.expected().exists(), "{} has no picture", golden.graph.display());
    }
    for picture in entries(&folder()).iter().filter(|path| path.is_dir()).flat_map(|folder| entries(folder)) {
        let text: String = goldens.iter().map(Golden::text).collect();
        let name = picture.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let is_expected = picture.with_extension("ron").exists();
        assert!(is_expected || text.contains(&name), "no graph gives or reads {}", picture.display());
    }
}
