//! Set operations on masks.

use crate::view::{View, ViewMut};

/// How masks are combined into one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Combination {
    /// What any mask covers: their maximum.
    Union,
    /// What all masks cover: their minimum.
    Intersection,
    /// What the first covers and no other does: min(first, 1 - max(others)).
    Difference,
}

/// Fuzzy set operation on masks, pixel by pixel.
///
/// The formulas stand at [`Combination`]; samples are first held to 0..=1.
///
/// `masks`: planes of the size of `out`, any count; `out`: the result, 0..=1.
///
/// NaN counts as 0. Of no masks at all the result is 0; of one mask it is that mask.
///
/// Cost: O(area x masks).
pub fn combine(combination: Combination, masks: &[View<f32>], out: ViewMut<f32>) {
    for mask in masks {
        assert_eq!([mask.width(), mask.height()], [out.width(), out.height()], "sizes differ");
    }
    let operation: fn(f32, f32) -> f32 = match combination {
        Combination::Union => f32::max,
        Combination::Intersection => f32::min,
        Combination::Difference => |first, other| first.min(1.0 - other),
    };
    out.par_rows(|y, row| {
        let Some((first, others)) = masks.split_first() else { return row.fill(0.0) };
        for (sample, &mask) in row.iter_mut().zip(first.row(y)) {
            *sample = super::coverage(mask);
        }
        for other in others {
            for (sample, &mask) in row.iter_mut().zip(other.row(y)) {
                *sample = operation(*sample, super::coverage(mask));
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn combined(combination: Combination, masks: &[&[f32]]) -> Vec<f32> {
        let views: Vec<_> = masks.iter().map(|mask| View::packed(mask, 5, 1)).collect();
        let mut out = vec![f32::NAN; 5];
        combine(combination, &views, ViewMut::packed(&mut out, 5, 1));
        out
    }

    const A: [f32; 5] = [0.0, 0.25, 0.5, 1.0, 0.75];
    const B: [f32; 5] = [0.5, 0.0, 0.75, 1.0, 0.0];
    const C: [f32; 5] = [0.25, 0.0, 0.25, 0.0, 0.5];

    #[test]
    fn formulas_hold() {
        assert_eq!(combined(Combination::Union, &[&A, &B, &C]), [0.5, 0.25, 0.75, 1.0, 0.75]);
        assert_eq!(combined(Combination::Intersection, &[&A, &B, &C]), [0.0, 0.0, 0.25, 0.0, 0.0]);
        assert_eq!(combined(Combination::Difference, &[&A, &B, &C]), [0.0, 0.25, 0.25, 0.0, 0.5]);
    }

    #[test]
    fn difference_is_intersection_with_the_complement_of_the_union() {
        let others = combined(Combination::Union, &[&B, &C]);
        let complement: Vec<f32> = others.iter().map(|sample| 1.0 - sample).collect();
        let expected = combined(Combination::Intersection, &[&A, &complement]);
        assert_eq!(combined(Combination::Difference, &[&A, &B, &C]), expected);
    }

    #[test]
    fn samples_are_held_to_coverage() {
        let wild = [f32::NAN, -1.0, 2.0, f32::INFINITY, f32::NEG_INFINITY];
        for combination in [Combination::Union, Combination::Intersection, Combination::Difference] {
            assert_eq!(combined(combination, &[&wild]), [0.0, 0.0, 1.0, 1.0, 0.0]);
        }
        assert_eq!(combined(Combination::Difference, &[&[1.0; 5], &wild]), [1.0, 1.0, 0.0, 0.0, 1.0]);
        assert_eq!(combined(Combination::Intersection, &[&[1.0; 5], &wild]), [0.0, 0.0, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn no_masks_cover_nothing() {
        assert_eq!(combined(Combination::Intersection, &[]), [0.0; 5]);
    }
}
