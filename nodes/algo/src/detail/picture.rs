//! Pictures as colours that compare well, and their pyramids.

use rayon::prelude::*;

use crate::{Interrupted, Watch};

/// Luma, R - luma and B - luma of a pixel, and a zero that fills the lane.
pub(super) type Colour = [f32; 4];

/// A value for each pixel, rows side by side.
pub(super) fn each<T: Clone + Default + Send>(
    width: usize,
    height: usize,
    watch: Watch,
    value: impl Fn(usize) -> T + Sync,
) -> Result<Vec<T>, Interrupted> {
    let mut out = vec![T::default(); width * height];
    out.par_chunks_mut(width.max(1)).enumerate().try_for_each(|(y, row)| {
        row.iter_mut().enumerate().for_each(|(x, out)| *out = value(y * width + x));
        watch.go_on()
    })?;
    Ok(out)
}

/// Weights of a pyramid's next level.
const BINOMIAL: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];

/// Pixel `i` of `n`, mirrored at the first and the last one.
pub(super) fn mirrored(i: isize, n: usize) -> usize {
    let last = n as isize - 1;
    if (0..=last).contains(&i) {
        return i as usize;
    }
    let i = if last == 0 { 0 } else { i.rem_euclid(2 * last) };
    i.min(2 * last - i) as usize
}

/// Colours row by row.
pub(super) struct Picture {
    pub width: usize,
    pub height: usize,
    pub colours: Vec<Colour>,
}

impl Picture {
    /// The colours of encoded planes.
    fn of(planes: &[Vec<f32>; 3], width: usize, height: usize, watch: Watch) -> Result<Self, Interrupted> {
        let colour = |pixel: usize| {
            let [r, g, b] = [0, 1, 2].map(|channel| planes[channel][pixel]);
            let luma = 0.2126 * r + 0.7152 * g + 0.0722 * b;
            [luma, r - luma, b - luma, 0.0]
        };
        Ok(Self { width, height, colours: each(width, height, watch, colour)? })
    }

    /// Every other pixel of every other row, after the binomial filter of five taps along both axes.
    fn halved(&self, watch: Watch) -> Result<Self, Interrupted> {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut colours = vec![[0.0; 4]; width * height];
        colours.par_chunks_mut(width).enumerate().try_for_each(|(y, out)| {
            let mut rows = vec![[0.0; 4]; self.width];
            for (tap, weight) in BINOMIAL.into_iter().enumerate() {
                let row = self.row(mirrored((2 * y + tap) as isize - 2, self.height));
                rows.iter_mut().zip(row).for_each(|(sum, colour)| add(sum, weight, colour));
            }
            for (x, out) in out.iter_mut().enumerate() {
                for (tap, weight) in BINOMIAL.into_iter().enumerate() {
                    add(out, weight, &rows[mirrored((2 * x + tap) as isize - 2, self.width)]);
                }
            }
            watch.go_on()
        })?;
        Ok(Self { width, height, colours })
    }

    /// A row's colours.
    pub fn row(&self, y: usize) -> &[Colour] {
        &self.colours[y * self.width..(y + 1) * self.width]
    }

    /// The luma of a pixel, mirrored into the picture.
    pub fn luma(&self, x: isize, y: isize) -> f32 {
        self.colours[mirrored(y, self.height) * self.width + mirrored(x, self.width)][0]
    }

    /// The pixel at (x, y), if there is one.
    pub fn pixel(&self, x: isize, y: isize) -> Option<usize> {
        let inside = x >= 0 && y >= 0 && x < self.width as isize && y < self.height as isize;
        inside.then(|| y as usize * self.width + x as usize)
    }

    /// The pixel `dx`, `dy` from a pixel, if there is one.
    pub fn beside(&self, pixel: usize, dx: isize, dy: isize) -> Option<usize> {
        self.pixel((pixel % self.width) as isize + dx, (pixel / self.width) as isize + dy)
    }
}

fn add<const N: usize>(sum: &mut [f32; N], weight: f32, values: &[f32; N]) {
    for lane in 0..N {
        sum[lane] += weight * values[lane];
    }
}

/// The picture of encoded planes, finest first, each level half of the one before.
pub(super) fn pyramid(
    planes: &[Vec<f32>; 3],
    width: usize,
    height: usize,
    levels: usize,
    watch: Watch,
) -> Result<Vec<Picture>, Interrupted> {
    let mut pyramid = vec![Picture::of(planes, width, height, watch)?];
    while pyramid.len() < levels {
        let next = pyramid[pyramid.len() - 1].halved(watch)?;
        pyramid.push(next);
    }
    Ok(pyramid)
}
