//! What plain loops do not reach: hints to the memory; and where the processor has AVX-512 copies of rows side by side; the
//! taps of a row; the weighted sums of four taps and four
//! channels or one, four pixels at a time; both by the same operations in the same order as in [`taps`](super::taps) and
//! [`weigh`](super::weigh), so with the same bits; and stores that pass by the cache, since a large picture is not read again
//! soon.

#![allow(unsafe_code)]

use super::block::{BLOCK_WIDTH, Samples};
use super::filter::{FRACTION_BITS, Kernel, RESOLUTION};
use super::taps::{BETWEEN, Extent, FARTHEST, OUTSIDE, ROUNDER, Taps, WHOLE};
use super::weigh::Values;
use std::arch::x86_64::*;

/// Samples in a cache line and in a vector.
pub(super) const LINE: usize = 16;
/// Taps and channels.
const FOUR: usize = 4;

fn available() -> bool {
    is_x86_feature_detected!("avx512f")
}

/// Has the memory bring samples nearer, for later.
#[inline(always)]
pub(super) fn fetch<T>(samples: &[T]) {
    for line in samples.chunks(64 / size_of::<T>()) {
        // SAFETY: a prefetch reads nothing.
        unsafe { _mm_prefetch::<_MM_HINT_T1>(line.as_ptr().cast()) }
    }
}

/// Fills the taps of a row by the same operations as [`Taps::fill`]; whether it did.
#[inline(always)]
pub(super) fn fill<const T: usize, const D: usize>(
    taps: &mut Taps<T>,
    kernel: &Kernel<T, D>,
    clamp: bool,
    positions: [&[f64]; 2],
    extents: &[Extent; 2],
    stride: u32,
) -> bool {
    if !available() {
        return false;
    }
    assert!(positions.iter().all(|positions| positions.len() == taps.count && taps.count <= BLOCK_WIDTH));
    // SAFETY: the processor has AVX-512; there is room for the row.
    unsafe { fill_row(taps, kernel, clamp, positions, extents, stride) }
    true
}

/// # Safety
/// There are `count` of `positions`, `BLOCK_WIDTH` at most.
#[target_feature(enable = "avx512f")]
unsafe fn fill_row<const T: usize, const D: usize>(
    taps: &mut Taps<T>,
    kernel: &Kernel<T, D>,
    clamp: bool,
    positions: [&[f64]; 2],
    extents: &[Extent; 2],
    stride: u32,
) {
    let (zero, all) = (_mm512_setzero_ps(), |value: i32| _mm512_set1_epi32(value));
    let (mut last, mut some) = (_mm512_setzero_si512(), _mm512_setzero_si512());
    for start in (0..taps.count).step_by(LINE) {
        let held = u16::MAX >> (LINE - (taps.count - start).min(LINE));
        // SAFETY: there are as many positions as `held` has bits from `start` on.
        let drawn = unsafe { numbers(positions[0].as_ptr().add(start), held) };
        let mut place = [_mm512_setzero_si512(); 2];
        let (mut outside, mut whole) = (0, [0; 2]);
        for axis in 0..2 {
            // SAFETY: there are as many positions as `held` has bits from `start` on; weights have room for whole vectors.
            unsafe {
                let (at, rest) = places(positions[axis].as_ptr().add(start), held, &extents[axis]);
                place[axis] = _mm512_min_epi32(_mm512_max_epi32(at, all(0)), all(extents[axis].more));
                outside |= _mm512_cmpneq_epi32_mask(place[axis], at);
                whole[axis] = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(rest, zero);
                let s = _mm512_sub_ps(rest, _mm512_set1_ps(0.5));
                for tap in 0..T {
                    let mut q = _mm512_set1_ps(kernel.q[D - 1][tap]);
                    for d in (0..D - 1).rev() {
                        q = _mm512_fmadd_ps(q, s, _mm512_set1_ps(kernel.q[d][tap]));
                    }
                    let weighed = if axis == 0 { held } else { drawn };
                    let weight = _mm512_maskz_fmadd_ps(weighed, rest, q, _mm512_set1_ps(kernel.at_zero[tap]));
                    _mm512_storeu_ps(taps.weights[axis][tap].as_mut_ptr().add(start), weight);
                }
            }
        }
        let between = if clamp { whole[0] ^ whole[1] } else { 0 };
        let outside = (outside & drawn) | if clamp { held & !drawn } else { 0 };
        let reasons = [(outside, OUTSIDE), (whole[0] & whole[1] & drawn, WHOLE), (between & drawn, BETWEEN)];
        let mut alone = _mm512_setzero_si512();
        for (pixels, reason) in reasons {
            alone = _mm512_or_si512(alone, _mm512_maskz_mov_epi32(pixels, all(reason as i32)));
        }
        let row = _mm512_mullo_epi32(place[1], all(stride as i32));
        let first = _mm512_maskz_add_epi32(held, row, place[0]);
        (last, some) = (_mm512_max_epu32(last, first), _mm512_or_si512(some, alone));
        // SAFETY: there is room for whole vectors.
        unsafe {
            _mm512_storeu_epi32(taps.first.as_mut_ptr().add(start).cast(), first);
            _mm512_storeu_epi32(taps.alone.as_mut_ptr().add(start).cast(), alone);
        }
    }
    let end = taps.count.next_multiple_of(LINE);
    taps.first[end..].fill(0);
    taps.alone[end..].fill(0);
    (taps.last, taps.some_alone) = (_mm512_reduce_max_epu32(last), _mm512_test_epi32_mask(some, some) != 0);
}

