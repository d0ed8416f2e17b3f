//! What one warp asks of the features.

use super::components::Component;
use super::local::{Frame, Linear, difference, edges_of, modulus};
use super::setup::{Exact, FeatureFactor, Features, Group};
use super::weights::NONE;
use super::{Error, RUN, assert_one_per_node};
use crate::Watch;
use crate::lattice::{Lattice, Positions};
use crate::poisson::Edges;
use faer::c64;
use rayon::prelude::*;

/// What features keep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Their shape: each component takes one scale from the warp.
    #[default]
    Similarity,
    /// Their shape and size.
    Rigid,
}

/// What an exact feature does that touches a frame that is held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnConflict {
    /// Its nodes on the frame stay with the frame; the others are the similarity's.
    #[default]
    NoFold,
    /// All its nodes are the similarity's, on the frame too, the lattice's corners included.
    KeepShape,
}

/// Another wish for the feature of one label.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Override {
    /// Label of the feature.
    pub label: u32,
    /// What it keeps.
    pub mode: Option<Mode>,
    /// Its scale, finite and positive; goes before the mode.
    pub scale: Option<f64>,
}

/// What is wanted of the features, for a warp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Targets<'a> {
    /// What features keep.
    pub mode: Mode,
    /// Features that want something else; of several for one label the first counts.
    pub overrides: &'a [Override],
    /// Whether what quads around features ask for fades into what the warp does, not only its weight.
    pub blend: bool,
    /// What exact features do on the frame.
    pub on_conflict: OnConflict,
    /// Multiplies the scales of all features, finite and positive; 1 as they are.
    pub size: f64,
}

impl Default for Targets<'_> {
    fn default() -> Self {
        Self { mode: Mode::default(), overrides: &[], blend: false, on_conflict: OnConflict::default(), size: 1.0 }
    }
}

/// How a node may move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Freedom {
    /// Anywhere.
    Free,
    /// Not at all.
    Pinned,
    /// Along a direction of positive length only.
    Along([f64; 2]),
}

/// What a feature-aware warp minimises: `sum over edges (p, q) of c |d_q - d_p|^2 - 2 phi . (d_q - d_p)`, d = x - base.
///
/// Up to a constant the weighted sum of squares of [`super::setup`].
#[derive(Clone, Copy, Debug)]
pub struct Functional<'a> {
    /// At rest, at least 2 x 2 nodes.
    pub lattice: &'a Lattice,
    /// c of every edge, finite and positive: the sum of the squared weights of its quads.
    pub conductances: &'a Edges,
    /// phi, for x and for y, px: what is asked of an edge beyond what the base does, times squared weights.
    pub fluxes: &'a [Edges; 2],
    /// The warp, one position per node, px. Pinned nodes stay here, those that move along a direction pass here.
    pub base: &'a Positions,
    /// Of every node; at least one is pinned.
    pub freedom: &'a [Freedom],
}

/// The right-hand side for one warp, to be solved with the factor it was made for.
#[derive(Debug)]
pub struct Rhs<'a> {
    pub(super) factor: &'a FeatureFactor,
    pub(super) warp: &'a Positions,
    pub(super) fluxes: [Edges; 2],
    freedom: Vec<Freedom>,
    /// Per group of exact features.
    pub(super) guides: Vec<Guide>,
    pub(super) targets: Targets<'a>,
}

/// How a group of exact features is mapped before the least squares move it: `turn z`, or `turn conj(z)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guide {
    pub(super) mirrored: bool,
    pub(super) turn: c64,
}

impl Rhs<'_> {
    /// What is minimised.
    pub fn functional(&self) -> Functional<'_> {
        let (features, fluxes) = (&self.factor.features, &self.fluxes);
        let conductances = self.factor.conductances();
        Functional { lattice: &features.lattice, conductances, fluxes, base: self.warp, freedom: &self.freedom }
    }

    /// Whether exact features take nodes of a frame along that is held.
    pub(super) fn keeps_shape(&self) -> bool {
        self.targets.on_conflict == OnConflict::KeepShape
    }

    /// How every node may move once exact features may bend.
    pub(super) fn freedom_to_bend(&self) -> Vec<Freedom> {
        let mut freedom = self.freedom.clone();
        let inner = self.factor.features.groups.iter().flat_map(|group| &group.inner);
        inner.for_each(|&node| freedom[node] = Freedom::Free);
        freedom
    }

    /// The direction that a node of the frame slides along; none where the warp's border has none.
    pub(super) fn tangent(&self, node: usize) -> Option<[f64; 2]> {
        match self.freedom[node] {
            Freedom::Along(tangent) => Some(tangent),
            _ => None,
        }
    }
}

