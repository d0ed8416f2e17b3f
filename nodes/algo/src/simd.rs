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