/// Which of as many positions as `held` has bits are numbers.
///
/// # Safety
/// There are as many.
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn numbers(positions: *const f64, held: u16) -> u16 {
    let mask = |half: usize| {
        let held = (held >> (8 * half)) as u8;
        // SAFETY: no more is read than the caller promised.
        let at = unsafe { _mm512_maskz_loadu_pd(held, positions.wrapping_add(8 * half)) };
        u16::from(_mm512_mask_cmp_pd_mask::<_CMP_ORD_Q>(held, at, at)) << (8 * half)
    };
    mask(0) | mask(1)
}

/// The whole parts, less the extent's start, and the rests of as many positions as `held` has bits: those of
/// [`split`](super::taps::split).
///
/// # Safety
/// There are as many.
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn places(positions: *const f64, held: u16, extent: &Extent) -> (__m512i, __m512) {
    let bits = |half: usize| {
        // SAFETY: no more is read than the caller promised.
        let at = unsafe { _mm512_maskz_loadu_pd((held >> (8 * half)) as u8, positions.wrapping_add(8 * half)) };
        let at = _mm512_sub_pd(_mm512_sub_pd(at, _mm512_set1_pd(extent.corner)), _mm512_set1_pd(0.5));
        let near = _mm512_min_pd(_mm512_max_pd(at, _mm512_set1_pd(-FARTHEST)), _mm512_set1_pd(FARTHEST));
        _mm512_castpd_si512(_mm512_add_pd(near, _mm512_set1_pd(ROUNDER)))
    };
    let low = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
    let (a, b) = (bits(0), bits(1));
    let shifted = |bits: __m512i| _mm512_srli_epi64::<FRACTION_BITS>(bits);
    let whole = _mm512_permutex2var_epi32(shifted(a), low, shifted(b));
    let none = ((ROUNDER.to_bits() >> FRACTION_BITS) as i32).wrapping_add(extent.start);
    let rest = _mm512_and_si512(_mm512_permutex2var_epi32(a, low, b), _mm512_set1_epi32((1 << FRACTION_BITS) - 1));
    let rest = _mm512_mul_ps(_mm512_cvtepi32_ps(rest), _mm512_set1_ps(RESOLUTION as f32));
    (_mm512_sub_epi32(whole, _mm512_set1_epi32(none)), rest)
}

