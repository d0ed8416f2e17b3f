//! What does not depend on the warp: the matrix, its factor, and what exact features and sliding nodes cost.

use super::cells::FeatureCells;
use super::components::{Component, components, touching, united};
use super::fit::{self, FeatureFit};
use super::local::edges_of;
use super::motion::{Motions, motions};
use super::weights::{self, Quads};
use super::{Error, RUN, assert_one_per_node};
use crate::lattice::{Lattice, Positions, border, is_on_border};
use crate::poisson::{self, Edges, GridLaplacian, Pins};
use crate::steps::Span;
use crate::{Interrupted, Watch};
use rayon::prelude::*;

/// Part of the work that is done once the matrix is factored.
const FACTORED: f64 = 0.9;

/// What the nodes of the frame may do that are corners of feature quads; the others stay where the warp puts them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Boundary {
    /// Nothing: they stay where the warp puts them.
    #[default]
    Pin,
    /// Move along the warp's border; the lattice's corners stay.
    Slide,
    /// Move anywhere.
    Free,
}

/// Whether features are mapped by similarities exactly, not only as nearly as their weight allows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Exact {
    /// No.
    #[default]
    Off,
    /// By a similarity whose rotation and scale the least squares find.
    Similarity,
    /// By the mean rotation of the warp on the feature; its scale is 1 or what an override says.
    Rigid,
}

/// Everything that the matrix is made of.
#[derive(Clone, Copy, Debug)]
pub struct Structure<'a> {
    /// At rest, at least 2 x 2 nodes.
    pub lattice: &'a Lattice,
    /// Label of every cell.
    pub cells: &'a FeatureCells,
    /// Weight of feature quads, finite and positive; 10 in the paper.
    pub weight: f64,
    /// Labels with weights of their own; labels without cells are passed over, of several of one label the first
    /// counts.
    pub weights: &'a [(u32, f64)],
    /// Coverage of every cell, 0..=1: on feature cells the excess weight, `weight - 1`, is multiplied by it.
    pub soft: Option<&'a [f64]>,
    /// Radius of the transition, cells, finite and not negative; 2 in the paper, 0 for a sharp edge.
    pub radius: f64,
    /// What features do on the frame.
    pub boundary: Boundary,
    /// Whether features are similarities exactly.
    pub exact: Exact,
}

/// Everything about the features that does not depend on a warp.
#[derive(Debug)]
pub(super) struct Features {
    pub(super) lattice: Lattice,
    /// In order of their labels.
    pub(super) components: Vec<Component>,
    pub(super) quads: Quads,
    pub(super) boundary: Boundary,
    pub(super) exact: Exact,
    /// Components that are one similarity; none where features are not exact.
    pub(super) groups: Vec<Group>,
    /// Nodes of the frame that slide.
    pub(super) sliding: Vec<usize>,
    /// Per node: a corner of a feature quad.
    pub(super) is_feature: Vec<bool>,
}

/// Components that share nodes, to be one similarity.
#[derive(Debug)]
pub(super) struct Group {
    /// All of them as one.
    pub(super) whole: Component,
    pub(super) labels: Vec<u32>,
    /// Nodes that are the similarity's whatever the warp.
    pub(super) inner: Vec<usize>,
    /// Nodes on a frame that is held.
    pub(super) frame: Vec<usize>,
}

impl Group {
    /// The nodes that move apart: inner ones, then those of the frame; without what there is none of.
    pub(super) fn parts(&self) -> impl Iterator<Item = &Vec<usize>> {
        [&self.inner, &self.frame].into_iter().filter(|nodes| !nodes.is_empty())
    }

    /// The parts that are mapped by the similarity, the first ones.
    pub(super) fn moving(&self, keeps_shape: bool) -> impl Iterator<Item = &Vec<usize>> {
        self.parts().take(usize::from(!self.inner.is_empty()) + usize::from(keeps_shape))
    }
}

/// The least squares system of a lattice and its features, not yet factored.
#[derive(Debug)]
pub struct System {
    features: Features,
    pub(super) laplacian: GridLaplacian,
}

/// A factored system: serves any number of warps.
#[derive(Debug)]
pub struct FeatureFactor {
    pub(super) features: Features,
    pub(super) solver: Solver,
    pub(super) motions: Motions,
}

#[derive(Debug)]
pub(super) enum Solver {
    /// There are no features, or all nodes lie on the frame and none may leave it: the warp is the result.
    Idle(GridLaplacian),
    Factored(poisson::Factor),
}

