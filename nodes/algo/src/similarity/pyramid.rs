//! Pictures of half the size.

use rayon::prelude::*;

use super::Boundary;
use crate::simd::vectorized;
use crate::view::View;
use crate::{Interrupted, Watch};

impl Boundary {
    /// The index of `count` (at least 1) that stands for index `at`.
    pub(super) fn inside(self, at: isize, count: usize) -> usize {
        let last = count as isize - 1;
        let inside = match self {
            Boundary::Clamp => at.clamp(0, last),
            Boundary::Wrap => at.rem_euclid(count as isize),
            Boundary::Mirror => {
                let at = at.rem_euclid((2 * last).max(1));
                at.min(2 * last - at)
            }
        };
        inside as usize
    }
}

/// Width and height of the next level.
pub(super) fn halved(size: [usize; 2]) -> [usize; 2] {
    size.map(|side| side.div_ceil(2))
}

/// The next level: [1 4 6 4 1] / 16 along both axes, rounded, of even columns and rows.
pub(super) fn down(plane: &View<u8>, boundary: Boundary, watch: Watch) -> Result<Vec<u8>, Interrupted> {
    let size @ [width, height] = [plane.width(), plane.height()];
    let [out_width, out_height] = halved(size);
    let mut out = vec![0; out_width * out_height];
    let row = |y: isize| plane.row(boundary.inside(y, height));
    let sums = || vec![0u16; 2 * out_width + 4];
    out.par_chunks_mut(out_width).enumerate().try_for_each_init(sums, |sums, (y, out)| {
        let rows = [-2, -1, 0, 1, 2].map(|dy| row(2 * y as isize + dy));
        vectorized(
            #[inline(always)]
            || {
                let [a, b, c, d, e] = rows;
                let rows = a.iter().zip(b).zip(c).zip(d).zip(e);
                for (sum, ((((a, b), c), d), e)) in sums[2..].iter_mut().zip(rows) {
                    let [a, b, c, d, e] = [a, b, c, d, e].map(|code| u16::from(*code));
                    *sum = a + 4 * (b + d) + 6 * c + e;
                }
            },
        );
        for at in (0..2).chain(width + 2..sums.len()) {
            sums[at] = sums[boundary.inside(at as isize - 2, width) + 2];
        }
        vectorized(
            #[inline(always)]
            || {
                let (sums, _) = sums.as_chunks::<2>();
                for (out, ((first, second), third)) in out.iter_mut().zip(sums.iter().zip(&sums[1..]).zip(&sums[2..])) {
                    let sum = first[0] + 4 * (first[1] + second[1]) + 6 * second[0] + third[0];
                    *out = ((sum + 128) >> 8) as u8;
                }
            },
        );
        watch.go_on()
    })?;
    Ok(out)
}
