//! `--dump`: the value on any edge, written for looking at or for other programs.

use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};
use warploom_core::diag::{Code, Fault};
use warploom_core::engine::{Disk, Io};
use warploom_core::graph::frames::{expand_pattern, has_pattern};
use warploom_core::graph::plan::Plan;
use warploom_core::node::NodeError;
use warploom_core::value::{Buffer, Channel, Direction, Grid, Image, Plane, Rect, SampleType, Value, Warp};
use warploom_nodes::io::codec::{WriteOptions, as_image, encode_image};

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

/// A dump whose node and output are found.
pub struct Planned {
    pub node: usize,
    output: usize,
    path: PathBuf,
}

/// Finds nodes and outputs; a fault per dump that cannot be done.
pub fn plan(dumps: &[Dump], plan: &Plan) -> Result<Vec<Planned>, Vec<Fault>> {
    let (mut planned, mut faults) = (Vec::new(), Vec::new());
    for dump in dumps {
        match find(dump, plan) {
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
    if !plan.nodes[node].is_static && plan.frames.len() > 1 && !has_pattern(&dump.path.to_string_lossy()) {
        let message = format!("--dump would write {} frames to one file", plan.frames.len());
        return Err(usage(message).hint("put #### where the frame number belongs".to_owned()));
    }
    Ok(Planned { node, output, path: dump.path.clone() })
}

/// Writes the dumps of a node.
pub fn write(dumps: &[Planned], node: usize, frame: Option<i64>, values: &[Value]) -> Result<(), Fault> {
    for dump in dumps.iter().filter(|dump| dump.node == node) {
        let path = match frame {
            Some(frame) => PathBuf::from(expand_pattern(&dump.path.to_string_lossy(), frame)),
            None => dump.path.clone(),
        };
        let bytes = encode(&values[dump.output], &path).map_err(|error| {
            let message = format!("cannot dump to {}: {}", path.display(), error.message);
            Fault::new(error.class.into(), message).hint(error.hint)
        })?;
        Disk.write(&path, &bytes)
            .map_err(|error| Fault::new(Code::OutputUnwritable, format!("cannot write {}: {error}", path.display())))?;
    }
    Ok(())
}

fn encode(value: &Value, path: &Path) -> Result<Vec<u8>, NodeError> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let image = |image: &Image| encode_image(image, &extension, &WriteOptions::default(), &|_| Ok(()));
    let json = |json: Json| Ok(format!("{json}\n").into_bytes());
    match (value, extension.as_str()) {
        (Value::Image(picture), _) => image(picture),
        (Value::Mask(_) | Value::Field(_) | Value::Labels(_), "exr") => {
            image(&as_image(value).expect("rasters can be shown as pictures"))
        }
        (Value::Labels(labels), "json") => json(json!({ "kind": "Labels", "components": labels.table })),
        (Value::Warp(warp), "json") => json(warp_json(warp)?),
        (Value::Warp(warp), "exr") => image(&warp_image(warp)),
        (Value::Grid(grid), "json") => json(grid_json("Grid", grid)),
        (Value::Points(points), "json") => json(json!({ "kind": "Points", "positions": points.positions })),
        (Value::Mesh(mesh), "json") => json(json!({
            "kind": "Mesh", "positions": mesh.positions, "uvs": mesh.uvs, "triangles": mesh.triangles,
        })),
        (Value::Number(number), "json") => json(json!({ "kind": "Number", "value": number })),
        (Value::Text(text), "json") => json(json!({ "kind": "Text", "value": **text })),
        (Value::Factor(factor), "json") => json(factor.summary.clone()),
        _ => {
            let allowed = match value {
                Value::Mask(_) | Value::Field(_) => "exr",
                Value::Labels(_) | Value::Warp(_) => "exr or json",
                _ => "json",
            };
            let message = format!("{} is not written as `.{extension}`", value.kind());
            Err(NodeError::refused(message).hint(format!("give the file the extension {allowed}")))
        }
    }
}

fn grid_json(kind: &str, grid: &Grid) -> Json {
    json!({ "kind": kind, "origin": grid.origin, "spacing": grid.spacing, "nodes": grid.nodes, "periodic": grid.periodic })
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
