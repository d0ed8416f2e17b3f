//! Locating through a forward map: its cells are drawn into the destination.

use super::cell::{Corners, InverseAffine, InverseBilinear, InverseNearlyAffine, Shape};
use super::locate::{BAND_HEIGHT, Clip, Located};
use super::net::{Axis, Net};
use super::spans::{Centers, Point, Spans};
use crate::bins::by_band;
use crate::rect::Rect;
use crate::simd::{counted, lanes_of};
use crate::{Interrupted, Watch};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

/// Nodes farther away than this, px, count as not finite.
const FARTHEST: f64 = (1_u64 << 40) as f64;
/// Cells per strip.
const STRIP: usize = 32;
/// Without a clip the continuation reaches this many times the size of what it has to cover.
const CONTINUED: f64 = 64.0;

/// Cells of one row that are binned together, and the pixels of the window that they may own.
#[derive(Clone, Copy, Debug)]
struct Strip {
    row: u32,
    first: u32,
    end: u32,
    /// Columns of the window, start and end.
    columns: [u32; 2],
    /// Rows of the window, start and end.
    rows: [u32; 2],
}

/// A forward map whose cells are binned to the bands of a destination window.
pub(super) struct Forward<'a> {
    net: Net<'a>,
    columns: Axis,
    rows: Axis,
    clip: Clip,
    window: Rect,
    strips: Vec<Strip>,
    /// For each band its strips, in the order of drawing.
    bands: Vec<Vec<u32>>,
}

impl<'a> Forward<'a> {
    pub fn new(net: Net<'a>, window: Rect, clip: Option<Clip>, watch: Watch) -> Result<Self, Interrupted> {
        let continued = continuation(&net, &window);
        let [columns, rows] = [0, 1].map(|axis| {
            let from = net.lattice.origin[axis];
            let to = from + net.lattice.size()[axis];
            Axis::new(&net, axis, clip.map_or([continued; 2], |clip| [from - clip.low[axis], clip.high[axis] - to]))
        });
        let (clip, strips, bands) = (clip.unwrap_or(Clip::NONE), Vec::new(), Vec::new());
        let mut forward = Self { net, columns, rows, clip, window, strips, bands };
        forward.bin(watch)?;
        Ok(forward)
    }

    /// Cuts the cells into strips, those of the continuation first so that it never hides the lattice, and lists
    /// them by band.
    fn bin(&mut self, watch: Watch) -> Result<(), Interrupted> {
        let [columns, rows] = [0, 1].map(|axis| self.wanted(axis));
        let whole = 0..self.columns.cells();
        let own = self.columns.own();
        // Row by row and then together.
        let most = (columns.len() / STRIP + 4) * rows.len();
        watch.reserve(2 * most * size_of::<Strip>())?;
        let ring = rows.clone().into_par_iter().map(|row| {
            let parts = if self.rows.own().contains(&row) {
                [whole.start..own.start, own.end..whole.end]
            } else {
                [whole.clone(), whole.end..whole.end]
            };
            watch.go_on().map(|()| parts.map(|part| self.strips_of(row, overlap(&part, &columns))).concat())
        });
        let inner = overlap(&self.rows.own(), &rows)
            .into_par_iter()
            .map(|row| watch.go_on().map(|()| self.strips_of(row, overlap(&own, &columns))));
        let strips = ring.chain(inner).collect::<Result<Vec<Vec<Strip>>, _>>()?.concat();
        let touched = |strip: &Strip| strip.rows[0] as usize..strip.rows[1] as usize;
        self.bands = by_band(&strips, touched, BAND_HEIGHT, self.window.height().div_ceil(BAND_HEIGHT), watch)?;
        self.strips = strips;
        Ok(())
    }

    /// The cells along an axis that the clip does not leave out.
    fn wanted(&self, axis: usize) -> Range<usize> {
        let stops = &[&self.columns, &self.rows][axis].stops;
        let start = stops[1..].partition_point(|&end| end <= self.clip.low[axis]);
        start..stops[..stops.len() - 1].partition_point(|&begin| begin < self.clip.high[axis])
    }

