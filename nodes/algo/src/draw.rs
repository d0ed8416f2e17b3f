//! Drawing lines.

use crate::bins::by_band;
use crate::lattice::Positions;
use crate::steps::Steps;
use crate::view::ViewMut;
use crate::{Interrupted, Watch};
use rayon::prelude::*;
use std::ops::Range;

/// Rows that are drawn together.
const BAND: usize = 32;

/// Only what lies within this distance of the grid's origin along both axes is drawn, px.
const FAR: f64 = 1e8;

type Point = [f64; 2];

/// Draws the lines of a warped lattice as anti-aliased coverage.
///
/// Straight segments join neighbouring nodes along every `every`-th row and column of nodes and along the border.
/// A segment covers a pixel whose centre lies at distance d from it by the length that [d - 1/2, d + 1/2] and
/// [-width / 2, width / 2] share: exact for lines along the axes, and with round caps. Of several segments the
/// greatest coverage counts, so lines do not grow darker where they meet.
///
/// * `positions`: of the nodes, px, row-major; one per node (asserted).
/// * `nodes`: columns and rows of nodes, any count; one row or column is a single line.
/// * `every`: at least 1 (asserted); 1 draws every line.
/// * `width`: of the lines, px, finite and > 0 (asserted); below 1 px they fade instead of breaking up.
/// * `x0`, `y0`, `out`: where the result's top left pixel lies, px, and the coverage to write, 0..=1, all of it.
/// * `watch`: asked once per band of rows.
///
/// A pixel's coverage does not depend on the window it is drawn in. Segments with an end that is not finite are left
/// out. Nothing is drawn farther than 10^8 px from the grid's origin; what is left of a segment that reaches beyond
/// lies where the rounding of its ends lets it, 10^-16 of their distance. A segment of length 0 is a dot.
///
/// Cost: linear in the segments and in the pixels that they touch; bands of rows side by side.
pub fn lattice_lines(
    positions: &Positions,
    nodes: [usize; 2],
    every: usize,
    width: f64,
    x0: i64,
    y0: i64,
    out: ViewMut<f32>,
    watch: Watch,
) -> Result<(), Interrupted> {
    let Positions { x, y } = positions;
    assert!(x.len() == nodes[0] * nodes[1] && y.len() == x.len(), "{} positions are not {nodes:?}", x.len());
    assert!(every >= 1, "every 0th line");
    assert!(width.is_finite() && width > 0.0, "lines {width} px wide");
    let window = Window { x0: x0 as f64, y0: y0 as f64, width: out.width(), height: out.height() };
    let pen = Pen { radius: 0.5 * width, reach: 0.5 * width + 0.5 };
    let lines = |axis: usize| nodes[1 - axis] / every + 2;
    let most: usize = [0, 1].map(|axis| lines(axis) * (nodes[axis] / PIECE + 1)).iter().sum();
    // As they are listed, and once more with their rows.
    watch.reserve(2 * most * size_of::<Piece>())?;
    let all = pieces(nodes, every);
    let touching = all.into_par_iter().map(|piece| {
        watch.go_on()?;
        let segments = piece.segments(positions).filter(|segment| !segment.columns(&pen, &window).is_empty());
        let rows = segments.map(|segment| segment.rows(&pen, &window)).filter(|rows| !rows.is_empty());
        let rows = rows.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end));
        Ok(Piece { rows: rows.unwrap_or(0..0), ..piece })
    });
    let pieces = touching.collect::<Result<Vec<_>, _>>()?;
    let bins = by_band(&pieces, |piece| piece.rows.clone(), BAND, window.height.div_ceil(BAND), watch)?;
    let steps = Steps::new(watch, bins.len());
    out.bands(BAND).into_par_iter().zip(bins).try_for_each(|((top, mut band), bin)| {
        (0..band.height()).for_each(|row| band.row_mut(row).fill(0.0));
        for &piece in &bin {
            watch.go_on()?;
            let segments = pieces[piece as usize].segments(positions);
            segments.for_each(|segment| draw(&segment, &pen, &window, top, &mut band));
        }
        steps.step()
    })
}