/// The weighted sums of a row; whether some is NaN or infinite, none if there is no faster way here.
#[inline(always)]
pub(super) fn sums<const T: usize, const C: usize>(
    samples: &Samples<C>,
    taps: &Taps<T>,
    values: &mut Values<C>,
) -> Option<bool> {
    if T != FOUR || (C != FOUR && C != 1) || !available() {
        return None;
    }
    let (pixels, stride) = (samples.from(0), samples.stride);
    let mut last = 0;
    for first in taps.first {
        last = if first > last { first } else { last };
    }
    assert!(last as usize + (FOUR - 1) * stride + FOUR <= pixels.len(), "the samples hold the footprints");
    let (samples, values) = (pixels.as_flattened(), values.as_flattened_mut());
    let first = &taps.first[..taps.count.next_multiple_of(FOUR)];
    let [across, down] = &taps.weights;
    // SAFETY: the processor has AVX-512; each footprint lies in `samples`.
    Some(unsafe {
        if C == FOUR {
            fours(samples, stride * FOUR, first, across, down, values)
        } else {
            singles(samples, stride, first, across, down, values)
        }
    })
}

/// # Safety
/// From each of `first` on, `FOUR` rows of `FOUR` samples, `stride` apart, lie in `samples`. There is a multiple of `FOUR`
/// of `first`, `BLOCK_WIDTH` at most, that many `values`, and `FOUR` of `across` and of `down`.
#[target_feature(enable = "avx512f")]
unsafe fn singles(
    samples: &[f32],
    stride: usize,
    first: &[u32],
    across: &[[f32; BLOCK_WIDTH]],
    down: &[[f32; BLOCK_WIDTH]],
    values: &mut [f32],
) -> bool {
    // Four values as columns or rows of four lanes, and each lane group's first.
    let spread = _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
    let turn = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
    let firsts = _mm512_setr_epi32(0, 4, 8, 12, 0, 4, 8, 12, 0, 4, 8, 12, 0, 4, 8, 12);
    // NaN where a sum is not finite, else a zero.
    let mut wild = _mm512_setzero_ps();
    for start in (0..first.len()).step_by(FOUR) {
        // SAFETY: as the caller promised.
        unsafe {
            let tap = |weights: &[[f32; BLOCK_WIDTH]], tap: usize| _mm_loadu_ps(weights[tap].as_ptr().add(start));
            let at = [0, 1, 2, 3].map(|i| samples.as_ptr().add(first[start + i] as usize));
            let mut sum = _mm512_setzero_ps();
            for row in 0..FOUR {
                let row_of = at.map(|at| _mm_loadu_ps(at.add(row * stride)));
                let weights = _mm512_permutexvar_ps(spread, _mm512_castps128_ps512(tap(down, row)));
                sum = _mm512_fmadd_ps(weights, joined(row_of), sum);
            }
            let weights = joined([0, 1, 2, 3].map(|i| tap(across, i)));
            let terms = _mm512_mul_ps(sum, _mm512_permutexvar_ps(turn, weights));
            let pairs = _mm512_add_ps(terms, _mm512_permute_ps::<0b10_11_00_01>(terms));
            let sum = _mm512_add_ps(pairs, _mm512_permute_ps::<0b01_00_11_10>(pairs));
            let sum = _mm512_permutexvar_ps(firsts, _mm512_add_ps(sum, _mm512_setzero_ps()));
            wild = _mm512_fmadd_ps(sum, _mm512_setzero_ps(), wild);
            _mm_storeu_ps(values.as_mut_ptr().add(start), _mm512_castps512_ps128(sum));
        }
    }
    some_nan(wild)
}

/// Whether some lane is NaN.
#[inline]
#[target_feature(enable = "avx512f")]
fn some_nan(lanes: __m512) -> bool {
    _mm512_cmp_ps_mask::<_CMP_UNORD_Q>(lanes, lanes) != 0
}

/// Four vectors side by side.
#[inline]
#[target_feature(enable = "avx512f")]
fn joined([a, b, c, d]: [__m128; FOUR]) -> __m512 {
    let low = _mm512_insertf32x4::<1>(_mm512_castps128_ps512(a), b);
    _mm512_insertf32x4::<3>(_mm512_insertf32x4::<2>(low, c), d)
}

