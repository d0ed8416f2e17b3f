//! `--dump`: the value on any edge, written for looking at or for other programs.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};
use warploom_core::diag::{Code, Fault};
use warploom_core::engine::{Delivery, cannot_write, plain, write_file};
use warploom_core::graph::frames::{Folding, expand_pattern, has_pattern, paths_over};
use warploom_core::graph::plan::Plan;
use warploom_core::node::{NodeError, OutputKind};
use warploom_core::value::{Buffer, Channel, Direction, Grid, Image, Kind, Plane, Rect, SampleType, Value, Warp};
use warploom_nodes::io::codec::{EXTENSIONS, Host, WriteOptions, as_image, encode_image};

/// One `NODE[.PORT]=FILE`.
pub struct Dump {
    pub node: String,
    port: Option<String>,
    path: PathBuf,
}

impl Dump {
    pub fn parse(text: &str) -> Result<Self, Fault> {
        let (name, path) = text
            .split_once('=')
            .filter(|(name, path)| !name.is_empty() && !path.is_empty())
            .ok_or_else(|| Fault::new(Code::Usage, format!("--dump {text}: write NODE=FILE or NODE.PORT=FILE")))?;
        let (node, port) = match name.split_once('.') {
            Some((node, port)) => (node, Some(port.to_owned())),
            None => (name, None),
        };
        let path = std::path::absolute(path).unwrap_or_else(|_| path.into());
        Ok(Self { node: node.to_owned(), port, path })
    }
}

/// A dump whose node, output and files are found.
pub struct Planned {
    pub node: usize,
    output: usize,
    path: PathBuf,
    /// Frames of the run, each of which gets its file where the path has a pattern.
    frames: Vec<i64>,
}

/// Finds nodes and outputs; a fault per dump that cannot be done. `taken` are the files that have a use already, as
/// [`Folding`] gives them; those of the dumps come to them.
pub fn plan(
    dumps: &[Dump],
    plan: &Plan,
    folding: &mut Folding,
    taken: &mut HashSet<String>,
) -> Result<Vec<Planned>, Vec<Fault>> {
    let (mut planned, mut faults) = (Vec::new(), Vec::new());
    for dump in dumps {
        match find(dump, plan).and_then(|found| found.take(folding, taken)) {
            Ok(found) => planned.push(found),
            Err(fault) => faults.push(fault.node(&dump.node)),
        }
    }
    if faults.is_empty() { Ok(planned) } else { Err(faults) }
}

fn find(dump: &Dump, plan: &Plan) -> Result<Planned, Fault> {
    let usage = |message: String| Fault::new(Code::Usage, message);
    let node = plan.node(&dump.node).ok_or_else(|| usage(format!("there is no node `{}` to dump", dump.node)))?;
    let node_type = &plan.nodes[node].node_type;
    let output = match &dump.port {
        Some(port) => node_type.output(port),
        None => (!node_type.outputs.is_empty()).then_some(0),
    };
    let output = output.ok_or_else(|| {
        let names: Vec<&str> = node_type.outputs.iter().map(|output| output.name).collect();
        let what = if names.is_empty() { "none: it only writes".into() } else { names.join(", ") };
        usage(format!("{} has no such output to dump; its outputs are {what}", node_type.name))
    })?;
    let kind = kind(plan, node, output);
    if let Some(error) = kind.and_then(|kind| unwritable(kind, &extension(&dump.path))) {
        return Err(usage(error.message).hint(error.hint));
    }
    let has_pattern = has_pattern(&dump.path.to_string_lossy());
    if !plan.nodes[node].is_static && plan.frames.len() > 1 && !has_pattern {
        let message = format!("--dump would write {} frames to one file", plan.frames.len());
        return Err(usage(message).hint("put #### where the frame number belongs".to_owned()));
    }
    if plan.frames.is_empty() && has_pattern {
        let message = format!("there are no frames to number {} by", dump.path.display());
        return Err(usage(message).hint("give --frames, or leave the # out".to_owned()));
    }
    Ok(Planned { node, output, path: dump.path.clone(), frames: plan.frames.clone() })
}

/// What comes out of a node's output, as far as its connections tell.
fn kind(plan: &Plan, mut node: usize, mut output: usize) -> Option<Kind> {
    loop {
        match plan.nodes[node].node_type.outputs[output].kind {
            OutputKind::Is(kind) => return Some(kind),
            OutputKind::SameAs(port) => {
                let slot = plan.nodes[node].slots.iter().find(|slot| slot.port == port)?;
                (node, output) = (slot.source, slot.output);
            }
        }
    }
}

impl Planned {
    /// Takes its files, unless one has a use already.
    fn take(self, folding: &mut Folding, taken: &mut HashSet<String>) -> Result<Self, Fault> {
        let pattern = self.path.to_string_lossy();
        for path in paths_over(("", &pattern), &self.frames) {
            if !taken.insert(folding.folded(&path)) {
                let message = format!("--dump would write {path}, which the run reads or writes already");
                return Err(Fault::new(Code::Usage, message).hint("dump to another file".to_owned()));
            }
        }
        Ok(self)
    }

