//! The elliptical filter: Cubic where the map does not shrink, else the weighted mean over the ellipse that a pixel
//! covers ([`ellipse`](super::ellipse)), in a smaller picture ([`pyramid`](super::pyramid)) where it shrinks much.
//!
//! A tile comes to its values block by block ([`ellipses`](super::ellipses)), level by level: each row of pixels gets its
//! ellipses; from them follows what part of the level the block needs; row after row that part is copied, with the channels
//! side by side, while memory brings the rows after it; then each ellipse weighs its samples in the copy, four channels at a
//! time. What has no finite value then is drawn alone, sample by sample: ellipses too wide or too scattered for a copy,
//! and those that hold a sample that is not finite.

use super::Map;
use super::axes::{Shapes, levels};
use super::block::{Pixels, finish_stores, store};
use super::ellipse::{Ellipse, Run, Weights, group_total};
use super::ellipses::{self, Ellipses, ROWS, TOGETHER, Values, WIDTH};
use super::filter::{CUBIC, Filter};
use super::filtered::{Blocks, filtered};
use super::jacobian::Jacobians;
use super::lanes::{LANES, Lanes, Work, widest};
use super::locate::{BAND_HEIGHT, Located, TILE_WIDTH};
use super::pyramid::{self, Frame, Level};
use super::sample::{Edge, Source};
use super::spans::Point;
use super::weigh::some_not_finite;
use crate::rect::Rect;
use crate::simd::vectorized;
use crate::view::{View, ViewMut};
use crate::{Interrupted, Watch};
use std::ops::Range;

/// Bytes that a thread takes for a tile besides [`TILE_BYTES`](super::TILE_BYTES): its axes, and copies.
pub(super) const TILE_BYTES: usize = TILE_WIDTH * BAND_HEIGHT * size_of::<[f32; 7]>() + ellipses::BYTES;
/// Positions farther out than this, px, count as lying here.
pub(super) const FARTHEST: f64 = (1_u64 << 27) as f64;
/// The longest radius of the kernel, in units of the axes.
const RADIUS: f64 = 1.5;

/// The filter made ready for one picture and one map.
pub(super) struct Ewa<'a> {
    jacobians: Jacobians<'a>,
    source: Source,
    clamp: bool,
    planes: &'a [View<'a, f32>],
    whole: Frame,
    /// The picture halved `lowest` times and more; `lowest` is at least 1.
    levels: Vec<Level>,
    lowest: usize,
    top: usize,
    reach: f64,
}

