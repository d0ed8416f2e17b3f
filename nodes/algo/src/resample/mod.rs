//! Drawing a picture through a warp.
//!
//! Two ideas, apart: *locate* finds the source position of each destination pixel (`locate`, `forward`), *sample*
//! turns source positions into filtered values (`sample`, and block by block `filtered`). A map is a lattice with the
//! positions of its nodes, bilinear between them; outside the lattice the border cells' bilinear patches continue.
//!
//! A forward map is drawn cell by cell: where no cell folds, every pixel centre in the image of the lattice is
//! owned by exactly one cell, shared edges and vertices included (`spans` says how that is decided), and its source
//! position is the inverse of the bilinear map, to rounding (`cell`). A cell with a corner whose Jacobian is zero or differs
//! in sign from another's is drawn as two triangles, cut along the diagonal that leaves both the same way round if
//! there is one, else along the one from its first node. Where cells overlap the last in row-major order wins.
//! A cell with a node that is not finite, or farther than 2^40 px away, is not drawn.
//!
//! The continuation of a forward map is drawn under the lattice and ends where it would fold; a folded border cell is
//! not continued. With [`Edge::Transparent`] it reaches as far as the source window grown by the filter's reach.
//! With the other edges it reaches 64 times the width plus height of the rectangle around the destination
//! window and the lattice's border nodes: all of the destination, where the map does not shrink more than that.

mod axes;
mod block;
mod bounds;
mod cell;
mod ellipse;
mod ellipses;
mod ewa;
mod filter;
mod filtered;
mod forward;
mod jacobian;
mod lanes;
mod locate;
mod net;
mod pixels;
mod pyramid;
mod sample;
#[cfg(target_arch = "x86_64")]
mod simd;
mod spans;
mod taps;
mod weigh;
mod whole;

pub use bounds::bounds;
pub use filter::Filter;
pub(crate) use locate::sources;
pub(crate) use net::{Net, Place};
pub use pixels::{pixel_sources, residual};
pub use sample::Edge;

use crate::lattice::{Lattice, Positions};
use crate::rect::Rect;
use crate::view::{View, ViewMut};
use crate::{Interrupted, Watch};
use ewa::Ewa;
use filtered::{Blocks, filtered};
use locate::{BAND_HEIGHT, Clip, Located, Locator, TILE_WIDTH};
use rayon::prelude::*;
use sample::Source;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A warp: a lattice with a position for each of its nodes, and which way it points.
#[derive(Clone, Copy, Debug)]
pub enum Map<'a> {
    /// `dst_from_src`: the lattice lies in the source, positions say where its nodes go.
    Forward {
        /// The lattice in the source.
        lattice: &'a Lattice,
        /// Where its nodes go.
        positions: &'a Positions,
    },
    /// `src_from_dst`: the lattice lies in the destination, positions say where its nodes come from.
    Backward {
        /// The lattice in the destination.
        lattice: &'a Lattice,
        /// Where its nodes come from.
        positions: &'a Positions,
    },
}

/// How values are made of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sampling {
    /// What a value is made of.
    pub filter: Filter,
    /// What lies outside the source window.
    pub edge: Edge,
    /// Whether a filter's overshoot is cut: a value lies between the least and the greatest of the samples with weight
    /// whose centres lie within 1 px along both axes, four of them between pixels.
    pub clamp_ringing: bool,
}

/// What was drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Drawn {
    /// Pixels that were drawn; the others are 0.
    pub pixels: u64,
    /// Samples drawn, in all planes, that are NaN or infinite.
    pub bad: u64,
}

