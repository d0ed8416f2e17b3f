use super::*;
use crate as algo;
use crate::lattice::Lattice;
use crate::{Interrupted, UNWATCHED};

#[path = "cases.rs"]
mod cases;

use cases::{Case, Noise};

const SQUARE: Lattice = Lattice { origin: [0.0; 2], spacing: [2.0; 2], nodes: [14, 12] };
const DISCS: [[f64; 3]; 2] = [[3.5, 4.5, 2.6], [9.0, 6.0, 2.2]];

fn no_solve(_: f64) -> Result<Positions, Error> {
    unreachable!("bending solves nothing")
}

/// Nothing is asked for: the base is the literal solution of its own functional.
fn plain(lattice: &Lattice, base: &Positions) -> Case {
    Case::new(*lattice, base.clone(), &[], false)
}

fn squeezed(lattice: &Lattice, x: f64, y: f64) -> Positions {
    Positions::from_map(lattice, |p| [x * p[0], y * p[1]])
}

fn bent(case: &Case) -> Guarded {
    let found = case.guarded(Fit::Bend);
    assert!(found.positions.x.iter().chain(&found.positions.y).all(|value| value.is_finite()));
    found
}

#[test]
fn random_cases_do_not_fold() {
    let mut folded = 0;
    for seed in 0..5 {
        for fit in [Fit::Bend, Fit::Shrink] {
            let case = Case::random(seed);
            let found = case.guarded(fit);
            assert_eq!(case.violations(&found), [""; 0], "case {seed}, {fit:?}");
            folded += usize::from(found.verdict.literal_folds > 0);
        }
    }
    assert!(folded >= 2, "{folded} folded");
}

#[test]
fn what_does_not_fold_keeps_its_bits() {
    let turned = |p: [f64; 2]| [0.8 * p[0] - 0.3 * p[1] + 7.0, 0.3 * p[0] + 0.8 * p[1]];
    let case = Case::new(SQUARE, Positions::from_map(&SQUARE, turned), &DISCS, false);
    let (found, literal) = (bent(&case), case.literal(1.0).expect("solved"));
    assert_eq!((found.verdict.how, &found.positions, found.verdict.reached), (How::Literal, &literal, true));
    assert_eq!(found.verdict.obstacles, []);
}

#[test]
fn a_squeeze_is_bent_or_shrunk() {
    let case = Case::new(SQUARE, squeezed(&SQUARE, 0.4, 1.0), &DISCS, true);
    let (bent, shrunk) = (bent(&case), case.guarded(Fit::Shrink));
    assert!(
        bent.verdict.literal_folds > 0 && matches!(bent.verdict.how, How::Bent { steps } if steps > 0),
        "{:?}",
        bent.verdict.how
    );
    let How::Shrunk { factor } = shrunk.verdict.how else { panic!("{:?}", shrunk.verdict.how) };
    assert!(factor > 0.3 && factor < 1.0, "{factor}");
    for found in [&bent, &shrunk] {
        assert_eq!(case.violations(found), [""; 0]);
    }
    // The next larger factor that bisection saw folds.
    let larger = case.literal(factor + 0.01).expect("solved");
    assert!(certify(&SQUARE, &larger, UNWATCHED).expect("unwatched").min_jacobian < shrunk.verdict.floor);
}

#[test]
fn at_most_ten_solves_and_none_without_need() {
    let case = Case::new(SQUARE, squeezed(&SQUARE, 0.4, 1.0), &DISCS, true);
    let fluxes = case.fluxes(1.0);
    let literal = case.literal(1.0).expect("solved");
    let solves = std::cell::Cell::new(0);
    let solve = |factor| {
        solves.set(solves.get() + 1);
        case.literal(factor)
    };
    guard(&case.functional(&fluxes), &literal, Fit::Shrink, true, &solve, UNWATCHED).expect("done");
    assert!((2..=10).contains(&solves.get()), "{}", solves.get());
    solves.set(0);
    guard(&case.functional(&fluxes), &case.base, Fit::Shrink, true, &solve, UNWATCHED).expect("done");
    assert_eq!(solves.get(), 0);
    // Where no factor helps it bends.
    let found = guard(&case.functional(&fluxes), &literal, Fit::Shrink, true, &|_| Ok(literal.clone()), UNWATCHED);
    assert_eq!(case.violations(&found.expect("done")), [""; 0]);
}

