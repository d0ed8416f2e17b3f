//! Between stored codes and working samples: transfer functions, integer codes, premultiplication.
//!
//! The sRGB transfer function is that of IEC 61966-2-1, computed in f64:
//! `linear(v) = v / 12.92` for `v <= 0.04045`, else `((v + 0.055) / 1.055)^2.4`.
//! Outside 0..=1 it is continued: above by the same power, below as an odd function, so that scene-linear values
//! beyond white and the small negatives that filters leave survive a round trip.

/// What of scene-linear samples is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// Their sRGB encoding, near to how differences are seen.
    Srgb,
    /// Themselves.
    Linear,
}

/// Linear value of an sRGB-encoded one.
///
/// `value`: any; 0..=1 is the standard's range. Odd: `f(-v) = -f(v)`; NaN stays NaN, infinities stay.
/// One power function of f64. IEC 61966-2-1, 5.2.
pub fn srgb_to_linear(value: f32) -> f32 {
    let v = f64::from(value).abs();
    (srgb_to_linear_f64(v) as f32).copysign(value)
}

/// sRGB-encoded value of a linear one: the inverse of [`srgb_to_linear`].
///
/// `value`: any; 0..=1 is the standard's range. Odd; NaN stays NaN, infinities stay.
/// One power function of f64. IEC 61966-2-1, 5.2.
pub fn linear_to_srgb(value: f32) -> f32 {
    let v = f64::from(value).abs();
    let encoded = if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * libm::pow(v, 1.0 / 2.4) - 0.055 };
    (encoded as f32).copysign(value)
}

/// Linear value of an sRGB-encoded one, in f64.
///
/// `v`: not negative; 0..=1 is the standard's range, above it the power goes on. NaN stays NaN. One power function.
/// IEC 61966-2-1, 5.2.
pub fn srgb_to_linear_f64(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
}

/// The linear value of every integer code: element `c` is that of `c / max`.
///
/// `max`: the code of white, 255 or 65535. Gives `max + 1` values, rising from 0 to 1.
/// One power function per code.
pub fn srgb_table(max: u16) -> Vec<f32> {
    (0..=max).map(|code| srgb_to_linear_f64(f64::from(code) / f64::from(max)) as f32).collect()
}

/// The value of every integer code without a transfer function: element `c` is `c / max`.
///
/// `max`: the code of white, 255 or 65535. Gives `max + 1` values, rising from 0 to 1.
pub fn code_table(max: u16) -> Vec<f32> {
    (0..=max).map(|code| (f64::from(code) / f64::from(max)) as f32).collect()
}

/// The linear values between codes: element `c` is that of `(c + 1/2) / max`, where rounding to nearest in the
/// encoded domain goes from code `c` to `c + 1`.
///
/// `max`: the code of white, 255 or 65535. Gives `max` values, rising, for [`srgb_code`]. Every code comes back:
/// `srgb_code(&srgb_thresholds(max), srgb_table(max)[c]) == c`. One power function per code.
pub fn srgb_thresholds(max: u16) -> Vec<f32> {
    (0..max).map(|code| srgb_to_linear_f64((f64::from(code) + 0.5) / f64::from(max)) as f32).collect()
}

/// The integer code nearest to a linear value in the encoded domain.
///
/// `thresholds`: of [`srgb_thresholds`]; `value`: linear, any. Below 0 and NaN give 0, above 1 gives `max`.
/// A binary search.
pub fn srgb_code(thresholds: &[f32], value: f32) -> u16 {
    thresholds.partition_point(|&threshold| threshold <= value) as u16
}

/// The integer code nearest to `value * max`.
///
/// `value`: any, 0..=1 being the range of codes; `max`: the code of white. Halves round up; below 0 and NaN give 0,
/// above 1 gives `max`.
pub fn code(value: f32, max: u16) -> u16 {
    // The cast saturates, and takes NaN to 0.
    ((f64::from(value) * f64::from(max) + 0.5).floor() as u16).min(max)
}

/// Multiplies straight colour by alpha.
///
/// `colour`: straight samples of one row, changed in place; `alpha`: as many, coverage 0..=1. Where alpha is 0 the
/// result is 0: premultiplied samples have no place for the colour of what cannot be seen, and it does not come
/// back.
pub fn premultiply(colour: &mut [f32], alpha: &[f32]) {
    assert_eq!(colour.len(), alpha.len(), "one alpha per sample");
    colour.iter_mut().zip(alpha).for_each(|(c, a)| *c *= a);
}

/// Divides premultiplied colour by alpha.
///
/// `colour`: premultiplied samples of one row, changed in place; `alpha`: as many. Where alpha is 0 the colour stays
/// as it is: it is light without coverage (fire, glows), which straight colour cannot say otherwise.
pub fn unpremultiply(colour: &mut [f32], alpha: &[f32]) {
    map_straight(colour, alpha, |c| c, false);
}

/// Multiplies straight colour by alpha where it was changed; elsewhere premultiplied samples come back bit for bit.
///
/// `colour`: straight samples of one row, changed in place; `before`: as many, what they were before they were changed;
/// `premultiplied`: as many, what that was made of by [`unpremultiply`]; `alpha`: as many.
pub fn premultiply_changed(colour: &mut [f32], before: &[f32], premultiplied: &[f32], alpha: &[f32]) {
    assert!([before, premultiplied, alpha].iter().all(|row| row.len() == colour.len()), "rows of one length");
    for (((c, before), as_it_was), a) in colour.iter_mut().zip(before).zip(premultiplied).zip(alpha) {
        *c = if c.to_bits() == before.to_bits() { *as_it_was } else { *c * a };
    }
}

