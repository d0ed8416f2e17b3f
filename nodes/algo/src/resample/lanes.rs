//! Sixteen lanes that hold two groups of eight: two rows of samples, or twice as much of one. All processors compute the
//! same bits.

use pulp::{Simd, WithSimd};
#[cfg(target_arch = "x86_64")]
use pulp::{
    bytemuck::cast,
    f32x16,
    x86::{V3, V4},
};

/// Lanes of a group.
pub(super) const LANES: usize = 8;
/// Lanes of two groups.
pub(super) const TWICE: usize = 2 * LANES;

/// A processor's way to compute with sixteen lanes.
pub(super) trait Lanes: Copy {
    type Two: Copy;

    fn load(self, lanes: &[f32; TWICE]) -> Self::Two;
    fn store(self, two: Self::Two) -> [f32; TWICE];
    fn splat(self, value: f32) -> Self::Two;
    fn add(self, a: Self::Two, b: Self::Two) -> Self::Two;
    fn sub(self, a: Self::Two, b: Self::Two) -> Self::Two;
    fn mul(self, a: Self::Two, b: Self::Two) -> Self::Two;
    /// `a * b + c`, rounded once.
    fn mul_add(self, a: Self::Two, b: Self::Two, c: Self::Two) -> Self::Two;
    fn max(self, a: Self::Two, b: Self::Two) -> Self::Two;

    /// Four lanes four times each.
    fn spread<const QUARTER: usize>(self, two: Self::Two) -> Self::Two;

    /// Of four the sums of the quarters of each, side by side: first and third, second and fourth, both.
    fn quarters(self, fours: [Self::Two; 4]) -> Self::Two;

    /// In each quarter the sum of its lanes, in the same order.
    fn total(self, two: Self::Two) -> Self::Two;

    fn div(self, a: Self::Two, b: Self::Two) -> Self::Two;
}

/// Plain loops.
#[derive(Clone, Copy)]
pub(super) struct Plain;

impl Lanes for Plain {
    type Two = [f32; TWICE];

    #[inline(always)]
    fn load(self, lanes: &[f32; TWICE]) -> Self::Two {
        *lanes
    }

    #[inline(always)]
    fn store(self, two: Self::Two) -> [f32; TWICE] {
        two
    }

    #[inline(always)]
    fn splat(self, value: f32) -> Self::Two {
        [value; TWICE]
    }

    #[inline(always)]
    fn add(self, a: Self::Two, b: Self::Two) -> Self::Two {
        std::array::from_fn(|i| a[i] + b[i])
    }

    #[inline(always)]
    fn sub(self, a: Self::Two, b: Self::Two) -> Self::Two {
        std::array::from_fn(|i| a[i] - b[i])
    }

    #[inline(always)]
    fn mul(self, a: Self::Two, b: Self::Two) -> Self::Two {
        std::array::from_fn(|i| a[i] * b[i])
    }

    #[inline(always)]
    fn mul_add(self, a: Self::Two, b: Self::Two, c: Self::Two) -> Self::Two {
        // Closures given to arrays are not always compiled for the vectors at hand; here they would call a function.
        let mut sums = c;
        for i in 0..TWICE {
            sums[i] = a[i].mul_add(b[i], c[i]);
        }
        sums
    }

