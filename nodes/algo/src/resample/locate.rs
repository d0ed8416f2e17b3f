//! Locate: from a tile of the destination to the source position of each of its pixels.

use super::Map;
use super::forward::Forward;
use super::net::{Columns, Net, Place};
use super::spans::Point;
use crate::lattice::Positions;
use crate::rect::Rect;
use crate::simd::{F64_LANES, vectorized};
use crate::steps::Steps;
use crate::{Interrupted, Watch};
use pulp::Simd;
use rayon::prelude::*;

/// Pixel rows per band; bands are worked on side by side.
pub(super) const BAND_HEIGHT: usize = 64;
/// Pixel columns per tile; a band is one row of tiles.
pub(super) const TILE_WIDTH: usize = 256;

/// Source positions of a tile's pixel centres, px, row-major; NaN where nothing is drawn.
#[derive(Debug, Default)]
pub(super) struct Located {
    /// The tile's first pixel.
    pub corner: [i64; 2],
    pub width: usize,
    pub height: usize,
    /// Those of the pixels, and more of no meaning that fill up lanes.
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    /// How many pixels are drawn.
    pub drawn: u64,
}

impl Located {
    /// Locates a tile, part of band number `band`; without a locator nothing is drawn.
    pub fn locate(
        &mut self,
        locator: Option<&Locator>,
        band: usize,
        tile: &Rect,
        watch: Watch,
    ) -> Result<(), Interrupted> {
        self.corner = [tile.x0, tile.y0];
        (self.width, self.height) = (tile.width(), tile.height());
        for values in [&mut self.x, &mut self.y] {
            values.resize(self.width * self.height + F64_LANES, f64::NAN);
        }
        self.drawn = match locator {
            None => {
                self.clear();
                0
            }
            Some(Locator::Forward(forward)) => {
                self.clear();
                forward.tile(band, tile, self, watch)?;
                self.count()
            }
            Some(Locator::Backward { net, clip }) => gather(net, clip, tile, self),
        };
        Ok(())
    }

    /// How many pixels have a position.
    fn count(&self) -> u64 {
        let mut count = 0;
        vectorized(
            #[inline(always)]
            || {
                for &x in &self.x[..self.width * self.height] {
                    count += u64::from(!x.is_nan());
                }
            },
        );
        count
    }

    /// x and y of a row of the tile.
    pub fn row(&self, row: usize) -> (&[f64], &[f64]) {
        let pixels = row * self.width..(row + 1) * self.width;
        (&self.x[pixels.clone()], &self.y[pixels])
    }

    /// Nothing is drawn.
    fn clear(&mut self) {
        self.x.fill(f64::NAN);
        self.y.fill(f64::NAN);
    }
}

/// The source positions that are drawn: `low <= position < high`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clip {
    pub low: Point,
    pub high: Point,
}

impl Clip {
    /// Everything.
    pub const NONE: Self = Self { low: [f64::NEG_INFINITY; 2], high: [f64::INFINITY; 2] };

    /// `window` grown by `reach` px on all sides.
    pub fn grown(window: &Rect, reach: f64) -> Self {
        Self {
            low: [window.x0 as f64 - reach, window.y0 as f64 - reach],
            high: [window.x1 as f64 + reach, window.y1 as f64 + reach],
        }
    }

    #[inline(always)]
    pub fn holds(&self, [x, y]: Point) -> bool {
        (x >= self.low[0]) & (x < self.high[0]) & (y >= self.low[1]) & (y < self.high[1])
    }

    #[inline(always)]
    pub fn holds_lanes<S: Simd>(&self, simd: S, [x, y]: [S::f64s; 2]) -> S::m64s {
        let [low_x, low_y] = [simd.splat_f64s(self.low[0]), simd.splat_f64s(self.low[1])];
        let [high_x, high_y] = [simd.splat_f64s(self.high[0]), simd.splat_f64s(self.high[1])];
        let x = simd.and_m64s(simd.less_than_or_equal_f64s(low_x, x), simd.less_than_f64s(x, high_x));
        let y = simd.and_m64s(simd.less_than_or_equal_f64s(low_y, y), simd.less_than_f64s(y, high_y));
        simd.and_m64s(x, y)
    }
}

