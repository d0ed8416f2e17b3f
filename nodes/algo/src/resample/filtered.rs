//! Filtered values of a tile's pixels, block by block.

use super::block::{BLOCK_WIDTH, Block, Part, Pixels, Samples, Supply, finish_stores, store};
use super::filter::Kernel;
use super::locate::Located;
use super::sample::Source;
use super::taps::{Taps, WHOLE};
use super::weigh::{self, Footprint, Values};
use crate::simd::vectorized;
use crate::view::{View, ViewMut};

/// Planes that are weighed together.
const TOGETHER: usize = 4;

/// Room for the copies of parts of the source.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    together: Block<TOGETHER>,
    alone: Block<1>,
}

/// Gives each pixel of a tile the value filtered with a kernel; places as in [`nearest`](super::sample::nearest). Returns
/// how many of the values are not finite.
pub(super) fn filtered<const T: usize, const D: usize>(
    kernel: &Kernel<T, D>,
    clamp: bool,
    source: &Source,
    planes: &[View<f32>],
    positions: &Located,
    left: usize,
    blocks: &mut Blocks,
    out: &mut [ViewMut<f32>],
) -> u64 {
    let mut painter = Painter { kernel, clamp, source, positions, left, taps: Taps::EMPTY };
    let (width, rows) = (positions.width, 0..positions.height);
    let columns = (0..width).step_by(BLOCK_WIDTH).map(|start| start..width.min(start + BLOCK_WIDTH));
    let pixels: Vec<_> = columns.map(|columns| Pixels { columns, rows: rows.clone() }).collect();
    let (mut parts, mut bad) = (vec![None; pixels.len()], 0);
    vectorized(
        #[inline(always)]
        || {
            for (part, pixels) in parts.iter_mut().zip(&pixels) {
                *part = Part::of(source, positions, pixels, T);
            }
        },
    );
    for (i, pixels) in pixels.iter().enumerate() {
        // The next block's samples are fetched while this one is drawn.
        let next = parts.get(i + 1).copied().flatten().filter(|part| part.is_dense(pixels, T));
        let next = next.map(|part| part.inside(source));
        vectorized(
            #[inline(always)]
            || bad += painter.block(planes, pixels, [parts[i], next], blocks, out),
        );
    }
    finish_stores();
    bad
}

struct Painter<'a, const T: usize, const D: usize> {
    kernel: &'a Kernel<T, D>,
    clamp: bool,
    source: &'a Source,
    positions: &'a Located,
    left: usize,
    taps: Taps<T>,
}

