//! The areas that cells are to have.

use super::areas::Sum;

/// The least 1 + strength of a cell; what lies below is raised to it.
pub const FLOOR: f64 = 0.05;

/// How the areas asked for are made to fill the rectangle, as those of cells in a fixed frame always do: their mean must
/// be 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Normalise {
    /// M over its mean: cells keep their ratios.
    Multiply,
    /// The strongest cells get just what was asked, and what is not magnified pays: with a the strength and w = |a| over
    /// its largest, M = c (1 - w) + w + a, where c makes the mean 1. Where c is not positive, `Multiply` is taken.
    Background,
    /// M less what its mean is above 1, as the relaxation's authors do; raised to [`FLOOR`] and divided by its mean.
    Subtract,
    /// M as it is, whatever its mean. No map has such areas; the transport then does what it does for `Multiply`.
    None,
}

/// The areas asked for, and how they came about.
pub(super) struct Target {
    /// By cell, over its area at rest; positive.
    pub(super) areas: Vec<f64>,
    pub(super) mean: f64,
    pub(super) raised: usize,
    pub(super) normalised: Normalise,
}

/// Areas of cells by their strengths.
pub(super) fn target(strength: &[f64], normalise: Normalise) -> Target {
    let plain = |strength: f64| 1.0 + if strength.is_finite() { strength } else { 0.0 };
    let raised = strength.iter().filter(|&&strength| plain(strength) < FLOOR).count();
    let mut areas: Vec<f64> = strength.iter().map(|&strength| plain(strength).max(FLOOR)).collect();
    let mean = mean_of(&areas);
    let mut normalised = normalise;
    match normalise {
        Normalise::Multiply => divide(&mut areas, mean),
        Normalise::None => {}
        Normalise::Subtract => {
            areas.iter_mut().for_each(|area| *area = (*area - (mean - 1.0)).max(FLOOR));
            let left = mean_of(&areas);
            divide(&mut areas, left);
        }
        Normalise::Background => {
            if !pay(&mut areas, mean) {
                normalised = Normalise::Multiply;
                divide(&mut areas, mean);
            }
        }
    }
    Target { areas, mean, raised, normalised }
}

/// Lets what is not magnified pay for the rest; false if it cannot.
fn pay(areas: &mut [f64], mean: f64) -> bool {
    let largest = areas.iter().map(|area| (area - 1.0).abs()).fold(0.0, f64::max);
    if largest == 0.0 {
        return true;
    }
    let weight = |area: f64| (area - 1.0).abs() / largest;
    let mut weights = Sum::default();
    areas.iter().for_each(|&area| weights.add(weight(area)));
    let weights = weights.value() / areas.len() as f64;
    let background = (1.0 - weights - (mean - 1.0)) / (1.0 - weights);
    // Where no cell is background the quotient is no number.
    if background.is_nan() || background <= 0.0 {
        return false;
    }
    areas.iter_mut().for_each(|area| *area += (background - 1.0) * (1.0 - weight(*area)));
    true
}

fn divide(areas: &mut [f64], by: f64) {
    if by != 1.0 {
        areas.iter_mut().for_each(|area| *area /= by);
    }
}

pub(super) fn mean_of(values: &[f64]) -> f64 {
    let mut sum = Sum::default();
    values.iter().for_each(|&value| sum.add(value));
    sum.value() / values.len() as f64
}
