//! Exact features, and features on the frame.

use super::dense::{Similar, energy, minimise};
use super::*;

const BOUNDARIES: [Boundary; 3] = [Boundary::Pin, Boundary::Slide, Boundary::Free];
const EXACT: [Exact; 3] = [Exact::Off, Exact::Similarity, Exact::Rigid];
const CONFLICTS: [OnConflict; 2] = [OnConflict::NoFold, OnConflict::KeepShape];

/// 5 and 7 share nodes, 4 touches a side, 9 is in a corner of the lattice.
fn four(lattice: &Lattice) -> FeatureCells {
    let mut cells = two_blobs(lattice);
    let [columns, rows] = lattice.cells();
    cells.labels[3 * columns + 4] = 5;
    cells.labels[(rows - 1) * columns..][..2].fill(9);
    cells
}

fn nodes_of(lattice: &Lattice, cells: &FeatureCells, labels: &[u32]) -> Vec<usize> {
    let [columns, rows] = lattice.nodes;
    let is_of = |node: usize| {
        let (column, row) = (node % columns, node / columns);
        let quads = [row.checked_sub(1), (row + 1 < rows).then_some(row)].into_iter().flatten().flat_map(move |r| {
            [column.checked_sub(1), (column + 1 < columns).then_some(column)].into_iter().flatten().map(move |c| (c, r))
        });
        quads.into_iter().any(|(c, r)| labels.contains(&cells.labels[r * (columns - 1) + c]))
    };
    (0..columns * rows).filter(|&node| is_of(node)).collect()
}

fn on_frame(lattice: &Lattice, node: usize) -> bool {
    let [columns, rows] = lattice.nodes;
    node < columns || node >= columns * (rows - 1) || node.is_multiple_of(columns) || (node + 1).is_multiple_of(columns)
}

/// Every way to treat the frame and features.
fn all_ways() -> impl Iterator<Item = (Boundary, Exact, OnConflict)> {
    BOUNDARIES.into_iter().flat_map(|boundary| {
        EXACT.into_iter().flat_map(move |exact| CONFLICTS.map(|on_conflict| (boundary, exact, on_conflict)))
    })
}

/// Mean rotation of a warp on quads of some labels from their edges; after mirroring y where it is `mirrored`.
fn mean_rotation(
    lattice: &Lattice,
    cells: &FeatureCells,
    warp: &Positions,
    labels: &[u32],
    mirrored: bool,
) -> [f64; 2] {
    let sign = if mirrored { -1.0 } else { 1.0 };
    let columns = lattice.nodes[0];
    let mut sum = [0.0; 2];
    for quad in (0..cells.labels.len()).filter(|&quad| labels.contains(&cells.labels[quad])) {
        let node = quad / (columns - 1) * columns + quad % (columns - 1);
        let mean = |values: &[f64], step: usize, other: usize, size: f64| {
            (values[node + step] - values[node] + values[node + step + other] - values[node + other]) / (2.0 * size)
        };
        let across = [&warp.x, &warp.y].map(|values| mean(values, 1, columns, lattice.spacing[0]));
        let down = [&warp.x, &warp.y].map(|values| mean(values, columns, 1, lattice.spacing[1]));
        sum = [sum[0] + across[0] + sign * down[1], sum[1] + across[1] - sign * down[0]];
    }
    let length = sum[0].hypot(sum[1]);
    sum.map(|part| part / length)
}

