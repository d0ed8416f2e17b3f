use super::*;
use crate as algo;
use crate::UNWATCHED;
use crate::view::View;

#[path = "cases.rs"]
mod cases;

use cases::{Case, Noise, owners};

const SQUARE: Lattice = Lattice { origin: [-3.0, 7.0], spacing: [4.0, 4.0], nodes: [33, 33] };

/// Neither the cells nor the rectangle are square.
const OBLONG: Lattice = Lattice { origin: [10.0, -20.0], spacing: [2.5, 6.0], nodes: [41, 25] };

/// Strengths of cells by the places of their centres, 0..1.
fn field(lattice: &Lattice, strength: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let [columns, rows] = lattice.cells();
    let at = |at: usize, count: usize| (at as f64 + 0.5) / count as f64;
    (0..columns * rows).map(|cell| strength(at(cell % columns, columns), at(cell / columns, rows))).collect()
}

fn bump(x: f64, y: f64) -> f64 {
    (-((x - 0.4).powi(2) + (y - 0.55).powi(2)) / 0.03).exp()
}

fn solved(lattice: &Lattice, strength: &[f64], method: Method, normalise: Normalise, frame: Frame) -> Magnified {
    magnify(lattice, &Wish { strength, method, normalise, frame }, UNWATCHED).expect("nobody stops it")
}

fn transported(lattice: &Lattice, strength: &[f64], frame: Frame) -> Magnified {
    solved(lattice, strength, Method::Transport, Normalise::Multiply, frame)
}

