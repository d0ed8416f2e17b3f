//! Plain loops compiled for the vectors of the machine at hand.

use pulp::{Arch, Simd, WithSimd};

struct Work<F>(F);

impl<F: FnMut()> WithSimd for Work<F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        (self.0)();
    }
}

/// Runs `work` once, with the widest vectors there are for what is inlined into it. It must be marked
/// `#[inline(always)]` and change something it captures: other closures are called through a shim that is not inlined.
pub(crate) fn vectorized(work: impl FnMut()) {
    Arch::new().dispatch(Work(work));
}

/// The most lanes of f64 that a processor has.
pub(crate) const F64_LANES: usize = 8;

/// The numbers from `first` on, 1 apart, as many as lanes.
#[inline(always)]
pub(crate) fn counted<S: Simd>(simd: S, first: f64) -> S::f64s {
    const COUNTED: [f64; F64_LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
    simd.add_f64s(simd.splat_f64s(first), S::as_simd_f64s(&COUNTED).0[0])
}

/// As many values as lanes, from number `first` on.
#[inline(always)]
pub(crate) fn lanes_of<S: Simd>(values: &mut [f64], first: usize) -> &mut S::f64s {
    &mut S::as_mut_simd_f64s(&mut values[first..first + S::F64_LANES]).0[0]
}
