//! Weights of quads: high on features, falling to 1 over a few rings of quads around them.

use crate::{Interrupted, Watch};
use rayon::prelude::*;

/// No component: the quad is background.
pub(super) const NONE: u32 = u32::MAX;

/// What a quad is asked to do, and how strongly.
#[derive(Debug)]
pub(super) struct Quads {
    /// Component the quad follows: its own on features, the nearest one within the radius, else `NONE`.
    pub(super) component: Vec<u32>,
    /// How far it does: f(D), 1 on features, falling to 0.
    pub(super) share: Vec<f64>,
    /// Squared weight, the quad's part of its edges' conductances.
    pub(super) stiffness: Vec<f64>,
}

/// The weights of all quads, and the component that each follows.
///
/// D is the distance from a quad's centre to the union of the feature quads, as filled unit squares, in cells: 0 on
/// features, 0.5 and 1.5 on the rings around a straight side, sqrt(0.5) off a corner. The weight is
/// `1 + (w - 1) f(D)`, `f(D) = 2 (D / rho)^3 - 3 (D / rho)^2 + 1` for D < rho and 0 from there on, w the weight of
/// the nearest component. Of components at the same distance a quad follows the lowest.
///
/// * `feature`: component of every cell, row-major, `NONE` off the features.
/// * `columns`: cells in a row.
/// * `weights`: w of every component; `radius`: rho, cells, at least 0: at 0 only the features themselves count.
/// * `soft`: if given, 0..=1 for every cell; on features the excess w - 1 is multiplied by it.
///
/// Exact: the squared distance is the sum of a horizontal and a vertical part, so the nearest feature in every row
/// comes first and the best of the rows second. O(cells * radius) at worst, O(cells) far from and on features.
///
/// Gal, Sorkine and Cohen-Or 2006, Section 2.1, Equations 6 and 7.
pub(super) fn weigh(
    feature: &[u32],
    columns: usize,
    weights: &[f64],
    radius: f64,
    soft: Option<&[f64]>,
    watch: Watch,
) -> Result<Quads, Interrupted> {
    let reach = ((radius + 0.5).ceil() - 1.0).max(0.0) as usize;
    let reach = reach.min(columns.max(feature.len() / columns));
    let mut in_row = vec![(0, NONE); feature.len()];
    in_row.par_chunks_mut(columns).zip(feature.par_chunks(columns)).try_for_each(|(near, row)| {
        nearest(near, row, reach);
        watch.go_on()
    })?;
    let weighed = |quad: usize| {
        let (distance, component) = nearest_across(&in_row, columns, quad, reach);
        if component == NONE || (distance != 0.0 && distance >= radius) {
            return (NONE, 0.0, 1.0);
        }
        let share = decay(distance, radius);
        let part = soft.filter(|_| distance == 0.0).map_or(share, |soft| soft[quad]);
        let w = 1.0 + (weights[component as usize] - 1.0) * part;
        (component, share, w * w)
    };
    let count = feature.len();
    let mut quads = Quads { component: vec![NONE; count], share: vec![0.0; count], stiffness: vec![1.0; count] };
    let shares = quads.share.par_chunks_mut(columns).zip(quads.stiffness.par_chunks_mut(columns));
    quads.component.par_chunks_mut(columns).zip(shares).enumerate().try_for_each(
        |(row, (component, (share, stiffness)))| {
            for column in 0..component.len() {
                (component[column], share[column], stiffness[column]) = weighed(row * columns + column);
            }
            watch.go_on()
        },
    )?;
    Ok(quads)
}

/// The nearest feature cell in the same row within `reach` cells: its offset and component.
fn nearest(near: &mut [(u32, u32)], row: &[u32], reach: usize) {
    let mut sweep = |cells: &mut dyn Iterator<Item = usize>| {
        let (mut offset, mut component) = (0, NONE);
        for cell in cells {
            (offset, component) = if row[cell] == NONE { (offset + 1, component) } else { (0, row[cell]) };
            if component != NONE && offset <= reach {
                let found = (offset as u32, component);
                near[cell] = if near[cell].1 == NONE { found } else { near[cell].min(found) };
            }
        }
    };
    sweep(&mut (0..row.len()));
    sweep(&mut (0..row.len()).rev());
}

/// Distance from a quad's centre to the nearest feature within `reach` rows, and its component.
fn nearest_across(in_row: &[(u32, u32)], columns: usize, quad: usize, reach: usize) -> (f64, u32) {
    let mut best = (u64::MAX, NONE);
    for offset in 0..=reach {
        let down = squared(offset as u32);
        if down > best.0 {
            break;
        }
        let step = offset * columns;
        for row in [quad.checked_sub(step), Some(quad + step)].into_iter().flatten() {
            if let Some(&(across, component)) = in_row.get(row)
                && component != NONE
            {
                best = best.min((squared(across) + down, component));
            }
        }
    }
    ((best.0 as f64).sqrt() / 2.0, best.1)
}