impl<'a> Ewa<'a> {
    /// Looks at the map's cells for the greatest shrink, and halves the picture where they need it. A backward map's
    /// cells are those under the destination window, a forward map's those over the source window, which is grown by its
    /// own size if the picture goes on outside.
    pub fn new(
        map: &Map<'a>,
        source: Source,
        dst_window: Rect,
        clamp: bool,
        planes: &'a [View<'a, f32>],
        watch: Watch,
    ) -> Result<Self, Interrupted> {
        let jacobians = Jacobians::new(map);
        let Source { window, edge } = source;
        let area = match *map {
            Map::Backward { .. } => dst_window,
            Map::Forward { .. } if edge == Edge::Transparent => grown(&window, 2, 2),
            Map::Forward { .. } => grown(&window, window.width() as i64, window.height() as i64),
        };
        let range = jacobians.range(&area, watch)?;
        let most = pyramid::most(&window);
        let [lowest, top] = [levels(range.least, most)[0].max(1), levels(range.minor, most)[1]];
        let levels = pyramid::halved(&source, planes, [lowest, top], watch)?;
        let reach = if range.major > 1.0 { (RADIUS * range.major).min(FARTHEST) } else { Filter::Cubic.reach() };
        let whole = Frame::whole(source);
        Ok(Self { jacobians, source, clamp, planes, whole, levels, lowest, top, reach })
    }

    /// How far outside the source window a position gets weight from it, px, at most.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Gives each pixel of a tile its value; places as in [`nearest`](super::sample::nearest). Returns how many
    /// are not finite.
    pub fn fill(&self, at: &Located, left: usize, scratch: &mut Scratch, out: &mut [ViewMut<f32>]) -> u64 {
        let Scratch { shapes, blocks, .. } = scratch;
        self.jacobians.tile(at, shapes);
        if shapes.are_still() {
            return filtered(&CUBIC, self.clamp, &self.source, self.planes, at, left, blocks, out);
        }
        if shapes.mix() {
            filtered(&CUBIC, self.clamp, &self.source, self.planes, at, left, blocks, out);
        }
        shapes.choose([self.lowest, self.top]);
        let mut bad = 0;
        for first in (0..self.planes.len()).step_by(TOGETHER) {
            let out = &mut out[first..self.planes.len().min(first + TOGETHER)];
            widest(Tile { ewa: self, at, left, first, scratch, out, bad: &mut bad });
        }
        bad
    }

    /// A plane of a level, and how its pixels lie.
    #[inline(always)]
    pub fn level(&self, level: usize, plane: usize) -> (View<'_, f32>, &Frame) {
        match level.checked_sub(self.lowest) {
            None => (self.planes[plane], &self.whole),
            Some(i) => (self.levels[i].view(plane), &self.levels[i].frame),
        }
    }

    /// Whether values are cut to the range of samples: each is drawn alone.
    pub fn clamps(&self) -> bool {
        self.clamp
    }

    pub fn plane_count(&self) -> usize {
        self.planes.len()
    }

    /// A position counted from the window's corner, not too far out.
    #[inline(always)]
    pub fn place(&self, at: Point) -> Point {
        let corner = self.source.corner();
        [0, 1].map(|axis| (at[axis] - corner[axis]).clamp(-FARTHEST, FARTHEST))
    }

    /// A pixel's values alone: those of planes from number `first` on at pixel `i` of the tile.
    #[inline(always)]
    fn alone<L: Lanes>(
        &self,
        lanes: L,
        shapes: &Shapes,
        i: usize,
        at: Point,
        first: usize,
        room: &mut Alone,
    ) -> [f32; TOGETHER] {
        let [level, before] = [shapes.levels[0][i] as usize, shapes.levels[1][i] as usize];
        let values = self.means(lanes, shapes, i, at, level, first, room);
        if level == before {
            return values;
        }
        let finer = self.means(lanes, shapes, i, at, before, first, room);
        std::array::from_fn(|plane| mixed(finer[plane], values[plane], shapes.part[i]))
    }

    #[inline(always)]
    fn means<L: Lanes>(
        &self,
        lanes: L,
        shapes: &Shapes,
        i: usize,
        at: Point,
        level: usize,
        first: usize,
        room: &mut Alone,
    ) -> [f32; TOGETHER] {
        let frame = self.level(level, 0).1;
        let ellipse = Ellipse::new(&shapes.axes(i), level, frame.grown);
        room.weights.lay(lanes, &ellipse, frame.place(self.place(at)));
        let mut values = [0.0; TOGETHER];
        for (value, plane) in values.iter_mut().zip(first..self.planes.len()) {
            *value = mean(&room.weights, &self.level(level, plane).0, &frame.source, self.clamp, &mut room.buffer);
        }
        values
    }
}

/// A tile of some planes to be drawn, from plane number `first` on.
struct Tile<'a, 'b, 'c> {
    ewa: &'a Ewa<'b>,
    at: &'a Located,
    left: usize,
    first: usize,
    scratch: &'a mut Scratch,
    out: &'a mut [ViewMut<'c, f32>],
    /// How many values are not finite.
    bad: &'a mut u64,
}

