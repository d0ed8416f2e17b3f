//! Masks of polygons.

use rayon::prelude::*;

use crate::steps::Steps;
use crate::view::ViewMut;
use crate::{Interrupted, Watch};

/// Rows that one task computes.
const BAND_ROWS: usize = 16;

/// Scanlines per row of pixels.
const SUBROWS: i32 = 16;

/// Steps of horizontal position per pixel. With `SUBROWS` this makes a full pixel 2^24 units, so that every coverage
/// is an exact f32 and every sum of units is exact in whatever order and tile.
const SUBPIXELS: i32 = 1 << 20;

/// Coordinates are held within this, px, so that no square of one overflows.
const FARTHEST: f64 = 1e100;

/// Coverage of a closed polygon, with a soft outline if asked for.
///
/// Without a feather, each pixel gets the part of it that lies inside by the even-odd rule, taken on 16 scanlines
/// through the pixel and exact along these to 2^-20 px. With one, it gets smoothstep(1/2 + d / `feather`), where d is
/// the signed distance of the pixel's centre from the outline (positive inside) and smoothstep(t) = t^2 (3 - 2 t) on
/// t held to 0..=1; all edges belong to the outline, those inside a self-overlap too.
///
/// `points`: the vertices in order, px, the last is joined to the first; `feather`: width of the falloff, px, >= 0;
/// `x0`, `y0`: the top left pixel of `out`, within +-2^40; `out`: any size, gets 0..=1.
///
/// Fewer than 3 points, or a coordinate that is NaN: nothing is covered. Coordinates beyond +-1e100 px are held there,
/// and a feather that is not positive is none. A feather narrower than a pixel samples its falloff at pixel centres
/// and so looks hard-edged. Polygons that share edges without overlap cover each pixel exactly once together. Tiles
/// equal the whole bit for bit. Stops when `watch` says so.
///
/// Cost: O(area + edges x height / 16 + 16 x height of all edges), and with a feather O(length of all edges x feather)
/// more.
pub fn polygon(
    points: &[[f64; 2]],
    feather: f64,
    x0: i64,
    y0: i64,
    out: ViewMut<f32>,
    watch: Watch,
) -> Result<(), Interrupted> {
    assert!(x0.unsigned_abs().max(y0.unsigned_abs()) <= 1 << 40, "pixel ({x0}, {y0}) lies too far out");
    let feather = if feather > 0.0 { feather.min(FARTHEST) } else { 0.0 };
    // The outline, and per thread what of it comes near a band, which grows by doubling, and near a row.
    watch.reserve(points.len() * size_of::<Edge>() * (1 + 4 * rayon::current_num_threads()))?;
    let edges = outline(points);
    let bands = out.bands(BAND_ROWS);
    let steps = Steps::new(watch, bands.len());
    bands.into_par_iter().try_for_each(|(top, mut band)| {
        let top = y0 + top as i64;
        let near = edges_near(&edges, top as f64, (top + band.height() as i64) as f64, feather / 2.0);
        let mut painter = Painter::new(x0, band.width());
        for y in 0..band.height() {
            watch.go_on()?;
            let row_top = (top + y as i64) as f64;
            let edges = edges_near(&near, row_top, row_top + 1.0, feather / 2.0);
            if feather > 0.0 {
                painter.paint_falloff(&edges, row_top + 0.5, feather, band.row_mut(y));
            } else {
                painter.paint_coverage(&edges, row_top, band.row_mut(y));
            }
        }
        steps.step()
    })
}

/// An edge from its upper to its lower end (from left to right where it is level): so the direction of travel along
/// the outline does not matter.
#[derive(Clone, Copy)]
struct Edge {
    upper: [f64; 2],
    lower: [f64; 2],
}

impl Edge {
    /// x where the edge passes height `y`, held to its ends.
    fn x_at(&self, y: f64) -> f64 {
        let ([ax, ay], [bx, by]) = (self.upper, self.lower);
        if y <= ay {
            ax
        } else if y >= by {
            bx
        } else {
            ax + (y - ay) / (by - ay) * (bx - ax)
        }
    }

    fn squared_distance(&self, [px, py]: [f64; 2]) -> f64 {
        let [ax, ay] = self.upper;
        let (dx, dy) = (self.lower[0] - ax, self.lower[1] - ay);
        let squared_length = dx * dx + dy * dy;
        let along = (px - ax) * dx + (py - ay) * dy;
        if along > 0.0 && along < squared_length {
            let across = ((px - ax) * dy - (py - ay) * dx) / squared_length.sqrt();
            return across * across;
        }
        let [ex, ey] = if along > 0.0 { self.lower } else { self.upper };
        (px - ex) * (px - ex) + (py - ey) * (py - ey)
    }
}

