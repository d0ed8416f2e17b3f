//! The part of a picture that is magnified.

use rayon::prelude::*;

use super::blur::back_project;
use super::encoding::Coder;
use super::local_blur::LocalBlur;
use super::picture::Picture;
use super::similar::SimilarSets;
use crate::lattice::Positions;
use crate::rect::Rect;
use crate::view::{View, ViewMut};
use crate::{Interrupted, Watch};

/// The magnifications from which on detail is added, and from which on all of it.
const FEATHER: [f32; 2] = [1.02, 1.15];

/// Which part of the magnified pixels has a magnification up to that which A is blurred for.
const QUANTILE: f64 = 0.9;

/// How far the part reaches beyond the magnified pixels, px, besides twice the reach of their blur.
const MARGIN: f64 = 16.0;

/// The area in px that a warp gives each pixel's share of the source: 1 / |det d src / d dst|.
///
/// Derivatives are differences between the two neighbours along each axis, at a border and beside a pixel without
/// source between the pixel and its neighbour.
///
/// - `sources`: where each pixel comes from, px, row-major, NaN where from nowhere.
/// - `width`: pixels per row.
///
/// Row-major; NaN where a pixel or all its neighbours along an axis have no source; infinite where the warp takes a
/// line or a point to an area. Cost: linear, rows side by side.
pub fn magnification(sources: &Positions, width: usize, watch: Watch) -> Result<Vec<f32>, Interrupted> {
    assert_eq!(sources.x.len(), sources.y.len(), "positions are pairs");
    let height = sources.x.len() / width.max(1);
    let mut out = vec![0.0; sources.x.len()];
    out.par_chunks_mut(width.max(1)).enumerate().try_for_each(|(y, out)| {
        for (x, out) in out.iter_mut().enumerate() {
            let pixel = y * width + x;
            let known = |pixel: usize| sources.x[pixel].is_finite() && sources.y[pixel].is_finite();
            let [dx, dy] = [(x, 1, width), (y, width, height)].map(|(at, step, count)| {
                let low = if at > 0 && known(pixel - step) { pixel - step } else { pixel };
                let high = if at + 1 < count && known(pixel + step) { pixel + step } else { pixel };
                let steps = ((high - low) / step) as f64;
                [(sources.x[high] - sources.x[low]) / steps, (sources.y[high] - sources.y[low]) / steps]
            });
            let area = 1.0 / (dx[0] * dy[1] - dx[1] * dy[0]).abs();
            *out = if known(pixel) { area as f32 } else { f32::NAN };
        }
        watch.go_on()
    })?;
    Ok(out)
}

/// How much of the detail a pixel gets, 0..=1: smoothstep of its magnification.
fn weight(magnification: f32) -> f32 {
    let t = ((magnification - FEATHER[0]) / (FEATHER[1] - FEATHER[0])).clamp(0.0, 1.0);
    if t > 0.0 { t * t * (3.0 - 2.0 * t) } else { 0.0 }
}

/// The variance of the blur that a magnification makes, square px.
fn variance(magnification: f32, blur: Option<f64>) -> f32 {
    blur.map_or_else(|| 0.25 * (magnification - 1.0).min(256.0), |blur| (blur * blur) as f32)
}

/// The magnified pixels' bounding box with a margin; none if there are no such pixels.
pub(super) fn frame(picture: &[View<f32>; 3], magnification: &[f32], blur: Option<f64>) -> Option<Rect> {
    let (width, height) = (picture[0].width(), picture[0].height());
    assert!(picture.iter().all(|plane| (plane.width(), plane.height()) == (width, height)), "planes of one size");
    assert_eq!(magnification.len(), width * height, "one magnification per pixel");
    let (mut frame, mut most) = (Rect::new(i64::MAX, i64::MAX, i64::MIN, i64::MIN), 0.0_f32);
    for (y, row) in magnification.chunks(width.max(1)).enumerate() {
        for (x, &m) in row.iter().enumerate().filter(|(_, m)| weight(**m) > 0.0) {
            let (x, y) = (x as i64, y as i64);
            frame = Rect::new(frame.x0.min(x), frame.y0.min(y), frame.x1.max(x + 1), frame.y1.max(y + 1));
            most = variance(m, blur).max(most);
        }
    }
    let margin = (MARGIN + 6.0 * f64::from(most).sqrt()).ceil() as i64;
    let whole = Rect::new(0, 0, width as i64, height as i64);
    let grown = |frame: Rect| Rect::new(frame.x0 - margin, frame.y0 - margin, frame.x1 + margin, frame.y1 + margin);
    (!frame.is_empty()).then(|| grown(frame).intersect(&whole))
}

/// The part of a picture that is magnified.
pub(super) struct Target {
    pub width: usize,
    pub height: usize,
    /// R, G, B, encoded.
    pub planes: [Vec<f32>; 3],
    /// The variance of the blur that A is made with, square px.
    pub variance: f64,
    /// Where it lies in the picture.
    frame: Rect,
    /// How much of the detail each pixel gets.
    weights: Vec<f32>,
    /// The variance of each pixel's blur, square px; NaN where no detail is added.
    variances: Vec<f32>,
    /// The pixel of the training picture that each comes from.
    starts: Vec<Option<[u32; 2]>>,
}