/// A convex boundary, what is inside folded: the convex combination map is found.
#[test]
fn any_interior_is_repaired_within_a_convex_boundary() {
    let round = |p: [f64; 2]| {
        let [u, v] = [p[0] / 13.0 - 1.0, p[1] / 11.0 - 1.0];
        [13.0 * u * (1.0 - 0.3 * v * v), 9.0 * v * (1.0 - 0.2 * u * u)]
    };
    let slanted = |p: [f64; 2]| [p[0] + 0.4 * p[1] + 0.02 * p[0] * p[0], 0.9 * p[1] - 0.1 * p[0]];
    for (seed, map) in [(1, &round as &(dyn Fn([f64; 2]) -> [f64; 2] + Sync)), (2, &slanted), (3, &|p| p)] {
        let mut base = Positions::from_map(&SQUARE, map);
        let mut noise = Noise::new(seed);
        let outline = plain(&SQUARE, &base).freedom;
        for node in (0..outline.len()).filter(|&node| outline[node] == Freedom::Free) {
            base.x[node] += noise.within(-9.0, 9.0);
            base.y[node] += noise.within(-9.0, 9.0);
        }
        for discs in [&[][..], &DISCS] {
            let found = bent(&Case::new(SQUARE, base.clone(), discs, false));
            assert!(
                found.verdict.literal_folds > 0 && found.verdict.reached && found.verdict.folds == 0,
                "{seed}: {found:?}"
            );
            assert!(found.verdict.obstacles.is_empty(), "{:?}", found.verdict.obstacles);
        }
    }
    let smallest = Lattice { nodes: [3, 3], ..SQUARE };
    let mut base = Positions::from_map(&smallest, |p| p);
    base.x[4] = 50.0;
    let found = bent(&plain(&smallest, &base));
    assert!(found.verdict.reached && (found.positions.x[4] - 2.0).abs() < 2.0, "{found:?}");
}

/// Every node of the frame is given, the polygon is simple and convex at the corners, and no centre unfolds it.
#[test]
fn where_no_map_exists_none_is_claimed() {
    let nine = Lattice { origin: [0.0; 2], spacing: [5.0; 2], nodes: [3, 3] };
    let x = vec![0.0, 2.0, 10.0, 1.0, 5.0, 9.0, 0.0, 9.0, 10.0];
    let y = vec![0.0, 8.0, 0.0, 6.0, 5.0, 2.0, 10.0, 4.0, 10.0];
    let found = bent(&plain(&nine, &Positions { x, y }));
    assert!(!found.verdict.reached && found.verdict.folds > 0 && found.verdict.min_jacobian <= 0.0, "{found:?}");
    assert_eq!(found.verdict.obstacles, []);
}

#[test]
fn untangling_finds_maps_within_boundaries_that_are_not_convex() {
    let notched = |p: [f64; 2]| {
        let [u, v] = [p[0] / 26.0, p[1] / 22.0];
        [p[0] + 5.0 * (3.0 * v).sin(), p[1] + 16.0 * u * (1.0 - u)]
    };
    let outline = Positions::from_map(&SQUARE, notched);
    let free = plain(&SQUARE, &outline).freedom;
    for seed in 0..4 {
        let (mut base, mut noise) = (outline.clone(), Noise::new(seed));
        for node in (0..free.len()).filter(|&node| free[node] == Freedom::Free) {
            base.x[node] += noise.within(-4.0, 4.0);
            base.y[node] += noise.within(-4.0, 4.0);
        }
        let found = bent(&plain(&SQUARE, &base));
        assert!(
            found.verdict.literal_folds > 10 && found.verdict.reached && found.verdict.folds == 0,
            "{seed}: {found:?}"
        );
    }
}

