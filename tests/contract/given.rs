//! A node that gives values no other node makes: pictures with odd windows, samples and channels, and the like.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_core::node::{Context, Node, NodeError, Output, Outputs};
use warploom_core::value::{
    Buffer, Channel, Component, Direction, Field, Grid, Image, Kind, Labels, Layer, Mask, Mesh, Plane, Points, Raster,
    Rect, Sample, SampleType, Value, Warp, Windows,
};

/// Values of every kind that lie where a picture lies.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Given {
    /// The picture.
    pub which: Which,
}

/// Pictures that are hard on nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Which {
    /// R, G, B, A in one window.
    #[default]
    Plain,
    /// Large enough to be shared out among threads.
    Large,
    /// One pixel.
    Pixel,
    /// Odd sides.
    Odd,
    /// NaN and infinite samples.
    NotFinite,
    /// A data window at a negative origin, reaching over the display window and short of it.
    Shifted,
    /// A data window without pixels.
    NoPixels,
    /// A display window without pixels.
    NoFormat,
    /// Y alone.
    Grey,
    /// R, G, B.
    NoAlpha,
    /// R, G, B, A and a channel of identities.
    Identities,
    /// Three layers with data windows of their own.
    Layers,
    /// No channel at all.
    NoChannels,
    /// A data window at the end of the world.
    Far,
    /// A display window from end to end of the world.
    Vast,
}

impl Which {
    pub const ALL: [Which; 15] = [
        Which::Plain,
        Which::Large,
        Which::Pixel,
        Which::Odd,
        Which::NotFinite,
        Which::Shifted,
        Which::NoPixels,
        Which::NoFormat,
        Which::Grey,
        Which::NoAlpha,
        Which::Identities,
        Which::Layers,
        Which::NoChannels,
        Which::Far,
        Which::Vast,
    ];

    fn windows(self) -> Windows {
        let (display, data) = match self {
            Which::Large => (Rect::at(0, 0, 200, 150), Rect::at(0, 0, 200, 150)),
            Which::Pixel => (Rect::at(0, 0, 1, 1), Rect::at(0, 0, 1, 1)),
            Which::Odd => (Rect::at(0, 0, 17, 13), Rect::at(0, 0, 17, 13)),
            Which::Shifted => (Rect::at(0, 0, 24, 18), Rect::at(-7, -5, 21, 30)),
            Which::NoPixels => (Rect::at(0, 0, 24, 18), Rect::at(5, 5, 0, 0)),
            Which::NoFormat => (Rect::at(3, 3, 0, 0), Rect::at(3, 3, 0, 0)),
            Which::Far => (Rect::at(0, 0, 24, 18), Rect::at(i32::MAX - 8, i32::MIN, 8, 8)),
            Which::Vast => (Rect { x0: i32::MIN, y0: i32::MIN, x1: i32::MAX, y1: i32::MAX }, Rect::at(0, 0, 8, 8)),
            _ => (Rect::at(0, 0, 24, 18), Rect::at(0, 0, 24, 18)),
        };
        let pixel_aspect = if self == Which::Shifted { 2.0 } else { 1.0 };
        Windows { display, data, pixel_aspect }
    }

    /// The picture.
    pub fn image(self) -> Image {
        let Windows { display, data, pixel_aspect } = self.windows();
        let names: &[&str] = match self {
            Which::Grey => &["Y"],
            Which::NoAlpha => &["R", "G", "B"],
            Which::Identities => &["R", "G", "B", "A", "id"],
            Which::NoChannels => &[],
            _ => &["R", "G", "B", "A"],
        };
        let layer = |name: &str, data: Rect| Layer {
            name: name.into(),
            data,
            channels: names.iter().map(|name| self.channel(name, &data)).collect(),
            metadata: Arc::default(),
        };
        let mut layers = vec![layer("", data)];
        if self == Which::Layers {
            layers.push(layer("diffuse", Rect::at(-3, 4, 9, 7)));
            layers.push(layer("empty", Rect::at(2, 2, 0, 0)));
        }
        Image { display, pixel_aspect, metadata: Arc::default(), layers }
    }

    fn channel(self, name: &str, data: &Rect) -> Channel {
        if name == "id" {
            let plane = Plane::U32(plane(data, |x, y| (disc(x, y) * 4.0) as u32 * (u32::MAX / 4)));
            return Channel { name: name.into(), sample_type: SampleType::Uint, plane };
        }
        let seed = i64::from(name.as_bytes()[0]);
        let sample = |x: i64, y: i64| {
            let alpha = ((x + y).rem_euclid(5) as f32) / 4.0;
            let value = ((x * 7 + y * 13 + seed * 29).rem_euclid(32)) as f32 / 31.0;
            match self {
                Which::NotFinite => match (x + 3 * y).rem_euclid(6) {
                    0 => f32::NAN,
                    1 => f32::INFINITY,
                    2 => f32::NEG_INFINITY,
                    3 => f32::MAX,
                    _ => value,
                },
                _ if name == "A" => alpha,
                _ => value * alpha,
            }
        };
        Channel { name: name.into(), sample_type: SampleType::Float, plane: Plane::F32(plane(data, sample)) }
    }

    fn coverage(self) -> Raster<f32> {
        let windows = self.windows();
        Raster { windows, samples: plane(&windows.data, disc) }
    }

