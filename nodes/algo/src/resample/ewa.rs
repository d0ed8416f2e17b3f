//! The elliptical filter: Cubic where the map does not shrink, else the weighted mean over the ellipse that a pixel
//! covers ([`ellipse`](super::ellipse)), in a halved picture ([`pyramid`](super::pyramid)) where it shrinks much.

use super::ellipse::{Axes, Eight, Ellipse, LANES, LONGEST, Patch, Run, Weights, total};
use super::filter::{CUBIC, Filter};
use super::filtered::{Blocks, filtered};
use super::jacobian::Jacobians;
use super::locate::Located;
use super::pyramid::{self, Level};
use super::sample::{Edge, Source};
use super::spans::Point;
use super::{Map, not_finite};
use crate::rect::Rect;
use crate::view::{View, ViewMut};
use crate::{Interrupted, Watch};
use pulp::Simd;
use pulp::bytemuck::cast;

/// Positions farther out than this, px, count as lying here.
const FARTHEST: f64 = (1_u64 << 27) as f64;
/// The longest radius of the kernel, in units of the axes.
const RADIUS: f64 = 1.5;

/// The filter made ready for one picture and one map.
pub(super) struct Ewa<'a> {
    jacobians: Jacobians<'a>,
    source: Source,
    clamp: bool,
    planes: &'a [View<'a, f32>],
    /// The picture halved once, twice, ..
    levels: Vec<Level>,
    /// Whether the planes have one stride.
    alike: bool,
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
        let [major, minor] = jacobians.greatest(&area, watch)?;
        let most = pyramid::most(&window);
        let top = (0..most).take_while(|&level| minor > LONGEST * (1_u64 << level) as f64).count();
        let levels = pyramid::halved(&source, planes, top, watch)?;
        let farthest = (window.width() + window.height()) as f64;
        let reach = if major > 1.0 { (RADIUS * major).min(farthest).max(RADIUS) } else { Filter::Cubic.reach() };
        let alike = planes.iter().all(|plane| plane.samples().1 == planes[0].samples().1);
        Ok(Self { jacobians, source, clamp, planes, levels, alike, reach })
    }

    /// How far outside the source window a position gets weight from it, px, at most.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Gives each pixel of a tile its value; places as in [`nearest`](super::sample::nearest). Returns how many
    /// are not finite.
    pub fn fill(&self, at: &Located, left: usize, blocks: &mut Blocks, out: &mut [ViewMut<f32>]) -> u64 {
        let axes = self.jacobians.tile(at);
        if axes.iter().all(Axes::is_still) {
            return filtered(&CUBIC, self.clamp, &self.source, self.planes, at, left, blocks, out);
        }
        if axes.iter().zip(&at.x).any(|(axes, x)| !x.is_nan() && axes.share() < 1.0) {
            filtered(&CUBIC, self.clamp, &self.source, self.planes, at, left, blocks, out);
        }
        let mut scratch = Scratch::default();
        for (row, axes) in axes.chunks(at.width).enumerate() {
            let mut rows: Vec<_> = out.iter_mut().map(|out| &mut out.row_mut(row)[left..left + at.width]).collect();
            Row { ewa: self, axes, places: at.row(row), rows: &mut rows, scratch: &mut scratch }.draw();
        }
        not_finite(left, at.width, out)
    }

    /// Mixes a pixel's value into the cubic one's.
    #[inline(always)]
    fn pixel<S: Eight>(
        &self,
        simd: S,
        mut axes: Axes,
        share: f32,
        at: Point,
        rows: &mut [&mut [f32]],
        i: usize,
        scratch: &mut Scratch,
    ) {
        let (level, part) = axes.level(self.levels.len());
        let (ellipse, center) = self.ellipse(&axes, level, at);
        let mut done = 0;
        if self.alike && !self.clamp && part == 1.0 {
            while done + 4 <= rows.len() {
                let Some(means) = self.patch::<4>(level, done).means(simd, &ellipse, center) else { break };
                (0..4).for_each(|plane| mix(&mut rows[done + plane][i], means[plane], share));
                done += 4;
            }
            while done < rows.len() {
                let Some([mean]) = self.patch::<1>(level, done).means(simd, &ellipse, center) else { break };
                mix(&mut rows[done][i], mean, share);
                done += 1;
            }
        }
        if done == rows.len() {
            return;
        }
        let Scratch { weights: [fine, coarse], buffer } = scratch;
        coarse.lay(simd, &ellipse, center);
        if part < 1.0 {
            let (ellipse, center) = self.ellipse(&axes, level - 1, at);
            fine.lay(simd, &ellipse, center);
        }
        for (plane, row) in rows.iter_mut().enumerate().skip(done) {
            let mut value = self.value(simd, coarse, level, plane, buffer);
            if part < 1.0 {
                value = mixed(self.value(simd, fine, level - 1, plane, buffer), value, part);
            }
            mix(&mut row[i], value, share);
        }
    }

    /// Planes from `first` on of a level.
    #[inline(always)]
    fn patch<const P: usize>(&self, level: usize, first: usize) -> Patch<'_, P> {
        let view = |plane: usize| match level.checked_sub(1) {
            None => self.planes[plane],
            Some(level) => self.levels[level].view(plane),
        };
        let (stride, size) = (view(first).samples().1, [view(first).width(), view(first).height()]);
        Patch { planes: std::array::from_fn(|plane| view(first + plane).samples().0), stride, size }
    }

    /// The ellipse of a place in a level, and its centre there.
    #[inline(always)]
    fn ellipse(&self, axes: &Axes, level: usize, at: Point) -> (Ellipse, Point) {
        if level == 0 {
            return (Ellipse::new(axes, 0, false), at);
        }
        let (Source { window, edge }, scale) = (&self.source, 1.0 / (1_u64 << level) as f64);
        let (x, flop) = pyramid::home(*edge, at[0], window.width());
        let (y, flip) = pyramid::home(*edge, at[1], window.height());
        (Ellipse::new(axes, level, flop != flip), [x * scale, y * scale])
    }

    /// The weighted mean of a plane's samples.
    #[inline(always)]
    fn value<S: Eight>(&self, simd: S, weights: &Weights, level: usize, plane: usize, buffer: &mut Vec<f32>) -> f32 {
        match level.checked_sub(1).map(|level| &self.levels[level]) {
            None => mean(simd, weights, &self.planes[plane], &self.source, self.clamp, buffer),
            Some(level) => mean(simd, weights, &level.view(plane), &level.source, self.clamp, buffer),
        }
    }
}

