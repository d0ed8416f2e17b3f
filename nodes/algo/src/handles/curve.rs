//! Curves as handles.

use std::collections::BTreeSet;

use super::rows::locate;
use super::{Error, Handle, Side};
use crate::lattice::Lattice;

/// Handles along a curve that is to go over into another.
///
/// The lattice's lines cut the curve into pieces; the first and the last piece are held at the ends of the curve, the
/// others at the middle of their length, but no cell twice: of a curve that comes back to a cell the first piece is
/// held. A curve within one cell is held at its middle.
///
/// Where both curves have the same count of corners they correspond corner by corner, evenly in between; else a point
/// goes to where the same share of the other curve's length is passed.
///
/// * `from`: corners of the curve, px, at least 1, within the lattice.
/// * `to`: corners of its image, px, at least 1, anywhere.
///
/// A curve of no length is held at its start, and an image of no length is a point. A corner of `from` outside the
/// lattice is an error that gives its index. O(corners + cells crossed).
pub fn along(lattice: &Lattice, from: &[[f64; 2]], to: &[[f64; 2]]) -> Result<Vec<Handle>, Error> {
    assert!(!from.is_empty() && !to.is_empty(), "a curve has corners");
    if let Some(index) = from.iter().position(|&corner| locate(lattice, corner).is_none()) {
        return Err(Error::Outside { index });
    }
    let (from, to) = (Curve::new(from), Curve::new(to));
    let pieces = from.pieces(lattice);
    let count = pieces.len();
    let mut held = BTreeSet::new();
    let mut handles = Vec::with_capacity(count);
    for (number, [begin, end]) in pieces.into_iter().enumerate() {
        let middle = from.at(from.halfway(begin, end));
        let (cell, _) = locate(lattice, middle).expect("between corners within the lattice");
        if !held.insert(cell) {
            continue;
        }
        let at = match number {
            _ if count == 1 => from.halfway(begin, end),
            0 => begin,
            _ if number + 1 == count => end,
            _ => from.halfway(begin, end),
        };
        handles.push(Handle { from: from.at(at), to: to.at(from.across(at, &to)) });
    }
    Ok(handles)
}

/// Handles that drag a side of the lattice along a curve: one at every node, evenly over the curve's length, or
/// straight where it has two corners.
///
/// * `to`: corners of the side's image, px, at least 1; from left to right or from top to bottom.
pub fn side(lattice: &Lattice, side: Side, to: &[[f64; 2]]) -> Vec<Handle> {
    assert!(!to.is_empty(), "a curve has corners");
    let [columns, rows] = lattice.cells();
    let to = Curve::new(to);
    let count = if matches!(side, Side::Top | Side::Bottom) { columns } else { rows };
    let node = |number: usize| match side {
        Side::Top => lattice.rest(number, 0),
        Side::Bottom => lattice.rest(number, rows),
        Side::Left => lattice.rest(0, number),
        Side::Right => lattice.rest(columns, number),
    };
    let image = |number: usize| to.at(to.passed(to.length() * (number as f64 / count as f64)));
    (0..=count).map(|number| Handle { from: node(number), to: image(number) }).collect()
}

/// A place on a curve: the number of a segment, and how much of it is passed, 0..=1.
type Place = (usize, f64);

struct Curve<'a> {
    corners: &'a [[f64; 2]],
    /// Length passed at each corner.
    passed: Vec<f64>,
}

impl<'a> Curve<'a> {
    fn new(corners: &'a [[f64; 2]]) -> Self {
        let mut passed = vec![0.0];
        for ends in corners.windows(2) {
            let step = libm::hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
            passed.push(passed[passed.len() - 1] + step);
        }
        Self { corners, passed }
    }

    fn length(&self) -> f64 {
        self.passed[self.passed.len() - 1]
    }

    /// The point at a place; the corners exactly.
    fn at(&self, (segment, share): Place) -> [f64; 2] {
        let from = self.corners[segment];
        match self.corners.get(segment + 1) {
            Some(to) if share == 1.0 => *to,
            Some(to) => [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis])),
            None => from,
        }
    }

    /// Length passed at a place.
    fn length_at(&self, (segment, share): Place) -> f64 {
        let end = self.passed.get(segment + 1).unwrap_or(&self.passed[segment]);
        self.passed[segment] + share * (end - self.passed[segment])
    }

    /// The place where a length is passed.
    fn passed(&self, length: f64) -> Place {
        let segments = self.corners.len() - 1;
        let segment = self.passed[1..].partition_point(|&end| end < length).min(segments.saturating_sub(1));
        if segments == 0 {
            return (0, 0.0);
        }
        let step = self.passed[segment + 1] - self.passed[segment];
        (segment, if step > 0.0 { ((length - self.passed[segment]) / step).clamp(0.0, 1.0) } else { 0.0 })
    }

    /// The place halfway between two, by length.
    fn halfway(&self, begin: Place, end: Place) -> Place {
        self.passed((self.length_at(begin) + self.length_at(end)) / 2.0)
    }

    /// The place of `other` that a place of this curve goes to.
    fn across(&self, place: Place, other: &Curve) -> Place {
        if self.corners.len() == other.corners.len() {
            return place;
        }
        let share = if self.length() > 0.0 { self.length_at(place) / self.length() } else { 0.0 };
        other.passed(other.length() * share)
    }

    /// Begin and end of the pieces into which the lattice's lines cut the curve.
    fn pieces(&self, lattice: &Lattice) -> Vec<[Place; 2]> {
        let mut cuts = vec![(0, 0.0)];
        for (segment, ends) in self.corners.windows(2).enumerate() {
            let mut shares: Vec<f64> = (0..2).flat_map(|axis| crossings(lattice, ends, axis)).collect();
            shares.sort_by(f64::total_cmp);
            cuts.extend(shares.into_iter().map(|share| (segment, share)));
        }
        cuts.push((self.corners.len().saturating_sub(2), if self.corners.len() > 1 { 1.0 } else { 0.0 }));
        let slack = 1e-9 * self.length();
        cuts.dedup_by(|second, first| self.length_at(*second) - self.length_at(*first) <= slack);
        if cuts.len() == 1 {
            return vec![[cuts[0], cuts[0]]];
        }
        cuts.windows(2).map(|ends| [ends[0], ends[1]]).collect()
    }
}

/// Shares of a segment at which it crosses the lattice's lines across an axis.
fn crossings(lattice: &Lattice, ends: &[[f64; 2]], axis: usize) -> Vec<f64> {
    let line = |point: [f64; 2]| (point[axis] - lattice.origin[axis]) / lattice.spacing[axis];
    let (from, to) = (line(ends[0]), line(ends[1]));
    let (low, high) = (from.min(to), from.max(to));
    let lines = (low.ceil() as i64)..=(high.floor() as i64);
    lines.filter(|_| high > low).map(|line| ((line as f64 - from) / (to - from)).clamp(0.0, 1.0)).collect()
}
