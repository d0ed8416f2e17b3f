//! Growing and shrinking of masks.

use rayon::prelude::*;

use crate::steps::Steps;
use crate::view::{View, ViewMut};
use crate::{Interrupted, Watch};

/// Chords between two looks at the watch.
const CHORDS: usize = 64;

/// Rows that one task computes.
const BAND_ROWS: usize = 16;

/// Grey dilation (`by` > 0) or erosion (`by` < 0) of a mask with a Euclidean disc.
///
/// Each pixel gets the greatest (least) sample among the pixels whose centres lie within |by| of its own.
///
/// `mask`, `out`: planes of one size, any samples; `by`: px, any value.
///
/// What lies outside the view is ignored: it neither grows nor erodes. A NaN sample counts as 0; `by` of 0 or NaN
/// copies. Stops when `watch` says so.
///
/// Cost: O(area x |by|), at most O(area x (width + height)).
///
/// The disc is a stack of centred chords, and dilations with centred chords compose by adding their half-widths. So the
/// chords nest like Horner's scheme: from the widest to the narrowest, take in the rows of that half-width, then dilate
/// by one pixel to either side. This is exact and costs two comparisons per sample and unit of radius, where the
/// running maximum of van Herk (1992) has to be computed anew for each chord.
pub fn grow(mask: View<f32>, by: f64, out: ViewMut<f32>, watch: Watch) -> Result<(), Interrupted> {
    assert_eq!([mask.width(), mask.height()], [out.width(), out.height()], "sizes differ");
    if by < 0.0 {
        spread(mask, -by, out, watch, f32::INFINITY, |a, b| if b < a { b } else { a })
    } else {
        spread(mask, by, out, watch, f32::NEG_INFINITY, |a, b| if b > a { b } else { a })
    }
}

/// Dilation in the order whose supremum is `sup` and whose least element is `least`.
fn spread(
    mask: View<f32>,
    radius: f64,
    out: ViewMut<f32>,
    watch: Watch,
    least: f32,
    sup: impl Fn(f32, f32) -> f32 + Copy + Sync,
) -> Result<(), Interrupted> {
    let (width, height) = (mask.width(), mask.height());
    let disc = chords(radius, width, height);
    let bands = out.bands(BAND_ROWS);
    let steps = Steps::new(watch, bands.len());
    bands.into_par_iter().try_for_each(|(top, mut band)| {
        // One sample of margin at both ends stands for what lies outside.
        let mut reached = vec![least; width + 2];
        let mut wider = reached.clone();
        for row in 0..band.height() {
            let y = top + row;
            reached.fill(least);
            for (number, rows) in disc.iter().rev().enumerate() {
                if number % CHORDS == 0 {
                    watch.go_on()?;
                }
                widen(&reached, &mut wider[1..=width], sup);
                std::mem::swap(&mut reached, &mut wider);
                for &dy in rows {
                    if dy <= y {
                        take_in(&mut reached[1..=width], mask.row(y - dy), sup);
                    }
                    if dy > 0 && y + dy < height {
                        take_in(&mut reached[1..=width], mask.row(y + dy), sup);
                    }
                }
            }
            band.row_mut(row).copy_from_slice(&reached[1..=width]);
        }
        steps.step()
    })
}

/// For each half-width of a chord of the disc, from 0 up, the distances of its rows from the disc's centre row; no
/// wider and no farther than a view of this size needs.
fn chords(radius: f64, width: usize, height: usize) -> Vec<Vec<usize>> {
    let squared = radius * radius;
    let mut disc = Vec::new();
    for dy in 0..height.min((radius as usize).saturating_add(1)) {
        let half_width = ((squared - (dy * dy) as f64).sqrt() as usize).min(width.saturating_sub(1));
        if disc.len() <= half_width {
            disc.resize(half_width + 1, Vec::new());
        }
        disc[half_width].push(dy);
    }
    disc
}

/// Each sample and its two neighbours: `to[x]` from `from[x..x + 3]`.
fn widen(from: &[f32], to: &mut [f32], sup: impl Fn(f32, f32) -> f32) {
    let width = to.len();
    let (left, middle, right) = (&from[..width], &from[1..=width], &from[2..]);
    for (((to, &a), &b), &c) in to.iter_mut().zip(left).zip(middle).zip(right) {
        *to = sup(sup(a, b), c);
    }
}

