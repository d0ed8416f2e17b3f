use super::*;
use crate::UNWATCHED;
use faer::linalg::solvers::Solve;

const SQUARE: Lattice = Lattice { origin: [3.0, -7.5], spacing: [4.0, 4.0], nodes: [13, 9] };
const FLAT: Lattice = Lattice { origin: [-20.0, 11.0], spacing: [5.5, 1.25], nodes: [7, 11] };
const CELL: Lattice = Lattice { origin: [0.0, 0.0], spacing: [3.0, 2.0], nodes: [2, 2] };
const MODES: [Mode; 2] = [Mode::Similarity, Mode::Rigid];

/// Numbers in 0..1, the same on every run.
fn noise(seed: u32) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24)
    }
}

fn prepared(lattice: &Lattice) -> HandleFactor {
    factor(lattice, UNWATCHED).expect("factored")
}

fn dragged(factor: &HandleFactor, handles: &[Handle], mode: Mode) -> Result<HandleWarp, Error> {
    drag(factor, None, handles, mode, UNWATCHED).map(|(warp, _)| warp)
}

fn solved(factor: &HandleFactor, handles: &[Handle], mode: Mode) -> HandleWarp {
    dragged(factor, handles, mode).expect("solved")
}

/// A point by shares of the lattice's size.
fn inside(lattice: &Lattice, shares: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|axis| lattice.origin[axis] + shares[axis] * lattice.size()[axis])
}

/// Handles at random places, moved by up to `by` of the lattice's size.
fn scattered(lattice: &Lattice, count: usize, by: f64, seed: u32) -> Vec<Handle> {
    let mut number = noise(seed);
    (0..count)
        .map(|_| {
            let from = inside(lattice, [number(), number()]);
            Handle { from, to: [0, 1].map(|axis| from[axis] + by * (number() - 0.5) * lattice.size()[axis]) }
        })
        .collect()
}

fn complex([x, y]: [f64; 2]) -> c64 {
    c64::new(x, y)
}

fn at(positions: &Positions, node: usize) -> c64 {
    c64::new(positions.x[node], positions.y[node])
}

fn rest(lattice: &Lattice, node: usize) -> c64 {
    complex(lattice.rest(node % lattice.nodes[0], node / lattice.nodes[0]))
}

fn assert_near(lattice: &Lattice, positions: &Positions, tolerance: f64, expected: impl Fn(usize) -> c64) {
    for node in 0..lattice.node_count() {
        let error = (at(positions, node) - expected(node)).modulus();
        assert!(error <= tolerance, "node {node} of {lattice:?} is off by {error}");
    }
}

#[test]
fn a_wrong_factor_gives_no_warp() {
    let mut factor = prepared(&SQUARE);
    let handles = scattered(&SQUARE, 5, 0.4, 2);
    assert!(dragged(&factor, &handles, Mode::Rigid).is_ok());
    factor.rigid.values.iter_mut().step_by(7).for_each(|value| *value *= 3.0);
    let solved = dragged(&factor, &handles, Mode::Rigid);
    assert!(matches!(solved, Err(Error::Inaccurate { .. })), "{solved:?}");
}

#[test]
fn without_a_move_nothing_moves() {
    for lattice in [SQUARE, FLAT, CELL] {
        let factor = prepared(&lattice);
        let still: Vec<Handle> =
            scattered(&lattice, 6, 0.0, 1).into_iter().map(|h| Handle { to: h.from, ..h }).collect();
        for (mode, handles) in MODES.into_iter().flat_map(|mode| [(mode, &still[..0]), (mode, &still[..])]) {
            let warp = solved(&factor, handles, mode);
            assert_eq!(warp.positions, Positions::from_map(&lattice, |p| p));
            assert_eq!((warp.residual, warp.largest_miss, warp.constraints), (0.0, 0.0, handles.len()));
        }
    }
}