impl Work for Tile<'_, '_, '_> {
    #[inline(always)]
    fn run<L: Lanes>(mut self, lanes: L) {
        let (at, first) = (self.at, self.first);
        let mut ellipses = std::mem::take(&mut self.scratch.ellipses);
        for pixels in blocks(at) {
            ellipses.draw(lanes, self.ewa, at, &self.scratch.shapes, &pixels, first);
            for (row, values) in pixels.rows.clone().zip(&ellipses.values) {
                self.finish(lanes, row, &pixels.columns, values);
            }
        }
        finish_stores();
        self.scratch.ellipses = ellipses;
    }
}

impl Tile<'_, '_, '_> {
    /// Writes a row of a block, and draws alone what must be.
    #[inline(always)]
    fn finish<L: Lanes>(&mut self, lanes: L, row: usize, columns: &Range<usize>, values: &Values) {
        let Self { ewa, at, left, first, scratch, out, bad } = self;
        let Scratch { shapes, alone, .. } = &mut **scratch;
        let pixels = row * at.width + columns.start..row * at.width + columns.end;
        let columns = *left + columns.start..*left + columns.end;
        // Where nothing is drawn values are NaN.
        if !shapes.mix_in(pixels.clone()) && !some_not_finite(values[..pixels.len()].as_flattened()) {
            return store(values, row, columns, out);
        }
        for (column, (pixel, value)) in columns.clone().zip(pixels.zip(values)) {
            let (place, share) = ([at.x[pixel], at.y[pixel]], shapes.share(pixel));
            let mut value = *value;
            if place[0].is_nan() {
                out.iter_mut().for_each(|out| out.row_mut(row)[column] = 0.0);
                continue;
            }
            if share > 0.0 && !value[..out.len()].iter().all(|value| value.is_finite()) {
                value = ewa.alone(lanes, shapes, pixel, place, *first, alone);
            }
            if share > 0.0 {
                out.iter_mut().zip(value).for_each(|(out, value)| mix(&mut out.row_mut(row)[column], value, share));
            }
        }
        for out in &mut **out {
            **bad += out.row_mut(row)[columns.clone()].iter().filter(|value| !value.is_finite()).count() as u64;
        }
    }
}

/// The blocks of a tile, row by row.
fn blocks(at: &Located) -> Vec<Pixels> {
    let range = |start: usize, count: usize, step: usize| start..count.min(start + step);
    let columns = || (0..at.width).step_by(WIDTH).map(|start| range(start, at.width, WIDTH));
    let rows = (0..at.height).step_by(ROWS).map(|start| range(start, at.height, ROWS));
    rows.flat_map(|rows| columns().map(move |columns| Pixels { columns, rows: rows.clone() })).collect()
}

/// What a thread reuses from tile to tile.
#[derive(Default)]
pub(super) struct Scratch {
    shapes: Shapes,
    /// For Cubic.
    blocks: Blocks,
    ellipses: Ellipses,
    alone: Alone,
}

/// What it reuses from pixel to pixel drawn alone.
#[derive(Default)]
struct Alone {
    weights: Weights,
    buffer: Vec<f32>,
}

fn grown(window: &Rect, x: i64, y: i64) -> Rect {
    Rect::new(window.x0 - x, window.y0 - y, window.x1 + x, window.y1 + y)
}

/// Mixes `to` into a value; all of it if `share` is 1, whatever the value was.
#[inline(always)]
fn mix(value: &mut f32, to: f32, share: f32) {
    *value = if share < 1.0 { mixed(*value, to, share) } else { to };
}

/// A NaN's payload depends on how the compiler orders operands; this takes it away.
#[inline(always)]
pub(super) fn mixed(from: f32, to: f32, part: f32) -> f32 {
    let value = from + part * (to - from);
    if value.is_nan() { f32::NAN } else { value }
}

/// The weighted mean of a plane's samples; samples of weight zero are not read. With `clamp` no less than the least and
/// no more than the greatest of those of positive weight.
#[inline(always)]
fn mean(weights: &Weights, plane: &View<f32>, source: &Source, clamp: bool, buffer: &mut Vec<f32>) -> f32 {
    if !clamp && weights.lie_in(plane.width(), plane.height()) {
        let value = inner_mean(weights, plane);
        if value.is_finite() {
            return value;
        }
    }
    careful_mean(weights, plane, source, clamp, buffer)
}

