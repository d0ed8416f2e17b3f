//! Whole numbers as integers, without the checks of a cast: a number out of range gives any integer.

/// The last place of a number near this is 1: added and taken away it rounds.
pub(super) const ROUNDER: f64 = 1.5 * (1_u64 << 52) as f64;

/// A whole number in 0..2^32 as an index.
#[inline(always)]
pub(super) fn index(whole: f64) -> usize {
    integer(whole) as u32 as usize
}

/// A whole number that an i32 holds, or its last 32 bits.
#[inline(always)]
pub(super) fn integer(whole: f64) -> i32 {
    (whole + ROUNDER).to_bits() as u32 as i32
}

/// The whole part of a number between -2^22 and 2^22, rounded down.
#[inline(always)]
pub(super) fn floored(at: f32) -> i32 {
    const ROUNDER: f32 = 1.5 * (1 << 23) as f32;
    (at.floor() + ROUNDER).to_bits().wrapping_sub(ROUNDER.to_bits()) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_are_those_of_casts() {
        for whole in [0.0, 1.0, 255.0, 2147483647.0, 4294967295.0] {
            assert_eq!(index(whole), whole as usize);
        }
        for whole in [-2147483648.0, -1.0, -0.0, 0.0, 7.0, 2147483647.0] {
            assert_eq!(integer(whole), whole as i32);
        }
        for at in [-4194303.5, -1.5, -0.0, 0.0, 0.99, 1.0, 7.999, 4194303.5_f32] {
            assert_eq!(floored(at), at.floor() as i32);
        }
    }
}
