//! Pictures on surfaces: sampled over the part that a pixel sees.

use rayon::prelude::*;

use crate::view::View;
use crate::{Interrupted, Watch};

/// What a texture coordinate outside 0..=1 sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// The border pixel, on and on.
    Clamp,
    /// The picture again.
    Wrap,
}

/// Most samples along a pixel's footprint.
const PROBES: f64 = 16.0;

/// Values of the planes R, G, B, A that are missing.
const MISSING: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

type Planes<'a> = [Option<View<'a, f32>>; 4];

/// A picture at half the size, a quarter, and so on down to a pixel.
pub(super) struct Pyramid {
    levels: Vec<Level>,
    /// Which of a level's planes each of R, G, B, A is; a grey picture's colours are one.
    plane_of: [Option<usize>; 4],
}

struct Level {
    size: [usize; 2],
    planes: Vec<Vec<f32>>,
}

impl Pyramid {
    /// Each level halves the sides of the one before, rounded down; a pixel is the mean of the area it covers there.
    pub(super) fn new(planes: &Planes, size: [usize; 2], watch: Watch) -> Result<Self, Interrupted> {
        let mut distinct: Vec<View<f32>> = Vec::new();
        let plane_of = planes.map(|plane| {
            let plane = plane?;
            let known = distinct.iter().position(|other| is_same(other, &plane));
            if known.is_none() {
                distinct.push(plane);
            }
            Some(known.unwrap_or(distinct.len() - 1))
        });
        let halves = |size: &[usize; 2]| (*size != [1, 1]).then(|| size.map(|side| (side / 2).max(1)));
        let sizes = || std::iter::successors(halves(&size), halves);
        let samples: usize = sizes().map(|[width, height]| width * height).sum();
        watch.reserve(samples * distinct.len() * size_of::<f32>())?;
        let mut levels: Vec<Level> = Vec::new();
        for to in sizes() {
            watch.go_on()?;
            let finer = levels.last().map_or_else(|| distinct.clone(), |level| level.views().collect());
            levels.push(Level { size: to, planes: finer.into_iter().map(|plane| reduced(plane, to)).collect() });
        }
        Ok(Self { levels, plane_of })
    }

    fn views(&self) -> impl Iterator<Item = Planes<'_>> {
        self.levels.iter().map(|level| self.plane_of.map(|plane| plane.map(|plane| level.view(plane))))
    }

    /// The red of the last level.
    #[cfg(test)]
    pub(super) fn smallest(&self) -> Option<f32> {
        self.levels.last().map(|level| level.planes[0][0])
    }
}

impl Level {
    fn view(&self, plane: usize) -> View<'_, f32> {
        View::packed(&self.planes[plane], self.size[0], self.size[1])
    }

    fn views(&self) -> impl Iterator<Item = View<'_, f32>> {
        (0..self.planes.len()).map(|plane| self.view(plane))
    }
}

/// Whether two planes of one size are the same samples in memory.
fn is_same(a: &View<f32>, b: &View<f32>) -> bool {
    [0, a.height() - 1].into_iter().all(|y| std::ptr::eq(a.row(y), b.row(y)))
}

/// For each of `to` pixels along a side, the first of `from` that it covers, and the share of each of up to three.
fn shares(from: usize, to: usize) -> Vec<(usize, [f32; 3])> {
    let shares = (0..to).map(|at| {
        // In units of 1 / to of a pixel.
        let (start, end) = (at * from, (at + 1) * from);
        let first = start / to;
        let share = |tap: usize| {
            let (left, right) = ((first + tap) * to, (first + tap + 1) * to);
            right.min(end).saturating_sub(left.max(start)) as f32 / from as f32
        };
        (first, [share(0), share(1), share(2)])
    });
    shares.collect()
}

fn reduced(from: View<f32>, [width, height]: [usize; 2]) -> Vec<f32> {
    let (across, down) = (shares(from.width(), width), shares(from.height(), height));
    let mut out = vec![0.0; width * height];
    out.par_chunks_mut(width).zip(&down).for_each(|(out, (top, down))| {
        for (out, (left, across)) in out.iter_mut().zip(&across) {
            for (y, share_y) in (*top..).zip(down).filter(|(_, share)| **share > 0.0) {
                let row = from.row(y);
                let taps = (*left..).zip(across).filter(|(_, share)| **share > 0.0);
                let sum = taps.fold(0.0, |sum, (x, share_x)| sum + share_x * row[x]);
                *out += share_y * sum;
            }
        }
    });
    out
}

