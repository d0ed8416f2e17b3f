//! Edits of pictures that a strength per pixel says where to make.

use crate::composite::Plane;
use crate::rect::Rect;
use crate::view::{View, ViewMut};

/// What painting makes of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Paint {
    /// The channel's sample of a colour, scene-linear and straight.
    Color(f32),
    /// The sample multiplied, then raised.
    Brightness {
        /// What it is multiplied by.
        scale: f32,
        /// What is added, straight.
        offset: f32,
    },
}

/// A channel of a picture that is laid over another.
#[derive(Clone, Copy, Debug)]
pub struct Texture<'a> {
    /// The channel's samples, premultiplied.
    pub samples: Plane<'a>,
    /// The picture's alpha.
    pub alpha: Plane<'a>,
    /// The part of it that is shown, px.
    pub window: Rect,
    /// How far it is moved, px.
    pub offset: [i64; 2],
    /// Whether it repeats beyond its window.
    pub repeat: bool,
}

/// The picture that is edited, of one channel.
#[derive(Clone, Copy, Debug)]
pub struct Base<'a> {
    /// The channel's samples, premultiplied.
    pub samples: View<'a, f32>,
    /// Where its first sample lies, px.
    pub corner: [i64; 2],
    /// The picture's alpha.
    pub alpha: Plane<'a>,
}

/// Paints one channel of a picture.
///
/// out = base (1 - a) + target a, a being the strength and the target `color * alpha` or `scale * base + offset * alpha`:
/// what is painted covers as much as the picture does.
///
/// - `base`: the picture; its alpha stays.
/// - `paint`: what its samples become where a is 1.
/// - `strength`: a, any numbers; beyond 0..=1 the paint is taken away or overdone.
/// - `out`: of the base's size (asserted); every sample is written.
///
/// Where a is 0, as it is outside of its window, a sample stays bit for bit. Else infinities and NaN follow IEEE 754.
///
/// Cost: linear, rows side by side.
///
/// S. Brooks and N. Dodgson, "Self-similarity based texture editing", SIGGRAPH 2002, section 3.
pub fn paint(base: &Base, paint: Paint, strength: Plane, out: ViewMut<f32>) {
    edit(base, strength, out, |_, _, out, strength, alpha| {
        for ((out, &a), &alpha) in out.iter_mut().zip(strength).zip(alpha).filter(|((_, a), _)| **a != 0.0) {
            let target = match paint {
                Paint::Color(color) => color * alpha,
                Paint::Brightness { scale, offset } => scale * *out + offset * alpha,
            };
            *out = if a == 1.0 { target } else { *out * (1.0 - a) + target * a };
        }
    });
}

/// Lays one channel of a texture upon a picture.
///
/// out = base (1 - a t) + a texture alpha, a being the strength, t the texture's alpha: "atop", so that the picture's
/// alpha stays. The texture is seen at (x, y) as it is at (x, y) - offset, modulo the sides of its window if it repeats.
///
/// - `base`: the picture; its alpha stays.
/// - `texture`: see there. Beyond its window, if it does not repeat, nothing is laid; neither if the window is empty.
/// - `strength`: a, any numbers.
/// - `out`: of the base's size (asserted); every sample is written.
///
/// Where a is 0, or where texture and t are, a sample stays bit for bit; where a t is 1 nothing of it is left, whatever
/// it was. Else infinities and NaN follow IEEE 754.
///
/// Cost: linear, rows side by side.
///
/// S. Brooks and N. Dodgson, "Self-similarity based texture editing", SIGGRAPH 2002, section 3. T. Porter and T. Duff,
/// "Compositing Digital Images", SIGGRAPH 1984, section 4.3 (atop).
pub fn lay(base: &Base, texture: &Texture, strength: Plane, out: ViewMut<f32>) {
    edit(base, strength, out, |x, y, out, strength, alpha| {
        let [samples, covers] = [texture.samples, texture.alpha].map(|plane| texture.row(plane, x, y, out.len()));
        let laid = samples.iter().zip(&covers).zip(strength).zip(alpha);
        for (out, (((&sample, &t), &a), &alpha)) in out.iter_mut().zip(laid) {
            if a != 0.0 && (t != 0.0 || sample != 0.0) {
                let kept = if a * t == 1.0 { 0.0 } else { *out * (1.0 - a * t) };
                *out = kept + a * sample * alpha;
            }
        }
    });
}