    /// Strips of the cells `cells` of a row that may own pixels of the window.
    fn strips_of(&self, row: usize, cells: Range<usize>) -> Vec<Strip> {
        let (columns, rows) =
            (Centers::new(self.window.x0, self.window.x1), Centers::new(self.window.y0, self.window.y1));
        let mut nodes = Vec::new();
        let mut strips = Vec::new();
        for first in cells.clone().step_by(STRIP) {
            let end = cells.end.min(first + STRIP);
            nodes.clear();
            self.load(row, first..end + 1, &mut nodes);
            self.load(row + 1, first..end + 1, &mut nodes);
            let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
            for &[x, y] in &nodes {
                low = [low[0].min(x), low[1].min(y)];
                high = [high[0].max(x), high[1].max(y)];
            }
            let columns = [low[0], high[0]].map(|x| columns.not_before(x) as u32);
            let rows = [low[1], high[1]].map(|y| rows.not_before(y) as u32);
            if columns[0] < columns[1] && rows[0] < rows[1] {
                strips.push(Strip { row: row as u32, first: first as u32, end: end as u32, columns, rows });
            }
        }
        strips
    }

    /// Appends the positions of nodes of a row, both coordinates NaN where a node cannot be drawn.
    fn load(&self, row: usize, columns: Range<usize>, nodes: &mut Vec<Point>) {
        let usable = |node: Point| if is_usable(node) { node } else { [f64::NAN; 2] };
        let (own, before) = (self.columns.own(), self.columns.before);
        let place = self.rows.places[row];
        if place.t == 0.0 && columns.start >= own.start && columns.end <= own.end + 1 {
            let start = place.node * self.columns.nodes + columns.start - before;
            let range = start..start + columns.len();
            let (xs, ys) = (&self.net.positions.x[range.clone()], &self.net.positions.y[range]);
            nodes.extend(xs.iter().zip(ys).map(|(&x, &y)| usable([x, y])));
        } else {
            nodes.extend(columns.map(|column| usable(self.net.position(self.columns.places[column], place))));
        }
    }

    /// Locates a tile of band number `band`.
    pub fn tile(&self, band: usize, tile: &Rect, out: &mut Located, watch: Watch) -> Result<(), Interrupted> {
        self.tile_by(Arch::new(), band, tile, out, watch)
    }

    /// By one of the processor's kinds of lanes.
    fn tile_by(
        &self,
        arch: Arch,
        band: usize,
        tile: &Rect,
        out: &mut Located,
        watch: Watch,
    ) -> Result<(), Interrupted> {
        let mut drawing = Drawing { spans: Spans::new(tile), columns: Centers::new(tile.x0, tile.x1), out };
        let [left, right] = [tile.x0, tile.x1].map(|x| (x - self.window.x0) as u32);
        let (mut upper, mut lower) = (Vec::new(), Vec::new());
        for &index in &self.bands[band] {
            let Strip { row, first, end, columns, .. } = self.strips[index as usize];
            if columns[0] >= right || columns[1] <= left {
                continue;
            }
            watch.go_on()?;
            let (row, first, end) = (row as usize, first as usize, end as usize);
            upper.clear();
            lower.clear();
            self.load(row, first..end + 1, &mut upper);
            self.load(row + 1, first..end + 1, &mut lower);
            arch.dispatch(Cells { forward: self, row, first, upper: &upper, lower: &lower, drawing: &mut drawing });
        }
        Ok(())
    }

    #[inline(always)]
    fn draw(&self, simd: impl Simd, cell: [usize; 2], corners: &Corners, drawing: &mut Drawing) {
        let rows = drawing.spans.trace(simd, corners);
        if rows.is_empty() {
            return;
        }
        let shape = Shape::of(corners);
        if !self.is_own(cell) && !self.continues(cell, shape) {
            return;
        }
        let source = self.source(cell);
        match shape {
            Shape::Convex { mirrored } => {
                if let Some(inverse) = InverseNearlyAffine::new(corners) {
                    return drawing.fill_lanes(simd, rows, &source, &inverse);
                }
                let inverse = InverseBilinear::new(corners, mirrored);
                if inverse.is_uneven() {
                    drawing.fill(rows, &source, |p| inverse.polished(p));
                } else {
                    drawing.fill(rows, &source, |p| inverse.at(p));
                }
            }
            Shape::Folded { split } => {
                for third in [1, 2] {
                    let ends = [split, split + third, (split + third + 1) % 4];
                    drawing.fill_triangle(simd, ends.map(|i| (corners[i], UNIT_CORNERS[i])), &source);
                }
            }
        }
    }