/// Segments of a line that are looked for together.
const PIECE: usize = 32;

/// Some of the segments along one line.
#[derive(Clone)]
struct Piece {
    /// Node at which the first begins.
    first: usize,
    /// From one node to the next.
    step: usize,
    count: usize,
    /// Rows of the window that they may touch.
    rows: Range<usize>,
}

impl Piece {
    fn segments(&self, positions: &Positions) -> impl Iterator<Item = Segment> {
        let node = |node: usize| [positions.x[node], positions.y[node]];
        let starts = (0..self.count).map(|number| self.first + number * self.step);
        starts.filter_map(move |from| Segment::new(node(from), node(from + self.step)))
    }
}

/// All lines to draw, cut into pieces.
fn pieces([columns, rows]: [usize; 2], every: usize) -> Vec<Piece> {
    let drawn = move |lines: usize| (0..lines).filter(move |line| line.is_multiple_of(every) || line + 1 == lines);
    let cut = |first: usize, step: usize, nodes: usize| {
        let starts = (0..nodes.saturating_sub(1)).step_by(PIECE);
        starts.map(move |start| Piece {
            first: first + start * step,
            step,
            count: PIECE.min(nodes - 1 - start),
            rows: 0..0,
        })
    };
    let across = drawn(rows).flat_map(|row| cut(row * columns, 1, columns));
    across.chain(drawn(columns).flat_map(|column| cut(column, columns, rows))).collect()
}

/// Draws a segment into the band whose first row is the window's row `top`.
fn draw(segment: &Segment, pen: &Pen, window: &Window, top: usize, band: &mut ViewMut<f32>) {
    let rows = segment.rows(pen, window);
    for row in rows.start.max(top)..rows.end.min(top + band.height()) {
        let y = window.y0 + row as f64 + 0.5;
        let columns = segment.columns_in_row(y, pen, window);
        let samples = &mut band.row_mut(row - top)[columns.clone()];
        for (sample, column) in samples.iter_mut().zip(columns) {
            let distance = segment.distance([window.x0 + column as f64 + 0.5, y]);
            *sample = sample.max(pen.coverage(distance));
        }
    }
}

/// Where the result lies.
struct Window {
    x0: f64,
    y0: f64,
    width: usize,
    height: usize,
}

/// The first and last of `count` pixels from `start` on whose centres lie within [low, high], as a range.
fn pixels_within(low: f64, high: f64, start: f64, count: usize) -> Range<usize> {
    let count = count as f64;
    let first = ((low - 0.5).ceil() - start).clamp(0.0, count) as usize;
    let end = ((high - 0.5).floor() + 1.0 - start).clamp(0.0, count) as usize;
    first..end.max(first)
}

/// What draws along a segment: `radius` is half the line's width, `reach` the distance where coverage ends, px.
struct Pen {
    radius: f64,
    reach: f64,
}

impl Pen {
    /// Coverage of a pixel whose centre lies `distance` from a segment.
    fn coverage(&self, distance: f64) -> f32 {
        let (near, far) = ((distance - 0.5).max(-self.radius), (distance + 0.5).min(self.radius));
        (far - near).max(0.0) as f32
    }
}

/// A straight segment, px.
#[derive(Clone, Copy, Debug)]
struct Segment {
    from: Point,
    to: Point,
}

impl Segment {
    /// The part of a segment that lies within [`FAR`] along both axes, where there is one.
    fn new(from: Point, to: Point) -> Option<Self> {
        if !from.iter().chain(&to).all(|coordinate| coordinate.is_finite()) {
            return None;
        }
        let segment = Self { from, to }.clipped(0)?.clipped(1)?;
        // The second clip may have moved the first axis by a rounding.
        Some(Self { from: segment.from.map(within_far), to: segment.to.map(within_far) })
    }