#[test]
fn equals_the_dense_minimum_under_all_constraints() {
    for (lattice, seed, mirrored) in [(SQUARE, 3, false), (FLAT, 4, false), (FLAT, 5, true)] {
        let cells = four(&lattice);
        let mut warp = shaken(&lattice, 0.3, seed);
        warp.y.iter_mut().filter(|_| mirrored).for_each(|y| *y = -*y);
        for (boundary, exact, on_conflict) in all_ways() {
            let factor = prepared(&Structure { boundary, exact, ..structure(&lattice, &cells) });
            let rhs = rhs(&factor, &warp, &Targets { on_conflict, ..Targets::default() }, UNWATCHED).expect("asked");
            let groups: &[&[u32]] = if exact == Exact::Off { &[] } else { &[&[4], &[5, 7], &[9]] };
            let similar = groups.iter().map(|labels| {
                let follows = |node: &usize| {
                    boundary == Boundary::Free || on_conflict == OnConflict::KeepShape || !on_frame(&lattice, *node)
                };
                let nodes = nodes_of(&lattice, &cells, labels).into_iter().filter(follows).collect();
                let a = (exact == Exact::Rigid).then(|| mean_rotation(&lattice, &cells, &warp, labels, mirrored));
                Similar { nodes, mirrored, a }
            });
            let expected = minimise(&rhs.functional(), &similar.collect::<Vec<_>>());
            let result = solve(&rhs, TOLERANCE, UNWATCHED).expect("solved");
            let way = format!("{boundary:?} {exact:?} {on_conflict:?}");
            for (node, (x, y)) in result.positions.x.iter().zip(&result.positions.y).enumerate() {
                let off = (x - expected.x[node]).hypot(y - expected.y[node]);
                assert!(off < 1e-9, "{way}: node {node} is off by {off}");
            }
            assert!(result.residual < 1e-12, "{way}: {}", result.residual);
        }
    }
}

#[test]
fn whole_pictures_that_are_similar_are_reproduced_in_every_way() {
    for lattice in [SQUARE, FLAT] {
        let frame = cells_where(&lattice, |column, row| u32::from(column == 0 || row < 2) * 5);
        let all = cells_where(&lattice, |_, _| 1);
        for cells in [four(&lattice), frame, all] {
            for (boundary, exact, on_conflict) in all_ways() {
                let Ok(system) = setup(&Structure { boundary, exact, ..structure(&lattice, &cells) }, UNWATCHED) else {
                    assert!(boundary == Boundary::Free && !cells.labels.contains(&0));
                    continue;
                };
                let factor = factor(system, UNWATCHED).expect("factored");
                for (scale, degrees, mode) in
                    [(1.0, 0.0, Mode::Rigid), (1.0, 130.0, Mode::Rigid), (0.3, -75.0, Mode::Similarity)]
                {
                    if exact == Exact::Rigid && scale != 1.0 {
                        continue;
                    }
                    let warp = Positions::from_map(&lattice, similarity(scale, degrees, [100.0, -40.0]));
                    let targets = Targets { mode, on_conflict, ..Targets::default() };
                    let rhs = match rhs(&factor, &warp, &targets, UNWATCHED) {
                        Err(error) => {
                            assert_eq!((error, on_conflict), (Error::NoPins, OnConflict::KeepShape));
                            assert!(!cells.labels.contains(&0) && exact != Exact::Off);
                            continue;
                        }
                        Ok(rhs) => rhs,
                    };
                    assert_close(&solve(&rhs, TOLERANCE, UNWATCHED).expect("solved").positions, &warp, 1e-10);
                }
            }
        }
    }
}

#[test]
fn mirrors_are_reproduced_by_exact_features_too() {
    let cells = four(&FLAT);
    let turn = similarity(2.0, 30.0, [1.0, 2.0]);
    let mirror = Positions::from_map(&FLAT, |[x, y]| turn([x, -y]));
    for on_conflict in CONFLICTS {
        let factor = prepared(&Structure { exact: Exact::Similarity, ..structure(&FLAT, &cells) });
        let result = aimed(&factor, &mirror, &Targets { on_conflict, ..Targets::default() });
        assert_close(&result.positions, &mirror, 1e-10);
        assert!(result.features.iter().all(|fit| fit.mirrored && (fit.scale - 2.0).abs() < 1e-10));
    }
}