/// Sets up the least squares system of a lattice and its features.
///
/// Minimise `sum over quads Q and edges (p, q) of Q of w_Q^2 |x_q - x_p - g_Q(p, q)|^2`; the weights w_Q make the
/// matrix, the images g_Q the right-hand side ([`super::rhs`]). `w_Q = 1 + (weight - 1) f(D)` with
/// `f(D) = 2 (D / radius)^3 - 3 (D / radius)^2 + 1` for D < radius, else 0; D is the distance in cells from Q's
/// centre to the union of the feature quads, 0 on them. Quads with 0 < D < radius follow the nearest component, of
/// equally near ones that with the lowest label, and take its weight.
///
/// * `structure`: see there.
/// * `watch`: asked now and then, and for memory.
///
/// All quads of one label are one component, connected or not. Features may touch the frame and each other; where
/// they are not exact, least squares averages what they ask for, and exact ones that share nodes are one similarity.
/// Fails with `NoPins` where `Boundary::Free` leaves no node of the frame to be held. On lattices with fewer than 3
/// nodes on a side all nodes are the frame's: there is nothing to solve for with `Boundary::Pin` and `Exact::Off`.
/// Time O(cells * (1 + radius)).
///
/// Section 2, Equations 3 to 5, and Section 2.1, Equations 6 and 7.
pub fn setup(structure: &Structure, watch: Watch) -> Result<System, Error> {
    let Structure { lattice, cells, weight, radius, .. } = *structure;
    let [columns, rows] = lattice.cells();
    assert_eq!(cells.labels.len(), columns * rows, "labels of {columns} x {rows} cells");
    assert!(structure.soft.is_none_or(|soft| soft.len() == columns * rows), "coverage of {columns} x {rows} cells");
    let all_weights = structure.weights.iter().map(|&(_, weight)| weight).chain([weight]);
    all_weights.for_each(|weight| assert!(weight.is_finite() && weight > 0.0, "weight {weight}"));
    assert!(radius.is_finite() && radius >= 0.0, "radius {radius}");
    watch.reserve(setup_bytes(cells))?;
    let (components, component_of) = components(lattice, &cells.labels, watch)?;
    let own = |component: &Component| structure.weights.iter().find(|(label, _)| *label == component.label);
    let weights: Vec<f64> = components.iter().map(|component| own(component).map_or(weight, |own| own.1)).collect();
    let quads = weights::weigh(&component_of, columns, &weights, radius, structure.soft, watch)?;
    drop(component_of);
    let conductances = conductances(lattice, &quads, watch)?;
    let features = features(structure, components, quads, watch)?;
    if !features.is_idle() && features.held_for_good().count() == 0 {
        return Err(Error::NoPins);
    }
    let pins = features.pins();
    Ok(System { features, laplacian: GridLaplacian::new(lattice.nodes, conductances, pins) })
}

/// Factors a system.
///
/// [`GridLaplacian::factor`] tells what it costs; it is the expensive step. For every group of exact features that
/// share nodes 3 systems are then solved with the factor (6 where it touches a frame that is held), and 1 for every
/// sliding node, in blocks of 8; their mutual energies, the square of their count, are kept. Hundreds of exact
/// features on 200 x 200 nodes take seconds. Without features there is nothing to factor.
///
/// * `watch`: called between the phases, and asked for memory.
pub fn factor(system: System, watch: Watch) -> Result<FeatureFactor, Error> {
    let System { features, laplacian } = system;
    if features.is_idle() {
        return Ok(FeatureFactor { features, solver: Solver::Idle(laplacian), motions: Motions::default() });
    }
    let poisson = laplacian.factor(&Span::new(watch, 0.0, FACTORED))?;
    let motions = motions(&features, &poisson, &Span::new(watch, FACTORED, 1.0))?;
    Ok(FeatureFactor { features, solver: Solver::Factored(poisson), motions })
}

impl FeatureFactor {
    /// Count of unknowns per coordinate that the factor solves for: nodes neither on a frame that is held or slides
    /// nor of an exact feature; 0 without features.
    pub fn unknowns(&self) -> usize {
        match &self.solver {
            Solver::Idle(_) => 0,
            Solver::Factored(factor) => factor.unknowns(),
        }
    }

    /// Bytes held, approximately.
    pub fn bytes(&self) -> usize {
        let Features { components, groups, quads, is_feature, .. } = &self.features;
        let members: usize = components.iter().map(|component| component.quads.len() + component.nodes.len()).sum();
        let grouped: usize = groups.iter().map(|group| group.whole.quads.len() + 2 * group.whole.nodes.len()).sum();
        let quads = quads.component.len() * (size_of::<u32>() + 2 * size_of::<f64>()) + is_feature.len();
        let factor = match &self.solver {
            Solver::Idle(laplacian) => {
                let Edges { horizontal, vertical } = laplacian.conductances();
                (horizontal.len() + vertical.len()) * size_of::<f64>()
            }
            Solver::Factored(factor) => factor.bytes(),
        };
        factor + quads + (members + grouped) * size_of::<usize>() + self.motions.bytes()
    }

    /// Sum of the squared weights of the quads at every edge.
    pub fn conductances(&self) -> &Edges {
        match &self.solver {
            Solver::Idle(laplacian) => laplacian.conductances(),
            Solver::Factored(factor) => factor.conductances(),
        }
    }

    /// Whether some features are to be similarities exactly.
    pub(super) fn has_exact_features(&self) -> bool {
        !self.features.groups.is_empty()
    }

    /// The labels of exact features that share nodes and so are one similarity, group by group.
    pub fn merged(&self) -> impl Iterator<Item = &[u32]> {
        self.features.groups.iter().map(|group| &group.labels[..]).filter(|labels| labels.len() > 1)
    }

