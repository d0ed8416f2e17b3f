//! A tree of points for finding near ones: each cut halves the points along the axis of their largest spread.

use std::ops::Range;

use super::look::distance;
use crate::{Interrupted, Watch};

/// Points that a leaf holds at most, but for one.
pub(super) const LEAF: usize = 24;

/// Cuts with more points than this are made side by side.
const SHARED: usize = 4096;

/// How many times nearer than what was found a point may be overlooked, squared: once more the distance.
const SLACK: f32 = 4.0;

/// A cut; a point whose coordinate on `axis` is at least `at` belongs to the upper half, one that equals it to either.
#[derive(Clone, Copy, Default)]
struct Cut {
    axis: u32,
    at: f32,
}

/// Points, cut in halves `depth` times.
pub(super) struct Tree<const D: usize> {
    /// A cut, then all of its lower half, then all of its upper half.
    cuts: Vec<Cut>,
    depth: u32,
    /// The points' numbers, leaf by leaf.
    pub order: Vec<u32>,
    /// The points in that order.
    pub points: Vec<[f32; D]>,
}

impl<const D: usize> Tree<D> {
    /// The tree of some points, all finite.
    pub fn new(points: &[[f32; D]], watch: Watch) -> Result<Self, Interrupted> {
        let mut depth = 0;
        while points.len() >> depth > LEAF {
            depth += 1;
        }
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let mut cuts = vec![Cut::default(); (1 << depth) - 1];
        cut(points, &mut order, &mut vec![0; points.len()], &mut cuts, watch)?;
        let points = order.iter().map(|&number| points[number as usize]).collect();
        Ok(Self { cuts, depth, order, points })
    }

    /// How many leaves there are.
    pub fn leaf_count(&self) -> usize {
        1 << self.depth
    }

    /// Which of the points, as they are ordered, a leaf holds.
    pub fn leaf(&self, number: usize) -> Range<usize> {
        let halves = (0..self.depth).rev().map(|level| number >> level & 1 == 1);
        halves.fold(0..self.order.len(), half)
    }

    /// The nearest point of the leaf that the query falls in; of equals the lowest number.
    pub fn near(&self, query: &[f32; D]) -> u32 {
        let (mut at, mut size, mut range) = (0, self.cuts.len(), 0..self.order.len());
        while size > 0 {
            let upper = query[self.cuts[at].axis as usize] >= self.cuts[at].at;
            (at, size, range) = (at + 1 + if upper { size / 2 } else { 0 }, size / 2, half(range, upper));
        }
        self.least(query, range, (f32::INFINITY, u32::MAX)).1
    }

    /// A point at most twice as far as the nearest one. One at no distance is found, of several the lowest number.
    pub fn nearest(&self, query: &[f32; D]) -> u32 {
        let mut search = Search { query, best: (f32::INFINITY, u32::MAX), beyond: [0.0; D] };
        self.search(0, self.cuts.len(), 0..self.order.len(), 0.0, &mut search);
        search.best.1
    }

    /// S. Arya and D. Mount 1993: the distance to a part is carried along axis by axis.
    fn search(&self, at: usize, size: usize, range: Range<usize>, far: f32, search: &mut Search<D>) {
        if size == 0 {
            search.best = self.least(search.query, range, search.best);
            return;
        }
        let Cut { axis, at: cut } = self.cuts[at];
        let beyond = search.query[axis as usize] - cut;
        let upper = beyond >= 0.0;
        let child = |upper: bool| at + 1 + if upper { size / 2 } else { 0 };
        self.search(child(upper), size / 2, half(range.clone(), upper), far, search);
        let before = search.beyond[axis as usize];
        let far = far + (beyond * beyond - before * before);
        if far * SLACK <= search.best.0 {
            search.beyond[axis as usize] = beyond;
            self.search(child(!upper), size / 2, half(range, !upper), far, search);
            search.beyond[axis as usize] = before;
        }
    }

    fn least(&self, query: &[f32; D], range: Range<usize>, best: (f32, u32)) -> (f32, u32) {
        let found = range.map(|i| (distance(query, &self.points[i]), self.order[i]));
        found.fold(best, |best, found| if found < best { found } else { best })
    }
}

/// A search under way.
struct Search<'a, const D: usize> {
    query: &'a [f32; D],
    /// The least distance so far, and of which point.
    best: (f32, u32),
    /// How far the part that is searched lies from the query along each axis.
    beyond: [f32; D],
}

fn half(range: Range<usize>, upper: bool) -> Range<usize> {
    let middle = range.start + range.len() / 2;
    if upper { middle..range.end } else { range.start..middle }
}

/// Orders points so that each half lies on one side of its cut. `keys`: scratch space, one for each of `order`.
fn cut<const D: usize>(
    points: &[[f32; D]],
    order: &mut [u32],
    keys: &mut [u64],
    cuts: &mut [Cut],
    watch: Watch,
) -> Result<(), Interrupted> {
    let Some((first, rest)) = cuts.split_first_mut() else {
        return Ok(());
    };
    let axis = widest(points, order);
    let coordinate = |number: u32| points[number as usize][axis];
    let middle = order.len() / 2;
    // As whole numbers that rise with the coordinate, then with the point's number, keys are compared without branches.
    for (key, &number) in keys.iter_mut().zip(&*order) {
        *key = u64::from(rising(coordinate(number))) << 32 | u64::from(number);
    }
    keys.select_nth_unstable(middle);
    order.iter_mut().zip(&*keys).for_each(|(number, &key)| *number = key as u32);
    *first = Cut { axis: axis as u32, at: coordinate(order[middle]) };
    let shared = order.len() > SHARED;
    let ((lower, upper), (lower_cuts, upper_cuts)) = (order.split_at_mut(middle), rest.split_at_mut(rest.len() / 2));
    let (lower_keys, upper_keys) = keys.split_at_mut(middle);
    if shared {
        watch.go_on()?;
        let lower = || cut(points, lower, lower_keys, lower_cuts, watch);
        let (lower, upper) = rayon::join(lower, || cut(points, upper, upper_keys, upper_cuts, watch));
        lower.and(upper)
    } else {
        cut(points, lower, lower_keys, lower_cuts, watch)?;
        cut(points, upper, upper_keys, upper_cuts, watch)
    }
}

/// A whole number that rises with a number, as `total_cmp` orders them.
fn rising(number: f32) -> u32 {
    let bits = number.to_bits();
    bits ^ if bits >> 31 == 1 { u32::MAX } else { 1 << 31 }
}

/// The axis along which the points spread most; of equals the first.
fn widest<const D: usize>(points: &[[f32; D]], order: &[u32]) -> usize {
    let (mut low, mut high) = ([f32::INFINITY; D], [f32::NEG_INFINITY; D]);
    for &number in order {
        let point = &points[number as usize];
        for axis in 0..D {
            low[axis] = if point[axis] < low[axis] { point[axis] } else { low[axis] };
            high[axis] = if point[axis] > high[axis] { point[axis] } else { high[axis] };
        }
    }
    (1..D).fold(0, |widest, axis| if high[axis] - low[axis] > high[widest] - low[widest] { axis } else { widest })
}
