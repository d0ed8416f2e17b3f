//! What the pixels of a block's row take from the source.
//!
//! Positions are rounded to 2^-24 px, the resolution of the weights: far above the locator's rounding errors, so
//! that a whole-pixel position is one, and exact for the fraction t and for 1 - t.

use super::block::{BLOCK_WIDTH, Part};
use super::filter::{FRACTION_BITS, Kernel, RESOLUTION};
use super::sample::Source;

const ONE: u64 = 1 << FRACTION_BITS;
/// Positions farther out than this, px, count as lying here.
pub(super) const FARTHEST: f64 = (1_u64 << 27) as f64;
/// The last place of a number near this is 2^-24, and its own last 24 bits are zero.
pub(super) const ROUNDER: f64 = 1.5 * (1_u64 << (52 - FRACTION_BITS)) as f64;

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

/// The samples do not hold the footprint, or nothing is drawn and the range of the samples would show.
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
    /// The greatest of `first`.
    pub last: u32,
    /// Why a pixel must be weighed alone, 0 if it need not.
    pub alone: [u32; BLOCK_WIDTH],
    /// Whether some pixel must be.
    pub some_alone: bool,
    /// The weights along each axis, tap by tap; those along y are 0 where nothing is drawn.
    pub weights: [[[f32; BLOCK_WIDTH]; T]; 2],
}

/// What samples hold of an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    /// The window's corner, px.
    pub corner: f64,
    /// The whole part of the first position, counted from the window's corner, whose footprint the samples hold.
    pub start: i32,
    /// How many more there are.
    pub more: i32,
}

impl Extent {
    /// Along both axes; footprints of `taps` x `taps` pixels.
    fn of(source: &Source, part: Part, taps: usize) -> [Self; 2] {
        let (corner, before) = (source.corner(), taps as i32 / 2 - 1);
        [0, 1].map(|axis| Self {
            corner: corner[axis],
            start: part.corner[axis] + before,
            more: (part.size[axis] - taps) as i32,
        })
    }
}

impl<const T: usize> Taps<T> {
    pub const EMPTY: Self = Self {
        count: 0,
        first: [0; BLOCK_WIDTH],
        last: 0,
        alone: [0; BLOCK_WIDTH],
        some_alone: false,
        weights: [[[0.0; BLOCK_WIDTH]; T]; 2],
    };

    /// `clamp`: values will be cut to the range of samples. Then whole positions along one axis matter too.
    #[inline(always)]
    pub fn fill<const D: usize>(
        &mut self,
        kernel: &Kernel<T, D>,
        clamp: bool,
        source: &Source,
        positions: [&[f64]; 2],
        part: Part,
        stride: usize,
    ) {
        let extents = Extent::of(source, part, T);
        self.count = positions[0].len();
        #[cfg(target_arch = "x86_64")]
        if super::simd::fill(self, kernel, clamp, positions, &extents, stride as u32) {
            return;
        }
        self.fill_plainly(kernel, clamp, positions, &extents, stride as u32);
    }

