//! A level of the guide, laid out for the sums of products.
//!
//! The sum of (p - c)^2 over a neighbourhood is sum p^2 - 2 sum p c + sum c^2. The first sum is made once per picture, the
//! last once per point; the middle one is all that a new point costs per pixel. Its products come in pairs, which vector
//! units multiply and add in one step: R with G, and B with the B below it.

use rayon::prelude::*;

use super::Boundary;
use super::kernel::BLOCK;
use crate::simd::vectorized;
use crate::view::{View, ViewMut};
use crate::{Interrupted, Watch};

/// Two codes that are multiplied together.
pub(super) type Pair = [i16; 2];

/// Half the width of the disc of an odd diameter on each of its rows, from the top.
pub(super) fn disc(diameter: usize) -> Vec<usize> {
    let radius = diameter as isize / 2;
    let holds = |dx: isize, dy: isize| 4 * (dx * dx + dy * dy) <= (diameter * diameter) as isize;
    (-radius..=radius).map(|dy| (0..=radius).rev().find(|&dx| holds(dx, dy)).unwrap_or(0) as usize).collect()
}

/// Bytes that a level of a size holds.
pub(super) fn bytes(size: [usize; 2], diameter: usize) -> usize {
    let (columns, border) = (size[0].next_multiple_of(BLOCK), diameter - 1);
    let pairs = (columns + border) * (size[1] + border) * 2 * size_of::<Pair>();
    pairs + columns * size[1] * size_of::<i32>()
}

/// Pixels with as many beyond each border as a neighbourhood reaches, and the sum of squares around each.
pub(super) struct Level {
    pub number: u32,
    pub size: [usize; 2],
    /// Half the disc's width on each of its rows.
    disc: Vec<usize>,
    /// From a row of pairs to the next.
    stride: usize,
    /// R and G of all rows, then B and the B below of all rows.
    pairs: Vec<Pair>,
    /// Per pixel, rows of whole blocks.
    squares: Vec<i32>,
}

/// What the pixels around a point are multiplied by, as the sum wants it.
pub(super) struct Probe {
    /// From a pixel's place in the pairs to a factor's, and the factors.
    pub taps: Vec<(usize, Pair)>,
    /// The point's own sum of squares.
    pub squares: i32,
}

/// Rows of sums of squares that are made together.
const ROWS: usize = 32;

impl Level {
    pub fn new(
        number: u32,
        planes: &[View<u8>; 3],
        diameter: usize,
        boundary: Boundary,
        watch: Watch,
    ) -> Result<Self, Interrupted> {
        let size @ [width, height] = [planes[0].width(), planes[0].height()];
        let reach = diameter / 2;
        let (stride, rows) = (width.next_multiple_of(BLOCK) + 2 * reach, height + 2 * reach);
        let mut pairs = vec![[0; 2]; 2 * stride * rows];
        let (red_green, blue) = pairs.split_at_mut(stride * rows);
        let row = |plane: usize, y: usize| planes[plane].row(boundary.inside(y as isize - reach as isize, height));
        let filled = |out: &mut [Pair], first: &[u8], second: &[u8]| {
            vectorized(
                #[inline(always)]
                || {
                    for (out, (first, second)) in out[reach..].iter_mut().zip(first.iter().zip(second)) {
                        *out = [i16::from(*first), i16::from(*second)];
                    }
                },
            );
            for x in (0..reach).chain(reach + width..width + 2 * reach) {
                out[x] = out[reach + boundary.inside(x as isize - reach as isize, width)];
            }
            watch.go_on()
        };
        red_green.par_chunks_mut(stride).enumerate().try_for_each(|(y, out)| filled(out, row(0, y), row(1, y)))?;
        blue.par_chunks_mut(stride).enumerate().try_for_each(|(y, out)| filled(out, row(2, y), row(2, y + 1)))?;
        let mut level = Self { number, size, disc: disc(diameter), stride, pairs, squares: Vec::new() };
        level.squares = level.sums_of_squares(watch)?;
        Ok(level)
    }

    /// The sum of the squares around each pixel.
    fn sums_of_squares(&self, watch: Watch) -> Result<Vec<i32>, Interrupted> {
        let mut squares = vec![0; self.columns() * self.size[1]];
        let scratch = || (vec![0; self.stride], vec![0; self.columns()]);
        let bands = squares.par_chunks_mut(ROWS * self.columns()).enumerate();
        bands.try_for_each_init(scratch, |(row, sums), (band, out)| {
            let (top, rows) = (band * ROWS, out.len() / self.columns());
            for y in top..top + rows + 2 * self.reach() {
                vectorized(
                    #[inline(always)]
                    || self.squares_of_row(y, row),
                );
                vectorized(
                    #[inline(always)]
                    || self.add_row(y, top, row, sums, out),
                );
            }
            watch.go_on()
        })?;
        Ok(squares)
    }

