//! Properties of the solvers, and the cases at their borders.

use super::*;
use crate::UNWATCHED;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Numbers in -1..1, the same on every run.
fn noise(seed: u32) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 23) - 1.0
    }
}

fn random_edges(nodes: [usize; 2], mut number: impl FnMut() -> f64) -> Edges {
    let mut edges = Edges::zeros(nodes);
    edges.horizontal.iter_mut().chain(&mut edges.vertical).for_each(|value| *value = number());
    edges
}

fn random_conductances(nodes: [usize; 2], seed: u32) -> Edges {
    let mut number = noise(seed);
    random_edges(nodes, || 1.0 + 100.0 * number().powi(8))
}

/// c grad x, the flux that x itself solves for.
fn flux_of(conductances: &Edges, x: &[f64], [columns, _]: [usize; 2]) -> Edges {
    let across = |(edge, c): (usize, &f64)| {
        let node = edge + edge / (columns - 1);
        c * (x[node + 1] - x[node])
    };
    let down = |(node, c): (usize, &f64)| c * (x[node + columns] - x[node]);
    Edges {
        horizontal: conductances.horizontal.iter().enumerate().map(across).collect(),
        vertical: conductances.vertical.iter().enumerate().map(down).collect(),
    }
}

fn factored(nodes: [usize; 2], conductances: &Edges) -> Factor {
    GridLaplacian::new(nodes, conductances.clone(), Pins::Frame).factor(UNWATCHED).expect("positive conductances")
}

fn cholesky(factor: &mut Factor) -> &mut Cholesky {
    match &mut factor.backend {
        Backend::Direct(cholesky) => cholesky,
        _ => panic!("not factored"),
    }
}

#[test]
fn middle_of_three_by_three_is_the_weighted_mean() {
    let nodes = [3, 3];
    let mut conductances = Edges::zeros(nodes);
    conductances.horizontal[2..4].copy_from_slice(&[1.0, 2.0]);
    conductances.vertical[1] = 3.0;
    conductances.vertical[4] = 4.0;
    let frame = [9.0, 30.0, 9.0, 10.0, 9.0, 20.0, 9.0, 40.0, 9.0];
    let mut flux = Edges::zeros(nodes);
    flux.horizontal[2] = 7.0;
    flux.vertical[4] = 2.0;
    let solution = factored(nodes, &conductances).solve(&[flux], &[&frame], 1e-6, UNWATCHED).expect("solved");
    let expected = (1.0 * 10.0 + 2.0 * 20.0 + 3.0 * 30.0 + 4.0 * 40.0 + 7.0 - 2.0) / 10.0;
    assert!((solution.fields[0][4] - expected).abs() < 1e-13, "{solution:?}");
    assert_eq!(solution.fields[0][..4], frame[..4]);
}

#[test]
fn any_field_is_recovered_from_its_flux_and_frame() {
    for nodes in [[3, 3], [3, 9], [9, 3], [4, 7], [23, 17], [70, 64]] {
        let conductances = random_conductances(nodes, 5);
        let mut number = noise(7);
        let fields: Vec<Vec<f64>> = (0..3).map(|_| (0..nodes[0] * nodes[1]).map(|_| number()).collect()).collect();
        let fluxes: Vec<Edges> = fields.iter().map(|field| flux_of(&conductances, field, nodes)).collect();
        let frames: Vec<&[f64]> = fields.iter().map(|field| &field[..]).collect();
        let factor = factored(nodes, &conductances);
        assert_eq!(factor.unknowns(), (nodes[0] - 2) * (nodes[1] - 2));
        let solution = factor.solve(&fluxes, &frames, 1e-6, UNWATCHED).expect("solved");
        assert!(solution.residual < 1e-13, "{nodes:?}: {}", solution.residual);
        for (solved, field) in solution.fields.iter().flatten().zip(fields.iter().flatten()) {
            assert!((solved - field).abs() < 1e-11, "{nodes:?}: {solved} for {field}");
        }
    }
}

