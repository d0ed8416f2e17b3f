//! Eight or sixteen pixels at once, by the widest vectors there are; all give the same.

use pulp::{Simd, WithSimd};
#[cfg(target_arch = "x86_64")]
use pulp::{bytemuck::cast, f32x8, f32x16, x86::V3, x86::V4};

/// Pixels per word of bits.
pub(super) const WORD: usize = 64;

/// What a processor does with several pixels.
pub(super) trait Lanes: Copy {
    /// Bit x tells whether sample x is above 0.5.
    fn above_half(self, samples: &[f32; WORD]) -> u64;

    /// Value `places[x]` for each x, 0 where that is 0; places are below 8.
    fn pick(self, values: [u32; 8], places: [u8; 8]) -> [u32; 8];
}

/// Any processor.
#[derive(Clone, Copy)]
pub(super) struct Plain;

impl Lanes for Plain {
    #[inline(always)]
    fn above_half(self, samples: &[f32; WORD]) -> u64 {
        samples.iter().rev().fold(0, |bits, &sample| bits << 1 | u64::from(sample > 0.5))
    }

    #[inline(always)]
    fn pick(self, values: [u32; 8], places: [u8; 8]) -> [u32; 8] {
        places.map(|place| if place == 0 { 0 } else { values[usize::from(place) & 7] })
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for V3 {
    #[inline(always)]
    fn above_half(self, samples: &[f32; WORD]) -> u64 {
        let eights: [f32x8; 8] = cast(*samples);
        let mut bits = 0;
        for (index, eight) in eights.into_iter().enumerate() {
            let above = self.cmp_gt_f32x8(eight, self.splat_f32x8(0.5));
            bits |= (self.avx._mm256_movemask_ps(cast(above)) as u64) << (8 * index);
        }
        bits
    }

    #[inline(always)]
    fn pick(self, values: [u32; 8], places: [u8; 8]) -> [u32; 8] {
        let places = self.avx2._mm256_cvtepu8_epi32(cast([u64::from_le_bytes(places), 0]));
        let values = self.avx2._mm256_blend_epi32::<1>(cast(values), cast([0u32; 8]));
        cast(self.avx2._mm256_permutevar8x32_epi32(values, places))
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for V4 {
    #[inline(always)]
    fn above_half(self, samples: &[f32; WORD]) -> u64 {
        let sixteens: [f32x16; 4] = cast(*samples);
        let half = self.splat_f32x16(0.5);
        cast(sixteens.map(|sixteen| self.cmp_gt_f32x16(sixteen, half).0))
    }

    #[inline(always)]
    fn pick(self, values: [u32; 8], places: [u8; 8]) -> [u32; 8] {
        Lanes::pick(*self, values, places)
    }
}

/// Work that is done with lanes.
pub(super) trait Work: Sized {
    /// What it gives.
    type Result;

    /// Does it. All of it must be inlined, to be compiled for the processor of the lanes.
    fn with<L: Lanes>(self, lanes: L) -> Self::Result;
}

struct With<L, W>(L, W);

impl<L: Lanes, W: Work> WithSimd for With<L, W> {
    type Output = W::Result;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> W::Result {
        self.1.with(self.0)
    }
}

/// Does work with the widest lanes there are.
pub(super) fn with_lanes<W: Work>(work: W) -> W::Result {
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(lanes) = V4::try_new() {
            return Simd::vectorize(lanes, With(lanes, work));
        }
        if let Some(lanes) = V3::try_new() {
            return Simd::vectorize(lanes, With(lanes, work));
        }
    }
    work.with(Plain)
}

/// Does work with each kind of lanes there is.
#[cfg(test)]
pub(super) fn with_each<W: Work + Copy>(work: W) -> Vec<W::Result> {
    let mut results = vec![work.with(Plain)];
    #[cfg(target_arch = "x86_64")]
    {
        results.extend(V3::try_new().map(|lanes| Simd::vectorize(lanes, With(lanes, work))));
        results.extend(V4::try_new().map(|lanes| Simd::vectorize(lanes, With(lanes, work))));
    }
    results
}