/// The edges of a polygon, none if it covers nothing.
fn outline(points: &[[f64; 2]]) -> Vec<Edge> {
    if points.len() < 3 || points.iter().flatten().any(|coordinate| coordinate.is_nan()) {
        return Vec::new();
    }
    let held = |point: [f64; 2]| point.map(|coordinate| coordinate.clamp(-FARTHEST, FARTHEST));
    let ends = points.iter().zip(points.iter().cycle().skip(1));
    ends.map(|(&a, &b)| {
        let (a, b) = (held(a), held(b));
        if (a[1], a[0]) <= (b[1], b[0]) { Edge { upper: a, lower: b } } else { Edge { upper: b, lower: a } }
    })
    .collect()
}

/// Those of the edges that come within `reach` of the heights from `top` to `bottom`.
fn edges_near(edges: &[Edge], top: f64, bottom: f64, reach: f64) -> Vec<Edge> {
    let near = |edge: &&Edge| edge.upper[1] - reach <= bottom && edge.lower[1] + reach >= top;
    edges.iter().filter(near).copied().collect()
}

/// Paints rows of pixels from column `x0` on; keeps its buffers from row to row.
struct Painter {
    x0: i64,
    /// Crossings of the scanline in work with the outline, from left to right.
    crossings: Vec<f64>,
    /// Units of coverage that a pixel gets from spans that end in it.
    partial: Vec<i32>,
    /// Step at each pixel of the units that it gets from spans across it.
    whole: Vec<i32>,
    /// Squared distance of each pixel's centre from the outline, infinite where it is out of reach.
    squared_distances: Vec<f64>,
}

impl Painter {
    fn new(x0: i64, width: usize) -> Self {
        Self {
            x0,
            crossings: Vec::new(),
            partial: vec![0; width],
            whole: vec![0; width],
            squared_distances: vec![f64::INFINITY; width],
        }
    }

    /// Finds the crossings of height `y`; an edge holds its upper end but not its lower one.
    fn cross(&mut self, edges: &[Edge], y: f64) {
        let crossed = edges.iter().filter(|edge| edge.upper[1] <= y && y < edge.lower[1]);
        self.crossings.clear();
        self.crossings.extend(crossed.map(|edge| edge.x_at(y)));
        self.crossings.sort_unstable_by(f64::total_cmp);
    }

    fn paint_coverage(&mut self, edges: &[Edge], top: f64, row: &mut [f32]) {
        self.partial.fill(0);
        self.whole.fill(0);
        for subrow in 0..SUBROWS {
            self.cross(edges, top + (f64::from(subrow) + 0.5) / f64::from(SUBROWS));
            let (left, right) = (self.x0, self.x0 + row.len() as i64);
            for index in (1..self.crossings.len()).step_by(2) {
                // Rounded in the plane, not in the view, so that tiles agree.
                let position = |x: f64| {
                    let x = x.clamp(left as f64, right as f64);
                    (x * f64::from(SUBPIXELS)).round() as i64 - left * i64::from(SUBPIXELS)
                };
                let (start, end) = (position(self.crossings[index - 1]), position(self.crossings[index]));
                if start < end {
                    self.add_span(start, end);
                }
            }
        }
        let mut whole = 0;
        for ((sample, &partial), &step) in row.iter_mut().zip(&self.partial).zip(&self.whole) {
            whole += step;
            *sample = (whole + partial) as f32 / (SUBROWS * SUBPIXELS) as f32;
        }
    }

    /// Adds the coverage of the span `start..end`, not empty, in subpixels from the view's left edge.
    fn add_span(&mut self, start: i64, end: i64) {
        let subpixels = i64::from(SUBPIXELS);
        let (first, last) = ((start / subpixels) as usize, ((end - 1) / subpixels) as usize);
        if first == last {
            self.partial[first] += (end - start) as i32;
            return;
        }
        self.partial[first] += SUBPIXELS - (start % subpixels) as i32;
        self.partial[last] += (end - last as i64 * subpixels) as i32;
        self.whole[first + 1] += SUBPIXELS;
        self.whole[last] -= SUBPIXELS;
    }

    fn paint_falloff(&mut self, edges: &[Edge], y: f64, feather: f64, row: &mut [f32]) {
        self.squared_distances.fill(f64::INFINITY);
        for edge in edges {
            self.approach(edge, y, feather / 2.0);
        }
        self.cross(edges, y);
        let mut passed = 0;
        for (x, (sample, squared)) in row.iter_mut().zip(&self.squared_distances).enumerate() {
            let center = (self.x0 + x as i64) as f64 + 0.5;
            while self.crossings.get(passed).is_some_and(|&crossing| crossing <= center) {
                passed += 1;
            }
            let distance = if passed % 2 == 1 { squared.sqrt() } else { -squared.sqrt() };
            let t = (0.5 + distance / feather).clamp(0.0, 1.0);
            *sample = (t * t * (3.0 - 2.0 * t)) as f32;
        }
    }