#[test]
fn right_hand_sides_do_not_mix() {
    let nodes = [12, 10];
    let factor = factored(nodes, &random_conductances(nodes, 1));
    let [one, two] = [3, 4].map(|seed| random_edges(nodes, noise(seed)));
    let still = vec![0.0; 120];
    let both = factor.solve(&[one.clone(), two], &[&still, &still], 1e-6, UNWATCHED).expect("solved");
    let alone = factor.solve(&[one], &[&still], 1e-6, UNWATCHED).expect("solved");
    for (a, b) in both.fields[0].iter().zip(&alone.fields[0]) {
        assert!((a - b).abs() < 1e-13);
    }
    assert_eq!(factor.solve(&[], &[], 1e-6, UNWATCHED).expect("solved").fields.len(), 0);
}

#[test]
fn without_interior_the_frame_is_the_result() {
    for nodes in [[2, 2], [2, 5], [5, 2], [1, 4]] {
        let frame: Vec<f64> = (0..nodes[0] * nodes[1]).map(|node| node as f64).collect();
        let factor = factored(nodes, &Edges::zeros(nodes));
        let solution = factor.solve(&[Edges::zeros(nodes)], &[&frame], 1e-6, UNWATCHED).expect("solved");
        assert_eq!((solution.fields, solution.residual, factor.unknowns()), (vec![frame], 0.0, 0));
    }
}

#[test]
fn bad_conductances_and_watches_are_told() {
    let nodes = [6, 6];
    let fail = |value: f64| {
        let conductances = random_edges(nodes, || value);
        GridLaplacian::new(nodes, conductances, Pins::Frame).factor(UNWATCHED).expect_err("no factor")
    };
    assert_eq!(fail(-1.0), Error::NotPositiveDefinite);
    assert_eq!(fail(0.0), Error::NotPositiveDefinite);
    fail(f64::NAN);
    fail(f64::INFINITY);
    let laplacian = GridLaplacian::new(nodes, random_conductances(nodes, 1), Pins::Frame);
    assert_eq!(laplacian.clone().factor(&|_| Err(Interrupted)).expect_err("stopped"), Error::Interrupted);
    let factor = laplacian.factor(UNWATCHED).expect("factored");
    let stopped = factor.solve(&[Edges::zeros(nodes)], &[&[0.0; 36]], 1e-6, &|_| Err(Interrupted));
    assert_eq!(stopped, Err(Error::Interrupted));
}

#[test]
fn a_slightly_wrong_factor_is_made_good_by_refinement() {
    let nodes = [30, 20];
    let mut factor = factored(nodes, &random_conductances(nodes, 2));
    cholesky(&mut factor).values.iter_mut().for_each(|value| *value *= 1.0 + 1e-8);
    let solution = factor.solve(&[random_edges(nodes, noise(6))], &[&vec![0.5; 600]], 1e-6, UNWATCHED).expect("solved");
    assert!(solution.residual < 1e-12, "{}", solution.residual);
}

#[test]
fn a_wrong_factor_does_not_pass_its_probe() {
    let nodes = [40, 40];
    let mut factor = factored(nodes, &random_conductances(nodes, 2));
    assert!(factor.probe(UNWATCHED).is_ok());
    assert!(factor.bytes() > 8 * 38 * 38);
    let values = &mut cholesky(&mut factor).values;
    let middle = values.len() / 2;
    values[middle..middle + 50].iter_mut().for_each(|value| *value *= 0.1);
    assert!(matches!(factor.probe(UNWATCHED), Err(Error::Inaccurate { .. })));
}

#[test]
fn a_wrong_factor_gives_no_solution() {
    let nodes = [40, 40];
    let mut factor = factored(nodes, &random_conductances(nodes, 2));
    let values = &mut cholesky(&mut factor).values;
    let middle = values.len() / 2;
    values[middle..middle + 50].iter_mut().for_each(|value| *value *= 0.1);
    let solved = factor.solve(&[random_edges(nodes, noise(6))], &[&vec![0.5; 1600]], 1e-6, UNWATCHED);
    assert!(matches!(solved, Err(Error::Inaccurate { .. })), "{solved:?}");
}

