use super::*;
use crate::UNWATCHED;
use proptest::prelude::*;
use pulp::Arch;
use spans::traced;

mod edges;
mod ewa;
mod wide;

const FILTERS: [Filter; 5] = [Filter::Nearest, Filter::Linear, Filter::Cubic, Filter::Lanczos3, Filter::Ewa];
const EDGES: [Edge; 4] = [Edge::Transparent, Edge::Clamp, Edge::Mirror, Edge::Wrap];

/// A small generator (Steele's splitmix64): the next number of a sequence.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mixed = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

fn noise(count: usize, seed: u64) -> Vec<f32> {
    let mut state = seed;
    (0..count).map(|_| (random(&mut state) >> 40) as f32 / 1e6 - 4.0).collect()
}

/// A lattice over a window's edges, `cells` cells a side.
fn over(window: Rect, cells: [usize; 2]) -> Lattice {
    let size = [window.width() as f64, window.height() as f64];
    Lattice {
        origin: [window.x0 as f64, window.y0 as f64],
        spacing: [0, 1].map(|axis| size[axis] / cells[axis] as f64),
        nodes: cells.map(|count| count + 1),
    }
}

/// Draws planes of `source` size and gives the drawn planes and the count of drawn pixels.
fn drawn(map: &Map, source: Rect, dst: Rect, filter: Filter, edge: Edge, planes: &[Vec<f32>]) -> (Vec<Vec<f32>>, u64) {
    let mut out = vec![vec![f32::NAN; dst.width() * dst.height()]; planes.len()];
    let views: Vec<_> = planes.iter().map(|p| View::packed(p, source.width(), source.height())).collect();
    let outs = out.iter_mut().map(|o| ViewMut::packed(o, dst.width(), dst.height())).collect();
    let sampling = Sampling { filter, edge, clamp_ringing: false };
    let count = draw(map, source, dst, &sampling, &views, outs, UNWATCHED).expect("unwatched");
    (out, count.pixels)
}

fn bits(plane: &[f32]) -> Vec<u32> {
    plane.iter().map(|v| v.to_bits()).collect()
}

/// A picture with all that is hard to keep: NaN, infinity, minus zero.
fn hard_picture(window: Rect, seed: u64) -> Vec<f32> {
    let mut plane = noise(window.width() * window.height(), seed);
    for (i, value) in plane.iter_mut().enumerate() {
        match i % 11 {
            3 => *value = f32::NAN,
            5 => *value = f32::INFINITY,
            7 => *value = -0.0,
            8 => *value = f32::MAX,
            _ => {}
        }
    }
    plane
}

#[test]
fn identity_gives_the_input_bit_for_bit() {
    let window = Rect::new(-7, 3, 290, 74);
    let planes: Vec<_> = (0..5).map(|seed| hard_picture(window, seed)).collect();
    for cells in [[1, 1], [43, 17], [297, 71]] {
        let lattice = over(window, cells);
        let positions = Positions::from_map(&lattice, |p| p);
        let forward = Map::Forward { lattice: &lattice, positions: &positions };
        let backward = Map::Backward { lattice: &lattice, positions: &positions };
        for (map, filter, edge) in [forward, backward]
            .into_iter()
            .flat_map(|map| FILTERS.into_iter().flat_map(move |filter| EDGES.map(|edge| (map, filter, edge))))
        {
            for count in [1, 5] {
                let (out, drawn) = drawn(&map, window, window, filter, edge, &planes[..count]);
                assert_eq!(drawn, 297 * 71);
                for (out, plane) in out.iter().zip(&planes) {
                    assert!(bits(out) == bits(plane), "{cells:?} {filter:?} {edge:?}");
                }
            }
        }
    }
}

