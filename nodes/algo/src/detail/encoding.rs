//! What is compared of samples.

use rayon::prelude::*;

use crate::transfer::{Encoding, linear_to_srgb, srgb_to_linear};
use crate::view::View;
use crate::{Interrupted, Watch};

/// Samples beyond this are taken for it, so that sums of squares stay finite.
const FARTHEST: f32 = 1e9;

/// Bits of the fraction that choose a place in a table.
const PLACES: u32 = 11;

/// A power of positive numbers: of the fraction linear between the places of a table, times that of the exponent.
pub(super) struct Power {
    fractions: Vec<f64>,
    exponents: Vec<f64>,
}

impl Power {
    fn new(power: f64) -> Self {
        let fraction = |place: u32| libm::pow(1.0 + f64::from(place) / f64::from(1 << PLACES), power);
        let exponent = |biased: i32| libm::exp2(f64::from(biased - 127) * power);
        Self { fractions: (0..=1 << PLACES).map(fraction).collect(), exponents: (0..256).map(exponent).collect() }
    }

    /// The power of a finite number of at least 2^-126.
    fn of(&self, x: f32) -> f64 {
        const REST: u32 = 23 - PLACES;
        let bits = x.to_bits();
        let place = (bits >> REST) as usize & ((1 << PLACES) - 1);
        let between = f64::from(bits & ((1 << REST) - 1)) / f64::from(1 << REST);
        let [low, high] = [self.fractions[place], self.fractions[place + 1]];
        self.exponents[(bits >> 23) as usize & 255] * (low + between * (high - low))
    }
}

/// An encoding with its tables; within 5e-7, relative, of what [`crate::transfer`] says.
pub(super) enum Coder {
    Srgb { root: Power, power: Power },
    Linear,
}

impl Coder {
    pub fn new(encoding: Encoding) -> Self {
        match encoding {
            Encoding::Srgb => Self::Srgb { root: Power::new(1.0 / 2.4), power: Power::new(2.4) },
            Encoding::Linear => Self::Linear,
        }
    }

    /// What is compared of a linear sample; what is not finite counts as 0.
    pub fn encoded(&self, linear: f32) -> f32 {
        let value = match self {
            Self::Srgb { root, .. } if linear.is_finite() && linear.abs() > 0.003_130_8 => {
                ((1.055 * root.of(linear.abs()) - 0.055) as f32).copysign(linear)
            }
            Self::Srgb { .. } => linear_to_srgb(linear),
            Self::Linear => linear,
        };
        if value.is_finite() { value.clamp(-FARTHEST, FARTHEST) } else { 0.0 }
    }

    /// The linear sample of a finite encoded one.
    pub fn linear(&self, encoded: f32) -> f32 {
        match self {
            Self::Srgb { power, .. } if encoded.abs() > 0.040_45 => {
                (power.of(((f64::from(encoded.abs()) + 0.055) / 1.055) as f32) as f32).copysign(encoded)
            }
            Self::Srgb { .. } => srgb_to_linear(encoded),
            Self::Linear => encoded,
        }
    }

    /// The encoded samples of planes, row by row without gaps.
    pub fn planes(&self, planes: &[View<f32>; 3], watch: Watch) -> Result<[Vec<f32>; 3], Interrupted> {
        let plane = |plane: &View<f32>| {
            let mut out = vec![0.0; plane.width() * plane.height()];
            let rows = out.par_chunks_mut(plane.width().max(1)).enumerate();
            rows.try_for_each(|(y, out)| {
                out.iter_mut().zip(plane.row(y)).for_each(|(out, &sample)| *out = self.encoded(sample));
                watch.go_on()
            })?;
            Ok(out)
        };
        let [r, g, b] = planes;
        Ok([plane(r)?, plane(g)?, plane(b)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_agree_with_the_standard_and_with_each_other() {
        let coder = Coder::new(Encoding::Srgb);
        let samples = (0..40_000).map(|i| libm::powf(1.001, i as f32 - 12_000.0)).filter(|x| x.is_finite());
        for x in samples.chain([0.0, 1.0, 0.003_130_8, 0.040_45, 0.5]).flat_map(|x| [x, -x]) {
            let near = |a: f32, b: f32| (a - b).abs() <= 5e-7 * b.abs();
            assert!(near(coder.encoded(x), linear_to_srgb(x).clamp(-FARTHEST, FARTHEST)), "encoded {x}");
            if x.abs() < 1e9 {
                assert!(near(coder.linear(x), srgb_to_linear(x)), "linear {x}");
            }
        }
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(coder.encoded(bad), 0.0);
        }
    }
}