    /// The part that lies within [`FAR`] along one axis, where there is one.
    fn clipped(self, axis: usize) -> Option<Self> {
        let Self { from, to } = self;
        let (a, b) = (from[axis], to[axis]);
        if a.min(b) > FAR || a.max(b) < -FAR {
            return None;
        }
        let end = |own: Point| {
            let wall = within_far(own[axis]);
            if wall == own[axis] {
                return own;
            }
            // Halves, for the difference of finite numbers may overflow; a != b, for the segment crosses the wall.
            let t = (0.5 * wall - 0.5 * a) / (0.5 * b - 0.5 * a);
            let across = from[1 - axis] * (1.0 - t) + to[1 - axis] * t;
            if axis == 0 { [wall, across] } else { [across, wall] }
        };
        Some(Self { from: end(from), to: end(to) })
    }

    /// Rows of the window that it may touch.
    fn rows(&self, pen: &Pen, window: &Window) -> Range<usize> {
        let (low, high) = (self.from[1].min(self.to[1]), self.from[1].max(self.to[1]));
        pixels_within(low - pen.reach, high + pen.reach, window.y0, window.height)
    }

    /// Columns of the window that it may touch.
    fn columns(&self, pen: &Pen, window: &Window) -> Range<usize> {
        let (low, high) = (self.from[0].min(self.to[0]), self.from[0].max(self.to[0]));
        pixels_within(low - pen.reach, high + pen.reach, window.x0, window.width)
    }

    /// Columns that it may touch in the row of pixels with centres at `y`: whatever is within reach of a centre is
    /// within reach along y and along x.
    fn columns_in_row(&self, y: f64, pen: &Pen, window: &Window) -> Range<usize> {
        let [dx, dy] = [self.to[0] - self.from[0], self.to[1] - self.from[1]];
        if dy == 0.0 {
            return self.columns(pen, window);
        }
        let x_at = |y: f64| self.from[0] + ((y - self.from[1]) / dy).clamp(0.0, 1.0) * dx;
        let (above, below) = (x_at(y - pen.reach), x_at(y + pen.reach));
        pixels_within(above.min(below) - pen.reach, above.max(below) + pen.reach, window.x0, window.width)
    }

    /// Distance of a point from the segment.
    fn distance(&self, point: Point) -> f64 {
        let [dx, dy] = [self.to[0] - self.from[0], self.to[1] - self.from[1]];
        let [px, py] = [point[0] - self.from[0], point[1] - self.from[1]];
        let square = dx * dx + dy * dy;
        let t = if square > 0.0 { ((px * dx + py * dy) / square).clamp(0.0, 1.0) } else { 0.0 };
        let [ox, oy] = [px - t * dx, py - t * dy];
        (ox * ox + oy * oy).sqrt()
    }
}

