//! Locate: from a tile of the destination to the source position of each of its pixels.

use super::forward::Forward;
use super::net::{Net, Place};
use super::{Map, spans::Point};
use crate::lattice::Positions;
use crate::rect::Rect;
use crate::simd::vectorized;
use crate::steps::Steps;
use crate::{Interrupted, Watch};
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
    pub x: Vec<f64>,
    pub y: Vec<f64>,
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
        self.width = tile.width();
        for values in [&mut self.x, &mut self.y] {
            values.resize(tile.width() * tile.height(), f64::NAN);
        }
        match locator {
            None => self.clear(),
            Some(Locator::Forward(forward)) => {
                self.clear();
                forward.tile(band, tile, self, watch)?;
            }
            Some(Locator::Backward { net, clip }) => gather(net, clip, tile, self),
        }
        Ok(())
    }

    /// How many pixels are drawn.
    pub fn drawn(&self) -> u64 {
        let mut count = 0;
        vectorized(
            #[inline(always)]
            || {
                for &x in &self.x {
                    count += u64::from(!x.is_nan());
                }
            },
        );
        count
    }

    pub fn height(&self) -> usize {
        self.x.len() / self.width
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
            for row in 0..located.height() {
                let (from_x, from_y) = located.row(row);
                xs[row * width + left..row * width + right].copy_from_slice(from_x);
                ys[row * width + left..row * width + right].copy_from_slice(from_y);
            }
        }
        steps.step()
    })?;
    Ok(Positions { x, y })
}

/// Rows between the one evaluated and the one fetched.
#[cfg(target_arch = "x86_64")]
const AHEAD: usize = 2;

/// Evaluates a backward map at the tile's pixel centres.
fn gather(net: &Net, clip: &Clip, tile: &Rect, out: &mut Located) {
    let columns: Vec<Place> = (tile.x0..tile.x1).map(|x| net.center(0, x)).collect();
    let first = columns.iter().map(|place| place.node.min(place.next)).min().unwrap_or(0);
    let end = columns.iter().map(|place| place.node.max(place.next) + 1).max().unwrap_or(0);
    // One node per pixel: each stands at its node, or each between its node and the next.
    let step = columns[0].next - columns[0].node.min(columns[0].next);
    let dense = columns.iter().enumerate().all(|(i, place)| place.node == first + i && place.next == first + i + step);
    let steps: Vec<f64> = columns.iter().map(|place| place.t).collect();
    let mut nodes = vec![0.0; end - first];
    vectorized(
        #[inline(always)]
        || {
            for (row, y) in (tile.y0..tile.y1).enumerate() {
                let place = net.center(1, y);
                let pixels = row * out.width..(row + 1) * out.width;
                let (xs, ys) = (&mut out.x[pixels.clone()], &mut out.y[pixels]);
                for (axis, out) in [&mut *xs, &mut *ys].into_iter().enumerate() {
                    blend_rows(net, axis, place, first, &mut nodes);
                    if dense {
                        for (((out, here), next), t) in out.iter_mut().zip(&nodes).zip(&nodes[step..]).zip(&steps) {
                            *out = here + t * (next - here);
                        }
                    } else {
                        for (out, place) in out.iter_mut().zip(&columns) {
                            *out = place.blend(nodes[place.node - first], nodes[place.next - first]);
                        }
                    }
                }
                for (x, y) in xs.iter_mut().zip(ys.iter_mut()) {
                    let inside = clip.holds([*x, *y]);
                    (*x, *y) = if inside { (*x, *y) } else { (f64::NAN, f64::NAN) };
                }
            }
        },
    );
}

/// One coordinate of the map on the line at `place`, at the columns of nodes from `first` on.
#[inline(always)]
fn blend_rows(net: &Net, axis: usize, place: Place, first: usize, out: &mut [f64]) {
    let values = [&net.positions.x, &net.positions.y][axis];
    let row = |row: usize| &values[row * net.lattice.nodes[0] + first..][..out.len()];
    let (here, next) = (row(place.node), row(place.next));
    #[cfg(target_arch = "x86_64")]
    if let Some(ahead) = values.get((place.next + AHEAD) * net.lattice.nodes[0] + first..) {
        super::simd::fetch(&ahead[..out.len().min(ahead.len())]);
    }
    for ((out, &here), &next) in out.iter_mut().zip(here).zip(next) {
        *out = place.blend(here, next);
    }
}
