//! Feature-aware warps: follow a warp everywhere, but map labelled features by similarities.
//!
//! Gal, Sorkine and Cohen-Or, "Feature-aware texturing", 2006, on a regular lattice. Every edge of every quad asks
//! for an image: `s R e` on features and around them, R the rotation of the warp on the quad and s one scale per
//! component; the warp's own image elsewhere. Weighted least squares gives the nodes; those on the frame stay where
//! the warp puts them. The normal equations are a weighted five-point Laplacian ([`crate::poisson`]) that does not
//! know the warp: [`setup`] and [`factor`] once, then [`rhs`] and [`solve`] for every warp.
//!
//! What is solved for is the displacement from the warp: its right-hand side lives on and around features only, so
//! no digits are lost to the size of the picture, and where nothing is asked for the warp comes back as it was.

mod cells;
mod fit;
pub mod guard;
mod local;
mod weights;

#[cfg(test)]
mod tests;

pub use cells::{FeatureCells, feature_cells};
pub use fit::FeatureFit;

use crate::lattice::{Lattice, Positions};
use crate::poisson::{self, Edges, GridLaplacian};
use crate::{Interrupted, Watch};
use local::{Frame, Linear, difference, edges_of};
use rayon::prelude::*;
use weights::{NONE, Quads};

/// What features keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Their shape: each component takes one scale from the warp.
    Similarity,
    /// Their shape and size.
    Rigid,
}

/// Why a feature-aware warp was not computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Error {
    /// The warp is not finite at this node, the first such one in row-major order.
    NotFinite {
        /// Column of the node.
        column: usize,
        /// Row of the node.
        row: usize,
    },
    /// The system was not factored or not solved.
    Poisson(poisson::Error),
}

impl From<Interrupted> for Error {
    fn from(error: Interrupted) -> Self {
        Self::Poisson(error.into())
    }
}

impl From<poisson::Error> for Error {
    fn from(error: poisson::Error) -> Self {
        Self::Poisson(error)
    }
}

/// The quads of one label, and their corners.
#[derive(Debug)]
struct Component {
    label: u32,
    quads: Vec<usize>,
    nodes: Vec<usize>,
}

/// Everything about the features that does not depend on a warp.
#[derive(Debug)]
struct Features {
    lattice: Lattice,
    /// In order of their labels.
    components: Vec<Component>,
    quads: Quads,
}

/// The least squares system of a lattice and its features, not yet factored.
#[derive(Debug)]
pub struct System {
    features: Features,
    /// None without features: the warp is the result.
    laplacian: Option<GridLaplacian>,
}

/// A factored system: serves any number of warps.
#[derive(Debug)]
pub struct FeatureFactor {
    features: Features,
    poisson: Option<poisson::Factor>,
}

/// The right-hand side for one warp and mode, to be solved with the factor it was made for.
#[derive(Debug)]
pub struct Rhs<'a> {
    warp: &'a Positions,
    /// For x and for y: what the quads ask of each edge beyond what the warp does, times their squared weights.
    fluxes: [Edges; 2],
}

/// A warp that respects features.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureWarp {
    /// Where the nodes go, px.
    pub positions: Positions,
    /// Relative residual of the normal equations for the displacement from the warp, the worse of x and y.
    pub residual: f64,
    /// The components in order of their labels.
    pub features: Vec<FeatureFit>,
}

/// Sets up the least squares system of a lattice and its features.
///
/// Minimise `sum over quads Q and edges (p, q) of Q of w_Q^2 |x_q - x_p - g_Q(p, q)|^2`; the weights w_Q make the
/// matrix, the images g_Q the right-hand side ([`rhs`]). `w_Q = 1 + (weight - 1) f(D)` with
/// `f(D) = 2 (D / radius)^3 - 3 (D / radius)^2 + 1` for D < radius, else 0; D is the distance in cells from Q's
/// centre to the union of the feature quads, 0 on them. Quads with 0 < D < radius follow the nearest component, of
/// equally near ones that with the lowest label.
///
/// * `lattice`: at rest, at least 2 x 2 nodes.
/// * `cells`: label of every cell.
/// * `weight`: of feature quads, finite and positive; 10 in the paper.
/// * `radius`: of the transition, cells, finite and not negative; 2 in the paper, 0 for a sharp edge.
///
/// All quads of one label are one component, connected or not. Features may touch the frame and each other, where
/// least squares averages what they ask for. Time O(cells * (1 + radius)).
///
/// Section 2, Equations 3 to 5, and Section 2.1, Equations 6 and 7.
pub fn setup(
    lattice: &Lattice,
    cells: &FeatureCells,
    weight: f64,
    radius: f64,
    watch: Watch,
) -> Result<System, Interrupted> {
    let [columns, rows] = lattice.cells();
    assert_eq!(cells.labels.len(), columns * rows, "labels of {columns} x {rows} cells");
    assert!(weight.is_finite() && weight > 0.0, "weight {weight}");
    assert!(radius.is_finite() && radius >= 0.0, "radius {radius}");
    watch.reserve(setup_bytes(cells))?;
    let (components, component_of) = components(lattice, &cells.labels, watch)?;
    let quads = weights::weigh(&component_of, columns, weight, radius, watch)?;
    drop(component_of);
    let laplacian = (!components.is_empty()).then(|| {
        let mut conductances = Edges::zeros(lattice.nodes);
        for (quad, stiffness) in quads.stiffness.iter().enumerate() {
            if quad % RUN == 0 {
                watch.go_on()?;
            }
            let (horizontal, vertical) = edges_of(quad, lattice.nodes[0]);
            horizontal.iter().for_each(|&(edge, ..)| conductances.horizontal[edge] += stiffness);
            vertical.iter().for_each(|&(edge, ..)| conductances.vertical[edge] += stiffness);
        }
        Ok(GridLaplacian::new(lattice.nodes, conductances))
    });
    let laplacian = laplacian.transpose()?;
    Ok(System { features: Features { lattice: *lattice, components, quads }, laplacian })
}

