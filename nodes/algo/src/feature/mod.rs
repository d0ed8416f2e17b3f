//! Feature-aware warps: follow a warp everywhere, but map labelled features by similarities.
//!
//! Gal, Sorkine and Cohen-Or, "Feature-aware texturing", 2006, on a regular lattice. Every edge of every quad asks
//! for an image: `s R e` on features and around them, R the rotation of the warp on the quad and s one scale per
//! component; the warp's own image elsewhere. Weighted least squares gives the nodes; those on the frame stay where
//! the warp puts them, or slide, or are free ([`Boundary`]). The normal equations are a weighted five-point
//! Laplacian ([`crate::poisson`]) that does not know the warp: [`setup`] and [`factor`] once, then [`rhs`] and
//! [`solve`] for every warp.
//!
//! What is solved for is the displacement from the warp: its right-hand side lives on and around features only, so
//! no digits are lost to the size of the picture, and where nothing is asked for the warp comes back as it was.
//!
//! Features that are to be similarities exactly, and nodes that slide, are pinned in the factor and moved by a few
//! numbers each: a small dense system per warp ([`Exact`]).

mod cells;
mod certified;
mod components;
mod fit;
pub mod guard;
mod local;
mod motion;
mod rhs;
mod setup;
mod solve;
mod weights;

#[cfg(test)]
mod tests;

pub use cells::{FeatureCells, cell_coverage, feature_cells};
pub use certified::solve_certified;
pub use fit::FeatureFit;
pub use rhs::{Freedom, Functional, Mode, OnConflict, Override, Rhs, Targets, rhs};
pub use setup::{Boundary, Exact, FeatureFactor, Structure, System, factor, setup};
pub use solve::{FeatureWarp, solve};

use crate::Interrupted;
use crate::lattice::{Lattice, Positions};
use crate::poisson;

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
    /// No node is left where the warp puts it, so nothing says where the picture goes.
    NoPins,
    /// Exact features that share nodes, and so are one, want several scales.
    Contradiction {
        /// Labels of two of them, rising.
        labels: [u32; 2],
        /// What they want; none takes the warp's scale.
        scales: [Option<f64>; 2],
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

/// Quads between two looks at the watch.
const RUN: usize = 1 << 16;

fn assert_one_per_node(positions: &Positions, lattice: &Lattice) {
    let count = lattice.node_count();
    assert!(positions.x.len() == count && positions.y.len() == count, "positions of {count} nodes");
}
