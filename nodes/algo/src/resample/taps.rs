//! What the pixels of a tile's row take from the source.
//!
//! Positions are rounded to 2^-24 px, the resolution of the weights: far above the locator's rounding errors, so
//! that a whole-pixel position is one, and exact for the fraction t and for 1 - t.

use super::filter::{FRACTION_BITS, RESOLUTION};
use super::locate::TILE_WIDTH;
use super::sample::Source;

const ONE: u64 = 1 << FRACTION_BITS;
/// Positions farther out than this, px, count as lying here.
const FARTHEST: f64 = (1_u64 << 27) as f64;
/// The last place of a number near this is 2^-24, and its own last 24 bits are zero.
const ROUNDER: f64 = 1.5 * (1_u64 << (52 - FRACTION_BITS)) as f64;

/// Rounds a position to 2^-24 px and splits it into whole pixels, rounded down, and the rest in 0..1.
#[inline(always)]
pub(super) fn split(position: f64) -> (i32, f32) {
    let near = if position > -FARTHEST { position } else { -FARTHEST };
    let near = if near < FARTHEST { near } else { FARTHEST };
    let bits = (near + ROUNDER).to_bits();
    let whole = (bits >> FRACTION_BITS) as u32;
    let rest = (bits & (ONE - 1)) as u32 as i32 as f32 * RESOLUTION as f32;
    (whole.wrapping_sub((ROUNDER.to_bits() >> FRACTION_BITS) as u32) as i32, rest)
}

/// The taps of one row of a tile.
pub(super) struct Taps {
    /// First source pixel along each axis, counted from the window's corner.
    pub first: [[i32; TILE_WIDTH]; 2],
    /// Fraction of a pixel along each axis.
    pub rest: [[f32; TILE_WIDTH]; 2],
    /// Whether all lanes lie inside the source window and no rule but the weighted sum applies.
    pub plain: [bool; TILE_WIDTH],
}

impl Taps {
    pub const EMPTY: Self =
        Self { first: [[0; TILE_WIDTH]; 2], rest: [[0.0; TILE_WIDTH]; 2], plain: [false; TILE_WIDTH] };

    /// `taps` and `lanes`: a filter's, as in [`Kernel`](super::filter::Kernel); `between`: whole positions along one
    /// axis are not plain either, not only those along both.
    #[inline(always)]
    pub fn fill(&mut self, source: &Source, positions: [&[f64]; 2], [taps, lanes]: [usize; 2], between: bool) {
        let corner = source.corner();
        for axis in 0..2 {
            let places = self.first[axis].iter_mut().zip(&mut self.rest[axis]);
            for ((first, rest), &position) in places.zip(positions[axis]) {
                let (whole, fraction) = split(position - corner[axis] - 0.5);
                (*first, *rest) = (whole - (taps as i32 / 2 - 1), fraction);
            }
        }
        let size = [source.window.width(), source.window.height()];
        let limits = [(size[0] + 1).saturating_sub(lanes) as u32, (size[1] + 1).saturating_sub(taps) as u32];
        for i in 0..positions[0].len() {
            let inside = ((self.first[0][i] as u32) < limits[0]) & ((self.first[1][i] as u32) < limits[1]);
            let whole = [self.rest[0][i] == 0.0, self.rest[1][i] == 0.0];
            let special = if between { whole[0] | whole[1] } else { whole[0] & whole[1] };
            self.plain[i] = inside & !special;
        }
    }
}
