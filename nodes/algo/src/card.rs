//! Test cards, one plane per call.
//!
//! Patterns are anchored in absolute pixel coordinates, so tiles of a card fit together bit for bit.

use crate::view::ViewMut;

/// The plane of one value everywhere.
///
/// `out`: any size; `value`: any sample.
///
/// Cost: O(area).
pub fn constant(out: ViewMut<f32>, value: f32) {
    out.par_rows(|_, row| row.fill(value));
}

/// A checkerboard of square cells.
///
/// The pixel with centre (x, y) lies in cell (floor(x / cell), floor(y / cell)); cell (c, r) is `even` where c + r is
/// even, else `odd`.
///
/// `out`: any size, its top left pixel is pixel (`x0`, `y0`); `cell`: side of a cell, px, finite and positive;
/// `even`, `odd`: any samples.
///
/// A pixel belongs to the cell that holds its centre, there is no antialiasing; a centre on a line between cells
/// belongs to the cell right of or below it.
///
/// Cost: O(area).
pub fn checker(out: ViewMut<f32>, x0: i64, y0: i64, cell: f64, even: f32, odd: f32) {
    assert!(cell > 0.0 && cell.is_finite(), "a cell of {cell} px");
    let is_odd = |origin, offset| (center(origin, offset) / cell).floor().rem_euclid(2.0) == 1.0;
    let odd_columns: Vec<bool> = (0..out.width()).map(|x| is_odd(x0, x)).collect();
    out.par_rows(|y, row| {
        let odd_row = is_odd(y0, y);
        for (sample, &odd_column) in row.iter_mut().zip(&odd_columns) {
            *sample = if odd_row != odd_column { odd } else { even };
        }
    });
}

/// A linear ramp between two points of the plane.
///
/// The value at p is first + t (last - first) with t = (p - from) . (to - from) / |to - from|^2 held to 0..=1, at
/// pixel centres, in f64.
///
/// `out`: any size, its top left pixel is pixel (`x0`, `y0`); `from`, `to`: points, px; `first`, `last`: values at and
/// before `from`, at and after `to`.
///
/// Where `from` and `to` coincide (or a coordinate is no number) the plane is `last` everywhere.
///
/// Cost: O(area).
pub fn ramp(out: ViewMut<f32>, x0: i64, y0: i64, from: [f64; 2], to: [f64; 2], first: f64, last: f64) {
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let squared_length = dx * dx + dy * dy;
    if !(squared_length > 0.0 && squared_length.is_finite()) {
        return constant(out, last as f32);
    }
    out.par_rows(|y, row| {
        let along_y = (center(y0, y) - from[1]) * dy;
        for (x, sample) in row.iter_mut().enumerate() {
            let t = ((center(x0, x) - from[0]) * dx + along_y) / squared_length;
            *sample = mix(first, last, t) as f32;
        }
    });
}

/// `first` up to t = 0, `last` from t = 1, both met exactly.
fn mix(first: f64, last: f64, t: f64) -> f64 {
    if t <= 0.0 {
        first
    } else if t >= 1.0 {
        last
    } else {
        first + t * (last - first)
    }
}

/// Centre of pixel `origin + offset`, px.
fn center(origin: i64, offset: usize) -> f64 {
    (origin + offset as i64) as f64 + 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(width: usize, height: usize, paint: impl FnOnce(ViewMut<f32>)) -> Vec<f32> {
        let mut samples = vec![f32::NAN; width * height];
        paint(ViewMut::packed(&mut samples, width, height));
        samples
    }

    #[test]
    fn constant_fills_every_sample() {
        assert_eq!(plane(3, 2, |out| constant(out, 0.25)), [0.25; 6]);
    }

    #[test]
    fn checker_of_two_pixel_cells_is_anchored_at_the_origin_of_the_plane() {
        let samples = plane(5, 5, |out| checker(out, -3, -1, 2.0, 0.0, 1.0));
        #[rustfmt::skip]
        assert_eq!(samples, [
            1.0, 0.0, 0.0, 1.0, 1.0,
            0.0, 1.0, 1.0, 0.0, 0.0,
            0.0, 1.0, 1.0, 0.0, 0.0,
            1.0, 0.0, 0.0, 1.0, 1.0,
            1.0, 0.0, 0.0, 1.0, 1.0,
        ]);
    }

    #[test]
    fn checker_cell_holds_the_pixels_whose_centres_it_holds() {
        // Cells of 1.5 px end at 1.5, 3.0 and 4.5: the centre at 1.5 falls into the cell that starts there.
        assert_eq!(plane(5, 1, |out| checker(out, 0, 0, 1.5, 0.0, 1.0)), [0.0, 1.0, 1.0, 0.0, 1.0]);
    }

    #[test]
    fn ramp_runs_through_pixel_centres_and_is_held_outside() {
        let samples = plane(6, 1, |out| ramp(out, -1, 0, [0.5, 9.0], [2.5, 9.0], 1.0, 3.0));
        assert_eq!(samples, [1.0, 1.0, 2.0, 3.0, 3.0, 3.0]);
    }

    #[test]
    fn ramp_is_constant_across_its_direction() {
        let samples = plane(5, 5, |out| ramp(out, 0, 0, [0.0, 0.0], [5.0, 5.0], 0.0, 1.0));
        for (i, sample) in samples.iter().enumerate() {
            let expected = ((i % 5 + i / 5 + 1) as f64 / 10.0) as f32;
            assert!((sample - expected).abs() < 1e-7, "{i}: {sample} is not {expected}");
        }
    }

    #[test]
    fn ramp_between_coincident_points_is_last_everywhere() {
        assert_eq!(plane(2, 2, |out| ramp(out, 0, 0, [1.0, 1.0], [1.0, 1.0], 0.0, 0.75)), [0.75; 4]);
    }

    #[test]
    fn tiles_of_a_card_equal_the_card() {
        type Card = fn(ViewMut<f32>, i64, i64);
        let cards: [Card; 2] = [
            |out, x0, y0| checker(out, x0, y0, 2.7, 0.1, 0.9),
            |out, x0, y0| ramp(out, x0, y0, [3.3, -1.0], [-2.2, 4.1], -0.3, 0.7),
        ];
        for card in cards {
            let whole = plane(9, 7, |out| card(out, -4, -2));
            let tile = plane(5, 4, |out| card(out, -1, 0));
            for (y, row) in tile.chunks(5).enumerate() {
                assert_eq!(row, &whole[(y + 2) * 9 + 3..][..5]);
            }
        }
    }
}