impl<const T: usize, const D: usize> Painter<'_, T, D> {
    /// Draws a block from its part of the source, if there is one, and fetches the next one's. Returns how many values
    /// are not finite.
    #[inline(always)]
    fn block(
        &mut self,
        planes: &[View<f32>],
        pixels: &Pixels,
        [part, next]: [Option<Part>; 2],
        blocks: &mut Blocks,
        out: &mut [ViewMut<f32>],
    ) -> u64 {
        let Some(part) = part else {
            let columns = self.columns(pixels);
            for out in out {
                pixels.rows.clone().for_each(|row| out.row_mut(row)[columns.clone()].fill(0.0));
            }
            return 0;
        };
        let dense = part.is_dense(pixels, T);
        let mut bad = 0;
        for (planes, out) in planes.chunks(TOGETHER).zip(out.chunks_mut(TOGETHER)) {
            if dense && planes.len() > 1 {
                // Where there are fewer, the last one fills up.
                let planes = std::array::from_fn(|i| planes[i.min(planes.len() - 1)]);
                let supply = blocks.together.supply(self.source, planes, part, next);
                bad += self.rows(supply, pixels, out);
                continue;
            }
            for (&plane, out) in planes.iter().zip(out.chunks_mut(1)) {
                let supply = if dense && part.inside(self.source) != part {
                    blocks.alone.supply(self.source, [plane], part, next)
                } else {
                    let supply = Supply::of_plane(plane, self.source, &part, next, T);
                    if dense { supply } else { supply.sparse() }
                };
                bad += self.rows(supply, pixels, out);
            }
        }
        bad
    }

    /// The columns of `pixels` in the output.
    fn columns(&self, pixels: &Pixels) -> std::ops::Range<usize> {
        self.left + pixels.columns.start..self.left + pixels.columns.end
    }

    #[inline(always)]
    fn rows<const C: usize>(&mut self, mut supply: Supply<C>, pixels: &Pixels, out: &mut [ViewMut<f32>]) -> u64 {
        let (mut values, mut bad) = ([[0.0; C]; BLOCK_WIDTH], 0);
        // Iterators' closures are not always compiled for the vectors at hand.
        for row in pixels.rows.clone() {
            bad += self.row(row, &mut supply, pixels, &mut values, out);
        }
        bad
    }

    #[inline(always)]
    fn row<const C: usize>(
        &mut self,
        row: usize,
        supply: &mut Supply<C>,
        pixels: &Pixels,
        values: &mut Values<C>,
        out: &mut [ViewMut<f32>],
    ) -> u64 {
        let (xs, ys) = self.positions.row(row);
        let at = [&xs[pixels.columns.clone()], &ys[pixels.columns.clone()]];
        self.taps.fill(self.kernel, self.clamp, self.source, at, supply.part, supply.stride);
        let samples = &supply.samples(self.taps.last as usize / supply.stride + T);
        let wild = weigh::sums(samples, &self.taps, values);
        if self.clamp {
            weigh::clamp(samples, &self.taps, values);
        }
        let bad = if wild || (self.taps.some_alone && self.needs_mending(values)) {
            self.mend(samples, at, out.len(), values)
        } else {
            0
        };
        let columns = self.columns(pixels);
        store(values, row, columns, out);
        bad
    }

    /// Whether a pixel to be weighed alone may differ. At a whole position a finite value is right but for the sign of a
    /// zero: there weights are 0 and 1, or samples of weight 0 change no sum.
    #[inline(always)]
    fn needs_mending<const C: usize>(&self, values: &Values<C>) -> bool {
        let mut some = false;
        for (value, &alone) in values.iter().zip(&self.taps.alone) {
            let mut zero = self.clamp;
            for channel in value {
                zero |= *channel == 0.0;
            }
            some |= if alone == WHOLE { zero } else { alone != 0 };
        }
        some
    }

    /// Weighs pixels of a row alone: those that must be, and those where a value is not finite, since there zero weights
    /// matter. Returns how many of the first `count` channels' values are not finite.
    #[cold]
    #[inline(never)]
    fn mend<const C: usize>(&self, samples: &Samples<C>, at: [&[f64]; 2], count: usize, values: &mut Values<C>) -> u64 {
        let mut bad = 0;
        vectorized(
            #[inline(always)]
            || bad = self.mended(samples, at, count, values),
        );
        bad
    }

    #[inline(always)]
    fn mended<const C: usize>(
        &self,
        samples: &Samples<C>,
        [xs, ys]: [&[f64]; 2],
        count: usize,
        values: &mut Values<C>,
    ) -> u64 {
        let mut bad = 0;
        for (i, value) in values.iter_mut().enumerate().take(xs.len()) {
            if xs[i].is_nan() {
                *value = [0.0; C];
                continue;
            }
            if self.taps.alone[i] == WHOLE && self.kernel.interpolates() {
                *value = samples.from(self.taps.first[i])[(T / 2 - 1) * (samples.stride + 1)];
            } else if self.taps.alone[i] != 0 || value.iter().any(|value| !value.is_finite()) {
                let footprint = Footprint::new(self.kernel, self.source, [xs[i], ys[i]]);
                *value = footprint.values(&samples.planes, self.clamp);
            }
            bad += value[..count].iter().filter(|value| !value.is_finite()).count() as u64;
        }
        bad
    }
}