#[test]
fn translation_moves_pixels_and_shows_each_edge() {
    // 1 2 3 moved by 4 columns to the right, seen from column 0 on.
    let (source, dst) = (Rect::new(0, 0, 3, 1), Rect::new(0, 0, 10, 1));
    let lattice = over(source, [3, 1]);
    let ahead = Positions::from_map(&lattice, |[x, y]| [x + 4.0, y]);
    let back = Positions::from_map(&lattice, |[x, y]| [x - 4.0, y]);
    for (edge, expected) in [
        (Edge::Transparent, [0., 0., 0., 0., 1., 2., 3., 0., 0., 0.]),
        (Edge::Clamp, [1., 1., 1., 1., 1., 2., 3., 3., 3., 3.]),
        (Edge::Mirror, [3., 3., 2., 1., 1., 2., 3., 3., 2., 1.]),
        (Edge::Wrap, [3., 1., 2., 3., 1., 2., 3., 1., 2., 3.]),
    ] {
        for map in [
            Map::Forward { lattice: &lattice, positions: &ahead },
            Map::Backward { lattice: &lattice, positions: &back },
        ] {
            for filter in FILTERS {
                let (out, _) = drawn(&map, source, dst, filter, edge, &[vec![1., 2., 3.]]);
                assert_eq!(out[0], expected, "{edge:?} {filter:?}");
            }
            let mut labels = [9; 10];
            let out = vec![ViewMut::packed(&mut labels, 10, 1)];
            draw_labels(&map, source, dst, edge, &[View::packed(&[1, 2, 3], 3, 1)], out, UNWATCHED).expect("unwatched");
            assert_eq!(labels, expected.map(|value| value as u32), "{edge:?}");
        }
    }
}

#[test]
fn half_pixels_weigh_as_the_filters_say() {
    let (source, dst) = (Rect::new(0, 0, 4, 1), Rect::new(-2, 0, 7, 1));
    let lattice = over(source, [2, 1]);
    let positions = Positions::from_map(&lattice, |[x, y]| [x + 0.5, y]);
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    let plane = [vec![0., 16., 0., 0.]];
    let run = |filter, edge| drawn(&map, source, dst, filter, edge, &plane);
    // Keys' weights at 1/2: -1/16, 9/16, 9/16, -1/16.
    assert_eq!(run(Filter::Cubic, Edge::Transparent), (vec![vec![0., 0., -1., 9., 9., -1., 0., 0., 0.]], 7));
    assert_eq!(run(Filter::Linear, Edge::Transparent), (vec![vec![0., 0., 0., 8., 8., 0., 0., 0., 0.]], 5));
    assert_eq!(run(Filter::Linear, Edge::Mirror).0[0], [8., 8., 0., 8., 8., 0., 0., 0., 8.]);
    assert_eq!(run(Filter::Linear, Edge::Wrap).0[0], [8., 0., 0., 8., 8., 0., 0., 8., 8.]);
}

#[test]
fn nan_spreads_within_the_footprint_only() {
    let window = Rect::new(0, 0, 9, 9);
    let lattice = over(window, [3, 3]);
    let mut plane = vec![1.0; 81];
    plane[4 * 9 + 4] = f32::NAN;
    let nan_pixels = |shift: [f64; 2], filter| -> Vec<usize> {
        let positions = Positions::from_map(&lattice, |[x, y]| [x + shift[0], y + shift[1]]);
        let map = Map::Forward { lattice: &lattice, positions: &positions };
        let (out, _) = drawn(&map, window, window, filter, Edge::Clamp, std::slice::from_ref(&plane));
        (0..81).filter(|&i| out[0][i].is_nan()).collect()
    };
    assert_eq!(nan_pixels([0.25, 0.25], Filter::Linear), [40, 41, 49, 50]);
    assert_eq!(nan_pixels([0.25, 0.0], Filter::Cubic), [39, 40, 41, 42]);
    assert_eq!(nan_pixels([0.0, 0.25], Filter::Linear), [40, 49]);
    assert_eq!(nan_pixels([0.25, 0.25], Filter::Cubic).len(), 16);
}

/// A lattice whose nodes moved by quarters of a pixel, less than what folds a cell; the outer ones too.
fn jittered(cells: [usize; 2], quarters: i64, jitter: i64, seed: u64) -> (Lattice, Positions) {
    let spacing = quarters as f64 / 4.0;
    let lattice = Lattice { origin: [4.0, 4.0], spacing: [spacing; 2], nodes: cells.map(|count| count + 1) };
    let mut state = seed;
    let mut move_by = || (random(&mut state) % (2 * jitter as u64 + 1)) as f64 / 4.0 - jitter as f64 / 4.0;
    let mut positions = Positions::from_map(&lattice, |p| p);
    for i in 0..lattice.node_count() {
        positions.x[i] += move_by();
        positions.y[i] += move_by();
    }
    (lattice, positions)
}

