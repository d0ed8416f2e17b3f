//! One band of rows: its runs, and the parts of components that they form.

use super::extent::Extent;
use super::lanes::{Lanes, WORD, Work, with_lanes};
use super::paint::Paint;
use super::runs::{Run, find_runs, row_bits, touching};
use super::unions::Unions;
use crate::view::{View, ViewMut};

/// No name yet.
const NONE: u32 = u32::MAX;

/// The runs of a band of rows and the parts of components that are connected within the band.
///
/// A run has the name of a run that touches it from above, or a new one. Names are numbered in raster order; those whose
/// runs meet name one part. Until it is painted, each row of the output begins with the names of its runs.
pub(super) struct Band<'a> {
    /// Bits of the rows, [`words`] per row.
    bits: Vec<u64>,
    /// Names of the runs of the first and the last row.
    pub(super) edges: [Vec<u32>; 2],
    /// The part of each name; parts are numbered in the order of their first names.
    pub(super) parts: Vec<u32>,
    /// Extent of each part.
    pub(super) extents: Vec<Extent>,
    out: ViewMut<'a, u32>,
}

/// Words that hold the bits of a row.
fn words(width: usize) -> usize {
    width.div_ceil(WORD)
}

impl<'a> Band<'a> {
    /// Finds the runs of the rows from `top` on that `out` has, and the parts that they form.
    pub(super) fn scan(mask: View<f32>, top: usize, corners: bool, out: ViewMut<'a, u32>) -> Self {
        with_lanes(Scan { mask, top, corners, out })
    }

    /// Bytes it holds.
    pub(super) fn bytes(&self) -> usize {
        let names = self.parts.capacity() + self.edges.iter().map(Vec::capacity).sum::<usize>();
        size_of_val(&*self.bits) + names * size_of::<u32>() + self.extents.capacity() * size_of::<Extent>()
    }

    /// Bits of the first row.
    pub(super) fn first_bits(&self) -> &[u64] {
        &self.bits[..words(self.out.width())]
    }

    /// Bits of the last row.
    pub(super) fn last_bits(&self) -> &[u64] {
        &self.bits[self.bits.len() - words(self.out.width())..]
    }

    /// Writes the label of its part into each pixel of each run, 0 elsewhere.
    pub(super) fn paint(self, labels: &[u32]) {
        let labels: Vec<u32> = self.parts.iter().map(|&part| labels[part as usize]).collect();
        with_lanes(Paint { bits: &self.bits, labels: &labels, out: self.out });
    }
}

struct Scan<'m, 'a> {
    mask: View<'m, f32>,
    top: usize,
    corners: bool,
    out: ViewMut<'a, u32>,
}

impl<'a> Work for Scan<'_, 'a> {
    type Result = Band<'a>;

    #[inline(always)]
    fn with<L: Lanes>(mut self, lanes: L) -> Band<'a> {
        let (width, height) = (self.out.width(), self.out.height());
        let words = words(width);
        let mut bits = vec![0; height * words];
        let (mut pairs, mut ends) = (vec![[0; 2]; words * WORD], vec![0; width + 1]);
        let (mut first, mut above, mut names) = (Vec::new(), Vec::new(), Vec::new());
        let mut named = Named::default();
        // All rows at first: memory is quicker read in one go.
        for (y, row) in bits.chunks_mut(words).enumerate() {
            row_bits(lanes, self.mask.row(self.top + y), row);
        }
        for y in 0..height {
            let row = &bits[y * words..][..words];
            let runs = find_runs(row, width, &mut ends);
            names.clear();
            names.resize(runs.len(), NONE);
            if y > 0 {
                let pairs = touching(&bits[(y - 1) * words..][..words], row, self.corners, &mut pairs);
                named.pass_down(pairs, &above, &mut names);
            }
            named.measure(runs, (self.top + y) as u32, &mut names);
            self.out.row_mut(y)[..names.len()].copy_from_slice(&names);
            if y == 0 {
                first.clone_from(&names);
            }
            std::mem::swap(&mut above, &mut names);
        }
        let (parts, extents) = named.into_parts();
        Band { bits, edges: [first, above], parts, extents, out: self.out }
    }
}

/// Names of runs.
#[derive(Default)]
struct Named {
    unions: Unions,
    /// Extent of the runs of each name.
    extents: Vec<Extent>,
}

impl Named {
    /// Gives runs below names of those above that they touch, and unites what meets.
    #[inline(always)]
    fn pass_down(&mut self, pairs: &[[u32; 2]], above: &[u32], below: &mut [u32]) {
        // The last name is kept at hand: to load what was just stored takes long.
        let (mut run, mut known) = (NONE, NONE);
        for &[a, b] in pairs {
            let name = self.unions.parent(above[a as usize]);
            let again = b == run;
            if again & (name != known) {
                self.unions.join(name, known);
            }
            known = if again { known } else { name };
            run = b;
            below[b as usize] = known;
        }
    }

    /// Adds the runs of row `y` to the extents of their names; those without get new ones.
    #[inline(always)]
    fn measure(&mut self, runs: &[Run], y: u32, names: &mut [u32]) {
        for (name, &run) in names.iter_mut().zip(runs) {
            let extent = Extent::of_run(run, y);
            if *name == NONE {
                *name = self.unions.add();
                self.extents.push(extent);
            } else {
                self.extents[*name as usize].merge(&extent);
            }
        }
    }

    /// The part of each name and the extents of the parts.
    fn into_parts(self) -> (Vec<u32>, Vec<Extent>) {
        let (parts, mut extents) = (self.unions.into_sets(), self.extents);
        let mut count = 0;
        for (name, &part) in parts.iter().enumerate() {
            let extent = extents[name];
            if part as usize == count {
                extents[count] = extent;
                count += 1;
            } else {
                extents[part as usize].merge(&extent);
            }
        }
        extents.truncate(count);
        extents.shrink_to_fit();
        (parts, extents)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::components::lanes::with_each;

    #[derive(Clone, Copy)]
    struct Whole<'m>(View<'m, f32>);

    impl Work for Whole<'_> {
        type Result = (Vec<u64>, [Vec<u32>; 2], Vec<u32>, Vec<u32>);

        #[inline(always)]
        fn with<L: Lanes>(self, lanes: L) -> Self::Result {
            let (width, height) = (self.0.width(), self.0.height());
            let mut out = vec![7; width * height];
            let view = ViewMut::packed(&mut out, width, height);
            let Band { bits, edges, parts, out: view, .. } =
                Scan { mask: self.0, top: 0, corners: true, out: view }.with(lanes);
            Paint { bits: &bits, labels: &parts, out: view }.with(lanes);
            (bits, edges, parts, out)
        }
    }

    #[test]
    fn all_lanes_give_the_same() {
        for width in [1, 63, 64, 65, 200] {
            let samples: Vec<f32> =
                (0..width * 20).map(|i: usize| (i.wrapping_mul(2_654_435_761) >> 9 & 7) as f32).collect();
            let mask: Vec<f32> =
                samples.iter().map(|&sample| if sample == 7.0 { f32::NAN } else { sample / 5.0 }).collect();
            let found = with_each(Whole(View::packed(&mask, width, 20)));
            assert!(found.iter().all(|one| *one == found[0]), "{width}");
        }
    }
}
