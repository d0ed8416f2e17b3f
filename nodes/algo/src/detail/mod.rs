//! Detail for a picture that a warp magnified.
//!
//! Magnified, a picture lacks high frequencies. Its original shows what they look like: blurred as the magnification
//! blurs it is A, itself it is A', the warped picture is B, and B' is sought that is to B as A' is to A (Hertzmann et
//! al. 2001). Every pixel of B' is a pixel of A': a method finds the sources, then B' is moved until its blur is B.

mod analogies;
mod blur;
mod coherent;
mod encoding;
mod local_blur;
mod look;
mod picture;
mod similar;
mod target;
mod tree;

pub use similar::{SimilarSets, similar_sets};
pub use target::magnification;

use target::Target;

use crate::lattice::Positions;
use crate::view::{View, ViewMut};
use crate::{Interrupted, Watch};

/// How sources are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// All pixels at once, from coarse to fine, by the sets of similar pixels; starts where the warp says.
    Coherent,
    /// Pixel after pixel in raster order, as published; slow.
    Analogies,
}

/// What [`detail`] does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How sources are found.
    pub method: Method,
    /// How much better a source must be that continues no neighbour's, at least 0; halves per coarser level.
    pub coherence: f64,
    /// Standard deviation of the blur between A' and A, px; none means by the magnification.
    pub blur: Option<f64>,
    /// How often B' is moved towards one whose blur is B.
    pub back_projections: usize,
}

/// What [`detail`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Detailed {
    /// Pixels that were made anew.
    pub pixels: u64,
    /// Standard deviation of the blur between A' and A, px.
    pub blur: f64,
    /// Root mean square, encoded, of the difference between the blurred result and the warped picture, where pixels
    /// were made anew; before and after the steps of back-projection.
    pub residual: [f64; 2],
}

/// Bytes per pixel of the part of the picture that is magnified.
const PICTURE_BYTES: usize = 110;

/// Gives a warped picture the detail that its magnification lacks.
///
/// Where the magnification m exceeds 1.02, each pixel becomes a pixel A'(s) of the training picture, then moved by
/// B' <- B' + G^T (B - G B') so that its blur G B' nears B. The result fades in as smoothstep(1.02, 1.15, m). G is the
/// Gaussian of variance (m - 1) / 4 square px at each pixel, made of a few Gaussians whose variances double. A is A'
/// after the Gaussian of the 90 % quantile of m.
///
/// [`Method::Coherent`]: per level two passes of four sub-passes, in each of which every other pixel of every other row
/// takes the source s of least cost: |F_A(s) - F_B(q)|^2 + 0.3 |R_A'(s) - R_B'(q)|^2, F the smooth look of
/// [`similar_sets`], R the luma of the eight neighbours. Candidates are the sources of the neighbours shifted, and at
/// 1 + coherence times the cost the sets similar to these, where the warp says, and the pixel whose F is next to
/// F_B(q) in a tree, on all levels but the coarsest one of every other row's every other pixel.
/// [`Method::Analogies`]: a scan over neighbourhoods of 5 x 5 pixels of luma and 3 x 3 on the coarser level. The
/// nearest one is searched to within twice its distance; where a pixel before lies outside the picture, B speaks for B'.
///
/// - `sets`: the training picture.
/// - `picture`: R, G, B of the warped picture, scene-linear; what is not finite stays.
/// - `magnification`: per pixel of it, area in px, see [`magnification`]; NaN counts as 1.
/// - `origins`: per pixel, where it comes from in px of the training picture, whose corner is (0, 0); any numbers.
/// - `settings`: see there.
/// - `out`: of the picture's size; every sample is written, to the bits of `picture` where m <= 1.02.
/// - `watch`: asked for the memory taken, told the part done. On `Interrupted`, `out` is partly written.
///
/// Shapes are asserted. Beyond borders lie mirrored pixels. A training picture without pixels changes nothing.
///
/// Encodings go through tables, within 5e-7 of the standard.
///
/// Cost: linear in the magnified pixels' bounding box, O(n log n) in a quarter of the training picture's; most of it for
/// the magnified pixels themselves. The result does not depend
/// on the count of threads.
///
/// A. Hertzmann et al., "Image analogies", SIGGRAPH 2001; X. Tong et al., SIGGRAPH 2002 (k-coherence); S. Lefebvre and
/// H. Hoppe, "Parallel controllable texture synthesis", SIGGRAPH 2005 (sub-passes); M. Irani and S. Peleg 1991
/// (back-projection); S. Brooks and N. Dodgson, "Self-similarity based texture editing", SIGGRAPH 2002, section 5.
pub fn detail(
    sets: &SimilarSets,
    picture: &[View<f32>; 3],
    magnification: &[f32],
    origins: &Positions,
    settings: &Settings,
    mut out: [ViewMut<f32>; 3],
    watch: Watch,
) -> Result<Detailed, Interrupted> {
    for (plane, out) in picture.iter().zip(&mut out) {
        plane.rows().enumerate().for_each(|(y, row)| out.row_mut(y).copy_from_slice(row));
    }
    let Some(frame) = target::frame(picture, magnification, settings.blur) else {
        return Ok(Detailed::default());
    };
    if sets.levels.is_empty() {
        return Ok(Detailed::default());
    }
    let per_training_pixel = match settings.method {
        Method::Coherent => coherent::BYTES,
        Method::Analogies => analogies::BYTES,
    };
    watch.reserve(sets.width * sets.height * per_training_pixel + frame.width() * frame.height() * PICTURE_BYTES)?;
    let target = Target::new(sets, picture, magnification, origins, settings.blur, frame, watch)?;
    let [r, g, b] = sets.planes.each_ref().map(|plane| blur::blurred(plane, sets.width, target.variance, watch));
    let (blurred, coherence) = ([r?, g?, b?], settings.coherence as f32);
    let sources = match settings.method {
        Method::Coherent => coherent::sources(sets, &blurred, &target, coherence, watch)?,
        Method::Analogies => analogies::sources(sets, &blurred, &target, coherence, watch)?,
    };
    drop(blurred);
    let residual = target.finish(sets, picture, &sources, settings.back_projections, out, watch)?;
    let pixels = sources.iter().flatten().count() as u64;
    Ok(Detailed { pixels, blur: target.variance.sqrt(), residual })
}

#[cfg(test)]
mod tests;
