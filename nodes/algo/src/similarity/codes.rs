//! Samples as the codes that are compared.

use rayon::prelude::*;

use crate::simd::vectorized;
use crate::transfer::{Encoding, code, srgb_thresholds};
use crate::view::View;
use crate::{Interrupted, Watch};

/// The codes 0..=255 of a plane of scene-linear samples.
///
/// That of a sample v is round(255 e(v / white)), e being the encoding.
///
/// - `plane`: scene-linear, any size.
/// - `encoding`: e.
/// - `white`: the sample that becomes 255, positive (asserted).
/// - `watch`: asked for the memory taken, and now and then whether to go on.
///
/// What is below 0 and NaN become 0, what is above `white` 255. Codes of 8 bits that were read as sRGB come back.
///
/// Cost: linear; a look into a table of 8 kB per sample.
pub fn codes(plane: View<f32>, encoding: Encoding, white: f32, watch: Watch) -> Result<Vec<u8>, Interrupted> {
    assert!(white > 0.0, "white is {white}");
    let (width, height) = (plane.width(), plane.height());
    watch.reserve(width * height)?;
    let mut codes = vec![0; width * height];
    if width == 0 {
        return Ok(codes);
    }
    let table = Table::new();
    codes.par_chunks_mut(width).enumerate().try_for_each(|(y, out)| {
        let samples = plane.row(y);
        vectorized(
            #[inline(always)]
            || match encoding {
                Encoding::Srgb => out.iter_mut().zip(samples).for_each(|(out, v)| *out = table.code(v / white)),
                Encoding::Linear => out.iter_mut().zip(samples).for_each(|(out, v)| *out = code(v / white, 255) as u8),
            },
        );
        watch.go_on()
    })?;
    Ok(codes)
}

/// Upper halves of the numbers from the first threshold to 1, and more.
const HALVES: usize = 1 << 11;

/// The sRGB codes by the upper half of a number's bits: among numbers that share it at most one threshold lies.
struct Table {
    /// The upper half of the first threshold.
    first: u32,
    /// For each upper half from `first` on, the code of its least number times 2^16, and so much that adding a lower half
    /// carries into the code from the threshold on.
    entries: [u32; HALVES],
}

impl Table {
    fn new() -> Self {
        let thresholds = srgb_thresholds(255);
        let first = thresholds[0].to_bits() >> 16;
        let (mut entries, mut code) = ([0; HALVES], 0);
        for (half, entry) in (first..).zip(&mut entries) {
            *entry = (code as u32) << 16;
            if let Some(threshold) = thresholds.get(code).map(|threshold| threshold.to_bits())
                && threshold >> 16 == half
            {
                *entry += (1 << 16) - (threshold & 0xFFFF);
                code += 1;
            }
        }
        Self { first, entries }
    }

    #[inline(always)]
    fn code(&self, value: f32) -> u8 {
        let least = f32::from_bits(self.first << 16);
        // NaN becomes the least.
        let value = if value > least { value } else { least };
        let bits = if value < 1.0 { value } else { 1.0 }.to_bits();
        let entry = self.entries[((bits >> 16) - self.first) as usize % HALVES];
        ((entry + (bits & 0xFFFF)) >> 16) as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UNWATCHED;
    use crate::transfer::{srgb_code, srgb_table};

    #[test]
    fn the_table_is_the_search() {
        let (table, thresholds) = (Table::new(), srgb_thresholds(255));
        let near = thresholds
            .iter()
            .flat_map(|value| (-2..=2).map(|by| f32::from_bits(value.to_bits().wrapping_add_signed(by))));
        let all = near.chain((0..20_000).map(|i| i as f32 / 19_000.0)).chain([-1.0, -0.0, f32::NAN, 1e-40, 2.0]);
        for value in all.chain([f32::INFINITY, f32::NEG_INFINITY]) {
            assert_eq!(u16::from(table.code(value)), srgb_code(&thresholds, value), "{value}");
        }
        for half in 1..=1.0f32.to_bits() >> 16 {
            let [first, last] =
                [half << 16, half << 16 | 0xFFFF].map(|bits| srgb_code(&thresholds, f32::from_bits(bits)));
            assert!(last - first <= 1, "two thresholds in one entry");
        }
    }

    #[test]
    fn codes_come_back_and_white_scales() {
        let table = srgb_table(255);
        let back = codes(View::packed(&table, 16, 16), Encoding::Srgb, 1.0, UNWATCHED).expect("unwatched");
        assert_eq!(back, (0..=255).collect::<Vec<u8>>());
        let bright: Vec<f32> = table.iter().map(|value| value * 8.0).collect();
        let back = codes(View::packed(&bright, 32, 8), Encoding::Srgb, 8.0, UNWATCHED).expect("unwatched");
        assert_eq!(back, (0..=255).collect::<Vec<u8>>());
        let samples = [0.0, 0.5, 1.0, 3.0, -1.0, f32::NAN, f32::INFINITY];
        let linear = codes(View::packed(&samples, 7, 1), Encoding::Linear, 2.0, UNWATCHED).expect("unwatched");
        assert_eq!(linear, [0, 64, 128, 255, 0, 0, 255]);
    }
}
