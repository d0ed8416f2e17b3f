//! A picture made smaller by powers of two.
//!
//! A level has a picture's size halved some times, rounded up, and covers the picture exactly: where a side is odd its pixels
//! are a little smaller. So it begins, ends, and repeats where the picture does.

use super::block::fetch;
use super::sample::{Edge, Source};
use super::spans::Point;
use crate::rect::Rect;
use crate::simd::vectorized;
use crate::view::View;
use crate::{Interrupted, Watch};
use rayon::prelude::*;

/// Pixels of a row made at a time.
const CHUNK: usize = 32;

/// A picture made smaller: a pixel is the mean of the samples it covers. Where the picture's edge goes on and on it has a
/// rim, one pixel wide, of what lies beyond.
pub(super) struct Level {
    pub frame: Frame,
    /// All planes.
    samples: Vec<f32>,
}

/// How the pixels of a level, or of the picture itself, lie.
pub(super) struct Frame {
    /// Their window, the rim's included, and what lies outside.
    pub source: Source,
    /// Level pixels per px.
    scale: Point,
    /// How much smaller they are than 2^level px.
    pub grown: [f32; 2],
    /// How wide the rim is: 0 or 1.
    rim: f64,
}

impl Frame {
    /// Of the picture itself.
    pub fn whole(source: Source) -> Self {
        Self { source, scale: [1.0; 2], grown: [1.0; 2], rim: 0.0 }
    }

    /// A place in the picture, px from its corner, in level pixels from the rim's corner.
    #[inline(always)]
    pub fn place(&self, [x, y]: Point) -> Point {
        [x * self.scale[0] + self.rim, y * self.scale[1] + self.rim]
    }
}

impl Level {
    pub fn view(&self, plane: usize) -> View<'_, f32> {
        let [width, height] = [self.frame.source.window.width(), self.frame.source.window.height()];
        View::packed(&self.samples[plane * width * height..][..width * height], width, height)
    }
}

/// How often a picture can be halved until one pixel is left.
pub(super) fn most(window: &Rect) -> usize {
    if window.is_empty() {
        return 0;
    }
    window.width().max(window.height()).next_power_of_two().trailing_zeros() as usize
}

/// The picture halved `lowest` to `top` times, at least once, each made from the picture itself: so a level is the same
/// whichever others there are. A mean in which a sample is NaN is NaN.
///
/// Asks for a third of the picture's memory at most, and for the rims'.
pub(super) fn halved(
    source: &Source,
    planes: &[View<f32>],
    [lowest, top]: [usize; 2],
    watch: Watch,
) -> Result<Vec<Level>, Interrupted> {
    let whole = [source.window.width(), source.window.height()];
    let rim = usize::from(source.edge == Edge::Clamp);
    let sides = |level: usize| whole.map(|side| side.div_ceil(1 << level));
    let range = lowest.max(1)..=top;
    let pixels: usize =
        range.clone().map(|level| sides(level).iter().map(|side| side + 2 * rim).product::<usize>()).sum();
    watch.reserve(pixels * planes.len() * size_of::<f32>())?;
    let level = |level: usize| {
        let size = sides(level);
        let scale = [0, 1].map(|axis| {
            // Of one pixel that goes on outside any part is the same: so ellipses stay small.
            let alike = size[axis] == 1 && source.edge != Edge::Transparent;
            if alike { 0.5_f64.powi(level as i32) } else { size[axis] as f64 / whole[axis] as f64 }
        });
        let grown = scale.map(|scale| (scale * (1_u64 << level) as f64) as f32);
        let [width, height] = size.map(|side| (side + 2 * rim) as i64);
        let source = Source { window: Rect::new(0, 0, width, height), ..*source };
        let samples = smaller(planes, size, rim, watch)?;
        Ok(Level { frame: Frame { source, scale, grown, rim: rim as f64 }, samples })
    };
    range.map(level).collect()
}

