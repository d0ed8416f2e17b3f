//! The weighted sums of eight pixels at a time, where the processor has AVX2: the same operations in the same order as
//! in [`weigh`](super::weigh), so the same bits.
//!
//! Planes stay apart: a pixel's taps are a few short loads per plane, and the eight results are stored as they lie.
//! The row's next pixels are fetched ahead, since memory latency is what a warp's reads cost most.

#![allow(unsafe_code)]

use super::filter::Kernel;
use super::taps::Taps;
use crate::view::View;
use std::arch::x86_64::*;

/// Pixels weighed together.
pub(super) const GROUP: usize = 8;
/// Groups between the one weighed and the one fetched.
const AHEAD: usize = 6;

/// Weighs the groups of a row whose pixels are all plain. Calls `left` with each pixel not done so, and with those
/// whose value is not finite in some plane: there the samples of weight zero decide.
///
/// The planes have one size and stride, that for which `taps` was filled; `out` has one row per plane.
pub(super) fn row<const L: usize, const D: usize, const P: usize>(
    kernel: &Kernel<L, D>,
    taps: &Taps,
    clamp: bool,
    planes: &[View<f32>; P],
    out: &mut [&mut [f32]; P],
    left: &mut Vec<usize>,
) {
    assert!(L == 4 || L == 8, "{L} lanes");
    let stride = planes[0].samples().1;
    let size = [planes[0].width(), planes[0].height()];
    assert!(planes.iter().all(|plane| plane.samples().1 == stride && [plane.width(), plane.height()] == size));
    assert!(out.iter().all(|row| row.len() == out[0].len()));
    let limits = [(size[0] + 1).saturating_sub(L) as u32, (size[1] + 1).saturating_sub(kernel.taps) as u32];
    // SAFETY: the caller's processor has AVX2, see `available`, and the planes are alike.
    unsafe { groups(kernel, taps, clamp, planes.map(|plane| plane.samples().0), stride, limits, out, left) }
}

/// Whether [`row`] may be called.
pub(super) fn available() -> bool {
    is_x86_feature_detected!("avx2")
}

#[target_feature(enable = "avx2")]
fn groups<const L: usize, const D: usize, const P: usize>(
    kernel: &Kernel<L, D>,
    taps: &Taps,
    clamp: bool,
    planes: [&[f32]; P],
    stride: usize,
    limits: [u32; 2],
    out: &mut [&mut [f32]; P],
    left: &mut Vec<usize>,
) {
    let width = out[0].len();
    for start in (0..width).step_by(GROUP) {
        let ahead = start + AHEAD * GROUP;
        if ahead + GROUP <= width && taps.plain[ahead..ahead + GROUP] == [true; GROUP] {
            for i in [ahead, ahead + GROUP / 2] {
                let at = offset(taps, i, stride);
                for plane in planes {
                    fetch(plane, at);
                    fetch(plane, at + (kernel.taps - 1) * stride);
                }
            }
        }
        if start + GROUP > width || taps.plain[start..start + GROUP] != [true; GROUP] {
            left.extend(start..width.min(start + GROUP));
            continue;
        }
        let mut at = [0; GROUP];
        for i in 0..GROUP {
            let (column, row) = (taps.first[0][start + i] as u32, taps.first[1][start + i] as u32);
            assert!(column < limits[0] && row < limits[1], "plain pixels lie inside");
            at[i] = offset(taps, start + i, stride);
        }
        // SAFETY: every pixel's L columns and `taps` rows lie inside the planes.
        let (values, finite) = unsafe { group(kernel, taps, start, clamp, planes, stride, &at) };
        for (out, value) in out.iter_mut().zip(values) {
            out[start..start + GROUP].copy_from_slice(&value);
        }
        left.extend((0..GROUP).filter(|i| finite & (1 << i) == 0).map(|i| start + i));
    }
}

#[inline(always)]
fn offset(taps: &Taps, i: usize, stride: usize) -> usize {
    taps.first[1][i] as usize * stride + taps.first[0][i] as usize
}

#[inline(always)]
fn fetch(plane: &[f32], at: usize) {
    // SAFETY: a prefetch reads nothing, whatever the address.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(plane.as_ptr().wrapping_add(at).cast()) }
}

/// The weights at eight places as `L` lanes of pixel i (low half) and i + 4 (high half) for four lanes; of one pixel
/// for eight.
#[inline]
#[target_feature(enable = "avx2")]
fn weights<const L: usize, const D: usize>(kernel: &Kernel<L, D>, t: __m256) -> __m256 {
    let s = _mm256_sub_ps(t, _mm256_set1_ps(0.5));
    let mut q = lanes(&kernel.q[D - 1]);
    for d in (0..D - 1).rev() {
        q = _mm256_add_ps(_mm256_mul_ps(q, s), lanes(&kernel.q[d]));
    }
    _mm256_add_ps(lanes(&kernel.at_zero), _mm256_mul_ps(t, q))
}