    /// Lowers the distances on the row of centres at height `y` to that of `edge`, where it is within `reach`.
    fn approach(&mut self, edge: &Edge, y: f64, reach: f64) {
        let (a, b) = (edge.x_at(y - reach), edge.x_at(y + reach));
        let column = |x: f64| (x - self.x0 as f64).max(0.0) as usize;
        let first = column((a.min(b) - reach).floor());
        let end = column((a.max(b) + reach).ceil()).min(self.squared_distances.len());
        for x in first..end {
            let center = [(self.x0 + x as i64) as f64 + 0.5, y];
            let squared = &mut self.squared_distances[x];
            *squared = squared.min(edge.squared_distance(center));
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::UNWATCHED;

    fn painted(points: &[[f64; 2]], feather: f64, [x0, y0]: [i64; 2], [width, height]: [usize; 2]) -> Vec<f32> {
        let mut out = vec![f32::NAN; width * height];
        polygon(points, feather, x0, y0, ViewMut::packed(&mut out, width, height), UNWATCHED).unwrap();
        out
    }

    const STAR: [[f64; 2]; 5] = [[20.3, 1.2], [31.7, 36.1], [1.9, 14.5], [38.6, 14.4], [8.8, 36.9]];

    #[test]
    fn a_rectangle_on_pixel_edges_is_exact() {
        let rectangle = [[-2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [-2.0, 3.0]];
        #[rustfmt::skip]
        assert_eq!(painted(&rectangle, 0.0, [-3, 0], [5, 5]), [
            0.0, 0.0, 0.0, 0.0, 0.0,
            0.0, 1.0, 1.0, 1.0, 0.0,
            0.0, 1.0, 1.0, 1.0, 0.0,
            0.0, 0.0, 0.0, 0.0, 0.0,
            0.0, 0.0, 0.0, 0.0, 0.0,
        ]);
    }

    #[test]
    fn coverage_is_the_covered_part_of_each_pixel() {
        let rectangle = [[0.25, 0.5], [2.5, 0.5], [2.5, 1.25], [0.25, 1.25]];
        assert_eq!(painted(&rectangle, 0.0, [0, 0], [3, 2]), [0.375, 0.5, 0.25, 0.1875, 0.25, 0.125]);
        let triangle = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]];
        assert_eq!(painted(&triangle, 0.0, [0, 0], [4, 4]).iter().sum::<f32>(), 8.0);
        assert_eq!(painted(&triangle, 0.0, [0, 0], [4, 4])[..4], [1.0, 1.0, 1.0, 0.5]);
    }

    #[test]
    fn even_odd_leaves_the_heart_of_a_star_empty() {
        let star = painted(&STAR, 0.0, [0, 0], [40, 40]);
        assert_eq!(star[20 * 40 + 20], 0.0);
        assert_eq!(star[8 * 40 + 20], 1.0);
    }

    #[test]
    fn direction_and_first_point_do_not_matter() {
        let mut turned = STAR;
        turned.reverse();
        turned.rotate_left(2);
        for feather in [0.0, 5.5] {
            assert_eq!(painted(&STAR, feather, [0, 0], [40, 40]), painted(&turned, feather, [0, 0], [40, 40]));
        }
    }

    #[test]
    fn neighbours_cover_each_pixel_exactly_once() {
        let (a, b, c, d) = ([0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]);
        let (p, q) = ([6.13, 8.71], [14.9, 3.33]);
        let parts: [&[_]; 3] = [&[a, b, q, p], &[b, c, d, p, q], &[d, a, p]];
        let painted = parts.map(|part| painted(part, 0.0, [0, 0], [20, 20]));
        for i in 0..400 {
            assert_eq!(painted.iter().map(|part| part[i]).sum::<f32>(), 1.0, "pixel {i}");
        }
    }

    #[test]
    fn tiles_equal_the_whole() {
        for feather in [0.0, 0.7, 9.3] {
            let whole = painted(&STAR, feather, [-7, -5], [61, 57]);
            let tile = painted(&STAR, feather, [9, 11], [13, 21]);
            for (y, row) in tile.chunks(13).enumerate() {
                assert_eq!(row, &whole[(y + 16) * 61 + 16..][..13], "row {y}, feather {feather}");
            }
        }
    }

    #[test]
    fn moving_by_whole_pixels_moves_the_mask() {
        let points = STAR.map(|[x, y]| [(x * 8.0).round() / 8.0, (y * 8.0).round() / 8.0]);
        let moved = points.map(|[x, y]| [x - 1000.0, y + 300.0]);
        for feather in [0.0, 4.0] {
            let (here, there) =
                (painted(&points, feather, [0, 0], [40, 40]), painted(&moved, feather, [-1000, 300], [40, 40]));
            assert!(here.iter().zip(&there).all(|(a, b)| (a - b).abs() < 1e-6));
        }
    }

    #[test]
    fn feather_is_smoothstep_of_the_signed_distance() {
        let band = [[4.0, -100.0], [4.0, 100.0], [200.0, 100.0], [200.0, -100.0]];
        let row = painted(&band, 4.0, [0, 0], [8, 1]);
        let expected = [-3.5f64, -2.5, -1.5, -0.5, 0.5, 1.5, 2.5, 3.5].map(|distance| {
            let t = (0.5 + distance / 4.0).clamp(0.0, 1.0);
            (t * t * (3.0 - 2.0 * t)) as f32
        });
        assert_eq!(row, expected);
    }

    #[test]
    fn feather_is_round_about_a_corner() {
        let quadrant = [[0.5, 0.5], [100.0, 0.5], [100.0, 100.0], [0.5, 100.0]];
        let out = painted(&quadrant, 20.0, [-10, -10], [11, 11]);
        let at = |x: i64, y: i64| out[((y + 10) * 11 + x + 10) as usize];
        // The centres of pixels (-3, -4) and (0, -5) lie 5 px from the corner at (0.5, 0.5).
        assert_eq!(at(-3, -4), at(0, -5));
        assert_eq!(at(-3, -4), 0.15625);
        assert_eq!(at(0, 0), 0.5);
        assert_eq!(at(-8, -8), 0.0);
    }

    #[test]
    fn feather_equals_its_definition_on_a_star() {
        let (feather, side) = (7.0, 40);
        let (edges, out) = (outline(&STAR), painted(&STAR, feather, [0, 0], [side, side]));
        for (i, sample) in out.iter().enumerate() {
            let center = [(i % side) as f64 + 0.5, (i / side) as f64 + 0.5];
            let nearest = edges.iter().map(|edge| edge.squared_distance(center)).fold(f64::INFINITY, f64::min).sqrt();
            let right = |edge: &&Edge| {
                edge.upper[1] <= center[1] && center[1] < edge.lower[1] && edge.x_at(center[1]) > center[0]
            };
            let inside = edges.iter().filter(right).count() % 2 == 1;
            let t = (0.5 + if inside { nearest } else { -nearest } / feather).clamp(0.0, 1.0);
            assert!((f64::from(*sample) - t * t * (3.0 - 2.0 * t)).abs() < 1e-6, "pixel {i}");
        }
    }

    #[test]
    fn degenerate_polygons_cover_nothing() {
        let line = [[0.0, 0.0], [4.0, 4.0], [0.0, 0.0]];
        let broken = [[0.0, 0.0], [4.0, f64::NAN], [0.0, 4.0]];
        assert_eq!(painted(&line, 0.0, [0, 0], [4, 4]), [0.0; 16]);
        for points in [&[][..], &line[..2], &broken] {
            for feather in [0.0, 3.3] {
                assert_eq!(painted(points, feather, [0, 0], [4, 4]), [0.0; 16]);
            }
        }
    }

    #[test]
    fn huge_coordinates_are_legal() {
        for far in [1e9, 1e30, 1e300, f64::INFINITY] {
            let around = [[-far, -far], [far, -far], [far, far], [-far, far]];
            let below = [[-far, 2.0], [far, 2.0], [far, far], [-far, far]];
            assert_eq!(painted(&around, 0.0, [-2, -2], [5, 5]), [1.0; 25]);
            assert_eq!(painted(&around, 3.0, [-2, -2], [5, 5]), [1.0; 25]);
            assert_eq!(painted(&below, 0.0, [0, 0], [1, 4]), [0.0, 0.0, 1.0, 1.0]);
            assert_eq!(painted(&below, 2.0, [0, 0], [1, 4]), [0.0, 0.15625, 0.84375, 1.0]);
            let any = painted(&[[-far, 0.0], [far, 1.0], [3.0, far]], far, [0, 0], [9, 9]);
            assert!(any.iter().all(|sample| (0.0..=1.0).contains(sample)));
        }
    }

    #[test]
    fn threads_do_not_matter() {
        let paint = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| [0.0, 6.1].map(|feather| painted(&STAR, feather, [0, 0], [40, 40])))
        };
        let alone = paint(1);
        assert!([2, 3, 8].into_iter().all(|threads| paint(threads) == alone));
    }

    #[test]
    fn a_watch_stops_it() {
        let mut out = [0.0; 4];
        let stop: Watch = &|_| Err(Interrupted);
        assert_eq!(polygon(&STAR, 0.0, 0, 0, ViewMut::packed(&mut out, 2, 2), stop), Err(Interrupted));
    }
}
