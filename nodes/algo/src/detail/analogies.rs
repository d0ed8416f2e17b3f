//! Image Analogies as published: pixel after pixel in raster order, coarse to fine.

use rayon::prelude::*;

use super::Target;
use super::look::distance;
use super::picture::{Picture, pyramid};
use super::similar::SimilarSets;
use super::tree::Tree;
use crate::{Interrupted, Watch};

/// Numbers of a neighbourhood: 25 + 12 of its own level, 9 + 9 of the coarser one, and a zero that fills the lane.
const NUMBERS: usize = 56;
type Neighbourhood = [f32; NUMBERS];

/// Bytes per pixel of the training picture: blurred planes, their pyramid, neighbourhoods and their tree.
pub(super) const BYTES: usize = 12 + 16 * 4 / 3 + 2 * size_of::<Neighbourhood>() + 5;

/// The pixels of 5 x 5 that come before the middle one in raster order.
const BEFORE: [(isize, isize); 12] =
    [(-2, -2), (-1, -2), (0, -2), (1, -2), (2, -2), (-2, -1), (-1, -1), (0, -1), (1, -1), (2, -1), (-2, 0), (-1, 0)];

/// The source in the training picture of each wanted pixel of `target`.
pub(super) fn sources(
    sets: &SimilarSets,
    blurred: &[Vec<f32>; 3],
    target: &Target,
    coherence: f32,
    watch: Watch,
) -> Result<Vec<Option<u32>>, Interrupted> {
    let count = sets.levels.len();
    let training = pyramid(blurred, sets.width, sets.height, count, watch)?;
    let constraint = pyramid(&target.planes, target.width, target.height, count, watch)?;
    let mut filtered = pyramid(&target.planes, target.width, target.height, count, watch)?;
    let weights = Weights::new();
    let mut sources = Vec::new();
    for number in (0..count).rev() {
        let (finer, coarser) = filtered.split_at_mut(number + 1);
        let sharp = &sets.levels[number].picture;
        let blurred = Pair {
            plain: &training[number],
            coarser: training.get(number + 1).zip(sets.levels.get(number + 1).map(|level| &level.picture)),
            weights: &weights,
        };
        let known = Pair {
            plain: &constraint[number],
            coarser: constraint.get(number + 1).zip(coarser.first()),
            weights: &weights,
        };
        let scan = Scan {
            sharp,
            neighbourhoods: (0..sharp.colours.len())
                .into_par_iter()
                .map(|pixel| blurred.around(sharp, pixel))
                .collect(),
            known,
            penalty: 1.0 + coherence * 0.5_f32.powi(number as i32),
        };
        let tree = Tree::new(&scan.neighbourhoods, watch)?;
        let wanted = |x, y| target.is_wanted(x, y, number);
        sources = scan.run(&tree, &mut finer[number], wanted, &|part| {
            watch.progress(0.25_f64.powi(number as i32) * (0.25 + 0.75 * part))
        })?;
    }
    Ok(sources)
}

/// Gaussian weights of the parts of a neighbourhood, each part's sum 1, as their roots.
struct Weights {
    five: [f32; 25],
    before: [f32; 12],
    three: [f32; 9],
}

impl Weights {
    fn new() -> Self {
        let five: [_; 25] = std::array::from_fn(|i| (i as isize % 5 - 2, i as isize / 5 - 2));
        let three: [_; 9] = std::array::from_fn(|i| (i as isize % 3 - 1, i as isize / 3 - 1));
        Self { five: roots(five, 1.25), before: roots(BEFORE, 1.25), three: roots(three, 0.75) }
    }
}

fn roots<const N: usize>(offsets: [(isize, isize); N], deviation: f64) -> [f32; N] {
    let gauss = offsets.map(|(dx, dy)| libm::exp(-((dx * dx + dy * dy) as f64) / (2.0 * deviation * deviation)));
    let sum: f64 = gauss.iter().sum();
    gauss.map(|weight| (weight / sum).sqrt() as f32)
}

/// An unfiltered picture, and both pictures of the coarser level.
struct Pair<'a> {
    plain: &'a Picture,
    coarser: Option<(&'a Picture, &'a Picture)>,
    weights: &'a Weights,
}

impl Pair<'_> {
    /// The neighbourhood of a pixel. Where a pixel before it lies outside, its mirror image may not be made yet:
    /// there the unfiltered picture speaks for the filtered one.
    fn around(&self, filtered: &Picture, pixel: usize) -> Neighbourhood {
        let [x, y] = [pixel % self.plain.width, pixel / self.plain.width].map(|at| at as isize);
        let mut numbers = [0.0; NUMBERS];
        let (five, rest) = numbers.split_at_mut(25);
        let (before, rest) = rest.split_at_mut(12);
        for (i, (number, weight)) in five.iter_mut().zip(self.weights.five).enumerate() {
            *number = weight * self.plain.luma(x + i as isize % 5 - 2, y + i as isize / 5 - 2);
        }
        for ((number, weight), (dx, dy)) in before.iter_mut().zip(self.weights.before).zip(BEFORE) {
            let inside = self.plain.pixel(x + dx, y + dy);
            *number = weight * inside.map_or_else(|| self.plain.luma(x + dx, y + dy), |at| filtered.colours[at][0]);
        }
        let coarser = self.coarser.into_iter().flat_map(|(plain, filtered)| [plain, filtered]);
        for (picture, numbers) in coarser.zip(rest.chunks_mut(9)) {
            for (i, (number, weight)) in numbers.iter_mut().zip(self.weights.three).enumerate() {
                *number = weight * picture.luma(x / 2 + i as isize % 3 - 1, y / 2 + i as isize / 3 - 1);
            }
        }
        numbers
    }
}

/// A level to be scanned.
struct Scan<'a> {
    /// The training picture, and each pixel's neighbourhood.
    sharp: &'a Picture,
    neighbourhoods: Vec<Neighbourhood>,
    known: Pair<'a>,
    /// How much farther a source may be that continues a neighbour's.
    penalty: f32,
}

impl Scan<'_> {
    fn run(
        &self,
        tree: &Tree<NUMBERS>,
        filtered: &mut Picture,
        wanted: impl Fn(usize, usize) -> bool,
        progress: &dyn Fn(f64) -> Result<(), Interrupted>,
    ) -> Result<Vec<Option<u32>>, Interrupted> {
        let mut sources = vec![None; filtered.colours.len()];
        for y in 0..filtered.height {
            progress(y as f64 / filtered.height as f64)?;
            for x in (0..filtered.width).filter(|&x| wanted(x, y)) {
                let pixel = y * filtered.width + x;
                let around = self.known.around(filtered, pixel);
                let unlike = |source: u32| distance(&around, &self.neighbourhoods[source as usize]);
                let nearest = tree.nearest(&around);
                let continued = BEFORE.iter().filter_map(|&(dx, dy)| {
                    let before = sources[filtered.beside(pixel, dx, dy)?]?;
                    let source = self.sharp.beside(before as usize, -dx, -dy)? as u32;
                    Some((unlike(source), source))
                });
                let coherent = continued.fold((f32::INFINITY, nearest), |a, b| if b < a { b } else { a });
                let source = if coherent.0 <= self.penalty * unlike(nearest) { coherent.1 } else { nearest };
                sources[pixel] = Some(source);
                filtered.colours[pixel] = self.sharp.colours[source as usize];
            }
        }
        Ok(sources)
    }
}
