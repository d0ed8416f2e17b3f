//! Node types that put values of every storable kind on disk, and runs of graphs of them.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_core::engine::{Delivery, Engine, Job, Report};
use warploom_core::graph::plan::Plan;
use warploom_core::graph::{Options, check};
use warploom_core::node::{Any, Context, In, Node, NodeError, Output, Outputs, ReadPath, WritePath};
use warploom_core::registry::{Definition, Registry, def};
use warploom_core::value::{
    Attribute, Buffer, Channel, Component, Digest, Direction, Field, Grid, Image, Kind, Labels, Mask, Mesh, Plane,
    Points, Raster, Rect, SampleType, Value, Warp, Windows, encode,
};

use crate::Random;

macro_rules! makers {
    ($($name:ident: $kind:ident = $make:ident;)*) => {$(
        #[doc = concat!("Makes a value of kind ", stringify!($kind), ", another one for each frame and seed.")]
        #[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            /// Another seed gives another value.
            pub seed: u32,
            /// How large it is.
            #[default(2)]
            pub size: u32,
        }

        impl Node for $name {
            const VERSION: u32 = 1;
            const OUTPUTS: &'static [Output] = &[Output::new("value", Kind::$kind)];
            const READS_FRAME: bool = true;
            fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
                let frame = cx.request().frame.unwrap_or_default() as u64;
                let mut random = Random(u64::from(self.seed) << 32 ^ frame);
                Ok($make(&mut random, self.size as usize).into())
            }
        }
    )*};
}

makers! {
    Picture: Image = image;
    Cover: Mask = mask;
    Depth: Field = field;
    Parts: Labels = labels;
    Lattice: Grid = grid;
    Bend: Warp = warp;
    Dots: Points = points;
    Shape: Mesh = mesh;
    Figure: Number = number;
    Word: Text = text;
}

/// A picture made of the bytes of all its inputs.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Stir {
    /// Whatever it is made of.
    pub of: Vec<In<Any>>,
    /// Another number gives another picture.
    pub by: u32,
    /// Pixels along each side.
    #[default(2)]
    pub size: u32,
}

impl Node for Stir {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("value", Kind::Image)];
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let mut seed = u64::from(self.by);
        for value in cx.get_all(&self.of) {
            let [a, b, c, d, e, f, g, h, ..] = Digest::of_bytes(&bytes_of(&value)).0;
            seed = seed.rotate_left(7) ^ u64::from_le_bytes([a, b, c, d, e, f, g, h]);
        }
        Ok(image(&mut Random(seed), self.size as usize).into())
    }
}

/// The text in a file.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Plate {
    /// The file.
    pub path: ReadPath,
}

impl Node for Plate {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("value", Kind::Text)];
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        Ok(Value::Text(String::from_utf8_lossy(&cx.read(&self.path)?).into()).into())
    }
}

/// Writes the bytes of a value.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Keep {
    /// The value.
    pub of: In<Any>,
    /// The file.
    pub path: WritePath,
}

impl Node for Keep {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[];
    const SINK: bool = true;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        cx.write(&self.path, &bytes_of(&cx.get(&self.of)))?;
        Ok(Outputs::default())
    }
}

/// All of these node types.
pub const NODES: &[Definition] = &[
    def::<Bend>("Bend"),
    def::<Cover>("Cover"),
    def::<Depth>("Depth"),
    def::<Dots>("Dots"),
    def::<Figure>("Figure"),
    def::<Keep>("Keep"),
    def::<Lattice>("Lattice"),
    def::<Parts>("Parts"),
    def::<Picture>("Picture"),
    def::<Plate>("Plate"),
    def::<Shape>("Shape"),
    def::<Stir>("Stir"),
    def::<Word>("Word"),
];

fn sample(random: &mut Random) -> f32 {
    (random.next() >> 40) as f32 / 1024.0 - 8192.0
}

fn position(random: &mut Random) -> f64 {
    (random.next() >> 11) as f64 / 4096.0
}

fn many<T>(random: &mut Random, count: usize, one: impl Fn(&mut Random) -> T) -> Vec<T> {
    (0..count).map(|_| one(random)).collect()
}

fn plane(random: &mut Random, size: usize) -> Buffer<f32> {
    Buffer::from_packed(&many(random, size * size, sample), size, size)
}

fn raster(random: &mut Random, size: usize) -> Raster<f32> {
    Raster { windows: Windows::full(Rect::at(0, 0, size, size)), samples: plane(random, size) }
}