/// Factors a system.
///
/// [`GridLaplacian::factor`] tells what it costs; it is the expensive step. Without features there is nothing to
/// factor.
///
/// * `watch`: called between the phases.
pub fn factor(system: System, watch: Watch) -> Result<FeatureFactor, Error> {
    let poisson = system.laplacian.map(|laplacian| laplacian.factor(watch)).transpose()?;
    Ok(FeatureFactor { features: system.features, poisson })
}

impl FeatureFactor {
    /// Count of unknowns per coordinate: nodes off the frame; 0 without features.
    pub fn unknowns(&self) -> usize {
        self.poisson.as_ref().map_or(0, poisson::Factor::unknowns)
    }

    /// Bytes held, approximately.
    pub fn bytes(&self) -> usize {
        let Features { components, quads, .. } = &self.features;
        let members: usize = components.iter().map(|component| component.quads.len() + component.nodes.len()).sum();
        let quads = quads.component.len() * (size_of::<u32>() + size_of::<f64>());
        self.poisson.as_ref().map_or(0, poisson::Factor::bytes) + quads + members * size_of::<usize>()
    }

    /// How close `positions`, one per node, bring each component to a similarity, in order of the labels.
    ///
    /// The best similarity is the complex least squares fit to the corners of the component's quads, the mirroring
    /// one where the component turned over. Use it on a warp itself to see what [`solve`] gained. O(feature nodes).
    /// Stops when `watch` says so.
    pub fn fits(&self, positions: &Positions, watch: Watch) -> Result<Vec<FeatureFit>, Interrupted> {
        let Features { lattice, components, .. } = &self.features;
        assert_one_per_node(positions, lattice);
        components.par_iter().map(|component| fit::fit(lattice, component, positions, watch)).collect()
    }
}

/// The right-hand side for a warp.
///
/// On a quad the warp's linear part is `z -> a z + b conj(z)`, z = x + i y, with singular values |a| + |b| and
/// ||a| - |b||. Quads that follow a component ask for `g = s (a / |a|) e` of their edges e. For `Similarity` the
/// scale s is the mean of max(|a| - |b|, 0) over the component's quads, for `Rigid` it is 1. Other quads ask for
/// what the warp does.
///
/// * `warp`: position of every node, px.
///
/// Where the warp mirrors a component (its mean determinant is negative) a and b change places: the component's
/// quads are mapped by `s (b / |b|) conj(e)`. Where the part that holds the rotation is below 1e-9 of the linear
/// map, the component's mean rotation is used, and no rotation if it has none. A warp that collapses a component
/// may take its scale to 0. O(cells); fails on a warp that is not finite.
///
/// Section 2, Equations 1 to 4, with R = a / |a| the proper rotation of the polar decomposition.
pub fn rhs<'a>(factor: &FeatureFactor, warp: &'a Positions, mode: Mode, watch: Watch) -> Result<Rhs<'a>, Error> {
    let Features { lattice, components, quads } = &factor.features;
    assert_one_per_node(warp, lattice);
    if let Some(node) = (0..warp.x.len()).find(|&node| !(warp.x[node].is_finite() && warp.y[node].is_finite())) {
        return Err(Error::NotFinite { column: node % lattice.nodes[0], row: node / lattice.nodes[0] });
    }
    let frame = |component| Frame::of(lattice, warp, component, mode == Mode::Rigid, watch);
    let frames: Vec<Frame> = components.par_iter().map(frame).collect::<Result<_, _>>()?;
    let [mut x, mut y] = [Edges::zeros(lattice.nodes), Edges::zeros(lattice.nodes)];
    for (quad, (&component, &stiffness)) in quads.component.iter().zip(&quads.stiffness).enumerate() {
        if quad % RUN == 0 {
            watch.go_on()?;
        }
        if component == NONE {
            continue;
        }
        let [across, down] = frames[component as usize].edges(&Linear::of(lattice, warp, quad), lattice.spacing);
        let (horizontal, vertical) = edges_of(quad, lattice.nodes[0]);
        for (edge, from, to) in horizontal {
            let flux = (across - difference(warp, from, to)) * stiffness;
            x.horizontal[edge] += flux.re;
            y.horizontal[edge] += flux.im;
        }
        for (edge, from, to) in vertical {
            let flux = (down - difference(warp, from, to)) * stiffness;
            x.vertical[edge] += flux.re;
            y.vertical[edge] += flux.im;
        }
    }
    Ok(Rhs { warp, fluxes: [x, y] })
}

