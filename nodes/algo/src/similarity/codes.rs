//! Samples as the codes that are compared.

use rayon::prelude::*;

use super::Encoding;
use crate::transfer::{code, srgb_code, srgb_thresholds};
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
/// Cost: linear; a look into a table of 16 kB per sample.
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
        let samples = out.iter_mut().zip(plane.row(y));
        match encoding {
            Encoding::Srgb => samples.for_each(|(out, &sample)| *out = table.code(sample / white)),
            Encoding::Linear => samples.for_each(|(out, &sample)| *out = code(sample / white, 255) as u8),
        }
        watch.go_on()
    })?;
    Ok(codes)
}

/// The sRGB codes by the upper half of a number's bits: among numbers that share it at most one threshold lies.
struct Table {
    /// The code of the least number with that upper half.
    codes: Vec<u8>,
    /// What the code after it begins with.
    next: [f32; 256],
}

impl Table {
    fn new() -> Self {
        let thresholds = srgb_thresholds(255);
        let of_half = |half: u32| srgb_code(&thresholds, f32::from_bits(half << 16)) as u8;
        let mut next = [f32::INFINITY; 256];
        next[..255].copy_from_slice(&thresholds);
        Self { codes: (0..=1.0f32.to_bits() >> 16).map(of_half).collect(), next }
    }

    #[inline(always)]
    fn code(&self, value: f32) -> u8 {
        let value = if value > 0.0 { value.min(1.0) } else { 0.0 };
        let code = self.codes[(value.to_bits() >> 16) as usize];
        code + u8::from(self.next[usize::from(code)] <= value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UNWATCHED;
    use crate::transfer::srgb_table;

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