/// The nearest coordinate that is drawn at all.
fn within_far(coordinate: f64) -> f64 {
    coordinate.clamp(-FAR, FAR)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UNWATCHED;
    use crate::lattice::Lattice;
    use proptest::prelude::*;

    fn drawn(positions: &Positions, nodes: [usize; 2], every: usize, width: f64, window: [i64; 4]) -> Vec<f32> {
        let [x0, y0, columns, rows] = window;
        let mut out = vec![9.0; (columns * rows) as usize];
        let view = ViewMut::packed(&mut out, columns as usize, rows as usize);
        lattice_lines(positions, nodes, every, width, x0, y0, view, UNWATCHED).expect("nothing interrupts it");
        out
    }

    fn line(from: Point, to: Point, width: f64, window: [i64; 4]) -> Vec<f32> {
        drawn(&Positions { x: vec![from[0], to[0]], y: vec![from[1], to[1]] }, [2, 1], 1, width, window)
    }

    fn assert_near(found: &[f32], expected: &[f32]) {
        assert_eq!(found.len(), expected.len());
        let near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-6);
        assert!(near, "{found:?} is not {expected:?}");
    }

    fn wavy() -> (Positions, [usize; 2]) {
        let lattice = Lattice { origin: [-10.0, -5.0], spacing: [7.3, 6.1], nodes: [16, 18] };
        let wavy = |[x, y]: Point| [x + 5.0 * libm::sin(0.13 * y), y + 4.0 * libm::cos(0.21 * x)];
        (Positions::from_map(&lattice, wavy), lattice.nodes)
    }

    #[test]
    fn a_frame_in_five_by_five() {
        let positions = Positions { x: vec![0.5, 3.0, 0.5, 3.0], y: vec![0.5, 0.5, 3.0, 3.0] };
        #[rustfmt::skip]
        let expected = [
            1.0, 1.0, 1.0,   0.5,     0.0,
            1.0, 0.0, 0.5,   0.5,     0.0,
            1.0, 0.5, 0.5,   0.5,     0.0,
            0.5, 0.5, 0.5,   0.2928932, 0.0,
            0.0, 0.0, 0.0,   0.0,     0.0,
        ];
        let found = drawn(&positions, [2, 2], 1, 1.0, [0, 0, 5, 5]);
        assert_near(&found, &expected);
    }

    #[test]
    fn width_is_the_sum_across() {
        for width in [0.1, 0.7, 1.0, 1.6, 2.0, 5.3] {
            for y in [20.0, 20.25, 20.5, 20.9] {
                let column = line([-9.0, y], [9.0, y], width, [0, 0, 1, 41]);
                let sum: f32 = column.iter().sum();
                assert!((sum - width as f32).abs() < 1e-5, "a line {width} px wide at {y} adds up to {sum}");
            }
        }
    }

    #[test]
    fn slanted_lines_measure_across() {
        // Along (4, 3), a pixel two to the right of the start lies 6/5 off the line, one below it 4/5
        // and (3, 3) from it 3/5.
        let found = line([0.5, 0.5], [4.5, 3.5], 2.0, [0, 0, 5, 5]);
        assert_near(&[found[2], found[5], found[18], found[0]], &[0.3, 0.7, 0.9, 1.0]);
    }

    #[test]
    fn every_thins_the_lines_but_not_the_border() {
        let lattice = Lattice { origin: [0.5, 0.5], spacing: [4.0, 4.0], nodes: [6, 6] };
        let rest = Positions::from_map(&lattice, |p| p);
        // Row 2 lies between lines: what it shows are the columns of lines.
        let columns = |every: usize| -> Vec<usize> {
            let out = drawn(&rest, lattice.nodes, every, 1.0, [0, 0, 21, 21]);
            let across: Vec<usize> = (0..21).filter(|&x| out[2 * 21 + x] == 1.0).collect();
            let down: Vec<usize> = (0..21).filter(|&y| out[y * 21 + 2] == 1.0).collect();
            assert_eq!(across, down);
            across
        };
        assert_eq!(columns(1), [0, 4, 8, 12, 16, 20]);
        assert_eq!(columns(2), [0, 8, 16, 20]);
        assert_eq!(columns(3), [0, 12, 20]);
        assert_eq!(columns(usize::MAX), [0, 20]);
    }

    #[test]
    fn turning_the_grid_turns_the_picture() {
        let (positions, [columns, rows]) = wavy();
        let turned = Positions { x: positions.y.clone(), y: positions.x.clone() };
        let transposed = |p: &Positions| {
            let order = || (0..columns).flat_map(|column| (0..rows).map(move |row| row * columns + column));
            Positions { x: order().map(|i| p.x[i]).collect(), y: order().map(|i| p.y[i]).collect() }
        };
        let (upright, turned) = (
            drawn(&positions, [columns, rows], 2, 1.7, [0, 0, 90, 90]),
            drawn(&transposed(&turned), [rows, columns], 2, 1.7, [0, 0, 90, 90]),
        );
        for i in 0..90 * 90 {
            assert!((upright[i] - turned[i % 90 * 90 + i / 90]).abs() < 1e-6, "sample {i}");
        }
    }

    #[test]
    fn windows_see_parts_of_one_picture() {
        let (positions, nodes) = wavy();
        let whole = drawn(&positions, nodes, 1, 1.3, [-20, -20, 150, 150]);
        assert!(whole.iter().filter(|&&sample| sample > 0.0).count() > 3000);
        let part = drawn(&positions, nodes, 1, 1.3, [13, 21, 40, 50]);
        for (i, sample) in part.iter().enumerate() {
            assert_eq!(*sample, whole[(i / 40 + 41) * 150 + i % 40 + 33], "sample {i}");
        }
    }

    #[test]
    fn far_ends_are_clipped_and_bad_ones_skipped() {
        let window = [-3, -3, 7, 7];
        let near = line([-100.0, 0.5], [100.0, 0.5], 1.0, window);
        assert_eq!(near.iter().sum::<f32>(), 7.0);
        for far in [1e8, 1e12, 1e300, f64::MAX] {
            assert_near(&line([-far, 0.5], [far, 0.5], 1.0, window), &near);
            assert_near(&line([far, 0.5], [0.5, 0.5], 1.0, window)[24..28], &[1.0; 4]);
            assert_eq!(line([-far, -far], [-far, far], 1.0, window), [0.0; 49]);
            let diagonal = line([-far, -far], [far, far], 2.0, window);
            assert!(diagonal.iter().all(|sample| (0.0..=1.0).contains(sample)), "{diagonal:?}");
            if far < 1e13 {
                assert_near(&diagonal, &line([-100.0, -100.0], [100.0, 100.0], 2.0, window));
            }
        }
        for bad in [f64::NAN, f64::INFINITY] {
            assert_eq!(line([0.5, bad], [3.5, 0.5], 1.0, window), [0.0; 49]);
        }
    }

    #[test]
    fn windows_at_the_end_of_the_world_are_empty() {
        for edge in [i64::MIN, i64::MAX] {
            assert_eq!(line([0.0, 0.0], [1e300, 1e300], 3.0, [edge, edge, 2, 2]), [0.0; 4]);
        }
        assert_eq!(drawn(&Positions { x: vec![], y: vec![] }, [0, 3], 1, 1.0, [0, 0, 2, 2]), [0.0; 4]);
        assert!(line([0.0, 0.0], [1.0, 1.0], 1.0, [0, 0, 0, 5]).is_empty());
    }

    #[test]
    fn threads_do_not_change_it() {
        let (positions, nodes) = wavy();
        let expected = drawn(&positions, nodes, 1, 2.1, [-11, -7, 131, 133]);
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            assert_eq!(pool.install(|| drawn(&positions, nodes, 1, 2.1, [-11, -7, 131, 133])), expected);
        }
    }

    #[test]
    fn watch_interrupts() {
        let (positions, nodes) = wavy();
        let mut out = vec![0.0; 100 * 100];
        let stop: Watch = &|part| if part < 0.4 { Ok(()) } else { Err(Interrupted) };
        let view = ViewMut::packed(&mut out, 100, 100);
        assert_eq!(lattice_lines(&positions, nodes, 1, 1.0, 0, 0, view, stop), Err(Interrupted));
    }

    proptest! {
        #[test]
        fn every_pixel_has_the_coverage_of_its_distance(
            ends in proptest::array::uniform4(-30.0..60.0f64), width in 0.05..9.0f64,
        ) {
            let [ax, ay, bx, by] = ends;
            let found = line([ax, ay], [bx, by], width, [-4, 3, 41, 37]);
            let segment = Segment { from: [ax, ay], to: [bx, by] };
            let pen = Pen { radius: 0.5 * width, reach: 0.5 * width + 0.5 };
            for (i, found) in found.iter().enumerate() {
                let center = [(i % 41) as f64 - 3.5, (i / 41) as f64 + 3.5];
                let expected = pen.coverage(segment.distance(center));
                prop_assert!((found - expected).abs() < 1e-6, "sample {i} is {found}, not {expected}");
            }
        }
    }
}