    /// How close `positions`, one per node, bring each component to a similarity, in order of the labels.
    ///
    /// The best similarity is the complex least squares fit to the corners of the component's quads, the mirroring
    /// one where the component turned over. Use it on a warp itself to see what [`super::solve`] gained. O(feature
    /// nodes). Stops when `watch` says so.
    pub fn fits(&self, positions: &Positions, watch: Watch) -> Result<Vec<FeatureFit>, Interrupted> {
        let Features { lattice, components, .. } = &self.features;
        assert_one_per_node(positions, lattice);
        components.par_iter().map(|component| fit::fit(lattice, component, positions, watch)).collect()
    }
}

impl Features {
    /// Nothing can differ from the warp.
    pub(super) fn is_idle(&self) -> bool {
        let is_all_frame = self.lattice.nodes.iter().any(|&count| count < 3);
        self.components.is_empty() || (is_all_frame && self.boundary == Boundary::Pin && self.groups.is_empty())
    }

    /// Nodes of the frame that neither slide nor are free. Exact features may still take them along.
    fn held_for_good(&self) -> impl Iterator<Item = usize> {
        border(self.lattice.nodes)
            .into_iter()
            .filter(|&node| self.is_held(node) && self.sliding.binary_search(&node).is_err())
    }

    /// A node of the frame that does not move freely.
    pub(super) fn is_held(&self, node: usize) -> bool {
        is_on_border(self.lattice.nodes, node) && !(self.boundary == Boundary::Free && self.is_feature[node])
    }

    /// What the factor does not solve for: the held frame and exact features.
    fn pins(&self) -> Pins {
        let holds_frame = || border(self.lattice.nodes).into_iter().all(|node| self.is_held(node));
        if self.is_idle() || (self.groups.is_empty() && self.sliding.is_empty() && holds_frame()) {
            return Pins::Frame;
        }
        let mut pinned: Vec<bool> = (0..self.lattice.node_count()).map(|node| self.is_held(node)).collect();
        self.groups.iter().flat_map(|group| &group.inner).for_each(|&node| pinned[node] = true);
        Pins::Nodes(pinned)
    }
}

fn conductances(lattice: &Lattice, quads: &Quads, watch: Watch) -> Result<Edges, Interrupted> {
    let mut conductances = Edges::zeros(lattice.nodes);
    for (quad, stiffness) in quads.stiffness.iter().enumerate() {
        if quad % RUN == 0 {
            watch.go_on()?;
        }
        let (horizontal, vertical) = edges_of(quad, lattice.nodes[0]);
        horizontal.iter().for_each(|&(edge, ..)| conductances.horizontal[edge] += stiffness);
        vertical.iter().for_each(|&(edge, ..)| conductances.vertical[edge] += stiffness);
    }
    Ok(conductances)
}

fn features(
    structure: &Structure,
    components: Vec<Component>,
    quads: Quads,
    watch: Watch,
) -> Result<Features, Interrupted> {
    let Structure { lattice, boundary, exact, .. } = *structure;
    let mut is_feature = vec![false; lattice.node_count()];
    components.iter().flat_map(|component| &component.nodes).for_each(|&node| is_feature[node] = true);
    let slides = |&node: &usize| is_feature[node] && !is_corner(lattice.nodes, node);
    let mut sliding: Vec<usize> = match boundary {
        Boundary::Slide => border(lattice.nodes).into_iter().filter(slides).collect(),
        _ => Vec::new(),
    };
    sliding.sort_unstable();
    let groups = match exact {
        Exact::Off => Vec::new(),
        _ => groups(lattice, &components, boundary, watch)?,
    };
    Ok(Features { lattice: *lattice, components, quads, boundary, exact, groups, sliding, is_feature })
}

fn groups(
    lattice: &Lattice,
    components: &[Component],
    boundary: Boundary,
    watch: Watch,
) -> Result<Vec<Group>, Interrupted> {
    let group = |members: Vec<usize>| {
        let whole = united(components, &members);
        let labels = members.iter().map(|&index| components[index].label).collect();
        let held = |&node: &usize| boundary != Boundary::Free && is_on_border(lattice.nodes, node);
        let (frame, inner) = whole.nodes.iter().copied().partition(held);
        Group { whole, labels, inner, frame }
    };
    Ok(touching(components, lattice.node_count(), watch)?.into_iter().map(group).collect())
}

fn is_corner([columns, rows]: [usize; 2], node: usize) -> bool {
    let (column, row) = (node % columns, node / columns);
    (column == 0 || column + 1 == columns) && (row == 0 || row + 1 == rows)
}

/// Bytes that [`setup`] holds at its peak beside the labels, some of which it gives: per quad conductances, stiffness,
/// shares and components, per quad of a feature itself and its corners, twice while these are sorted.
fn setup_bytes(cells: &FeatureCells) -> usize {
    let members = cells.labels.iter().filter(|&&label| label != 0).count();
    cells.labels.len() * 37 + members * 48
}