/// A solution that is not a number is no solution, whichever backend finds it.
#[test]
fn what_is_not_a_number_is_told() {
    let nodes = [50, 41];
    let (conductances, [flux, _]) = stiff_discs(nodes, 10.0, 2.0, 4);
    let backends = [
        by_multigrid(nodes, &conductances),
        factored(nodes, &conductances),
        even(nodes, 1.0, 2.0).factor(UNWATCHED).expect("factored"),
    ];
    for factor in backends {
        let mut wrong = flux.clone();
        wrong.vertical[1025] = f64::NAN;
        for (flux, pinned) in [(&wrong, 0.0), (&flux, 1e300 * 1e300), (&flux, f64::NAN)] {
            let solved = factor.solve(std::slice::from_ref(flux), &[&vec![pinned; 2050]], 1e-4, UNWATCHED);
            assert!(matches!(solved, Err(Error::Inaccurate { .. })), "{} {pinned}", factor.backend());
        }
    }
}

#[test]
fn multigrid_refuses_what_single_precision_does_not_hold() {
    let nodes = [50, 41];
    let (conductances, [flux, _]) = stiff_discs(nodes, 10.0, 2.0, 4);
    let far: Vec<f64> = (0..2050).map(|node| 1e39 * (1.0 + (node % 50) as f64)).collect();
    let solved = by_multigrid(nodes, &conductances).solve(&[flux], &[&far], 1e-4, UNWATCHED);
    assert!(matches!(solved, Err(Error::Inaccurate { .. })), "{solved:?}");
}

#[test]
fn edges_between_pins_do_not_matter() {
    let nodes = [50, 41];
    let (conductances, [flux, _]) = stiff_discs(nodes, 10.0, 2.0, 4);
    let mut number = noise(5);
    let pinned: Vec<f64> = (0..2050).map(|_| number()).collect();
    for solver in [by_multigrid, factored] {
        let solve = |conductances: &Edges| {
            let solved = solver(nodes, conductances).solve(std::slice::from_ref(&flux), &[&pinned], 1e-4, UNWATCHED);
            solved.expect("solved")
        };
        for odd in [1e40, f64::INFINITY, f64::NAN, -1.0] {
            let mut other = conductances.clone();
            (other.horizontal[3], other.vertical[50]) = (odd, odd);
            assert_eq!(solve(&other), solve(&conductances), "{odd}");
        }
    }
}

#[test]
fn many_right_hand_sides_are_those_solved_alone() {
    let nodes = [19, 14];
    let factor = factored(nodes, &random_conductances(nodes, 3));
    let fluxes: Vec<Edges> = (0..70).map(|seed| random_edges(nodes, noise(seed))).collect();
    let pinned: Vec<f64> = (0..266).map(f64::from).collect();
    let together = factor.solve(&fluxes, &vec![&pinned[..]; 70], 1e-6, UNWATCHED).expect("solved");
    for (flux, field) in fluxes.into_iter().zip(&together.fields) {
        let alone = factor.solve(&[flux], &[&pinned], 1e-6, UNWATCHED).expect("solved");
        assert!(alone.fields[0].iter().zip(field).all(|(a, b)| (a - b).abs() < 1e-10));
    }
}

