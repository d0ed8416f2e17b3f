//! Sixteen lanes that hold two groups of eight: two rows of samples, or twice as much of one. All processors compute the
//! same bits.

#[cfg(target_arch = "x86_64")]
use pulp::{
    bytemuck::cast,
    f32x16,
    x86::{V3, V4},
};
use pulp::{Simd, WithSimd};

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
    fn max(self, a: Self::Two, b: Self::Two) -> Self::Two;

    /// Four lanes four times each.
    fn spread<const QUARTER: usize>(self, two: Self::Two) -> Self::Two;

    /// The sum of the four quarters: first and third, second and fourth, both.
    fn quarters(self, two: Self::Two) -> [f32; 4];
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
    fn max(self, a: Self::Two, b: Self::Two) -> Self::Two {
        std::array::from_fn(|i| if a[i] > b[i] { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn spread<const QUARTER: usize>(self, two: Self::Two) -> Self::Two {
        std::array::from_fn(|i| two[4 * QUARTER + i / 4])
    }

    #[inline(always)]
    fn quarters(self, two: Self::Two) -> [f32; 4] {
        std::array::from_fn(|i| (two[i] + two[i + 8]) + (two[i + 4] + two[i + 12]))
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
    fn max(self, a: Self::Two, b: Self::Two) -> Self::Two {
        self.max_f32s(a, b)
    }

    #[inline(always)]
    fn spread<const QUARTER: usize>(self, two: Self::Two) -> Self::Two {
        let lanes: [i32; TWICE] = const { spread_lanes(4 * QUARTER as i32) };
        cast(self.avx512f._mm512_permutexvar_ps(cast(lanes), cast(two)))
    }

    #[inline(always)]
    fn quarters(self, two: Self::Two) -> [f32; 4] {
        let halves = self.add(two, cast(self.avx512f._mm512_shuffle_f32x4::<0b01_00_11_10>(cast(two), cast(two))));
        let turned = self.avx512f._mm512_shuffle_f32x4::<0b10_11_00_01>(cast(halves), cast(halves));
        let sums: [[f32; 4]; 4] = cast(self.add(halves, cast(turned)));
        sums[0]
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
