//! Which pixels a convex polygon owns, exactly.
//!
//! A pixel belongs to a polygon iff its centre moved by (e, e^2), e > 0 and infinitely small, lies inside. A point
//! so moved lies on no edge and no vertex, so polygons that share edges and vertices share no pixel and leave none
//! out. Along a pixel row the moved centres lie on a line that meets no vertex: the row crosses exactly two edges of a
//! convex polygon, those with `min y <= row's y < max y`, and owns the pixels from the left crossing (a centre on
//! it included) to the right one (a centre on it left out). Horizontal edges never matter.

use crate::rect::Rect;
use robust::{Coord, orient2d};
use std::ops::Range;

/// A node's position, px.
pub(super) type Point = [f64; 2];

/// Exact sign of the turn at `b` on the way from `a` over `b` to `c`: positive if clockwise on screen.
pub(super) fn turn(a: Point, b: Point, c: Point) -> f64 {
    let [a, b, c] = [a, b, c].map(|[x, y]| Coord { x, y });
    orient2d(a, b, c)
}

/// A row of pixels, or a column: `count` centres from `first` on, 1 apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Centers {
    first: f64,
    count: f64,
}

impl Centers {
    /// Of pixels `start..end`.
    pub fn new(start: i64, end: i64) -> Self {
        Self { first: start as f64 + 0.5, count: (end - start) as f64 }
    }

    /// Coordinate of centre `index`.
    pub fn at(&self, index: usize) -> f64 {
        self.first + index as f64
    }

    /// Index of the first centre `>= limit`, exactly; `count` if there is none. `limit` is not NaN.
    pub fn not_before(&self, limit: f64) -> usize {
        let distance = limit - self.first;
        if distance <= 0.0 {
            return 0;
        }
        if distance > self.count {
            return self.count as usize;
        }
        let nearest = (distance + 0.5) as u32;
        // A centre's own coordinate is exact, the distance is not.
        let index = if self.first + nearest as f64 >= limit { nearest } else { nearest + 1 };
        (index as usize).min(self.count as usize)
    }
}

/// The pixel rows of a tile, each with the run of columns that the polygon traced last owns.
#[derive(Debug)]
pub(super) struct Spans {
    columns: Centers,
    rows: Centers,
    runs: Vec<[u32; 2]>,
}

impl Spans {
    pub fn new(tile: &Rect) -> Self {
        Self {
            columns: Centers::new(tile.x0, tile.x1),
            rows: Centers::new(tile.y0, tile.y1),
            runs: vec![[0, 0]; tile.height()],
        }
    }

    /// Traces a convex polygon, either way round, and gives the rows of the tile that it may own pixels in: none if
    /// it has a NaN.
    pub fn trace<const N: usize>(&mut self, polygon: &[Point; N]) -> Range<usize> {
        let [mut low, mut high] = [polygon[0][0]; 2];
        let mut total = 0.0;
        for &[x, y] in polygon {
            low = if x < low { x } else { low };
            high = if x > high { x } else { high };
            total += x + y;
        }
        if total.is_nan() || self.columns.not_before(low) >= self.columns.not_before(high) {
            return 0..0;
        }
        let starts = polygon.map(|[_, y]| self.rows.not_before(y));
        let rows = starts.iter().fold(starts[0], |a, &b| a.min(b))..starts.iter().fold(starts[0], |a, &b| a.max(b));
        self.runs[rows.clone()].fill([u32::MAX, 0]);
        for i in 0..N {
            let next = (i + 1) % N;
            let (upper, lower) = if polygon[i][1] < polygon[next][1] { (i, next) } else { (next, i) };
            if starts[upper] < starts[lower] {
                self.cross(&Edge::new(polygon[upper], polygon[lower]), starts[upper]..starts[lower]);
            }
        }
        rows
    }

    /// Widens the runs of the rows that an edge crosses.
    fn cross(&mut self, edge: &Edge, rows: Range<usize>) {
        for (row, run) in rows.clone().zip(&mut self.runs[rows]) {
            let crossing = edge.crossing(self.rows.at(row), &self.columns);
            *run = [run[0].min(crossing), run[1].max(crossing)];
        }
    }

    /// The y of row `row` of the tile.
    pub fn row_center(&self, row: usize) -> f64 {
        self.rows.at(row)
    }

    /// The columns owned in `row` by the polygon traced last.
    pub fn run(&self, row: usize) -> Range<usize> {
        self.runs[row][0] as usize..self.runs[row][1] as usize
    }
}

/// An edge from its upper to its lower end, so that both polygons that share it compute the same.
struct Edge {
    upper: Point,
    lower: Point,
    /// dx / dy; an edge that crosses a row is no flatter than the spacing of numbers near 1/2 allows.
    slope: f64,
    /// Bound of the rounding error of an approximate crossing, px.
    tolerance: f64,
}