/// # Safety
/// From `FOUR` times each of `first` on, `FOUR` rows of `LINE` samples, `stride` apart, lie in `samples`. There is a multiple
/// of `FOUR` of `first`, `BLOCK_WIDTH` at most, that many times `FOUR` of `values`, and `FOUR` of `across` and of `down`.
#[target_feature(enable = "avx512f")]
unsafe fn fours(
    samples: &[f32],
    stride: usize,
    first: &[u32],
    across: &[[f32; BLOCK_WIDTH]],
    down: &[[f32; BLOCK_WIDTH]],
    values: &mut [f32],
) -> bool {
    // NaN where a sum is not finite, else a zero.
    let mut wild = _mm512_setzero_ps();
    for start in (0..first.len()).step_by(FOUR) {
        // SAFETY: as the caller promised.
        unsafe {
            // Row by row the weights of a tap for four pixels.
            let weights = joined([0, 1, 2, 3].map(|tap| _mm_loadu_ps(across[tap].as_ptr().add(start))));
            let column = |i: usize| {
                let at = samples.as_ptr().add(first[start + i] as usize * FOUR);
                let mut sum = _mm512_setzero_ps();
                for row in 0..FOUR {
                    let samples = _mm512_loadu_ps(at.add(row * stride));
                    sum = _mm512_fmadd_ps(_mm512_set1_ps(down[row][start + i]), samples, sum);
                }
                sum
            };
            let a = _mm512_mul_ps(column(0), _mm512_permute_ps::<0x00>(weights));
            let b = _mm512_mul_ps(column(1), _mm512_permute_ps::<0x55>(weights));
            let c = _mm512_mul_ps(column(2), _mm512_permute_ps::<0xaa>(weights));
            let d = _mm512_mul_ps(column(3), _mm512_permute_ps::<0xff>(weights));
            let sum = _mm512_add_ps(pairs(pairs(a, b), pairs(c, d)), _mm512_setzero_ps());
            wild = _mm512_fmadd_ps(sum, _mm512_setzero_ps(), wild);
            _mm512_storeu_ps(values.as_mut_ptr().add(start * FOUR), sum);
        }
    }
    some_nan(wild)
}

/// Of two vectors of four columns each, the sums of columns 0 and 1, 2 and 3.
#[inline]
#[target_feature(enable = "avx512f")]
fn pairs(a: __m512, b: __m512) -> __m512 {
    _mm512_add_ps(_mm512_shuffle_f32x4::<0x88>(a, b), _mm512_shuffle_f32x4::<0xdd>(a, b))
}

/// Writes the pixels of rows of planes with their channels side by side, from the last to the first if `FALLING`. Whether
/// it did.
#[inline(always)]
pub(super) fn interleave<const C: usize, const FALLING: bool>(rows: [&[f32]; C], pixels: &mut [[f32; C]]) -> bool {
    let count = pixels.len();
    match <&[&[f32]; FOUR]>::try_from(&rows[..]) {
        Ok(rows) if count >= LINE && available() => {
            // The last whole vector overlaps those before it.
            for part in [0..count / LINE * LINE, count - LINE..count] {
                let from = if FALLING { count - part.end..count - part.start } else { part.clone() };
                let rows = rows.map(|row| &row[from.clone()]);
                // SAFETY: the processor has AVX-512; there are as many pixels.
                unsafe { interleave_lines::<FALLING>(rows, pixels[part].as_flattened_mut()) }
            }
            true
        }
        _ => false,
    }
}

/// # Safety
/// The rows have one length, a multiple of `LINE`; there are `FOUR` times as many of `pixels`, at least.
#[target_feature(enable = "avx512f")]
unsafe fn interleave_lines<const FALLING: bool>(rows: [&[f32]; FOUR], pixels: &mut [f32]) {
    let last_first = _mm512_setr_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    let count = rows[0].len();
    for start in (0..count).step_by(LINE) {
        // SAFETY: as the caller promised.
        unsafe {
            let [a, b, c, d] = if FALLING {
                rows.map(|row| {
                    _mm512_permutexvar_ps(last_first, _mm512_loadu_ps(row.as_ptr().add(count - LINE - start)))
                })
            } else {
                rows.map(|row| _mm512_loadu_ps(row.as_ptr().add(start)))
            };
            // Pixels 0, 4, 8, 12 in p, the next ones in q, r, s.
            let [p, q, r, s] = turned(a, b, c, d);
            let (pq, rs) = (_mm512_shuffle_f32x4::<0x44>(p, q), _mm512_shuffle_f32x4::<0x44>(r, s));
            let (qp, sr) = (_mm512_shuffle_f32x4::<0xee>(p, q), _mm512_shuffle_f32x4::<0xee>(r, s));
            let fours = [
                _mm512_shuffle_f32x4::<0x88>(pq, rs),
                _mm512_shuffle_f32x4::<0xdd>(pq, rs),
                _mm512_shuffle_f32x4::<0x88>(qp, sr),
                _mm512_shuffle_f32x4::<0xdd>(qp, sr),
            ];
            for (i, four) in fours.into_iter().enumerate() {
                _mm512_storeu_ps(pixels.as_mut_ptr().add(start * FOUR + i * LINE), four);
            }
        }
    }
}

