use std::sync::{Arc, Mutex, PoisonError};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::exchange::{self, Encoded, PixelMap};
use warploom_algo::resample::{self, Map};
use warploom_algo::warp::{self, InvertError};
use warploom_algo::{Interrupted, rect};
use warploom_core::node::{Context, Domain, In, Node, NodeError, Output, Outputs, WritePath};
use warploom_core::value::{
    Attribute, BufferMut, Channel, Direction, Grid, Image, Layer, Metadata, Plane, Rect, SampleType, Warp,
};

use super::codec::{self, Compression, Depth, WriteOptions};
use super::warp_file::{Channels, Choices, Preset};
use crate::adapt::{FARTHEST, lattice, positions, view_mut, watch, watched, window};

/// Writes a warp as an EXR of floats that says for each pixel where it comes from: an ST map, UV map or displacement.
///
/// Where nothing comes from alpha is 0, and the position lies a whole format outside the format. The map covers the
/// format and the picture's pixels. In the stats, `pixels` counts the map's pixels and `without_source` those without
/// a position; `rounding` is how far positions moved by being stored, and `residual` how far the warp takes what is
/// stored from the centres of the pixels, px.
#[derive(Clone, Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct SaveWarp {
    /// The warp.
    pub warp: In<Warp>,
    /// The picture that is to be warped: its format is that of the map, and positions refer to it. If not connected,
    /// the lattice's rectangle is the format.
    pub domain: Option<In<Domain>>,
    /// The file, `.exr`; `####` stands for the frame.
    #[schemars(extend("x-extensions" = ["exr"]))]
    pub path: WritePath,
    /// Whose map it is to be: what the numbers mean, and which channels hold them.
    pub preset: Preset,
    /// What the numbers mean, where that is not as the preset has it.
    pub convention: Choices,
    /// Names of the channels, where they are not the preset's.
    pub channels: Channels,
    /// Width and height of the warped picture's format, at the old one's upper left corner; the old size if not given.
    #[schemars(inner(range(min = 1, max = 65536)), extend("x-unit" = "px"))]
    pub size: Option<[u32; 2]>,
    /// How far the map reaches beyond the format on every side.
    #[schemars(range(min = 0, max = 16384), extend("x-unit" = "px", "x-soft" = [0, 256]))]
    pub overscan: u32,
    /// Whether the map says where pixels go instead of where they come from.
    pub inverse: bool,
    /// Whether a warp that folds is written; where cells overlap, the last in row order counts, as in Resample. It
    /// counts too where far parts of a warp overlap without a fold, which is not looked for.
    pub frontmost: bool,
    /// How samples are stored.
    pub depth: MapDepth,
    /// How the file is compressed, without loss; `Auto` is `Zips`.
    pub compression: Compression,
}

/// A rounding that is worth a warning, px.
const LARGE_ROUNDING: f64 = 0.01;

/// How samples of a map are stored; others than floats are too coarse for positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum MapDepth {
    /// As 32-bit floats.
    #[default]
    Auto,
    /// As 32-bit floats.
    Float,
}

impl Node for SaveWarp {
    const VERSION: u32 = 2;
    const OUTPUTS: &'static [Output] = &[];
    const SINK: bool = true;

