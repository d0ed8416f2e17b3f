//! Filtered values of a tile's pixels, block by block.

use super::block::{BLOCK_WIDTH, Block, Part, Pixels};
use super::filter::Kernel;
use super::locate::Located;
use super::sample::Source;
use super::taps::Taps;
use super::weigh::{self, Footprint, Values};
use crate::poisson::simd::vectorized;
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
    let mut bad = 0;
    for (planes, out) in planes.chunks(TOGETHER).zip(out.chunks_mut(TOGETHER)) {
        bad += if let &[plane] = planes {
            let block = &mut blocks.alone;
            Painter { kernel, clamp, source, planes: [plane], positions, left, block, out, taps: Taps::EMPTY }.tile()
        } else {
            // Where there are fewer, the last one fills up.
            let planes = std::array::from_fn(|i| planes[i.min(planes.len() - 1)]);
            let block = &mut blocks.together;
            Painter { kernel, clamp, source, planes, positions, left, block, out, taps: Taps::EMPTY }.tile()
        };
    }
    bad
}

struct Painter<'a, 'b, const T: usize, const D: usize, const C: usize> {
    kernel: &'a Kernel<T, D>,
    clamp: bool,
    source: &'a Source,
    planes: [View<'a, f32>; C],
    positions: &'a Located,
    left: usize,
    block: &'a mut Block<C>,
    out: &'a mut [ViewMut<'b, f32>],
    taps: Taps<T>,
}

impl<const T: usize, const D: usize, const C: usize> Painter<'_, '_, T, D, C> {
    /// Draws all pixels and returns how many values are not finite.
    fn tile(mut self) -> u64 {
        let (width, rows) = (self.positions.width, 0..self.positions.height());
        let columns = (0..width).step_by(BLOCK_WIDTH).map(|start| start..width.min(start + BLOCK_WIDTH));
        let bad = columns.map(|columns| self.draw(Pixels { columns, rows: rows.clone() })).sum();
        #[cfg(target_arch = "x86_64")]
        super::simd::finish_stores();
        bad
    }

    /// Draws some pixels from one block, or in parts from smaller ones.
    fn draw(&mut self, pixels: Pixels) -> u64 {
        let mut bad = None;
        vectorized(
            #[inline(always)]
            || bad = self.once(&pixels),
        );
        bad.unwrap_or_else(|| pixels.parts().into_iter().map(|part| self.draw(part)).sum())
    }

    /// Draws some pixels, unless they lie too far apart in the source.
    #[inline(always)]
    fn once(&mut self, pixels: &Pixels) -> Option<u64> {
        let Some(part) = Part::of(self.source, self.positions, pixels, T) else {
            let columns = self.left + pixels.columns.start..self.left + pixels.columns.end;
            for out in &mut *self.out {
                pixels.rows.clone().for_each(|row| out.row_mut(row)[columns.clone()].fill(0.0));
            }
            return Some(0);
        };
        if !part.suits(pixels, T) {
            return None;
        }
        self.block.load(self.source, &self.planes, part);
        let mut bad = 0;
        for row in pixels.rows.clone() {
            bad += self.row(row, pixels);
        }
        Some(bad)
    }

    #[inline(always)]
    fn row(&mut self, row: usize, pixels: &Pixels) -> u64 {
        let (xs, ys) = self.positions.row(row);
        let (xs, ys) = (&xs[pixels.columns.clone()], &ys[pixels.columns.clone()]);
        self.taps.fill(self.kernel, self.source, [xs, ys], self.block.part());
        let mut values = [[0.0; C]; BLOCK_WIDTH];
        weigh::sums(self.block, &self.taps, &mut values);
        let wild = weigh::some_not_finite(&values);
        if self.clamp {
            weigh::clamp(self.block, &self.taps, &mut values);
        }
        let bad = if wild || self.taps.some_whole(self.clamp) { self.mend(xs, &mut values) } else { 0 };
        let count = self.out.len();
        let mut rows: [&mut [f32]; C] = std::array::from_fn(|_| Default::default());
        let columns = self.left + pixels.columns.start..self.left + pixels.columns.end;
        for (to, out) in rows.iter_mut().zip(&mut *self.out) {
            *to = &mut out.row_mut(row)[columns.clone()];
        }
        store(&values, &mut rows[..count]);
        bad
    }

    /// Weighs pixels of a row alone where zero weights matter: at whole positions and where a value is not finite.
    /// Returns how many values are not finite.
    #[cold]
    fn mend(&self, xs: &[f64], values: &mut Values<C>) -> u64 {
        let mut bad = 0;
        for (i, value) in values.iter_mut().enumerate().take(xs.len()) {
            if xs[i].is_nan() {
                *value = [0.0; C];
            } else if self.taps.is_whole(i, self.clamp) || value.iter().any(|value| !value.is_finite()) {
                let footprint = Footprint::new(self.kernel, self.block, &self.taps, i);
                *value = footprint.values(self.kernel, self.clamp);
                bad += value[..self.out.len()].iter().filter(|value| !value.is_finite()).count() as u64;
            }
        }
        bad
    }
}

/// Writes the values' channels to a row of each plane.
#[inline(always)]
fn store<const C: usize>(values: &Values<C>, rows: &mut [&mut [f32]]) {
    #[cfg(target_arch = "x86_64")]
    if super::simd::store(values, rows) {
        return;
    }
    for (channel, row) in rows.iter_mut().enumerate() {
        for (sample, value) in row.iter_mut().zip(values) {
            *sample = value[channel];
        }
    }
}