    /// By plain loops.
    #[inline(always)]
    fn fill_plainly<const D: usize>(
        &mut self,
        kernel: &Kernel<T, D>,
        clamp: bool,
        positions: [&[f64]; 2],
        extents: &[Extent; 2],
        width: u32,
    ) {
        let mut place = [[0_u32; BLOCK_WIDTH]; 2];
        let mut beyond = [[0_u32; BLOCK_WIDTH]; 2];
        let mut rest = [[0.0; BLOCK_WIDTH]; 2];
        for (axis, &Extent { corner, start, more }) in extents.iter().enumerate() {
            let places = place[axis].iter_mut().zip(&mut beyond[axis]).zip(&mut rest[axis]);
            for (((place, beyond), rest), &position) in places.zip(positions[axis]) {
                let (whole, fraction) = split(position - corner - 0.5);
                let held = (whole - start).clamp(0, more);
                (*place, *beyond, *rest) = (held as u32, (held ^ (whole - start)) as u32, fraction);
            }
        }
        let mut drawn = [false; BLOCK_WIDTH];
        for (drawn, position) in drawn.iter_mut().zip(positions[0]) {
            *drawn = !position.is_nan();
        }
        // Beyond the row's end too: loops of fixed length compile to whole vectors.
        for i in 0..BLOCK_WIDTH {
            let [x, y] = [u32::from(rest[0][i] == 0.0), u32::from(rest[1][i] == 0.0)];
            let outside = u32::from((beyond[0][i] | beyond[1][i] != 0) & drawn[i]);
            self.first[i] = place[1][i] * width + place[0][i];
            let alone = (outside * OUTSIDE) | ((x & y) * WHOLE) | ((u32::from(clamp) & (x ^ y)) * BETWEEN);
            self.alone[i] = if drawn[i] { alone } else { u32::from(clamp) * OUTSIDE };
        }
        self.first[self.count..].fill(0);
        self.alone[self.count..].fill(0);
        self.last = 0;
        let mut some = 0;
        for i in 0..BLOCK_WIDTH {
            self.last = if self.first[i] > self.last { self.first[i] } else { self.last };
            some |= self.alone[i];
        }
        self.some_alone = some != 0;
        for axis in 0..2 {
            for tap in 0..T {
                for i in 0..BLOCK_WIDTH {
                    let weight = kernel.weight(tap, rest[axis][i]);
                    self.weights[axis][tap][i] = if (axis == 0) | drawn[i] { weight } else { 0.0 };
                }
            }
        }
    }
}

#[cfg(test)]
#[cfg(target_arch = "x86_64")]
mod tests {
    use super::*;
    use crate::rect::Rect;
    use crate::resample::Edge;
    use crate::resample::filter::{CUBIC, LANCZOS3};

    fn compare<const T: usize, const D: usize>(kernel: &Kernel<T, D>, clamp: bool, positions: [&[f64]; 2]) {
        let source = Source { window: Rect::new(-3, 5, 60, 40), edge: Edge::Transparent };
        let extents = Extent::of(&source, Part { corner: [2, -4], size: [30, 20] }, T);
        let (mut wide, mut plain) = (Taps::EMPTY, Taps::EMPTY);
        (wide.count, plain.count) = (positions[0].len(), positions[0].len());
        if !crate::resample::simd::fill(&mut wide, kernel, clamp, positions, &extents, 77) {
            return;
        }
        plain.fill_plainly(kernel, clamp, positions, &extents, 77);
        assert_eq!((wide.first, wide.last), (plain.first, plain.last));
        assert_eq!((wide.alone, wide.some_alone), (plain.alone, plain.some_alone));
        for (wide, plain) in wide.weights.as_flattened().iter().zip(plain.weights.as_flattened()) {
            let bits = |weights: &[f32; BLOCK_WIDTH]| {
                weights[..positions[0].len()].iter().map(|w| w.to_bits()).collect::<Vec<_>>()
            };
            assert_eq!(bits(wide), bits(plain));
        }
    }

    #[test]
    fn wide_and_plain_loops_fill_alike() {
        let hard = [f64::NAN, f64::INFINITY, -1e300, 1e300, 134217728.0, -134217729.5, 0.5, 10.5, 11.0, -0.0, 1e-20];
        let position =
            |i: usize, step: f64| if i.is_multiple_of(3) { hard[i / 3 % hard.len()] } else { i as f64 * step - 7.3 };
        for count in [1, 7, 8, 15, 16, 17, 33, 63, 64] {
            let x: Vec<f64> = (0..count).map(|i| position(i, 0.61)).collect();
            let y: Vec<f64> =
                x.iter().enumerate().map(|(i, x)| if x.is_nan() { *x } else { position(i + 4, 0.37) }).collect();
            for clamp in [false, true] {
                compare(&CUBIC, clamp, [&x, &y]);
                compare(&LANCZOS3, clamp, [&x, &y]);
            }
        }
    }
}
