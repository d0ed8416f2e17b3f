//! The values of a block of pixels from copies of the ellipses' part of the source, or of a level of it, with a pixel's
//! channels side by side: they hold what lies beyond the edges, and a large picture's rows do not push each other out of
//! the cache.

use super::axes::{Axes, Shapes};
use super::block::{Ahead, Block, Part, Pixels, Samples};
use super::ellipse::{Ellipse, Spot, means};
use super::ewa::{Ewa, mixed};
use super::lanes::{LANES, Lanes};
use super::locate::Located;
use super::whole::integer;
use std::ops::Range;

/// Planes that are weighed together.
pub(super) const TOGETHER: usize = 4;
/// Columns and rows of a block.
pub(super) const WIDTH: usize = 64;
pub(super) const ROWS: usize = 16;
/// Pixels of a copy: two mebibytes.
const MOST: usize = 1 << 17;
/// Up to how many pixels a copy may hold per ellipse: more are the gaps between ellipses that lie far apart.
const SPREAD: usize = 64;

/// Bytes of what is kept from block to block, at most.
pub(super) const BYTES: usize = MOST * size_of::<[f32; TOGETHER]>() + ROWS * (size_of::<Values>() + size_of::<Line>());

/// A copy of a part of a level.
struct Copied<'a> {
    /// The first sample's column and row.
    corner: [i32; 2],
    samples: Samples<'a, TOGETHER>,
    /// What the row below needs besides.
    ahead: Ahead<'a, TOGETHER>,
}

/// The values of a row of a block.
pub(super) type Values = [[f32; TOGETHER]; WIDTH];

/// Draws blocks of pixels.
#[derive(Default)]
pub(super) struct Ellipses {
    /// Row by row; NaN where an ellipse must be drawn alone.
    pub values: Vec<Values>,
    lines: Vec<Line>,
    block: Block<TOGETHER>,
}

impl Ellipses {
    /// Draws a block of the planes from number `first` on.
    #[inline(always)]
    pub fn draw<L: Lanes>(
        &mut self,
        lanes: L,
        ewa: &Ewa,
        at: &Located,
        shapes: &Shapes,
        pixels: &Pixels,
        first: usize,
    ) {
        let count = pixels.rows.len();
        self.values.resize(ROWS, [[f32::NAN; TOGETHER]; WIDTH]);
        self.values.iter_mut().for_each(|values| values.as_flattened_mut().fill(f32::NAN));
        self.lines.resize(ROWS, Line::EMPTY);
        if ewa.clamps() {
            return;
        }
        let used = shapes.used(at.width, pixels);
        for level in (0..u32::BITS as usize).filter(|level| used >> level & 1 == 1) {
            for (row, line) in pixels.rows.clone().zip(&mut self.lines) {
                let first = row * at.width;
                line.fill(ewa, at, shapes, first + pixels.columns.start..first + pixels.columns.end, level);
            }
            let mut row = 0;
            while row < count {
                let (rows, part) = part_of(&self.lines[row..count]);
                self.rows(lanes, ewa, row..row + rows, part, level, first);
                row += rows;
            }
        }
    }

    /// Draws rows of the block from a part of a level.
    #[inline(always)]
    fn rows<L: Lanes>(
        &mut self,
        lanes: L,
        ewa: &Ewa,
        rows: Range<usize>,
        part: Option<Part>,
        level: usize,
        first: usize,
    ) {
        // Where there are fewer, the last one fills up.
        let last = ewa.plane_count() - 1;
        let planes: [_; TOGETHER] = std::array::from_fn(|i| ewa.level(level, last.min(first + i)).0);
        let Self { lines, values, block } = self;
        let Some(part) = part else {
            for row in rows {
                lines[row].draw(lanes, None, &mut values[row]);
            }
            return;
        };
        let mut supply = block.supply(&ewa.level(level, 0).1.source, planes, part, None).unfetched();
        for row in rows.clone() {
            let next = &lines[(row + 1).min(rows.end - 1)];
            supply.samples(lines[row].depth(&part));
            let ahead = supply.ahead(next.depth(&part));
            let copy = Copied { corner: part.corner, samples: supply.samples(0), ahead };
            lines[row].draw(lanes, Some(copy), &mut values[row]);
        }
    }
}

