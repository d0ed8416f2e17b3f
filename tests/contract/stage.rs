//! Puts a node type into a graph with fitting sources and runs it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, LazyLock, Mutex};

use tempfile::TempDir;
use warploom_core::diag::{Code, Fault};
use warploom_core::engine::{Delivery, Engine, Job, Report, Settings, Status};
use warploom_core::graph::check::{Checked, Options, check};
use warploom_core::node::OutputKind;
use warploom_core::registry::{NodeType, Registry, def};
use warploom_core::schema::{Arity, PortShape, Shape};
use warploom_core::value::{Kind, Value};
use warploom_nodes::NODES;
use warploom_nodes::io::codec;

use crate::given::{Given, Which};
use crate::texts;

pub static REGISTRY: LazyLock<Registry> = LazyLock::new(|| Registry::new(&[NODES, &[def::<Given>("Given")]].concat()));

/// The node types under contract.
pub fn node_types() -> impl Iterator<Item = &'static NodeType> {
    NODES.iter().map(|(name, _)| &**REGISTRY.get(name).expect("it is in the list"))
}

/// Sources of a kind in the graph of [`Subject::graph`]; the first is the usual one.
pub fn sources(kind: Kind) -> &'static [&'static str] {
    match kind {
        Kind::Image => &["given.image", "plain.image"],
        Kind::Mask => &["given.mask", "plain.mask"],
        Kind::Field => &["given.field", "plain.field"],
        Kind::Labels => &["given.labels", "plain.labels"],
        Kind::Grid => &["grid", "fine", "periodic"],
        Kind::Warp => {
            &["warp", "turned", "finely", "given.backward", "given.wild", "given.far", "given.collapsed", "plain.far"]
        }
        Kind::Factor => &["factor", "stiff", "pins", "fine_pins", "sets", "plain_sets", "guide", "plain_guide"],
        Kind::Points => &["given.points", "plain.points"],
        Kind::Mesh => &["given.mesh", "plain.mesh", "ball", "given.bare", "given.ragged"],
        Kind::Number => &["given.number", "plain.number"],
        Kind::Text => &["given.text", "plain.text"],
        Kind::Plugin(_) => &[],
    }
}

/// All sources that a port takes, the usual one first: of factors, those of the solver that it knows.
fn fitting(port: &PortShape) -> Vec<&'static str> {
    let of_maker: &[&str] = match port.maker.as_deref() {
        None => return port.kinds.iter().flat_map(|kind| sources(*kind)).copied().collect(),
        Some("FeatureFactor") => &["factor", "stiff"],
        Some("HandleFactor") => &["pins", "fine_pins"],
        Some("SimilarSets") => &["sets", "plain_sets"],
        Some("SimilarityGuide") => &["guide", "plain_guide"],
        Some(maker) => panic!("no {maker} is on the stage"),
    };
    of_maker.to_vec()
}

/// The usual value of a parameter that must be given: of points on a picture, one that lies on every picture.
fn given(node_type: &NodeType, param: &str, shape: &Shape, which: Which) -> String {
    match (&*node_type.name, param) {
        ("Similarity", "at") => "[(0.5, 0.5)]".into(),
        _ => texts::sample(shape, &format!("{which:?}")),
    }
}

/// A node with its connections and parameters.
#[derive(Clone)]
pub struct Subject {
    pub node_type: &'static NodeType,
    pub which: Which,
    /// Source per port.
    pub ports: BTreeMap<String, &'static str>,
    /// Text per parameter that is given.
    pub params: BTreeMap<String, String>,
}

impl Subject {
    /// Usual sources, and parameters only where there is no default.
    pub fn new(node_type: &'static NodeType, which: Which) -> Self {
        let ports = node_type.ports().map(|(param, port)| (param.name.clone(), fitting(port)[0]));
        let missing = node_type.params.iter().filter(|p| p.required && !matches!(p.shape, Shape::Port(_)));
        let params = missing.map(|p| (p.name.clone(), given(node_type, &p.name, &p.shape, which)));
        let none = Self { node_type, which, ports: ports.collect(), params: BTreeMap::new() };
        params.fold(none, |subject, (name, text)| subject.with(&name, &text))
    }

    pub fn with(&self, param: &str, text: &str) -> Self {
        let mut other = self.clone();
        // Files are pictures, but for nodes that make meshes.
        let makes_mesh = self.node_type.outputs.first().is_some_and(|output| output.kind == OutputKind::Is(Kind::Mesh));
        let text = if makes_mesh { text.replace(".exr", ".obj").replace(".png", ".ply") } else { text.to_owned() };
        other.params.insert(param.to_owned(), text);
        other
    }

    pub fn connected(&self, port: &str, source: &'static str) -> Self {
        let mut other = self.clone();
        other.ports.insert(port.to_owned(), source);
        other
    }

    /// The same with every other source on each of its ports in turn.
    pub fn reconnected(&self) -> Vec<Subject> {
        let ports = self.node_type.ports();
        let choices = ports.flat_map(|(param, port)| {
            let others = fitting(port).into_iter().filter(|source| *source != self.ports[&param.name]);
            others.map(|source| self.connected(&param.name, source))
        });
        choices.collect()
    }

    /// The same with other values of each of its parameters in turn, where these go together with the rest.
    pub fn reset(&self, values: fn(&Shape) -> Vec<String>) -> Vec<Subject> {
        let params = self.node_type.params.iter().filter(|param| !matches!(param.shape, Shape::Port(_)));
        let choices = params.flat_map(|param| {
            let texts = texts::each_leaf(param, &mut |leaf| values(leaf));
            let fits = |text: &String| param.extensions.is_empty() || param.extensions.iter().any(|e| text.contains(e));
            texts.into_iter().filter(fits).map(|text| self.with(&param.name, &text)).collect::<Vec<_>>()
        });
        choices.filter(Self::goes_together).collect()
    }

