//! How close a feature came to a similarity.

use super::components::Component;
use super::local::{difference, modulus};
use crate::lattice::{Lattice, Positions};
use crate::{Interrupted, Watch};
use faer::c64;

/// A component's best similarity, and how far its nodes are from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeatureFit {
    /// Label of the component.
    pub label: u32,
    /// Largest distance of a feature node from where the best similarity puts it, in mean cell sizes (hx + hy) / 2.
    pub deviation_cells: f64,
    /// Scale of the similarity, positive; 0 where the feature collapsed.
    pub scale: f64,
    /// Rotation, degrees in (-180, 180], positive clockwise on screen; of mirrored components the rotation after
    /// mirroring y.
    pub rotation_deg: f64,
    /// The feature turned over: the similarity mirrors.
    pub mirrored: bool,
}

/// Fits `w = s z + t`, or `w = s conj(z) + t` where that is nearer, to the nodes of a component, by least squares.
///
/// With z and w about their means, `s = sum(w conj(z)) / sum |z|^2`, or `sum(w z) / sum |z|^2` when mirrored. Sums
/// are taken about the component's first node, for accuracy far from the origin.
pub(super) fn fit(
    lattice: &Lattice,
    component: &Component,
    positions: &Positions,
    watch: Watch,
) -> Result<FeatureFit, Interrupted> {
    watch.go_on()?;
    let first = component.nodes[0];
    let count = component.nodes.len() as f64;
    let columns = lattice.nodes[0];
    let pair = |&node: &usize| {
        let across = (node % columns) as f64 - (first % columns) as f64;
        let down = (node / columns - first / columns) as f64;
        (c64::new(across * lattice.spacing[0], down * lattice.spacing[1]), difference(positions, first, node))
    };
    let zero = c64::new(0.0, 0.0);
    let (z_sum, w_sum) = component.nodes.iter().map(pair).fold((zero, zero), |(zs, ws), (z, w)| (zs + z, ws + w));
    let centred = |node: &usize| {
        let (z, w) = pair(node);
        (z - z_sum / count, w - w_sum / count)
    };
    watch.go_on()?;
    let (size, upright, mirror) = component
        .nodes
        .iter()
        .map(centred)
        .fold((0.0, zero, zero), |sums, (z, w)| (sums.0 + z.norm_sqr(), sums.1 + w * z.conj(), sums.2 + w * z));
    watch.go_on()?;
    let mirrored = modulus(mirror) > modulus(upright);
    let s = if mirrored { mirror } else { upright } / size;
    let off = |node| {
        let (z, w) = centred(node);
        modulus(s * if mirrored { z.conj() } else { z } - w)
    };
    let deviation = component.nodes.iter().map(off).fold(0.0, f64::max);
    Ok(FeatureFit {
        label: component.label,
        deviation_cells: deviation * 2.0 / (lattice.spacing[0] + lattice.spacing[1]),
        scale: modulus(s),
        rotation_deg: libm::atan2(s.im, s.re).to_degrees(),
        mirrored,
    })
}