/// Square of twice the distance, along one axis, from a cell's centre to the cell `offset` cells further.
fn squared(offset: u32) -> u64 {
    let doubled = (2 * u64::from(offset)).saturating_sub(1);
    doubled * doubled
}

fn decay(distance: f64, radius: f64) -> f64 {
    if distance == 0.0 {
        return 1.0;
    }
    let t = distance / radius;
    (2.0 * t - 3.0) * t * t + 1.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UNWATCHED;

    fn weigh(feature: &[u32], columns: usize, weight: f64, radius: f64) -> Quads {
        super::weigh(feature, columns, &[weight; 8], radius, None, UNWATCHED).expect("nobody stops it")
    }

    /// Distance and component of every quad by trying all features; ties to the lowest.
    fn slow(feature: &[u32], columns: usize, quad: usize) -> (f64, u32) {
        let gap = |a: usize, b: usize| if a == b { 0.0 } else { a.abs_diff(b) as f64 - 0.5 };
        (0..feature.len()).filter(|&other| feature[other] != NONE).fold((f64::INFINITY, NONE), |best, other| {
            let (x, y) = (gap(quad % columns, other % columns), gap(quad / columns, other / columns));
            let found = ((x * x + y * y).sqrt(), feature[other]);
            if found.0 < best.0 || (found.0 == best.0 && found.1 < best.1) { found } else { best }
        })
    }

    #[test]
    fn rings_around_one_quad() {
        let mut feature = vec![NONE; 25];
        feature[12] = 3;
        let quads = weigh(&feature, 5, 10.0, 2.0);
        let f = |d: f64| 1.0 + 9.0 * (2.0 * (d / 2.0).powi(3) - 3.0 * (d / 2.0).powi(2) + 1.0);
        let (side, corner, far, knight) = (f(0.5), f(0.5f64.sqrt()), f(1.5), f(2.5f64.sqrt()));
        #[rustfmt::skip]
        let expected = [
            1.0,    knight, far,  knight, 1.0,
            knight, corner, side, corner, knight,
            far,    side,   10.0, side,   far,
            knight, corner, side, corner, knight,
            1.0,    knight, far,  knight, 1.0,
        ];
        for (quad, w) in expected.iter().enumerate() {
            assert!((quads.stiffness[quad] - w * w).abs() < 1e-10, "quad {quad}: {}", quads.stiffness[quad]);
            assert_eq!(quads.component[quad], if *w == 1.0 { NONE } else { 3 }, "quad {quad}");
        }
    }

    #[test]
    fn sharp_weights_stay_on_the_features() {
        let feature = [NONE, 0, NONE, 1, NONE, NONE];
        for radius in [0.0, 0.3, 0.5] {
            let quads = weigh(&feature, 3, 4.0, radius);
            assert_eq!(quads.component, feature);
            assert_eq!(quads.stiffness, [1.0, 16.0, 1.0, 16.0, 1.0, 1.0]);
        }
    }

    #[test]
    fn distances_are_exact_for_any_radius() {
        let (columns, rows) = (37, 29);
        for seed in 1..6u32 {
            let mut state = seed;
            let feature: Vec<u32> = (0..columns * rows)
                .map(|_| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    if (state >> 8).is_multiple_of(97) { (state >> 20) % 4 } else { NONE }
                })
                .collect();
            for radius in [0.0, 0.6, 1.0, 2.0, 3.7, 9.0, 64.0, 1e6] {
                let quads = weigh(&feature, columns, 10.0, radius);
                for quad in 0..feature.len() {
                    let (distance, component) = slow(&feature, columns, quad);
                    let near = distance == 0.0 || distance < radius;
                    let w = if near { 1.0 + 9.0 * decay(distance, radius) } else { 1.0 };
                    let expected = (if near { component } else { NONE }, w * w);
                    assert_eq!((quads.component[quad], quads.stiffness[quad]), expected, "{radius}: {quad}");
                }
            }
        }
    }

    #[test]
    fn components_have_weights_of_their_own_and_coverage_softens_features_only() {
        let feature = [0, NONE, NONE, NONE, NONE, 1];
        let soft = [0.5, 0.0, 0.0, 0.0, 0.0, 0.0];
        let quads = super::weigh(&feature, 6, &[3.0, 5.0], 2.0, Some(&soft), UNWATCHED).expect("weighed");
        let (near, far) = (decay(0.5, 2.0), decay(1.5, 2.0));
        assert_eq!(quads.component, [0, 0, 0, 1, 1, 1]);
        assert_eq!(quads.share, [1.0, near, far, far, near, 1.0]);
        let weights = [2.0, 1.0 + 2.0 * near, 1.0 + 2.0 * far, 1.0 + 4.0 * far, 1.0 + 4.0 * near, 1.0];
        assert_eq!(quads.stiffness, weights.map(|w| w * w));
    }

    #[test]
    fn no_features_no_weights() {
        let quads = weigh(&[NONE; 12], 4, 10.0, 5.0);
        assert_eq!((quads.component, quads.stiffness), (vec![NONE; 12], vec![1.0; 12]));
    }
}