#[test]
fn any_set_of_pins_is_kept_and_solved_around() {
    for (nodes, seed) in [([9, 8], 1), ([2, 30], 2), ([1, 12], 3), ([25, 31], 4), ([7, 1], 5)] {
        let count = nodes[0] * nodes[1];
        let (conductances, mut number) = (random_conductances(nodes, seed), noise(seed + 9));
        let mut pinned: Vec<bool> = (0..count).map(|_| number() > 0.8).collect();
        pinned[count / 2] = true;
        let field: Vec<f64> = (0..count).map(|_| number()).collect();
        let flux = flux_of(&conductances, &field, nodes);
        let given: Vec<f64> = field.iter().zip(&pinned).map(|(x, pin)| if *pin { *x } else { f64::NAN }).collect();
        let free = pinned.iter().filter(|pin| !**pin).count();
        let factor = GridLaplacian::new(nodes, conductances, Pins::Nodes(pinned)).factor(UNWATCHED).expect("factored");
        assert_eq!((factor.unknowns(), factor.backend()), (free, "direct"));
        let solution = factor.solve(&[flux], &[&given], 1e-6, UNWATCHED).expect("solved");
        for (solved, field) in solution.fields[0].iter().zip(&field) {
            assert!((solved - field).abs() < 1e-11, "{nodes:?}: {solved} for {field}");
        }
    }
}

fn by_multigrid(nodes: [usize; 2], conductances: &Edges) -> Factor {
    let laplacian = GridLaplacian::new(nodes, conductances.clone(), Pins::Frame);
    let multigrid = Multigrid::new(&laplacian, UNWATCHED).expect("positive conductances");
    Factor { laplacian, backend: Backend::Multigrid(Box::new(multigrid)) }
}

/// Conductances of a lattice with stiff discs, and fluxes that bend them, for x and y.
fn stiff_discs([columns, rows]: [usize; 2], weight: f64, radius: f64, seed: u32) -> (Edges, [Edges; 2]) {
    let mut number = noise(seed);
    let mut within = |most: usize| (number() + 1.0) / 2.0 * most as f64;
    let discs: Vec<[f64; 3]> =
        (0..6).map(|_| [within(columns), within(rows), 2.0 + within(columns.min(rows) / 5)]).collect();
    let stiffness = |column: usize, row: usize| {
        let gap = |[x, y, size]: &[f64; 3]| (column as f64 - x).hypot(row as f64 - y) - size;
        let nearest = discs.iter().map(gap).fold(f64::INFINITY, f64::min).max(0.0);
        let part = if radius > 0.0 { (nearest / radius).min(1.0) } else { f64::from(nearest > 0.0) };
        (1.0 + (weight - 1.0) * (2.0 * part.powi(3) - 3.0 * part.powi(2) + 1.0)).powi(2)
    };
    let horizontal = |edge: usize| stiffness(edge % (columns - 1), edge / (columns - 1));
    let vertical = |edge: usize| stiffness(edge % columns, edge / columns);
    let mut conductances = Edges::zeros([columns, rows]);
    conductances.horizontal.iter_mut().enumerate().for_each(|(edge, c)| *c = horizontal(edge));
    conductances.vertical.iter_mut().enumerate().for_each(|(edge, c)| *c = vertical(edge));
    let asked = |c: &f64, wave: f64| if *c > 1.0 { c * wave.sin() } else { 0.0 };
    let fluxes = [0.05, 0.31].map(|pace| Edges {
        horizontal: conductances.horizontal.iter().enumerate().map(|(i, c)| asked(c, pace * i as f64)).collect(),
        vertical: conductances
            .vertical
            .iter()
            .enumerate()
            .map(|(i, c)| asked(c, 1.0 + pace * (i % 97) as f64))
            .collect(),
    });
    (conductances, fluxes)
}

