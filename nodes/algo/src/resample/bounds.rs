//! The destination window of a picture drawn through a warp.

use super::Map;
use super::cell::Shape;
use super::locate::Clip;
use super::net::{Net, Place};
use super::spans::Point;
use crate::rect::Rect;
use crate::{Interrupted, Watch};
use rayon::prelude::*;

/// What of a pixel's width the image may cover and still be left out, so that rounding adds no pixels, px.
const SLACK: f64 = 1.0 / (1 << 20) as f64;

/// The destination pixels that the image of a picture overlaps.
///
/// All pixels of which the bounding box of the image of `source_window` covers more than 2^-20 px along both axes: of
/// the corners of all cells, those at the border cut to the window, uncut where they fold. So both fringes of a
/// picture moved by part of a pixel are in it, and the identity keeps the window. What the lobes of a wide filter
/// would add beyond is left out.
///
/// - `map`: the warp.
/// - `source_window`: as for [`draw`](super::draw).
/// - `limit`: the result is clipped to it, so that a wild warp does not ask for an absurd size.
///
/// A backward map has no closed form: `None`; callers use the display window. Positions that are not finite are
/// left out; an empty source window gives an empty rectangle.
///
/// Cost: linear in the nodes. Stops when `watch` says so.
pub fn bounds(map: &Map, source_window: Rect, limit: Rect, watch: Watch) -> Result<Option<Rect>, Interrupted> {
    let Map::Forward { lattice, positions } = *map else { return Ok(None) };
    let net = Net::new(lattice, positions);
    if source_window.is_empty() {
        return Ok(Some(Rect::new(limit.x0, limit.y0, limit.x0, limit.y0)));
    }
    let clip = Clip::grown(&source_window, 0.0);
    let ends = [0, 1].map(|axis| [clip.low, clip.high].map(|end| net.place(axis, end[axis])));
    let [columns, rows] = [0, 1].map(|axis| {
        let rest = |node: usize| lattice.origin[axis] + node as f64 * lattice.spacing[axis];
        let nodes = (0..lattice.nodes[axis]).filter(|&node| (clip.low[axis]..clip.high[axis]).contains(&rest(node)));
        nodes.map(Place::at_node).chain(ends[axis]).collect::<Vec<_>>()
    });
    let hulls = rows.par_iter().map(|&row| {
        watch.go_on()?;
        Ok(columns.iter().fold(Hull::EMPTY, |hull, &column| hull.with(net.position(column, row))))
    });
    let hull = hulls.try_reduce(|| Hull::EMPTY, |a, b| Ok(a.and(b)))?;
    let hull = border_cells(ends).map(|cell| net.corners(cell)).fold(hull, |hull, corners| {
        if matches!(Shape::of(&corners), Shape::Folded { .. }) {
            corners.into_iter().fold(hull, Hull::with)
        } else {
            hull
        }
    });
    // Casts saturate.
    let low = hull.low.map(|at| (at + SLACK).floor() as i64);
    let high = hull.high.map(|at| (at - SLACK).ceil() as i64);
    Ok(Some(Rect::new(low[0], low[1], high[0].max(low[0]), high[1].max(low[1])).intersect(&limit)))
}

/// The lattice's cells [column, row] along the border of the rectangle between two places along each axis.
fn border_cells(ends: [[Place; 2]; 2]) -> impl Iterator<Item = [usize; 2]> {
    let [[left, right], [top, bottom]] = ends.map(|ends| ends.map(|end| end.node.min(end.next)));
    let across = [top, bottom].into_iter().flat_map(move |row| (left..=right).map(move |column| [column, row]));
    across.chain([left, right].into_iter().flat_map(move |column| (top..=bottom).map(move |row| [column, row])))
}

/// The bounding box of finite points.
#[derive(Clone, Copy, Debug)]
struct Hull {
    low: Point,
    high: Point,
}

impl Hull {
    const EMPTY: Self = Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };

    fn with(self, point: Point) -> Self {
        if point.iter().all(|at| at.is_finite()) { self.and(Self { low: point, high: point }) } else { self }
    }

    fn and(self, other: Self) -> Self {
        Self {
            low: [0, 1].map(|axis| self.low[axis].min(other.low[axis])),
            high: [0, 1].map(|axis| self.high[axis].max(other.high[axis])),
        }
    }
}