impl Edge {
    fn new(upper: Point, lower: Point) -> Self {
        const UNIT: f64 = f64::EPSILON / 2.0;
        // 8 roundings of numbers no larger than the ends' x, one of a number no larger than a tile; twice that.
        let tolerance = 16.0 * UNIT * (upper[0].abs() + lower[0].abs()) + 512.0 * UNIT;
        Self { upper, lower, slope: (lower[0] - upper[0]) / (lower[1] - upper[1]), tolerance }
    }

    /// Index of the first centre of row `y` that is not left of the edge, 0..=count. `upper.y <= y < lower.y`.
    fn crossing(&self, y: f64, columns: &Centers) -> u32 {
        let distance = self.upper[0] + (y - self.upper[1]) * self.slope - columns.first;
        if distance <= -1.0 {
            return 0;
        }
        if distance >= columns.count {
            return columns.count as u32;
        }
        let nearest = (distance + 1.5) as u32; // The nearest index, plus 1.
        let beyond = distance + 1.0 - nearest as f64;
        let left = if beyond.abs() > self.tolerance {
            beyond > 0.0
        } else {
            turn(self.upper, self.lower, [columns.first + nearest as f64 - 1.0, y]) > 0.0
        };
        if left { nearest.min(columns.count as u32) } else { nearest.saturating_sub(1) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs of the tile's rows, empty where the polygon owns nothing.
    fn runs<const N: usize>(tile: &Rect, polygon: &[Point; N]) -> Vec<Vec<usize>> {
        let mut spans = Spans::new(tile);
        let rows = spans.trace(polygon);
        (0..tile.height()).map(|row| if rows.contains(&row) { spans.run(row).collect() } else { vec![] }).collect()
    }

    #[test]
    fn centres_on_left_and_upper_edges_are_owned() {
        let tile = Rect::new(0, 0, 4, 4);
        // Edges through the centres of pixels 0 and 2.
        let square = [[0.5, 0.5], [2.5, 0.5], [2.5, 2.5], [0.5, 2.5]];
        assert_eq!(runs(&tile, &square), [vec![0, 1], vec![0, 1], vec![], vec![]]);
        let mirrored = square.map(|[x, y]| [y, x]);
        assert_eq!(runs(&tile, &mirrored), runs(&tile, &square));
        // The diagonal runs through centres: they belong to the part on its right.
        let [upper, lower] = [[square[0], square[1], square[2]], [square[0], square[2], square[3]]];
        assert_eq!(runs(&tile, &upper), [vec![0, 1], vec![1], vec![], vec![]]);
        assert_eq!(runs(&tile, &lower), [vec![], vec![0], vec![], vec![]]);
    }

    #[test]
    fn tiles_cut_a_polygon_without_loss() {
        let polygon = [[-3.25, 1.5], [9.5, -4.0], [12.0, 8.75], [2.5, 11.5]];
        let whole = runs(&Rect::new(-8, -8, 16, 16), &polygon);
        for (x0, y0) in [(-8, -8), (0, -8), (8, -8), (-8, 0), (0, 0), (8, 0), (-8, 8), (0, 8), (8, 8)] {
            let part = runs(&Rect::new(x0, y0, x0 + 8, y0 + 8), &polygon);
            for row in 0..8 {
                let expected: Vec<usize> = (0..8)
                    .filter(|column| whole[(y0 + 8) as usize + row].contains(&((x0 + 8) as usize + column)))
                    .collect();
                assert_eq!(part[row], expected, "row {row} of {x0} {y0}");
            }
        }
    }

    #[test]
    fn first_centre_is_exact() {
        let centers = Centers::new(-2, 2);
        let below = |x: f64| f64::from_bits(x.to_bits() + 1); // For negative x.
        assert_eq!(
            [-9.0, -1.5, -1.0, -0.5, 1.5, 1.6, 9.0, f64::INFINITY].map(|x| centers.not_before(x)),
            [0, 0, 1, 1, 3, 4, 4, 4]
        );
        assert_eq!([below(-0.5), -0.49999999999999994].map(|x| centers.not_before(x)), [1, 2]);
        assert_eq!(centers.not_before(-1.4999999999999998), 1);
    }

    #[test]
    fn degenerate_polygons_own_nothing() {
        let tile = Rect::new(0, 0, 4, 4);
        for polygon in
            [[[0.5, 0.5]; 3], [[0.0, 0.0], [2.0, 2.0], [4.0, 4.0]], [[f64::NAN, 0.0], [4.0, 0.0], [0.0, 4.0]]]
        {
            assert!(runs(&tile, &polygon).iter().all(|run| run.is_empty()), "{polygon:?}");
        }
    }
}
