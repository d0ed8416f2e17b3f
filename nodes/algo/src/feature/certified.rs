//! The warp that does not fold.

use super::Error;
use super::guard::{Fit, Guarded, How, guard};
use super::rhs::{Functional, OnConflict, Rhs, Targets, rhs};
use super::solve::{FeatureWarp, solve};
use crate::Watch;

/// The feature-aware warp of a warp, repaired where it folds.
///
/// [`solve`], then [`guard`] on the solution.
///
/// * `asked`: made by [`rhs`]; its factor, warp and targets are used.
/// * `fit`: what gives way where features do not fit.
/// * `tolerance`: as for [`solve`].
/// * `watch`: asked now and then.
///
/// Exact features that fold give up their shape with `NoFold`, as little as the functional allows. With `KeepShape`
/// they never bend: they shrink, if that is wanted and helps, or the folds stay and are reported. `residual` is that
/// of the literal solution. The cost is that of [`guard`].
pub fn solve_certified(asked: &Rhs, fit: Fit, tolerance: f64, watch: Watch) -> Result<(FeatureWarp, Guarded), Error> {
    let Rhs { factor, warp, targets, .. } = *asked;
    let literal = solve(asked, tolerance, watch)?;
    let freedom = asked.freedom_to_bend();
    let functional = Functional { freedom: &freedom, ..asked.functional() };
    let shrunk = |size: f64| {
        let smaller = Targets { size: targets.size * size, ..targets };
        Ok(solve(&rhs(factor, warp, &smaller, watch)?, tolerance, watch)?.positions)
    };
    let may_bend = targets.on_conflict == OnConflict::NoFold || !factor.has_exact_features();
    let guarded = guard(&functional, &literal.positions, fit, may_bend, &shrunk, watch)?;
    if guarded.how == How::Literal {
        return Ok((literal, guarded));
    }
    let features = factor.fits(&guarded.positions, watch)?;
    Ok((FeatureWarp { positions: guarded.positions.clone(), features, ..literal }, guarded))
}

#[cfg(test)]
mod tests {
    use super::super::guard::How;
    use super::super::{Boundary, Exact, FeatureCells, FeatureFactor, Mode, Structure, factor, setup};
    use super::*;
    use crate::UNWATCHED;
    use crate::lattice::{Lattice, Positions};
    use crate::warp::certify;

    const LATTICE: Lattice = Lattice { origin: [0.0; 2], spacing: [4.0; 2], nodes: [31, 25] };

    /// Two blocks side by side that need more than the width that is left of a squeeze.
    fn blocks(exact: Exact) -> FeatureFactor {
        let labels = (0..30 * 24).map(|cell| match (cell % 30, cell / 30) {
            (3..14, 6..18) => 1,
            (16..27, 6..18) => 2,
            _ => 0,
        });
        let cells = FeatureCells { labels: labels.collect(), mixed: 0, outside: 0 };
        let structure = Structure {
            lattice: &LATTICE,
            cells: &cells,
            weight: 10.0,
            weights: &[],
            soft: None,
            radius: 2.0,
            boundary: Boundary::Pin,
            exact,
        };
        factor(setup(&structure, UNWATCHED).expect("set up"), UNWATCHED).expect("factored")
    }

    fn squeezed() -> Positions {
        Positions::from_map(&LATTICE, |[x, y]| [0.4 * x, y])
    }

    fn solved(exact: Exact, on_conflict: OnConflict, fit: Fit) -> (FeatureWarp, Guarded) {
        let targets = Targets { mode: Mode::Rigid, on_conflict, ..Targets::default() };
        let (factor, warp) = (blocks(exact), squeezed());
        let asked = rhs(&factor, &warp, &targets, UNWATCHED).expect("asked");
        solve_certified(&asked, fit, 1e-6, UNWATCHED).expect("solved")
    }

    #[test]
    fn features_that_do_not_fit_shrink_or_bend() {
        for exact in [Exact::Off, Exact::Rigid] {
            for fit in [Fit::Shrink, Fit::Bend] {
                let (warp, guarded) = solved(exact, OnConflict::NoFold, fit);
                assert!(guarded.literal_folds > 0 && guarded.reached, "{exact:?} {fit:?}: {guarded:?}");
                let found = certify(&LATTICE, &warp.positions, UNWATCHED).expect("nobody stops it");
                assert!(found.min_jacobian >= 0.004, "{exact:?} {fit:?}: {found:?}");
            }
        }
    }

    #[test]
    fn exact_features_that_keep_their_shape_fold_rather_than_bend() {
        let (warp, guarded) = solved(Exact::Rigid, OnConflict::KeepShape, Fit::Bend);
        // Whatever the fit: a size may give way, a shape may not.
        assert!(warp.features.iter().all(|fit| fit.deviation_cells < 1e-9), "{:?}", warp.features);
        assert!(matches!(guarded.how, How::Kept | How::Shrunk { .. }));
        assert_eq!(guarded.reached, guarded.how != How::Kept);
    }

    #[test]
    fn what_does_not_fold_is_the_literal_solution() {
        let factor = blocks(Exact::Off);
        let warp = Positions::from_map(&LATTICE, |[x, y]| [0.8 * x + 0.1 * y, y]);
        let asked = rhs(&factor, &warp, &Targets::default(), UNWATCHED).expect("asked");
        let (certified, guarded) = solve_certified(&asked, Fit::Bend, 1e-6, UNWATCHED).expect("solved");
        let literal = solve(&asked, 1e-6, UNWATCHED);
        assert_eq!((certified, guarded.how), (literal.expect("solved"), How::Literal));
    }
}