#[test]
fn exact_features_are_exact() {
    let cells = four(&SQUARE);
    let mirror = |mut p: Positions| {
        p.y.iter_mut().for_each(|y| *y = -*y);
        p
    };
    let far = |mut p: Positions| {
        p.x.iter_mut().for_each(|x| *x += 1e5);
        p
    };
    for (warp, mirrored) in [
        (shaken(&SQUARE, 0.8, 1), false),
        (mirror(shaken(&SQUARE, 0.3, 2)), true),
        (far(shaken(&SQUARE, 0.3, 2)), false),
    ] {
        for exact in [Exact::Similarity, Exact::Rigid] {
            let factor = prepared(&Structure { exact, ..structure(&SQUARE, &cells) });
            let deviations = |on_conflict| aimed(&factor, &warp, &Targets { on_conflict, ..Targets::default() });
            let stays = deviations(OnConflict::NoFold);
            let kept = deviations(OnConflict::KeepShape);
            assert_eq!((&stays.conflicts, &kept.conflicts), (&vec![4, 9], &vec![4, 9]));
            for (stays, kept) in stays.features.iter().zip(&kept.features) {
                assert!(kept.deviation_cells < 1e-9 && kept.mirrored == mirrored, "{kept:?}");
                assert_eq!(stays.deviation_cells < 1e-9, ![4, 9].contains(&stays.label), "{stays:?}");
                assert!(exact == Exact::Similarity || (kept.scale - 1.0).abs() < 1e-9, "{kept:?}");
            }
            // The merged ones are one similarity.
            let [five, seven] = [1, 2].map(|index| kept.features[index]);
            assert!((five.scale - seven.scale).abs() < 1e-9 && (five.rotation_deg - seven.rotation_deg).abs() < 1e-7);
            assert_eq!(factor.merged().collect::<Vec<_>>(), [[5, 7]]);
            for (node, (x, y)) in stays.positions.x.iter().zip(&stays.positions.y).enumerate() {
                assert!(!on_frame(&SQUARE, node) || (*x, *y) == (warp.x[node], warp.y[node]), "node {node}");
            }
        }
    }
}

#[test]
fn rigid_exact_features_take_overridden_scales() {
    let cells = four(&SQUARE);
    let factor = prepared(&Structure { exact: Exact::Rigid, ..structure(&SQUARE, &cells) });
    let overrides = [Override { label: 4, scale: Some(1.25), ..Override::default() }];
    let (warp, on_conflict) = (shaken(&SQUARE, 0.2, 9), OnConflict::KeepShape);
    for size in [1.0, 0.5] {
        let result = aimed(&factor, &warp, &Targets { overrides: &overrides, on_conflict, size, ..Targets::default() });
        for fit in result.features {
            let scale = if fit.label == 4 { 1.25 } else { 1.0 };
            assert!((fit.scale - size * scale).abs() < 1e-9 && fit.deviation_cells < 1e-9, "{fit:?}");
        }
    }
}

#[test]
fn sliding_nodes_stay_on_their_chords_and_more_freedom_costs_less() {
    let cells = four(&SQUARE);
    let warp = shaken(&SQUARE, 0.3, 6);
    let mut energies = Vec::new();
    for boundary in BOUNDARIES {
        let factor = prepared(&Structure { boundary, ..structure(&SQUARE, &cells) });
        let rhs = rhs(&factor, &warp, &Targets::default(), UNWATCHED).expect("asked");
        let result = solve(&rhs, TOLERANCE, UNWATCHED).expect("solved");
        energies.push(energy(&rhs.functional(), &result.positions));
        let moved = |node: usize| [result.positions.x[node] - warp.x[node], result.positions.y[node] - warp.y[node]];
        let features = nodes_of(&SQUARE, &cells, &[4, 9]);
        for node in (0..99).filter(|&node| on_frame(&SQUARE, node)) {
            let [x, y] = moved(node);
            let is_corner = [0, 8, 90, 98].contains(&node);
            match boundary {
                Boundary::Slide if features.contains(&node) && !is_corner => {
                    let step = if node % 9 == 0 || node % 9 == 8 { 9 } else { 1 };
                    let along = [&warp.x, &warp.y].map(|values| values[node + step] - values[node - step]);
                    assert!((x * along[1] - y * along[0]).abs() < 1e-12 && (x, y) != (0.0, 0.0), "node {node}");
                }
                Boundary::Free if features.contains(&node) => assert_ne!((x, y), (0.0, 0.0), "node {node}"),
                _ => assert_eq!((x, y), (0.0, 0.0), "{boundary:?}: node {node}"),
            }
        }
    }
    assert!(energies[0] > energies[1] + 1e-3 && energies[1] > energies[2] + 1e-3, "{energies:?}");
}