#[test]
fn one_handle_moves_the_whole() {
    let from = inside(&FLAT, [0.3, 0.6]);
    for mode in MODES {
        let warp = solved(&prepared(&FLAT), &[Handle { from, to: [from[0] + 2.0, from[1] - 8.0] }], mode);
        assert_eq!(warp.positions, Positions::from_map(&FLAT, |[x, y]| [x + 2.0, y - 8.0]));
    }
}

#[test]
fn two_handles_give_the_similarity_through_them() {
    for lattice in [SQUARE, FLAT, CELL] {
        for seed in 0..8 {
            let handles = scattered(&lattice, 2, 1.5, seed);
            let warp = solved(&prepared(&lattice), &handles, Mode::Similarity);
            let [p, q] = [handles[0], handles[1]].map(|handle| complex(handle.from));
            let [s, t] = [handles[0], handles[1]].map(|handle| complex(handle.to));
            let turn = (t - s) / (q - p);
            let size = lattice.size()[0].max(lattice.size()[1]) * (1.0 + turn.modulus());
            assert_near(&lattice, &warp.positions, 1e-12 * size, |node| s + turn * (rest(&lattice, node) - p));
        }
    }
}

#[test]
fn what_is_implied_is_delivered() {
    for lattice in [SQUARE, FLAT] {
        let factor = prepared(&lattice);
        for (mode, turn) in [(Mode::Similarity, c64::new(-1.3, 2.2)), (Mode::Rigid, c64::new(-0.6, 0.8))] {
            let map = |p: c64| turn * p + c64::new(31.0, -4.0);
            let moved = |handle: Handle| {
                let to = map(complex(handle.from));
                Handle { to: [to.re, to.im], ..handle }
            };
            let handles: Vec<Handle> = scattered(&lattice, 9, 0.0, 3).into_iter().map(moved).collect();
            let warp = solved(&factor, &handles, mode);
            assert_near(&lattice, &warp.positions, 1e-10, |node| map(rest(&lattice, node)));
            assert!(warp.rank == 9 && warp.residual < 1e-12, "{warp:?}");
        }
    }
}

#[test]
fn turned_and_grown_targets_turn_and_grow_the_warp() {
    let factor = prepared(&FLAT);
    let handles = scattered(&FLAT, 7, 0.6, 5);
    for (mode, turn) in [(Mode::Similarity, c64::new(0.7, 1.9)), (Mode::Rigid, c64::new(0.28, -0.96))] {
        let map = |p: c64| turn * p + c64::new(-9.0, 2.0);
        let moved = |handle: &Handle| {
            let to = map(complex(handle.to));
            Handle { to: [to.re, to.im], ..*handle }
        };
        let plain = solved(&factor, &handles, mode);
        let turned = solved(&factor, &handles.iter().map(moved).collect::<Vec<_>>(), mode);
        assert_near(&FLAT, &turned.positions, 1e-9, |node| map(at(&plain.positions, node)));
    }
}

/// Least `z^T A z / 2 - b^T z` with `C z = c`, all given as dense arrays.
fn dense(energy: &Mat<f64>, load: &Mat<f64>, rows: &Mat<f64>, values: &Mat<f64>) -> Mat<f64> {
    let (n, k) = (energy.nrows(), rows.nrows());
    let system = Mat::from_fn(n + k, n + k, |i, j| match (i < n, j < n) {
        (true, true) => energy[(i, j)],
        (false, true) => rows[(i - n, j)],
        (true, false) => rows[(j - n, i)],
        (false, false) => 0.0,
    });
    let right = Mat::from_fn(n + k, 1, |i, _| if i < n { load[(i, 0)] } else { values[(i - n, 0)] });
    system.full_piv_lu().solve(right)
}