/// Whether the pixel's centre, moved by (e, e^2), lies in the polygon, whose corners are whole quarters: whole
/// numbers throughout, nothing shared with the code under test.
fn holds(polygon: &[[i64; 2]], [x, y]: [i64; 2]) -> bool {
    let edges = (0..polygon.len()).map(|i| (polygon[i], polygon[(i + 1) % polygon.len()]));
    let right_of = edges.filter(|&(a, b)| {
        let [upper, lower] = if a[1] < b[1] { [a, b] } else { [b, a] };
        let (dx, dy) = (lower[0] - upper[0], lower[1] - upper[1]);
        upper[1] <= y && y < lower[1] && (x - upper[0]) * dy >= (y - upper[1]) * dx
    });
    right_of.count() % 2 == 1
}

/// Whether a point lies on the polygon's boundary.
fn touches(polygon: &[[i64; 2]], [x, y]: [i64; 2]) -> bool {
    (0..polygon.len()).map(|i| (polygon[i], polygon[(i + 1) % polygon.len()])).any(|(a, b)| {
        let between = |at: i64, axis: usize| a[axis].min(b[axis]) <= at && at <= a[axis].max(b[axis]);
        (b[0] - a[0]) * (y - a[1]) == (b[1] - a[1]) * (x - a[0]) && between(x, 0) && between(y, 1)
    })
}

fn in_quarters(positions: &Positions, node: usize) -> [i64; 2] {
    [(positions.x[node] * 4.0) as i64, (positions.y[node] * 4.0) as i64]
}

/// The lattice's nodes once around.
fn boundary([columns, rows]: [usize; 2]) -> Vec<usize> {
    let mut nodes: Vec<usize> = (0..columns).collect();
    nodes.extend((1..rows).map(|row| row * columns + columns - 1));
    nodes.extend((0..columns - 1).rev().map(|column| (rows - 1) * columns + column));
    nodes.extend((1..rows - 1).rev().map(|row| row * columns));
    nodes
}

/// How often each pixel of a window is owned by a cell of the lattice.
fn owners(arch: Arch, lattice: &Lattice, positions: &Positions, window: Rect) -> Vec<u32> {
    let mut counts = vec![0; window.width() * window.height()];
    let mut spans = spans::Spans::new(&window);
    let mut count = |polygon: [usize; 4], corners: usize| {
        let [a, b, c, d] = polygon.map(|node| [positions.x[node], positions.y[node]]);
        let rows =
            if corners == 4 { traced(arch, &mut spans, &[a, b, c, d]) } else { traced(arch, &mut spans, &[a, b, c]) };
        for row in rows {
            for column in spans.run(row) {
                counts[row * window.width() + column] += 1;
            }
        }
    };
    let columns = lattice.nodes[0];
    for (row, column) in (0..lattice.cells()[1]).flat_map(|row| (0..columns - 1).map(move |column| (row, column))) {
        let node = row * columns + column;
        let nodes = [node, node + 1, node + 1 + columns, node + columns];
        match cell::Shape::of(&nodes.map(|node| [positions.x[node], positions.y[node]])) {
            cell::Shape::Convex { .. } => count(nodes, 4),
            cell::Shape::Folded { split } => {
                for third in [1, 2] {
                    count([nodes[split], nodes[split + third], nodes[(split + third + 1) % 4], 0], 3);
                }
            }
        }
    }
    counts
}