/// Applies `f` to the straight colour of premultiplied samples.
///
/// `colour`: premultiplied samples of one row, changed in place to `f(c / a) * a`; `alpha`: as many. Where alpha is
/// 0, light without coverage, to `f(c)`.
pub fn map_premultiplied(colour: &mut [f32], alpha: &[f32], f: impl Fn(f32) -> f32) {
    map_straight(colour, alpha, f, true);
}

fn map_straight(colour: &mut [f32], alpha: &[f32], f: impl Fn(f32) -> f32, back: bool) {
    assert_eq!(colour.len(), alpha.len(), "one alpha per sample");
    for (c, &a) in colour.iter_mut().zip(alpha) {
        *c = match a == 0.0 {
            true => f(*c),
            false => f(*c / a) * if back { a } else { 1.0 },
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_standards_values() {
        for (encoded, expected) in [(0.0, 0.0), (0.04045, 0.0031308), (0.5, 0.214_041_14), (1.0, 1.0)] {
            assert!((srgb_to_linear(encoded) - expected).abs() < 1e-7, "{encoded}");
        }
        // Middle grey of an 8-bit file, as every table of sRGB gives it.
        assert!((srgb_table(255)[128] - 0.215_860_5).abs() < 1e-6);
    }

    #[test]
    fn what_was_not_changed_comes_back_bit_for_bit() {
        let (premultiplied, alpha) = ([0.1, 0.3, 0.7, f32::NAN, 0.2], [0.3, 0.7, 0.0, 0.5, 0.9]);
        let mut straight = premultiplied;
        unpremultiply(&mut straight, &alpha);
        let mut colour = straight;
        colour[4] = 0.5;
        premultiply_changed(&mut colour, &straight, &premultiplied, &alpha);
        assert_eq!(
            colour[..4].iter().map(|c| c.to_bits()).collect::<Vec<_>>(),
            premultiplied[..4].iter().map(|c| c.to_bits()).collect::<Vec<_>>()
        );
        assert_eq!(colour[4], 0.45);
    }

    #[test]
    fn every_code_comes_back() {
        for max in [255, 65535] {
            let (table, thresholds, linear) = (srgb_table(max), srgb_thresholds(max), code_table(max));
            assert_eq!((table[0], table[usize::from(max)]), (0.0, 1.0));
            assert!(table.windows(2).all(|pair| pair[0] < pair[1]));
            for c in 0..=max {
                assert_eq!(srgb_code(&thresholds, table[usize::from(c)]), c);
                assert_eq!(code(linear[usize::from(c)], max), c);
                assert_eq!(code(linear_to_srgb(table[usize::from(c)]), max), c, "by the function itself");
            }
        }
    }

    #[test]
    fn codes_round_to_nearest_and_clamp() {
        let thresholds = srgb_thresholds(255);
        for (value, expected) in [(-1.0, 0), (f32::NAN, 0), (2.0, 255), (f32::INFINITY, 255), (f32::NEG_INFINITY, 0)] {
            assert_eq!(srgb_code(&thresholds, value), expected);
            assert_eq!(code(value, 255), expected);
        }
        for c in 1..=255u16 {
            let between = f64::from(c) - 0.5;
            let (below, above) = (((between - 1e-3) / 255.0) as f32, ((between + 1e-3) / 255.0) as f32);
            assert_eq!((code(below, 255), code(above, 255)), (c - 1, c));
            assert_eq!(srgb_code(&thresholds, srgb_to_linear(below)), c - 1);
            assert_eq!(srgb_code(&thresholds, srgb_to_linear(above)), c);
        }
    }

    #[test]
    fn floats_come_back_outside_the_range_too() {
        for value in [-7.5, -0.4, -0.001, 0.0, 1e-6, 0.0031308, 0.5, 1.0, 40.0, 3e4] {
            let back = srgb_to_linear(linear_to_srgb(value));
            assert!((back - value).abs() <= 1e-6 * value.abs(), "{value} -> {back}");
            assert_eq!(linear_to_srgb(-value), -linear_to_srgb(value));
        }
        assert!(srgb_to_linear(f32::NAN).is_nan() && linear_to_srgb(f32::NAN).is_nan());
        assert_eq!(linear_to_srgb(f32::INFINITY), f32::INFINITY);
    }

    #[test]
    fn light_without_coverage_is_kept() {
        let (mut colour, alpha) = ([0.2, 0.2, 0.2], [0.5, 0.0, 1.0]);
        unpremultiply(&mut colour, &alpha);
        assert_eq!(colour, [0.4, 0.2, 0.2]);
        premultiply(&mut colour, &alpha);
        assert_eq!(colour, [0.2, 0.0, 0.2]);
        let mut colour = [0.2, 0.2, 0.2];
        map_premultiplied(&mut colour, &alpha, |c| c * c);
        assert_eq!(colour, [0.4 * 0.4 * 0.5, 0.2 * 0.2, 0.2 * 0.2]);
    }
}
