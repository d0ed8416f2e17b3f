//! Sources for all pixels at once, from coarse to fine: no result depends on the order of pixels.

use rayon::prelude::*;

use super::Target;
use super::look::{Look, distance, ring, smooth};
use super::picture::{Picture, each, pyramid};
use super::similar::{Level, SimilarSets};
use super::tree::Tree;
use crate::{Interrupted, Watch};

/// Bytes per pixel of the training picture: blurred planes, their colours and looks, and a tree of a quarter of these.
pub(super) const BYTES: usize = 12 + 16 + size_of::<Look>() + (2 * size_of::<Look>() + 16) / 4;

/// How often every pixel of a level chooses anew.
const PASSES: u8 = 2;

/// Of which rows and columns the constraint alone finds pixels, but on the coarsest level: one in so many.
const THINNED: usize = 2;

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
    let mut coarser: Option<Chosen> = None;
    for (number, ((level, training), constraint)) in sets.levels.iter().zip(training).zip(constraint).enumerate().rev()
    {
        watch.progress(0.25_f64.powi(number as i32 + 1))?;
        let matching = Matching {
            level,
            training: smooth(&training, |_, _| true, watch)?,
            constraint: smooth(&constraint, |x, y| target.is_wanted(x, y, number), watch)?,
            penalty: 1.0 + coherence * 0.5_f32.powi(number as i32),
        };
        let mut chosen = matching.begin(target, number, constraint, coarser, watch)?;
        for turn in 0..4 * PASSES {
            matching.choose(&mut chosen, turn, watch)?;
        }
        coarser = Some(chosen);
    }
    Ok(coarser.map(|chosen| chosen.sources).unwrap_or_default())
}

/// What a level's choices rest on.
struct Matching<'a> {
    level: &'a Level,
    /// Smooth looks of the blurred training picture, and of the constraint where it is wanted.
    training: Vec<Look>,
    constraint: Vec<Look>,
    /// By what the cost of a source is multiplied that continues no neighbour's.
    penalty: f32,
}

/// Choices of a level.
struct Chosen {
    /// Where each pixel is taken from; none where the constraint stays.
    sources: Vec<Option<u32>>,
    /// What that looks like.
    picture: Picture,
    /// For each pixel that is wanted, where it begins, and sources that are tried besides: by the warp and by the
    /// constraint.
    tried: Vec<Option<[u32; 3]>>,
    /// The sub-pass after which each pixel last had another source, counted from 1; 0 for none.
    changed: Vec<u8>,
    /// Width of the training picture.
    training_width: usize,
}

impl Chosen {
    /// The source on the finer level of the pixel there at (x, y), by what its pixel on this level has chosen.
    fn finer(&self, x: usize, y: usize, training: &Picture) -> Option<u32> {
        let source = self.sources[y / 2 * self.picture.width + x / 2]? as usize;
        let [across, down] = [source % self.training_width, source / self.training_width];
        let across = (2 * across + x % 2).min(training.width - 1);
        let down = (2 * down + y % 2).min(training.height - 1);
        Some((down * training.width + across) as u32)
    }
}

impl Chosen {
    /// Whether a pixel or one beside it changed in a sub-pass or after it.
    fn changed_since(&self, turn: u8, x: usize, y: usize) -> bool {
        let [width, height] = [self.picture.width, self.picture.height];
        let columns = x.saturating_sub(1)..width.min(x + 2);
        let mut rows = y.saturating_sub(1)..height.min(y + 2);
        rows.any(|y| self.changed[y * width..][columns.clone()].iter().any(|&changed| changed > turn))
    }
}

