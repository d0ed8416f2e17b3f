//! From labelled pixels to labelled cells of a lattice.

use crate::lattice::Lattice;
use crate::view::View;
use crate::{Interrupted, Watch};
use rayon::prelude::*;

/// The label of every cell of a lattice; 0 is the background.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FeatureCells {
    /// Labels, row-major, `nodes[0] - 1` columns wide.
    pub labels: Vec<u32>,
    /// Count of cells that hold pixels of several labels.
    pub mixed: usize,
    /// Count of labelled pixels outside the lattice.
    pub outside: usize,
}

/// Labels the cells of a lattice by the labelled pixels in them.
///
/// A cell has label L if it holds the centre of a pixel labelled L; of several labels it has the lowest. Cells are
/// half-open: a centre on a grid line belongs to the cell right of or below it.
///
/// * `lattice`: in the coordinates of the pixels, any positive spacing.
/// * `labels`: one label a pixel, 0 for background.
/// * `x0`, `y0`: position of the view's top left pixel, px; pixel (i, j) has its centre at (x0 + i + 0.5,
///   y0 + j + 0.5).
///
/// Pixels on or beyond the lattice's right and lower border are outside, like those left of and above it: they are
/// counted if labelled, and ignored. Cells without a pixel are background. O(pixels + cells), rows of cells side by
/// side. Stops when `watch` says so.
///
/// Gal, Sorkine and Cohen-Or 2006, Section 2 ("at least one node in F"), for masks that are not sampled at nodes.
pub fn feature_cells(
    lattice: &Lattice,
    labels: View<u32>,
    x0: i64,
    y0: i64,
    watch: Watch,
) -> Result<FeatureCells, Interrupted> {
    let [columns, rows] = lattice.nodes;
    let left = first_pixels((0..columns).map(|column| lattice.rest(column, 0)[0]), x0, labels.width());
    let top = first_pixels((0..rows).map(|row| lattice.rest(0, row)[1]), y0, labels.height());
    let mut cells = vec![0; (columns - 1) * (rows - 1)];
    let mixed = cells
        .par_chunks_mut(columns - 1)
        .enumerate()
        .map(|(row, cells)| {
            watch.go_on()?;
            Ok(label_row(cells, (top[row]..top[row + 1]).map(|y| labels.row(y)), &left))
        })
        .sum::<Result<_, _>>()?;
    let count = |pixels: &[u32]| pixels.iter().filter(|&&label| label != 0).count();
    let outside = (0..labels.height())
        .into_par_iter()
        .map(|y| {
            watch.go_on()?;
            let row = labels.row(y);
            let beside = (top[0]..top[rows - 1]).contains(&y);
            Ok(if beside { count(&row[..left[0]]) + count(&row[left[columns - 1]..]) } else { count(row) })
        })
        .sum::<Result<_, _>>()?;
    Ok(FeatureCells { labels: cells, mixed, outside })
}

/// How much of every cell of a lattice a mask covers.
///
/// The mean of the mask over the pixels whose centres the cell holds, as in [`feature_cells`]; row-major, 0..=1.
///
/// * `lattice`: in the coordinates of the pixels, any positive spacing.
/// * `mask`: coverage; below 0 and NaN count as 0, above 1 as 1.
/// * `x0`, `y0`: position of the view's top left pixel, px.
///
/// Pixels outside the view are not covered. Cells without a pixel's centre have 0. O(pixels + cells), rows of cells
/// side by side. Stops when `watch` says so.
pub fn cell_coverage(
    lattice: &Lattice,
    mask: View<f32>,
    x0: i64,
    y0: i64,
    watch: Watch,
) -> Result<Vec<f64>, Interrupted> {
    let [columns, rows] = lattice.nodes;
    let left: Vec<i64> = (0..columns).map(|column| first_centre(lattice.rest(column, 0)[0])).collect();
    let top: Vec<i64> = (0..rows).map(|row| first_centre(lattice.rest(0, row)[1])).collect();
    let within = |from: i64, to: i64, first: i64, count: usize| {
        let [from, to] = [from, to].map(|pixel| pixel.saturating_sub(first).clamp(0, count as i64) as usize);
        from..to
    };
    let mut cells = vec![0.0; (columns - 1) * (rows - 1)];
    cells.par_chunks_mut(columns - 1).enumerate().try_for_each(|(row, cells)| {
        let height = top[row + 1] - top[row];
        for y in within(top[row], top[row + 1], y0, mask.height()) {
            for (column, cell) in cells.iter_mut().enumerate() {
                let pixels = &mask.row(y)[within(left[column], left[column + 1], x0, mask.width())];
                *cell += pixels
                    .iter()
                    .filter(|&&covered| covered > 0.0)
                    .map(|&covered| f64::from(covered.min(1.0)))
                    .sum::<f64>();
            }
        }
        for (column, cell) in cells.iter_mut().enumerate() {
            let count = height * (left[column + 1] - left[column]);
            *cell /= count.max(1) as f64;
        }
        watch.go_on()
    })?;
    Ok(cells)
}

/// The first pixel whose centre is not before a grid line.
fn first_centre(line: f64) -> i64 {
    let near = (line - 0.5).ceil();
    (if near + 0.5 < line { near + 1.0 } else { near }) as i64
}

/// For every grid line the first of `count` pixels from `first` on whose centre is not before it; `count` if none.
fn first_pixels(lines: impl Iterator<Item = f64>, first: i64, count: usize) -> Vec<usize> {
    let mut pixel = 0;
    lines
        .map(|line| {
            while pixel < count && (first as f64 + pixel as f64) + 0.5 < line {
                pixel += 1;
            }
            pixel
        })
        .collect()
}

