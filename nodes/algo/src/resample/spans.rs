//! Which pixels a convex polygon owns, exactly.
//!
//! A pixel belongs to a polygon iff its centre moved by (e, e^2), e > 0 and infinitely small, lies inside. A point
//! so moved lies on no edge and no vertex, so polygons that share edges and vertices share no pixel and leave none
//! out. Along a pixel row the moved centres lie on a line that meets no vertex: the row crosses exactly two edges of a
//! convex polygon, those with `min y <= row's y < max y`, and owns the pixels from the left crossing (a centre on
//! it included) to the right one (a centre on it left out). Horizontal edges never matter.

use super::whole::{ROUNDER, index};
use crate::rect::Rect;
use crate::simd::{F64_LANES, counted, lanes_of};
use pulp::Simd;
use robust::{Coord, orient2d};
use std::array;
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
    #[inline(always)]
    pub fn not_before(&self, limit: f64) -> f64 {
        let distance = limit - self.first;
        let distance = if distance > 0.0 { distance } else { 0.0 };
        let distance = if distance < self.count { distance } else { self.count };
        let nearest = distance + ROUNDER - ROUNDER;
        // A centre's own coordinate is exact, the distance is not.
        let index = if self.first + nearest >= limit { nearest } else { nearest + 1.0 };
        if index < self.count { index } else { self.count }
    }
}

/// The pixel rows of a tile, each with the run of columns that the polygon traced last owns.
#[derive(Debug)]
pub(super) struct Spans {
    columns: Centers,
    rows: Centers,
    /// Where the runs start and end, whole numbers; those beyond the last row fill up lanes.
    runs: [Vec<f64>; 2],
}

impl Spans {
    pub fn new(tile: &Rect) -> Self {
        let runs = vec![0.0; tile.height() + F64_LANES];
        let (columns, rows) = (Centers::new(tile.x0, tile.x1), Centers::new(tile.y0, tile.y1));
        Self { columns, rows, runs: [runs.clone(), runs] }
    }

    /// Traces a convex polygon, either way round, and gives the rows of the tile that it may own pixels in: none if
    /// a corner's x is NaN.
    #[inline(always)]
    pub fn trace<S: Simd, const N: usize>(&mut self, simd: S, polygon: &[Point; N]) -> Range<usize> {
        let [mut low, mut high] = [polygon[0][0]; 2];
        let mut total = 0.0;
        for &[x, _] in polygon {
            low = if x < low { x } else { low };
            high = if x > high { x } else { high };
            total += x;
        }
        if total.is_nan() || self.columns.not_before(low) >= self.columns.not_before(high) {
            return 0..0;
        }
        let tops = polygon.map(|[_, y]| self.rows.not_before(y));
        let first = tops.iter().fold(tops[0], |a, &b| if b < a { b } else { a });
        let end = tops.iter().fold(tops[0], |a, &b| if b > a { b } else { a });
        let edges = array::from_fn::<_, N, _>(|i| Edge::new(i, polygon, &tops));
        let rows = index(first)..index(end);
        for row in rows.clone().step_by(S::F64_LANES) {
            let mut runs = [self.columns.count, 0.0].map(|none| simd.splat_f64s(none));
            let mut some_close = false;
            for edge in &edges {
                some_close |= edge.widen(simd, self, row as f64, &mut runs);
            }
            for (all, run) in self.runs.iter_mut().zip(runs) {
                *lanes_of::<S>(all, row) = run;
            }
            if some_close {
                self.trace_exactly(&edges, row..rows.end.min(row + S::F64_LANES));
            }
        }
        rows
    }

    /// Traces a polygon in rows where rounding may have left a crossing in doubt.
    #[cold]
    #[inline(never)]
    fn trace_exactly(&mut self, edges: &[Edge], rows: Range<usize>) {
        for row in rows {
            let at = row as f64;
            let crossings = edges.iter().filter(|edge| edge.top <= at && at < edge.bottom);
            let crossings = crossings.map(|edge| edge.crossing(self.rows.at(row), &self.columns));
            let run = crossings.fold([self.columns.count, 0.0], |run, at| [run[0].min(at), run[1].max(at)]);
            (self.runs[0][row], self.runs[1][row]) = (run[0], run[1]);
        }
    }

    /// The y of row `row` of the tile.
    pub fn row_center(&self, row: usize) -> f64 {
        self.rows.at(row)
    }

    /// The columns owned in `row` by the polygon traced last.
    #[inline(always)]
    pub fn run(&self, row: usize) -> Range<usize> {
        index(self.runs[0][row])..index(self.runs[1][row])
    }
}

/// An edge from its upper to its lower end, so that both polygons that share it compute the same.
#[derive(Clone, Copy)]
struct Edge {
    upper: Point,
    lower: Point,
    /// The rows it crosses, `upper.y <= y < lower.y`, whole numbers: none if it is horizontal.
    top: f64,
    bottom: f64,
    /// dx / dy; an edge that crosses a row is no flatter than the spacing of numbers near 1/2 allows.
    slope: f64,
    /// Bound of the rounding error of an approximate crossing, px.
    tolerance: f64,
}

