//! Connected components of a mask.

mod band;
mod runs;
mod unions;

use rayon::prelude::*;

use crate::steps::Steps;
use crate::view::{View, ViewMut};
use crate::{Interrupted, Watch};
use band::{Band, Extent};
use runs::for_touching;
use unions::Unions;

/// Rows that one task labels.
const BAND_ROWS: usize = 64;

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
/// Cost: O(area), nearly: runs of pixels are joined, not pixels, and a union costs the inverse Ackermann function.
///
/// He, Chao, Suzuki: A run-based two-scan labeling algorithm, IEEE Trans. Image Processing 17(5), 2008; here bands of
/// rows are labelled side by side and joined across their borders.
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
    let reach = match connectivity {
        Connectivity::Eight => 1,
        Connectivity::Four => 0,
    };
    let count = height.div_ceil(BAND_ROWS);
    let steps = Steps::new(watch, 2 * count);
    let scan = |index: usize| {
        let top = index * BAND_ROWS;
        let band = Band::scan(mask, top..height.min(top + BAND_ROWS), reach);
        steps.step().map(|()| band)
    };
    let bands = (0..count).into_par_iter().map(scan).collect::<Result<Vec<_>, _>>()?;

    let (part_labels, extents) = join(&bands, reach, min_area);
    let painted = out.bands(BAND_ROWS).into_par_iter().zip(&bands).zip(&part_labels);
    painted.try_for_each(|(((_, view), band), labels)| {
        band.paint(labels, view);
        steps.step()
    })?;
    Ok(extents.iter().map(|extent| extent.component(x0, y0)).collect())
}

/// Joins the parts of components that the bands found: the label of each band's parts, and the extents of the labelled
/// components.
fn join(bands: &[Band], reach: u32, min_area: u64) -> (Vec<Vec<u32>>, Vec<Extent>) {
    let mut offsets = vec![0];
    for band in bands {
        offsets.push(offsets[offsets.len() - 1] + band.extents.len() as u32);
    }
    let mut unions = Unions::default();
    unions.extend(offsets[bands.len()]);
    for (pair, offset) in bands.windows(2).zip(offsets.windows(2)) {
        let (above, below) = (pair[0].last_row(), pair[1].first_row());
        for_touching(pair[0].runs(above.clone()), pair[1].runs(below.clone()), reach, |a, b| {
            unions.join(offset[0] + pair[0].parts[above.start + a], offset[1] + pair[1].parts[below.start + b]);
        });
    }
    let mut extents: Vec<Extent> = Vec::new();
    let wholes = unions.into_sets();
    for (&whole, part) in wholes.iter().zip(bands.iter().flat_map(|band| &band.extents)) {
        match extents.get_mut(whole as usize) {
            Some(extent) => extent.merge(part),
            None => extents.push(*part),
        }
    }
    let mut kept = 0;
    let labels: Vec<u32> = extents
        .iter()
        .map(|extent| {
            let keep = extent.area >= min_area;
            kept += u32::from(keep);
            if keep { kept } else { 0 }
        })
        .collect();
    extents.retain(|extent| extent.area >= min_area);
    let parts = offsets.windows(2).map(|part| &wholes[part[0] as usize..part[1] as usize]);
    (parts.map(|part| part.iter().map(|&whole| labels[whole as usize]).collect()).collect(), extents)
}

#[cfg(test)]
mod tests;
