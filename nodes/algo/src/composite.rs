//! Combining planes of samples that lie in different windows.

use crate::view::{View, ViewMut};
use std::ops::Range;

/// A view and where it lies; the samples outside it are 0.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a, T = f32> {
    /// The samples.
    pub view: View<'a, T>,
    /// Column of its leftmost samples, px.
    pub x0: i64,
    /// Row of its topmost samples, px.
    pub y0: i64,
}

/// A plane of samples over the whole grid of pixels.
#[derive(Clone, Copy, Debug)]
pub enum Plane<'a> {
    /// 0 everywhere: a plane that is not there.
    Zero,
    /// The samples of a view, 0 outside it.
    Samples(Placed<'a>),
    /// 1 in a window, 0 outside it: the alpha of a picture that has no alpha plane.
    Opaque {
        /// Leftmost column, px.
        x0: i64,
        /// Topmost row, px.
        y0: i64,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
}

/// Where `count` samples from `start` on meet a run of `out_count` from `out_start` on, counted in that run.
fn overlap(start: i64, count: usize, out_start: i64, out_count: usize) -> Range<usize> {
    let end = |start: i64, count: usize| start.saturating_add_unsigned(count as u64);
    let (first, last) = (start.max(out_start), end(start, count).min(end(out_start, out_count)));
    if first < last { first.abs_diff(out_start) as usize..last.abs_diff(out_start) as usize } else { 0..0 }
}

/// The index in a run from `start` on that belongs to index `i` of one from `out_start` on, if it has one.
fn index(i: usize, out_start: i64, start: i64, count: usize) -> Option<usize> {
    let position = out_start.checked_add_unsigned(i as u64)?;
    (position >= start && position.abs_diff(start) < count as u64).then(|| position.abs_diff(start) as usize)
}

impl<'a, T: Copy> Placed<'a, T> {
    /// The part of a row of samples that row `y` of an output at (out_x0, out_y0) sees, and its columns there.
    fn seen_by_row(&self, out_x0: i64, out_y0: i64, y: usize, out_width: usize) -> Option<(Range<usize>, &'a [T])> {
        let row = self.view.row(index(y, out_y0, self.y0, self.view.height())?);
        let columns = overlap(self.x0, row.len(), out_x0, out_width);
        let first = index(columns.start, out_x0, self.x0, row.len())?;
        let samples = &row[first..first + columns.len()];
        Some((columns, samples))
    }
}

impl Plane<'_> {
    /// Its samples from (x, y) to the right; 0 outside its window.
    pub(crate) fn row(&self, x: i64, y: i64, count: usize) -> Vec<f32> {
        let mut row = vec![0.0; count];
        self.onto_row(x, y, 0, &mut row, |out, sample| *out = sample);
        row
    }

    /// Calls `f(out, sample)` where row `y` of an output at (out_x0, out_y0) lies in the plane's window.
    pub(crate) fn onto_row(&self, out_x0: i64, out_y0: i64, y: usize, out: &mut [f32], f: impl Fn(&mut f32, f32)) {
        match *self {
            Plane::Zero => {}
            Plane::Samples(placed) => {
                if let Some((columns, samples)) = placed.seen_by_row(out_x0, out_y0, y, out.len()) {
                    out[columns].iter_mut().zip(samples).for_each(|(out, &sample)| f(out, sample));
                }
            }
            Plane::Opaque { x0, y0, width, height } => {
                if index(y, out_y0, y0, height).is_some() {
                    let columns = overlap(x0, width, out_x0, out.len());
                    out[columns].iter_mut().for_each(|out| f(out, 1.0));
                }
            }
        }
    }
}

/// One plane of a picture over another picture.
///
/// out = front + back (1 - alpha), the "over" of premultiplied samples. The alpha plane of the result is this with
/// the alpha plane as the front.
///
/// * `front`, `alpha`: the plane and the alpha of the picture in front; of one without alpha, [`Plane::Opaque`] over
///   its data window.
/// * `back`: the plane of the picture behind, premultiplied.
/// * `out_x0`, `out_y0`, `out`: where the result's top left sample lies, px, and the samples to write, all of them.
///
/// Planes are 0 outside their windows. Where alpha is exactly 1 the back does not contribute, and where the back is
/// exactly 0 alpha does not matter: 0 times infinity or NaN is 0 here. Other infinities and NaN follow IEEE 754.
///
/// Cost: linear in the samples of `out`, rows side by side.
///
/// T. Porter and T. Duff, "Compositing Digital Images", SIGGRAPH 1984, section 4.3.
pub fn over(front: Plane, alpha: Plane, back: Plane, out_x0: i64, out_y0: i64, out: ViewMut<f32>) {
    out.par_rows(|y, row| {
        row.fill(0.0);
        back.onto_row(out_x0, out_y0, y, row, |out, back| *out = back);
        alpha.onto_row(out_x0, out_y0, y, row, |out, alpha| {
            *out = if alpha == 1.0 || *out == 0.0 { 0.0 } else { *out * (1.0 - alpha) };
        });
        front.onto_row(out_x0, out_y0, y, row, |out, front| *out += front);
    });
}