/// The neighbours of a sliding node are one point: it has no way to go.
#[test]
fn nodes_without_a_direction_stay() {
    let cells = four(&SQUARE);
    let mut warp = shaken(&SQUARE, 0.3, 6);
    let node = 8 + 6 * 9;
    (warp.x[node - 9], warp.y[node - 9]) = (warp.x[node + 9], warp.y[node + 9]);
    let factor = prepared(&Structure { boundary: Boundary::Slide, ..structure(&SQUARE, &cells) });
    let rhs = rhs(&factor, &warp, &Targets::default(), UNWATCHED).expect("asked");
    assert_eq!(rhs.functional().freedom[node], Freedom::Pinned);
    let result = solve(&rhs, TOLERANCE, UNWATCHED).expect("solved").positions;
    assert_eq!((result.x[node], result.y[node]), (warp.x[node], warp.y[node]));
    assert!(result.y.iter().all(|y| y.is_finite()));
}

#[test]
fn pictures_that_nothing_holds_are_refused() {
    let all = cells_where(&SQUARE, |_, _| 1);
    for exact in EXACT {
        for nodes in [SQUARE.nodes, [2, 2], [2, 7], [7, 2]] {
            let lattice = Lattice { nodes, ..SQUARE };
            let all = cells_where(&lattice, |_, _| 1);
            let free = Structure { boundary: Boundary::Free, exact, ..structure(&lattice, &all) };
            assert_eq!(setup(&free, UNWATCHED).err(), Some(Error::NoPins));
        }
    }
    let factor = prepared(&Structure { exact: Exact::Rigid, ..structure(&SQUARE, &all) });
    let warp = shaken(&SQUARE, 0.1, 1);
    let targets = Targets { on_conflict: OnConflict::KeepShape, ..Targets::default() };
    assert_eq!(rhs(&factor, &warp, &targets, UNWATCHED).err(), Some(Error::NoPins));
    assert!(aimed(&factor, &warp, &Targets::default()).residual < 1e-12);
}

#[test]
fn empty_masks_give_the_warp_in_every_way() {
    for nodes in [[9, 11], [2, 2], [2, 7], [7, 2]] {
        let lattice = Lattice { nodes, ..SQUARE };
        let warp = shaken(&lattice, 0.4, 3);
        let cells = cells_where(&lattice, |_, _| 0);
        for (boundary, exact, on_conflict) in all_ways() {
            let factor = prepared(&Structure { boundary, exact, ..structure(&lattice, &cells) });
            let result = aimed(&factor, &warp, &Targets { on_conflict, ..Targets::default() });
            assert_eq!((&result.positions, result.residual, factor.unknowns()), (&warp, 0.0, 0));
            assert_eq!(result.features, []);
        }
    }
}