/// Copies the base, and has `change(x, y, row, strength, alpha)` change its rows, which start at (x, y).
fn edit(base: &Base, strength: Plane, out: ViewMut<f32>, change: impl Fn(i64, i64, &mut [f32], &[f32], &[f32]) + Sync) {
    assert_eq!([base.samples.width(), base.samples.height()], [out.width(), out.height()], "sizes differ");
    let [x, top] = base.corner;
    out.par_rows(|y, row| {
        row.copy_from_slice(base.samples.row(y));
        let y = top.saturating_add_unsigned(y as u64);
        let [strength, alpha] = [strength, base.alpha].map(|plane| plane.row(x, y, row.len()));
        change(x, y, row, &strength, &alpha);
    });
}

impl Texture<'_> {
    /// The samples of one of its planes that are seen from (x, y) to the right.
    fn row(&self, plane: Plane, x: i64, y: i64, count: usize) -> Vec<f32> {
        let Rect { x0, y0, x1, y1 } = self.window;
        let mut row = vec![0.0; count];
        if self.window.is_empty() {
            return row;
        }
        let [mut u, mut v] = [x.saturating_sub(self.offset[0]), y.saturating_sub(self.offset[1])];
        if self.repeat {
            [u, v] = [x0 + (u - x0).rem_euclid(x1 - x0), y0 + (v - y0).rem_euclid(y1 - y0)];
        }
        if !(y0..y1).contains(&v) {
            return row;
        }
        let mut at = x0.saturating_sub(u).clamp(0, count as i64) as usize;
        u = u.saturating_add_unsigned(at as u64);
        while at < count && u < x1 {
            let end = count.min(at.saturating_add((x1 - u) as usize));
            plane.onto_row(u, v, 0, &mut row[at..end], |out, sample| *out = sample);
            (at, u) = (end, if self.repeat { x0 } else { x1 });
        }
        row
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::composite::Placed;
    use proptest::prelude::*;

    fn plane(samples: &[f32], width: usize, x0: i64, y0: i64) -> Plane<'_> {
        Plane::Samples(Placed { view: View::packed(samples, width, samples.len() / width), x0, y0 })
    }

    fn base<'a>(samples: &'a [f32], alpha: Plane<'a>) -> Base<'a> {
        Base { samples: View::packed(samples, samples.len(), 1), corner: [0, 0], alpha }
    }

    const OPAQUE: Plane = Plane::Opaque { x0: -99, y0: -99, width: 200, height: 200 };

    fn made(width: usize, height: usize, make: impl FnOnce(ViewMut<f32>)) -> Vec<f32> {
        let mut out = vec![9.0; width * height];
        make(ViewMut::packed(&mut out, width, height));
        out
    }

    #[test]
    fn paint_in_literals() {
        let (samples, strength) = ([0.5, 0.5, 0.5, 0.5, f32::NAN], [0.0, 0.5, 1.0, -1.0, 0.0f32]);
        let strength = plane(&strength, 5, 0, 0);
        let color = made(5, 1, |out| paint(&base(&samples, OPAQUE), Paint::Color(2.0), strength, out));
        assert_eq!(color[..4], [0.5, 1.25, 2.0, -1.0]);
        assert!(color[4].is_nan(), "it stays");
        let brighter = Paint::Brightness { scale: 3.0, offset: 0.25 };
        let bright = made(5, 1, |out| paint(&base(&samples, OPAQUE), brighter, strength, out));
        assert_eq!(bright[..4], [0.5, 1.125, 1.75, -0.75]);
    }

    #[test]
    fn paint_covers_what_the_picture_covers() {
        let (samples, alpha, strength) = ([0.25, 0.0, 0.5], [0.5, 0.0, 1.0f32], [1.0f32; 3]);
        let base = base(&samples, plane(&alpha, 3, 0, 0));
        let strength = plane(&strength, 3, 0, 0);
        assert_eq!(made(3, 1, |out| paint(&base, Paint::Color(0.8), strength, out)), [0.4, 0.0, 0.8]);
        let texture = [0.8f32; 3];
        let window = Rect::new(0, 0, 3, 1);
        let samples = plane(&texture, 3, 0, 0);
        let texture = Texture { samples, alpha: OPAQUE, window, offset: [0, 0], repeat: false };
        assert_eq!(made(3, 1, |out| lay(&base, &texture, strength, out)), [0.4, 0.0, 0.8]);
    }

    #[test]
    fn masks_of_another_size_are_nothing_beyond() {
        let (samples, strength) = ([1.0, 1.0, 1.0, 1.0f32], [1.0, 1.0f32]);
        let out = made(4, 1, |out| paint(&base(&samples, OPAQUE), Paint::Color(0.0), plane(&strength, 2, 1, 0), out));
        assert_eq!(out, [1.0, 0.0, 0.0, 1.0]);
        let out = made(4, 1, |out| paint(&base(&samples, OPAQUE), Paint::Color(0.0), plane(&strength, 2, 1, 1), out));
        assert_eq!(out, [1.0; 4]);
    }

    #[test]
    fn a_texture_repeats_or_ends() {
        let (samples, strength) = ([0.0f32; 8], [1.0f32; 8]);
        let (texture, strength) = ([1.0, 2.0, 3.0f32], plane(&strength, 8, 0, 0));
        let window = Rect::new(0, 0, 3, 1);
        let row = |offset, repeat| {
            let texture = Texture { samples: plane(&texture, 3, 0, 0), alpha: OPAQUE, window, offset, repeat };
            made(8, 1, |out| lay(&base(&samples, OPAQUE), &texture, strength, out))
        };
        assert_eq!(row([0, 0], true), [1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 1.0, 2.0]);
        assert_eq!(row([-1, 7], true), [2.0, 3.0, 1.0, 2.0, 3.0, 1.0, 2.0, 3.0]);
        assert_eq!(row([2, 0], false), [0.0, 0.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0]);
        assert_eq!(row([-1, 0], false), [2.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(row([7, 0], false), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!(row([0, 1], false), [0.0; 8]);
        assert_eq!(row([i64::MAX, i64::MIN], false), [0.0; 8]);
    }

    #[test]
    fn a_texture_without_pixels_changes_nothing() {
        let (samples, strength) = ([0.5f32; 2], [1.0f32; 2]);
        let window = Rect::new(3, 3, 3, 3);
        let texture = Texture { samples: Plane::Zero, alpha: OPAQUE, window, offset: [0, 0], repeat: true };
        assert_eq!(made(2, 1, |out| lay(&base(&samples, OPAQUE), &texture, plane(&strength, 2, 0, 0), out)), samples);
    }

    proptest! {
        #[test]
        fn every_sample_of_a_texture_obeys_the_definition(
            ox in -9i64..9, oy in -9i64..9, places in proptest::array::uniform6(-4i64..4), repeat: bool,
            values in proptest::collection::vec(-2.0f32..2.0, 5 * 4 * 2 + 7 * 6 * 2 + 9),
        ) {
            let [bx, by, tx, ty, sx, sy] = places;
            let (texture, rest) = values.split_at(20);
            let (covers, rest) = rest.split_at(20);
            let (samples, rest) = rest.split_at(42);
            let (alpha, strength) = rest.split_at(42);
            let at = |samples: &[f32], width: i64, x: i64, y: i64| {
                let inside = (0..width).contains(&x) && (0..samples.len() as i64 / width).contains(&y);
                if inside { samples[(y * width + x) as usize] } else { 0.0 }
            };
            let base = Base { samples: View::packed(samples, 7, 6), corner: [bx, by], alpha: plane(alpha, 7, bx, by) };
            // The window shows a part of the samples, and one row below them.
            let window = Rect::new(tx + 1, ty, tx + 5, ty + 5);
            let [t, c] = [texture, covers].map(|samples| plane(samples, 5, tx, ty));
            let texture_at = Texture { samples: t, alpha: c, window, offset: [ox, oy], repeat };
            let out = made(7, 6, |out| lay(&base, &texture_at, plane(strength, 3, sx, sy), out));
            for (i, out) in out.iter().enumerate() {
                let (x, y) = (bx + i as i64 % 7, by + i as i64 / 7);
                let [u, v] = [x - ox - window.x0, y - oy - window.y0];
                let [u, v] = if repeat { [u.rem_euclid(4), v.rem_euclid(5)] } else { [u, v] };
                let shown = (0..4).contains(&u) && (0..5).contains(&v);
                let [t, c] = [texture, covers].map(|samples| if shown { at(samples, 5, u + 1, v) } else { 0.0 });
                let a = at(strength, 3, x - sx, y - sy);
                prop_assert_eq!(*out, samples[i] * (1.0 - a * c) + a * t * alpha[i]);
            }
        }
    }
}
