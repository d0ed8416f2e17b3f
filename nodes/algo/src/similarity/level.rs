//! A level of the guide, and its rows laid out for the sums of squares.
//!
//! Differences are squared and added up in pairs, which vector units do in one step: R with G, and B with the B below it,
//! but for the last of a column of odd height, which is alone.

use super::Boundary;
use super::kernel::BLOCK;
use super::pyramid;
use crate::simd::vectorized;
use crate::view::View;
use crate::{Interrupted, Watch};

/// Two codes that are compared together.
pub(super) type Pair = [i16; 2];

/// Which pixels around one are compared, and what stands for those beyond the border.
pub(super) struct Neighbourhood {
    /// Half the disc's width on each of its rows, from the top.
    disc: Vec<usize>,
    pub boundary: Boundary,
}

impl Neighbourhood {
    pub fn new(diameter: usize, boundary: Boundary) -> Self {
        Self { disc: disc(diameter), boundary }
    }

    pub fn diameter(&self) -> usize {
        self.disc.len()
    }

    fn reach(&self) -> usize {
        self.disc.len() / 2
    }

    /// Bytes of what a point's surroundings are compared with, at most.
    pub fn probe_bytes(&self) -> usize {
        2 * self.diameter() * self.diameter() * size_of::<(usize, Pair)>()
    }

    fn holds(&self, dx: usize, dy: usize) -> bool {
        self.disc.get(dy).is_some_and(|wide| dx.abs_diff(self.reach()) <= *wide)
    }
}

/// Half the width of the disc of an odd diameter on each of its rows, from the top.
pub(super) fn disc(diameter: usize) -> Vec<usize> {
    let radius = diameter as isize / 2;
    let holds = |dx: isize, dy: isize| 4 * (dx * dx + dy * dy) <= (diameter * diameter) as isize;
    (-radius..=radius).map(|dy| (0..=radius).rev().find(|&dx| holds(dx, dy)).unwrap_or(0) as usize).collect()
}

/// Codes of R, G and B, without gaps.
pub(super) struct Level {
    pub number: u32,
    pub size: [usize; 2],
    planes: [Vec<u8>; 3],
}

impl Level {
    /// The picture itself.
    pub fn first(planes: &[View<u8>; 3]) -> Self {
        let size = [planes[0].width(), planes[0].height()];
        Self { number: 0, size, planes: planes.map(|plane| plane.rows().collect::<Vec<_>>().concat()) }
    }

    /// The level after it.
    pub fn next(&self, boundary: Boundary, watch: Watch) -> Result<Self, Interrupted> {
        let half = |plane: &Vec<u8>| pyramid::down(&View::packed(plane, self.size[0], self.size[1]), boundary, watch);
        let [r, g, b] = self.planes.each_ref().map(half);
        Ok(Self { number: self.number + 1, size: pyramid::halved(self.size), planes: [r?, g?, b?] })
    }

    pub fn bytes(&self) -> usize {
        bytes(self.size)
    }

    /// Columns of whole blocks.
    pub fn columns(&self) -> usize {
        self.size[0].next_multiple_of(BLOCK)
    }
}

/// Bytes that a level of a size holds.
pub(super) fn bytes([width, height]: [usize; 2]) -> usize {
    3 * width * height
}

/// What the pixels around a point are compared with: from a pixel's place in the pairs to another's, and the point's.
pub(super) type Probe = Vec<(usize, Pair)>;

/// Rows that are laid out together.
pub(super) const ROWS: usize = 16;

/// Some rows of a level with as many pixels around them as a neighbourhood reaches.
pub(super) struct Rows<'a> {
    level: &'a Level,
    around: &'a Neighbourhood,
    /// From a row of pairs to the next.
    stride: usize,
    /// R with G of all rows, then B with the B below, then B alone with nothing.
    pairs: Vec<Pair>,
    /// Columns beyond the border, and those that stand for them.
    beyond: Vec<[usize; 2]>,
}