    fn is_own(&self, [column, row]: [usize; 2]) -> bool {
        self.columns.own().contains(&column) && self.rows.own().contains(&row)
    }

    /// Whether a piece of the continuation lies the same way round as the border cell that it continues, neither
    /// of them folded.
    fn continues(&self, [column, row]: [usize; 2], shape: Shape) -> bool {
        let border = self.net.corners([self.columns.origin_cell(column), self.rows.origin_cell(row)]);
        matches!(shape, Shape::Convex { .. }) && border.into_iter().all(is_usable) && Shape::of(&border) == shape
    }

    fn source(&self, [column, row]: [usize; 2]) -> Source {
        let low = [self.columns.stops[column], self.rows.stops[row]];
        let high = [self.columns.stops[column + 1], self.rows.stops[row + 1]];
        let inside = self.clip.holds(low) && high[0] < self.clip.high[0] && high[1] < self.clip.high[1];
        Source { low, size: [high[0] - low[0], high[1] - low[1]], clip: (!inside).then_some(self.clip) }
    }
}

/// Neighbouring cells of a row, from number `first` on, to be drawn.
struct Cells<'a, 'b, 'c> {
    forward: &'a Forward<'b>,
    row: usize,
    first: usize,
    /// Their nodes.
    upper: &'a [Point],
    lower: &'a [Point],
    drawing: &'a mut Drawing<'c>,
}

impl WithSimd for Cells<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (i, (upper, lower)) in self.upper.windows(2).zip(self.lower.windows(2)).enumerate() {
            let corners = [upper[0], upper[1], lower[1], lower[0]];
            self.forward.draw(simd, [self.first + i, self.row], &corners, self.drawing);
        }
    }
}

/// Whether a node's cells can be drawn.
fn is_usable([x, y]: Point) -> bool {
    x.abs() <= FARTHEST && y.abs() <= FARTHEST
}

fn overlap(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    a.start.max(b.start)..a.end.min(b.end)
}

/// How far, px, the continuation reaches where no clip ends it: `CONTINUED` times the width plus height of what
/// the window and the lattice's border cover together.
fn continuation(net: &Net, window: &Rect) -> f64 {
    let [columns, rows] = net.lattice.nodes;
    let border = (0..columns)
        .flat_map(|column| [column, (rows - 1) * columns + column])
        .chain((0..rows).flat_map(|row| [row * columns, (row + 1) * columns - 1]));
    let mut low = [window.x0 as f64, window.y0 as f64];
    let mut high = [window.x1 as f64, window.y1 as f64];
    for node in border {
        let (x, y) = (net.positions.x[node], net.positions.y[node]);
        if is_usable([x, y]) {
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
        }
    }
    CONTINUED * (high[0] - low[0] + high[1] - low[1])
}

/// (u, v) of a cell's corners.
const UNIT_CORNERS: Corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

/// A cell's rectangle in the source.
struct Source {
    low: Point,
    size: Point,
    /// Present where part of the rectangle is not drawn.
    clip: Option<Clip>,
}

/// A tile being drawn.
struct Drawing<'a> {
    spans: Spans,
    columns: Centers,
    out: &'a mut Located,
}