/// Rows and targets in 2 N real unknowns: x of all nodes, then y.
fn dense_rows(lattice: &Lattice, handles: &[Handle]) -> (Mat<f64>, Mat<f64>) {
    let (n, k) = (lattice.node_count(), handles.len());
    let (mut rows, mut values) = (Mat::zeros(2 * k, 2 * n), Mat::zeros(2 * k, 1));
    for (number, handle) in handles.iter().enumerate() {
        let [u, v] = [0, 1].map(|axis| (handle.from[axis] - lattice.origin[axis]) / lattice.spacing[axis]);
        for node in 0..n {
            let [column, row] = [node % lattice.nodes[0], node / lattice.nodes[0]].map(|at| at as f64);
            let tent = (1.0 - (u - column).abs()).max(0.0) * (1.0 - (v - row).abs()).max(0.0);
            rows[(number, node)] = tent;
            rows[(k + number, n + node)] = tent;
        }
        values[(number, 0)] = handle.to[0];
        values[(k + number, 0)] = handle.to[1];
    }
    (rows, values)
}

fn cells(lattice: &Lattice) -> Vec<[usize; 4]> {
    let [columns, rows] = lattice.nodes;
    let nodes = (0..rows - 1).flat_map(|row| (0..columns - 1).map(move |column| row * columns + column));
    nodes.map(|first| [first, first + 1, first + columns, first + columns + 1]).collect()
}

#[test]
fn the_complex_form_is_the_real_least_squares() {
    for lattice in [Lattice { nodes: [5, 4], ..SQUARE }, Lattice { nodes: [4, 5], ..FLAT }] {
        let (n, handles) = (lattice.node_count(), scattered(&lattice, 5, 0.7, 11));
        let mut energy = Mat::<f64>::zeros(2 * n, 2 * n);
        for cell in cells(&lattice) {
            // Similarities (a x - b y + c, b x + a y + d) of the corners: what is left of a cell beside them.
            let fit = Mat::from_fn(8, 4, |i, j| {
                let v = rest(&lattice, cell[i % 4]);
                let rows = if i < 4 { [v.re, -v.im, 1.0, 0.0] } else { [v.im, v.re, 0.0, 1.0] };
                rows[j]
            });
            let projection = &fit * (fit.transpose() * &fit).full_piv_lu().solve(fit.transpose());
            let place = |i: usize| cell[i % 4] + if i < 4 { 0 } else { n };
            for (i, j) in (0..64).map(|entry| (entry / 8, entry % 8)) {
                energy[(place(i), place(j))] += if i == j { 1.0 } else { 0.0 } - projection[(i, j)];
            }
        }
        let (rows, values) = dense_rows(&lattice, &handles);
        let expected = dense(&energy, &Mat::zeros(2 * n, 1), &rows, &values);
        let warp = solved(&prepared(&lattice), &handles, Mode::Similarity);
        assert_near(&lattice, &warp.positions, 1e-8, |i| c64::new(expected[(i, 0)], expected[(n + i, 0)]));
    }
}

#[test]
fn the_rigid_step_is_the_real_least_squares() {
    for lattice in [Lattice { nodes: [5, 4], ..SQUARE }, Lattice { nodes: [4, 5], ..FLAT }] {
        let (n, handles, factor) = (lattice.node_count(), scattered(&lattice, 4, 0.7, 12), prepared(&lattice));
        let similar = solved(&factor, &handles, Mode::Similarity).positions;
        let (mut energy, mut load) = (Mat::<f64>::zeros(2 * n, 2 * n), Mat::<f64>::zeros(2 * n, 1));
        let [hx, hy] = lattice.spacing;
        for cell in cells(&lattice) {
            let middle = |f: &dyn Fn(usize) -> c64| cell.iter().fold(c64::ZERO, |sum, &node| sum + f(node)) / 4.0;
            let (v, z) = (middle(&|node| rest(&lattice, node)), middle(&|node| at(&similar, node)));
            let products = cell.map(|node| (rest(&lattice, node) - v).conj() * (at(&similar, node) - z));
            let turn = products.into_iter().fold(c64::ZERO, |sum, product| sum + product);
            let turn = turn / turn.modulus();
            for (p, q, weight) in [(0, 1, hy / hx), (2, 3, hy / hx), (0, 2, hx / hy), (1, 3, hx / hy)] {
                let (p, q) = (cell[p], cell[q]);
                let edge = turn * (rest(&lattice, q) - rest(&lattice, p));
                for (offset, edge) in [(0, edge.re), (n, edge.im)] {
                    let (p, q) = (p + offset, q + offset);
                    for (i, j, sign) in [(p, p, 1.0), (q, q, 1.0), (p, q, -1.0), (q, p, -1.0)] {
                        energy[(i, j)] += sign * weight;
                    }
                    load[(q, 0)] += weight * edge;
                    load[(p, 0)] -= weight * edge;
                }
            }
        }
        let (rows, values) = dense_rows(&lattice, &handles);
        let expected = dense(&energy, &load, &rows, &values);
        let warp = solved(&factor, &handles, Mode::Rigid);
        assert_near(&lattice, &warp.positions, 1e-9, |i| c64::new(expected[(i, 0)], expected[(n + i, 0)]));
    }
}