#[test]
fn every_pixel_of_the_image_is_owned_once() {
    let mut on_edges = 0;
    for seed in 0..60 {
        // The last kind has cells with three corners on one line.
        let (quarters, jitter) = [(16, 3), (5, 1), (10, 2), (4, 1)][seed as usize % 4];
        let (lattice, positions) = jittered([9, 7], quarters, jitter, seed);
        let window = Rect::new(0, 0, 48, 40);
        let polygon: Vec<_> = boundary(lattice.nodes).iter().map(|&node| in_quarters(&positions, node)).collect();
        let expected: Vec<u32> =
            (0..48 * 40).map(|i| u32::from(holds(&polygon, [i % 48 * 4 + 2, i / 48 * 4 + 2]))).collect();
        for arch in [Arch::Scalar, Arch::new()] {
            let found = owners(arch, &lattice, &positions, window);
            for i in 0..48 * 40 {
                assert_eq!(found[i], expected[i], "{arch:?}, seed {seed}, pixel {} {}", i % 48, i / 48);
            }
        }
        on_edges +=
            (0..lattice.node_count()).filter(|&i| in_quarters(&positions, i).iter().all(|q| q % 4 == 2)).count();

        // Drawn without its continuation the lattice shows just these pixels. Only a centre on the image's very edge
        // may have a position on the source window's far edge, outside.
        if quarters % 4 == 0 {
            let source = Rect::new(4, 4, 4 + 9 * quarters / 4, 4 + 7 * quarters / 4);
            let map = Map::Forward { lattice: &lattice, positions: &positions };
            let plane = vec![1.0; source.width() * source.height()];
            let (out, _) = drawn(&map, source, window, Filter::Nearest, Edge::Transparent, &[plane]);
            for i in 0..48 * 40 {
                let on_edge = || touches(&polygon, [i % 48 * 4 + 2, i / 48 * 4 + 2]);
                let owned = expected[i as usize] == 1;
                assert!((out[0][i as usize] == 1.0) == owned || (owned && on_edge()), "seed {seed}, pixel {i}");
            }
        }
    }
    assert!(on_edges > 100, "{on_edges} pixel centres are nodes");
}

#[test]
fn an_arrowhead_fills_its_outline() {
    // The middle node moved past the diagonal of the last cell, which stays inside the unmoved boundary.
    let lattice = over(Rect::new(0, 0, 8, 8), [2, 2]);
    let mut positions = Positions::from_map(&lattice, |p| p);
    for middle in [[6.5, 6.5], [7.0, 6.25], [1.5, 1.0], [7.5, 0.5]] {
        [positions.x[4], positions.y[4]] = middle;
        assert_eq!(owners(Arch::new(), &lattice, &positions, Rect::new(0, 0, 8, 8)), [1; 64], "{middle:?}");
    }
}

/// A warp that bends, folds here and there if `wild`, over a source of 300 x 80.
fn bent(wild: bool) -> (Lattice, Positions) {
    let lattice = over(Rect::new(0, 0, 300, 80), [61, 17]);
    let amplitude = if wild { 40.0 } else { 4.0 };
    let positions = Positions::from_map(&lattice, |[x, y]| {
        [x + amplitude * libm::sin(y * 0.13), y + amplitude * libm::sin(x * 0.11)]
    });
    (lattice, positions)
}

#[test]
fn thread_counts_give_the_same_bits() {
    let (source, dst) = (Rect::new(0, 0, 300, 80), Rect::new(-30, -50, 333, 140));
    let planes: Vec<_> = (0..3).map(|seed| noise(300 * 80, seed)).collect();
    for (wild, edge) in [(false, Edge::Transparent), (true, Edge::Transparent), (true, Edge::Mirror)] {
        let (lattice, mut positions) = bent(wild);
        positions.x[500] = f64::NAN;
        positions.y[700] = f64::INFINITY;
        positions.y[800] = 1e300;
        let map = Map::Forward { lattice: &lattice, positions: &positions };
        let results = [1, 2, 3, 8].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let (out, count) = pool.install(|| drawn(&map, source, dst, Filter::Cubic, edge, &planes));
            (out.iter().map(|plane| bits(plane)).collect::<Vec<_>>(), count)
        });
        assert!(results.iter().all(|result| *result == results[0]), "wild {wild}");
        assert!(results[0].1 > 20_000);
    }
}