/// A texture that answers for parts of surfaces.
pub(super) struct Texture<'a> {
    levels: Vec<Planes<'a>>,
    sizes: Vec<[usize; 2]>,
    edges: [Edge; 2],
}

impl<'a> Texture<'a> {
    pub(super) fn new(planes: Planes<'a>, size: [usize; 2], pyramid: &'a Pyramid, edges: [Edge; 2]) -> Self {
        let levels = std::iter::once(planes).chain(pyramid.views()).collect();
        let sizes = std::iter::once(size).chain(pyramid.levels.iter().map(|level| level.size)).collect();
        Self { levels, sizes, edges }
    }

    /// The mean over about the parallelogram with centre `uv` that `du` and `dv`, the change of u and of v along the
    /// pixel's sides, make of a pixel.
    ///
    /// Its long axis, of a pixel's image in texels, is cut into probes about as long as the short one, and each is
    /// read from the levels whose texels are about as large, linearly in all three directions.
    pub(super) fn filtered(&self, uv: [f64; 2], du: [f64; 2], dv: [f64; 2]) -> [f32; 4] {
        let [width, height] = self.sizes[0].map(|side| side as f64);
        let ([a, b], [c, d]) = (du.map(|change| change * width), dv.map(|change| change * height));
        let (p, q, r) = (a * a + b * b, a * c + b * d, c * c + d * d);
        let (mean, half) = ((p + r) / 2.0, (p - r) / 2.0);
        let root = (half * half + q * q).sqrt();
        let major = (mean + root).sqrt();
        let minor = (mean - root).max(0.0).sqrt().max(1.0).max(major / PROBES);
        let count = (major / minor).round().clamp(1.0, PROBES);
        let level = libm::log2((major / count).max(1.0));
        if count.is_nan() || count == 1.0 {
            return self.smooth(uv, level);
        }
        let along = if half >= 0.0 { [half + root, q] } else { [q, root - half] };
        let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
        let axis = [along[0] / length * major / width, along[1] / length * major / height];
        let mut sum = [0.0; 4];
        for probe in 0..count as usize {
            let offset = (probe as f64 + 0.5) / count - 0.5;
            let sample = self.smooth([uv[0] + offset * axis[0], uv[1] + offset * axis[1]], level);
            sum = std::array::from_fn(|i| sum[i] + sample[i]);
        }
        sum.map(|sum| sum / count as f32)
    }

    /// Between two levels.
    fn smooth(&self, uv: [f64; 2], level: f64) -> [f32; 4] {
        let level = level.clamp(0.0, (self.levels.len() - 1) as f64);
        let (finer, between) = (level.floor() as usize, (level - level.floor()) as f32);
        let fine = self.linear(uv, finer);
        if between.is_nan() || between == 0.0 {
            return fine;
        }
        let coarse = self.linear(uv, finer + 1);
        std::array::from_fn(|i| mix(fine[i], coarse[i], between))
    }

    /// Between four pixels of a level.
    fn linear(&self, uv: [f64; 2], level: usize) -> [f32; 4] {
        let [(x0, x1, tx), (y0, y1, ty)] =
            std::array::from_fn(|axis| neighbours(uv[axis], self.sizes[level][axis], self.edges[axis]));
        let planes = &self.levels[level];
        std::array::from_fn(|channel| match &planes[channel] {
            None => MISSING[channel],
            Some(plane) => {
                let [top, bottom] = [plane.row(y0), plane.row(y1)].map(|row| mix(row[x0], row[x1], tx));
                mix(top, bottom, ty)
            }
        })
    }
}

/// Between two numbers; what has no part in it does not matter, be it NaN.
fn mix(a: f32, b: f32, t: f32) -> f32 {
    if t == 0.0 { a } else { a * (1.0 - t) + b * t }
}

/// The pixels left and right of a coordinate, and how far it is on the way.
fn neighbours(coordinate: f64, count: usize, edge: Edge) -> (usize, usize, f32) {
    let last = count - 1;
    match edge {
        Edge::Clamp => {
            let at = (coordinate * count as f64 - 0.5).clamp(0.0, last as f64);
            let left = at as usize;
            (left, (left + 1).min(last), (at - left as f64) as f32)
        }
        Edge::Wrap => {
            let at = (coordinate - coordinate.floor()) * count as f64 - 0.5;
            let left = if at < 0.0 { last } else { (at as usize).min(last) };
            (left, if left == last { 0 } else { left + 1 }, (at - at.floor()) as f32)
        }
    }
}
