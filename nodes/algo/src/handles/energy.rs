//! Energies that are a sum of one form over all cells.

use faer::c64;
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::traits::ComplexField;
use std::ops::{Add, AddAssign, Mul, Sub, SubAssign};

use super::Error;
use crate::Watch;
use crate::lattice::Lattice;

/// Real or complex numbers.
pub(super) trait Number:
    ComplexField
    + Copy
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Mul<f64, Output = Self>
    + AddAssign
    + SubAssign
{
    const ZERO: Self;
    const ONE: Self;
    /// Columns of them that hold a displacement in the plane.
    const COLUMNS: usize;

    fn modulus(self) -> f64;
}

impl Number for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const COLUMNS: usize = 2;

    fn modulus(self) -> f64 {
        self.abs()
    }
}

impl Number for c64 {
    const ZERO: Self = c64::new(0.0, 0.0);
    const ONE: Self = c64::new(1.0, 0.0);
    const COLUMNS: usize = 1;

    fn modulus(self) -> f64 {
        libm::hypot(self.re, self.im)
    }
}

/// `sum over cells of z_Q^* M z_Q`, M one Hermitian form on the corners (0, 0), (1, 0), (0, 1), (1, 1) of a cell.
///
/// Opposite corners do not meet in it, so its matrix couples each node with four neighbours.
#[derive(Clone, Copy, Debug)]
pub(super) struct Energy<T> {
    nodes: [usize; 2],
    cell: [[T; 4]; 4],
}

/// Corners of a cell about its middle as complex numbers, the larger spacing being 1.
pub(super) fn corners(lattice: &Lattice) -> [c64; 4] {
    let [x, y] = lattice.spacing.map(|spacing| spacing / lattice.spacing[0].max(lattice.spacing[1]) / 2.0);
    [c64::new(-x, -y), c64::new(x, -y), c64::new(-x, y), c64::new(x, y)]
}

/// |u|^2 of the corners u.
pub(super) fn square(corners: &[c64; 4]) -> f64 {
    corners.iter().map(|u| u.re * u.re + u.im * u.im).sum()
}

/// How far each cell is from a similarity of itself at rest: `|(I - G G^+) z_Q|^2`, G = [1, v_Q].
///
/// With the corners u about the middle, G G^+ = 1 1^T / 4 + u u^* / |u|^2. Inside the lattice x neighbours and y
/// neighbours come to weigh as hy^2 : hx^2, and the imaginary parts meet only on the frame.
pub(super) fn similarity(lattice: &Lattice) -> Energy<c64> {
    let u = corners(lattice);
    let size = square(&u);
    let entry = |j: usize, k: usize| {
        let own = if j == k { 1.0 } else { 0.0 };
        c64::new(own - 0.25, 0.0) - u[j] * u[k].conj() / size
    };
    Energy { nodes: lattice.nodes, cell: std::array::from_fn(|j| std::array::from_fn(|k| entry(j, k))) }
}

/// Dirichlet's energy: `sum over edges of c_e |z_q - z_p|^2 / 2` of a cell, c = hy / hx along x and hx / hy along y.
pub(super) fn dirichlet(lattice: &Lattice) -> Energy<f64> {
    let [hx, hy] = lattice.spacing;
    let mut cell = [[0.0; 4]; 4];
    for (p, q, conductance) in [(0, 1, hy / hx), (2, 3, hy / hx), (0, 2, hx / hy), (1, 3, hx / hy)] {
        for (j, k, sign) in [(p, p, 0.5), (q, q, 0.5), (p, q, -0.5), (q, p, -0.5)] {
            cell[j][k] += sign * conductance;
        }
    }
    Energy { nodes: lattice.nodes, cell }
}

impl<T: Number> Energy<T> {
    /// Count of nodes.
    pub(super) fn node_count(&self) -> usize {
        self.nodes[0] * self.nodes[1]
    }

    pub(super) fn nodes(&self) -> [usize; 2] {
        self.nodes
    }

    /// A bound of the matrix's norm.
    pub(super) fn norm(&self) -> f64 {
        4.0 * self.cell.iter().map(|row| row.iter().map(|entry| entry.modulus()).sum()).fold(0.0, f64::max)
    }

    /// Adds the gradients `M z_Q` of all cells to the nodes; `of_cell` gives z_Q of the cell whose corners it is told.
    pub(super) fn add_gradients(&self, sums: &mut [T], of_cell: impl Fn([usize; 4]) -> [T; 4]) {
        let [columns, rows] = self.nodes;
        for row in 0..rows - 1 {
            for column in 0..columns - 1 {
                let first = row * columns + column;
                let nodes = [first, first + 1, first + columns, first + columns + 1];
                let z = of_cell(nodes);
                for (node, form) in nodes.into_iter().zip(&self.cell) {
                    sums[node] += form[0] * z[0] + form[1] * z[1] + form[2] * z[2] + form[3] * z[3];
                }
            }
        }
    }

    /// The matrix over all nodes, its lower triangle; the rows and columns of `pins` are those of the identity.
    pub(super) fn lower_triangle(&self, pins: &[usize], watch: Watch) -> Result<SparseColMat<u32, T>, Error> {
        let ([columns, rows], n) = (self.nodes, self.node_count());
        if n > i32::MAX as usize / 3 {
            return Err(Error::TooLarge);
        }
        let (mut starts, mut indices, mut values) =
            (Vec::with_capacity(n + 1), Vec::with_capacity(3 * n), Vec::with_capacity(3 * n));
        starts.push(0);
        for node in 0..n {
            let (column, row) = (node % columns, node / columns);
            if column == 0 {
                watch.go_on()?;
            }
            let pinned = pins.contains(&node);
            let [left, right, up, down] = [column > 0, column + 1 < columns, row > 0, row + 1 < rows];
            let entry = |cells: [(bool, usize, usize); 4]| {
                let there = cells.into_iter().filter(|cell| cell.0);
                there.fold(T::ZERO, |sum, (_, j, k)| sum + self.cell[j][k])
            };
            let none = (false, 0, 0);
            let own = [(right && down, 0, 0), (left && down, 1, 1), (right && up, 2, 2), (left && up, 3, 3)];
            indices.push(node as u32);
            values.push(if pinned { T::ONE } else { entry(own) });
            if right && !pinned && !pins.contains(&(node + 1)) {
                indices.push(node as u32 + 1);
                values.push(entry([(down, 1, 0), (up, 3, 2), none, none]));
            }
            if down && !pinned && !pins.contains(&(node + columns)) {
                indices.push((node + columns) as u32);
                values.push(entry([(right, 2, 0), (left, 3, 1), none, none]));
            }
            starts.push(indices.len() as u32);
        }
        Ok(SparseColMat::new(SymbolicSparseColMat::new_checked(n, n, starts, None, indices), values))
    }
}