#[test]
fn tiles_and_windows_do_not_show() {
    let source = Rect::new(0, 0, 300, 80);
    let (lattice, positions) = bent(true);
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    let planes = [noise(300 * 80, 1)];
    for filter in FILTERS {
        let whole = drawn(&map, source, Rect::new(-30, -50, 333, 140), filter, Edge::Transparent, &planes).0;
        let part = drawn(&map, source, Rect::new(17, -9, 290, 60), filter, Edge::Transparent, &planes).0;
        for (i, value) in part[0].iter().enumerate() {
            let (x, y) = (i % 273 + 47, i / 273 + 41);
            assert_eq!(value.to_bits(), whole[0][y * 363 + x].to_bits(), "{x} {y}");
        }
    }
}

#[test]
fn transparent_is_a_border_of_zeros() {
    // A picture grown by zeros gives the same values, though it takes other paths at the edges.
    let (lattice, positions) = bent(false);
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    let (source, grown, dst) = (Rect::new(20, 10, 70, 40), Rect::new(15, 5, 75, 45), Rect::new(0, 0, 100, 60));
    let plane = noise(50 * 30, 3);
    let mut padded = vec![0.0; 60 * 40];
    for (row, values) in plane.chunks(50).enumerate() {
        padded[(row + 5) * 60 + 5..][..50].copy_from_slice(values);
    }
    for filter in FILTERS {
        let (a, count) = drawn(&map, source, dst, filter, Edge::Transparent, std::slice::from_ref(&plane));
        let (b, larger) = drawn(&map, grown, dst, filter, Edge::Transparent, std::slice::from_ref(&padded));
        assert_eq!(a, b, "{filter:?}");
        assert!(count < larger);
    }
}

#[test]
fn planes_do_not_know_each_other() {
    let (lattice, positions) = bent(false);
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    let window = Rect::new(0, 0, 300, 80);
    let planes: Vec<_> = (0..6).map(|seed| hard_picture(window, seed)).collect();
    for edge in EDGES {
        let (together, _) = drawn(&map, window, window, Filter::Cubic, edge, &planes);
        for (plane, expected) in planes.iter().zip(&together) {
            let (alone, _) = drawn(&map, window, window, Filter::Cubic, edge, std::slice::from_ref(plane));
            assert!(bits(&alone[0]) == bits(expected), "{edge:?}");
        }
    }
}

#[test]
fn forward_and_backward_agree_on_an_affine_map() {
    let (source, dst) = (Rect::new(-5, 2, 85, 62), Rect::new(0, 0, 120, 90));
    let plane = noise(90 * 60, 9);
    let ([a, b, c, d], [e, f]) = ([0.9, -0.35, 0.3, 1.1], [20.3, 4.7]);
    let det = a * d - b * c;
    let (from, to) = (over(source, [7, 5]), over(dst, [11, 4]));
    let ahead = Positions::from_map(&from, |[x, y]| [a * x + b * y + e, c * x + d * y + f]);
    let back = Positions::from_map(&to, |[x, y]| {
        let (x, y) = (x - e, y - f);
        [(d * x - b * y) / det, (a * y - c * x) / det]
    });
    for (filter, edge) in
        [(Filter::Linear, Edge::Transparent), (Filter::Cubic, Edge::Mirror), (Filter::Cubic, Edge::Transparent)]
    {
        let forward = Map::Forward { lattice: &from, positions: &ahead };
        let backward = Map::Backward { lattice: &to, positions: &back };
        let (x, x_count) = drawn(&forward, source, dst, filter, edge, std::slice::from_ref(&plane));
        let (y, y_count) = drawn(&backward, source, dst, filter, edge, std::slice::from_ref(&plane));
        let worst = x[0].iter().zip(&y[0]).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-4, "{filter:?}: {worst}");
        assert_eq!(x_count, y_count);
        assert!(edge == Edge::Transparent || x_count == 120 * 90, "the continuation covers the window");
    }
}