impl<'a> Rows<'a> {
    pub fn new(level: &'a Level, around: &'a Neighbourhood) -> Self {
        let (reach, width) = (around.reach(), level.size[0]);
        let stride = level.columns() + 2 * reach;
        let inside = |x: usize| [x, reach + around.boundary.inside(x as isize - reach as isize, width)];
        let beyond = (0..reach).chain(reach + width..width + 2 * reach).map(inside).collect();
        Self { level, around, stride, pairs: vec![[0; 2]; 3 * stride * (ROWS + 2 * reach)], beyond }
    }

    /// Bytes that they take.
    pub fn bytes(level: &Level, around: &Neighbourhood) -> usize {
        3 * (level.columns() + 2 * around.reach()) * (ROWS + 2 * around.reach()) * size_of::<Pair>()
    }

    /// Lays out `count` rows, at most [`ROWS`], from `top` on.
    pub fn lay(&mut self, top: usize, count: usize) {
        let (reach, [width, height], part) = (self.around.reach(), self.level.size, self.part());
        let (red_green, blue) = self.pairs.split_at_mut(part);
        let (blue_below, blue_alone) = blue.split_at_mut(part);
        let parts = [red_green, blue_below, blue_alone].map(|part| part.chunks_mut(self.stride));
        let [red_green, blue_below, blue_alone] = parts;
        for (y, ((red_green, blue_below), blue_alone)) in
            (top..top + count + 2 * reach).zip(red_green.zip(blue_below).zip(blue_alone))
        {
            let row = |plane: usize, y: usize| {
                let y = self.around.boundary.inside(y as isize - reach as isize, height);
                &self.level.planes[plane][y * width..][..width]
            };
            let [red, green, blue, below] = [row(0, y), row(1, y), row(2, y), row(2, y + 1)];
            vectorized(
                #[inline(always)]
                || {
                    pair_up(&mut red_green[reach..], red.iter().zip(green).map(|(r, g)| [*r, *g]));
                    pair_up(&mut blue_below[reach..], blue.iter().zip(below).map(|(b, below)| [*b, *below]));
                    pair_up(&mut blue_alone[reach..], blue.iter().map(|b| [*b, 0]));
                },
            );
            for pairs in [red_green, blue_below, blue_alone] {
                self.beyond.iter().for_each(|[at, from]| pairs[*at] = pairs[*from]);
            }
        }
    }

    /// The pairs from the first pixel of a laid row on.
    pub fn row(&self, number: usize) -> &[Pair] {
        &self.pairs[number * self.stride..]
    }

    /// What is compared with a pixel's surroundings, (`x`, `y`) being the pixel of level 0. Lays out its row.
    pub fn probe(&mut self, [x, y]: [usize; 2]) -> Probe {
        let (x, side) = (x >> self.level.number, self.around.diameter());
        self.lay(y >> self.level.number, 1);
        let holds = |dx: usize, dy: usize| self.around.holds(dx, dy);
        let mut offsets = Vec::new();
        for (dx, dy) in (0..side).flat_map(|dy| (0..side).map(move |dx| (dx, dy))).filter(|(dx, dy)| holds(*dx, *dy)) {
            let at = dy * self.stride + dx;
            offsets.push(at);
            let top = (0..dy).find(|dy| holds(dx, *dy)).unwrap_or(dy);
            if (dy - top).is_multiple_of(2) {
                offsets.push(at + self.part() * if holds(dx, dy + 1) { 1 } else { 2 });
            }
        }
        offsets.into_iter().map(|offset| (offset, self.pairs[offset + x])).collect()
    }

    /// From pairs of one kind to those of the next.
    fn part(&self) -> usize {
        self.pairs.len() / 3
    }
}

#[inline(always)]
fn pair_up(out: &mut [Pair], codes: impl Iterator<Item = [u8; 2]>) {
    out.iter_mut().zip(codes).for_each(|(out, codes)| *out = codes.map(i16::from));
}