/// All planes, of one size, made smaller, with a rim: rows are added up first, then neighbours in the sum.
fn smaller(
    planes: &[View<f32>],
    [width, height]: [usize; 2],
    rim: usize,
    watch: Watch,
) -> Result<Vec<f32>, Interrupted> {
    let lines = height + 2 * rim;
    let mut out = vec![0.0; planes.len() * (width + 2 * rim) * lines];
    out.par_chunks_mut(width + 2 * rim).enumerate().try_for_each_init(
        Vec::new,
        |sums: &mut Vec<f32>, (line, out)| {
            watch.go_on()?;
            let plane = &planes[line / lines];
            let across = Cover::new(plane.width(), width);
            let down = Cover::new(plane.height(), height);
            let last = plane.height() - 1;
            let row = |row: usize, weight: f32| Row {
                samples: plane.row(row),
                weight,
                next: plane.row((row + down.step as usize).min(last)),
            };
            let rows: Vec<_> = match line % lines {
                0 if rim > 0 => vec![row(0, down.step as f32)],
                line if line == height + rim => vec![row(last, down.step as f32)],
                line => down.parts(line - rim).map(|(at, weight)| row(at, weight)).collect(),
            };
            sums.resize(plane.width(), 0.0);
            vectorized(
                #[inline(always)]
                || {
                    let scale = 1.0 / (across.step * down.step) as f32;
                    let inner = &mut out[rim..rim + width];
                    match across.step {
                        2.0 => whole::<2>(&rows, scale, inner),
                        4.0 => whole::<4>(&rows, scale, inner),
                        8.0 => whole::<8>(&rows, scale, inner),
                        _ => {
                            add(&rows, 0, sums);
                            across.means(sums, scale, inner);
                        }
                    }
                },
            );
            if rim > 0 {
                for (to, column) in [(0, 0), (width + 1, plane.width() - 1)] {
                    let sum = rows.iter().fold(0.0, |sum, row| sum + row.weight * row.samples[column]);
                    out[to] = sum / down.step as f32;
                }
            }
            Ok(())
        },
    )?;
    Ok(out)
}

/// A row to be added up, and the one that the next sum takes in its place.
struct Row<'a> {
    samples: &'a [f32],
    weight: f32,
    next: &'a [f32],
}

/// The weighted sums of rows, from a column on; has the memory bring the next ones.
#[inline(always)]
fn add(rows: &[Row], first: usize, sums: &mut [f32]) {
    sums.fill(0.0);
    for Row { samples, weight, next } in rows {
        fetch(&next[first..first + sums.len()]);
        for (sum, sample) in sums.iter_mut().zip(&samples[first..]) {
            *sum += weight * sample;
        }
    }
}

/// The weighted sums of N neighbours in rows, times `scale`. A few columns of all rows are read at a time: so memory
/// brings rows side by side.
#[inline(always)]
fn whole<const N: usize>(rows: &[Row], scale: f32, out: &mut [f32]) {
    let mut sums = [[0.0; N]; CHUNK];
    for (i, out) in out.chunks_mut(CHUNK).enumerate() {
        let sums = &mut sums[..out.len()];
        add(rows, i * CHUNK * N, sums.as_flattened_mut());
        for (out, small) in out.iter_mut().zip(sums) {
            let mut sum = small[0];
            for sample in &small[1..] {
                sum += sample;
            }
            *out = sum * scale;
        }
    }
}

/// Pixels that cover smaller ones.
#[derive(Clone, Copy)]
struct Cover {
    count: usize,
    /// Smaller ones in one.
    step: f64,
}

impl Cover {
    fn new(small: usize, count: usize) -> Self {
        Self { count: small, step: small as f64 / count as f64 }
    }

    /// The smaller pixels that one covers, and how much of each.
    #[inline(always)]
    fn parts(self, at: usize) -> impl Iterator<Item = (usize, f32)> {
        let (start, end) = (at as f64 * self.step, ((at + 1) as f64 * self.step).min(self.count as f64));
        let parts = start as usize..(end.ceil() as usize).min(self.count);
        let part = move |i: usize| (i, ((i as f64 + 1.0).min(end) - (i as f64).max(start)) as f32);
        // What rounding makes of nothing is nothing.
        parts.map(part).filter(|&(_, part)| part > 1e-6)
    }

    /// The weighted sums of the smaller pixels, times `scale`.
    #[inline(always)]
    fn means(self, small: &[f32], scale: f32, out: &mut [f32]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.parts(i).fold(0.0, |sum, (i, part)| sum + part * small[i]) * scale;
        }
    }
}