#[test]
fn cubic_reproduces_a_parabola() {
    // Keys' kernel with a = -1/2 is exact for polynomials of degree 2.
    let window = Rect::new(0, 0, 24, 24);
    let lattice = over(window, [4, 4]);
    let positions = Positions::from_map(&lattice, |[x, y]| [1.1 * x + 0.1 * y - 1.3, y + 0.21]);
    let value = |x: f64, y: f64| 3.0 + 0.5 * x - 0.25 * y + 0.02 * x * x - 0.03 * x * y;
    let plane = (0..576).map(|i| value((i % 24) as f64 + 0.5, (i / 24) as f64 + 0.5) as f32).collect();
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    let (out, _) = drawn(&map, window, window, Filter::Cubic, Edge::Clamp, &[plane]);
    for (i, &found) in out[0].iter().enumerate() {
        let (x, y) = ((i % 24) as f64 + 0.5, (i / 24) as f64 + 0.5 - 0.21);
        let x = (x + 1.3 - 0.1 * y) / 1.1;
        if (2.0..22.0).contains(&x) && (2.0..22.0).contains(&y) {
            assert!((f64::from(found) - value(x, y)).abs() < 2e-5, "{x} {y}: {found}");
        }
    }
}

#[test]
fn the_continuation_lies_under_the_lattice_and_ends_at_its_fold() {
    // A fan whose sides meet at (20, 50): continued downwards, it ends there instead of turning inside out.
    let source = Rect::new(0, 0, 40, 40);
    let lattice = over(source, [8, 8]);
    let positions = Positions::from_map(&lattice, |[x, y]| [20.0 + (x - 20.0) * (1.0 - y / 50.0), y]);
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    let dst = Rect::new(0, 0, 40, 100);
    let (out, _) = drawn(&map, source, dst, Filter::Nearest, Edge::Clamp, &[vec![1.0; 1600]]);
    assert!((0..45).all(|y| out[0][y * 40 + 20] == 1.0));
    assert!(out[0][60 * 40..].iter().all(|&v| v == 0.0));
}

#[test]
fn the_last_of_overlapping_cells_shows() {
    // The right cell is laid over the left one; where it lies outside the source it hides nothing.
    let lattice = over(Rect::new(0, 0, 4, 2), [2, 1]);
    let positions = Positions { x: vec![0., 2., 0., 0., 2., 0.], y: vec![0., 0., 0., 2., 2., 2.] };
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    let (source, dst) = (Rect::new(0, 0, 4, 1), Rect::new(0, 0, 2, 1));
    let (out, _) = drawn(&map, source, dst, Filter::Nearest, Edge::Transparent, &[vec![1., 2., 3., 4.]]);
    assert_eq!(out[0], [4., 3.]);
    let (out, _) = drawn(&map, Rect::new(0, 0, 3, 1), dst, Filter::Nearest, Edge::Transparent, &[vec![1., 2., 3.]]);
    assert_eq!(out[0], [1., 3.]);
}

#[test]
fn small_empty_and_broken() {
    let lattice = over(Rect::new(0, 0, 1, 1), [1, 1]);
    let identity = Positions::from_map(&lattice, |p| p);
    let broken = Positions { x: vec![f64::NAN; 4], y: vec![f64::INFINITY; 4] };
    let (one, empty) = (Rect::new(0, 0, 1, 1), Rect::new(0, 0, 0, 5));
    for (filter, edge) in FILTERS.into_iter().flat_map(|filter| EDGES.map(|edge| (filter, edge))) {
        let same = Map::Forward { lattice: &lattice, positions: &identity };
        assert_eq!(drawn(&same, one, one, filter, edge, &[vec![7.0]]), (vec![vec![7.0]], 1));
        assert_eq!(drawn(&same, one, empty, filter, edge, &[vec![7.0]]).1, 0);
        assert_eq!(drawn(&same, empty, one, filter, edge, &[vec![]]), (vec![vec![0.0]], 0));
        assert_eq!(drawn(&same, one, one, filter, edge, &[]), (vec![], 0), "without planes nothing is drawn");
        for map in [
            Map::Forward { lattice: &lattice, positions: &broken },
            Map::Backward { lattice: &lattice, positions: &broken },
        ] {
            assert_eq!(drawn(&map, one, one, filter, edge, &[vec![7.0]]), (vec![vec![0.0]], 0), "{edge:?}");
        }
        let far = Positions::from_map(&lattice, |[x, y]| [1e9 * x, -1e9 * y]);
        drawn(
            &Map::Backward { lattice: &lattice, positions: &far },
            one,
            Rect::new(-20, -20, 20, 20),
            filter,
            edge,
            &[vec![7.0]],
        );
    }
}

