//! Gaussian blurs whose width differs from place to place, and their transposes, tile by tile.

use rayon::prelude::*;

use super::blur::{gaussian, mirrored};
use crate::simd::vectorized;
use crate::{Interrupted, Watch};

/// Variances below and above which a blur is none and is cut, square px.
const VARIANCES: [f32; 2] = [1.0 / 16.0, 64.0];

/// Side of a tile, px: more than a kernel reaches.
const TILE: usize = 64;

/// Samples that are summed side by side.
const LANES: usize = 16;

/// A blur that differs from place to place: a mixture of Gaussians whose variances double, in shares that give each
/// pixel's variance.
pub(super) struct LocalBlur<'a> {
    pub width: usize,
    height: usize,
    /// Each pixel's variance, square px; those that are NaN have no share in anything.
    pub variances: &'a [f32],
    parts: Vec<Part>,
    /// The least and the greatest variance of each tile, row by row; the first is greater where none is known.
    extents: Vec<[f32; 2]>,
}

/// A Gaussian of a mixture.
struct Part {
    /// All of its kernel.
    taps: Vec<f32>,
    variance: f32,
    /// By what its share falls per square px below and above its variance: 0 where it is the last one.
    slopes: [f32; 2],
}

impl Part {
    /// The variances before, of and after a part.
    fn new(before: Option<f32>, variance: f32, after: Option<f32>) -> Self {
        let half = gaussian(f64::from(variance));
        let taps = half[1..].iter().rev().chain(&half).copied().collect();
        let slope = |other: f32| 1.0 / (variance - other).abs();
        Self { taps, variance, slopes: [before, after].map(|other| other.map_or(0.0, slope)) }
    }

    /// Its share in a pixel's blur.
    #[inline(always)]
    fn share(&self, variance: f32) -> f32 {
        let above = taken(variance) - self.variance;
        let share = 1.0 + if above < 0.0 { above * self.slopes[0] } else { -above * self.slopes[1] };
        if share > 0.0 { share } else { 0.0 }
    }

    /// Whether it can have a share where variances are within some limits.
    fn is_in(&self, [low, high]: [f32; 2]) -> bool {
        low <= high && self.share(self.variance.clamp(low, high)) > 0.0
    }

    fn reach(&self) -> usize {
        self.taps.len() / 2
    }
}

/// The variance that is used for one; NaN stays.
#[inline(always)]
fn taken(variance: f32) -> f32 {
    let [least, most] = VARIANCES;
    let cut = if variance > most { most } else { variance };
    if cut < least { 0.0 } else { cut }
}

/// Scratch space for a tile.
struct Patch {
    /// A row of samples, and one of variances.
    rows: [Vec<f32>; 2],
    /// Rows of `TILE` samples, blurred along x.
    across: Vec<f32>,
    sum: [[f32; TILE]; TILE],
}

impl<'a> LocalBlur<'a> {
    /// The blur of a variance per pixel, square px.
    pub fn new(width: usize, variances: &'a [f32]) -> Self {
        let height = variances.len() / width.max(1);
        let extent = |[low, high]: [f32; 2], v: f32| [if v < low { v } else { low }, if v > high { v } else { high }];
        let none = [f32::INFINITY, f32::NEG_INFINITY];
        let band = |rows: &[f32]| {
            let mut extents = vec![none; width.div_ceil(TILE)];
            for row in rows.chunks(width) {
                for (tile, part) in extents.iter_mut().zip(row.chunks(TILE)) {
                    *tile = part.iter().fold(*tile, |all, &v| extent(all, taken(v)));
                }
            }
            extents
        };
        let extents: Vec<_> = variances.par_chunks((TILE * width).max(1)).flat_map_iter(band).collect();
        let [low, high] = extents.iter().fold(none, |all, of| [all[0].min(of[0]), all[1].max(of[1])]);
        let mut steps = Vec::from_iter((low <= high).then_some(low));
        while let Some(&last) = steps.last().filter(|&&last| last < high) {
            steps.push((2.0 * last.max(VARIANCES[0] / 2.0)).min(high));
        }
        let at = |step: usize| steps.get(step).copied();
        let part = |step: usize| Part::new(step.checked_sub(1).and_then(at), steps[step], at(step + 1));
        Self { width, height, variances, parts: (0..steps.len()).map(part).collect(), extents }
    }

    /// Writes the plane as the blur leaves it; 0 where no variance is known.
    pub fn apply(&self, plane: &[f32], out: &mut [f32], watch: Watch) -> Result<(), Interrupted> {
        self.mix(plane, out, false, watch)
    }