/// Draws planes of samples through a warp.
///
/// The value of a destination pixel is the source filtered at the source position of the pixel's centre; but for Ewa
/// the filter's footprint does not grow where the map shrinks. Sums are f32 in a fixed order, each product and
/// the sum it goes to rounded once, on processors without an instruction for that slowly. With a filter that
/// interpolates (all but Mitchell) a position within 2^-25 px of a pixel's centre gives that pixel's sample bit for
/// bit. Samples of weight zero are not read, so NaN and infinity spread no farther than the footprint.
///
/// Ewa takes the map's Jacobian at the pixel: of a backward map the differences across the pixel, where one side is not finite
/// twice those to the other, of a forward map the inverse of its cell's derivative. With singular values a >= b, px per pixel, raised to 1 and to b >= a / 16, the
/// pixel covers an ellipse with these semi-axes in the source. Where a <= 1, and where the Jacobian is not finite,
/// Cubic is drawn, bit for bit; from a = 5/4 on the weighted mean over the ellipse; between them a smooth mix. A sample at
/// the distance r from the centre, in units of the axes, weighs `(1 - u)^2 (1 - c u)`, u = (r / R)^2 < 1, over the sum,
/// with R = 5/6 + 2 / 3b, and c such that the second moments are those of the pixel itself. Where b > 4 the samples
/// are means of 2 x 2 pixels of the source, where b > 6 of 4 x 4, where b > 12 of 8 x 8 and so on; each change is a smooth mix
/// that ends at 5/4 of where it starts. Where the source has odd sides these pixels are a little smaller, so that they
/// cover it exactly and repeat where it does. There are sizes down to one pixel. Which sizes are made is decided at the corners of the map's cells;
/// pixels that shrink more than these, on a continuation far out, take an ellipse of the last one's reach. With
/// `clamp_ringing` the range is that of samples of positive weight.
///
/// - `map`: the warp; one position per node, nodes may be non-finite (see the module's text).
/// - `source_window`: the pixels that `planes` hold.
/// - `dst_window`: the pixels that `out` holds.
/// - `sampling`: how a value is made, and of what outside the source window.
/// - `planes`: any number of channels, each of the source window's size.
/// - `out`: as many, each of the destination window's size; every sample is written.
/// - `watch`: told the part done.
///
/// Pixels that are not drawn are 0: those that no cell covers and, with [`Edge::Transparent`], those whose position
/// lies outside the source window grown by the filter's reach (0, 1/2, 3/2 or 5/2 px for nearest, linear, the cubics
/// and Lanczos; 3/2 of the map's greatest a for Ewa). Nothing is drawn from an empty source window, or without planes. On `Interrupted`, `out` is partly
/// written.
///
/// Cost: linear in the cells and in the destination's pixels times planes; for Ewa times the samples of an ellipse,
/// some 17 where a = b = 2, 50 where a = b = 4, and 1200 at most, planes taken four at a time; making the source smaller reads
/// it once for each size and asks `watch` for a third of its size at most, and for a rim with [`Edge::Clamp`]. Bands of 64 rows go side by side; the result does not depend
/// on how many.
///
/// Keys' cubic: R. Keys, "Cubic convolution interpolation for digital image processing", IEEE Trans. ASSP 29, 1981,
/// equation 15. Mitchell's: D. Mitchell and A. Netravali, "Reconstruction filters in computer graphics", SIGGRAPH
/// 1988, equation 8. The exact sign of a turn: J. Shewchuk, "Adaptive precision floating-point arithmetic and fast
/// robust geometric predicates", 1997. The ellipse: N. Greene and P. Heckbert, "Creating raster omnimax images from
/// multiple perspective views using the elliptical weighted average filter", IEEE CG&A 6(6), 1986. The halved pictures: L.
/// Williams, "Pyramidal parametrics", SIGGRAPH 1983.
pub fn draw(
    map: &Map,
    source_window: Rect,
    dst_window: Rect,
    sampling: &Sampling,
    planes: &[View<f32>],
    out: Vec<ViewMut<f32>>,
    watch: Watch,
) -> Result<Drawn, Interrupted> {
    let &Sampling { filter, edge, clamp_ringing: clamp } = sampling;
    let source = Source { window: source_window, edge };
    assert_sources(planes, source_window, out.len());
    if filter == Filter::Ewa {
        watch.reserve(rayon::current_num_threads() * ewa::TILE_BYTES)?;
        let ewa = Ewa::new(map, source, dst_window, clamp, planes, watch)?;
        let fill = |room: &mut ewa::Scratch, at: &Located, left: usize, out: &mut [ViewMut<f32>]| {
            ewa.fill(at, left, room, out)
        };
        return draw_bands(map, &source, dst_window, ewa.reach(), out, watch, fill);
    }
    let fill = |blocks: &mut Blocks, at: &Located, left: usize, out: &mut [ViewMut<f32>]| match filter {
        Filter::Nearest => {
            sample::nearest(&source, planes, at, left, out);
            not_finite(left, at.width, out)
        }
        Filter::Linear => filtered(&filter::LINEAR, clamp, &source, planes, at, left, blocks, out),
        Filter::Cubic => filtered(&filter::CUBIC, clamp, &source, planes, at, left, blocks, out),
        Filter::Mitchell => filtered(&filter::MITCHELL, clamp, &source, planes, at, left, blocks, out),
        Filter::Lanczos3 => filtered(&filter::LANCZOS3, clamp, &source, planes, at, left, blocks, out),
        Filter::Ewa => unreachable!("drawn above"),
    };
    draw_bands(map, &source, dst_window, filter.reach(), out, watch, fill)
}