    /// The squares of a row of pairs.
    #[inline(always)]
    fn squares_of_row(&self, y: usize, out: &mut [i32]) {
        let row = y * self.stride..(y + 1) * self.stride;
        let (red_green, blue) = (&self.pairs[row.clone()], &self.pairs[self.pairs.len() / 2..][row]);
        for (out, (rg, b)) in out.iter_mut().zip(red_green.iter().zip(blue)) {
            let [r, g, b] = [i32::from(rg[0]), i32::from(rg[1]), i32::from(b[0])];
            *out = r * r + g * g + b * b;
        }
    }

    /// Adds a row's squares to the sums, from row `top` on, whose discs meet it: the same along the row for all rows of
    /// a disc that are as wide.
    #[inline(always)]
    fn add_row(&self, y: usize, top: usize, row: &[i32], sums: &mut [i32], out: &mut [i32]) {
        let (reach, columns) = (self.reach(), sums.len());
        sums.copy_from_slice(&row[reach..reach + columns]);
        for wide in 0..=reach {
            if wide > 0 {
                let (left, right) = (&row[reach - wide..][..columns], &row[reach + wide..][..columns]);
                sums.iter_mut().zip(left.iter().zip(right)).for_each(|(sum, (left, right))| *sum += left + right);
            }
            let below = self.disc.iter().enumerate().filter(|(_, of_disc)| **of_disc == wide);
            for at in below.filter_map(|(dy, _)| y.checked_sub(top + dy)) {
                if let Some(out) = out.get_mut(at * columns..(at + 1) * columns) {
                    out.iter_mut().zip(&*sums).for_each(|(out, sum)| *out += sum);
                }
            }
        }
    }

    fn reach(&self) -> usize {
        self.disc.len() / 2
    }

    /// Columns of whole blocks.
    pub fn columns(&self) -> usize {
        self.size[0].next_multiple_of(BLOCK)
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&*self.pairs) + size_of_val(&*self.squares)
    }

    /// What is compared with a pixel's surroundings, (`x`, `y`) being the pixel of level 0.
    pub fn probe(&self, [x, y]: [usize; 2]) -> Probe {
        let (reach, half) = (self.reach(), self.pairs.len() / 2);
        let start = (y >> self.number) * self.stride + (x >> self.number);
        let in_disc = |dx: usize, dy: isize| {
            usize::try_from(dy).ok().and_then(|dy| self.disc.get(dy)).is_some_and(|wide| dx.abs_diff(reach) <= *wide)
        };
        let (mut taps, mut squares) = (Vec::new(), 0);
        let mut tap = |offset: usize, used: [bool; 2]| {
            let pair = self.pairs[start + offset];
            let used = [0, 1].map(|i| if used[i] { pair[i] } else { 0 });
            squares += used.map(|code| i32::from(code) * i32::from(code)).iter().sum::<i32>();
            if used != [0; 2] {
                taps.push((offset, used.map(|code| -2 * code)));
            }
        };
        for dy in 0..self.disc.len() {
            (0..self.disc.len())
                .filter(|&dx| in_disc(dx, dy as isize))
                .for_each(|dx| tap(dy * self.stride + dx, [true; 2]));
        }
        // Each column's B from its top on, two rows at a time.
        for dx in 0..self.disc.len() {
            let top = (0..self.disc.len()).find(|&dy| in_disc(dx, dy as isize)).unwrap_or(0);
            let pairs = (top..self.disc.len()).step_by(2).filter(|&dy| in_disc(dx, dy as isize));
            pairs.for_each(|dy| tap(half + dy * self.stride + dx, [true, in_disc(dx, dy as isize + 1)]));
        }
        Probe { taps, squares }
    }

    /// The pairs from a row's first pixel on, and its sums of squares.
    pub fn row(&self, y: usize) -> (&[Pair], &[i32]) {
        (&self.pairs[y * self.stride..], &self.squares[y * self.columns()..][..self.columns()])
    }

    /// The distances of all pixels, rows of whole blocks.
    pub fn distances(&self, probe: &Probe, watch: Watch) -> Result<Vec<i32>, Interrupted> {
        let mut out = vec![0; self.columns() * self.size[1]];
        let rows = ViewMut::packed(&mut out, self.columns(), self.size[1]).bands(1);
        rows.into_par_iter().try_for_each(|(y, mut out)| {
            super::kernel::row(self.row(y), probe, out.row_mut(0));
            watch.go_on()
        })?;
        Ok(out)
    }
}