#[test]
fn nothing_to_move_gives_the_base() {
    let mut case = Case::new(SQUARE, squeezed(&SQUARE, 0.4, 1.0), &DISCS, true);
    case.freedom.fill(Freedom::Pinned);
    let found = bent(&case);
    assert_eq!((&found.positions, found.verdict.how), (&case.base, How::Literal));
    let fluxes = case.fluxes(1.0);
    let mut folded = case.base.clone();
    folded.x[20] += 30.0;
    let functional = Functional { base: &folded, ..case.functional(&fluxes) };
    let found = guard(&functional, &folded, Fit::Bend, true, &no_solve, UNWATCHED).expect("done");
    assert!(!found.verdict.reached && found.positions == folded);
    let told = |&obstacle: &Obstacle| matches!(obstacle, Obstacle::PinnedCorner { count, .. } if count > 0);
    assert!(found.verdict.obstacles.iter().any(told), "{:?}", found.verdict.obstacles);
    for nodes in [[2, 2], [2, 9], [7, 2]] {
        let lattice = Lattice { nodes, ..SQUARE };
        let base = squeezed(&lattice, 0.5, 0.5);
        assert_eq!(bent(&plain(&lattice, &base)).positions, base);
    }
}

#[test]
fn nodes_slide_along_their_direction_only() {
    let mut case = Case::new(SQUARE, squeezed(&SQUARE, 0.4, 1.0), &[[4.0, 0.0, 3.2], [9.5, 0.0, 2.4]], true);
    (1..13).for_each(|node| case.freedom[node] = Freedom::Along([3.0, 0.0]));
    let found = bent(&case);
    assert!(found.verdict.literal_folds > 0);
    assert_eq!(case.violations(&found), [""; 0]);
    assert!((1..13).all(|node| found.positions.y[node] == case.base.y[node]));
    assert!((1..13).any(|node| (found.positions.x[node] - case.base.x[node]).abs() > 0.1), "none slid");
    assert!((1..14).all(|node| found.positions.x[node] > found.positions.x[node - 1]));
}

#[test]
fn mirrored_warps_are_repaired_in_a_mirror() {
    let upright = Case::new(SQUARE, squeezed(&SQUARE, 0.4, 1.0), &DISCS, true);
    let (fluxes, literal) = (upright.fluxes(1.0), upright.literal(1.0).expect("solved"));
    let negative = |edges: &[f64]| edges.iter().map(|value| -value).collect();
    let x = Edges { horizontal: negative(&fluxes[0].horizontal), vertical: negative(&fluxes[0].vertical) };
    let (fluxes, base) = ([x, fluxes[1].clone()], in_mirror(&upright.base));
    let functional = Functional { fluxes: &fluxes, base: &base, ..upright.functional(&fluxes) };
    let found = guard(&functional, &in_mirror(&literal), Fit::Bend, true, &no_solve, UNWATCHED).expect("done");
    let expected = bent(&upright);
    let verdict = Verdict { mirrored: true, ..expected.verdict };
    assert_eq!(found, Guarded { positions: in_mirror(&expected.positions), verdict });
}

#[test]
fn obstacles_are_named() {
    // The boundary of a bow tie crosses itself; the corners of its crossed half are the wrong way round.
    let bow = Positions::from_map(&SQUARE, |[x, y]| [(x - 13.0) * (14.0 - y), y]);
    let found = bent(&plain(&SQUARE, &bow));
    assert!(
        !found.verdict.reached && found.verdict.obstacles.iter().any(|o| matches!(o, Obstacle::BoundaryCrosses { .. }))
    );
    assert!(
        found.verdict.obstacles.iter().any(|o| matches!(o, Obstacle::PinnedCorner { .. })),
        "{:?}",
        found.verdict.obstacles
    );
    let mut base = squeezed(&SQUARE, 1.0, 1.0);
    base.x[5] = base.x[6];
    let found = bent(&plain(&SQUARE, &base));
    assert!(
        !found.verdict.reached
            && found.verdict.obstacles.contains(&Obstacle::CollapsedEdge { nodes: [[5, 0], [6, 0]] })
    );
    // Too far from the origin for single precision.
    let far = Lattice { origin: [1e8, 0.0], spacing: [0.25; 2], nodes: [6, 6] };
    let found = bent(&plain(&far, &Positions::from_map(&far, |p| p)));
    assert_eq!(
        (found.verdict.how, found.verdict.reached, &found.verdict.obstacles[..]),
        (How::Literal, true, &[Obstacle::SinglePrecision][..])
    );
}

