//! A picture halved again and again.

use super::sample::{Edge, Source};
use crate::rect::Rect;
use crate::view::View;
use crate::{Interrupted, Watch};
use rayon::prelude::*;

/// A picture halved some times: pixel (i, j) is the mean of the samples of a square of the picture.
pub(super) struct Level {
    pub source: Source,
    planes: Vec<Vec<f32>>,
}

impl Level {
    pub fn view(&self, plane: usize) -> View<'_, f32> {
        View::packed(&self.planes[plane], self.source.window.width(), self.source.window.height())
    }
}

/// How often a picture can be halved until one pixel is left.
pub(super) fn most(window: &Rect) -> usize {
    if window.is_empty() {
        return 0;
    }
    window.width().max(window.height()).next_power_of_two().trailing_zeros() as usize
}

/// The picture halved 1 to `top` times. Where a side is odd the last pixels take their other half from beyond the
/// edge. A mean in which a sample is NaN is NaN.
///
/// Asks for a third of the picture's memory at most.
pub(super) fn halved(
    source: &Source,
    planes: &[View<f32>],
    top: usize,
    watch: Watch,
) -> Result<Vec<Level>, Interrupted> {
    let sides = |level: usize| [source.window.width(), source.window.height()].map(|side| side.div_ceil(1 << level));
    let pixels: usize = (1..=top).map(|level| sides(level).iter().product::<usize>()).sum();
    watch.reserve(pixels * planes.len() * size_of::<f32>())?;
    let mut levels: Vec<Level> = Vec::with_capacity(top);
    for level in 1..=top {
        let [width, height] = sides(level);
        let window = Rect::new(0, 0, width as i64, height as i64);
        let halves = (0..planes.len()).map(|plane| match levels.last() {
            None => half(&planes[plane], source, [width, height], watch),
            Some(larger) => half(&larger.view(plane), &larger.source, [width, height], watch),
        });
        let planes = halves.collect::<Result<_, _>>()?;
        levels.push(Level { source: Source { window, ..*source }, planes });
    }
    Ok(levels)
}

/// One plane halved.
fn half(
    plane: &View<f32>,
    source: &Source,
    [width, height]: [usize; 2],
    watch: Watch,
) -> Result<Vec<f32>, Interrupted> {
    let mut out = vec![0.0; width * height];
    out.par_chunks_mut(width).enumerate().try_for_each(|(y, out)| {
        watch.go_on()?;
        let [upper, lower] = [2 * y, 2 * y + 1].map(|y| source.row(y as i32).map(|y| plane.row(y)));
        // The first row of a pair always lies inside.
        let upper = upper.unwrap_or_default();
        row(upper, lower, source, out);
        Ok(())
    })?;
    Ok(out)
}

/// One row of means, `lower` being all zeros if missing.
fn row(upper: &[f32], lower: Option<&[f32]>, source: &Source, out: &mut [f32]) {
    let mean = |[a, b]: [f32; 2], [c, d]: [f32; 2]| ((a + b) + (c + d)) * 0.25;
    let (pairs, odd) = upper.as_chunks::<2>();
    match lower {
        Some(lower) => {
            let lower = lower.as_chunks::<2>().0;
            out.iter_mut().zip(pairs.iter().zip(lower)).for_each(|(out, (&a, &b))| *out = mean(a, b));
        }
        None => out.iter_mut().zip(pairs).for_each(|(out, &a)| *out = mean(a, [0.0; 2])),
    }
    if !odd.is_empty() {
        let last = upper.len() - 1;
        let beyond = source.column(last as i32 + 1);
        let pair = |row: &[f32]| [row[last], beyond.map_or(0.0, |column| row[column])];
        out[last / 2] = mean(pair(upper), lower.map_or([0.0; 2], pair));
    }
}

/// A place moved into the picture where it repeats, and whether it was mirrored: a level of a picture with an odd side
/// would else repeat at another distance. `size`: the picture's side, px.
pub(super) fn home(edge: Edge, at: f64, size: usize) -> (f64, bool) {
    let size = size as f64;
    match edge {
        Edge::Transparent | Edge::Clamp => (at, false),
        Edge::Wrap => (at.rem_euclid(size), false),
        Edge::Mirror => {
            let phase = at.rem_euclid(2.0 * size);
            if phase < size { (phase, false) } else { (2.0 * size - phase, true) }
        }
    }
}