/// Handles on all four sides, the targets bent.
fn frame(lattice: &Lattice) -> Vec<Handle> {
    let bent = |handle: Handle| {
        let [x, y] = handle.from;
        Handle { to: [x + (0.2 * y).sin(), y + 0.01 * x * x], ..handle }
    };
    let sides = [Side::Top, Side::Right, Side::Bottom, Side::Left];
    sides.into_iter().flat_map(|name| side(lattice, name, &[[0.0; 2]])).map(bent).collect()
}

#[test]
fn with_the_whole_frame_held_the_inside_is_harmonic() {
    for lattice in [SQUARE, FLAT] {
        let handles = frame(&lattice);
        let warp = solved(&prepared(&lattice), &handles, Mode::Similarity);
        let ([columns, rows], [hx, hy]) = (lattice.nodes, lattice.spacing);
        assert_eq!((warp.constraints, warp.rank), (2 * (columns + rows) - 4, 2 * (columns + rows) - 4));
        for (column, row) in (1..rows - 1).flat_map(|row| (1..columns - 1).map(move |column| (column, row))) {
            let z = |dc: usize, dr: usize| at(&warp.positions, (row + dr - 1) * columns + column + dc - 1);
            let (across, down) = (z(0, 1) + z(2, 1) - z(1, 1) * 2.0, z(1, 0) + z(1, 2) - z(1, 1) * 2.0);
            let laplacian = across * (hy * hy) + down * (hx * hx);
            assert!(laplacian.modulus() < 1e-10 * (hx * hx + hy * hy), "{column}, {row}: {laplacian}");
        }
    }
}

#[test]
fn handles_are_met() {
    let lattice = Lattice { nodes: [41, 33], ..SQUARE };
    let factor = prepared(&lattice);
    for (mode, count) in MODES.into_iter().flat_map(|mode| [3, 10, 31, 60].map(|count| (mode, count))) {
        let warp = solved(&factor, &scattered(&lattice, count, 0.5, 21), mode);
        assert_eq!((warp.constraints, warp.rank), (count, count));
        assert!(warp.largest_miss < 1e-9 * lattice.size()[0], "{mode:?}, {count}: {}", warp.largest_miss);
        assert!(warp.residual < 1e-12, "{mode:?}, {count}: {}", warp.residual);
    }
}

#[test]
fn rigid_keeps_sizes_better() {
    let factor = prepared(&SQUARE);
    let [left, right] = [[0.1, 0.5], [0.9, 0.5]].map(|shares| inside(&SQUARE, shares));
    let handles = [Handle { from: left, to: left }, Handle { from: right, to: [left[0] + 20.0, left[1] + 5.0] }];
    let strain = |mode| {
        let positions = solved(&factor, &handles, mode).positions;
        let edge = |[p, q, ..]: [usize; 4]| ((at(&positions, q) - at(&positions, p)).modulus() / 4.0 - 1.0).powi(2);
        cells(&SQUARE).into_iter().map(edge).sum::<f64>()
    };
    assert!(strain(Mode::Rigid) < 0.5 * strain(Mode::Similarity), "{} {}", strain(Mode::Rigid), strain(MODES[0]));
}