/// All nodes of a lattice one cell wide are on its frame, and what features may do there they do.
#[test]
fn lattices_one_cell_wide_are_solved_as_others() {
    for nodes in [[2, 26], [26, 2]] {
        let lattice = Lattice { nodes, ..FLAT };
        let cells = cells_where(&lattice, |column, row| match column + row {
            6..12 => 1,
            15..18 => 2,
            _ => 0,
        });
        let warp = shaken(&lattice, 0.3, 8);
        let factor = |boundary, exact| prepared(&Structure { boundary, exact, ..structure(&lattice, &cells) });
        for (boundary, exact, on_conflict) in all_ways() {
            let way = format!("{nodes:?} {boundary:?} {exact:?} {on_conflict:?}");
            let (factor, targets) = (factor(boundary, exact), Targets { on_conflict, ..Targets::default() });
            let rhs = rhs(&factor, &warp, &targets, UNWATCHED).expect("asked");
            let follows = boundary == Boundary::Free || on_conflict == OnConflict::KeepShape;
            let labels: &[u32] = if exact != Exact::Off && follows { &[1, 2] } else { &[] };
            let similar = labels.iter().map(|&label| Similar {
                nodes: nodes_of(&lattice, &cells, &[label]),
                mirrored: false,
                a: (exact == Exact::Rigid).then(|| mean_rotation(&lattice, &cells, &warp, &[label], false)),
            });
            let expected = minimise(&rhs.functional(), &similar.collect::<Vec<_>>());
            let result = solve(&rhs, TOLERANCE, UNWATCHED).expect("solved");
            assert_close(&result.positions, &expected, 1e-9);
            let is_idle = boundary == Boundary::Pin && labels.is_empty();
            assert_eq!(result.positions == warp, is_idle, "{way}");
            let is_exact = result.features.iter().all(|fit| fit.deviation_cells < 1e-9);
            assert_eq!(is_exact, !labels.is_empty(), "{way}: {:?}", result.features);
            let held_against = exact != Exact::Off && boundary != Boundary::Free;
            assert_eq!(result.conflicts, [1, 2][..if held_against { 2 } else { 0 }], "{way}");
        }
    }
}

#[test]
fn features_that_are_one_want_one_scale() {
    let cells = four(&SQUARE);
    let warp = shaken(&SQUARE, 0.2, 9);
    let wish = |label, scale| Override { label, scale: Some(scale), ..Override::default() };
    let asked = |exact, overrides: &[Override]| {
        let factor = prepared(&Structure { exact, ..structure(&SQUARE, &cells) });
        rhs(&factor, &warp, &Targets { overrides, ..Targets::default() }, UNWATCHED).map(|_| ()).err()
    };
    let apart = |scales| Some(Error::Contradiction { labels: [5, 7], scales });
    let apart_each = [(Exact::Similarity, None), (Exact::Rigid, Some(1.0))];
    for (exact, without) in apart_each {
        assert_eq!(asked(exact, &[wish(7, 2.0), wish(5, 0.5)]), apart([Some(0.5), Some(2.0)]));
        assert_eq!(asked(exact, &[wish(7, 2.0)]), apart([without, Some(2.0)]));
        assert_eq!(asked(exact, &[wish(7, 2.0), wish(5, 2.0), wish(4, 3.0)]), None);
    }
    let rigid = Override { label: 5, mode: Some(Mode::Rigid), scale: None };
    assert_eq!(asked(Exact::Similarity, &[rigid]), apart([Some(1.0), None]));
    assert_eq!(asked(Exact::Rigid, &[rigid]), None);
    assert_eq!(asked(Exact::Off, &[wish(7, 2.0), wish(5, 0.5)]), None);
}

#[test]
fn thread_counts_do_not_change_a_bit_of_exact_features() {
    let lattice = Lattice { nodes: [31, 27], ..FLAT };
    let cells = cells_where(&lattice, |column, row| [0, 1, 0, 2, 0][(column / 4 + row / 3) % 5] * (row as u32 / 9 + 1));
    let warp = shaken(&lattice, 0.3, 7);
    let run = || {
        let way = Structure { boundary: Boundary::Slide, exact: Exact::Similarity, ..structure(&lattice, &cells) };
        aimed(&prepared(&way), &warp, &Targets::default())
    };
    let results = [1, 2, 3, 8]
        .map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool").install(run));
    for other in &results[1..] {
        assert_eq!(&results[0], other);
    }
}
