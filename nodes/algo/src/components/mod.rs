//! Connected components of a mask.

mod band;
mod extent;
mod lanes;
mod paint;
mod runs;
mod unions;

use rayon::prelude::*;

use crate::steps::Steps;
use crate::view::{View, ViewMut};
use crate::{Interrupted, Watch};
use band::Band;
use extent::Extent;
use lanes::WORD;
use runs::touching;
use unions::Unions;

/// Rows that one task labels.
const BAND_ROWS: usize = 32;

/// Bytes per column that a thread takes while it scans a band: for bits and runs, and for a name of every other pixel,
/// which is the most there can be, twice, for lists double as they grow.
const SCAN_BYTES: usize = 32 + 2 * BAND_ROWS / 2 * (size_of::<Extent>() + size_of::<u32>());

/// Which neighbours of a pixel it is connected to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Connectivity {
    /// All eight around it.
    Eight,
    /// The four that share an edge with it.
    Four,
}

/// A connected component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component {
    /// Count of its pixels.
    pub area: u64,
    /// Left, top, right and bottom of the smallest box of pixels that holds it, the last two exclusive, absolute px.
    pub bounds: [i64; 4],
    /// Mean of its pixels' centres, absolute px.
    pub centroid: [f64; 2],
}

/// Labels the connected components of the set where coverage > 0.5.
///
/// `out` gets 0 outside all components and n in component n, where n counts from 1 in raster order of the components'
/// first pixels, after those smaller than `min_area` are dropped (set to 0). Entry n - 1 of the result describes
/// component n.
///
/// `mask`, `out`: planes of one size, fewer than 2^32 px; `connectivity`: of the set; `min_area`: px; `x0`, `y0`: the
/// top left pixel of the view, to which bounds and centroids refer.
///
/// NaN is outside the set. What lies outside the view connects nothing. Stops when `watch` says so.
///
/// Cost: O(area + runs x log(runs)) at worst, O(area) in practice: runs of pixels are joined, not pixels. Between the scans
/// there is a bit per pixel; the names of the runs wait in `out`.
///
/// He, Chao, Suzuki: A run-based two-scan labeling algorithm, IEEE Trans. Image Processing 17(5), 2008; here bands of
/// rows are labelled side by side and joined across their borders, and runs that touch are found from words of bits.
pub fn label(
    mask: View<f32>,
    connectivity: Connectivity,
    min_area: u64,
    x0: i64,
    y0: i64,
    out: ViewMut<u32>,
    watch: Watch,
) -> Result<Vec<Component>, Interrupted> {
    let (width, height) = (mask.width(), mask.height());
    assert_eq!([width, height], [out.width(), out.height()], "sizes differ");
    assert!(width.checked_mul(height).is_some_and(|area| area <= u32::MAX as usize), "{width} x {height} px");
    let corners = connectivity == Connectivity::Eight;
    let count = height.div_ceil(BAND_ROWS);
    let steps = Steps::new(watch, 2 * count);
    watch.reserve(rayon::current_num_threads() * width * SCAN_BYTES)?;
    let scan = |(top, out)| {
        let band = Band::scan(mask, top, corners, out);
        watch.reserve(band.bytes())?;
        steps.step().map(|()| band)
    };
    let mut bands = out.bands(BAND_ROWS).into_par_iter().map(scan).collect::<Result<Vec<_>, _>>()?;

    let wholes = join(&bands, corners, watch)?;
    let mut homes = gather(&mut bands, &wholes, watch)?;
    let labels = number(&bands, &mut homes, min_area);
    let table = homes.par_iter().map(|home| bands[home.band].extents[home.part].component(x0, y0)).collect();
    bands.into_par_iter().zip(&wholes).try_for_each(|(band, wholes)| {
        let labels: Vec<u32> = wholes.iter().map(|&whole| labels[whole as usize]).collect();
        band.paint(&labels);
        steps.step()
    })?;
    Ok(table)
}