    fn check(&self) -> Result<(), NodeError> {
        NodeError::all([self.names().map(drop), self.compression().map(drop)])
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let compression = self.compression()?;
        let names = self.names()?;
        let warp = cx.get(&self.warp);
        let place = self.place(cx, &warp.grid)?;
        let (lattice, positions) = (lattice(&warp.grid), positions(cx, &warp)?);
        let goes = (warp.direction == Direction::DstFromSrc) != self.inverse;
        let map = if goes {
            self.check_folds(cx, &warp, &lattice, &positions)?;
            Map::Forward { lattice: &lattice, positions: &positions }
        } else {
            Map::Backward { lattice: &lattice, positions: &positions }
        };
        let data = window(&place.data);
        let mut sources = watched(cx, |watch| resample::pixel_sources(&map, data, watch))?;
        let planes = cx.planes(3, data.width(), data.height())?;
        let mut planes: [BufferMut<f32>; 3] =
            planes.try_into().unwrap_or_else(|_| unreachable!("three were asked for"));
        let numbers = PixelMap {
            convention: self.convention.of(self.preset),
            pixels: window(&place.format),
            positions: window(&place.positions),
        };
        let outs = planes.each_mut().map(view_mut);
        let Encoded { without_source, rounding } =
            watched(cx, |watch| exchange::encode(&numbers, data, &mut sources, outs, watch))?;
        let residual = watched(cx, |watch| resample::residual(&map, data, &sources, watch))?;
        let count = sources.x.len() + positions.x.len();
        drop((sources, positions));
        let options = WriteOptions { depth: Depth::Float, compression, ..WriteOptions::default() };
        let host = reusing(cx, count * size_of::<[f64; 2]>());
        let bytes = codec::encode_image(&picture(&place, names, planes), "exr", &options, &host)?;
        cx.write(&self.path, &bytes)?;
        let coarse = (rounding > LARGE_ROUNDING).then(|| {
            format!("positions are stored to within {rounding:.3} px only: they lie far from the format, or it is huge")
        });
        Ok(Outputs::default()
            .warning(coarse)
            .stat("pixels", data.width() * data.height())
            .stat("without_source", without_source)
            .stat("rounding", rounding)
            .stat("residual", residual))
    }
}

/// Where a map lies.
struct Place {
    /// Format of the map.
    format: Rect,
    /// Format that positions refer to.
    positions: Rect,
    /// The map's pixels.
    data: Rect,
    pixel_aspect: f64,
}

impl SaveWarp {
    fn compression(&self) -> Result<Compression, NodeError> {
        match self.compression {
            Compression::Auto => Ok(Compression::Zips),
            lossless @ (Compression::None
            | Compression::Rle
            | Compression::Zips
            | Compression::Zip
            | Compression::Piz) => Ok(lossless),
            lossy => {
                let message =
                    format!("{lossy:?} loses digits, and positions with them; it may be None, Rle, Zips, Zip or Piz");
                Err(NodeError::refused(message).at("compression").hint("leave `compression` out"))
            }
        }
    }

    /// The names of x, y and alpha.
    fn names(&self) -> Result<[&str; 3], NodeError> {
        let names = self.channels.of(self.preset);
        let refused = |message: String| {
            let hint = "name them: channels: (x: \"..\", y: \"..\", alpha: \"..\")";
            Err(NodeError::refused(message).at("channels").hint(hint))
        };
        if let Some(name) = names.iter().find(|name| name.is_empty() || name.len() > 255 || name.contains('\0')) {
            return refused(format!("names of channels are 1 to 255 bytes long without zeros; {name:?} is not"));
        }
        let [x, y, alpha] = names;
        if x == y || y == alpha || alpha == x {
            return refused(format!("x, y and alpha need channels of their own, not `{x}`, `{y}` and `{alpha}`"));
        }
        Ok(names)
    }

    fn place(&self, cx: &Context, grid: &Grid) -> Result<Place, NodeError> {
        let domain = cx.get_optional(&self.domain);
        let port = if domain.is_some() { "domain" } else { "warp" };
        let (source, pixels) = match &domain {
            Some(windows) => (windows.display, windows.data),
            None => (cells(grid), cells(grid)),
        };
        check(&source, port)?;
        let warped = self.size.map(|[w, h]| Rect::at(source.x0, source.y0, w as usize, h as usize));
        let (format, positions, covered) = match warped {
            Some(warped) if self.inverse => (source, warped, source.union(&pixels)),
            Some(warped) => (warped, source, warped),
            None => (source, source, source.union(&pixels)),
        };
        check(&covered, port)?;
        let by = self.overscan as i32;
        let data = Rect { x0: covered.x0 - by, y0: covered.y0 - by, x1: covered.x1 + by, y1: covered.y1 + by };
        check(&data, "overscan")?;
        let pixel_aspect = domain.map_or(1.0, |windows| windows.pixel_aspect);
        Ok(Place { format, positions, data, pixel_aspect })
    }