/// The right-hand side for a warp.
///
/// On a quad the warp's linear part is `z -> a z + b conj(z)`, z = x + i y, with singular values |a| + |b| and
/// ||a| - |b||. Quads that follow a component ask for `g = s (a / |a|) e` of their edges e. For `Similarity` the
/// scale s is the mean of max(|a| - |b|, 0) over the component's quads, at least 1e-3, for `Rigid` it is 1. Other
/// quads ask for what the warp does. With `blend`, quads around features ask for `f g + (1 - f)` times what the warp
/// does, f(D) as in [`super::setup`]: then not only the weight is continuous across the transition.
///
/// * `factor`: knows nothing of the warp and of `targets`.
/// * `warp`: position of every node, px.
/// * `targets`: what is wanted; overrides of labels that have no cells are passed over.
/// * `watch`: asked now and then.
///
/// Where the warp mirrors a component (its mean determinant is negative) a and b change places: the component's
/// quads are mapped by `s (b / |b|) conj(e)`. Where the part that holds the rotation is below 1e-9 of the linear
/// map, the component's mean rotation is used, and no rotation if it has none. Sliding nodes move along the chord
/// between the images of their two neighbours on the frame; where these are one point they stay. Exact
/// features that are one want one scale. O(cells); fails on a warp that is not finite, with `Contradiction` where such
/// features want several scales, and with `NoPins` where `KeepShape` would move every node of the frame.
///
/// Section 2, Equations 1 to 4, with R = a / |a| the proper rotation of the polar decomposition.
pub fn rhs<'a>(
    factor: &'a FeatureFactor,
    warp: &'a Positions,
    targets: &Targets<'a>,
    watch: Watch,
) -> Result<Rhs<'a>, Error> {
    let features = &factor.features;
    let Features { lattice, components, .. } = features;
    assert_one_per_node(warp, lattice);
    assert!(targets.size.is_finite() && targets.size > 0.0, "size {}", targets.size);
    if let Some(node) = (0..warp.x.len()).find(|&node| !(warp.x[node].is_finite() && warp.y[node].is_finite())) {
        return Err(Error::NotFinite { column: node % lattice.nodes[0], row: node / lattice.nodes[0] });
    }
    features.groups.iter().try_for_each(|group| agreement(group, features.exact, targets))?;
    let frame = |component: &Component, scale: Option<f64>| {
        let frame = Frame::of(lattice, warp, component, scale, watch)?;
        Ok(Frame { scale: frame.scale * targets.size, ..frame })
    };
    let frames = components.par_iter().map(|component| frame(component, targets.scale(component.label, Exact::Off)));
    let frames: Vec<Frame> = frames.collect::<Result<_, Error>>()?;
    let fluxes = fluxes(features, warp, &frames, targets.blend, watch)?;
    let guides = features.groups.par_iter().map(|group| {
        let wanted = targets.scale(group.whole.label, features.exact);
        let Frame { mirrored, scale, rotation } = frame(&group.whole, wanted)?;
        Ok(Guide { mirrored, turn: rotation * scale })
    });
    let guides = guides.collect::<Result<_, Error>>()?;
    let keeps_shape = targets.on_conflict == OnConflict::KeepShape;
    if keeps_shape && !features.is_idle() && !features.groups.is_empty() && features.held_by_no_feature() == 0 {
        return Err(Error::NoPins);
    }
    let freedom = freedom(features, warp, keeps_shape);
    Ok(Rhs { factor, warp, fluxes, freedom, guides, targets: *targets })
}