/// As many of the rows, from the first on, as one part of the level serves; none if that would be too large, or there is
/// nothing to draw.
fn part_of(lines: &[Line]) -> (usize, Option<Part>) {
    let mut count = lines.len();
    loop {
        let lines = &lines[..count];
        let low = [0, 1].map(|axis| lines.iter().map(|line| line.low[axis]).min().unwrap_or(0));
        let high = [0, 1].map(|axis| lines.iter().map(|line| line.high[axis]).max().unwrap_or(0));
        let drawn: usize = lines.iter().map(|line| line.drawn).sum();
        if drawn == 0 {
            return (count, None);
        }
        let size = [0, 1].map(|axis| (i64::from(high[axis]) - i64::from(low[axis])) as usize);
        if size[0].saturating_mul(size[1]) <= MOST.min(SPREAD * drawn) {
            return (count, Some(Part { corner: low, size }));
        }
        if count == 1 {
            return (count, None);
        }
        count /= 2;
    }
}

/// The ellipses of a row of pixels in a level.
#[derive(Clone)]
struct Line {
    count: usize,
    along: [f32; WIDTH],
    slope: [f32; WIDTH],
    down: [f32; WIDTH],
    dip: [f32; WIDTH],
    /// The first sample of each: from the centre, and its column and row.
    from: [[f32; WIDTH]; 2],
    first: [[i32; WIDTH]; 2],
    /// Columns and rows of samples; no rows where none is drawn.
    columns: [i32; WIDTH],
    rows: [i32; WIDTH],
    /// The level's share of the value; the one before has the rest.
    part: [f32; WIDTH],
    /// What all of them hold.
    low: [i32; 2],
    high: [i32; 2],
    /// How many are drawn.
    drawn: usize,
}

impl Line {
    const EMPTY: Self = Self {
        count: 0,
        along: [0.0; WIDTH],
        slope: [0.0; WIDTH],
        down: [0.0; WIDTH],
        dip: [0.0; WIDTH],
        from: [[0.0; WIDTH]; 2],
        first: [[0; WIDTH]; 2],
        columns: [0; WIDTH],
        rows: [0; WIDTH],
        part: [1.0; WIDTH],
        low: [i32::MAX; 2],
        high: [i32::MIN; 2],
        drawn: 0,
    };

