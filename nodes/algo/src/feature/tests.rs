mod dense;
mod exact;
mod wishes;

use super::components::Component;
use super::local::{Frame, Linear};
use super::*;
use crate::poisson::Pins;
use crate::view::View;
use crate::{Interrupted, UNWATCHED};
use faer::c64;

const SQUARE: Lattice = Lattice { origin: [0.0, 0.0], spacing: [1.0, 1.0], nodes: [9, 11] };
const FLAT: Lattice = Lattice { origin: [-7.5, 3.25], spacing: [3.0, 1.25], nodes: [10, 8] };

/// Numbers in -1..1, the same on every run.
fn noise(seed: u32) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 23) - 1.0
    }
}

/// The rest positions, each moved by up to `amount` cells.
fn shaken(lattice: &Lattice, amount: f64, seed: u32) -> Positions {
    let mut number = noise(seed);
    let mut positions = Positions::from_map(lattice, |p| p);
    positions.x.iter_mut().for_each(|x| *x += amount * lattice.spacing[0] * number());
    positions.y.iter_mut().for_each(|y| *y += amount * lattice.spacing[1] * number());
    positions
}

fn cells_where(lattice: &Lattice, label: impl Fn(usize, usize) -> u32) -> FeatureCells {
    let [columns, rows] = lattice.cells();
    let labels = (0..columns * rows).map(|cell| label(cell % columns, cell / columns)).collect();
    FeatureCells { labels, mixed: 0, outside: 0 }
}

/// Two blobs whose transitions meet; the second touches the frame.
fn two_blobs(lattice: &Lattice) -> FeatureCells {
    cells_where(lattice, |column, row| match (column, row) {
        (2..=3, 1..=3) => 7,
        (5..=7, 5..=6) | (6, 4) => 4,
        _ => 0,
    })
}

fn discs(lattice: &Lattice) -> FeatureCells {
    cells_where(lattice, |column, row| {
        let within = |x: f64, y: f64, radius: f64| (column as f64 - x).hypot(row as f64 - y) <= radius;
        if within(10.0, 10.0, 5.3) { 1 } else { 2 * u32::from(within(28.0, 21.0, 4.3)) }
    })
}

/// As in the paper.
fn structure<'a>(lattice: &'a Lattice, cells: &'a FeatureCells) -> Structure<'a> {
    let (boundary, exact) = (Boundary::Pin, Exact::Off);
    Structure { lattice, cells, weight: 10.0, weights: &[], soft: None, radius: 2.0, boundary, exact }
}

fn prepared(structure: &Structure) -> FeatureFactor {
    factor(setup(structure, UNWATCHED).expect("set up"), UNWATCHED).expect("factored")
}

fn factored(lattice: &Lattice, cells: &FeatureCells, weight: f64, radius: f64) -> FeatureFactor {
    prepared(&Structure { weight, radius, ..structure(lattice, cells) })
}

/// Largest distance to the exact solution, px.
const TOLERANCE: f64 = 1e-12;

fn aimed(factor: &FeatureFactor, warp: &Positions, targets: &Targets) -> FeatureWarp {
    solve(&rhs(factor, warp, targets, UNWATCHED).expect("finite"), TOLERANCE, UNWATCHED).expect("solved")
}

fn solved(factor: &FeatureFactor, warp: &Positions, mode: Mode) -> FeatureWarp {
    aimed(factor, warp, &Targets { mode, ..Targets::default() })
}

fn assert_close(a: &Positions, b: &Positions, tolerance: f64) {
    for (node, (a, b)) in a.x.iter().zip(&b.x).chain(a.y.iter().zip(&b.y)).enumerate() {
        assert!((a - b).abs() <= tolerance, "value {node}: {a} for {b}");
    }
}

/// A border that no feature meets stays as it is, whatever features may do on it.
#[test]
fn a_border_without_features_is_the_frame() {
    let lattice = Lattice { nodes: [40, 32], ..SQUARE };
    let (inside, meeting) = (discs(&lattice), cells_where(&lattice, |column, row| u32::from(column < 3 && row == 9)));
    for boundary in [Boundary::Pin, Boundary::Slide, Boundary::Free] {
        let pins = |cells| {
            let system = setup(&Structure { boundary, ..structure(&lattice, cells) }, UNWATCHED).expect("set up");
            system.laplacian.pins().clone()
        };
        assert_eq!(pins(&inside), Pins::Frame, "{boundary:?}");
        assert_eq!(pins(&meeting) == Pins::Frame, boundary == Boundary::Pin, "{boundary:?}");
    }
}