/// Four values twice, or eight.
#[inline]
#[target_feature(enable = "avx2")]
fn lanes<const L: usize>(values: &[f32; L]) -> __m256 {
    let values = values.as_ptr();
    // SAFETY: L samples, 4 or 8.
    unsafe { if L == 4 { _mm256_broadcast_ps(&_mm_loadu_ps(values)) } else { _mm256_loadu_ps(values) } }
}

/// Sums, and with `clamp` the inner taps' least and greatest, of four columns of two pixels, or folded from eight.
type Sums = (__m256, __m256, __m256);

/// Eight pixels' values in each plane, and a bit set for each of the pixels that is finite in all of them.
///
/// # Safety
/// From each of `at` on, `taps` rows of L samples lie in each plane.
#[inline]
#[target_feature(enable = "avx2")]
unsafe fn group<const L: usize, const D: usize, const P: usize>(
    kernel: &Kernel<L, D>,
    taps: &Taps,
    start: usize,
    clamp: bool,
    planes: [&[f32]; P],
    stride: usize,
    at: &[usize; GROUP],
) -> ([[f32; GROUP]; P], u32) {
    let mut sums = [[(_mm256_setzero_ps(), _mm256_setzero_ps(), _mm256_setzero_ps()); 4]; P];
    let rest = [&taps.rest[0][start..start + GROUP], &taps.rest[1][start..start + GROUP]];
    for pair in 0..4 {
        // SAFETY: as the caller promised.
        let pair_sums: [Sums; P] = unsafe {
            if L == 4 {
                let [x, y] = [twice(rest[0], pair), twice(rest[1], pair)];
                let [x, y] = [weights(kernel, x), weights(kernel, y)];
                fours(planes, stride, [at[pair], at[pair + 4]], x, y, clamp)
            } else {
                let mut low = eights(kernel, planes, stride, at[pair], [rest[0][pair], rest[1][pair]], clamp);
                let next = [rest[0][pair + 4], rest[1][pair + 4]];
                let high = eights(kernel, planes, stride, at[pair + 4], next, clamp);
                for plane in 0..P {
                    low[plane] = fold(low[plane], high[plane], clamp);
                }
                low
            }
        };
        for plane in 0..P {
            sums[plane][pair] = pair_sums[plane];
        }
    }
    finish(sums, clamp)
}

/// Values i and i + 4, four times each.
#[inline]
#[target_feature(enable = "avx2")]
fn twice(values: &[f32], i: usize) -> __m256 {
    _mm256_set_m128(_mm_set1_ps(values[i + 4]), _mm_set1_ps(values[i]))
}

/// Adds columns, clamps, and tells what is finite.
#[inline]
#[target_feature(enable = "avx2")]
fn finish<const P: usize>(sums: [[Sums; 4]; P], clamp: bool) -> ([[f32; GROUP]; P], u32) {
    let mut values = [[0.0; GROUP]; P];
    let mut wild = _mm256_setzero_si256();
    for plane in 0..P {
        let [a, b, c, d] = transposed([sums[plane][0].0, sums[plane][1].0, sums[plane][2].0, sums[plane][3].0]);
        let sum = _mm256_add_ps(_mm256_add_ps(a, b), _mm256_add_ps(c, d));
        let mut sum = _mm256_add_ps(sum, _mm256_setzero_ps());
        let size = _mm256_and_si256(_mm256_castps_si256(sum), _mm256_set1_epi32(i32::MAX));
        wild = _mm256_or_si256(wild, _mm256_cmpgt_epi32(size, _mm256_set1_epi32(f32::MAX.to_bits() as i32)));
        if clamp {
            let [_, low, other, _] =
                transposed([sums[plane][0].1, sums[plane][1].1, sums[plane][2].1, sums[plane][3].1]);
            sum = _mm256_max_ps(_mm256_min_ps(low, other), sum);
            let [_, high, other, _] =
                transposed([sums[plane][0].2, sums[plane][1].2, sums[plane][2].2, sums[plane][3].2]);
            sum = _mm256_min_ps(_mm256_max_ps(high, other), sum);
        }
        // SAFETY: eight samples.
        unsafe { _mm256_storeu_ps(values[plane].as_mut_ptr(), sum) };
    }
    (values, !_mm256_movemask_ps(_mm256_castsi256_ps(wild)) as u32)
}

