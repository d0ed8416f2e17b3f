//! Half samples as floats and back, bit for bit.
//!
//! Processors make every NaN a quiet one when they convert it. Here its sign and payload stay, so that each of the
//! 65,536 halfs comes back as it was.

use half::f16;
use half::slice::HalfFloatSliceExt;

const HALF_INFINITY: u16 = 0x7c00;
const FLOAT_INFINITY: u32 = 0x7f80_0000;

/// Bits of a float's fraction that a half has no room for.
const LOST: u32 = 13;

/// Widens halfs; both slices are of one length.
pub fn widen(halves: &[f16], floats: &mut [f32]) {
    halves.convert_to_f32_slice(floats);
    for (float, half) in floats.iter_mut().zip(halves) {
        let (bits, sign) = (u32::from(half.to_bits()), u32::from(half.to_bits() & 0x8000) << 16);
        let is_nan = half.to_bits() & 0x7fff > HALF_INFINITY;
        *float = if is_nan { f32::from_bits(sign | FLOAT_INFINITY | (bits & 0x3ff) << LOST) } else { *float };
    }
}

/// Rounds floats to halfs, ties to even; both slices are of one length. A NaN whose payload does not fit stays a NaN.
pub fn narrow(floats: &[f32], halves: &mut [f16]) {
    halves.convert_from_f32_slice(floats);
    for (half, float) in halves.iter_mut().zip(floats) {
        let bits = float.to_bits();
        let payload = (bits >> LOST) as u16 & 0x3ff;
        let nan = (bits >> 16) as u16 & 0x8000 | HALF_INFINITY | if payload == 0 { 0x200 } else { payload };
        *half = if bits & 0x7fff_ffff > FLOAT_INFINITY { f16::from_bits(nan) } else { *half };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_half_comes_back_bit_for_bit() {
        let halves: Vec<f16> = (0..=u16::MAX).map(f16::from_bits).collect();
        let (mut floats, mut back) = (vec![0.0; halves.len()], vec![f16::ZERO; halves.len()]);
        widen(&halves, &mut floats);
        for (half, float) in halves.iter().zip(&floats).filter(|(half, _)| !half.is_nan()) {
            assert_eq!(half.to_f64(), f64::from(*float));
        }
        narrow(&floats, &mut back);
        let bits = |halves: &[f16]| halves.iter().map(|half| half.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&back), bits(&halves));
    }

    #[test]
    fn a_nan_whose_payload_does_not_fit_stays_a_nan() {
        let floats = [0x7f80_0001, 0xff80_1fff, 0x7fc0_0000, 0x7f80_0000, 0xff80_0000].map(f32::from_bits);
        let mut halves = [f16::ZERO; 5];
        narrow(&floats, &mut halves);
        assert_eq!(halves.map(f16::to_bits), [0x7e00, 0xfe00, 0x7e00, 0x7c00, 0xfc00]);
    }
}
