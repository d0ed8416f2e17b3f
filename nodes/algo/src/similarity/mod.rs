//! How alike pixels' surroundings are (Brooks, Dodgson 2002).
//!
//! What depends on the picture alone is a [`Guide`]; a new point costs one square per pixel, channel and member of the
//! neighbourhood. All sums are of whole numbers: their order, and so threads and vectors, cannot matter.

mod codes;
mod kernel;
mod level;
mod pyramid;
mod quantile;

pub use codes::codes;
pub use quantile::quantile;

use rayon::prelude::*;

use crate::room::Room;
use crate::simd::vectorized;
use crate::steps::Steps;
use crate::view::{View, ViewMut};
use crate::{Interrupted, Watch};
use level::{Level, Neighbourhood, Pair, Probe, ROWS, Rows};

/// What lies beyond the picture's border.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Boundary {
    /// The other side: the picture is a tile.
    Wrap,
    /// The picture mirrored at its outermost pixels, which are not repeated.
    Mirror,
    /// The outermost pixel.
    Clamp,
}

/// Greatest diameter of a neighbourhood, px.
pub const MOST_DIAMETER: usize = 21;

/// Coarsest level of any picture.
pub const COARSEST: u32 = 12;

/// The coarsest level that serves a picture: its pixels lie at most twice as far apart as the longer side is long.
pub fn coarsest(size: [usize; 2]) -> u32 {
    (size[0].max(size[1]).max(1).ilog2() + 1).min(COARSEST)
}

/// A picture made ready for comparisons with any of its pixels.
pub struct Guide {
    size: [usize; 2],
    around: Neighbourhood,
    /// Finest first.
    levels: Vec<Level>,
}

impl Guide {
    /// Columns and rows.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Diameter of neighbourhoods, px of each level.
    pub fn diameter(&self) -> usize {
        self.around.diameter()
    }

    /// Memory it holds.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(Level::bytes).sum()
    }
}

/// Makes a picture ready for comparisons.
///
/// Level 0 is the picture; level n + 1 is level n after the filter [1 4 6 4 1] / 16 along both axes, rounded to whole
/// codes, even columns and rows kept. A neighbourhood is the pixels at distances of 4 (dx^2 + dy^2) <= diameter^2: 21 of
/// them for a diameter of 5, 69 for 9.
///
/// - `planes`: R, G, B as codes 0..=255, any size, see [`codes`](codes()).
/// - `diameter`: odd, 1..=[`MOST_DIAMETER`] (asserted), px of each level.
/// - `levels`: at least one, no number twice, each at most [`coarsest`] (asserted).
/// - `boundary`: what lies beyond the border, for the filter and for neighbourhoods.
/// - `watch`: asked for the memory taken, and now and then whether to go on.
///
/// A picture without pixels gives a guide without pixels. With [`Boundary::Wrap`] a side that a level halves although it
/// is odd is no tile on that level.
///
/// Cost: linear; the guide holds three bytes per pixel of the levels listed.
///
/// S. Brooks and N. Dodgson, "Self-similarity based texture editing", SIGGRAPH 2002, section 3. P. Burt and E. Adelson
/// 1983 (the filter).
pub fn guide(
    planes: &[View<u8>; 3],
    diameter: usize,
    levels: &[u32],
    boundary: Boundary,
    watch: Watch,
) -> Result<Guide, Interrupted> {
    let size = [planes[0].width(), planes[0].height()];
    assert!(planes.iter().all(|plane| [plane.width(), plane.height()] == size), "planes of one size");
    assert!(diameter % 2 == 1 && diameter <= MOST_DIAMETER, "diameter {diameter}");
    let mut wanted = levels.to_vec();
    wanted.sort_unstable();
    assert!(!wanted.is_empty() && wanted.windows(2).all(|pair| pair[0] < pair[1]), "levels {levels:?}");
    let last = wanted[wanted.len() - 1];
    assert!(last <= coarsest(size), "level {last} of {size:?}");
    let mut guide = Guide { size, around: Neighbourhood::new(diameter, boundary), levels: Vec::new() };
    if size.contains(&0) {
        return Ok(guide);
    }
    let mut room = Room::new(watch);
    room.phase(level::bytes(size))?;
    let mut level = Level::first(planes);
    for number in 0..last {
        room.phase(guide.bytes() + level.bytes() + level::bytes(pyramid::halved(level.size)))?;
        let next = level.next(boundary, watch)?;
        let done = std::mem::replace(&mut level, next);
        if wanted.contains(&number) {
            guide.levels.push(done);
        }
    }
    guide.levels.push(level);
    Ok(guide)
}

