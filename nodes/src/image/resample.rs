use std::cell::Cell;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::lattice::{Lattice, Positions};
use warploom_algo::rect::Rect as Window;
use warploom_algo::resample::{self, Edge as Border, Filter as Kernel, Map, Sampling};
use warploom_algo::{components, mask};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs, Raster as AnyRaster};
use warploom_core::value::{
    Buffer, BufferMut, Channel, Direction, Field, Image, Labels, Layer, Mask, Plane, Raster, Rect, Sample, Value, Warp,
    Windows,
};

use crate::adapt::{FARTHEST, map, repeated, view, view_mut, watched, window};
use crate::io::codec::MAX_SIDE;

/// Draws a picture, mask, field or label map through a warp.
///
/// The warp's cells are drawn as quads. Where none folds, every pixel is drawn once; where several cover a pixel, the
/// last in row order counts. All layers and channels are drawn, premultiplied as they are. The data window becomes the
/// pixels that the old one's image overlaps. Warps that repeat on a periodic lattice go on beyond it. What lies outside the display window is drawn and drawn from like the
/// rest. Labels and channels of identities are never mixed. NaN and infinity spread no farther than the filter's
/// footprint; `stats` counts such samples before (`bad_samples`) and after (`bad_samples_drawn`).
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Resample {
    /// What to draw.
    pub image: In<AnyRaster>,
    /// Where it goes.
    pub warp: In<Warp>,
    /// How samples between pixels are made; labels take the nearest.
    pub filter: Filter,
    /// Whether a filter's overshoot beside a very bright pixel is cut: between the least and the greatest of the samples
    /// with weight within 1 px along both axes, the four around a position between pixels.
    pub clamp_ringing: bool,
    /// What lies outside the data window.
    pub edge: Edge,
    /// Width and height of the new format, at the old one's upper left corner; the old size if not given.
    #[schemars(inner(range(min = 1, max = 65536)), extend("x-unit" = "px"))]
    pub size: Option<[u32; 2]>,
    /// Whether the new format is the warped picture's bounding box; not together with a size.
    pub fit: bool,
    /// Whether only the display window is drawn; what lies outside is lost.
    pub crop: bool,
}

/// How samples between pixels are made.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Filter {
    /// The nearest pixel's.
    Nearest,
    /// Linear between four pixels.
    Linear,
    /// Keys' cubic between sixteen pixels, a = -0.5.
    #[default]
    Cubic,
    /// Mitchell's cubic between sixteen pixels, soft: it blurs a little even where nothing moves.
    Mitchell,
    /// Windowed sinc between thirty-six pixels, sharp; rings beside bright pixels.
    Lanczos3,
    /// As the cubic where the warp does not shrink; elsewhere the mean over the ellipse that a new pixel covers in the
    /// old picture, weighted, so that fine detail does not alias. The ellipse's minor axis is never shorter than a
    /// pixel, nor than a sixteenth of its major axis. Where it is longer than 4 pixels the old picture is drawn from
    /// halved, past 6 at a quarter, past 12 at an eighth of its size and so on, each after a smooth change.
    Ewa,
}

/// What lies outside the data window.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Edge {
    /// Nothing: zeros.
    #[default]
    Transparent,
    /// The border pixel, on and on.
    Clamp,
    /// The picture mirrored at its border.
    Mirror,
    /// The picture again.
    Wrap,
}

/// Bytes per label while the labels of a map are counted and described anew.
const BYTES_PER_LABEL: u128 = 160;

impl Node for Resample {
    const VERSION: u32 = 4;
    const OUTPUTS: &'static [Output] = &[Output::same_as("image", "image")];

    fn check(&self) -> Result<(), NodeError> {
        if !self.fit || self.size.is_none() {
            return Ok(());
        }
        Err(NodeError::refused("a size and fit: true exclude each other").at("fit").hint("leave one of them out"))
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (source, warp) = (cx.get(&self.image), cx.get(&self.warp));
        let (lattice, positions) = repeated(cx, &warp)?;
        let drawing = Drawing { node: self, cx, direction: warp.direction, lattice, positions, bad: Cell::default() };
        let outputs: Outputs = match source {
            Value::Image(image) => drawing.image(&image)?.into(),
            Value::Mask(mask) => {
                let mut drawn = drawing.raster(&mask.0)?;
                mask::clamp(view_mut(&mut drawn.samples));
                Mask(drawn.freeze()).into()
            }
            Value::Field(field) => Field(drawing.raster(&field.0)?.freeze()).into(),
            Value::Labels(labels) => drawing.labels(&labels)?.into(),
            other => return Err(NodeError::refused(format!("{} has no pixels", other.kind())).at("image")),
        };
        let [before, drawn] = drawing.bad.get();
        Ok(outputs.stat("bad_samples", before).stat("bad_samples_drawn", drawn))
    }
}