#[test]
fn a_cell_with_a_broken_node_is_left_out() {
    let window = Rect::new(0, 0, 9, 9);
    let lattice = over(window, [3, 3]);
    let mut positions = Positions::from_map(&lattice, |p| p);
    positions.x[5] = f64::NAN; // Node (1, 1): a corner of the four cells over 0..6.
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    let (out, count) = drawn(&map, window, window, Filter::Linear, Edge::Transparent, &[vec![1.0; 81]]);
    assert_eq!(count, 81 - 36);
    assert!((0..81).all(|i| out[0][i] == if i % 9 < 6 && i / 9 < 6 { 0.0 } else { 1.0 }));
}

#[test]
fn bounds_of_simple_maps() {
    let window = Rect::new(10, -4, 40, 20);
    let limit = Rect::new(-1000, -1000, 1000, 1000);
    let lattice = over(Rect::new(0, 0, 100, 70), [21, 13]);
    let shifted = |dx: f64| Positions::from_map(&lattice, |[x, y]| [x + dx, y]);
    let of = |positions: &Positions, limit| {
        bounds(&Map::Forward { lattice: &lattice, positions }, window, limit, UNWATCHED)
            .expect("nobody stops it")
            .expect("forward")
    };
    assert_eq!(of(&shifted(0.0), limit), window);
    assert_eq!(of(&shifted(1e-9), limit), window);
    assert_eq!(of(&shifted(2.25), limit), Rect::new(12, -4, 43, 20));
    assert_eq!(of(&shifted(0.0), Rect::new(20, 0, 30, 9)), Rect::new(20, 0, 30, 9));
    let wild = Positions::from_map(&lattice, |[x, y]| [(x - 20.0) * 1e30, y]);
    assert_eq!(of(&wild, limit), Rect::new(-1000, -4, 1000, 20));
    let broken = Positions { x: vec![f64::NAN; 308], y: vec![f64::NAN; 308] };
    assert!(of(&broken, limit).is_empty());
    let backward = Map::Backward { lattice: &lattice, positions: &wild };
    assert_eq!(bounds(&backward, window, limit, UNWATCHED), Ok(None));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn nothing_is_drawn_out_of_bounds(seed in 0..u64::MAX, jitter in 1..40i64, x0 in -10..10i64, y0 in -10..10i64) {
        let (lattice, positions) = jittered([6, 5], 22, jitter, seed);
        let map = Map::Forward { lattice: &lattice, positions: &positions };
        let (source, dst) = (Rect::new(x0, y0, x0 + 25, y0 + 30), Rect::new(-40, -40, 90, 90));
        let (out, _) = drawn(&map, source, dst, Filter::Nearest, Edge::Transparent, &[vec![1.0; 25 * 30]]);
        let hull = bounds(&map, source, dst, UNWATCHED).expect("nobody stops it").expect("forward");
        for (i, _) in out[0].iter().enumerate().filter(|(_, value)| **value != 0.0) {
            let (x, y) = (i as i64 % 130 - 40, i as i64 / 130 - 40);
            prop_assert!(x >= hull.x0 && x < hull.x1 && y >= hull.y0 && y < hull.y1, "{x} {y} {hull:?}");
        }
    }
}

#[test]
fn a_half_pixel_shift_treats_both_fringes_alike() {
    let (source, limit) = (Rect::new(0, 0, 6, 5), Rect::new(-50, -50, 50, 50));
    let lattice = over(source, [2, 2]);
    for shift in [0.5, -0.5] {
        let positions = Positions::from_map(&lattice, |[x, y]| [x + shift, y + shift]);
        let map = Map::Forward { lattice: &lattice, positions: &positions };
        let window = bounds(&map, source, limit, UNWATCHED).expect("nobody stops it").expect("forward");
        assert_eq!((window.width(), window.height()), (7, 6));
        for filter in [Filter::Linear, Filter::Cubic, Filter::Mitchell, Filter::Lanczos3] {
            let out = &drawn(&map, source, window, filter, Edge::Transparent, &[vec![1.0; 30]]).0[0];
            for (i, &value) in out.iter().enumerate() {
                let opposite = out[41 - i];
                assert!((value - opposite).abs() < 1e-6 && value > 0.2, "{filter:?} {i}: {value} {opposite}");
            }
        }
    }
}