/// How unlike the surroundings of each pixel are to those of the nearest of some points.
///
/// D(x, y) = min over points s of sum over levels n of D_n(x >> n, y >> n), with D_n(p) = sum over the neighbourhood's
/// offsets o and R, G, B of (I_n(p + o) - I_n((s >> n) + o))^2: the paper's scale. Levels count the same.
///
/// - `guide`: the picture made ready.
/// - `points`: columns and rows of pixels of it, at least one (asserted); a repeated one changes nothing.
/// - `out`: of the picture's size (asserted); every sample is written. Exact up to 2^24, then the nearest f32.
/// - `watch`: asked for the memory taken, told the part done. On `Interrupted`, `out` is partly written.
///
/// Where no level is level 0 blocks of pixels have one distance. The points themselves have 0. A picture without pixels
/// has no points.
///
/// Cost: per point and level, the level's pixels times 3 times the neighbourhood's differences, squares and sums. The
/// result does not depend on the count of threads.
///
/// S. Brooks and N. Dodgson, "Self-similarity based texture editing", SIGGRAPH 2002, section 3.
pub fn distances(guide: &Guide, points: &[[usize; 2]], out: ViewMut<f32>, watch: Watch) -> Result<(), Interrupted> {
    assert!(!points.is_empty() && [out.width(), out.height()] == guide.size, "points, and the guide's size");
    assert!(points.iter().all(|[x, y]| *x < guide.size[0] && *y < guide.size[1]), "points lie in the picture");
    let [finest, coarser @ ..] = &guide.levels[..] else { unreachable!("a picture with points has a level") };
    let maps = coarser.iter().map(|level| level.columns() * level.size[1] * size_of::<i32>()).sum::<usize>();
    let rows = Rows::bytes(finest, &guide.around) * (rayon::current_num_threads() + 1);
    watch.reserve(points.len().saturating_mul(maps + guide.around.probe_bytes()).saturating_add(rows))?;
    let points = compared(guide, points, watch)?;
    // Rows of the finest level that are made together.
    let together = (ROWS >> finest.number).max(1);
    let bands = out.bands(together << finest.number);
    let steps = Steps::new(watch, bands.len());
    let scratch = || (Rows::new(finest, &guide.around), [vec![0; finest.columns()], vec![0; finest.columns()]]);
    bands.into_par_iter().try_for_each_init(scratch, |(rows, [least, other]), (top, mut out)| {
        let top = top >> finest.number;
        let count = out.height().div_ceil(1 << finest.number);
        rows.lay(top, count);
        for row in 0..count {
            let (first, more) = points.split_first().expect("there are points");
            first.row(finest, top + row, rows.row(row), least);
            for point in more {
                point.row(finest, top + row, rows.row(row), other);
                least.iter_mut().zip(&*other).for_each(|(least, other)| *least = (*least).min(*other));
            }
            for at in (row << finest.number..out.height()).take(1 << finest.number) {
                let out = out.row_mut(at);
                vectorized(
                    #[inline(always)]
                    || widen(least, finest.number, out, |out, distance| *out = distance as f32),
                );
            }
        }
        steps.step()
    })
}

/// A point, and the distances from it on coarser levels.
struct Point<'a> {
    /// Of the finest level.
    probe: Probe,
    coarser: Vec<(&'a Level, Vec<i32>)>,
}