    /// The ellipses of a range of a tile's pixels.
    #[inline(always)]
    fn fill(&mut self, ewa: &Ewa, at: &Located, shapes: &Shapes, pixels: Range<usize>, level: usize) {
        self.count = pixels.len();
        let frame = ewa.level(level, 0).1;
        let [major, minor, cos, sin] = shapes.rows(pixels.clone()).map(padded);
        let (xs, ys) = (padded(&at.x[pixels.clone()]), padded(&at.y[pixels.clone()]));
        // Loops of fixed length compile to whole vectors.
        for i in 0..WIDTH {
            let axes = Axes { squares: [major[i], minor[i]], twice: [cos[i], sin[i]] };
            let ellipse = Ellipse::new(&axes, level, frame.grown);
            let [x, y] = frame.place(ewa.place([xs[i], ys[i]])).map(|at| at - 0.5);
            let reach = ellipse.reach();
            let [left, top] = [(x - reach[0]).ceil(), (y - reach[1]).ceil()];
            let spot = ellipse.spot(left - x, top - y);
            (self.along[i], self.slope[i], self.down[i], self.dip[i]) = (spot.along, spot.slope, spot.down, spot.dip);
            (self.from[0][i], self.from[1][i]) = (spot.x, spot.y);
            (self.first[0][i], self.first[1][i]) = (integer(left), integer(top));
            (self.columns[i], self.rows[i]) = (ellipse.width(), ellipse.rows());
        }
        let [levels, before] = shapes.levels.each_ref().map(|levels| padded(&levels[pixels.clone()]));
        let (parts, level) = (padded(&shapes.part[pixels.clone()]), level as i32);
        for i in 0..WIDTH {
            let here = (levels[i] == level) | (before[i] == level);
            self.rows[i] = if here & (i < self.count) & !xs[i].is_nan() { self.rows[i] } else { 0 };
            self.part[i] = if levels[i] == level { parts[i] } else { 1.0 };
        }
        let ([left, top], columns, rows) = (&self.first, &self.columns, &self.rows);
        let (mut low, mut high, mut count) = ([i32::MAX; 2], [i32::MIN; 2], 0);
        for i in 0..WIDTH {
            let drawn = rows[i] > 0;
            low[0] = low[0].min(if drawn { left[i] } else { i32::MAX });
            low[1] = low[1].min(if drawn { top[i] } else { i32::MAX });
            high[0] = high[0].max(if drawn { left[i] + columns[i] } else { i32::MIN });
            high[1] = high[1].max(if drawn { top[i] + rows[i] } else { i32::MIN });
            count += i32::from(drawn);
        }
        (self.low, self.high, self.drawn) = (low, high, count as usize);
    }

    /// Rows of a part that they need.
    fn depth(&self, part: &Part) -> usize {
        (i64::from(self.high[1]) - i64::from(part.corner[1])).max(0) as usize
    }

    /// Draws them, or says that they must be drawn alone.
    #[inline(always)]
    fn draw<L: Lanes>(&self, lanes: L, copy: Option<Copied>, values: &mut Values) {
        let copy = copy.as_ref();
        for first in (0..self.count).step_by(4) {
            if let Some(copy) = copy {
                copy.ahead.fetch(first / 4, self.count.div_ceil(4));
            }
            // Closures given to arrays are not always compiled for the vectors at hand.
            let a = self.sums(lanes, first, copy);
            let b = self.sums(lanes, first + 1, copy);
            let c = self.sums(lanes, first + 2, copy);
            let d = self.sums(lanes, first + 3, copy);
            let means = means(lanes, [a, b, c, d]);
            for (i, means) in (first..self.count).zip(means) {
                let part = self.part[i];
                let mix = |plane: usize| mixed(values[i][plane], means[plane], part);
                match self.rows[i] {
                    0 => {}
                    _ if part < 1.0 => values[i] = std::array::from_fn(mix),
                    _ => values[i] = means,
                }
            }
        }
    }

    /// The sums of a pixel; zeros if it is not drawn here.
    #[inline(always)]
    fn sums<L: Lanes>(&self, lanes: L, i: usize, copy: Option<&Copied>) -> [L::Two; 2] {
        let (Some(Copied { corner, samples, .. }), rows @ 1..) = (copy, self.rows[i]) else {
            return [lanes.splat(0.0); 2];
        };
        let column = (self.first[0][i] - corner[0]) as usize;
        let row = (self.first[1][i] - corner[1]) as usize;
        let spot = Spot {
            along: self.along[i],
            slope: self.slope[i],
            down: self.down[i],
            dip: self.dip[i],
            x: self.from[0][i],
            y: self.from[1][i],
        };
        let pixels = samples.from((row * samples.stride + column) as u32);
        let is_narrow = self.columns[i] == LANES as i32;
        spot.sums(lanes, is_narrow, rows as usize, pixels, samples.stride)
    }
}

/// Values as many as a row of a block has.
#[inline(always)]
fn padded<T: Copy + Default>(values: &[T]) -> [T; WIDTH] {
    values.first_chunk().copied().unwrap_or_else(|| {
        let mut all = [T::default(); WIDTH];
        all[..values.len()].copy_from_slice(values);
        all
    })
}