/// The feature-aware warp of a right-hand side.
///
/// The minimiser of the functional of [`setup`] with the nodes of the frame held where the warp puts them.
///
/// * `rhs`: made by [`rhs`] for this factor.
/// * `watch`: called before every substitution.
///
/// Without features, or without nodes off the frame, the warp itself. The cost is that of
/// [`poisson::Factor::solve`] for two right-hand sides.
///
/// Section 4, Equations 10 to 13.
pub fn solve(factor: &FeatureFactor, rhs: &Rhs, watch: Watch) -> Result<FeatureWarp, Error> {
    assert_one_per_node(rhs.warp, &factor.features.lattice);
    let mut positions = rhs.warp.clone();
    let mut residual = 0.0;
    if let Some(poisson) = &factor.poisson {
        let still = vec![0.0; positions.x.len()];
        let solution = poisson.solve(&rhs.fluxes, &[&still, &still], watch)?;
        for (coordinate, displacement) in [&mut positions.x, &mut positions.y].into_iter().zip(&solution.fields) {
            coordinate.iter_mut().zip(displacement).for_each(|(value, displacement)| *value += displacement);
        }
        residual = solution.residual;
    }
    let features = factor.fits(&positions, watch)?;
    Ok(FeatureWarp { positions, residual, features })
}

fn assert_one_per_node(positions: &Positions, lattice: &Lattice) {
    let count = lattice.node_count();
    assert!(positions.x.len() == count && positions.y.len() == count, "positions of {count} nodes");
}

/// Quads between two looks at the watch.
const RUN: usize = 1 << 16;

/// Bytes that [`setup`] holds at its peak beside the labels, some of which it gives: per quad conductances, stiffness
/// and components, per quad of a feature itself and its corners, twice while these are sorted.
fn setup_bytes(cells: &FeatureCells) -> usize {
    let members = cells.labels.iter().filter(|&&label| label != 0).count();
    cells.labels.len() * 28 + members * 48
}

/// The components in order of their labels, and the component of every cell.
fn components(lattice: &Lattice, labels: &[u32], watch: Watch) -> Result<(Vec<Component>, Vec<u32>), Interrupted> {
    let present = distinct(labels, watch)?;
    let index = |label: &u32| present.binary_search(label).map_or(NONE, |index| index as u32);
    let mut component_of = vec![NONE; labels.len()];
    let runs = component_of.par_chunks_mut(RUN).zip(labels.par_chunks(RUN));
    runs.try_for_each(|(components, labels)| {
        components.iter_mut().zip(labels).for_each(|(component, label)| *component = index(label));
        watch.go_on()
    })?;
    let mut sizes = vec![0; present.len()];
    component_of.iter().filter(|&&component| component != NONE).for_each(|&component| sizes[component as usize] += 1);
    let empty =
        |(&label, &size): (&u32, &usize)| Component { label, quads: Vec::with_capacity(size), nodes: Vec::new() };
    let mut components: Vec<Component> = present.iter().zip(&sizes).map(empty).collect();
    for (quad, &component) in component_of.iter().enumerate() {
        if quad % RUN == 0 {
            watch.go_on()?;
        }
        if component != NONE {
            components[component as usize].quads.push(quad);
        }
    }
    components.par_iter_mut().try_for_each(|component| {
        component.nodes = corners(&component.quads, lattice.nodes[0]);
        watch.go_on()
    })?;
    Ok((components, component_of))
}

/// The labels there are but 0, rising.
fn distinct(labels: &[u32], watch: Watch) -> Result<Vec<u32>, Interrupted> {
    let of_run = |labels: &[u32]| {
        let mut present = labels.to_vec();
        present.sort_unstable();
        present.dedup();
        watch.go_on().map(|()| present)
    };
    let runs = labels.par_chunks(RUN).map(of_run).collect::<Result<Vec<_>, _>>()?;
    let mut present = runs.concat();
    present.sort_unstable();
    present.dedup();
    present.retain(|&label| label != 0);
    Ok(present)
}

/// The corners of quads given in order, in order, each once.
fn corners(quads: &[usize], columns: usize) -> Vec<usize> {
    let mut nodes: Vec<usize> = Vec::with_capacity(4 * quads.len());
    nodes.extend(quads.iter().flat_map(|&quad| {
        let (_, from, to) = edges_of(quad, columns).0[0];
        [from, to]
    }));
    nodes.extend(quads.iter().flat_map(|&quad| {
        let (_, from, to) = edges_of(quad, columns).0[1];
        [from, to]
    }));
    // Two runs that rise: merged, not sorted.
    nodes.sort();
    nodes.dedup();
    nodes.shrink_to_fit();
    nodes
}