impl Drawing<'_> {
    #[inline(always)]
    fn fill_triangle(&mut self, simd: impl Simd, corners: [(Point, Point); 3], source: &Source) {
        let polygon = corners.map(|(position, _)| position);
        let [a, b, c] = corners.map(|(_, uv)| uv);
        let inverse = InverseAffine::new(polygon);
        let rows = self.spans.trace(simd, &polygon);
        self.fill(rows, source, |p| {
            let [s, t] = inverse.at(p);
            [0, 1].map(|i| a[i] + s * (b[i] - a[i]) + t * (c[i] - a[i]))
        });
    }

    /// Fills the spans traced last with source positions, many at a time.
    #[inline(always)]
    fn fill_lanes<S: Simd>(&mut self, simd: S, rows: Range<usize>, source: &Source, inverse: &InverseNearlyAffine) {
        let Source { low, size, clip } = source;
        for row in rows {
            let run = self.spans.run(row);
            for first in run.clone().step_by(S::F64_LANES) {
                let [u, v] = inverse.at(simd, self.columns.at(first), self.spans.row_center(row));
                let x = simd.mul_add_f64s(u, simd.splat_f64s(size[0]), simd.splat_f64s(low[0]));
                let y = simd.mul_add_f64s(v, simd.splat_f64s(size[1]), simd.splat_f64s(low[1]));
                let mut here = simd.less_than_f64s(counted(simd, 0.0), simd.splat_f64s((run.end - first) as f64));
                if let Some(clip) = clip {
                    here = simd.and_m64s(here, clip.holds_lanes(simd, [x, y]));
                }
                let to = row * self.out.width + first;
                for (all, values) in [(&mut self.out.x, x), (&mut self.out.y, y)] {
                    let values_there = lanes_of::<S>(all, to);
                    *values_there = simd.select_f64s(here, values, *values_there);
                }
            }
        }
    }

    /// Fills the spans traced last with source positions; `uv` gives the place in the cell of a pixel centre.
    #[inline(always)]
    fn fill(&mut self, rows: Range<usize>, source: &Source, uv: impl Fn(Point) -> Point) {
        match source.clip {
            None => self.fill_where(rows, source, uv, |_| true),
            Some(clip) => self.fill_where(rows, source, uv, |position| clip.holds(position)),
        }
    }

    #[inline(always)]
    fn fill_where(
        &mut self,
        rows: Range<usize>,
        Source { low, size, .. }: &Source,
        uv: impl Fn(Point) -> Point,
        wanted: impl Fn(Point) -> bool,
    ) {
        for row in rows {
            let run = self.spans.run(row);
            if run.is_empty() {
                continue;
            }
            let y = self.spans.row_center(row);
            let pixels = row * self.out.width + run.start..row * self.out.width + run.end;
            let (xs, ys) = (&mut self.out.x[pixels.clone()], &mut self.out.y[pixels]);
            for ((column, to_x), to_y) in run.zip(xs).zip(ys) {
                let [u, v] = uv([self.columns.at(column), y]);
                let position = [low[0] + u * size[0], low[1] + v * size[1]];
                if wanted(position) {
                    [*to_x, *to_y] = position;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UNWATCHED;
    use crate::lattice::{Lattice, Positions};

    /// Where a tile's pixels come from, as bits.
    fn located(arch: Arch, positions: &Positions, lattice: &Lattice, clip: Option<Clip>) -> Vec<[u64; 2]> {
        let window = Rect::new(3, -7, 3 + 100, 50);
        let forward = Forward::new(Net::new(lattice, positions), window, clip, UNWATCHED).expect("unwatched");
        let mut out = Located::default();
        out.locate(None, 0, &window, UNWATCHED).expect("unwatched");
        forward.tile_by(arch, 0, &window, &mut out, UNWATCHED).expect("unwatched");
        out.x.iter().zip(&out.y).map(|(x, y)| [x.to_bits(), y.to_bits()]).collect()
    }

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn all_processors_locate_alike() {
        let wide = pulp::x86::V3::try_new().map(Arch::V3);
        let widest = pulp::x86::V4::try_new().map(Arch::V4);
        for (cell, bend) in [(5.0, 0.3), (5.0, 4.0), (13.0, 6.0), (40.0, 20.0)] {
            let lattice = Lattice { origin: [-4.0, 2.0], spacing: [cell; 2], nodes: [9, 7] };
            let bent = |[x, y]: Point| {
                let (s, c) = (libm::sin(0.3 * y / cell), libm::cos(0.7 * x / cell));
                [0.9 * x - 0.4 * y + bend * s + 11.0, 0.5 * x + y + bend * c]
            };
            let positions = Positions::from_map(&lattice, bent);
            for clip in [None, Some(Clip { low: [1.0, 4.0], high: [6.0 * cell, 5.0 * cell] })] {
                let plain = located(Arch::Scalar, &positions, &lattice, clip);
                assert!(plain.iter().any(|[x, _]| !f64::from_bits(*x).is_nan()));
                for arch in [wide, widest].into_iter().flatten() {
                    assert!(located(arch, &positions, &lattice, clip) == plain, "{arch:?} {cell} {bend}");
                }
            }
        }
    }
}