/// A row of a tile to be drawn.
struct Row<'a, 'b> {
    ewa: &'a Ewa<'a>,
    axes: &'a [Axes],
    places: (&'a [f64], &'a [f64]),
    rows: &'a mut [&'b mut [f32]],
    scratch: &'a mut Scratch,
}

impl Row<'_, '_> {
    fn draw(self) {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            return Simd::vectorize(simd, With { simd, row: self });
        }
        self.draw_with(pulp::Scalar256b);
    }

    #[inline(always)]
    fn draw_with<S: Eight>(self, simd: S) {
        let Self { ewa, axes, places: (xs, ys), rows, scratch } = self;
        let corner = ewa.source.corner();
        for (i, (axes, (&x, &y))) in axes.iter().zip(xs.iter().zip(ys)).enumerate() {
            let share = axes.share();
            if x.is_nan() {
                rows.iter_mut().for_each(|row| row[i] = 0.0);
            } else if share > 0.0 {
                let at = [x - corner[0], y - corner[1]].map(|at| at.clamp(-FARTHEST, FARTHEST));
                ewa.pixel(simd, *axes, share, at, rows, i, scratch);
            }
        }
    }
}

/// A row and the lanes to draw it with: all of the work is compiled for their processor.
struct With<'a, 'b, S> {
    simd: S,
    row: Row<'a, 'b>,
}

impl<S: Eight> pulp::WithSimd for With<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<T: Simd>(self, _: T) {
        self.row.draw_with(self.simd);
    }
}

/// What a thread reuses from pixel to pixel.
#[derive(Default)]
struct Scratch {
    /// Of a level and the one before it.
    weights: [Weights; 2],
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
fn mixed(from: f32, to: f32, part: f32) -> f32 {
    let value = from + part * (to - from);
    if value.is_nan() { f32::NAN } else { value }
}

/// The weighted mean of a plane's samples; samples of weight zero are not read. With `clamp` no less than the least and
/// no more than the greatest of those of positive weight.
#[inline(always)]
fn mean<S: Eight>(
    simd: S,
    weights: &Weights,
    plane: &View<f32>,
    source: &Source,
    clamp: bool,
    buffer: &mut Vec<f32>,
) -> f32 {
    if !clamp && weights.lie_in(plane.width(), plane.height()) {
        let value = inner_mean(simd, weights, plane);
        if value.is_finite() {
            return value;
        }
    }
    careful_mean(weights, plane, source, clamp, buffer)
}

/// Where all runs lie in the plane, and all samples are finite.
#[inline(always)]
fn inner_mean<S: Eight>(simd: S, weights: &Weights, plane: &View<f32>) -> f32 {
    let (samples, stride) = plane.samples();
    let mut sums = simd.splat_f32s(0.0);
    let mut add = |weights: &[f32; LANES], samples: &[f32; LANES]| {
        sums = simd.add_f32s(sums, simd.mul_f32s(cast(*weights), cast(*samples)));
    };
    let runs = weights.runs.iter().map(|run| (&samples[run.row as usize * stride + run.first as usize..], run.groups));
    if weights.runs.len() == weights.groups.len() {
        for ((samples, _), weights) in runs.zip(&weights.groups) {
            add(weights, samples.first_chunk().expect("the run lies in the plane"));
        }
    } else {
        let mut rest = &weights.groups[..];
        for (samples, groups) in runs {
            let (run, others) = rest.split_at(groups);
            rest = others;
            run.iter().zip(samples.as_chunks().0).for_each(|(weights, samples)| add(weights, samples));
        }
    }
    // Never minus zero.
    total(cast(sums)) / weights.sum + 0.0
}

/// Anywhere, whatever the samples.
#[inline(never)]
fn careful_mean(weights: &Weights, plane: &View<f32>, source: &Source, clamp: bool, buffer: &mut Vec<f32>) -> f32 {
    let mut sums = [0.0; LANES];
    let mut range = [[f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]];
    let mut start = 0;
    for run in &weights.runs {
        let groups = &weights.groups[start..start + run.groups];
        start += run.groups;
        let samples = samples(run, plane, source, buffer);
        for (weights, samples) in groups.iter().zip(samples.as_chunks::<LANES>().0) {
            for lane in 0..LANES {
                let sample = if weights[lane] != 0.0 { samples[lane] } else { 0.0 };
                sums[lane] += weights[lane] * sample;
            }
            if clamp {
                widen(&mut range, weights, samples);
            }
        }
    }
    // Never minus zero.
    let value = total(sums) / weights.sum + 0.0;
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