/// How many samples of a tile are NaN or infinite.
fn not_finite(left: usize, width: usize, out: &mut [ViewMut<f32>]) -> u64 {
    let count = |values: &[f32]| values.iter().filter(|value| !value.is_finite()).count() as u64;
    out.iter_mut().map(|out| (0..out.height()).map(|y| count(&out.row_mut(y)[left..left + width])).sum::<u64>()).sum()
}

/// Draws planes of labels through a warp: [`draw`] with [`Filter::Nearest`] for samples without arithmetic. Returns how
/// many pixels were drawn.
pub fn draw_labels(
    map: &Map,
    source_window: Rect,
    dst_window: Rect,
    edge: Edge,
    planes: &[View<u32>],
    out: Vec<ViewMut<u32>>,
    watch: Watch,
) -> Result<u64, Interrupted> {
    let source = Source { window: source_window, edge };
    let fill = |_: &mut (), positions: &Located, left: usize, out: &mut [ViewMut<u32>]| {
        sample::nearest(&source, planes, positions, left, out);
        0
    };
    assert_sources(planes, source_window, out.len());
    Ok(draw_bands(map, &source, dst_window, Filter::Nearest.reach(), out, watch, fill)?.pixels)
}

fn assert_sources<T>(planes: &[View<T>], window: Rect, outputs: usize) {
    assert_eq!(planes.len(), outputs, "one output per plane");
    let size = (window.width(), window.height());
    assert!(planes.iter().all(|plane| (plane.width(), plane.height()) == size), "planes are {size:?}");
}

/// Bytes that a thread takes for a tile: positions, and the part of the source that a block needs.
const TILE_BYTES: usize = 1 << 20;

/// Locates tile by tile, band beside band, and has `fill` write each tile and say how many samples are not finite; it
/// gets scratch space of its own from tile to tile.
fn draw_bands<T: Send, S: Default>(
    map: &Map,
    source: &Source,
    window: Rect,
    reach: f64,
    out: Vec<ViewMut<T>>,
    watch: Watch,
    fill: impl Fn(&mut S, &Located, usize, &mut [ViewMut<T>]) -> u64 + Sync,
) -> Result<Drawn, Interrupted> {
    let size = (window.width(), window.height());
    assert!(out.iter().all(|out| (out.width(), out.height()) == size), "outputs are {size:?}");
    if window.is_empty() || out.is_empty() {
        return Ok(Drawn::default());
    }
    watch.progress(0.0)?;
    watch.reserve(rayon::current_num_threads() * TILE_BYTES)?;
    let clip = (source.edge == Edge::Transparent).then(|| Clip::grown(&source.window, reach));
    let locator = (!source.window.is_empty()).then(|| Locator::new(map, window, clip, watch)).transpose()?;
    let bands = bands_of(out, window.height());
    let (count, done) = (bands.len(), AtomicUsize::new(0));
    let bands = bands.into_par_iter().enumerate();
    let drawn = bands.map_init(<(Located, S)>::default, |(positions, scratch), (index, mut planes)| {
        let top = window.y0 + (index * BAND_HEIGHT) as i64;
        let band = Rect { y0: top, y1: window.y1.min(top + BAND_HEIGHT as i64), ..window };
        let mut drawn = Drawn::default();
        for left in (0..window.width()).step_by(TILE_WIDTH) {
            let x0 = window.x0 + left as i64;
            let tile = Rect { x0, x1: window.x1.min(x0 + TILE_WIDTH as i64), ..band };
            positions.locate(locator.as_ref(), index, &tile, watch)?;
            drawn.pixels += positions.drawn;
            drawn.bad += fill(scratch, positions, left, &mut planes);
            watch.progress(done.load(Ordering::Relaxed) as f64 / count as f64)?;
        }
        done.fetch_add(1, Ordering::Relaxed);
        Ok(drawn)
    });
    drawn.try_reduce(Drawn::default, |a, b| Ok(Drawn { pixels: a.pixels + b.pixels, bad: a.bad + b.bad }))
}

/// The views cut into bands, those of one band together.
fn bands_of<T: Send>(views: Vec<ViewMut<T>>, height: usize) -> Vec<Vec<ViewMut<T>>> {
    let mut bands: Vec<Vec<ViewMut<T>>> = (0..height.div_ceil(BAND_HEIGHT)).map(|_| Vec::new()).collect();
    for view in views {
        for (band, (_, part)) in bands.iter_mut().zip(view.bands(BAND_HEIGHT)) {
            band.push(part);
        }
    }
    bands
}

#[cfg(test)]
mod tests;