    fn check_folds(
        &self,
        cx: &Context,
        warp: &Warp,
        lattice: &warploom_algo::lattice::Lattice,
        positions: &warploom_algo::lattice::Positions,
    ) -> Result<(), NodeError> {
        if self.frontmost {
            return Ok(());
        }
        crate::warp::refuse_holes(warp, "warp")?;
        let at_work = watch(cx);
        warp::refuse_folds(lattice, positions, &at_work).map_err(|error| match error {
            InvertError::Interrupted => at_work.error(Interrupted),
            InvertError::Folded { cell: [column, row], folds } => {
                let message = format!(
                    "the warp folds in {folds} cells, most at column {column}, row {row}; there a pixel has several sources"
                );
                NodeError::refused(message).at("warp").hint("bend it less, or write the foremost: frontmost: true")
            }
        })
    }
}

/// A codec's host that first uses up so many bytes, which the node had asked for and has given back.
fn reusing(cx: &Context, spare: usize) -> impl Fn(u128) -> Result<(), NodeError> + Sync {
    let spare = Mutex::new(spare as u128);
    move |bytes| {
        cx.go_on()?;
        let mut spare = spare.lock().unwrap_or_else(PoisonError::into_inner);
        let reused = bytes.min(*spare);
        *spare -= reused;
        cx.reserve(bytes - reused)
    }
}

/// The lattice's rectangle, rounded out to whole pixels.
fn cells(grid: &Grid) -> Rect {
    let ends = [0, 1].map(|axis| {
        let size = (grid.nodes[axis] - 1) as f64 * grid.spacing[axis];
        [grid.origin[axis].floor() as i32, (grid.origin[axis] + size).ceil() as i32]
    });
    let [[x0, x1], [y0, y1]] = ends;
    Rect { x0, y0, x1, y1 }
}

fn check(window: &Rect, port: &'static str) -> Result<(), NodeError> {
    let rect::Rect { x0, y0, x1, y1 } = self::window(window);
    if window.is_empty() {
        return Err(NodeError::refused("the format is empty; a map needs at least one pixel")
            .at(port)
            .hint("connect a picture of the plate's size to `domain`"));
    }
    let most = codec::MAX_SIDE;
    if [x0, y0, x1, y1].iter().any(|edge| edge.abs() > FARTHEST) || window.width().max(window.height()) > most {
        let (width, height) = (window.width(), window.height());
        let message = format!(
            "the map would be {width} x {height} px at ({x0}, {y0}) px; a side may be 1 to {most} px long, within \
             {FARTHEST} px of the origin"
        );
        let hint = "give a smaller format: connect a picture of the plate's size to `domain`";
        return Err(NodeError::refused(message).at(port).hint(hint));
    }
    Ok(())
}

/// The file's picture. It is marked as data, so that nobody takes it for colour.
fn picture(place: &Place, names: [&str; 3], planes: [BufferMut<f32>; 3]) -> Image {
    let channels = names.into_iter().zip(planes).map(|(name, plane)| Channel {
        name: name.into(),
        sample_type: SampleType::Float,
        plane: Plane::F32(plane.freeze()),
    });
    let data = Attribute { kind: "string".into(), bytes: b"data".to_vec() };
    Image {
        display: place.format,
        pixel_aspect: place.pixel_aspect,
        metadata: Arc::new(Metadata::from([("colorInteropID".into(), data)])),
        layers: vec![Layer {
            name: "".into(),
            data: place.data,
            channels: channels.collect(),
            metadata: Arc::default(),
        }],
    }
}