    /// Writes the transposed blur of a plane; only where variances are known it is sure to be there.
    pub fn transposed(&self, plane: &[f32], out: &mut [f32], watch: Watch) -> Result<(), Interrupted> {
        self.mix(plane, out, true, watch)
    }

    /// Adds up the parts: blurred, each has its share of every pixel; transposed, the share of every pixel is blurred.
    fn mix(&self, plane: &[f32], out: &mut [f32], transposed: bool, watch: Watch) -> Result<(), Interrupted> {
        out.par_chunks_mut((TILE * self.width).max(1)).enumerate().try_for_each(|(band, out)| {
            let mut patch = Patch { rows: Default::default(), across: Vec::new(), sum: [[0.0; TILE]; TILE] };
            for (column, left) in (0..self.width).step_by(TILE).enumerate() {
                patch.sum = [[0.0; TILE]; TILE];
                for part in self.parts.iter().filter(|part| self.counts(part, [column, band], transposed)) {
                    self.add(part, [column, band], plane, transposed, &mut patch);
                }
                let count = TILE.min(self.width - left);
                for (out, sum) in out.chunks_mut(self.width).zip(&patch.sum) {
                    out[left..left + count].copy_from_slice(&sum[..count]);
                }
            }
            watch.go_on()
        })
    }

    /// Whether a part counts in a tile: what is wanted there, or what comes there from it and the tiles around it.
    fn counts(&self, part: &Part, [column, band]: [usize; 2], transposed: bool) -> bool {
        let columns = self.width.div_ceil(TILE);
        let own = self.extents[band * columns + column];
        if !transposed {
            return part.is_in(own);
        }
        let around = |at: usize, count: usize| at.saturating_sub(1)..count.min(at + 2);
        let mut tiles = around(band, self.extents.len() / columns)
            .flat_map(|band| around(column, columns).map(move |column| band * columns + column));
        own[0] <= own[1] && tiles.any(|tile| part.is_in(self.extents[tile]))
    }

    /// Adds a part to a tile's sum.
    fn add(&self, part: &Part, [column, band]: [usize; 2], plane: &[f32], transposed: bool, patch: &mut Patch) {
        let Patch { rows: [samples, variances], across, sum } = patch;
        let (reach, left, top, width) = (part.reach(), column * TILE, band * TILE, self.width);
        let height = TILE.min(self.height - top);
        samples.resize(TILE + 2 * reach, 0.0);
        variances.resize(TILE + 2 * reach, 0.0);
        across.resize((height + 2 * reach) * TILE, 0.0);
        let from = left as isize - reach as isize;
        vectorized(
            #[inline(always)]
            || {
                for (y, across) in across.chunks_mut(TILE).enumerate() {
                    let row = mirrored((top + y) as isize - reach as isize, self.height) * width;
                    cut(&plane[row..row + width], from, samples);
                    if transposed {
                        cut(&self.variances[row..row + width], from, variances);
                        for (sample, &variance) in samples.iter_mut().zip(&*variances) {
                            *sample *= part.share(variance);
                        }
                    }
                    for x in (0..TILE).step_by(LANES) {
                        across[x..x + LANES].copy_from_slice(&weighted(&part.taps, &samples[x..], 1));
                    }
                }
                for (y, sum) in sum.iter_mut().take(height).enumerate() {
                    let row = (top + y) * width + left;
                    let known = &self.variances[row..row + TILE.min(width - left)];
                    for (x, sum) in (0..TILE).step_by(LANES).zip(sum.chunks_mut(LANES)) {
                        let down = weighted(&part.taps, &across[y * TILE + x..], TILE);
                        for ((sum, down), &variance) in sum.iter_mut().zip(down).zip(known.get(x..).unwrap_or(&[])) {
                            *sum += if transposed { down } else { part.share(variance) * down };
                        }
                    }
                }
            },
        );
    }
}

/// The samples of a row from `from` on, mirrored at its edges.
#[inline(always)]
fn cut(row: &[f32], from: isize, out: &mut [f32]) {
    let inside = usize::try_from(from).ok().and_then(|from| row.get(from..from + out.len()));
    match inside {
        Some(inside) => out.copy_from_slice(inside),
        None => out.iter_mut().zip(from..).for_each(|(out, x)| *out = row[mirrored(x, row.len())]),
    }
}

/// The sums of weights times samples that lie `stride` apart, `LANES` side by side.
#[inline(always)]
fn weighted(weights: &[f32], samples: &[f32], stride: usize) -> [f32; LANES] {
    let mut sums = [0.0; LANES];
    for (i, weight) in weights.iter().enumerate() {
        let samples = &samples[i * stride..i * stride + LANES];
        for lane in 0..LANES {
            sums[lane] += weight * samples[lane];
        }
    }
    sums
}