impl Target {
    pub fn new(
        sets: &SimilarSets,
        picture: &[View<f32>; 3],
        magnification: &[f32],
        origins: &Positions,
        blur: Option<f64>,
        frame: Rect,
        watch: Watch,
    ) -> Result<Self, Interrupted> {
        let (width, height, full) = (frame.width(), frame.height(), picture[0].width());
        assert_eq!(origins.x.len(), magnification.len(), "one origin per pixel");
        assert_eq!(origins.y.len(), magnification.len(), "one origin per pixel");
        let cut = picture.each_ref().map(|plane| {
            let (samples, stride) = plane.samples();
            View::new(&samples[frame.y0 as usize * stride + frame.x0 as usize..], width, height, stride)
        });
        let pixels = || (0..width * height).into_par_iter();
        let at = |i: usize| (frame.y0 as usize + i / width) * full + frame.x0 as usize + i % width;
        let weights: Vec<f32> = pixels().map(|i| weight(magnification[at(i)])).collect();
        let variance_of = |i: usize| if weights[i] > 0.0 { variance(magnification[at(i)], blur) } else { f32::NAN };
        let variances: Vec<f32> = pixels().map(variance_of).collect();
        let start = |i: usize| {
            let [x, y] = [origins.x[at(i)].floor(), origins.y[at(i)].floor()];
            let inside = x >= 0.0 && y >= 0.0 && x < sets.width as f64 && y < sets.height as f64;
            inside.then_some([x as u32, y as u32])
        };
        let mut known: Vec<f32> = variances.iter().copied().filter(|variance| !variance.is_nan()).collect();
        let quantile = (QUANTILE * (known.len() - 1) as f64) as usize;
        let variance = f64::from(*known.select_nth_unstable_by(quantile, f32::total_cmp).1);
        let (planes, starts) = (sets.coder.planes(&cut, watch)?, pixels().map(start).collect());
        Ok(Self { width, height, planes, variance, frame, weights, variances, starts })
    }

    /// Whether a pixel of a level of the pyramid gets detail: one of those that it stands for does.
    pub fn is_wanted(&self, x: usize, y: usize, level: usize) -> bool {
        let rows = y << level..self.height.min((y + 1) << level);
        let columns = x << level..self.width.min((x + 1) << level);
        rows.into_iter().any(|y| self.weights[y * self.width..][columns.clone()].iter().any(|&weight| weight > 0.0))
    }

    /// The pixel of a level of the training picture that a pixel of that level comes from, by the warp.
    pub fn start(&self, x: usize, y: usize, level: usize, training: &Picture) -> Option<u32> {
        let [x, y] = self.starts[(y << level) * self.width + (x << level)]?;
        Some((y >> level) * training.width as u32 + (x >> level))
    }

    /// Makes the result of pixels' sources and writes it to `out`; see [`super::Detailed::residual`].
    pub fn finish(
        &self,
        sets: &SimilarSets,
        picture: &[View<f32>; 3],
        sources: &[Option<u32>],
        steps: usize,
        out: [ViewMut<f32>; 3],
        watch: Watch,
    ) -> Result<[f64; 2], Interrupted> {
        let blur = LocalBlur::new(self.width, &self.variances);
        let mut sums = [0.0; 2];
        for (channel, out) in out.into_iter().enumerate() {
            let (constraint, training) = (&self.planes[channel], &sets.planes[channel]);
            let value = |(source, own): (&Option<u32>, &f32)| source.map_or(*own, |source| training[source as usize]);
            let mut made: Vec<f32> = sources.par_iter().zip(constraint).map(value).collect();
            let sum = back_project(&blur, constraint, &mut made, steps, watch)?;
            sums = [sums[0] + sum[0], sums[1] + sum[1]];
            self.write(channel, &sets.coder, &picture[channel], &made, out);
        }
        let count = 3.0 * self.weights.iter().filter(|&&weight| weight > 0.0).count() as f64;
        Ok(sums.map(|sum| (sum / count).sqrt()))
    }

    /// Fades what was made in.
    fn write(&self, channel: usize, coder: &Coder, plane: &View<f32>, made: &[f32], out: ViewMut<f32>) {
        let [left, top] = [self.frame.x0 as usize, self.frame.y0 as usize];
        out.par_rows(|y, out| {
            let Some(row) = y.checked_sub(top).filter(|&row| row < self.height) else {
                return;
            };
            let pixels = row * self.width..(row + 1) * self.width;
            let out = &mut out[left..left + self.width];
            for ((out, pixel), sample) in out.iter_mut().zip(pixels).zip(&plane.row(y)[left..]) {
                let (weight, own) = (self.weights[pixel], self.planes[channel][pixel]);
                if weight > 0.0 && sample.is_finite() {
                    *out = coder.linear(own + weight * (made[pixel] - own));
                }
            }
        });
    }
}