/// The columns' terms of two pixels, four columns each.
///
/// # Safety
/// From each of `at` on, four rows of four samples lie in each plane.
#[inline]
#[target_feature(enable = "avx2")]
unsafe fn fours<const P: usize>(
    planes: [&[f32]; P],
    stride: usize,
    at: [usize; 2],
    x: __m256,
    y: __m256,
    clamp: bool,
) -> [Sums; P] {
    let y = [
        _mm256_permute_ps::<0x00>(y),
        _mm256_permute_ps::<0x55>(y),
        _mm256_permute_ps::<0xaa>(y),
        _mm256_permute_ps::<0xff>(y),
    ];
    let zero = _mm256_setzero_ps();
    let mut all = [(zero, zero, zero); P];
    for plane in 0..P {
        let mut rows = [zero; 4];
        for row in 0..4 {
            // SAFETY: as the caller promised.
            rows[row] = unsafe {
                let first = planes[plane].as_ptr().add(row * stride);
                _mm256_loadu2_m128(first.add(at[1]), first.add(at[0]))
            };
        }
        let mut sum = _mm256_mul_ps(y[0], rows[0]);
        for row in 1..4 {
            sum = _mm256_add_ps(sum, _mm256_mul_ps(y[row], rows[row]));
        }
        all[plane].0 = _mm256_mul_ps(x, sum);
        if clamp {
            (all[plane].1, all[plane].2) = (_mm256_min_ps(rows[1], rows[2]), _mm256_max_ps(rows[1], rows[2]));
        }
    }
    all
}

/// The columns' terms of one pixel, eight columns.
///
/// # Safety
/// From `at` on, `taps` rows of eight samples lie in each plane.
#[inline]
#[target_feature(enable = "avx2")]
unsafe fn eights<const L: usize, const D: usize, const P: usize>(
    kernel: &Kernel<L, D>,
    planes: [&[f32]; P],
    stride: usize,
    at: usize,
    rest: [f32; 2],
    clamp: bool,
) -> [Sums; P] {
    let x = weights(kernel, _mm256_set1_ps(rest[0]));
    let y = weights(kernel, _mm256_set1_ps(rest[1]));
    let mut down = [0.0; 8];
    // SAFETY: eight samples.
    unsafe { _mm256_storeu_ps(down.as_mut_ptr(), y) };
    let middle = kernel.taps / 2 - 1;
    let ends = (_mm256_setzero_ps(), _mm256_set1_ps(f32::INFINITY), _mm256_set1_ps(f32::NEG_INFINITY));
    let mut all = [ends; P];
    for plane in 0..P {
        let (mut sum, mut low, mut high) = ends;
        for row in 0..kernel.taps {
            // SAFETY: as the caller promised.
            let samples = unsafe { _mm256_loadu_ps(planes[plane].as_ptr().add(at + row * stride)) };
            sum = _mm256_add_ps(sum, _mm256_mul_ps(_mm256_set1_ps(down[row]), samples));
            if clamp && (row == middle || row == middle + 1) {
                (low, high) = (_mm256_min_ps(low, samples), _mm256_max_ps(high, samples));
            }
        }
        all[plane] = (_mm256_mul_ps(x, sum), low, high);
    }
    all
}

/// Two pixels' eight columns as four each: terms added to those four columns on, the inner two columns of the others
/// at 1 and 2.
#[inline]
#[target_feature(enable = "avx2")]
fn fold(a: Sums, b: Sums, clamp: bool) -> Sums {
    let sum = _mm256_add_ps(_mm256_permute2f128_ps::<0x20>(a.0, b.0), _mm256_permute2f128_ps::<0x31>(a.0, b.0));
    if !clamp {
        return (sum, a.1, a.2);
    }
    // The inner taps are columns 2 and 3 of six.
    let low = _mm256_permute_ps::<0b11_11_10_00>(_mm256_permute2f128_ps::<0x20>(a.1, b.1));
    let high = _mm256_permute_ps::<0b11_11_10_00>(_mm256_permute2f128_ps::<0x20>(a.2, b.2));
    (sum, low, high)
}

/// Four columns of pixels i and i + 4, i = 0, 1, 2, 3, as columns of eight pixels.
#[inline]
#[target_feature(enable = "avx2")]
fn transposed([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
    let (ef, gh) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
    [
        _mm256_shuffle_ps::<0x44>(ab, cd),
        _mm256_shuffle_ps::<0xee>(ab, cd),
        _mm256_shuffle_ps::<0x44>(ef, gh),
        _mm256_shuffle_ps::<0xee>(ef, gh),
    ]
}