    /// The files that hold the value of `frame`. What is the same for all frames goes to the file of each.
    fn paths(&self, frame: Option<i64>) -> Vec<PathBuf> {
        let pattern = self.path.to_string_lossy();
        let at = |&frame: &i64| PathBuf::from(expand_pattern(&pattern, frame));
        match frame {
            _ if !has_pattern(&pattern) => vec![self.path.clone()],
            Some(frame) => vec![at(&frame)],
            None => self.frames.iter().map(at).collect(),
        }
    }
}

/// Writes the dumps of a node, and says `wrote` of each file.
pub fn write(dumps: &[Planned], delivery: &Delivery, wrote: impl Fn(&Path)) -> Result<(), Fault> {
    for dump in dumps.iter().filter(|dump| dump.node == delivery.node) {
        let value = &delivery.values[dump.output];
        let bytes = encode(value, &dump.path, &|bytes| (delivery.reserve)(bytes)).map_err(|error| {
            let message = format!("cannot dump to {}: {}", dump.path.display(), error.message);
            Fault::new(error.class.into(), message).hint(error.hint)
        })?;
        for path in dump.paths(delivery.frame) {
            write_file(&path, &bytes).map_err(|error| {
                let message = format!("cannot write {}: {}", path.display(), plain(&error));
                Fault::new(Code::OutputUnwritable, message).hint(cannot_write(&error).to_owned())
            })?;
            wrote(&path);
        }
    }
    Ok(())
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// Why a kind does not go into files of an extension, if it does not.
fn unwritable(kind: Kind, extension: &str) -> Option<NodeError> {
    let allowed: &[&str] = match kind {
        Kind::Image => &EXTENSIONS,
        Kind::Mask | Kind::Field => &["exr"],
        Kind::Labels | Kind::Warp => &["exr", "json"],
        Kind::Plugin(_) => &[],
        _ => &["json"],
    };
    if allowed.contains(&extension) {
        return None;
    }
    let file = if extension.is_empty() { "a file without extension".into() } else { format!("`.{extension}`") };
    let error = NodeError::refused(format!("{kind} is not written as {file}"));
    Some(if allowed.is_empty() {
        error
    } else {
        error.hint(format!("give the file the extension {}", allowed.join(" or ")))
    })
}

fn encode(value: &Value, path: &Path, host: &dyn Host) -> Result<Vec<u8>, NodeError> {
    let extension = extension(path);
    if let Some(error) = unwritable(value.kind(), &extension) {
        return Err(error);
    }
    let image = |image: &Image| encode_image(image, &extension, &WriteOptions::default(), host);
    if extension == "json" {
        // A number is a node of a tree before it is text.
        host.reserve(8 * u128::from(value.bytes()))?;
    }
    let json = match value {
        Value::Image(picture) => return image(picture),
        Value::Warp(warp) if extension == "exr" => return image(&warp_image(warp)),
        Value::Warp(warp) => warp_json(warp)?,
        Value::Labels(labels) if extension == "json" => json!({ "kind": "Labels", "components": labels.table }),
        Value::Mask(_) | Value::Field(_) | Value::Labels(_) => {
            return image(&as_image(value).expect("rasters can be shown as pictures"));
        }
        Value::Grid(grid) => grid_json(grid),
        Value::Factor(factor) => factor.summary.clone(),
        Value::Points(points) => json!({ "kind": "Points", "positions": points.positions }),
        Value::Mesh(mesh) => json!({
            "kind": "Mesh", "positions": mesh.positions, "uvs": mesh.uvs, "normals": mesh.normals,
            "triangles": mesh.triangles,
        }),
        Value::Number(number) => json!({ "kind": "Number", "value": number }),
        Value::Text(text) => json!({ "kind": "Text", "value": **text }),
        Value::Plugin(_) => return Err(NodeError::refused("a plugin's own kind is not written")),
    };
    Ok(format!("{json}\n").into_bytes())
}

fn grid_json(grid: &Grid) -> Json {
    json!({ "kind": "Grid", "origin": grid.origin, "spacing": grid.spacing, "nodes": grid.nodes, "periodic": grid.periodic })
}

fn warp_json(warp: &Warp) -> Result<Json, NodeError> {
    if warp.x.iter().chain(&*warp.y).any(|position| !position.is_finite()) {
        let error = NodeError::refused("the warp has positions that are not finite, which JSON cannot hold");
        return Err(error.hint("write it as .exr"));
    }
    let direction = match warp.direction {
        Direction::DstFromSrc => "dst_from_src",
        Direction::SrcFromDst => "src_from_dst",
    };
    let Grid { origin, spacing, nodes, .. } = warp.grid;
    Ok(json!({
        "kind": "Warp", "direction": direction, "origin": origin, "spacing": spacing, "nodes": nodes,
        "x": *warp.x, "y": *warp.y,
    }))
}

/// One pixel per lattice node, for looking.
fn warp_image(warp: &Warp) -> Image {
    let [columns, rows] = warp.grid.nodes;
    let channel = |name: &str, positions: &[f64]| {
        let samples: Vec<f32> = positions.iter().map(|&position| position as f32).collect();
        let plane = Plane::F32(Buffer::from_packed(&samples, columns, rows));
        Channel { name: name.into(), sample_type: SampleType::Float, plane }
    };
    Image::new(Rect::at(0, 0, columns, rows), vec![channel("x", &warp.x), channel("y", &warp.y)])
}