#[test]
fn multigrid_keeps_its_tolerance() {
    let shapes = [[40, 33], [33, 40], [65, 65], [64, 64], [11, 11], [10, 200], [97, 50], [130, 121]];
    for (k, nodes) in shapes.into_iter().enumerate() {
        for (weight, radius) in [(1.0001, 0.0), (10.0, 2.0), (10.0, 0.0), (30.0, 1.0), (100.0, 8.0), (100.0, 0.0)] {
            let (conductances, fluxes) = stiff_discs(nodes, weight, radius, k as u32);
            let mut number = noise(77);
            let pinned: Vec<f64> = (0..nodes[0] * nodes[1]).map(|_| 5.0 * number()).collect();
            let exact =
                factored(nodes, &conductances).solve(&fluxes, &[&pinned, &pinned], 1.0, UNWATCHED).expect("solved");
            let factor = by_multigrid(nodes, &conductances);
            for tolerance in [1e-2, 1e-3, 1e-6] {
                let solved = factor.solve(&fluxes, &[&pinned, &pinned], tolerance, UNWATCHED).expect("solved");
                let apart =
                    solved.fields.iter().flatten().zip(exact.fields.iter().flatten()).map(|(a, b)| (a - b).abs());
                let error = apart.fold(0.0, f64::max);
                assert!(error <= tolerance, "{nodes:?} weight {weight} radius {radius}: {error:e} for {tolerance:e}");
                assert_eq!(solved.fields[0][..nodes[0]], pinned[..nodes[0]], "the frame");
            }
        }
    }
}

#[test]
fn multigrid_serves_any_count_of_right_hand_sides() {
    let nodes = [50, 41];
    let (conductances, [one, two]) = stiff_discs(nodes, 10.0, 2.0, 4);
    let factor = by_multigrid(nodes, &conductances);
    let still = vec![0.0; 2050];
    let three =
        factor.solve(&[one.clone(), two.clone(), one.clone()], &[&still[..]; 3], 1e-4, UNWATCHED).expect("solved");
    let pair = factor.solve(&[one, two], &[&still[..]; 2], 1e-4, UNWATCHED).expect("solved");
    assert_eq!(three.fields[..2], pair.fields);
    assert_eq!(three.fields[2], three.fields[0]);
    let quiet = factor.solve(&[Edges::zeros(nodes)], &[&still], 1e-4, UNWATCHED).expect("solved");
    assert_eq!((quiet.fields, quiet.residual), (vec![still], 0.0));
}

#[test]
fn only_large_framed_lattices_of_moderate_contrast_go_to_multigrid() {
    let backend = |nodes: [usize; 2], pins: Pins, first: f64| {
        let mut conductances = random_edges(nodes, || 1.0);
        conductances.vertical[2 * nodes[0] - 2] = first;
        GridLaplacian::new(nodes, conductances, pins).suits_multigrid()
    };
    let mask = |count: usize| Pins::Nodes((0..count).map(|node| node == 0).collect());
    assert!(backend([300, 300], Pins::Frame, 1.0));
    assert!(!backend([100, 100], Pins::Frame, 1.0));
    assert!(!backend([5000, 20], Pins::Frame, 1.0));
    assert!(!backend([300, 300], mask(90_000), 1.0));
    for wrong in [0.0, -1.0, 1e12, f64::NAN, f64::INFINITY] {
        assert!(!backend([300, 300], Pins::Frame, wrong), "{wrong}");
    }
}

/// A lattice whose edges across are all the same, and those down, but for those between pinned nodes.
fn even(nodes: [usize; 2], across: f64, down: f64) -> GridLaplacian {
    let mut conductances = Edges::zeros(nodes);
    conductances.horizontal.fill(across);
    conductances.vertical.fill(down);
    conductances.horizontal[0] = 7.0;
    GridLaplacian::new(nodes, conductances, Pins::Frame)
}

#[test]
fn sines_solve_what_elimination_solves() {
    for (nodes, across, down) in
        [([3, 3], 1.0, 1.0), ([3, 40], 2.0, 0.1), ([41, 4], 5.0, 3.0), ([64, 65], 1.0, 100.0), ([130, 47], 1e3, 1.0)]
    {
        let laplacian = even(nodes, across, down);
        let direct = Backend::Direct(Box::new(Cholesky::new(&laplacian, UNWATCHED).expect("positive conductances")));
        let direct = Factor { laplacian: laplacian.clone(), backend: direct };
        let sine = laplacian.factor(UNWATCHED).expect("factored");
        assert_eq!(sine.backend(), "sine");
        let fluxes = [1, 2, 3].map(|seed| random_edges(nodes, noise(seed)));
        let mut number = noise(8);
        let pinned: Vec<f64> = (0..nodes[0] * nodes[1]).map(|_| 9.0 * number()).collect();
        let [solved, exact] =
            [&sine, &direct].map(|factor| factor.solve(&fluxes, &[&pinned[..]; 3], 1.0, UNWATCHED).expect("solved"));
        assert!(solved.residual < 1e-12, "{nodes:?}: {}", solved.residual);
        for (a, b) in solved.fields.iter().flatten().zip(exact.fields.iter().flatten()) {
            assert!((a - b).abs() < 1e-9, "{nodes:?}: {a} for {b}");
        }
        assert_eq!(solved.fields[2][..nodes[0]], pinned[..nodes[0]], "the frame");
    }
}