#[test]
fn one_place_has_one_target() {
    let factor = prepared(&SQUARE);
    let mut handles = scattered(&SQUARE, 4, 0.3, 2);
    let once = solved(&factor, &handles, Mode::Similarity);
    handles.push(handles[1]);
    let twice = solved(&factor, &handles, Mode::Similarity);
    assert_eq!(once, twice);
    handles[4].to[0] += 0.01;
    let refused = dragged(&factor, &handles, Mode::Similarity);
    assert_eq!(refused, Err(Error::Contradiction { first: 1, second: 4 }));
}

#[test]
fn bad_handles_are_told() {
    let factor = prepared(&SQUARE);
    let fail = |handle: Handle| {
        let handles = [Handle { from: inside(&SQUARE, [0.2, 0.2]), to: [0.0; 2] }, handle];
        dragged(&factor, &handles, Mode::Rigid).expect_err("refused")
    };
    let [width, height] = inside(&SQUARE, [1.0, 1.0]);
    for from in [[width + 1e-3, 0.0], [0.0, height + 1e-3], [2.9, 0.0], [f64::NAN, 0.0], [0.0, f64::INFINITY]] {
        assert_eq!(fail(Handle { from, to: [0.0; 2] }), Error::Outside { index: 1 });
    }
    let from = [width + 1e-12, height];
    assert_eq!(fail(Handle { from, to: [f64::NAN, 0.0] }), Error::NotFinite { index: 1 });
    let apart = [[-1.0, 0.2], [1.0, 0.8]]
        .map(|[sign, at]| Handle { from: inside(&SQUARE, [at, at]), to: [sign * f64::MAX; 2] });
    for mode in MODES {
        assert_eq!(dragged(&factor, &apart, mode), Err(Error::Overflow));
    }
    let handles = scattered(&SQUARE, 3, 0.1, 1);
    let stopped = hold(&factor, &handles, Mode::Similarity, &mut Room::new(UNWATCHED), &|_| Err(Interrupted));
    assert!(matches!(stopped, Err(Error::Interrupted)), "{stopped:?}");
    let held = hold(&factor, &handles, Mode::Similarity, &mut Room::new(UNWATCHED), UNWATCHED).expect("held");
    let stopped = solve(&factor, &held, &handles, &mut Room::new(UNWATCHED), &|_| Err(Interrupted));
    assert_eq!(stopped, Err(Error::Interrupted));
    assert_eq!(super::factor(&SQUARE, &|_| Err(Interrupted)).expect_err("stopped"), Error::Interrupted);
}

#[test]
fn dependent_handles_are_met_in_the_least_squares_sense() {
    let factor = prepared(&FLAT);
    // Three in a row in one cell, and one elsewhere.
    let row = |shift: f64| {
        [[-19.0, 0.0], [-18.0, shift], [-17.0, 0.0], [-2.0, 3.0]].map(|[x, by]: [f64; 2]| {
            let y = if x < -10.0 { 11.5 } else { 20.0 };
            Handle { from: [x, y], to: [x, y + by] }
        })
    };
    for mode in MODES {
        let warp = solved(&factor, &row(0.0), mode);
        assert_eq!((warp.constraints, warp.rank), (4, 3));
        assert!(warp.largest_miss < 1e-9, "{}", warp.largest_miss);
        // Of a middle that is off by 0.3 two thirds are left there and one third at both ends.
        let warp = solved(&factor, &row(0.3), mode);
        assert!((warp.largest_miss - 0.2).abs() < 1e-9 && warp.residual < 1e-12, "{warp:?}");
    }
}