impl Targets<'_> {
    fn wish(&self, label: u32) -> Option<&Override> {
        self.overrides.iter().find(|wish| wish.label == label)
    }

    /// The scale of a feature, if it does not take the warp's.
    fn scale(&self, label: u32, exact: Exact) -> Option<f64> {
        let wish = self.wish(label);
        let mode = wish.and_then(|wish| wish.mode).unwrap_or(self.mode);
        let is_rigid = exact == Exact::Rigid || mode == Mode::Rigid;
        wish.and_then(|wish| wish.scale).or(is_rigid.then_some(1.0))
    }
}

/// Fails where features that are one want several scales.
fn agreement(group: &Group, exact: Exact, targets: &Targets) -> Result<(), Error> {
    let first = group.whole.label;
    let scales = |other: u32| [first, other].map(|label| targets.scale(label, exact));
    let apart = group.labels.iter().copied().find(|&other| scales(other)[0] != scales(other)[1]);
    apart.map_or(Ok(()), |other| Err(Error::Contradiction { labels: [first, other], scales: scales(other) }))
}

fn fluxes(
    features: &Features,
    warp: &Positions,
    frames: &[Frame],
    blend: bool,
    watch: Watch,
) -> Result<[Edges; 2], Error> {
    let Features { lattice, quads, .. } = features;
    let [mut x, mut y] = [Edges::zeros(lattice.nodes), Edges::zeros(lattice.nodes)];
    for (quad, (&component, &stiffness)) in quads.component.iter().zip(&quads.stiffness).enumerate() {
        if quad % RUN == 0 {
            watch.go_on()?;
        }
        if component == NONE {
            continue;
        }
        let [across, down] = frames[component as usize].edges(&Linear::of(lattice, warp, quad), lattice.spacing);
        let strength = if blend { stiffness * quads.share[quad] } else { stiffness };
        let (horizontal, vertical) = edges_of(quad, lattice.nodes[0]);
        for (edge, from, to) in horizontal {
            let flux = (across - difference(warp, from, to)) * strength;
            x.horizontal[edge] += flux.re;
            y.horizontal[edge] += flux.im;
        }
        for (edge, from, to) in vertical {
            let flux = (down - difference(warp, from, to)) * strength;
            x.vertical[edge] += flux.re;
            y.vertical[edge] += flux.im;
        }
    }
    Ok([x, y])
}

fn freedom(features: &Features, warp: &Positions, keeps_shape: bool) -> Vec<Freedom> {
    let held = |node| if features.is_held(node) { Freedom::Pinned } else { Freedom::Free };
    let mut freedom: Vec<Freedom> = (0..features.lattice.node_count()).map(held).collect();
    for &node in &features.sliding {
        if let Some(along) = border_direction(features.lattice.nodes, warp, node) {
            freedom[node] = Freedom::Along(along);
        }
    }
    for group in &features.groups {
        let frame = group.frame.iter().filter(|_| keeps_shape);
        group.inner.iter().chain(frame).for_each(|&node| freedom[node] = Freedom::Pinned);
    }
    freedom
}

/// The direction of the warp's border at a node of the frame that is no corner.
fn border_direction([columns, _]: [usize; 2], warp: &Positions, node: usize) -> Option<[f64; 2]> {
    let is_upright = node.is_multiple_of(columns) || (node + 1).is_multiple_of(columns);
    let step = if is_upright { columns } else { 1 };
    let chord = difference(warp, node - step, node + step);
    let length = modulus(chord);
    (length > 0.0 && length.is_finite()).then(|| [chord.re / length, chord.im / length])
}

impl Features {
    /// Count of nodes of the frame that are no corner of a feature quad.
    fn held_by_no_feature(&self) -> usize {
        let is_held = |&node: &usize| self.is_held(node) && !self.is_feature[node];
        (0..self.lattice.node_count()).filter(is_held).count()
    }

    /// Whether an exact feature's nodes may be held against it.
    pub(super) fn conflicts(&self) -> impl Iterator<Item = u32> {
        let touching = self.groups.iter().filter(|group| !group.frame.is_empty());
        touching.flat_map(|group| group.labels.iter().copied())
    }
}
