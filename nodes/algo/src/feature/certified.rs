//! The warp that does not fold.

use super::Error;
use super::guard::{Fit, Guarded, How, Verdict, guard};
use super::rhs::{Functional, OnConflict, Rhs, Targets, rhs};
use super::solve::{FeatureWarp, solve};
use crate::Watch;
use crate::steps::{Paid, Span};

/// Part of the work that is done once the literal solution is known.
const SOLVED: f64 = 0.2;

/// The feature-aware warp of a warp, repaired where it folds.
///
/// [`solve`], then [`guard`] on the solution.
///
/// * `asked`: made by [`rhs`]; its factor, warp and targets are used.
/// * `fit`: what gives way where features do not fit.
/// * `tolerance`: as for [`solve`].
/// * `watch`: asked now and then.
///
/// A warp that folds is repaired without features too: nothing can shrink then, so it is bent.
/// Exact features that fold give up their shape with `NoFold`, as little as the functional allows. With `KeepShape`
/// they never bend: they shrink, if that is wanted and helps, or the folds stay and are reported. They stay too where no
/// repair helps. `residual` is that of the literal solution. The cost is that of [`guard`].
pub fn solve_certified(asked: &Rhs, fit: Fit, tolerance: f64, watch: Watch) -> Result<(FeatureWarp, Verdict), Error> {
    let Rhs { factor, warp, targets, .. } = *asked;
    let literal = solve(asked, tolerance, &Span::new(watch, 0.0, SOLVED))?;
    let freedom = asked.freedom_to_bend();
    let functional = Functional { freedom: &freedom, ..asked.functional() };
    let shrunk = |size: f64| {
        let smaller = Targets { size: targets.size * size, ..targets };
        // The literal solution's memory serves again.
        Ok(solve(&rhs(factor, warp, &smaller, &Paid(watch))?, tolerance, &Paid(watch))?.positions)
    };
    // Without features nothing can shrink.
    let fit = if factor.features.is_idle() { Fit::Bend } else { fit };
    let may_bend = targets.on_conflict == OnConflict::NoFold || !factor.has_exact_features();
    let Guarded { positions, verdict } =
        guard(&functional, &literal.positions, fit, may_bend, &shrunk, &Span::new(watch, SOLVED, 1.0))?;
    if verdict.how == How::Literal {
        return Ok((literal, verdict));
    }
    let features = factor.fits(&positions, watch)?;
    Ok((FeatureWarp { positions, features, ..literal }, verdict))
}