#[test]
fn smooth_fields_are_exact_whichever_way_and_whatever_the_cells() {
    for lattice in [SQUARE, OBLONG] {
        for (least, most) in [(0.0, 0.85), (0.0, -0.85), (-0.5, 0.9)] {
            let strength = field(&lattice, |x, y| least + (most - least) * bump(x, y));
            for frame in [Frame::Slide, Frame::Periodic] {
                let found = transported(&lattice, &strength, frame);
                assert!(found.largest_error < 1e-3 && found.rms_error <= found.largest_error, "{found:?}");
                assert!(found.certificate.folds == 0 && found.exponent == 1.0, "{frame:?}: {:?}", found.certificate);
                assert!((found.total_area - 1.0).abs() < 1e-12, "{}", found.total_area);
                // The score is that of the positions.
                let mean = strength.iter().map(|a| 1.0 + a).sum::<f64>() / strength.len() as f64;
                let areas = relative_areas(&lattice, &found.positions);
                let worst = areas.iter().zip(&strength).map(|(area, a)| (area * mean / (1.0 + a) - 1.0).abs());
                assert!((worst.fold(0.0, f64::max) - found.largest_error).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn equal_strengths_move_nothing() {
    let rest = Positions::from_map(&OBLONG, |p| p);
    for strength in [0.0, 3.0, -0.4, f64::NAN] {
        for method in [Method::Transport, Method::Keahey(Keahey::default())] {
            let strength = vec![strength; 40 * 24];
            let found = solved(&OBLONG, &strength, method, Normalise::Multiply, Frame::Slide);
            let apart = found.positions.x.iter().zip(&rest.x).chain(found.positions.y.iter().zip(&rest.y));
            assert!(apart.clone().all(|(a, b)| (a - b).abs() < 1e-9), "{method:?}");
        }
    }
}

#[test]
fn stripes_are_as_wide_as_they_ask() {
    // Two columns of 1 and two of 3 over 8 px: 1, 1, 3, 3 px.
    let lattice = Lattice { origin: [0.0; 2], spacing: [2.0, 5.0], nodes: [5, 3] };
    let strength = [0.0, 0.0, 2.0, 2.0].repeat(2);
    let found = transported(&lattice, &strength, Frame::Slide);
    for (x, expected) in found.positions.x.iter().zip([0.0, 1.0, 2.0, 5.0, 8.0].repeat(3)) {
        assert!((x - expected).abs() < 2e-3, "{:?}", found.positions.x);
    }
    assert_eq!(found.positions.y, Positions::from_map(&lattice, |p| p).y);
}

#[test]
fn frames_keep_to_their_place() {
    let strength = field(&OBLONG, |x, y| 3.0 * bump(x + 0.3, y));
    let rest = Positions::from_map(&OBLONG, |p| p);
    let [nodes, lines] = OBLONG.nodes;
    for (frame, method) in [
        (Frame::Slide, Method::Transport),
        (Frame::Pin, Method::Transport),
        (Frame::Slide, Method::Keahey(Keahey { levels: 3, ..Keahey::default() })),
    ] {
        let found = solved(&OBLONG, &strength, method, Normalise::Multiply, frame).positions;
        let slides = frame == Frame::Slide && method == Method::Transport;
        for node in (0..nodes * lines).filter(|at| [0, nodes - 1].contains(&(at % nodes))) {
            assert_eq!(found.x[node], rest.x[node], "{frame:?}: the left or right edge");
            assert!(slides || found.y[node] == rest.y[node], "{frame:?}");
        }
        for node in (0..nodes).chain(nodes * (lines - 1)..nodes * lines) {
            assert_eq!(found.y[node], rest.y[node], "{frame:?}: the upper or lower edge");
            assert!(slides || found.x[node] == rest.x[node], "{frame:?}");
        }
        let moved = (0..nodes * lines).any(|at| found.y[at] != rest.y[at] && at % nodes == 0);
        assert_eq!(moved, slides, "{frame:?}");
    }
}

#[test]
fn a_periodic_warp_repeats_and_moves_with_its_field() {
    let [columns, rows] = OBLONG.cells();
    let strength = field(&OBLONG, |x, y| 2.0 * bump(x, y) - 0.6 * bump(x - 0.4, y + 0.3));
    let found = transported(&OBLONG, &strength, Frame::Periodic);
    let ([nodes, _], [width, height]) = (OBLONG.nodes, OBLONG.size());
    for row in 0..=rows {
        let line = row * nodes;
        assert_eq!(found.positions.x[line + columns], found.positions.x[line] + width);
        assert_eq!(found.positions.y[line + columns], found.positions.y[line]);
    }
    for column in 0..=columns {
        assert_eq!(found.positions.x[rows * nodes + column], found.positions.x[column]);
        assert_eq!(found.positions.y[rows * nodes + column], found.positions.y[column] + height);
    }
    for [right, down] in [[1, 0], [7, 5], [columns - 1, rows - 2]] {
        let from = |cell: usize| {
            let (column, row) = (cell % columns + columns - right, cell / columns + rows - down);
            row % rows * columns + column % columns
        };
        let rolled: Vec<f64> = (0..columns * rows).map(|cell| strength[from(cell)]).collect();
        let rolled = transported(&OBLONG, &rolled, Frame::Periodic);
        let displacement = |found: &Magnified, column: usize, row: usize| {
            let (node, [x, y]) = (row * nodes + column, OBLONG.rest(column, row));
            [found.positions.x[node] - x, found.positions.y[node] - y]
        };
        for (column, row) in (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row))) {
            let here = displacement(&found, column, row);
            let there = displacement(&rolled, (column + right) % columns, (row + down) % rows);
            assert!((0..2).all(|axis| (here[axis] - there[axis]).abs() < 1e-8), "{here:?} and {there:?}");
        }
    }
}

#[test]
fn random_fields_never_fold_and_every_pixel_has_one_owner() {
    let mut whole = 0;
    for seed in 0..60 {
        let case = Case::random(seed);
        let found = case.solved();
        let violations = case.violations(&found);
        assert!(violations.is_empty(), "case {seed}, {:?}, {:?}: {violations:?}", case.look, case.frame);
        whole += usize::from(found.exponent == 1.0);
    }
    assert!((20..60).contains(&whole), "{whole} of 60 whole");
}

#[test]
fn owners_see_a_fold() {
    let lattice = Lattice { origin: [0.0; 2], spacing: [4.0; 2], nodes: [5, 5] };
    let mut positions = Positions::from_map(&lattice, |p| p);
    assert!(owners(&lattice, &positions).iter().all(|&count| count == 1));
    positions.x[12] = 15.0;
    assert!(owners(&lattice, &positions).iter().any(|&count| count != 1));
}

#[test]
fn a_disc_of_five_is_had_whole_and_one_of_a_hundred_in_part() {
    let disc = |most: f64| field(&SQUARE, |x, y| if (x - 0.5).hypot(y - 0.5) < 0.2 { most - 1.0 } else { 0.0 });
    let [five, hundred] = [5.0, 100.0].map(|most| transported(&SQUARE, &disc(most), Frame::Slide));
    assert!(five.exponent == 1.0 && five.certificate.folds == 0, "{:?} {}", five.certificate, five.exponent);
    assert!(hundred.exponent > 0.3 && hundred.exponent < 1.0 && hundred.certificate.folds == 0, "{}", hundred.exponent);
    assert!(hundred.certificate.min_jacobian > 0.0);
}

#[test]
fn a_pinned_frame_costs_areas() {
    let strength = field(&SQUARE, |x, y| 0.85 * bump(x, y));
    let found = transported(&SQUARE, &strength, Frame::Pin);
    assert!(found.certificate.folds == 0 && found.rms_error < 0.02, "{}", found.rms_error);
    assert!(found.largest_error > 1e-3, "{}", found.largest_error);
}

#[test]
fn the_relaxation_comes_nearer_and_stays_far_behind() {
    let strength = field(&SQUARE, |x, y| 0.85 * bump(x, y));
    let relaxed = |sweeps: usize, levels: usize| {
        let method = Method::Keahey(Keahey { sweeps, levels, ..Keahey::default() });
        solved(&SQUARE, &strength, method, Normalise::Multiply, Frame::Pin)
    };
    let (none, plain, levels) = (relaxed(0, 1), relaxed(30, 1), relaxed(30, 3));
    assert!(plain.rms_error < none.rms_error && levels.rms_error < plain.rms_error);
    assert_eq!((none.steps, plain.steps, levels.steps), (0, 30, 90));
    let transported = transported(&SQUARE, &strength, Frame::Slide);
    assert!(levels.rms_error > 100.0 * transported.rms_error, "{} and {}", levels.rms_error, transported.rms_error);
}

#[test]
fn one_visit_of_the_relaxation_is_the_published_one() {
    // Five by five nodes 1 px apart; only the cells around the middle ask for more, and one sweep of a small step.
    let lattice = Lattice { origin: [0.0; 2], spacing: [1.0; 2], nodes: [5, 5] };
    let mut strength = vec![0.0; 16];
    [5, 6, 9, 10].into_iter().for_each(|cell| strength[cell] = 1.0);
    let method = Method::Keahey(Keahey { sweeps: 1, refine: 0.001, limit: 0.1, weight: 0.0, levels: 1 });
    let found = solved(&lattice, &strength, method, Normalise::None, Frame::Pin).positions;
    // Visited with M = 2, the middle pushes its neighbours by 0.001 (2 - 1) 3/4 of a gap each; these, with M = 1.5, and the
    // corners, with M = 1.25, push as well: the left one along its column, at first order by 0.0005 3/4 and 0.00025 3/4.
    let left = 11;
    assert!((found.x[left] - (1.0 - 0.00075)).abs() < 1e-5, "{}", found.x[left]);
    assert!((found.y[left] - 2.0).abs() < 1e-5, "{}", found.y[left]);
    let corner = 6;
    assert!((found.x[corner] - (1.0 - 0.000375)).abs() < 1e-5, "{}", found.x[corner]);
    assert_eq!(found.x[0], 0.0);
}

#[test]
fn background_pays_for_the_strongest_where_it_can() {
    let areas = |strength: &[f64], normalise| target::target(strength, normalise).areas;
    let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
    assert!(near(&areas(&[1.0, 0.0, 0.0, 0.0], Normalise::Background), &[2.0, 2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0]));
    assert!(near(&areas(&[-0.5, 0.0], Normalise::Background), &[0.5, 1.5]));
    assert!(near(&areas(&[1.0, 0.0, 0.0, 0.0], Normalise::Multiply), &[1.6, 0.8, 0.8, 0.8]));
    assert!(near(&areas(&[1.0, 0.0, 0.0, 0.0], Normalise::Subtract), &[1.75, 0.75, 0.75, 0.75]));
    assert!(near(&areas(&[1.0, 0.0], Normalise::None), &[2.0, 1.0]));
    let fallen = target::target(&[3.0, 3.0, 0.0], Normalise::Background);
    assert_eq!(fallen.normalised, Normalise::Multiply);
    assert!(near(&fallen.areas, &[4.0 / 3.0, 4.0 / 3.0, 1.0 / 3.0]) && (fallen.mean - 3.0).abs() < 1e-12);
    let raised = target::target(&[-3.0, f64::INFINITY, 0.0], Normalise::None);
    assert!(near(&raised.areas, &[FLOOR, 1.0, 1.0]) && raised.raised == 1);
}

#[test]
fn means_weigh_pixels_by_the_part_that_a_cell_covers() {
    // Cells of 1.5 x 2 px from (-0.5, 0) on, over pixels from (0, 0) on.
    let lattice = Lattice { origin: [-0.5, 0.0], spacing: [1.5, 2.0], nodes: [4, 2] };
    let samples = [1.0, 2.0, 4.0, f32::NAN, 3.0, 6.0];
    let means = cell_means(&lattice, View::packed(&samples, 3, 2), 0, 0, UNWATCHED).expect("nobody stops it");
    // (1 + 0) / 3, (2 + 3 + 0.5 (4 + 6)) / 3, 0.5 of the last pixels and nothing beyond.
    for (mean, expected) in means.iter().zip([1.0 / 3.0, 10.0 / 3.0, 5.0 / 3.0]) {
        assert!((mean - expected).abs() < 1e-12, "{means:?}");
    }
    let away = cell_means(&lattice, View::packed(&samples, 3, 2), 9, -4, UNWATCHED).expect("nobody stops it");
    assert_eq!(away, [0.0; 3]);
    // Cells within one pixel.
    let fine = Lattice { origin: [0.25, 0.25], spacing: [0.25, 0.25], nodes: [4, 2] };
    let means = cell_means(&fine, View::packed(&samples, 3, 2), 0, 0, UNWATCHED).expect("nobody stops it");
    assert!(means.iter().all(|mean| (mean - 1.0).abs() < 1e-12), "{means:?}");
}

#[test]
fn threads_do_not_change_it() {
    let mut noise = Noise::new(3);
    let lattice = Lattice { origin: [0.0; 2], spacing: [3.0, 2.0], nodes: [80, 61] };
    let strength: Vec<f64> = (0..79 * 60).map(|_| noise.within(-0.5, 2.0)).collect();
    let run = || {
        let frames = [Frame::Slide, Frame::Pin, Frame::Periodic];
        let found = frames.map(|frame| transported(&lattice, &strength, frame).positions);
        let values = found.iter().flat_map(|found| found.x.iter().chain(&found.y));
        values.map(|value| value.to_bits()).collect::<Vec<_>>()
    };
    let expected = run();
    for threads in [1, 2, 3, 8] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        assert!(pool.install(run) == expected, "{threads} threads");
    }
}

#[test]
fn a_watch_stops_it_and_refuses_memory() {
    struct Poor;
    impl crate::Watcher for Poor {
        fn progress(&self, _: f64) -> Result<(), Interrupted> {
            Ok(())
        }
        fn go_on(&self) -> Result<(), Interrupted> {
            Ok(())
        }
        fn reserve(&self, bytes: usize) -> Result<(), Interrupted> {
            if bytes > 1000 { Err(Interrupted) } else { Ok(()) }
        }
    }
    let strength = field(&SQUARE, bump);
    for method in [Method::Transport, Method::Keahey(Keahey::default())] {
        let wish = Wish { strength: &strength, method, normalise: Normalise::Multiply, frame: Frame::Pin };
        assert!(magnify(&SQUARE, &wish, &|_: f64| Err(Interrupted)).is_err());
        assert!(magnify(&SQUARE, &wish, &Poor).is_err());
    }
}