/// The map `z -> s z + t`, turned clockwise on screen.
fn similarity(scale: f64, degrees: f64, shift: [f64; 2]) -> impl Fn([f64; 2]) -> [f64; 2] {
    let (sin, cos) = degrees.to_radians().sin_cos();
    move |[x, y]| [scale * (cos * x - sin * y) + shift[0], scale * (sin * x + cos * y) + shift[1]]
}

/// The least squares system as printed, dense, with no closed form shared with the solver.
mod literal {
    use super::*;

    type Matrix = [[f64; 2]; 2];

    fn multiply(a: Matrix, b: Matrix) -> Matrix {
        [0, 1].map(|i| [0, 1].map(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
    }

    fn corners(quad: usize, columns: usize) -> [usize; 4] {
        let node = quad / (columns - 1) * columns + quad % (columns - 1);
        [node, node + 1, node + columns + 1, node + columns]
    }

    fn determinant(m: Matrix) -> f64 {
        m[0][0] * m[1][1] - m[0][1] * m[1][0]
    }

    /// Equation 1: `U' U^T (U U^T)^-1` over the centred corners.
    fn linear_part(rest: &Positions, warp: &Positions, corners: [usize; 4]) -> Matrix {
        let centred = |p: &Positions| {
            [&p.x, &p.y].map(|values| {
                let mean = corners.iter().map(|&node| values[node]).sum::<f64>() / 4.0;
                corners.map(|node| values[node] - mean)
            })
        };
        let (u, v) = (centred(rest), centred(warp));
        let gram = |a: &[[f64; 4]; 2]| [0, 1].map(|i| [0, 1].map(|j| (0..4).map(|k| a[i][k] * u[j][k]).sum::<f64>()));
        let uu: Matrix = gram(&u);
        let inverse = [[uu[1][1], -uu[0][1]], [-uu[1][0], uu[0][0]]].map(|row| row.map(|x| x / determinant(uu)));
        multiply(gram(&v), inverse)
    }

    /// One-sided Jacobi: the rotation next to `t` and its smaller singular value, negative where `t` turns over.
    fn rotation_and_scale(t: Matrix) -> (Matrix, f64) {
        let column = |m: Matrix, j: usize| [m[0][j], m[1][j]];
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let (first, second) = (column(t, 0), column(t, 1));
        let angle = 0.5 * (2.0 * dot(first, second)).atan2(dot(first, first) - dot(second, second));
        let v = [[angle.cos(), -angle.sin()], [angle.sin(), angle.cos()]];
        let us = multiply(t, v);
        let sigma = [0, 1].map(|j| dot(column(us, j), column(us, j)).sqrt());
        assert!(sigma[0] >= sigma[1], "sorted by the choice of the angle");
        let flip = determinant(t).signum();
        let large = column(us, 0).map(|x| x / sigma[0]);
        // The left vectors with determinant 1: the column of the smaller value is turned over where need be.
        let u = [[large[0], -large[1]], [large[1], large[0]]];
        (multiply(u, [[v[0][0], v[1][0]], [v[0][1], v[1][1]]]), flip * sigma[1])
    }

    /// Distance to the union of the feature squares, and the lowest label at that distance.
    fn nearest(labels: &[u32], columns: usize, quad: usize) -> (f64, u32) {
        let gap = |a: usize, b: usize| (a.abs_diff(b) as f64 - 0.5).max(0.0);
        let distance = |other: usize| gap(quad % columns, other % columns).hypot(gap(quad / columns, other / columns));
        let found = (0..labels.len()).filter(|&other| labels[other] != 0).map(|other| (distance(other), labels[other]));
        found.fold(
            (f64::INFINITY, u32::MAX),
            |a, b| {
                if b.0 < a.0 - 1e-9 || (b.0 < a.0 + 1e-9 && b.1 < a.1) { b } else { a }
            },
        )
    }

    pub fn solve(structure: &Structure, warp: &Positions, targets: &Targets) -> Positions {
        let Structure { lattice, cells: FeatureCells { labels, .. }, radius, .. } = *structure;
        let columns = lattice.nodes[0];
        let rest = Positions::from_map(lattice, |p| p);
        let scale = |label: u32| {
            let own = (0..labels.len()).filter(|&quad| labels[quad] == label);
            let values: Vec<f64> = own
                .map(|quad| rotation_and_scale(linear_part(&rest, warp, corners(quad, columns))).1.max(0.0))
                .collect();
            let wish = targets.overrides.iter().find(|wish| wish.label == label);
            let of_the_warp = || (values.iter().sum::<f64>() / values.len() as f64).max(1e-3);
            let mode = wish.and_then(|wish| wish.mode).unwrap_or(targets.mode);
            let usual = if mode == Mode::Rigid { 1.0 } else { of_the_warp() };
            targets.size * wish.and_then(|wish| wish.scale).unwrap_or(usual)
        };
        let weight_of =
            |label: u32| structure.weights.iter().find(|own| own.0 == label).map_or(structure.weight, |own| own.1);
        let mut equations = Vec::new();
        for quad in 0..labels.len() {
            let (distance, label) = nearest(labels, columns - 1, quad);
            let t = distance / radius;
            let f = if distance == 0.0 { 1.0 } else { 2.0 * t.powi(3) - 3.0 * t.powi(2) + 1.0 };
            let follows = distance == 0.0 || distance < radius;
            let part = structure.soft.filter(|_| distance == 0.0).map_or(f, |soft| soft[quad]);
            let w = if follows { weight_of(label) * part + 1.0 * (1.0 - part) } else { 1.0 };
            let corners = corners(quad, columns);
            let (rotation, _) = rotation_and_scale(linear_part(&rest, warp, corners));
            for k in 0..4 {
                let (p, q) = (corners[k], corners[(k + 1) % 4]);
                let edge = |of: &Positions| [of.x[q] - of.x[p], of.y[q] - of.y[p]];
                let e = edge(&rest);
                let turned =
                    [0, 1].map(|i| scale(label.min(1 << 30)) * (rotation[i][0] * e[0] + rotation[i][1] * e[1]));
                let share = if targets.blend { f } else { 1.0 };
                let wanted = [0, 1].map(|i| share * turned[i] + (1.0 - share) * edge(warp)[i]);
                let image = if follows { wanted } else { edge(warp) };
                equations.push((w, p, q, image));
            }
        }
        let [x, y] = [0, 1].map(|axis| {
            let given = if axis == 0 { &warp.x } else { &warp.y };
            let rows: Vec<_> = equations.iter().map(|&(w, p, q, image)| (w, p, q, image[axis])).collect();
            let free = (0..given.len()).filter(|&node| is_free(structure, node)).collect();
            least_squares(free, &rows, given)
        });
        Positions { x, y }
    }

    /// Off the frame, or at a feature where that frees nodes of the frame.
    fn is_free(structure: &Structure, node: usize) -> bool {
        let [columns, rows] = structure.lattice.nodes;
        let (column, row) = (node % columns, node / columns);
        let inside = column > 0 && row > 0 && column + 1 < columns && row + 1 < rows;
        let mut quads = (0..(columns - 1) * (rows - 1)).filter(|&quad| corners(quad, columns).contains(&node));
        inside || structure.boundary == Boundary::Free && quads.any(|quad| structure.cells.labels[quad] != 0)
    }

    /// Dense A over all nodes, columns of those that are not free moved to the right, `A^T A x = A^T b` by
    /// elimination.
    fn least_squares(free: Vec<usize>, equations: &[(f64, usize, usize, f64)], given: &[f64]) -> Vec<f64> {
        let (a, b): (Vec<Vec<f64>>, Vec<f64>) = equations
            .iter()
            .map(|&(w, p, q, image)| {
                let mut full = vec![0.0; given.len()];
                full[p] -= w;
                full[q] += w;
                let pinned: f64 =
                    (0..given.len()).filter(|node| !free.contains(node)).map(|node| full[node] * given[node]).sum();
                (free.iter().map(|&node| full[node]).collect::<Vec<f64>>(), w * image - pinned)
            })
            .unzip();
        let n = free.len();
        let sum = |f: &dyn Fn(usize) -> f64| (0..a.len()).map(f).sum::<f64>();
        let mut m: Vec<Vec<f64>> = (0..n)
            .map(|i| (0..n).map(|j| sum(&|e| a[e][i] * a[e][j])).chain([sum(&|e| a[e][i] * b[e])]).collect())
            .collect();
        for pivot in 0..n {
            for row in 0..n {
                if row != pivot {
                    let factor = m[row][pivot] / m[pivot][pivot];
                    (pivot..=n).for_each(|column| m[row][column] -= factor * m[pivot][column]);
                }
            }
        }
        let mut result = given.to_vec();
        free.iter().enumerate().for_each(|(i, &node)| result[node] = m[i][n] / m[i][i]);
        result
    }
}

#[test]
fn equals_the_literal_least_squares_system() {
    let cases = [(SQUARE, 10.0, 2.0), (SQUARE, 10.0, 0.0), (SQUARE, 1.0, 2.0), (FLAT, 7.0, 2.6), (FLAT, 30.0, 1.0)];
    for (case, (lattice, weight, radius)) in cases.into_iter().enumerate() {
        let cells = two_blobs(&lattice);
        let factor = factored(&lattice, &cells, weight, radius);
        for (amount, seed) in [(0.2, 1), (0.7, 9)] {
            let warp = shaken(&lattice, amount, seed + case as u32);
            for mode in [Mode::Similarity, Mode::Rigid] {
                let structure = Structure { weight, radius, ..structure(&lattice, &cells) };
                let expected = literal::solve(&structure, &warp, &Targets { mode, ..Targets::default() });
                let result = solved(&factor, &warp, mode);
                assert_close(&result.positions, &expected, 1e-11);
                assert!(result.residual <= 1e-13, "{}", result.residual);
            }
        }
    }
}

#[test]
fn identity_similarities_and_rigid_motions_are_reproduced() {
    let frame = |column: usize, row: usize| u32::from(column == 0 || row < 2) * 5;
    for lattice in [SQUARE, FLAT] {
        for cells in [two_blobs(&lattice), cells_where(&lattice, frame), cells_where(&lattice, |_, _| 1)] {
            let factor = factored(&lattice, &cells, 10.0, 2.0);
            for (scale, degrees, mode) in [
                (1.0, 0.0, Mode::Similarity),
                (1.0, 0.0, Mode::Rigid),
                (1.0, 130.0, Mode::Rigid),
                (0.3, -75.0, Mode::Similarity),
                (5.0, 180.0, Mode::Similarity),
            ] {
                let warp = Positions::from_map(&lattice, similarity(scale, degrees, [100.0, -40.0]));
                let result = solved(&factor, &warp, mode);
                assert_close(&result.positions, &warp, 1e-11);
                for fit in result.features {
                    assert!(fit.deviation_cells < 1e-11 && !fit.mirrored, "{fit:?}");
                    assert!((fit.scale - scale).abs() < 1e-11, "{fit:?}");
                    assert!((fit.rotation_deg.abs() - f64::abs(degrees)).abs() < 1e-9, "{fit:?}");
                    assert!(degrees == 180.0 || (fit.rotation_deg - degrees).abs() < 1e-9, "{fit:?}");
                }
            }
        }
    }
}

#[test]
fn mirrors_are_reproduced() {
    let factor = factored(&FLAT, &two_blobs(&FLAT), 10.0, 2.0);
    let turn = similarity(2.0, 30.0, [1.0, 2.0]);
    let mirror = Positions::from_map(&FLAT, |[x, y]| turn([x, -y]));
    let result = solved(&factor, &mirror, Mode::Similarity);
    assert_close(&result.positions, &mirror, 1e-11);
    for fit in result.features {
        assert!(fit.mirrored && (fit.scale - 2.0).abs() < 1e-11 && (fit.rotation_deg - 30.0).abs() < 1e-9, "{fit:?}");
    }
}

#[test]
fn mirroring_the_warp_mirrors_the_result() {
    let factor = factored(&FLAT, &two_blobs(&FLAT), 10.0, 2.0);
    let warp = shaken(&FLAT, 0.4, 21);
    let mirror = |p: Positions| Positions { x: p.x.into_iter().map(|x| -x).collect(), y: p.y };
    for mode in [Mode::Similarity, Mode::Rigid] {
        let expected = mirror(solved(&factor, &warp, mode).positions);
        assert_close(&solved(&factor, &mirror(warp.clone()), mode).positions, &expected, 1e-11);
    }
}

#[test]
fn collapsing_warps_give_finite_results() {
    let cells = two_blobs(&SQUARE);
    let factor = factored(&SQUARE, &cells, 10.0, 2.0);
    let point = Positions::from_map(&SQUARE, |_| [3.0, 4.0]);
    // Features keep a thousandth of their size.
    let result = solved(&factor, &point, Mode::Similarity);
    assert!(result.features.iter().all(|fit| (1e-5..1.001e-3).contains(&fit.scale)), "{:?}", result.features);
    for mode in [Mode::Similarity, Mode::Rigid] {
        for map in [|_| [3.0, 4.0], |[x, _]: [f64; 2]| [x, 0.0], |[_, y]: [f64; 2]| [2.0 * y, -y]] {
            let result = solved(&factor, &Positions::from_map(&SQUARE, map), mode);
            assert!(result.positions.x.iter().chain(&result.positions.y).all(|value| value.is_finite()));
        }
    }
}

#[test]
fn a_quad_without_rotation_takes_the_mean_of_its_component() {
    let lattice = Lattice { nodes: [3, 2], ..SQUARE };
    let component = Component { label: 1, quads: vec![0, 1], nodes: Vec::new() };
    let mirrored = Linear::of(&lattice, &Positions::from_map(&lattice, |[x, y]| [x, -y]), 0);
    let edges = |map: fn([f64; 2]) -> [f64; 2]| {
        Frame::of(&lattice, &Positions::from_map(&lattice, map), &component, Some(1.0), UNWATCHED)
            .expect("framed")
            .edges(&mirrored, [1.0, 1.0])
    };
    let [i, one] = [c64::new(0.0, 1.0), c64::new(1.0, 0.0)];
    assert_eq!(edges(|[x, y]| [-y, x]), [i, -one]);
    assert_eq!(edges(|_| [5.0, 5.0]), [one, i]);
}

#[test]
fn without_features_the_warp_comes_back_bit_for_bit() {
    let mut warp = shaken(&SQUARE, 3.0, 5);
    warp.x[40] = -0.0;
    let factor = factored(&SQUARE, &cells_where(&SQUARE, |_, _| 0), 10.0, 2.0);
    let result = solved(&factor, &warp, Mode::Rigid);
    let bits = |p: &Positions| p.x.iter().chain(&p.y).map(|value| value.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&result.positions), bits(&warp));
    assert_eq!((result.residual, result.features.len(), factor.unknowns()), (0.0, 0, 0));
}

#[test]
fn without_interior_the_warp_comes_back_from_its_border() {
    for nodes in [[2, 2], [2, 7], [7, 2]] {
        let lattice = Lattice { nodes, ..SQUARE };
        let warp = shaken(&lattice, 0.4, 3);
        let result = solved(&factored(&lattice, &cells_where(&lattice, |_, _| 9), 10.0, 2.0), &warp, Mode::Rigid);
        assert_eq!((&result.positions, result.features[0].label), (&warp, 9));
    }
}

#[test]
fn the_weight_cancels_when_all_is_feature() {
    let warp = shaken(&SQUARE, 0.4, 8);
    let all = cells_where(&SQUARE, |_, _| 1);
    let [light, heavy] = [1.0, 50.0].map(|weight| solved(&factored(&SQUARE, &all, weight, 2.0), &warp, Mode::Rigid));
    assert_close(&light.positions, &heavy.positions, 1e-11);
    assert!(light.features[0].deviation_cells > 0.01);
}

#[test]
fn heavier_features_are_nearer_to_similarities() {
    let lattice = Lattice { nodes: [41, 33], ..SQUARE };
    let cells = discs(&lattice);
    for (stretch, limit) in [(2.0, 0.15), (0.6, 0.05)] {
        let warp = Positions::from_map(&lattice, |[x, y]| [stretch * x, y]);
        let fits =
            |weight, radius| solved(&factored(&lattice, &cells, weight, radius), &warp, Mode::Similarity).features;
        let itself = factored(&lattice, &cells, 1.0, 0.0).fits(&warp, UNWATCHED).expect("fitted");
        let (light, sharp, smooth) = (fits(1.0, 2.0), fits(10.0, 0.0), fits(10.0, 2.0));
        for k in 0..2 {
            let deviations = [&itself, &light, &sharp, &smooth].map(|fits| fits[k].deviation_cells);
            let [itself, light, sharp, smooth] = deviations;
            assert!(itself > light && light > 5.0 * smooth && smooth > sharp && smooth < limit, "{deviations:?}");
        }
        for fit in smooth {
            assert!(fit.rotation_deg.abs() < 1.0 && (fit.scale - f64::min(stretch, 1.0)).abs() < 0.1, "{fit:?}");
        }
    }
}

#[test]
fn moving_and_turning_the_warp_moves_and_turns_the_result() {
    let factor = factored(&FLAT, &two_blobs(&FLAT), 10.0, 2.0);
    let warp = shaken(&FLAT, 0.3, 12);
    for (degrees, shift) in [(0.0, [1000.0, -20.0]), (37.0, [0.0, 0.0]), (-120.0, [5.0, 6.0])] {
        let motion = similarity(1.0, degrees, shift);
        let moved = |p: &Positions| {
            let (x, y) = p.x.iter().zip(&p.y).map(|(&x, &y)| motion([x, y])).map(|[x, y]| (x, y)).unzip();
            Positions { x, y }
        };
        for mode in [Mode::Similarity, Mode::Rigid] {
            let expected = moved(&solved(&factor, &warp, mode).positions);
            assert_close(&solved(&factor, &moved(&warp), mode).positions, &expected, 1e-10);
        }
    }
}

/// Labels name components and nothing else: any numbers in the same order give the same bits.
#[test]
fn the_numbers_of_the_labels_do_not_matter() {
    let cells = two_blobs(&SQUARE);
    let mut renamed = cells.clone();
    renamed.labels.iter_mut().for_each(|label| *label = [0, 1, u32::MAX][(*label as usize).div_ceil(4)]);
    let warp = shaken(&SQUARE, 0.3, 2);
    let [a, b] = [cells, renamed].map(|cells| solved(&factored(&SQUARE, &cells, 10.0, 2.0), &warp, Mode::Similarity));
    assert_eq!(a.positions, b.positions);
    assert_eq!([a.features[0].label, a.features[1].label], [4, 7]);
    assert_eq!([b.features[0].label, b.features[1].label], [1, u32::MAX]);
}

#[test]
fn a_warp_that_is_not_finite_names_its_first_node() {
    let factor = factored(&SQUARE, &two_blobs(&SQUARE), 10.0, 2.0);
    let mut warp = shaken(&SQUARE, 0.1, 1);
    warp.x[80] = f64::NAN;
    warp.y[2 * 9 + 5] = f64::INFINITY;
    let error = rhs(&factor, &warp, &Targets::default(), UNWATCHED).err();
    assert_eq!(error, Some(Error::NotFinite { column: 5, row: 2 }));
}

#[test]
fn watches_stop_it() {
    let stop = |_| Err(Interrupted);
    let cells = two_blobs(&SQUARE);
    let system = setup(&structure(&SQUARE, &cells), UNWATCHED).expect("set up");
    assert_eq!(factor(system, &stop).err(), Some(Error::Poisson(poisson::Error::Interrupted)));
    let factor = factored(&SQUARE, &two_blobs(&SQUARE), 10.0, 2.0);
    let warp = shaken(&SQUARE, 0.1, 1);
    let rhs = rhs(&factor, &warp, &Targets::default(), UNWATCHED).expect("finite");
    assert_eq!(solve(&rhs, TOLERANCE, &stop).err(), Some(Error::Poisson(poisson::Error::Interrupted)));
}

#[test]
fn thread_counts_do_not_change_a_bit() {
    let lattice = Lattice { origin: [3.0, 2.0], spacing: [2.5, 3.5], nodes: [61, 47] };
    let labels: Vec<u32> =
        (0..160 * 170).map(|pixel| [0, 0, 3, 0, 2, 0, 0][(pixel % 160 / 20 + pixel / 3200) % 7]).collect();
    let warp = shaken(&lattice, 0.4, 77);
    let run = || {
        let cells = feature_cells(&lattice, View::packed(&labels, 160, 170), 1, -1, UNWATCHED).expect("labelled");
        let result = solved(&factored(&lattice, &cells, 10.0, 4.0), &warp, Mode::Similarity);
        (cells, result)
    };
    let results = [1, 2, 3, 8]
        .map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool").install(run));
    assert!(results[0].0.labels.contains(&2) && results[0].1.features.len() == 2);
    for other in &results[1..] {
        assert_eq!(&results[0], other);
    }
}
