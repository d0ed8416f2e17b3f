//! What the pixels of a block's row take from the source.
//!
//! Positions are rounded to 2^-24 px, the resolution of the weights: far above the locator's rounding errors, so
//! that a whole-pixel position is one, and exact for the fraction t and for 1 - t.

use super::block::{BLOCK_WIDTH, Part};
use super::filter::{FRACTION_BITS, Kernel, RESOLUTION};
use super::sample::Source;

const ONE: u64 = 1 << FRACTION_BITS;
/// Positions farther out than this, px, count as lying here.
const FARTHEST: f64 = (1_u64 << 27) as f64;
/// The last place of a number near this is 2^-24, and its own last 24 bits are zero.
const ROUNDER: f64 = 1.5 * (1_u64 << (52 - FRACTION_BITS)) as f64;

/// Rounds a position to 2^-24 px and splits it into whole pixels, rounded down, and the rest in 0..1. NaN counts as
/// far out: its rest is 0.
#[inline(always)]
pub(super) fn split(position: f64) -> (i32, f32) {
    let near = if position > -FARTHEST { position } else { -FARTHEST };
    let near = if near < FARTHEST { near } else { FARTHEST };
    let bits = (near + ROUNDER).to_bits();
    let whole = (bits >> FRACTION_BITS) as u32;
    let rest = (bits & (ONE - 1)) as u32 as i32 as f32 * RESOLUTION as f32;
    (whole.wrapping_sub((ROUNDER.to_bits() >> FRACTION_BITS) as u32) as i32, rest)
}

/// The samples do not hold the footprint, or the pixel is not drawn.
pub(super) const OUTSIDE: u32 = 1;
/// It stands at a whole position.
pub(super) const WHOLE: u32 = 2;
/// It stands at a whole position along one axis, where that matters.
pub(super) const BETWEEN: u32 = 4;

/// The taps of one row of a block, T x T each.
#[derive(Debug)]
pub(super) struct Taps<const T: usize> {
    /// Pixels of the row.
    pub count: usize,
    /// Number of the first pixel among the samples; 0 beyond the row's end.
    pub first: [u32; BLOCK_WIDTH],
    /// Why a pixel must be weighed alone, 0 if it need not.
    pub alone: [u32; BLOCK_WIDTH],
    /// Fraction of a pixel along each axis.
    pub rest: [[f32; BLOCK_WIDTH]; 2],
    /// The weights along each axis, tap by tap.
    pub weights: [[[f32; BLOCK_WIDTH]; T]; 2],
}

impl<const T: usize> Taps<T> {
    pub const EMPTY: Self = Self {
        count: 0,
        first: [0; BLOCK_WIDTH],
        alone: [0; BLOCK_WIDTH],
        rest: [[0.0; BLOCK_WIDTH]; 2],
        weights: [[[0.0; BLOCK_WIDTH]; T]; 2],
    };

    /// `either`: whole positions along one axis matter too, not only those along both.
    #[inline(always)]
    pub fn fill<const D: usize>(
        &mut self,
        kernel: &Kernel<T, D>,
        either: bool,
        source: &Source,
        positions: [&[f64]; 2],
        part: Part,
        stride: usize,
    ) {
        self.count = positions[0].len();
        let mut place = [[0_u32; BLOCK_WIDTH]; 2];
        let mut beyond = [[0_u32; BLOCK_WIDTH]; 2];
        for axis in 0..2 {
            let (corner, start) = (source.corner()[axis], part.corner[axis] + (T as i32 / 2 - 1));
            let last = (part.size[axis] - T) as i32;
            let places = place[axis].iter_mut().zip(&mut beyond[axis]).zip(&mut self.rest[axis]);
            for (((place, beyond), rest), &position) in places.zip(positions[axis]) {
                let (whole, fraction) = split(position - corner - 0.5);
                let held = (whole - start).clamp(0, last);
                (*place, *beyond, *rest) = (held as u32, (held ^ (whole - start)) as u32, fraction);
            }
        }
        let width = stride as u32;
        // Beyond the row's end too: loops of fixed length compile to whole vectors.
        for i in 0..BLOCK_WIDTH {
            let [x, y] = [u32::from(self.rest[0][i] == 0.0), u32::from(self.rest[1][i] == 0.0)];
            let outside = u32::from(beyond[0][i] | beyond[1][i] != 0);
            self.first[i] = place[1][i] * width + place[0][i];
            self.alone[i] = (outside * OUTSIDE) | ((x & y) * WHOLE) | ((u32::from(either) & (x ^ y)) * BETWEEN);
        }
        self.first[self.count..].fill(0);
        self.alone[self.count..].fill(0);
        for axis in 0..2 {
            for tap in 0..T {
                for i in 0..BLOCK_WIDTH {
                    self.weights[axis][tap][i] = kernel.weight(tap, self.rest[axis][i]);
                }
            }
        }
    }

    /// The greatest of `first`.
    #[inline(always)]
    pub fn last(&self) -> u32 {
        let mut last = 0;
        for first in self.first {
            last = if first > last { first } else { last };
        }
        last
    }

    /// Whether some pixel must be weighed alone.
    #[inline(always)]
    pub fn some_alone(&self) -> bool {
        let mut some = 0;
        for alone in self.alone {
            some |= alone;
        }
        some != 0
    }
}