/// Describes the labels of a plane: each label but 0 with its component, labels rising.
///
/// `labels`: any plane of labels; pixels of one label are one component, connected or not; `x0`, `y0`: the top left pixel
/// of the view, to which bounds and centroids refer.
///
/// Cost: linear in the pixels, one after the other. Stops when `watch` says so.
pub fn tabulate(labels: View<u32>, x0: i64, y0: i64, watch: Watch) -> Result<Vec<(u32, Component)>, Interrupted> {
    let mut extents: std::collections::BTreeMap<u32, Extent> = std::collections::BTreeMap::new();
    for (y, row) in labels.rows().enumerate() {
        watch.go_on()?;
        let mut start = 0;
        for run in row.chunk_by(|a, b| a == b) {
            let end = start + run.len();
            if run[0] != 0 {
                let extent = Extent::of_run([start as u32, end as u32], y as u32);
                extents.entry(run[0]).and_modify(|known| known.merge(&extent)).or_insert(extent);
            }
            start = end;
        }
    }
    Ok(extents.into_iter().map(|(label, extent)| (label, extent.component(x0, y0))).collect())
}

/// Where the extent of a component is gathered: at the first of its parts.
struct Home {
    band: usize,
    part: usize,
}

/// Joins the parts of components across the borders of bands: for each part of each band the number of its component,
/// counted from 0 in raster order.
fn join(bands: &[Band], corners: bool, watch: Watch) -> Result<Vec<Vec<u32>>, Interrupted> {
    let parts: usize = bands.iter().map(|band| band.extents.len()).sum();
    watch.reserve(2 * parts * size_of::<u32>())?;
    let width = bands.first().map_or(0, |band| band.first_bits().len() * WORD);
    let (mut unions, mut pairs, mut offset) = (Unions::default(), vec![[0; 2]; width], 0);
    unions.extend(parts as u32);
    for pair in bands.windows(2) {
        watch.go_on()?;
        let next = offset + pair[0].extents.len() as u32;
        for &[a, b] in touching(pair[0].last_bits(), pair[1].first_bits(), corners, &mut pairs) {
            let (a, b) = (pair[0].edges[1][a as usize], pair[1].edges[0][b as usize]);
            unions.join(offset + pair[0].parts[a as usize], next + pair[1].parts[b as usize]);
        }
        offset = next;
    }
    let mut wholes = unions.into_sets().into_iter();
    Ok(bands.iter().map(|band| wholes.by_ref().take(band.extents.len()).collect()).collect())
}

/// Gathers the extents of all parts of each component; the home of each component.
fn gather(bands: &mut [Band], wholes: &[Vec<u32>], watch: Watch) -> Result<Vec<Home>, Interrupted> {
    let count = wholes.iter().flatten().max().map_or(0, |&last| last as usize + 1);
    // With the labels of the components and what describes them in the end.
    watch.reserve(count * (size_of::<Home>() + size_of::<u32>() + size_of::<Component>()))?;
    let mut homes: Vec<Home> = Vec::with_capacity(count);
    for band in 0..bands.len() {
        watch.go_on()?;
        for (part, &whole) in wholes[band].iter().enumerate() {
            match homes.get(whole as usize) {
                Some(home) => {
                    let extent = bands[band].extents[part];
                    bands[home.band].extents[home.part].merge(&extent);
                }
                None => homes.push(Home { band, part }),
            }
        }
    }
    Ok(homes)
}

/// Drops the components smaller than `min_area`; the label of each component, 0 if dropped.
fn number(bands: &[Band], homes: &mut Vec<Home>, min_area: u64) -> Vec<u32> {
    let mut labels = Vec::with_capacity(homes.len());
    let mut last = 0;
    homes.retain(|home| {
        let keep = bands[home.band].extents[home.part].area >= min_area;
        last += u32::from(keep);
        labels.push(if keep { last } else { 0 });
        keep
    });
    labels
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