/// How far two planes lie apart.
///
/// out = |a - b|.
///
/// * `a`, `b`: the planes, in any order.
/// * `out_x0`, `out_y0`, `out`: where the result's top left sample lies, px, and the samples to write, all of them.
///
/// Planes are 0 outside their windows. Equal samples differ by 0, equal infinities among them; NaN in either gives
/// NaN.
///
/// Cost: linear in the samples of `out`, rows side by side.
pub fn difference(a: Plane, b: Plane, out_x0: i64, out_y0: i64, out: ViewMut<f32>) {
    out.par_rows(|y, row| {
        row.fill(0.0);
        a.onto_row(out_x0, out_y0, y, row, |out, a| *out = a);
        b.onto_row(out_x0, out_y0, y, row, |out, b| *out = if *out == b { 0.0 } else { *out - b });
        row.iter_mut().for_each(|out| *out = out.abs());
    });
}

/// Multiplies samples by a number.
///
/// out(x, y) = factor * source(x, y).
///
/// * `source`, `out`: planes of one size; every sample of `out` is written.
/// * `factor`: any number.
///
/// Cost: linear in the samples, rows side by side.
pub fn scale(source: View<f32>, factor: f32, out: ViewMut<f32>) {
    assert_eq!([source.width(), source.height()], [out.width(), out.height()], "sizes differ");
    out.par_rows(|y, row| row.iter_mut().zip(source.row(y)).for_each(|(out, sample)| *out = factor * sample));
}

/// Cuts samples down to a matte.
///
/// out = samples * matte, in place.
///
/// * `samples`: any numbers; (`x0`, `y0`) is where the top left one lies, px.
/// * `matte`: 0 outside its window.
///
/// Where the matte is 0 the result is 0, whatever the sample was. Other infinities and NaN follow IEEE 754.
///
/// Cost: linear in the samples, rows side by side.
///
/// T. Porter and T. Duff, "Compositing Digital Images", SIGGRAPH 1984, section 4.3 ("in").
pub fn within(matte: Plane, x0: i64, y0: i64, samples: ViewMut<f32>) {
    samples.par_rows(|y, row| {
        let parts = matte.row(x0, y0.saturating_add_unsigned(y as u64), row.len());
        row.iter_mut().zip(parts).for_each(|(sample, part)| *sample = if part == 0.0 { 0.0 } else { *sample * part });
    });
}