#[test]
fn numbers_that_are_not_finite_are_told_or_harmless() {
    let case = Case::new(SQUARE, squeezed(&SQUARE, 0.4, 1.0), &DISCS, true);
    let (fluxes, literal) = (case.fluxes(1.0), case.literal(1.0).expect("solved"));
    let mut bad = case.base.clone();
    bad.y[15] = f64::NAN;
    let node = Err(Error::NotFinite { column: 1, row: 1 });
    let functional = Functional { base: &bad, ..case.functional(&fluxes) };
    assert_eq!(guard(&functional, &literal, Fit::Bend, true, &no_solve, UNWATCHED), node);
    assert_eq!(guard(&case.functional(&fluxes), &bad, Fit::Bend, true, &no_solve, UNWATCHED), node);
    let mut fluxes = fluxes;
    fluxes[0].horizontal[40] = f64::NAN;
    let found = guard(&case.functional(&fluxes), &literal, Fit::Bend, true, &no_solve, UNWATCHED).expect("done");
    assert!(found.verdict.reached && found.positions.x.iter().chain(&found.positions.y).all(|value| value.is_finite()));
}

#[test]
fn the_watch_stops_it() {
    let case = Case::new(SQUARE, squeezed(&SQUARE, 0.4, 1.0), &DISCS, true);
    let (fluxes, literal) = (case.fluxes(1.0), case.literal(1.0).expect("solved"));
    let asked = std::sync::atomic::AtomicUsize::new(0);
    for limit in [0, 5, 20] {
        asked.store(0, std::sync::atomic::Ordering::Relaxed);
        let watch = |_| match asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed) {
            count if count >= limit => Err(Interrupted),
            _ => Ok(()),
        };
        let stopped = guard(&case.functional(&fluxes), &literal, Fit::Bend, true, &no_solve, &watch);
        assert_eq!(stopped, Err(Interrupted.into()), "after {limit}");
    }
}

/// The cases' own literal solution is that of the feature-aware warp.
#[test]
fn the_literal_solution_is_the_feature_aware_warp() {
    use crate::feature::{Boundary, Exact, FeatureCells, Mode, Structure, Targets, factor, rhs, setup, solve};
    let base = Positions::from_map(&SQUARE, |[x, y]| [0.7 * x + 0.02 * x * y, y + 0.2 * (0.3 * x).sin()]);
    let label = |cell: usize| {
        let within = |[x, y, r]: [f64; 3]| ((cell % 13) as f64 - x).hypot((cell / 13) as f64 - y) <= r;
        DISCS.iter().position(|&disc| within(disc)).map_or(0, |index| index as u32 + 1)
    };
    let cells = FeatureCells { labels: (0..13 * 11).map(label).collect(), mixed: 0, outside: 0 };
    let structure = Structure {
        lattice: &SQUARE,
        cells: &cells,
        weight: 10.0,
        weights: &[],
        soft: None,
        radius: 2.0,
        boundary: Boundary::Pin,
        exact: Exact::Off,
    };
    let factor = factor(setup(&structure, UNWATCHED).expect("set up"), UNWATCHED).expect("factored");
    for (rigid, mode) in [(false, Mode::Similarity), (true, Mode::Rigid)] {
        let asked = rhs(&factor, &base, &Targets { mode, ..Targets::default() }, UNWATCHED).expect("finite");
        let expected = solve(&asked, 1e-9, UNWATCHED).expect("solved").positions;
        let found = Case::new(SQUARE, base.clone(), &DISCS, rigid).literal(1.0).expect("solved");
        for (a, b) in found.x.iter().zip(&expected.x).chain(found.y.iter().zip(&expected.y)) {
            assert!((a - b).abs() < 1e-10, "{a} for {b}");
        }
    }
}