/// A spot of 100 on 0.18, moved by parts of a pixel.
fn spot(filter: Filter, clamp_ringing: bool, shift: [f64; 2]) -> Vec<f32> {
    let window = Rect::new(0, 0, 40, 30);
    let lattice = over(window, [4, 3]);
    let positions = Positions::from_map(&lattice, |[x, y]| [x + shift[0], y + shift[1]]);
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    let (mut plane, mut out) = (vec![0.18; 1200], vec![0.0; 1200]);
    plane[15 * 40 + 20] = 100.0;
    let sampling = Sampling { filter, edge: Edge::Clamp, clamp_ringing };
    let views = [View::packed(&plane, 40, 30)];
    draw(&map, window, window, &sampling, &views, vec![ViewMut::packed(&mut out, 40, 30)], UNWATCHED)
        .expect("unwatched");
    out
}

#[test]
fn clamped_ringing_stays_within_the_neighbours() {
    for (filter, shift) in [Filter::Cubic, Filter::Mitchell, Filter::Lanczos3]
        .into_iter()
        .flat_map(|filter| [[0.4, 0.6], [0.5, 0.5], [0.3, 0.0]].map(|shift| (filter, shift)))
    {
        let (free, cut) = (spot(filter, false, shift), spot(filter, true, shift));
        let least = |values: &[f32]| values.iter().copied().fold(f32::INFINITY, f32::min);
        assert!(least(&free) < -1.0, "{filter:?} {shift:?} rings: {}", least(&free));
        assert_eq!(least(&cut), 0.18, "{filter:?} {shift:?}");
        for (free, cut) in free.iter().zip(&cut) {
            assert!(*cut == *free || (*cut == 0.18) || *cut == 100.0, "only what rings is touched: {free} {cut}");
        }
    }
}

#[test]
fn bad_samples_are_counted() {
    let window = Rect::new(0, 0, 40, 30);
    let lattice = over(window, [4, 3]);
    let positions = Positions::from_map(&lattice, |[x, y]| [x + 0.5, y + 0.5]);
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    let mut plane = vec![1.0; 1200];
    (plane[15 * 40 + 20], plane[3]) = (f32::NAN, f32::INFINITY);
    let views = [View::packed(&plane, 40, 30)];
    // The second one's footprint is cut by the upper border; for the nearest each is one pixel.
    for (filter, expected) in
        [(Filter::Nearest, 2), (Filter::Linear, 4 + 4), (Filter::Cubic, 16 + 12), (Filter::Lanczos3, 36 + 24)]
    {
        let mut out = vec![0.0; 1200];
        let sampling = Sampling { filter, edge: Edge::Transparent, clamp_ringing: false };
        let outs = vec![ViewMut::packed(&mut out, 40, 30)];
        let drawn = draw(&map, window, window, &sampling, &views, outs, UNWATCHED).expect("unwatched");
        assert_eq!(drawn.bad, out.iter().filter(|value| !value.is_finite()).count() as u64);
        assert_eq!(drawn.bad, expected, "{filter:?}");
    }
}

#[test]
fn a_watch_stops_it() {
    let window = Rect::new(0, 0, 300, 80);
    let (lattice, positions) = bent(false);
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    let plane = noise(300 * 80, 1);
    let mut out = vec![0.0; 300 * 80];
    let stop = |part: f64| if part > 0.0 { Err(Interrupted) } else { Ok(()) };
    let views = [View::packed(&plane, 300, 80)];
    let outs = vec![ViewMut::packed(&mut out, 300, 80)];
    let sampling = Sampling { filter: Filter::Cubic, edge: Edge::Wrap, clamp_ringing: false };
    assert_eq!(draw(&map, window, window, &sampling, &views, outs, &stop), Err(Interrupted));
}