/// Labels one row of cells from its rows of pixels; `left`: first pixel of every cell. Gives the mixed cells' count.
fn label_row<'a>(cells: &mut [u32], pixel_rows: impl Iterator<Item = &'a [u32]>, left: &[usize]) -> usize {
    let mut mixed = vec![false; cells.len()];
    for pixels in pixel_rows {
        for (column, cell) in cells.iter_mut().enumerate() {
            for &label in pixels[left[column]..left[column + 1]].iter().filter(|&&label| label != 0) {
                mixed[column] |= *cell != 0 && *cell != label;
                *cell = if *cell == 0 { label } else { label.min(*cell) };
            }
        }
    }
    mixed.into_iter().filter(|&mixed| mixed).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UNWATCHED;

    fn feature_cells(lattice: &Lattice, labels: View<u32>, x0: i64, y0: i64) -> FeatureCells {
        super::feature_cells(lattice, labels, x0, y0, UNWATCHED).expect("nobody stops it")
    }

    const LATTICE: Lattice = Lattice { origin: [0.0, 0.0], spacing: [2.0, 2.0], nodes: [3, 3] };

    #[test]
    fn lowest_label_of_a_cell_wins_and_mixed_cells_are_counted() {
        #[rustfmt::skip]
        let labels = [
            0, 0, 7, 0, 1,
            0, 0, 0, 3, 0,
            5, 5, 0, 0, 2,
            0, 5, 0, 9, 0,
            0, 4, 0, 0, 0,
        ];
        let cells = feature_cells(&LATTICE, View::packed(&labels, 5, 5), 0, 0);
        assert_eq!(cells, FeatureCells { labels: vec![0, 3, 5, 9], mixed: 1, outside: 3 });
    }

    #[test]
    fn pixels_beside_the_lattice_are_counted_only() {
        let labels = [1, 2, 3, 4];
        for (x0, y0, expected, outside) in [
            (-1, -1, [4, 0, 0, 0], 3),
            (3, 3, [0, 0, 0, 1], 3),
            (-2, 0, [0, 0, 0, 0], 4),
            (i64::from(i32::MIN), 0, [0, 0, 0, 0], 4),
            (4, 0, [0, 0, 0, 0], 4),
            (0, 1000, [0, 0, 0, 0], 4),
        ] {
            let cells = feature_cells(&LATTICE, View::packed(&labels, 2, 2), x0, y0);
            assert_eq!((&cells.labels[..], cells.outside), (&expected[..], outside), "at ({x0}, {y0})");
        }
        let empty = feature_cells(&LATTICE, View::packed(&[], 0, 0), 0, 0);
        assert_eq!(empty, FeatureCells { labels: vec![0; 4], mixed: 0, outside: 0 });
    }

    #[test]
    fn coverage_is_the_mean_over_a_cells_pixels() {
        #[rustfmt::skip]
        let mask = [
            1.0, 0.5, 0.25, 0.0,
            0.5, 0.0, f32::NAN, 7.0,
            -3.0, 1.0, 0.0, f32::INFINITY,
        ];
        let mean = |x0, y0, lattice: Lattice| {
            cell_coverage(&lattice, View::packed(&mask, 4, 3), x0, y0, UNWATCHED).expect("nobody stops it")
        };
        assert_eq!(mean(0, 0, LATTICE), [0.5, 0.3125, 0.25, 0.25]);
        // Of cells that the mask covers in part the rest is not covered.
        assert_eq!(mean(1, 1, LATTICE), [0.25, 0.1875, 0.125, 0.25]);
        assert_eq!(mean(100, -50, LATTICE), [0.0; 4]);
        let fine = Lattice { origin: [0.0, 0.0], spacing: [0.5, 1.0], nodes: [3, 2] };
        assert_eq!(mean(0, 0, fine), [0.0, 1.0], "a cell without a centre, and the cell of one");
    }

    #[test]
    fn a_centre_on_a_grid_line_is_right_of_it() {
        let lattice = Lattice { origin: [0.5, 0.0], spacing: [1.0, 1.0], nodes: [4, 2] };
        let cells = feature_cells(&lattice, View::packed(&[1, 2, 3, 4], 4, 1), 0, 0);
        assert_eq!(cells, FeatureCells { labels: vec![1, 2, 3], mixed: 0, outside: 1 });
    }

    /// Every pixel is looked up in the half-open cells themselves.
    #[test]
    fn cells_hold_the_pixels_between_their_rest_positions() {
        for (origin, spacing) in [([-3.3, 2.1], [0.7, 3.7]), ([0.1, 0.1], [0.1, 1.0 / 3.0]), ([-0.5, 0.5], [1.5, 2.5])]
        {
            let lattice = Lattice { origin, spacing, nodes: [29, 11] };
            let labels: Vec<u32> = (1..=40 * 30).collect();
            let cells = feature_cells(&lattice, View::packed(&labels, 40, 30), -5, -2);
            let mut expected = vec![0; 28 * 10];
            let mut outside = 0;
            for (pixel, &label) in labels.iter().enumerate() {
                let [x, y] = [(pixel % 40) as f64 - 4.5, (pixel / 40) as f64 - 1.5];
                let holds = |c: usize, r: usize| {
                    let ([left, top], [right, bottom]) = (lattice.rest(c, r), lattice.rest(c + 1, r + 1));
                    left <= x && x < right && top <= y && y < bottom
                };
                let found = (0..280).find(|cell| holds(cell % 28, cell / 28));
                outside += usize::from(found.is_none());
                found.into_iter().for_each(|cell| {
                    expected[cell] = if expected[cell] == 0 { label } else { label.min(expected[cell]) };
                });
            }
            assert_eq!((cells.labels, cells.outside), (expected, outside), "{lattice:?}");
        }
    }
}