#[test]
fn one_cell_follows_four_handles_of_five() {
    let warp = solved(&prepared(&CELL), &scattered(&CELL, 5, 0.5, 8), Mode::Similarity);
    assert_eq!((warp.constraints, warp.rank), (5, 4));
    let corners = frame(&CELL);
    let warp = solved(&prepared(&CELL), &corners, Mode::Rigid);
    for handle in &corners {
        let node = cells(&CELL)[0].into_iter().find(|&node| rest(&CELL, node) == complex(handle.from));
        let there = at(&warp.positions, node.expect("a corner"));
        assert!((there - complex(handle.to)).modulus() < 1e-12, "{there} {handle:?}");
    }
}

#[test]
fn handles_on_one_line_across_cells_are_independent() {
    let handles = [0.05, 0.3, 0.55, 0.95].map(|x| {
        let from = inside(&SQUARE, [x, 0.5]);
        Handle { from, to: [from[0], from[1] + 9.0 * (x - 0.4) * (x - 0.4)] }
    });
    let warp = solved(&prepared(&SQUARE), &handles, Mode::Similarity);
    assert!(warp.rank == 4 && warp.largest_miss < 1e-11, "{warp:?}");
}

#[test]
fn compliance_is_what_whole_solves_give() {
    let lattice = Lattice { nodes: [23, 31], ..FLAT };
    let mut handles = scattered(&lattice, 12, 0.5, 4);
    // The pins themselves are not felt.
    handles.push(Handle { from: lattice.rest(5, 7), to: [0.0; 2] });
    let (factor, rows) = (prepared(&lattice), rows(&lattice, &handles).expect("inside"));
    let mut fields = Mat::<c64>::zeros(lattice.node_count(), rows.len());
    for (number, row) in rows.iter().enumerate() {
        row.pulls().for_each(|(node, weight)| fields[(node, number)] += c64::new(weight, 0.0));
    }
    factor.similarity.solve(fields.as_mut()).expect("solved");
    let compliance =
        factor.similarity.compliance(&rows, 0, &mut Room::new(UNWATCHED), UNWATCHED).expect("nobody stops it");
    for (j, (i, row)) in (0..rows.len()).flat_map(|j| rows.iter().enumerate().map(move |row| (j, row))) {
        let whole = row.pulls().fold(c64::ZERO, |sum, (node, weight)| sum + fields[(node, j)] * weight);
        assert!(
            (whole - compliance[(i, j)]).modulus() < 1e-12 * (1.0 + whole.modulus()),
            "{i}, {j}: {whole} {}",
            compliance[(i, j)]
        );
    }
}

/// Kept responses and solves give one warp, and what is held does not know its targets.
#[test]
fn what_is_held_serves_all_targets() {
    let (factor, places) = (prepared(&SQUARE), scattered(&SQUARE, 6, 0.0, 5));
    for mode in MODES {
        let held = hold(&factor, &places, mode, &mut Room::new(UNWATCHED), UNWATCHED).expect("held");
        for seed in 1..4 {
            let mut number = noise(seed);
            let handles: Vec<Handle> =
                places.iter().map(|h| Handle { to: h.from.map(|at| at + 8.0 * number()), ..*h }).collect();
            let warp = solve(&factor, &held, &handles, &mut Room::new(UNWATCHED), UNWATCHED).expect("solved");
            assert_eq!(warp, solved(&factor, &handles, mode));
            let mut bare = hold(&factor, &handles, mode, &mut Room::new(UNWATCHED), UNWATCHED).expect("held");
            bare.similar.as_mut().expect("six handles").forget_responses();
            bare.rigid.as_mut().into_iter().for_each(Prepared::forget_responses);
            assert!(bare.bytes() < held.bytes());
            let whole = solve(&factor, &bare, &handles, &mut Room::new(UNWATCHED), UNWATCHED).expect("solved");
            assert_near(&SQUARE, &warp.positions, 1e-10, |node| at(&whole.positions, node));
        }
        assert!(held.holds(&places, mode) && !held.holds(&places[1..], mode));
        assert!(MODES.iter().filter(|&&mode| held.holds(&places, mode)).count() == 1);
    }
}