    fn goes_together(&self) -> bool {
        let checked = check(&self.graph(), &REGISTRY, &Options::new(Path::new("graph.ron")));
        checked.faults.iter().all(|fault| fault.code != Code::Conflict)
    }

    fn port_text(&self, name: &str, port: &PortShape) -> String {
        let source = self.ports[name];
        match port.arity {
            Arity::List => format!("[\"{source}\", \"{}\"]", source.replace("given.", "plain.")),
            _ => format!("\"{source}\""),
        }
    }

    pub fn graph(&self) -> String {
        let ports = self.node_type.ports().map(|(param, port)| (&param.name, self.port_text(&param.name, port)));
        let params = self.params.iter().map(|(name, text)| (name, text.clone()));
        let fields: Vec<String> = ports.chain(params).map(|(name, text)| format!("{name}: {text}")).collect();
        format!(
            r#"Graph(version: 1, nodes: {{
    "given": Given(which: {:?}),
    "plain": Given(which: Plain),
    "grid": Lattice(domain: "given.image", cell: 7.0),
    "fine": Lattice(domain: "given.image", cell: 3.0),
    "periodic": Lattice(domain: "given.image", cell: 7.0, periodic: Both),
    "warp": Arc(grid: "grid", angle: 40.0),
    "turned": Affine(grid: "grid", rotate: 30.0, scale: (0.75, -1.25)),
    "finely": Arc(grid: "fine", angle: -40.0),
    "factor": FeatureFactor(grid: "grid", features: "given.labels"),
    "stiff": FeatureFactor(grid: "grid", features: "given.labels", weight: 100.0),
    "pins": HandleFactor(grid: "grid"),
    "fine_pins": HandleFactor(grid: "fine"),
    "sets": SimilarSets(image: "given.image"),
    "plain_sets": SimilarSets(image: "plain.image"),
    "guide": SimilarityGuide(image: "given.image"),
    "plain_guide": SimilarityGuide(image: "plain.image"),
    "ball": Sphere(segments: 12, rings: 6),
    "it": {}({}),
}})"#,
            self.which,
            self.node_type.name,
            fields.join(", ")
        )
    }
}

/// What a run gave.
pub struct Outcome {
    pub report: Report,
    /// The subject's outputs.
    pub values: Vec<Value>,
}

impl Outcome {
    /// What became of the subject itself.
    pub fn status(&self) -> Option<Status> {
        self.report.nodes.iter().find(|pair| &*pair.node == "it").map(|pair| pair.status)
    }

    /// Digests of all outputs and of all files written; what stopped it, if anything did.
    pub fn bits(&self) -> (Vec<String>, Vec<(Code, String)>) {
        let values = self.values.iter().map(|value| value.digest().hex());
        let files = self.report.outputs.iter().map(|output| output.blake3.expect("it was written").hex());
        let faults = self.report.faults.iter().map(|fault: &Fault| (fault.code, fault.message.clone()));
        // Of faults upstream that have nothing to do with each other, either may come first.
        let mut faults: Vec<_> = faults.collect();
        faults.sort_by_key(|(code, message)| (code.name(), message.clone()));
        (values.chain(files).collect(), faults)
    }
}

/// A folder with the files that nodes may read.
pub struct Stage {
    folder: TempDir,
}

/// Enough for every sound case, and little enough that the outrageous ones are refused.
const BUDGET: u64 = 64 << 20;

pub fn engine(threads: usize) -> Engine {
    Engine::new(Settings { threads, memory: BUDGET, ..Settings::default() })
}

impl Stage {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("in")).expect("a folder");
        let write = |name: String, extension: &str, which: Which| {
            let options = codec::WriteOptions::default();
            // A picture that the format cannot hold leaves no file: a fault that nodes must report well, too.
            if let Ok(bytes) = codec::encode_image(&which.image(), extension, &options, &|_| Ok(())) {
                std::fs::write(folder.path().join("in").join(name), bytes).expect("written");
            }
        };
        for which in Which::ALL.into_iter().filter(|which| *which != Which::Vast) {
            write(format!("{which:?}.exr"), "exr", which);
        }
        write("Plain.png".into(), "png", Which::Plain);
        write("Copy.exr".into(), "exr", Which::Plain);
        let mesh =
            |name: String, text: &str| std::fs::write(folder.path().join("in").join(name), text).expect("written");
        Which::ALL.into_iter().for_each(|which| mesh(format!("{which:?}.obj"), &which.obj()));
        mesh("Copy.obj".into(), &Which::Plain.obj());
        mesh("Plain.ply".into(), include_str!("plain.ply"));
        Self { folder }
    }

    pub fn check(&self, graph: &str, frames: Option<Vec<i64>>) -> Checked {
        let file = self.folder.path().join("graph.ron");
        check(graph, &REGISTRY, &Options { targets: &["it".to_owned()], frames, ..Options::new(&file) })
    }

    pub fn run(&self, engine: &Engine, subject: &Subject) -> Outcome {
        let graph = subject.graph();
        let checked = self.check(&graph, None);
        let plan = Arc::new(checked.plan.unwrap_or_else(|| panic!("{graph}\n{:#?}", checked.faults)));
        let it = plan.node("it").expect("it is in the graph");
        let values = Mutex::new(Vec::new());
        let keep = |found: Delivery| {
            *values.lock().expect("no panic") = found.values.to_vec();
            Ok(())
        };
        let report = engine.run(&plan, &Job { deliver: vec![it], on_values: &keep, ..Job::default() });
        Outcome { report, values: values.into_inner().expect("no panic") }
    }
}