/// In each group of four lanes, the groups of four vectors as rows made columns.
#[inline]
#[target_feature(enable = "avx512f")]
fn turned(a: __m512, b: __m512, c: __m512, d: __m512) -> [__m512; FOUR] {
    let (low, next_low) = (_mm512_unpacklo_ps(a, b), _mm512_unpacklo_ps(c, d));
    let (high, next_high) = (_mm512_unpackhi_ps(a, b), _mm512_unpackhi_ps(c, d));
    [
        _mm512_shuffle_ps::<0x44>(low, next_low),
        _mm512_shuffle_ps::<0xee>(low, next_low),
        _mm512_shuffle_ps::<0x44>(high, next_high),
        _mm512_shuffle_ps::<0xee>(high, next_high),
    ]
}

/// Writes the values' channels to rows of planes past the cache; false if they are not four rows of whole cache lines.
#[inline(always)]
pub(super) fn store<const C: usize>(values: &[[f32; C]], rows: &mut [&mut [f32]]) -> bool {
    let whole = |row: &&mut [f32]| {
        row.as_ptr().addr().is_multiple_of(64) && row.len().is_multiple_of(LINE) && row.len() <= values.len()
    };
    let Ok([a, b, c, d]) = <&mut [&mut [f32]; FOUR]>::try_from(rows) else { return false };
    let alike = [&*b, &*c, &*d].iter().all(|row| row.len() == a.len());
    if C != FOUR || !alike || ![&*a, &*b, &*c, &*d].into_iter().all(whole) || !available() {
        return false;
    }
    // SAFETY: the processor has AVX-512; the rows are alike, whole lines and no longer than the values.
    unsafe { stream(values.as_flattened(), [a, b, c, d]) }
    true
}

/// # Safety
/// The rows have one length, a multiple of `LINE`, and start at a cache line; there are `FOUR` times as many values.
#[target_feature(enable = "avx512f")]
unsafe fn stream(values: &[f32], mut rows: [&mut [f32]; FOUR]) {
    for start in (0..rows[0].len()).step_by(LINE) {
        // SAFETY: as the caller promised.
        unsafe {
            let load = |i: usize| _mm512_loadu_ps(values.as_ptr().add((start + FOUR * i) * FOUR));
            let planes = transposed([load(0), load(1), load(2), load(3)]);
            for (row, plane) in rows.iter_mut().zip(planes) {
                _mm512_stream_ps(row.as_mut_ptr().add(start), plane);
            }
        }
    }
}

/// The four channels of 16 pixels, from four pixels in each vector.
#[inline]
#[target_feature(enable = "avx512f")]
fn transposed([a, b, c, d]: [__m512; FOUR]) -> [__m512; FOUR] {
    let (ab, cd) = (_mm512_shuffle_f32x4::<0x44>(a, b), _mm512_shuffle_f32x4::<0x44>(c, d));
    let (ef, gh) = (_mm512_shuffle_f32x4::<0xee>(a, b), _mm512_shuffle_f32x4::<0xee>(c, d));
    // Pixels 0, 4, 8, 12 in p, the next ones in q, r, s.
    let (p, q) = (_mm512_shuffle_f32x4::<0x88>(ab, cd), _mm512_shuffle_f32x4::<0xdd>(ab, cd));
    let (r, s) = (_mm512_shuffle_f32x4::<0x88>(ef, gh), _mm512_shuffle_f32x4::<0xdd>(ef, gh));
    turned(p, q, r, s)
}

/// Waits until all stores of [`store`] can be seen.
pub(super) fn finish_stores() {
    // SAFETY: every processor of this architecture has it.
    unsafe { _mm_sfence() }
}