impl Edge {
    /// From corner `i` of a polygon to the next; `tops`: the first rows below the corners.
    #[inline(always)]
    fn new<const N: usize>(i: usize, polygon: &[Point; N], tops: &[f64; N]) -> Self {
        const UNIT: f64 = f64::EPSILON / 2.0;
        let next = (i + 1) % N;
        let (from, to) = if polygon[i][1] < polygon[next][1] { (i, next) } else { (next, i) };
        let (upper, lower) = (polygon[from], polygon[to]);
        // 8 roundings of numbers no larger than the ends' x, one of a number no larger than a tile; twice that.
        let tolerance = 16.0 * UNIT * (upper[0].abs() + lower[0].abs()) + 512.0 * UNIT;
        let slope = (lower[0] - upper[0]) / (lower[1] - upper[1]);
        Self { upper, lower, top: tops[from], bottom: tops[to], slope, tolerance }
    }

    /// Widens the runs of the rows from number `row` on by the crossings of those that the edge crosses: the indices of
    /// the first centres that are not left of it. Whether rounding may have left one in doubt.
    #[inline(always)]
    fn widen<S: Simd>(&self, simd: S, spans: &Spans, row: f64, runs: &mut [S::f64s; 2]) -> bool {
        let (rounder, columns) = (simd.splat_f64s(ROUNDER), &spans.columns);
        let [before, zero, one, count] = [-1.0, 0.0, 1.0, columns.count].map(|at| simd.splat_f64s(at));
        let rows = counted(simd, row);
        let above = simd.less_than_or_equal_f64s(simd.splat_f64s(self.top), rows);
        let here = simd.and_m64s(above, simd.less_than_f64s(rows, simd.splat_f64s(self.bottom)));
        let y = simd.add_f64s(rows, simd.splat_f64s(spans.rows.first));
        let across = simd.mul_f64s(simd.sub_f64s(y, simd.splat_f64s(self.upper[1])), simd.splat_f64s(self.slope));
        let at = simd.add_f64s(simd.splat_f64s(self.upper[0]), across);
        let distance = simd.sub_f64s(at, simd.splat_f64s(columns.first));
        let inside = simd.and_m64s(simd.less_than_f64s(before, distance), simd.less_than_f64s(distance, count));
        let distance = simd.min_f64s(simd.max_f64s(distance, before), count);
        let nearest = simd.sub_f64s(simd.add_f64s(distance, rounder), rounder);
        let beyond = simd.sub_f64s(distance, nearest);
        let after = simd.select_f64s(simd.less_than_f64s(zero, beyond), simd.add_f64s(nearest, one), nearest);
        let crossing = simd.min_f64s(simd.max_f64s(after, zero), count);
        *runs = [
            simd.select_f64s(here, simd.min_f64s(runs[0], crossing), runs[0]),
            simd.select_f64s(here, simd.max_f64s(runs[1], crossing), runs[1]),
        ];
        let close = simd.less_than_or_equal_f64s(simd.abs_f64s(beyond), simd.splat_f64s(self.tolerance));
        let close = simd.and_m64s(simd.and_m64s(close, inside), here);
        simd.first_true_m64s(close) < S::F64_LANES
    }

    /// The crossing of the row at `y`, exactly.
    fn crossing(&self, y: f64, columns: &Centers) -> f64 {
        let is_left = |index: f64| turn(self.upper, self.lower, [columns.first + index, y]) > 0.0;
        let about = self.upper[0] + (y - self.upper[1]) * self.slope - columns.first;
        let mut crossing = (about.clamp(0.0, columns.count) - 1.0).floor().max(0.0);
        while crossing < columns.count && is_left(crossing) {
            crossing += 1.0;
        }
        crossing
    }
}

/// Traces by one of the processor's kinds of lanes.
#[cfg(test)]
pub(super) fn traced<const N: usize>(arch: pulp::Arch, spans: &mut Spans, polygon: &[Point; N]) -> Range<usize> {
    struct Trace<'a, const N: usize>(&'a mut Spans, &'a [Point; N]);

    impl<const N: usize> pulp::WithSimd for Trace<'_, N> {
        type Output = Range<usize>;

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Range<usize> {
            self.0.trace(simd, self.1)
        }
    }

    arch.dispatch(Trace(spans, polygon))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::Arch;

    /// Runs of the tile's rows, empty where the polygon owns nothing.
    fn runs<const N: usize>(tile: &Rect, polygon: &[Point; N]) -> Vec<Vec<usize>> {
        let mut spans = Spans::new(tile);
        let rows = traced(Arch::new(), &mut spans, polygon);
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
            [0.0, 0.0, 1.0, 1.0, 3.0, 4.0, 4.0, 4.0]
        );
        assert_eq!([below(-0.5), -0.49999999999999994].map(|x| centers.not_before(x)), [1.0, 2.0]);
        assert_eq!(centers.not_before(-1.4999999999999998), 1.0);
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