/// Where all runs lie in the plane, and all samples are finite.
#[inline(always)]
fn inner_mean(weights: &Weights, plane: &View<f32>) -> f32 {
    let (samples, stride) = plane.samples();
    let mut sums = [0.0; LANES];
    let mut rest = &weights.groups[..];
    for run in &weights.runs {
        let samples = &samples[run.row as usize * stride + run.first as usize..];
        let (groups, others) = rest.split_at(run.groups);
        rest = others;
        for (weights, samples) in groups.iter().zip(samples.as_chunks::<LANES>().0) {
            for lane in 0..LANES {
                sums[lane] = weights[lane].mul_add(samples[lane], sums[lane]);
            }
        }
    }
    // Never minus zero.
    group_total(sums) / weights.sum + 0.0
}

/// Anywhere, whatever the samples.
#[inline(never)]
fn careful_mean(weights: &Weights, plane: &View<f32>, source: &Source, clamp: bool, buffer: &mut Vec<f32>) -> f32 {
    let mut sums = [0.0; LANES];
    let mut range = [[f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]];
    vectorized(
        #[inline(always)]
        || {
            let mut start = 0;
            for run in &weights.runs {
                let groups = &weights.groups[start..start + run.groups];
                start += run.groups;
                let samples = samples(run, plane, source, buffer);
                for (weights, samples) in groups.iter().zip(samples.as_chunks::<LANES>().0) {
                    for lane in 0..LANES {
                        let sample = if weights[lane] != 0.0 { samples[lane] } else { 0.0 };
                        sums[lane] = weights[lane].mul_add(sample, sums[lane]);
                    }
                    if clamp {
                        widen(&mut range, weights, samples);
                    }
                }
            }
        },
    );
    // Never minus zero.
    let value = group_total(sums) / weights.sum + 0.0;
    let low = range[0].into_iter().fold(f32::INFINITY, f32::min);
    let high = range[1].into_iter().fold(f32::NEG_INFINITY, f32::max);
    let value = if clamp && value < low { low } else { value };
    let value = if clamp && value > high { high } else { value };
    if value.is_nan() { f32::NAN } else { value }
}

/// Widens the range to the samples of positive weight that are numbers.
#[inline(always)]
fn widen([low, high]: &mut [[f32; LANES]; 2], weights: &[f32; LANES], samples: &[f32; LANES]) {
    for lane in 0..LANES {
        let inside = weights[lane] > 0.0;
        low[lane] = if inside && samples[lane] < low[lane] { samples[lane] } else { low[lane] };
        high[lane] = if inside && samples[lane] > high[lane] { samples[lane] } else { high[lane] };
    }
}

/// The samples of a run: as they lie in the plane, or gathered at its edge.
#[inline(always)]
fn samples<'a>(run: &Run, plane: &View<'a, f32>, source: &Source, buffer: &'a mut Vec<f32>) -> &'a [f32] {
    let count = run.groups * LANES;
    let inside = run.row >= 0 && (run.row as usize) < plane.height() && run.first >= 0;
    if inside && run.first as usize + count <= plane.width() {
        return &plane.row(run.row as usize)[run.first as usize..][..count];
    }
    gathered(run, plane, source, buffer)
}

fn gathered<'a>(run: &Run, plane: &View<'a, f32>, source: &Source, buffer: &'a mut Vec<f32>) -> &'a [f32] {
    buffer.clear();
    match source.row(run.row) {
        None => buffer.resize(run.groups * LANES, 0.0),
        Some(row) => {
            let row = plane.row(row);
            let columns = run.first..run.first + (run.groups * LANES) as i32;
            buffer.extend(columns.map(|column| source.column(column).map_or(0.0, |column| row[column])));
        }
    }
    buffer
}
