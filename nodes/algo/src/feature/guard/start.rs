//! Warps without folds to start from.

use super::boundary::doubled_area;
use super::shape::Shape;
use super::{Error, Freedom, Functional};
use crate::Watch;
use crate::lattice::{Positions, border};
use crate::poisson;
use crate::room::Room;
use crate::warp::certify;

/// Share of the start's least Jacobian, or of 1, that a repair may use up to.
const FLOOR: f64 = 0.01;

/// The floor, by mean Jacobian, where no start is known.
const UNTANGLED_FLOOR: f64 = 1e-4;

/// A warp to start from, and its least corner Jacobian.
pub(super) enum Start {
    /// The base, or else the convex combination map: free of folds.
    Free { positions: Positions, least: f64 },
    /// None is known; the convex combination map, which folds.
    Folded { combination: Positions },
}

impl Start {
    pub(super) fn find(functional: &Functional, shape: &Shape, room: &mut Room, watch: Watch) -> Result<Self, Error> {
        let least = certify(functional.lattice, functional.base, watch)?.min_jacobian;
        if least > 0.0 {
            return Ok(Self::Free { positions: functional.base.clone(), least });
        }
        let combination = combination(functional, room, watch)?.unwrap_or_else(|| functional.base.clone());
        let least = certify(functional.lattice, &combination, watch)?.min_jacobian.min(shape.least(&combination));
        Ok(if least > 0.0 { Self::Free { positions: combination, least } } else { Self::Folded { combination } })
    }

    pub(super) fn floor(&self, functional: &Functional) -> f64 {
        match self {
            Self::Free { least, .. } => FLOOR * least.min(1.0),
            Self::Folded { .. } => UNTANGLED_FLOOR * mean_jacobian(functional).min(1.0),
        }
    }
}

/// The mean Jacobian of all warps with the base's boundary; 1 where it is not positive.
pub(super) fn mean_jacobian(functional: &Functional) -> f64 {
    let [width, height] = functional.lattice.size();
    let mean = 0.5 * doubled_area(functional.base, &border(functional.lattice.nodes)) / (width * height);
    if mean > 0.0 { mean } else { 1.0 }
}

/// Every node the mean of its neighbours weighted by the conductances, but those that are not free as in the base.
///
/// None where the system cannot be solved.
fn combination(functional: &Functional, room: &mut Room, watch: Watch) -> Result<Option<Positions>, Error> {
    let pin = |freedom: &Freedom| if *freedom == Freedom::Free { Freedom::Free } else { Freedom::Pinned };
    let freedom: Vec<Freedom> = functional.freedom.iter().map(pin).collect();
    let fluxes = functional.contraction();
    match (Functional { fluxes: &fluxes, freedom: &freedom, ..*functional }).minimised(room, watch) {
        Err(Error::Poisson(poisson::Error::NotPositiveDefinite)) => Ok(None),
        found => found.map(Some),
    }
}