/// Points as they are compared.
fn compared<'a>(guide: &'a Guide, points: &[[usize; 2]], watch: Watch) -> Result<Vec<Point<'a>>, Interrupted> {
    let [finest, coarser @ ..] = &guide.levels[..] else { unreachable!("a picture with points has a level") };
    let mut rows = Rows::new(finest, &guide.around);
    let at_point = |point: &[usize; 2]| {
        let coarser = coarser.iter().map(|level| Ok((level, on_level(level, &guide.around, *point, watch)?)));
        Ok(Point { probe: rows.probe(*point), coarser: coarser.collect::<Result<_, Interrupted>>()? })
    };
    points.iter().map(at_point).collect()
}

/// The distances of all pixels of a level from a point, rows of whole blocks.
fn on_level(level: &Level, around: &Neighbourhood, point: [usize; 2], watch: Watch) -> Result<Vec<i32>, Interrupted> {
    let columns = level.columns();
    let mut out = vec![0; columns * level.size[1]];
    let probe = Rows::new(level, around).probe(point);
    let bands = out.par_chunks_mut(columns * ROWS).enumerate();
    bands.try_for_each_init(
        || Rows::new(level, around),
        |rows, (band, out)| {
            rows.lay(band * ROWS, out.len() / columns);
            out.chunks_mut(columns).enumerate().for_each(|(row, out)| kernel::row(rows.row(row), &probe, out));
            watch.go_on()
        },
    )?;
    Ok(out)
}

impl Point<'_> {
    /// The distances from it on row `y` of the finest level, of which there are `pairs`.
    fn row(&self, finest: &Level, y: usize, pairs: &[Pair], out: &mut [i32]) {
        kernel::row(pairs, &self.probe, out);
        for (level, distances) in &self.coarser {
            let shift = level.number - finest.number;
            let row = &distances[(y >> shift) * level.columns()..][..level.columns()];
            vectorized(
                #[inline(always)]
                || widen(row, shift, out, |out, distance| *out += distance),
            );
        }
    }
}

/// Hands each number to as many pixels as its level's are wide.
#[inline(always)]
fn widen<T>(numbers: &[i32], level: u32, out: &mut [T], hand: impl Fn(&mut T, i32)) {
    match level {
        0 => out.iter_mut().zip(numbers).for_each(|(out, number)| hand(out, *number)),
        1 => {
            let (out, rest) = out.as_chunks_mut::<2>();
            rest.iter_mut().zip(&numbers[out.len()..]).for_each(|(out, number)| hand(out, *number));
            out.iter_mut().zip(numbers).for_each(|(out, number)| out.iter_mut().for_each(|out| hand(out, *number)));
        }
        _ => out
            .chunks_mut(1 << level)
            .zip(numbers)
            .for_each(|(out, number)| out.iter_mut().for_each(|out| hand(out, *number))),
    }
}

/// How strongly an edit is repeated at each pixel.
///
/// a = strength max(0, 1 - D / threshold); with a threshold of 0, strength where D is 0 and 0 elsewhere.
///
/// - `distances`: D, see [`distances`](distances()), any size.
/// - `threshold`: the distance from which on nothing happens, at least 0 (asserted).
/// - `strength`: a where D is 0, finite; negative contracts where positive magnifies.
/// - `out`: of the same size (asserted); every sample is written.
///
/// Where D is 0 a is `strength`, whatever the threshold is.
///
/// Cost: linear, rows side by side.
///
/// S. Brooks and N. Dodgson, "Self-similarity based texture editing", SIGGRAPH 2002, section 3.
pub fn opacity(distances: View<f32>, threshold: f32, strength: f32, out: ViewMut<f32>) {
    assert_eq!([distances.width(), distances.height()], [out.width(), out.height()], "sizes differ");
    assert!(threshold >= 0.0, "threshold {threshold}");
    out.par_rows(|y, out| {
        let distances = distances.row(y);
        vectorized(
            #[inline(always)]
            || {
                let (threshold, strength) = (threshold, strength);
                for (out, &distance) in out.iter_mut().zip(distances) {
                    let part = if distance == 0.0 { 1.0 } else { 1.0 - distance / threshold };
                    let repeated = strength * part;
                    *out = if part > 0.0 { repeated } else { 0.0 };
                }
            },
        );
    });
}

#[cfg(test)]
mod tests;