/// What all planes of one drawing share.
struct Drawing<'a> {
    node: &'a Resample,
    cx: &'a Context<'a>,
    direction: Direction,
    lattice: Lattice,
    positions: Positions,
    /// Samples that are NaN or infinite, before and after.
    bad: Cell<[u64; 2]>,
}

/// A raster that is not frozen yet.
struct Drawn<T> {
    windows: Windows,
    samples: BufferMut<T>,
}

impl<T: Sample> Drawn<T> {
    fn freeze(self) -> Raster<T> {
        Raster { windows: self.windows, samples: self.samples.freeze() }
    }
}

impl Drawing<'_> {
    fn map(&self) -> Map<'_> {
        map(self.direction, &self.lattice, &self.positions)
    }

    /// Display and data window of what is drawn from `windows`.
    fn windows(&self, windows: &Windows) -> Result<Windows, NodeError> {
        let display = windows.display;
        let display = self.node.size.map_or(display, |[w, h]| Rect::at(display.x0, display.y0, w as usize, h as usize));
        let limit = Window { x0: -FARTHEST, y0: -FARTHEST, x1: FARTHEST, y1: FARTHEST };
        let bounds = watched(self.cx, |watch| resample::bounds(&self.map(), window(&windows.data), limit, watch))?;
        let bounds = bounds.map(rect);
        // What lies out of reach may be empty and yet millions of rows high.
        let nothing = Rect::at(display.x0, display.y0, 0, 0);
        let bounds = bounds.map(|bounds| if bounds.is_empty() { nothing } else { bounds });
        let endless = self.node.edge != Edge::Transparent;
        self.check_sides(match bounds {
            Some(bounds) if self.node.fit && bounds.is_empty() && !windows.data.is_empty() => {
                let message = format!("nothing to fit to: no pixel within {FARTHEST} px of the origin is covered");
                return Err(NodeError::refused(message).at("fit").hint("look at the warp, or give a size"));
            }
            Some(bounds) if self.node.fit => Windows { display: bounds, data: bounds, ..*windows },
            Some(bounds) if !endless && self.node.crop => {
                let data = rect(window(&bounds).intersect(&window(&display)));
                Windows { display, data: if data.is_empty() { nothing } else { data }, ..*windows }
            }
            Some(bounds) if !endless => Windows { display, data: bounds, ..*windows },
            _ => Windows { display, data: display, ..*windows },
        })
    }

    /// Refuses windows that no picture has, before anything is drawn.
    fn check_sides(&self, windows: Windows) -> Result<Windows, NodeError> {
        let is_long = |window: &&Rect| window.width().max(window.height()) > MAX_SIDE;
        let Some(window) = [&windows.data, &windows.display].into_iter().find(is_long) else { return Ok(windows) };
        let (width, height) = (window.width(), window.height());
        let message = format!("the result would be {width} x {height} px; a side may be 1 to {MAX_SIDE} px long");
        let hint = match (self.node.fit, self.node.crop) {
            (true, _) => "give a size instead of fit, and draw no more than that: crop: true",
            (false, false) => "draw the display window alone: crop: true",
            (false, true) => "give a smaller size",
        };
        Err(NodeError::refused(message).at("warp").hint(hint))
    }

    fn draw(&self, from: &Rect, to: &Rect, planes: &[&Buffer<f32>]) -> Result<Vec<BufferMut<f32>>, NodeError> {
        let filter = match self.node.filter {
            Filter::Nearest => Kernel::Nearest,
            Filter::Linear => Kernel::Linear,
            Filter::Cubic => Kernel::Cubic,
            Filter::Mitchell => Kernel::Mitchell,
            Filter::Lanczos3 => Kernel::Lanczos3,
            Filter::Ewa => Kernel::Ewa,
        };
        let sampling = Sampling { filter, edge: self.border(), clamp_ringing: self.node.clamp_ringing };
        let mut out = self.cx.planes(planes.len(), to.width(), to.height())?;
        let (views, outs) = (planes.iter().map(|plane| view(plane)).collect::<Vec<_>>(), views_mut(&mut out));
        let drawn = watched(self.cx, |watch| {
            resample::draw(&self.map(), window(from), window(to), &sampling, &views, outs, watch)
        })?;
        let before: u64 = planes.iter().map(|plane| plane.bad_samples()).sum();
        self.bad.set([self.bad.get()[0] + before, self.bad.get()[1] + drawn.bad]);
        Ok(out)
    }

    fn draw_labels(&self, from: &Rect, to: &Rect, planes: &[&Buffer<u32>]) -> Result<Vec<BufferMut<u32>>, NodeError> {
        let mut out = self.cx.planes(planes.len(), to.width(), to.height())?;
        let (views, outs) = (planes.iter().map(|plane| view(plane)).collect::<Vec<_>>(), views_mut(&mut out));
        watched(self.cx, |watch| {
            resample::draw_labels(&self.map(), window(from), window(to), self.border(), &views, outs, watch)
        })?;
        Ok(out)
    }

    fn border(&self) -> Border {
        match self.node.edge {
            Edge::Transparent => Border::Transparent,
            Edge::Clamp => Border::Clamp,
            Edge::Mirror => Border::Mirror,
            Edge::Wrap => Border::Wrap,
        }
    }

    fn raster(&self, raster: &Raster<f32>) -> Result<Drawn<f32>, NodeError> {
        let windows = self.windows(&raster.windows)?;
        let drawn = self.draw(&raster.windows.data, &windows.data, &[&raster.samples])?;
        let samples = drawn.into_iter().next().expect("one plane gives one");
        Ok(Drawn { windows, samples })
    }

    fn labels(&self, labels: &Labels) -> Result<Labels, NodeError> {
        let windows = self.windows(&labels.raster.windows)?;
        let drawn = self.draw_labels(&labels.raster.windows.data, &windows.data, &[&labels.raster.samples])?;
        let samples = drawn.into_iter().next().expect("one plane gives one").freeze();
        self.cx.reserve(labels.table.len() as u128 * BYTES_PER_LABEL)?;
        let (x0, y0) = (windows.data.x0.into(), windows.data.y0.into());
        let found = watched(self.cx, |watch| components::tabulate(view(&samples), x0, y0, watch))?;
        let table = found.iter().map(|(label, component)| crate::mask::component_row(*label, component)).collect();
        Ok(Labels { raster: Raster { windows, samples }, table })
    }

    fn image(&self, image: &Image) -> Result<Image, NodeError> {
        let display = self.windows(&image.windows())?.display;
        let layers = image.layers.iter().map(|layer| self.layer(image, layer)).collect::<Result<_, _>>()?;
        Ok(Image { display, layers, ..image.clone() })
    }

    fn layer(&self, image: &Image, layer: &Layer) -> Result<Layer, NodeError> {
        let data = self.windows(&Windows { data: layer.data, ..image.windows() })?.data;
        let numbers: Vec<&Buffer<f32>> = (layer.channels.iter())
            .filter_map(|channel| if let Plane::F32(plane) = &channel.plane { Some(plane) } else { None })
            .collect();
        let identities: Vec<&Buffer<u32>> = (layer.channels.iter())
            .filter_map(|channel| if let Plane::U32(plane) = &channel.plane { Some(plane) } else { None })
            .collect();
        let mut numbers = self.draw(&layer.data, &data, &numbers)?.into_iter();
        let mut identities = self.draw_labels(&layer.data, &data, &identities)?.into_iter();
        let drawn = |channel: &Channel| {
            let plane = match channel.plane {
                Plane::F32(_) => Plane::F32(numbers.next().expect("one per plane").freeze()),
                Plane::U32(_) => Plane::U32(identities.next().expect("one per plane").freeze()),
            };
            Channel { plane, ..channel.clone() }
        };
        Ok(Layer { data, channels: layer.channels.iter().map(drawn).collect(), ..layer.clone() })
    }
}

fn views_mut<T: Sample>(planes: &mut [BufferMut<T>]) -> Vec<warploom_algo::view::ViewMut<'_, T>> {
    planes.iter_mut().map(view_mut).collect()
}

fn rect(window: Window) -> Rect {
    let [x0, y0, x1, y1] = [window.x0, window.y0, window.x1, window.y1].map(|edge| edge as i32);
    Rect { x0, y0, x1, y1 }
}
