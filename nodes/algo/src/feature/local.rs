//! What a warp does to one quad, and what its component makes of it.

use super::RUN;
use super::components::Component;
use crate::lattice::{Lattice, Positions};
use crate::poisson::Edge;
use crate::{Interrupted, Watch};
use faer::c64;

/// The least scale that features take from a warp.
const LEAST_SCALE: f64 = 1e-3;

/// A rotation is undefined where the part that holds it is not above this share of the linear map.
const DEGENERATE: f64 = 1e-9;

const I: c64 = c64::new(0.0, 1.0);

/// The two horizontal and the two vertical edges of a quad, in lattices of `columns` columns of nodes.
pub(super) fn edges_of(quad: usize, columns: usize) -> ([Edge; 2], [Edge; 2]) {
    let node = quad + quad / (columns - 1);
    let below = node + columns;
    (
        [(quad, node, node + 1), (quad + columns - 1, below, below + 1)],
        [(node, node, below), (node + 1, node + 1, below + 1)],
    )
}

/// The linear part `z -> a z + b conj(z)` of a warp on one quad.
///
/// It equals the least squares fit by the pseudo-inverse of Equation 1: the means of the opposite edges, by the
/// spacing, are its columns.
#[derive(Clone, Copy)]
pub(super) struct Linear {
    /// Rotation and uniform scale.
    pub(super) a: c64,
    /// The rest, which mirrors.
    pub(super) b: c64,
}

impl Linear {
    pub(super) fn of(lattice: &Lattice, warp: &Positions, quad: usize) -> Self {
        let column = |edges: [Edge; 2], spacing: f64| {
            let [first, second] = edges.map(|(_, from, to)| difference(warp, from, to));
            (first + second) / (2.0 * spacing)
        };
        let (horizontal, vertical) = edges_of(quad, lattice.nodes[0]);
        let (x, y) = (column(horizontal, lattice.spacing[0]), column(vertical, lattice.spacing[1]));
        Self { a: (x - I * y) / 2.0, b: (x + I * y) / 2.0 }
    }

    /// The larger singular value.
    fn norm(&self) -> f64 {
        modulus(self.a) + modulus(self.b)
    }
}

/// How the quads of one component are to be mapped: by `scale` times their own rotation.
#[derive(Clone, Copy)]
pub(super) struct Frame {
    /// The component is mirrored: its rotations follow a reflection.
    pub(super) mirrored: bool,
    pub(super) scale: f64,
    /// Rotation of the whole, and of quads that have none of their own.
    pub(super) rotation: c64,
}

impl Frame {
    /// The frame of a component under a warp; of a given scale, or of the warp's.
    ///
    /// The warp's scale is the mean of the smaller singular value over the component's quads, 0 on those that turn
    /// over, and at least 1e-3. The component is mirrored where the mean determinant is negative.
    pub(super) fn of(
        lattice: &Lattice,
        warp: &Positions,
        component: &Component,
        scale: Option<f64>,
        watch: Watch,
    ) -> Result<Self, Interrupted> {
        let zero = c64::new(0.0, 0.0);
        let mut sum = Linear { a: zero, b: zero };
        let (mut upright, mut mirrored, mut determinant, mut norm) = (0.0, 0.0, 0.0, 0.0);
        for (number, &quad) in component.quads.iter().enumerate() {
            if number % RUN == 0 {
                watch.go_on()?;
            }
            let linear = Linear::of(lattice, warp, quad);
            let signed = modulus(linear.a) - modulus(linear.b);
            sum = Linear { a: sum.a + linear.a, b: sum.b + linear.b };
            upright += signed.max(0.0);
            mirrored += (-signed).max(0.0);
            determinant += signed * linear.norm();
            norm += linear.norm();
        }
        let count = component.quads.len() as f64;
        let (mirrored, sizes, main) = if determinant < 0.0 { (true, mirrored, sum.b) } else { (false, upright, sum.a) };
        Ok(Self {
            mirrored,
            scale: scale.unwrap_or((sizes / count).max(LEAST_SCALE)),
            rotation: direction(main, norm).unwrap_or(c64::new(1.0, 0.0)),
        })
    }

    /// Where the horizontal and the vertical edges of a quad of `spacing` go.
    pub(super) fn edges(&self, linear: &Linear, spacing: [f64; 2]) -> [c64; 2] {
        let main = if self.mirrored { linear.b } else { linear.a };
        let turn = direction(main, linear.norm()).unwrap_or(self.rotation) * self.scale;
        let down = if self.mirrored { -I } else { I };
        [turn * spacing[0], turn * down * spacing[1]]
    }
}

/// z / |z|, or none where z is next to nothing against `size`.
fn direction(z: c64, size: f64) -> Option<c64> {
    let length = modulus(z);
    (length > DEGENERATE * size).then(|| z / length)
}

/// The vector from node `from` to node `to`.
pub(super) fn difference(positions: &Positions, from: usize, to: usize) -> c64 {
    c64::new(positions.x[to] - positions.x[from], positions.y[to] - positions.y[from])
}

pub(super) fn modulus(z: c64) -> f64 {
    libm::hypot(z.re, z.im)
}
