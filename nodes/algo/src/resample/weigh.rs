//! Weighing the samples of a row of pixels.

use super::block::{BLOCK_WIDTH, Samples};
use super::filter::Kernel;
use super::sample::Source;
use super::taps::Taps;
use crate::view::View;

/// Pixels weighed together.
const GROUP: usize = 8;

/// Values of a row's pixels, each with C channels.
pub(super) type Values<const C: usize> = [[f32; C]; BLOCK_WIDTH];

/// The weighted sums of a row: down each column first, then across, in the order that [`total`] says. Whether some
/// value is NaN or infinite.
#[inline(always)]
pub(super) fn sums<const T: usize, const C: usize>(
    samples: &Samples<C>,
    taps: &Taps<T>,
    values: &mut Values<C>,
) -> bool {
    #[cfg(target_arch = "x86_64")]
    if let Some(wild) = super::simd::sums(samples, taps, values) {
        return wild;
    }
    plain_sums(samples, taps, values)
}

/// By plain loops.
#[inline(always)]
fn plain_sums<const T: usize, const C: usize>(samples: &Samples<C>, taps: &Taps<T>, values: &mut Values<C>) -> bool {
    for start in (0..taps.count).step_by(GROUP) {
        // Closures given to arrays are not always compiled for the vectors at hand.
        let mut group = [[[0.0; C]; T]; GROUP];
        for (i, terms) in group.iter_mut().enumerate() {
            *terms = terms_of(samples, taps, start + i);
        }
        for (value, terms) in values[start..].iter_mut().zip(&group) {
            for channel in 0..C {
                value[channel] = total::<T>(std::array::from_fn(|column| terms[column][channel]));
            }
        }
    }
    some_not_finite(values.as_flattened())
}

/// What each column of pixel `i` gives.
#[inline(always)]
fn terms_of<const T: usize, const C: usize>(samples: &Samples<C>, taps: &Taps<T>, i: usize) -> [[f32; C]; T] {
    let (pixels, stride) = (samples.from(taps.first[i]), samples.stride);
    let mut terms = [[0.0; C]; T];
    for row in 0..T {
        let samples: &[[f32; C]; T] = pixels[row * stride..].first_chunk().expect("the samples hold the footprint");
        for column in 0..T {
            for channel in 0..C {
                let term = &mut terms[column][channel];
                *term = taps.weights[1][row][i].mul_add(samples[column][channel], *term);
            }
        }
    }
    for column in 0..T {
        for channel in 0..C {
            terms[column][channel] *= taps.weights[0][column][i];
        }
    }
    terms
}

/// The sum of the columns' terms: those beyond four added to the first ones, then in pairs. Never minus zero.
#[inline(always)]
fn total<const T: usize>(terms: [f32; T]) -> f32 {
    let folded: [f32; 4] = std::array::from_fn(|i| (i + 4..T).step_by(4).fold(terms[i], |sum, k| sum + terms[k]));
    (folded[0] + folded[1]) + (folded[2] + folded[3]) + 0.0
}

/// Whether some value is NaN or infinite.
#[inline(always)]
pub(super) fn some_not_finite(values: &[f32]) -> bool {
    const LANES: usize = 16;
    // NaN where some value is not finite, else a zero.
    let mut sums = [0.0; LANES];
    let (chunks, rest) = values.as_chunks::<LANES>();
    for values in chunks {
        for lane in 0..LANES {
            sums[lane] += values[lane] * 0.0;
        }
    }
    for value in rest {
        sums[0] += value * 0.0;
    }
    sums.iter().any(|sum| sum.is_nan())
}

/// Cuts the values to between the least and the greatest of the middle 2 x 2 taps.
#[inline(always)]
pub(super) fn clamp<const T: usize, const C: usize>(samples: &Samples<C>, taps: &Taps<T>, values: &mut Values<C>) {
    let middle = T / 2 - 1;
    for (i, value) in values.iter_mut().enumerate().take(taps.count) {
        let (pixels, stride) = (samples.from(taps.first[i]), samples.stride);
        let [upper, lower]: [&[[f32; C]; 2]; 2] = [middle, middle + 1]
            .map(|row| pixels[row * stride + middle..].first_chunk().expect("the samples hold the footprint"));
        *value = std::array::from_fn(|channel| {
            let [a, b, c, d] = [upper[0], upper[1], lower[0], lower[1]].map(|pixel| pixel[channel]);
            cut(value[channel], [a.min(b).min(c.min(d)), a.max(b).max(c.max(d))])
        });
    }
}

/// `value`, no less than `low` and no more than `high`.
#[inline(always)]
fn cut(value: f32, [low, high]: [f32; 2]) -> f32 {
    let value = if value < low { low } else { value };
    if value > high { high } else { value }
}

/// One pixel weighed alone, where samples of weight zero matter: they are not read.
pub(super) struct Footprint<'a, const T: usize, const D: usize> {
    kernel: &'a Kernel<T, D>,
    source: &'a Source,
    first: [i32; 2],
    rest: [f32; 2],
}