#[cfg(test)]
mod tests {
    use super::super::guard::How;
    use super::super::{Boundary, Exact, FeatureCells, FeatureFactor, Mode, Structure, factor, setup};
    use super::*;
    use crate::lattice::{Lattice, Positions};
    use crate::warp::{arc, certify, swirl};
    use crate::{Interrupted, UNWATCHED, Watcher};
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};

    const LATTICE: Lattice = Lattice { origin: [0.0; 2], spacing: [4.0; 2], nodes: [31, 25] };

    /// Two blocks side by side that need more than the width that is left of a squeeze.
    fn blocks(exact: Exact, watch: Watch) -> FeatureFactor {
        let labels = (0..30 * 24).map(|cell| match (cell % 30, cell / 30) {
            (3..14, 6..18) => 1,
            (16..27, 6..18) => 2,
            _ => 0,
        });
        factored(&LATTICE, labels.collect(), exact, watch)
    }

    fn factored(lattice: &Lattice, labels: Vec<u32>, exact: Exact, watch: Watch) -> FeatureFactor {
        let cells = FeatureCells { labels, mixed: 0, outside: 0 };
        let structure = Structure {
            lattice,
            cells: &cells,
            weight: 10.0,
            weights: &[],
            soft: None,
            radius: 2.0,
            boundary: Boundary::Pin,
            exact,
        };
        factor(setup(&structure, UNWATCHED).expect("set up"), watch).expect("factored")
    }

    fn squeezed() -> Positions {
        Positions::from_map(&LATTICE, |[x, y]| [0.4 * x, y])
    }

    fn solved(exact: Exact, on_conflict: OnConflict, fit: Fit) -> (FeatureWarp, Verdict) {
        let targets = Targets { mode: Mode::Rigid, on_conflict, ..Targets::default() };
        let (factor, warp) = (blocks(exact, UNWATCHED), squeezed());
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
        // Whatever the fit: a size may give way, a shape may not.
        for fit in [Fit::Shrink, Fit::Bend] {
            let (warp, guarded) = solved(Exact::Rigid, OnConflict::KeepShape, fit);
            assert!(warp.features.iter().all(|fit| fit.deviation_cells < 1e-9), "{:?}", warp.features);
            assert_eq!(matches!(guarded.how, How::Shrunk { .. }), fit == Fit::Shrink, "{:?}", guarded.how);
            assert_eq!((guarded.how == How::Kept, guarded.reached), (fit == Fit::Bend, fit == Fit::Shrink));
        }
    }

    /// What a watch is told, and bytes that it is asked for.
    #[derive(Default)]
    struct Told(Mutex<(Vec<f64>, usize)>);

    impl Watcher for Told {
        fn progress(&self, part: f64) -> Result<(), Interrupted> {
            self.0.lock().expect("nobody panicked").0.push(part);
            Ok(())
        }

        fn go_on(&self) -> Result<(), Interrupted> {
            Ok(())
        }

        fn reserve(&self, bytes: usize) -> Result<(), Interrupted> {
            self.0.lock().expect("nobody panicked").1 += bytes;
            Ok(())
        }
    }

    #[test]
    fn progress_does_not_run_backwards() {
        let mut folded = squeezed();
        folded.x[200] += 9.0;
        let assert_forward = |told: Told| {
            let (parts, _) = told.0.into_inner().expect("nobody panicked");
            assert!(parts.is_sorted() && parts.len() > 3 && parts[parts.len() - 1] <= 1.0, "{parts:?}");
        };
        for exact in [Exact::Off, Exact::Similarity] {
            let told = Told::default();
            let factor = blocks(exact, &told);
            assert_forward(told);
            for (warp, fit) in [(&squeezed(), Fit::Shrink), (&squeezed(), Fit::Bend), (&folded, Fit::Bend)] {
                let targets = Targets { mode: Mode::Rigid, ..Targets::default() };
                let (asked, told) = (rhs(&factor, warp, &targets, UNWATCHED).expect("asked"), Told::default());
                let (_, guarded) = solve_certified(&asked, fit, 1e-6, &told).expect("solved");
                assert!(guarded.how != How::Literal, "{guarded:?}");
                assert_forward(told);
            }
        }
    }

    /// Solutions that follow each other take the same memory.
    #[test]
    fn shrinking_asks_for_memory_once() {
        let (factor, warp) = (blocks(Exact::Off, UNWATCHED), squeezed());
        let targets = Targets { mode: Mode::Rigid, ..Targets::default() };
        let asked = rhs(&factor, &warp, &targets, UNWATCHED).expect("asked");
        let (literal, shrunk) = (Told::default(), Told::default());
        solve(&asked, 1e-6, &literal).expect("solved");
        let (_, guarded) = solve_certified(&asked, Fit::Shrink, 1e-6, &shrunk).expect("solved");
        assert!(matches!(guarded.how, How::Shrunk { .. }), "{guarded:?}");
        let [literal, shrunk] = [literal, shrunk].map(|told| told.0.into_inner().expect("nobody panicked").1);
        assert!((literal..3 * literal).contains(&shrunk), "{shrunk} for {literal}");
    }

    /// Without features the warp that folds is bent straight away: nothing can shrink.
    #[test]
    fn nothing_shrinks_where_there_are_no_features() {
        let factor = factored(&LATTICE, vec![0; 30 * 24], Exact::Off, UNWATCHED);
        let mut warp = squeezed();
        warp.x[200] += 9.0;
        let asked = rhs(&factor, &warp, &Targets::default(), UNWATCHED).expect("asked");
        let [shrunk, bent] = [Fit::Shrink, Fit::Bend].map(|fit| {
            let asks = AtomicUsize::new(0);
            let count = |_: f64| {
                asks.fetch_add(1, Ordering::Relaxed);
                Ok(())
            };
            let (_, guarded) = solve_certified(&asked, fit, 1e-6, &count).expect("solved");
            assert!(matches!(guarded.how, How::Bent { .. }) && guarded.reached, "{guarded:?}");
            asks.into_inner()
        });
        assert_eq!(shrunk, bent, "looks at the watch");
    }

    /// What no repair mends is not made worse, with and without features.
    #[test]
    fn repairs_that_fail_do_no_harm() {
        let lattice = Lattice { nodes: [17, 13], ..LATTICE };
        let swirled = swirl(&lattice, 3600.0, 30.0, lattice.center(), UNWATCHED).expect("nobody stops it");
        let around = arc(&lattice, -360.0, UNWATCHED).expect("nobody stops it");
        let block = (0..16 * 12).map(|cell| u32::from((5..11).contains(&(cell % 16)) && (4..8).contains(&(cell / 16))));
        for labels in [block.collect(), vec![0; 16 * 12]] {
            let factor = factored(&lattice, labels, Exact::Off, UNWATCHED);
            for warp in [&swirled, &around] {
                let asked = rhs(&factor, warp, &Targets::default(), UNWATCHED).expect("asked");
                let literal = solve(&asked, 1e-6, UNWATCHED).expect("solved");
                let (certified, guarded) = solve_certified(&asked, Fit::Shrink, 1e-6, UNWATCHED).expect("solved");
                let [before, after] = [&literal, &certified]
                    .map(|warp| certify(&lattice, &warp.positions, UNWATCHED).expect("nobody stops it"));
                assert!(!guarded.reached && before.folds > 0, "{guarded:?}");
                assert!(after.folds <= before.folds && after.min_jacobian >= before.min_jacobian, "{guarded:?}");
                let is_kept = guarded.how == How::Kept;
                assert_eq!((is_kept, after.folds == before.folds), (certified == literal, is_kept), "{guarded:?}");
                assert!(!is_kept || (!guarded.mirrored && guarded.literal_folds == before.folds), "{guarded:?}");
            }
        }
    }

    #[test]
    fn what_does_not_fold_is_the_literal_solution() {
        let factor = blocks(Exact::Off, UNWATCHED);
        let warp = Positions::from_map(&LATTICE, |[x, y]| [0.8 * x + 0.1 * y, y]);
        let asked = rhs(&factor, &warp, &Targets::default(), UNWATCHED).expect("asked");
        let (certified, guarded) = solve_certified(&asked, Fit::Bend, 1e-6, UNWATCHED).expect("solved");
        let literal = solve(&asked, 1e-6, UNWATCHED);
        assert_eq!((certified, guarded.how), (literal.expect("solved"), How::Literal));
    }
}