    #[inline(always)]
    fn max(self, a: Self::Two, b: Self::Two) -> Self::Two {
        std::array::from_fn(|i| if a[i] > b[i] { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn spread<const QUARTER: usize>(self, two: Self::Two) -> Self::Two {
        std::array::from_fn(|i| two[4 * QUARTER + i / 4])
    }

    #[inline(always)]
    fn quarters(self, fours: [Self::Two; 4]) -> Self::Two {
        std::array::from_fn(|i| {
            let (two, i) = (&fours[i / 4], i % 4);
            (two[i] + two[i + 8]) + (two[i + 4] + two[i + 12])
        })
    }

    #[inline(always)]
    fn total(self, two: Self::Two) -> Self::Two {
        std::array::from_fn(|i| {
            let first = i / 4 * 4;
            (two[first] + two[first + 2]) + (two[first + 1] + two[first + 3])
        })
    }

    #[inline(always)]
    fn div(self, a: Self::Two, b: Self::Two) -> Self::Two {
        std::array::from_fn(|i| a[i] / b[i])
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for V4 {
    type Two = f32x16;

    #[inline(always)]
    fn load(self, lanes: &[f32; TWICE]) -> Self::Two {
        cast(*lanes)
    }

    #[inline(always)]
    fn store(self, two: Self::Two) -> [f32; TWICE] {
        cast(two)
    }

    #[inline(always)]
    fn splat(self, value: f32) -> Self::Two {
        self.splat_f32s(value)
    }

    #[inline(always)]
    fn add(self, a: Self::Two, b: Self::Two) -> Self::Two {
        self.add_f32s(a, b)
    }

    #[inline(always)]
    fn sub(self, a: Self::Two, b: Self::Two) -> Self::Two {
        self.sub_f32s(a, b)
    }

    #[inline(always)]
    fn mul(self, a: Self::Two, b: Self::Two) -> Self::Two {
        self.mul_f32s(a, b)
    }

    #[inline(always)]
    fn mul_add(self, a: Self::Two, b: Self::Two, c: Self::Two) -> Self::Two {
        self.mul_add_f32s(a, b, c)
    }

    #[inline(always)]
    fn max(self, a: Self::Two, b: Self::Two) -> Self::Two {
        self.max_f32s(a, b)
    }

    #[inline(always)]
    fn spread<const QUARTER: usize>(self, two: Self::Two) -> Self::Two {
        let lanes: [i32; TWICE] = const { spread_lanes(4 * QUARTER as i32) };
        cast(self.avx512f._mm512_permutexvar_ps(cast(lanes), cast(two)))
    }

    #[inline(always)]
    fn quarters(self, [a, b, c, d]: [Self::Two; 4]) -> Self::Two {
        let halves = |a: Self::Two, b: Self::Two| {
            let first = self.avx512f._mm512_shuffle_f32x4::<0x44>(cast(a), cast(b));
            let last = self.avx512f._mm512_shuffle_f32x4::<0xee>(cast(a), cast(b));
            self.add_f32s(cast(first), cast(last))
        };
        let (ab, cd) = (halves(a, b), halves(c, d));
        let even = self.avx512f._mm512_shuffle_f32x4::<0x88>(cast(ab), cast(cd));
        let odd = self.avx512f._mm512_shuffle_f32x4::<0xdd>(cast(ab), cast(cd));
        self.add_f32s(cast(even), cast(odd))
    }

    #[inline(always)]
    fn total(self, two: Self::Two) -> Self::Two {
        let pairs = self.add_f32s(two, cast(self.avx512f._mm512_permute_ps::<0b01_00_11_10>(cast(two))));
        self.add_f32s(pairs, cast(self.avx512f._mm512_permute_ps::<0b10_11_00_01>(cast(pairs))))
    }

    #[inline(always)]
    fn div(self, a: Self::Two, b: Self::Two) -> Self::Two {
        self.div_f32s(a, b)
    }
}

/// Four lanes from `first` on, four times each.
#[cfg(target_arch = "x86_64")]
const fn spread_lanes(first: i32) -> [i32; TWICE] {
    let mut lanes = [first; TWICE];
    let mut i = 0;
    while i < TWICE {
        lanes[i] += i as i32 / 4;
        i += 1;
    }
    lanes
}

/// Something done with a processor's lanes; all that is inlined into it is compiled for them.
pub(super) trait Work {
    fn run<L: Lanes>(self, lanes: L);
}

struct With<L, W>(L, W);

impl<L: Lanes, W: Work> WithSimd for With<L, W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.1.run(self.0);
    }
}

/// Does it with the widest lanes there are.
pub(super) fn widest(work: impl Work) {
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(simd) = V4::try_new() {
            return Simd::vectorize(simd, With(simd, work));
        }
        if let Some(simd) = V3::try_new() {
            return Simd::vectorize(simd, With(Plain, work));
        }
    }
    work.run(Plain);
}
