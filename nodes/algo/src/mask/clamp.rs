use crate::view::ViewMut;

/// Holds samples to 0..=1, what coverage can be; NaN becomes 0.
///
/// `samples`: a plane, changed in place.
///
/// Cost: linear in the samples, rows side by side.
pub fn clamp(samples: ViewMut<f32>) {
    samples.par_rows(|_, row| row.iter_mut().for_each(|sample| *sample = super::coverage(*sample)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_but_coverage_is_left() {
        let mut samples = [-0.25, 0.0, 0.5, 1.0, 1.25, f32::NAN, f32::INFINITY];
        clamp(ViewMut::packed(&mut samples, 7, 1));
        assert_eq!(samples, [0.0, 0.0, 0.5, 1.0, 1.0, 0.0, 1.0]);
    }
}