/// A map made ready to locate the tiles of one destination window.
pub(super) enum Locator<'a> {
    Forward(Box<Forward<'a>>),
    Backward { net: Net<'a>, clip: Clip },
}

impl<'a> Locator<'a> {
    /// `clip`: the source positions wanted; `None` for all that the map's continuation reaches.
    pub fn new(map: &Map<'a>, window: Rect, clip: Option<Clip>, watch: Watch) -> Result<Self, Interrupted> {
        Ok(match *map {
            Map::Forward { lattice, positions } => {
                Self::Forward(Box::new(Forward::new(Net::new(lattice, positions), window, clip, watch)?))
            }
            Map::Backward { lattice, positions } => {
                Self::Backward { net: Net::new(lattice, positions), clip: clip.unwrap_or(Clip::NONE) }
            }
        })
    }
}

/// Source positions of the centres of all pixels of a window, row-major; NaN where neither the map nor its
/// continuation reaches.
pub(crate) fn sources(map: &Map, window: Rect, watch: Watch) -> Result<Positions, Interrupted> {
    let locator = Locator::new(map, window, None, watch)?;
    let width = window.width();
    let (mut x, mut y) = (vec![f64::NAN; width * window.height()], vec![f64::NAN; width * window.height()]);
    let steps = Steps::new(watch, window.height().div_ceil(BAND_HEIGHT));
    let bands = x.par_chunks_mut(width * BAND_HEIGHT).zip(y.par_chunks_mut(width * BAND_HEIGHT)).enumerate();
    bands.try_for_each(|(index, (xs, ys))| {
        let top = window.y0 + (index * BAND_HEIGHT) as i64;
        let mut located = Located::default();
        for left in (0..width).step_by(TILE_WIDTH) {
            let right = width.min(left + TILE_WIDTH);
            let height = (xs.len() / width) as i64;
            let tile = Rect::new(window.x0 + left as i64, top, window.x0 + right as i64, top + height);
            located.locate(Some(&locator), index, &tile, watch)?;
            for row in 0..located.height {
                let (from_x, from_y) = located.row(row);
                xs[row * width + left..row * width + right].copy_from_slice(from_x);
                ys[row * width + left..row * width + right].copy_from_slice(from_y);
            }
        }
        steps.step()
    })?;
    Ok(Positions { x, y })
}

/// Evaluates a backward map at the tile's pixel centres. Returns how many are drawn.
fn gather(net: &Net, clip: &Clip, tile: &Rect, out: &mut Located) -> u64 {
    let places: Vec<Place> = (tile.x0..tile.x1).map(|x| net.center(0, x)).collect();
    let needed = || places.iter().flat_map(|place| [place.node, place.next]);
    let first = needed().min().unwrap_or(0);
    let columns = Columns::new(&places, first);
    let mut nodes = vec![0.0; needed().max().map_or(0, |last| last + 1 - first)];
    let mut drawn = 0;
    vectorized(
        #[inline(always)]
        || {
            for (row, y) in (tile.y0..tile.y1).enumerate() {
                let place = net.center(1, y);
                let pixels = row * out.width..(row + 1) * out.width;
                let (xs, ys) = (&mut out.x[pixels.clone()], &mut out.y[pixels]);
                net.line(0, place, first, &mut nodes);
                columns.blend(&nodes, xs);
                net.line(1, place, first, &mut nodes);
                columns.blend(&nodes, ys);
                let mut inside = 0;
                for (&x, &y) in xs.iter().zip(&*ys) {
                    inside += u64::from(clip.holds([x, y]));
                }
                drawn += inside;
                if inside == out.width as u64 {
                    continue;
                }
                for (x, y) in xs.iter_mut().zip(ys) {
                    let inside = clip.holds([*x, *y]);
                    (*x, *y) = if inside { (*x, *y) } else { (f64::NAN, f64::NAN) };
                }
            }
        },
    );
    drawn
}