/// Copies samples into another window: crops where that is smaller, pads with 0 where it is larger.
///
/// out(x, y) = source(x, y), bit for bit.
///
/// * `source`: samples of any kind whose default is 0, such as `f32` and `u32`.
/// * `out_x0`, `out_y0`, `out`: where the result's top left sample lies, px, and the samples to write, all of them.
///
/// Windows that do not meet give zeros.
///
/// Cost: linear in the samples of `out`, rows side by side.
pub fn copy<T: Copy + Default + Send + Sync>(source: Placed<T>, out_x0: i64, out_y0: i64, out: ViewMut<T>) {
    out.par_rows(|y, row| {
        row.fill(T::default());
        if let Some((columns, samples)) = source.seen_by_row(out_x0, out_y0, y, row.len()) {
            row[columns].copy_from_slice(samples);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const INF: f32 = f32::INFINITY;

    fn placed<T>(samples: &[T], width: usize, x0: i64, y0: i64) -> Placed<'_, T> {
        Placed { view: View::packed(samples, width, samples.len() / width), x0, y0 }
    }

    fn samples(samples: &[f32], width: usize, x0: i64, y0: i64) -> Plane<'_> {
        Plane::Samples(placed(samples, width, x0, y0))
    }

    /// What `f` writes into a window of `width` times `height` samples.
    fn written<T: Copy + Send>(garbage: T, width: usize, height: usize, f: impl FnOnce(ViewMut<T>)) -> Vec<T> {
        let mut out = vec![garbage; width * height];
        f(ViewMut::packed(&mut out, width, height));
        out
    }

    #[test]
    fn copy_crops_and_pads() {
        let source: Vec<u32> = (1..=25).collect();
        let crop = written(99, 2, 3, |out| copy(placed(&source, 5, 10, -20), 13, -19, out));
        assert_eq!(crop, [9, 10, 14, 15, 19, 20]);
        let pad = written(99, 4, 3, |out| copy(placed(&source, 5, 10, -20), 8, -21, out));
        assert_eq!(pad, [0, 0, 0, 0, 0, 0, 1, 2, 0, 0, 6, 7]);
        let corner = written(99, 3, 2, |out| copy(placed(&source, 5, 10, -20), 14, -16, out));
        assert_eq!(corner, [25, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn windows_that_do_not_meet_give_zeros() {
        let source = [7.0f32; 4];
        let edges = [i64::MIN, i64::MIN + 1, -1, 0, 1, i64::MAX - 1, i64::MAX];
        for (x0, out_x0) in edges.iter().flat_map(|&a| edges.iter().map(move |&b| (a, b))) {
            let out = written(1.0, 2, 2, |out| copy(placed(&source, 2, x0, 0), out_x0, 0, out));
            let touching = x0.abs_diff(out_x0) < 2;
            assert!(touching || out == [0.0; 4], "{x0} and {out_x0} are apart");
            let out = written(1.0, 2, 2, |out| copy(placed(&source, 2, 0, x0), 0, out_x0, out));
            assert!(touching || out == [0.0; 4], "{x0} and {out_x0} are apart");
        }
        let empty: [f32; 0] = [];
        let none = Placed { view: View::packed(&empty, 0, 0), x0: 0, y0: 0 };
        assert_eq!(written(1.0, 2, 1, |out| copy(none, 0, 0, out)), [0.0, 0.0]);
    }

    #[test]
    fn over_in_five_by_five() {
        // A front of 3 x 3 in the middle, opaque in its centre and half transparent around it.
        let front = [0.25, 0.25, 0.25, 0.25, 2.0, 0.25, 0.25, 0.25, 0.25f32];
        let alpha = [0.5, 0.5, 0.5, 0.5, 1.0, 0.5, 0.5, 0.5, 0.5f32];
        let back = [4.0f32; 25];
        let out = written(9.0, 5, 5, |out| {
            over(samples(&front, 3, 1, 1), samples(&alpha, 3, 1, 1), samples(&back, 5, 0, 0), 0, 0, out);
        });
        #[rustfmt::skip]
        let expected = [
            4.0, 4.0,  4.0,  4.0,  4.0,
            4.0, 2.25, 2.25, 2.25, 4.0,
            4.0, 2.25, 2.0,  2.25, 4.0,
            4.0, 2.25, 2.25, 2.25, 4.0,
            4.0, 4.0,  4.0,  4.0,  4.0,
        ];
        assert_eq!(out, expected);
    }

    #[test]
    fn missing_planes_are_zero_and_missing_alpha_is_opaque() {
        let (front, back) = ([0.5, 0.75f32], [1.0, 2.0, 3.0, 4.0f32]);
        let opaque = Plane::Opaque { x0: 1, y0: 0, width: 2, height: 1 };
        let run =
            |front: Plane, alpha: Plane, back: Plane| written(9.0, 5, 1, |out| over(front, alpha, back, 0, 0, out));
        let (front, back) = (samples(&front, 2, 1, 0), samples(&back, 4, 0, 0));
        assert_eq!(run(front, opaque, back), [1.0, 0.5, 0.75, 4.0, 0.0]);
        assert_eq!(run(Plane::Zero, opaque, back), [1.0, 0.0, 0.0, 4.0, 0.0], "a missing plane hides the back");
        assert_eq!(run(front, opaque, Plane::Zero), [0.0, 0.5, 0.75, 0.0, 0.0]);
        assert_eq!(run(front, Plane::Zero, back), [1.0, 2.5, 3.75, 4.0, 0.0], "without alpha light adds up");
        // The alpha plane itself.
        let behind = Plane::Opaque { x0: 2, y0: 0, width: 3, height: 1 };
        assert_eq!(run(opaque, opaque, behind), [0.0, 1.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn infinities_and_nan_do_not_leak() {
        let front = [2.0, 2.0, 2.0, 2.0f32];
        let alpha = [1.0, 1.0, INF, f32::NAN];
        let back = [INF, f32::NAN, 0.0, 0.0f32];
        let hidden = written(9.0, 4, 1, |out| {
            over(samples(&front, 4, 0, 0), samples(&alpha, 4, 0, 0), samples(&back, 4, 0, 0), 0, 0, out);
        });
        assert_eq!(hidden, [2.0; 4]);
        let shown = written(9.0, 2, 1, |out| {
            over(samples(&front, 4, 0, 0), samples(&[0.5f32; 4], 4, 0, 0), samples(&back, 4, 0, 0), 0, 0, out);
        });
        assert!(shown[0] == INF && shown[1].is_nan(), "what shows through shows");
    }

    #[test]
    fn difference_of_literals() {
        let a = [1.0, -2.0, INF, INF, f32::NAN, 5.0];
        let b = [3.0, 1.0, INF, -INF, 1.0f32];
        let out = written(9.0, 7, 1, |out| difference(samples(&a, 6, 0, 0), samples(&b, 5, 0, 0), 0, 0, out));
        assert_eq!(out[..4], [2.0, 3.0, 0.0, INF]);
        assert!(out[4].is_nan());
        assert_eq!(out[5..], [5.0, 0.0]);
        let opaque = Plane::Opaque { x0: 0, y0: 0, width: 2, height: 1 };
        let out = written(9.0, 3, 1, |out| difference(opaque, Plane::Zero, -1, 0, out));
        assert_eq!(out, [0.0, 1.0, 1.0]);
    }

    #[test]
    fn a_matte_cuts() {
        let mut out = [2.0, 2.0, f32::NAN, -2.0, 2.0];
        within(samples(&[0.5, 0.0, 1.0], 3, 1, 0), 0, 0, ViewMut::packed(&mut out, 5, 1));
        assert_eq!(out, [0.0, 1.0, 0.0, -2.0, 0.0]);
        within(Plane::Opaque { x0: 3, y0: 0, width: 9, height: 9 }, 0, 0, ViewMut::packed(&mut out, 5, 1));
        assert_eq!(out, [0.0, 0.0, 0.0, -2.0, 0.0]);
    }

    #[test]
    fn threads_and_strides_do_not_change_it() {
        let values: Vec<f32> = (0..40 * 30).map(|i| (i as f32 * 0.37).sin()).collect();
        let strided = Plane::Samples(Placed { view: View::new(&values, 33, 30, 40), x0: 3, y0: -2 });
        let compute = || {
            written(9.0, 37, 29, |out| {
                over(strided, samples(&values, 40, 0, 0), samples(&values, 30, -5, 4), 0, 0, out)
            })
        };
        let expected = compute();
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            assert_eq!(pool.install(compute), expected);
        }
    }

    proptest! {
        #[test]
        fn every_sample_obeys_the_definition(
            places in proptest::array::uniform8(-6i64..6), values in proptest::collection::vec(-2.0f32..2.0, 48),
        ) {
            let [fx, fy, ax, ay, bx, by, ox, oy] = places;
            let planes = [
                placed(&values[..12], 4, fx, fy), placed(&values[12..27], 3, ax, ay), placed(&values[27..], 7, bx, by),
            ];
            let [front, alpha, back] = planes.map(Plane::Samples);
            let composite = written(9.0, 6, 5, |out| over(front, alpha, back, ox, oy, out));
            let apart = written(9.0, 6, 5, |out| difference(front, back, ox, oy, out));
            for (i, (composite, apart)) in composite.iter().zip(apart).enumerate() {
                let (x, y) = (ox + i as i64 % 6, oy + i as i64 / 6);
                let [f, a, b] = planes.map(|Placed { view, x0, y0 }| {
                    let within = |i: i64, count: usize| usize::try_from(i).ok().filter(|&i| i < count);
                    let at = within(x - x0, view.width()).zip(within(y - y0, view.height()));
                    at.map_or(0.0, |(column, row)| view.row(row)[column])
                });
                prop_assert_eq!(*composite, f + b * (1.0 - a));
                prop_assert_eq!(apart, (f - b).abs());
            }
        }
    }
}