fn take_in(reached: &mut [f32], row: &[f32], sup: impl Fn(f32, f32) -> f32) {
    for (reached, &sample) in reached.iter_mut().zip(row) {
        *reached = sup(*reached, if sample.is_nan() { 0.0 } else { sample });
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::UNWATCHED;

    fn grown(mask: &[f32], width: usize, by: f64) -> Vec<f32> {
        let height = mask.len() / width;
        let mut out = vec![f32::NAN; mask.len()];
        let view = ViewMut::packed(&mut out, width, height);
        grow(View::packed(mask, width, height), by, view, UNWATCHED).unwrap();
        out
    }

    fn noise(count: usize) -> Vec<f32> {
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        };
        (0..count).map(|_| next()).collect()
    }

    /// The definition, pixel by pixel.
    fn by_definition(mask: &[f32], width: usize, by: f64) -> Vec<f32> {
        let squared_distance = |a: usize, b: usize| {
            let (dx, dy) = ((a % width).abs_diff(b % width), (a / width).abs_diff(b / width));
            (dx * dx + dy * dy) as f64
        };
        let near = |a: usize| (0..mask.len()).filter(move |&b| squared_distance(a, b) <= by * by).map(|b| mask[b]);
        let pick = if by < 0.0 { f32::min } else { f32::max };
        (0..mask.len()).map(|a| near(a).reduce(pick).unwrap()).collect()
    }

    #[test]
    fn a_pixel_grows_to_a_disc() {
        let mut mask = [0.0; 25];
        mask[12] = 1.0;
        #[rustfmt::skip]
        assert_eq!(grown(&mask, 5, 2.0), [
            0.0, 0.0, 1.0, 0.0, 0.0,
            0.0, 1.0, 1.0, 1.0, 0.0,
            1.0, 1.0, 1.0, 1.0, 1.0,
            0.0, 1.0, 1.0, 1.0, 0.0,
            0.0, 0.0, 1.0, 0.0, 0.0,
        ]);
        let square = grown(&mask, 5, 1.5);
        assert_eq!(square.iter().sum::<f32>(), 9.0);
        assert_eq!(grown(&square, 5, -1.5), mask);
    }

    #[test]
    fn equals_the_definition() {
        for (width, height) in [(1, 9), (13, 1), (17, 11), (7, 40)] {
            let mask = noise(width * height);
            for by in [0.0, 0.9, 1.0, 1.42, 2.3, 5.0, 8.6, 100.0, 1e300] {
                assert_eq!(grown(&mask, width, by), by_definition(&mask, width, by), "{width} x {height} by {by}");
                assert_eq!(grown(&mask, width, -by), by_definition(&mask, width, -by), "{width} x {height} by -{by}");
            }
        }
    }

    #[test]
    fn the_outside_neither_grows_nor_erodes() {
        assert_eq!(grown(&[0.5; 35], 5, 3.0), [0.5; 35]);
        assert_eq!(grown(&[0.5; 35], 5, -3.0), [0.5; 35]);
    }

    #[test]
    fn nan_counts_as_zero() {
        let mask = [1.0, 1.0, f32::NAN, 1.0, 1.0];
        assert_eq!(grown(&mask, 5, 0.0), [1.0, 1.0, 0.0, 1.0, 1.0]);
        assert_eq!(grown(&mask, 5, -1.0), [1.0, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!(grown(&mask, 5, 1.0), [1.0; 5]);
        assert_eq!(grown(&[-1.0, f32::NAN, -1.0], 3, 1.0), [0.0; 3]);
    }

    #[test]
    fn opening_never_adds_and_closing_never_removes() {
        let mask = noise(31 * 23);
        let opened = grown(&grown(&mask, 31, -2.5), 31, 2.5);
        let closed = grown(&grown(&mask, 31, 2.5), 31, -2.5);
        assert!(mask.iter().zip(&opened).all(|(a, b)| b <= a));
        assert!(mask.iter().zip(&closed).all(|(a, b)| b >= a));
    }

    #[test]
    fn threads_do_not_matter() {
        let mask = noise(53 * 71);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| grown(&mask, 53, -6.2))
        };
        let alone = run(1);
        assert!([2, 3, 8].into_iter().all(|threads| run(threads) == alone));
    }

    #[test]
    fn empty_views_are_legal() {
        for (width, height) in [(0, 0), (0, 3), (3, 0)] {
            let out = ViewMut::packed(&mut [], width, height);
            assert_eq!(grow(View::packed(&[], width, height), 2.0, out, UNWATCHED), Ok(()));
        }
    }

    #[test]
    fn a_watch_stops_it() {
        let mut out = [0.0; 4];
        let stop: Watch = &|_| Err(Interrupted);
        let result = grow(View::packed(&[1.0; 4], 2, 2), 1.0, ViewMut::packed(&mut out, 2, 2), stop);
        assert_eq!(result, Err(Interrupted));
    }
}
