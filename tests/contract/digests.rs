//! Bits of every node type on one fixed input, stored per version: other bits need a raised `VERSION`.
//!
//! `UPDATE_DIGESTS=1` writes what is new. It does not overwrite: where the bits of a version differ, the version is to
//! be raised (or, if it was never released, its entry deleted from `digests.json` by hand).

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use warploom_core::value::{Buffer, Digest, Plane, Sample, Value};

use crate::given::Which;
use crate::stage::{Outcome, Stage, Subject, engine, node_types};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Stored {
    version: u32,
    /// Digest per output.
    outputs: BTreeMap<String, String>,
}

/// Of node types whose bits hold on one processor family only, numbers are rounded to this.
const ROUNDED: f64 = 1e-4;

fn stored(subject: &Subject, outcome: &Outcome) -> Stored {
    let node_type = subject.node_type;
    let digest = |value: &Value| {
        let mut content = Content { bytes: Vec::new(), exact: !node_type.cpu_family };
        content.value(value);
        Digest::of_bytes(&content.bytes).hex()
    };
    let values = node_type.outputs.iter().zip(&outcome.values);
    let values = values.map(|(output, value)| (output.name.to_owned(), digest(value)));
    // The formats written here are the lossless ones, whose bytes no processor changes.
    let files =
        outcome.report.outputs.iter().map(|output| ("file".to_owned(), output.blake3.expect("it was written").hex()));
    Stored { version: node_type.version, outputs: values.chain(files).collect() }
}

/// What a value holds, as bytes; unlike its own digest, no business of the engine's.
struct Content {
    bytes: Vec<u8>,
    exact: bool,
}

impl Content {
    fn about(&mut self, what: &impl std::fmt::Debug) {
        self.bytes.extend(format!("{what:?};").as_bytes());
    }

    fn numbers(&mut self, numbers: impl Iterator<Item = f64>) {
        for number in numbers {
            let bits = if self.exact { number.to_bits() } else { (number / ROUNDED).round() as i64 as u64 };
            self.bytes.extend(bits.to_le_bytes());
        }
    }

    /// The numbers of a JSON text are rounded where others are.
    fn text(&mut self, text: &str) {
        match serde_json::from_str(text) {
            Ok(json) if !self.exact => self.json(&json),
            _ => self.about(&text),
        }
    }

    fn json(&mut self, json: &serde_json::Value) {
        match json {
            serde_json::Value::Number(number) => self.numbers(number.as_f64().into_iter()),
            serde_json::Value::Array(items) => items.iter().for_each(|item| self.json(item)),
            serde_json::Value::Object(fields) => fields.iter().for_each(|(name, value)| {
                self.about(name);
                self.json(value);
            }),
            other => self.about(other),
        }
    }

    fn raster<T: Sample + Into<f64>>(&mut self, samples: &Buffer<T>) {
        self.about(&(samples.width(), samples.height()));
        self.numbers(samples.rows().flatten().map(|sample| (*sample).into()));
    }

    fn value(&mut self, value: &Value) {
        self.about(&(value.kind(), value.windows()));
        match value {
            Value::Image(image) => image.layers.iter().for_each(|layer| {
                self.about(&(&layer.name, layer.data, &layer.metadata));
                for channel in &layer.channels {
                    self.about(&(&channel.name, channel.sample_type));
                    match &channel.plane {
                        Plane::F32(samples) => self.raster(samples),
                        Plane::U32(samples) => self.raster(samples),
                    }
                }
            }),
            Value::Mask(mask) => self.raster(&mask.0.samples),
            Value::Field(field) => self.raster(&field.0.samples),
            Value::Labels(labels) => {
                self.raster(&labels.raster.samples);
                self.about(&labels.table);
            }
            Value::Grid(grid) => self.about(grid),
            Value::Warp(warp) => {
                self.about(&(warp.grid, warp.direction));
                self.numbers(warp.x.iter().chain(warp.y.iter()).copied());
            }
            // The solver itself is seen in what FeatureWarp makes of it.
            Value::Factor(factor) => self.about(&(factor.grid, factor.summary.to_string())),
            Value::Mesh(mesh) => {
                self.about(&(mesh.positions.len(), mesh.uvs.len(), mesh.normals.len(), &mesh.triangles));
                let (uvs, vectors) = (mesh.uvs.as_flattened(), [&mesh.positions, &mesh.normals]);
                self.numbers(vectors.into_iter().flat_map(|vectors| vectors.as_flattened()).chain(uvs).copied());
            }
            Value::Number(number) => self.numbers([*number].into_iter()),
            Value::Text(text) => self.text(text),
            other => panic!("say what a {} holds", other.kind()),
        }
    }
}

#[test]
fn changed_bits_raise_the_version() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("contract/digests.json");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|_| "{}".into());
    let mut known: BTreeMap<String, Stored> = serde_json::from_str(&text).expect("digests.json is JSON");
    let update = std::env::var_os("UPDATE_DIGESTS").is_some_and(|value| value == "1");
    let (stage, engine) = (Stage::new(), engine(2));
    let mut problems = Vec::new();
    let mut fresh = BTreeMap::new();
    for node_type in node_types() {
        let (name, subject) = (node_type.name.to_string(), Subject::new(node_type, Which::Large));
        let outcome = stage.run(&engine, &subject);
        assert!(outcome.report.faults.is_empty(), "{name}: {:#?}", outcome.report.faults);
        let now = stored(&subject, &outcome);
        match known.remove(&name) {
            Some(before) if before == now => {}
            Some(before) if before.version == now.version => {
                problems.push(format!("{name} gives other bits than version {} did: raise its VERSION", now.version));
            }
            _ if update => {}
            Some(_) | None => problems.push(format!("{name} is new: run once with UPDATE_DIGESTS=1")),
        }
        fresh.insert(name, now);
    }
    let gone = known.keys().filter(|_| !update);
    problems.extend(gone.map(|name| format!("{name} is gone: run once with UPDATE_DIGESTS=1")));
    assert!(problems.is_empty(), "{}", problems.join("\n"));
    if update {
        let text = serde_json::to_string_pretty(&fresh).expect("JSON") + "\n";
        std::fs::write(&path, text).expect("digests.json is written");
    }
}