#[test]
fn only_even_framed_lattices_go_to_sines() {
    let is_even = |change: &dyn Fn(&mut GridLaplacian)| {
        let mut laplacian = even([9, 7], 2.0, 3.0);
        change(&mut laplacian);
        laplacian.is_even()
    };
    assert!(is_even(&|_| ()));
    assert!(!is_even(&|laplacian| laplacian.conductances.horizontal[8] = 1.0));
    assert!(!is_even(&|laplacian| laplacian.conductances.vertical[7] = 1.0));
    assert!(!is_even(&|laplacian| laplacian.conductances.vertical.fill(f64::INFINITY)));
    assert!(!is_even(&|laplacian| laplacian.conductances.horizontal.fill(-1.0)));
    assert!(!is_even(&|laplacian| laplacian.pins = Pins::Nodes(vec![true; 63])));
}

/// The same bits on any count of threads, and none at all once the watch says so, however late.
#[test]
fn threads_do_not_matter_and_every_watch_is_obeyed() {
    let nodes = [90, 71];
    let (conductances, fluxes) = stiff_discs(nodes, 10.0, 2.0, 4);
    let still = vec![0.25; nodes[0] * nodes[1]];
    let factors = [
        by_multigrid(nodes, &conductances),
        factored(nodes, &conductances),
        even(nodes, 1.0, 2.0).factor(UNWATCHED).expect("factored"),
    ];
    for factor in &factors {
        let solve = |watch: Watch| factor.solve(&fluxes, &[&still[..]; 2], 1e-6, watch);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| solve(UNWATCHED)).expect("solved")
        };
        let alone = on(1);
        for threads in [2, 3, 8] {
            assert_eq!(on(threads), alone, "{} on {threads} threads", factor.backend());
        }
        let calls = AtomicUsize::new(0);
        let count = |_: f64| {
            calls.fetch_add(1, Ordering::Relaxed);
            Ok(())
        };
        solve(&count).expect("solved");
        let most = calls.load(Ordering::Relaxed);
        assert!(most > 0, "{} asks {most} times", factor.backend());
        for at in [0, most / 2, most - 1] {
            let calls = AtomicUsize::new(0);
            let stop = |_: f64| if calls.fetch_add(1, Ordering::Relaxed) >= at { Err(Interrupted) } else { Ok(()) };
            assert_eq!(solve(&stop), Err(Error::Interrupted), "{} at {at}", factor.backend());
        }
    }
}

/// Fluxes whose divergence is rounding alone are no reason to doubt a solution.
#[test]
fn what_rounding_leaves_of_large_fluxes_is_solved() {
    let nodes = [23, 17];
    let mut conductances = random_conductances(nodes, 5);
    // Fluxes of one size everywhere, but for their last bits.
    conductances.horizontal.iter_mut().chain(&mut conductances.vertical).for_each(|c| *c = c.min(2.0));
    let factor = factored(nodes, &conductances);
    let mut number = noise(9);
    let flux = random_edges(nodes, || 1e3 + 1e-12 * number());
    let solution = factor.solve(&[flux], &[&[0.0; 23 * 17]], 1e-6, UNWATCHED).expect("solved");
    assert!(largest(&solution.fields[0]) < 1e-9);
}