impl<'a, const T: usize, const D: usize> Footprint<'a, T, D> {
    const MIDDLE: usize = T / 2 - 1;

    /// Around a position.
    #[inline(always)]
    pub fn new(kernel: &'a Kernel<T, D>, source: &'a Source, position: [f64; 2]) -> Self {
        let (first, rest) = source.first_tap(position, T);
        Self { kernel, source, first, rest }
    }

    /// The planes' values; with `clamp` no less than the least and no more than the greatest sample within 1 px.
    #[inline(always)]
    pub fn values<const C: usize>(&self, planes: &[View<f32>; C], clamp: bool) -> [f32; C] {
        if self.kernel.interpolates() && self.rest == [0.0; 2] {
            let column = self.source.column(self.first[0] + Self::MIDDLE as i32);
            let row = self.source.row(self.first[1] + Self::MIDDLE as i32);
            return column.zip(row).map_or([0.0; C], |(column, row)| planes.map(|plane| plane.row(row)[column]));
        }
        let mut values = [0.0; C];
        for (value, plane) in values.iter_mut().zip(planes) {
            *value = self.weighed(plane, clamp);
        }
        values
    }

    #[inline(always)]
    fn weighed(&self, plane: &View<f32>, clamp: bool) -> f32 {
        let weights = [self.kernel.weights(self.rest[0]), self.kernel.weights(self.rest[1])];
        let sum = self.sum(&weights, plane);
        let value = if clamp { cut(sum, self.range(&weights, plane)) } else { sum };
        // The sign and payload of a computed NaN depend on how the compiler orders operands; this takes them away.
        if value.is_nan() { f32::NAN } else { value }
    }

    fn sample(&self, plane: &View<f32>, column: usize, row: usize) -> f32 {
        let column = self.source.column(self.first[0] + column as i32);
        let row = self.source.row(self.first[1] + row as i32);
        column.zip(row).map_or(0.0, |(column, row)| plane.row(row)[column])
    }

    #[inline(always)]
    fn sum(&self, [x, y]: &[[f32; T]; 2], plane: &View<f32>) -> f32 {
        let mut terms = [0.0; T];
        for column in 0..T {
            for row in 0..T {
                if x[column] != 0.0 && y[row] != 0.0 {
                    terms[column] = y[row].mul_add(self.sample(plane, column, row), terms[column]);
                }
            }
            terms[column] *= x[column];
        }
        total(terms)
    }

    /// The least and the greatest sample with weight within 1 px along both axes.
    fn range(&self, weights: &[[f32; T]; 2], plane: &View<f32>) -> [f32; 2] {
        let inner = |axis: usize| {
            let whole = self.rest[axis] == 0.0;
            let first = if whole { Self::MIDDLE - 1 } else { Self::MIDDLE };
            (first..Self::MIDDLE + 2).filter(move |&tap| !whole || weights[axis][tap] != 0.0)
        };
        let samples = inner(1).flat_map(|row| inner(0).map(move |column| self.sample(plane, column, row)));
        samples.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::{Block, Part};
    use super::super::filter::CUBIC;
    use super::*;
    use crate::rect::Rect;
    use crate::resample::Edge;

    /// Four channels and one are weighed by vectors made for them, where the processor has them.
    fn compare<const C: usize>() {
        let (width, height) = (90, 30);
        let plane: Vec<f32> = (0..C * width * height).map(|i| libm::sinf(i as f32 * 1.7) + 0.3).collect();
        let planes: [_; C] =
            std::array::from_fn(|i| View::packed(&plane[i * width * height..][..width * height], width, height));
        let source = Source { window: Rect::new(0, 0, width as i64, height as i64), edge: Edge::Mirror };
        let part = Part { corner: [-3, -2], size: [80, 25] };
        let mut block = Block::default();
        let mut supply = block.supply(&source, planes, part, None);
        let stride = supply.stride;
        let samples = supply.samples(part.size[1]);
        for count in [1, 5, 16, 63, 64] {
            let x: Vec<f64> = (0..count).map(|i| if i % 7 == 3 { f64::NAN } else { 1.1 * i as f64 + 0.217 }).collect();
            let y: Vec<f64> = x.iter().map(|x| 4.0 + 0.11 * x).collect();
            let mut taps = Taps::EMPTY;
            taps.fill(&CUBIC, false, &source, [&x, &y], part, stride);
            let (mut wide, mut plain) = ([[0.0; C]; BLOCK_WIDTH], [[0.0; C]; BLOCK_WIDTH]);
            assert_eq!(sums(&samples, &taps, &mut wide), plain_sums(&samples, &taps, &mut plain));
            for i in 0..count {
                assert_eq!(wide[i].map(f32::to_bits), plain[i].map(f32::to_bits), "{count} {i}");
                assert!(!x[i].is_nan() || plain[i] == [0.0; C]);
            }
        }
    }

    #[test]
    fn wide_and_plain_loops_weigh_alike() {
        compare::<1>();
        compare::<4>();
    }
}
