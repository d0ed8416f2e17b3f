//! Weights, coverage, modes and scales feature by feature.

use super::*;

fn wish(label: u32, mode: Option<Mode>, scale: Option<f64>) -> Override {
    Override { label, mode, scale }
}

#[test]
fn all_wishes_equal_the_literal_system() {
    for (lattice, seed) in [(SQUARE, 1), (FLAT, 2)] {
        let cells = two_blobs(&lattice);
        let mut number = noise(5);
        let soft: Vec<f64> = cells.labels.iter().map(|_| number().abs()).collect();
        let warp = shaken(&lattice, 0.3, seed);
        let plain = structure(&lattice, &cells);
        let overrides = [wish(7, Some(Mode::Rigid), None), wish(4, None, Some(1.2))];
        for structure in [
            Structure { weights: &[(7, 40.0), (11, 3.0)], radius: 3.5, ..plain },
            Structure { soft: Some(&soft), ..plain },
            Structure { boundary: Boundary::Free, weight: 3.0, ..plain },
        ] {
            let factor = prepared(&structure);
            for targets in [
                Targets { overrides: &overrides, ..Targets::default() },
                Targets { blend: true, mode: Mode::Rigid, ..Targets::default() },
                Targets { size: 0.7, overrides: &overrides[1..], ..Targets::default() },
            ] {
                let expected = literal::solve(&structure, &warp, &targets);
                assert_close(&aimed(&factor, &warp, &targets).positions, &expected, 1e-10);
            }
        }
    }
}

/// One factor, made once, gives for any warp and wish what a factor made for it alone gives.
#[test]
fn a_factor_serves_any_warp_and_wish() {
    let cells = two_blobs(&SQUARE);
    for (boundary, exact) in [(Boundary::Pin, Exact::Off), (Boundary::Slide, Exact::Similarity)] {
        let structure = Structure { boundary, exact, ..structure(&SQUARE, &cells) };
        let shared = prepared(&structure);
        let overrides = [wish(4, Some(Mode::Rigid), None)];
        let on_conflict = OnConflict::KeepShape;
        for (warp, targets) in [
            (shaken(&SQUARE, 0.3, 1), Targets::default()),
            (Positions::from_map(&SQUARE, |[x, y]| [2.0 * x, y]), Targets { mode: Mode::Rigid, ..Targets::default() }),
            (
                shaken(&SQUARE, 0.6, 2),
                Targets { overrides: &overrides, blend: true, on_conflict, ..Targets::default() },
            ),
            (shaken(&SQUARE, 0.3, 1), Targets::default()),
        ] {
            assert_eq!(aimed(&shared, &warp, &targets), aimed(&prepared(&structure), &warp, &targets));
        }
    }
}

#[test]
fn scales_go_before_modes_and_labels_without_cells_are_passed_over() {
    let cells = discs(&Lattice { nodes: [41, 33], ..SQUARE });
    let lattice = Lattice { nodes: [41, 33], ..SQUARE };
    let factor = factored(&lattice, &cells, 100.0, 0.0);
    let warp = Positions::from_map(&lattice, |[x, y]| [0.6 * x, y]);
    let scales = |overrides: &[Override]| {
        aimed(&factor, &warp, &Targets { overrides, ..Targets::default() }).features.iter().map(|f| f.scale).collect()
    };
    let near = |scales: Vec<f64>, expected: [f64; 2]| {
        assert!(scales.iter().zip(expected).all(|(scale, expected)| (scale - expected).abs() < 0.02), "{scales:?}");
    };
    near(scales(&[]), [0.6, 0.6]);
    near(scales(&[wish(2, Some(Mode::Rigid), None)]), [0.6, 1.0]);
    near(scales(&[wish(2, Some(Mode::Rigid), Some(0.8)), wish(2, None, Some(3.0))]), [0.6, 0.8]);
    near(scales(&[wish(3, Some(Mode::Rigid), Some(9.0))]), [0.6, 0.6]);
}

/// Without coverage a feature weighs as little as the rest; with all of it, as if there were no mask.
#[test]
fn coverage_goes_from_no_weight_to_all_of_it() {
    let cells = two_blobs(&SQUARE);
    let warp = shaken(&SQUARE, 0.3, 4);
    let with = |weight, soft: Option<f64>| {
        let soft = soft.map(|coverage| vec![coverage; cells.labels.len()]);
        let structure = Structure { weight, soft: soft.as_deref(), radius: 0.0, ..structure(&SQUARE, &cells) };
        aimed(&prepared(&structure), &warp, &Targets::default()).positions
    };
    assert_eq!(with(10.0, Some(1.0)), with(10.0, None));
    assert_eq!(with(10.0, Some(0.0)), with(1.0, None));
    assert_eq!(with(10.0, Some(0.5)), with(5.5, None));
}
