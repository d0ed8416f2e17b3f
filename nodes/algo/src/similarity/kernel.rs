//! Sums of squares of whole numbers, by the widest vectors there are; all give the same.

use pulp::bytemuck::{Pod, Zeroable, cast};
use pulp::{Simd, WithSimd};
#[cfg(target_arch = "x86_64")]
use pulp::{i16x16, i16x32, i32x8, i32x16};

use super::level::{Pair, Probe};

/// Pixels whose sums are made together.
pub(super) const BLOCK: usize = 64;

/// A processor's way to square the differences of pairs and add them up.
trait Lanes: Copy {
    /// One sum per pixel of a block.
    type Sums: Pod;

    /// Adds the squared differences of a pair from another to each sum.
    fn add(self, sums: Self::Sums, pairs: [Pair; BLOCK], other: Pair) -> Self::Sums;
}

#[derive(Clone, Copy)]
struct Plain;

impl Lanes for Plain {
    type Sums = [i32; BLOCK];

    #[inline(always)]
    fn add(self, mut sums: Self::Sums, pairs: [Pair; BLOCK], other: Pair) -> Self::Sums {
        for (sum, pair) in sums.iter_mut().zip(pairs) {
            let [a, b] = [0, 1].map(|i| i32::from(pair[i] - other[i]));
            *sum += a * a + b * b;
        }
        sums
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for pulp::x86::V3 {
    type Sums = [i32x8; 8];

    #[inline(always)]
    fn add(self, mut sums: Self::Sums, pairs: [Pair; BLOCK], other: Pair) -> Self::Sums {
        let (pairs, other): ([i16x16; 8], i16x16) = (cast(pairs), cast([other; 8]));
        for (sum, pairs) in sums.iter_mut().zip(pairs) {
            let by = self.wrapping_sub_i16x16(pairs, other);
            *sum = self.wrapping_add_i32x8(*sum, self.multiply_wrapping_add_adjacent_i16x16(by, by));
        }
        sums
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for pulp::x86::V4 {
    type Sums = [i32x16; 4];

    #[inline(always)]
    fn add(self, mut sums: Self::Sums, pairs: [Pair; BLOCK], other: Pair) -> Self::Sums {
        let (pairs, other): ([i16x32; 4], i16x32) = (cast(pairs), cast([other; 16]));
        for (sum, pairs) in sums.iter_mut().zip(pairs) {
            let by = self.wrapping_sub_i16x32(pairs, other);
            *sum = self.wrapping_add_i32x16(*sum, self.multiply_wrapping_add_adjacent_i16x32(by, by));
        }
        sums
    }
}

/// A row of distances to be made.
struct Row<'a> {
    pairs: &'a [Pair],
    probe: &'a Probe,
    out: &'a mut [i32],
}

impl Row<'_> {
    #[inline(always)]
    fn make<L: Lanes>(self, lanes: L) {
        let Self { pairs, probe, out } = self;
        let (out, _) = out.as_chunks_mut::<BLOCK>();
        for (block, out) in out.iter_mut().enumerate() {
            let pairs = &pairs[block * BLOCK..];
            let mut sums = L::Sums::zeroed();
            for &(offset, other) in probe {
                let pairs = pairs[offset..].first_chunk().expect("rows are whole blocks");
                sums = lanes.add(sums, *pairs, other);
            }
            *out = cast(sums);
        }
    }
}

/// A row and the lanes to make it with: all of the work is compiled for their processor.
struct With<'a, L> {
    lanes: L,
    row: Row<'a>,
}

impl<L: Lanes> WithSimd for With<'_, L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.row.make(self.lanes);
    }
}

/// The squared distances of a row of pixels from a probe: `pairs` as [`Rows::row`](super::level::Rows::row) gives them, `out`
/// of whole blocks.
pub(super) fn row(pairs: &[Pair], probe: &Probe, out: &mut [i32]) {
    let row = Row { pairs, probe, out };
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(lanes) = pulp::x86::V4::try_new() {
            return Simd::vectorize(lanes, With { lanes, row });
        }
        if let Some(lanes) = pulp::x86::V3::try_new() {
            return Simd::vectorize(lanes, With { lanes, row });
        }
    }
    row.make(Plain);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_lanes_give_the_same() {
        let number = |i: usize| (i.wrapping_mul(2_654_435_761) >> 7) as i16 & 255;
        let pairs: Vec<Pair> = (0..600).map(|i| [number(2 * i), number(2 * i + 1)]).collect();
        let probe: Probe = (0..40).map(|i| (i * 9 + i % 3, [number(i + 5), number(i + 11)])).collect();
        let made = |make: &dyn Fn(Row)| {
            let mut out = vec![7; 3 * BLOCK];
            make(Row { pairs: &pairs, probe: &probe, out: &mut out });
            out
        };
        let expected = made(&|row| row.make(Plain));
        let direct = |x: usize| {
            let square = |(offset, other): &(usize, Pair)| {
                let [a, b] = [0, 1].map(|i| i32::from(pairs[offset + x][i]) - i32::from(other[i]));
                a.pow(2) + b.pow(2)
            };
            probe.iter().map(square).sum::<i32>()
        };
        assert_eq!(expected, (0..3 * BLOCK).map(direct).collect::<Vec<_>>());
        #[cfg(target_arch = "x86_64")]
        {
            if let Some(lanes) = pulp::x86::V3::try_new() {
                assert_eq!(made(&|row| Simd::vectorize(lanes, With { lanes, row })), expected);
            }
            if let Some(lanes) = pulp::x86::V4::try_new() {
                assert_eq!(made(&|row| Simd::vectorize(lanes, With { lanes, row })), expected);
            }
        }
    }
}