#[test]
fn threads_do_not_change_it() {
    let lattice = Lattice { nodes: [37, 29], ..FLAT };
    let handles = scattered(&lattice, 40, 0.4, 6);
    let run = || solved(&prepared(&lattice), &handles, Mode::Rigid);
    let expected = run();
    for threads in [1, 2, 3, 8] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        assert_eq!(pool.install(run), expected);
    }
}

#[test]
fn a_curve_is_held_once_a_cell() {
    let lattice = Lattice { origin: [0.0, 0.0], spacing: [10.0, 10.0], nodes: [7, 4] };
    let up = |from: &[[f64; 2]]| -> Vec<[f64; 2]> { from.iter().map(|[x, y]| [x + 1.0, y + 2.0]).collect() };
    let straight = [[5.0, 5.0], [35.0, 5.0]];
    let held = along(&lattice, &straight, &up(&straight)).expect("inside");
    let expected = [[5.0, 5.0], [15.0, 5.0], [25.0, 5.0], [35.0, 5.0]];
    assert_eq!(held, expected.map(|from| Handle { from, to: [from[0] + 1.0, from[1] + 2.0] }));
    // To a cell and back, along a line of nodes, in one cell, and in one point.
    let back = [[5.0, 5.0], [15.0, 5.0], [15.0, 8.0], [5.0, 8.0]];
    assert_eq!(along(&lattice, &back, &up(&back)).expect("inside").len(), 2);
    let line = [[20.0, 0.0], [20.0, 30.0]];
    assert_eq!(along(&lattice, &line, &up(&line)).expect("inside").len(), 3);
    let short = [[1.0, 1.0], [3.0, 1.0]];
    assert_eq!(along(&lattice, &short, &up(&short)), Ok(vec![Handle { from: [2.0, 1.0], to: [3.0, 3.0] }]));
    assert_eq!(along(&lattice, &[[1.0, 1.0]; 2], &[[4.0, 4.0]]).expect("inside").len(), 1);
    assert_eq!(along(&lattice, &[[5.0, 5.0], [61.0, 5.0]], &straight), Err(Error::Outside { index: 1 }));
}

#[test]
fn curves_correspond_by_corners_or_by_length() {
    let lattice = Lattice { origin: [0.0, 0.0], spacing: [10.0, 10.0], nodes: [7, 4] };
    let from = [[5.0, 5.0], [15.0, 5.0], [45.0, 5.0]];
    let to_of = |to: &[[f64; 2]]| -> Vec<[f64; 2]> {
        along(&lattice, &from, to).expect("inside").into_iter().map(|handle| handle.to).collect()
    };
    // Handles lie at 5, 15, 25, 35, 45.
    assert_eq!(
        to_of(&[[0.0, 0.0], [9.0, 0.0], [9.0, 3.0]]),
        [[0.0, 0.0], [9.0, 0.0], [9.0, 1.0], [9.0, 2.0], [9.0, 3.0]]
    );
    assert_eq!(to_of(&[[0.0, 0.0], [0.0, 8.0]]), [[0.0, 0.0], [0.0, 2.0], [0.0, 4.0], [0.0, 6.0], [0.0, 8.0]]);
}

#[test]
fn a_side_is_held_at_its_nodes() {
    let to = [[0.0, 0.0], [3.0, 0.0], [3.0, 9.0]];
    let held = side(&SQUARE, Side::Right, &to);
    assert_eq!(held.len(), 9);
    assert_eq!((held[0].from, held[0].to, held[8].to), ([51.0, -7.5], to[0], to[2]));
    assert_eq!((held[2].from, held[2].to), ([51.0, 0.5], [3.0, 0.0]));
    assert_eq!(side(&SQUARE, Side::Bottom, &to)[12].from, [51.0, 24.5]);
}