impl Matching<'_> {
    /// What the coarser level or the warp says, whichever is more alike; else what the constraint alone says.
    fn begin(
        &self,
        target: &Target,
        number: usize,
        mut picture: Picture,
        coarser: Option<Chosen>,
        watch: Watch,
    ) -> Result<Chosen, Interrupted> {
        let training = &self.level.picture;
        let some: Vec<u32> = self.some(if coarser.is_some() { THINNED } else { 1 });
        let looks: Vec<Look> = some.par_iter().map(|&pixel| self.training[pixel as usize]).collect();
        let tree = Tree::new(&looks, watch)?;
        let (width, height) = (picture.width, picture.height);
        let begin = |pixel: usize| {
            let [x, y] = [pixel % width, pixel / width];
            target.is_wanted(x, y, number).then(|| {
                let near = some[tree.near(&self.constraint[pixel]) as usize];
                let by_warp = target.start(x, y, number, training);
                let finer = coarser.as_ref().and_then(|coarser| coarser.finer(x, y, training));
                let of_both = finer.into_iter().chain(by_warp).map(|source| (self.unlike(pixel, source), source));
                let first = of_both.fold((f32::INFINITY, near), |a, b| if b.0 < a.0 { b } else { a });
                [first.1, by_warp.unwrap_or(near), near]
            })
        };
        let tried: Vec<Option<[u32; 3]>> = each(width, height, watch, begin)?;
        let sources: Vec<_> = tried.par_iter().map(|tried| tried.map(|[first, ..]| first)).collect();
        picture.colours.par_iter_mut().zip(&sources).for_each(|(colour, source)| {
            *colour = source.map_or(*colour, |source| training.colours[source as usize]);
        });
        let changed = vec![0; sources.len()];
        Ok(Chosen { sources, picture, tried, changed, training_width: training.width })
    }

    /// Every `step`-th pixel of every `step`-th row of the training picture.
    fn some(&self, step: usize) -> Vec<u32> {
        let training = &self.level.picture;
        let rows = (0..training.height).step_by(step);
        rows.flat_map(|y| (0..training.width).step_by(step).map(move |x| (y * training.width + x) as u32)).collect()
    }

    /// How unlike the constraint at a pixel the blurred training picture is at a source.
    fn unlike(&self, pixel: usize, source: u32) -> f32 {
        distance(&self.constraint[pixel], &self.training[source as usize])
    }

    /// The pixels of every other row and column choose, seeing what all had chosen before; but not those around which
    /// nothing changed since they last did.
    fn choose(&self, chosen: &mut Chosen, turn: u8, watch: Watch) -> Result<(), Interrupted> {
        let (width, height) = (chosen.picture.width, chosen.picture.height);
        let [left, top] = [turn & 1, turn >> 1 & 1].map(usize::from);
        let rows = (top..height).into_par_iter().step_by(2).map(|y| {
            let chooses =
                |x: usize| chosen.tried[y * width + x].is_some() && (turn < 4 || chosen.changed_since(turn - 4, x, y));
            let pixels = (left..width).step_by(2).filter(|&x| chooses(x));
            let changed = pixels.map(|x| (y * width + x, self.best(chosen, x, y)));
            let changed: Vec<_> = changed.filter(|&(pixel, best)| chosen.sources[pixel] != Some(best)).collect();
            watch.go_on().map(|()| changed)
        });
        for (pixel, best) in rows.collect::<Result<Vec<_>, _>>()?.into_iter().flatten() {
            chosen.sources[pixel] = Some(best);
            chosen.changed[pixel] = turn + 1;
            chosen.picture.colours[pixel] = self.level.picture.colours[best as usize];
        }
        Ok(())
    }

    /// The best source for a pixel: of those that continue its neighbours', of pixels similar to these, of what is
    /// tried besides. Of equals the lowest.
    fn best(&self, chosen: &Chosen, x: usize, y: usize) -> u32 {
        let pixel = y * chosen.picture.width + x;
        let (constraint, sharp) = (&self.constraint[pixel], ring(&chosen.picture, x, y));
        let mut best = (f32::INFINITY, u32::MAX);
        let mut take = |source: u32, factor: f32| {
            let at = source as usize;
            let smooth = distance(constraint, &self.training[at]);
            if factor * smooth > best.0 {
                return;
            }
            let unlike = smooth + distance(&sharp, &self.level.rings[at]);
            best = if (factor * unlike, source) < best { (factor * unlike, source) } else { best };
        };
        let (mut seen, mut seen_count) = ([0; 9], 0);
        for (dx, dy) in NEIGHBOURS {
            let beside = chosen.picture.pixel(x as isize + dx, y as isize + dy);
            let source = beside.and_then(|beside| chosen.sources[beside]);
            let Some(source) = source.and_then(|source| self.level.picture.beside(source as usize, -dx, -dy)) else {
                continue;
            };
            if !seen[..seen_count].contains(&source) {
                seen[seen_count] = source;
                seen_count += 1;
                take(source as u32, 1.0);
                self.level.similar[source].iter().for_each(|&similar| take(similar, self.penalty));
            }
        }
        chosen.tried[pixel].iter().flat_map(|[_, others @ ..]| others).for_each(|&source| take(source, self.penalty));
        best.1
    }
}

/// A pixel's neighbours and itself.
const NEIGHBOURS: [(isize, isize); 9] = [(0, 0), (-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