    fn labels(self) -> Labels {
        let windows = self.windows();
        let label = |x: i64, y: i64| {
            let column = (x.rem_euclid(64) / 8) as u32;
            if disc(x, y) > 0.5 { 1 + 3 * column + (y.rem_euclid(64) / 8) as u32 } else { 0 }
        };
        let samples = plane(&windows.data, label);
        let mut table: Vec<Component> = Vec::new();
        let Rect { x0, y0, x1, y1 } = windows.data;
        for (y, row) in (y0..y1).zip(samples.rows()) {
            for (x, &label) in (x0..x1).zip(row).filter(|(_, label)| **label != 0) {
                let at = table.partition_point(|row| row.label < label);
                let here = Rect { x0: x, y0: y, x1: x + 1, y1: y + 1 };
                if table.get(at).is_none_or(|row| row.label != label) {
                    table.insert(at, Component { label, area: 0, bounds: here, centroid: [0.0; 2] });
                }
                let row = &mut table[at];
                row.area += 1;
                row.bounds = row.bounds.union(&here);
                for (mean, at) in row.centroid.iter_mut().zip([x, y]) {
                    *mean += (f64::from(at) + 0.5 - *mean) / row.area as f64;
                }
            }
        }
        Labels { raster: Raster { windows, samples }, table }
    }

    /// A slanted square, of wild corners for a picture of wild samples.
    fn mesh(self) -> Mesh {
        let slant = f64::from(self as u8) / 20.0;
        let mut positions = vec![[-0.2, 0.2, -slant], [0.3, 0.2, slant], [0.2, -0.3, slant], [-0.2, -0.2, 0.0]];
        if self == Which::NotFinite {
            positions.extend([[f64::NAN, 0.0, 0.0], [0.0, f64::INFINITY, 1e300]]);
        }
        let uvs = positions.iter().map(|[x, y, _]| [0.5 + 3.0 * x, 0.5 - 3.0 * y]).collect();
        let last = positions.len() as u32 - 1;
        Mesh { positions, uvs, normals: vec![], triangles: vec![[0, 3, 2], [0, 2, 1], [last, 1, 2]] }
    }

    /// Its mesh as the text of an OBJ.
    pub fn obj(self) -> String {
        let mesh = if self == Which::NotFinite { Which::Plain } else { self }.mesh();
        let vertices = mesh.positions.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n"));
        let uvs = mesh.uvs.iter().map(|[u, v]| format!("vt {u} {v}\n"));
        vertices.chain(uvs).chain(["f 1/1 4/4 3/3 2/2\n".into()]).collect()
    }

    /// A warp on three by three nodes.
    fn warp(self, direction: Direction, map: impl Fn(usize, f64) -> f64) -> Warp {
        let display = self.windows().display;
        let origin = [f64::from(display.x0), f64::from(display.y0)];
        let spacing = [display.width(), display.height()].map(|side| side.max(1) as f64 / 2.0);
        let position = |axis: usize| -> Vec<f64> {
            let step = |node: usize| if axis == 0 { node % 3 } else { node / 3 };
            (0..9).map(|node| map(node, origin[axis] + spacing[axis] * step(node) as f64)).collect()
        };
        let grid = Grid { origin, spacing, nodes: [3, 3], periodic: [false, false] };
        Warp { grid, direction, x: position(0).into(), y: position(1).into() }
    }
}

fn plane<T: Sample>(data: &Rect, sample: impl Fn(i64, i64) -> T) -> Buffer<T> {
    let pixels = (data.y0..data.y1).flat_map(|y| (data.x0..data.x1).map(move |x| (x.into(), y.into())));
    let samples: Vec<T> = pixels.map(|(x, y)| sample(x, y)).collect();
    Buffer::from_packed(&samples, data.width(), data.height())
}

/// Soft discs, one in each square of eight pixels.
fn disc(x: i64, y: i64) -> f32 {
    let [dx, dy] = [x.rem_euclid(8) - 4, y.rem_euclid(8) - 4];
    match dx * dx + dy * dy {
        0..=6 => 1.0,
        7..=9 => 0.75,
        10 => 0.25,
        _ => 0.0,
    }
}

const WILD: [f64; 6] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, f64::MAX];

impl Node for Given {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[
        Output::new("image", Kind::Image),
        Output::new("mask", Kind::Mask),
        Output::new("field", Kind::Field),
        Output::new("labels", Kind::Labels),
        Output::new("points", Kind::Points),
        Output::new("mesh", Kind::Mesh),
        Output::new("number", Kind::Number),
        Output::new("text", Kind::Text),
        Output::new("backward", Kind::Warp),
        Output::new("wild", Kind::Warp),
        Output::new("far", Kind::Warp),
        Output::new("collapsed", Kind::Warp),
        Output::new("bare", Kind::Mesh),
        Output::new("ragged", Kind::Mesh),
    ];

    fn compute(&self, _: &Context) -> Result<Outputs, NodeError> {
        let which = self.which;
        let wild = |node: usize, at: f64| WILD.get(node).copied().unwrap_or(at);
        Ok(Outputs::new([
            which.image().into(),
            Mask(which.coverage()).into(),
            Field(which.coverage()).into(),
            which.labels().into(),
            Points { positions: vec![[1.5, -2.0], [which as u8 as f64, 4.0]] }.into(),
            which.mesh().into(),
            Value::Number(which as u8 as f64),
            Value::Text(format!("{which:?}").into()),
            which.warp(Direction::SrcFromDst, |_, at| at * 0.9 + 1.0).into(),
            which.warp(Direction::DstFromSrc, wild).into(),
            which.warp(Direction::DstFromSrc, |node, at| at * 1e9 + node as f64).into(),
            which.warp(Direction::DstFromSrc, |_, _| 3.0).into(),
            Mesh { uvs: vec![], ..which.mesh() }.into(),
            Mesh { normals: vec![WILD[..3].try_into().expect("three"); 4], triangles: vec![[0, 1, 9]], ..which.mesh() }
                .into(),
        ]))
    }
}