/// 8 bytes per pixel: numbers in one channel, identities in the other.
fn image(random: &mut Random, size: usize) -> Value {
    let identities = Buffer::from_packed(&many(random, size * size, |random| random.next() as u32), size, size);
    let channels = vec![
        Channel { name: "Y".into(), sample_type: SampleType::Float, plane: Plane::F32(plane(random, size)) },
        Channel { name: "id".into(), sample_type: SampleType::Uint, plane: Plane::U32(identities) },
    ];
    let mut image = Image::new(Rect::at(-1, 2, size, size), channels);
    let note = Attribute { kind: "string".into(), bytes: random.next().to_le_bytes().to_vec() };
    Arc::make_mut(&mut image.metadata).insert("note".into(), note);
    image.into()
}

fn mask(random: &mut Random, size: usize) -> Value {
    Mask(raster(random, size)).into()
}

fn field(random: &mut Random, size: usize) -> Value {
    Field(raster(random, size)).into()
}

fn labels(random: &mut Random, size: usize) -> Value {
    let windows = Windows::full(Rect::at(0, 0, size, size));
    let samples = Buffer::from_packed(&many(random, size * size, |random| random.next() as u32), size, size);
    let centroid = [position(random), position(random)];
    let row = Component { label: 1, area: random.next(), bounds: windows.data, centroid };
    Labels { raster: Raster { windows, samples }, table: vec![row] }.into()
}

fn lattice(random: &mut Random, size: usize) -> Grid {
    let origin = [position(random), position(random)];
    Grid { origin, spacing: [1.5, 2.5], nodes: [size.max(2); 2], periodic: [true, false] }
}

fn grid(random: &mut Random, size: usize) -> Value {
    lattice(random, size).into()
}

/// 16 bytes per node.
fn warp(random: &mut Random, size: usize) -> Value {
    let grid = lattice(random, size);
    let x = Arc::new(many(random, grid.node_count(), position));
    let y = Arc::new(many(random, grid.node_count(), position));
    Warp { grid, direction: Direction::DstFromSrc, x, y }.into()
}

fn points(random: &mut Random, size: usize) -> Value {
    Points { positions: many(random, size, |random| [position(random), position(random)]) }.into()
}

fn mesh(random: &mut Random, size: usize) -> Value {
    let positions = many(random, size, |random| [position(random), position(random), position(random)]);
    let uvs = many(random, size, |random| [position(random), position(random)]);
    let normals = many(random, size, |random| [position(random), position(random), position(random)]);
    let triangles = many(random, size, |random| [random.next() as u32; 3]);
    Mesh { positions, uvs, normals, triangles }.into()
}

fn number(random: &mut Random, _: usize) -> Value {
    position(random).into()
}

fn text(random: &mut Random, size: usize) -> Value {
    let words = many(random, size, |random| format!("{:x}", random.next()));
    Value::Text(words.join(" ").into())
}

/// All of a value, as bytes.
pub fn bytes_of(value: &Value) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(value, &mut bytes).expect("every kind that these nodes make can be written");
    bytes
}

/// The plan of a graph with these nodes at `frames`; `targets` are its sinks if none are named.
pub fn plan(nodes: &str, frames: &str, folder: &Path, targets: &[&str]) -> Arc<Plan> {
    let text = format!("Graph(version: 1, frames: \"{frames}\", nodes: {{\n{nodes}\n}})");
    let (file, registry) = (folder.join("graph.ron"), Registry::new(NODES));
    let targets: Vec<String> = targets.iter().map(|&target| target.to_owned()).collect();
    let checked = check(&text, &registry, &Options { targets: &targets, ..Options::new(&file) });
    assert!(checked.faults.is_empty(), "{text}\n{:#?}", checked.faults);
    Arc::new(checked.plan.expect("a graph without faults has a plan"))
}

/// Values by node and frame, as bytes.
pub type Values = BTreeMap<(String, Option<i64>), Vec<u8>>;

/// Runs a plan; the values of all targets, which the engine has to find or make.
pub fn values(engine: &Engine, plan: &Arc<Plan>) -> (Values, Report) {
    let found = Mutex::new(Values::new());
    let collect = |Delivery { node, frame, values, .. }: Delivery| {
        let id = plan.nodes[node].id.to_string();
        values.iter().for_each(|value| {
            found.lock().expect("no panic").insert((id.clone(), frame), bytes_of(value));
        });
        Ok(())
    };
    let deliver = (0..plan.nodes.len()).collect();
    let report = engine.run(plan, &Job { deliver, on_values: &collect, ..Job::default() });
    (found.into_inner().expect("no panic"), report)
}
