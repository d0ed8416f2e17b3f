//! Masks from the values of a picture.

use crate::view::{View, ViewMut};

/// The mask of the samples between two bounds: 1 where sample > `above` and sample < `below`, else 0.
///
/// Both comparisons are strict and made in f64; a bound that is not given does not count.
///
/// `samples`, `out`: planes of one size; `above`, `below`: in units of the samples.
///
/// A NaN sample gives 0, whatever the bounds; so does every sample under a NaN bound.
///
/// Cost: O(area).
pub fn threshold(samples: View<f32>, above: Option<f64>, below: Option<f64>, out: ViewMut<f32>) {
    assert_eq!([samples.width(), samples.height()], [out.width(), out.height()], "sizes differ");
    let keeps = |sample: f64| {
        !sample.is_nan() && above.is_none_or(|bound| sample > bound) && below.is_none_or(|bound| sample < bound)
    };
    out.par_rows(|y, row| {
        for (mask, &sample) in row.iter_mut().zip(samples.row(y)) {
            *mask = if keeps(f64::from(sample)) { 1.0 } else { 0.0 };
        }
    });
}

/// Luma of a picture: 0.2126 r + 0.7152 g + 0.0722 b, summed in f64, so that grey keeps its value exactly.
///
/// `r`, `g`, `b`, `out`: planes of one size, linear light with Rec. 709 primaries.
///
/// NaN in any channel gives NaN.
///
/// Cost: O(area).
///
/// ITU-R BT.709-6, item 3.2.
pub fn luma(r: View<f32>, g: View<f32>, b: View<f32>, out: ViewMut<f32>) {
    for channel in [r, g, b] {
        assert_eq!([channel.width(), channel.height()], [out.width(), out.height()], "sizes differ");
    }
    out.par_rows(|y, row| {
        for (((luma, &r), &g), &b) in row.iter_mut().zip(r.row(y)).zip(g.row(y)).zip(b.row(y)) {
            *luma = (0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)) as f32;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn masked(samples: &[f32], above: Option<f64>, below: Option<f64>) -> Vec<f32> {
        let mut out = vec![f32::NAN; samples.len()];
        let width = samples.len();
        threshold(View::packed(samples, width, 1), above, below, ViewMut::packed(&mut out, width, 1));
        out
    }

    #[test]
    fn bounds_are_strict_and_optional() {
        let samples = [-1.0, 0.25, 0.5, 0.75, f32::NAN, f32::INFINITY];
        assert_eq!(masked(&samples, Some(0.25), Some(0.75)), [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
        assert_eq!(masked(&samples, Some(0.25), None), [0.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
        assert_eq!(masked(&samples, None, Some(0.75)), [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
        assert_eq!(masked(&samples, None, None), [1.0, 1.0, 1.0, 1.0, 0.0, 1.0]);
    }

    #[test]
    fn bounds_are_compared_in_f64() {
        // 0.1 rounds up to f32, so the sample lies above the f64 bound.
        assert_eq!(masked(&[0.1], Some(0.1), None), [1.0]);
    }

    #[test]
    fn nan_bounds_keep_nothing() {
        assert_eq!(masked(&[0.0, 1.0], Some(f64::NAN), None), [0.0, 0.0]);
    }

    fn luma_of(r: &[f32], g: &[f32], b: &[f32]) -> Vec<f32> {
        let mut out = vec![f32::NAN; r.len()];
        let plane = |samples| View::packed(samples, r.len(), 1);
        luma(plane(r), plane(g), plane(b), ViewMut::packed(&mut out, r.len(), 1));
        out
    }

    #[test]
    fn luma_weighs_the_primaries() {
        let out = luma_of(&[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0]);
        assert_eq!(out, [0.2126, 0.7152, 0.0722]);
    }

    #[test]
    fn grey_keeps_its_value_exactly() {
        let grey: Vec<f32> = (0..1000).map(|i| i as f32 * 0.0137 - 2.0).collect();
        assert_eq!(luma_of(&grey, &grey, &grey), grey);
    }
}
