//! The warp itself.

use super::fit::FeatureFit;
use super::motion::Motions;
use super::rhs::Rhs;
use super::setup::Solver;
use super::{Error, assert_one_per_node};
use crate::Watch;
use crate::lattice::Positions;
use crate::steps::Paid;

/// A warp that respects features.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureWarp {
    /// Where the nodes go, px.
    pub positions: Positions,
    /// Relative residual of the normal equations for the displacement from the warp, the worse of x and y.
    pub residual: f64,
    /// The components in order of their labels.
    pub features: Vec<FeatureFit>,
    /// Labels of the exact features that touch a frame which does not move freely, rising.
    pub conflicts: Vec<u32>,
}

/// The feature-aware warp of a right-hand side.
///
/// The minimiser of the functional of [`super::setup`] over what the factor and the right-hand side leave free: the
/// nodes off the frame, those on the frame that slide or are free, and the similarities of exact features.
///
/// * `rhs`: made by [`super::rhs`]; its factor is used.
/// * `tolerance`: largest distance of a node from the exact solution, px, positive.
/// * `watch`: called before every substitution.
///
/// Without features the warp itself, and where no node may leave it. The cost is that of
/// [`crate::poisson::Factor::solve`] for two right-hand sides; twice that where features are exact or nodes slide,
/// and a dense system of 4 unknowns for every exact feature (2 of `Exact::Rigid`) and 1 for every sliding node.
///
/// Section 4, Equations 10 to 13; exact features are our own.
pub fn solve(rhs: &Rhs, tolerance: f64, watch: Watch) -> Result<FeatureWarp, Error> {
    let features = &rhs.factor.features;
    assert_one_per_node(rhs.warp, &features.lattice);
    let mut positions = rhs.warp.clone();
    let mut residual = 0.0;
    if let Solver::Factored(poisson) = &rhs.factor.solver {
        let motions = &rhs.factor.motions;
        let mut held = Motions::begin(rhs);
        let mut solution = poisson.solve(&rhs.fluxes, &[&held[0], &held[1]], tolerance, watch)?;
        if !motions.is_empty() {
            motions.settle(rhs, &solution.fields, &mut held, watch)?;
            // The first solve's memory serves again.
            drop(solution);
            solution = poisson.solve(&rhs.fluxes, &[&held[0], &held[1]], tolerance, &Paid(watch))?;
        }
        for (coordinate, displacement) in [&mut positions.x, &mut positions.y].into_iter().zip(&solution.fields) {
            coordinate.iter_mut().zip(displacement).for_each(|(value, displacement)| *value += displacement);
        }
        residual = solution.residual;
    }
    let fits = rhs.factor.fits(&positions, watch)?;
    let mut conflicts: Vec<u32> = features.conflicts().collect();
    conflicts.sort_unstable();
    Ok(FeatureWarp { positions, residual, features: fits, conflicts })
}
