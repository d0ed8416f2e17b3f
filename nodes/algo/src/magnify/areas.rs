//! Signed areas of moved cells.

use crate::lattice::{Lattice, Positions};

/// Areas of moved cells against those asked for.
pub(super) struct Score {
    /// Largest |area / asked - 1|.
    pub(super) largest_error: f64,
    /// Root of the mean of its square.
    pub(super) rms_error: f64,
    /// Sum of the areas over that of the rectangle.
    pub(super) total_area: f64,
}

/// Signed area of every moved cell over its area at rest, row-major.
///
/// Half the cross product of the diagonals; negative where a cell is turned over.
///
/// * `lattice`: at rest.
/// * `positions`: where its nodes go, px; one per node (asserted).
///
/// Positions that are not finite give areas that are not. Cost: linear in the cells.
pub fn relative_areas(lattice: &Lattice, positions: &Positions) -> Vec<f64> {
    assert_eq!(positions.x.len(), lattice.node_count(), "positions do not fit {lattice:?}");
    let [columns, rows] = lattice.cells();
    let mut areas = vec![0.0; columns * rows];
    for (row, areas) in areas.chunks_mut(columns).enumerate() {
        row_areas(lattice, positions, row, areas);
    }
    areas
}

/// The relative areas of one row of cells.
#[inline(always)]
pub(super) fn row_areas(lattice: &Lattice, positions: &Positions, row: usize, areas: &mut [f64]) {
    let [nodes, _] = lattice.nodes;
    let scale = 0.5 / (lattice.spacing[0] * lattice.spacing[1]);
    let line = |row: usize| (&positions.x[row * nodes..][..nodes], &positions.y[row * nodes..][..nodes]);
    let ((x, y), (below_x, below_y)) = (line(row), line(row + 1));
    let (areas, last) = (&mut areas[..nodes - 1], nodes - 1);
    let left = x[..last].iter().zip(&y[..last]).zip(below_x[..last].iter().zip(&below_y[..last]));
    let right = x[1..].iter().zip(&y[1..]).zip(below_x[1..].iter().zip(&below_y[1..]));
    for ((area, ((x00, y00), (x01, y01))), ((x10, y10), (x11, y11))) in areas.iter_mut().zip(left).zip(right) {
        *area = ((x11 - x00) * (y01 - y10) - (y11 - y00) * (x01 - x10)) * scale;
    }
}

/// How far areas are from what was asked, cell by cell.
pub(super) fn score(lattice: &Lattice, positions: &Positions, asked: &[f64]) -> Score {
    let [columns, rows] = lattice.cells();
    let mut areas = vec![0.0; columns];
    let (mut largest, mut squares, mut total) = (0.0, Sum::default(), Sum::default());
    for (row, asked) in asked.chunks(columns).enumerate() {
        row_areas(lattice, positions, row, &mut areas);
        for (area, asked) in areas.iter().zip(asked) {
            let error = (area / asked - 1.0).abs();
            largest = if error > largest || error.is_nan() { error } else { largest };
            squares.add(error * error);
            total.add(*area);
        }
    }
    let count = (columns * rows) as f64;
    Score { largest_error: largest, rms_error: (squares.value() / count).sqrt(), total_area: total.value() / count }
}

/// A sum that carries its rounding errors along.
///
/// A. Neumaier, "Rundungsfehleranalyse einiger Verfahren zur Summation endlicher Summen", ZAMM 54, 1974.
#[derive(Default)]
pub(super) struct Sum {
    sum: f64,
    lost: f64,
}

impl Sum {
    pub(super) fn add(&mut self, value: f64) {
        let sum = self.sum + value;
        let (large, small) = if self.sum.abs() >= value.abs() { (self.sum, value) } else { (value, self.sum) };
        self.lost += (large - sum) + small;
        self.sum = sum;
    }

    pub(super) fn value(&self) -> f64 {
        self.sum + self.lost
    }
}
