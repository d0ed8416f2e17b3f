//! Lattices, maps on them, and prefactored solvers.

use std::any::Any;
use std::sync::Arc;

use super::{Digest, Hasher};

/// A regular lattice over a rectangle; node (c, r) rests at `origin + (c, r) * spacing`, px.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Grid {
    /// Position of node (0, 0), px.
    pub origin: [f64; 2],
    /// Distance between neighbouring nodes, px, positive.
    pub spacing: [f64; 2],
    /// Columns and rows of nodes, at least 2 each.
    pub nodes: [usize; 2],
    /// Whether the last column (row) is the first one a period further.
    pub periodic: [bool; 2],
}

impl Grid {
    /// Count of nodes.
    pub fn node_count(&self) -> usize {
        self.nodes[0] * self.nodes[1]
    }

    /// Digest of all of it.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("grid");
        hasher.numbers(&self.origin).numbers(&self.spacing);
        for axis in 0..2 {
            hasher.int(self.nodes[axis] as i128).int(self.periodic[axis].into());
        }
        hasher.finish()
    }
}

/// Which way a warp's positions point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Each lattice node's position is where it goes.
    DstFromSrc,
    /// Each lattice node's position is where it comes from.
    SrcFromDst,
}

/// A map on a grid, bilinear between nodes, continued linearly outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Warp {
    /// The lattice it lives on.
    pub grid: Grid,
    /// Which way positions point.
    pub direction: Direction,
    /// x of each node's position, px, row-major.
    pub x: Arc<Vec<f64>>,
    /// y of each node's position, px, row-major.
    pub y: Arc<Vec<f64>>,
}

impl Warp {
    /// Digest of lattice, direction and positions.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("warp");
        hasher.digest(&self.grid.digest()).int(self.direction as i128).numbers(&self.x).numbers(&self.y);
        hasher.finish()
    }
}

/// A prefactored solver. It lives in memory only; its digest is that of the structure it was made for.
#[derive(Clone)]
pub struct Factor {
    /// The lattice it was made for.
    pub grid: Grid,
    /// Digest of everything that determines the factor.
    pub structure: Digest,
    /// Memory it holds.
    pub bytes: u64,
    /// What `--dump` shows of it: counts and parameters.
    pub summary: serde_json::Value,
    /// The solver itself, known to the nodes that make and use it.
    pub solver: Arc<dyn Any + Send + Sync>,
}

impl std::fmt::Debug for Factor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Factor({:?})", self.structure)
    }
}
