//! The elliptical filter.

use super::*;
use crate::Watcher;
use std::f64::consts::PI;
use std::sync::atomic::{AtomicUsize, Ordering};

type Matrix = [[f64; 2]; 2];

/// Turned by `degrees` after scaling by `across` and `down`.
fn turned(across: f64, down: f64, degrees: f64) -> Matrix {
    let (s, c) = (libm::sin(degrees * PI / 180.0), libm::cos(degrees * PI / 180.0));
    [[c * across, -s * down], [s * across, c * down]]
}

fn middle(window: Rect) -> [f64; 2] {
    [(window.x0 + window.x1) as f64 / 2.0, (window.y0 + window.y1) as f64 / 2.0]
}

/// The lattice over `dst` and where its nodes come from: the middles meet.
fn affine(matrix: Matrix, source: Rect, dst: Rect) -> (Lattice, Positions) {
    let ([a, b], [cx, cy]) = (middle(source), middle(dst));
    let lattice = over(dst, [2, 3]);
    let positions = Positions::from_map(&lattice, |[x, y]| {
        let (x, y) = (x - cx, y - cy);
        [a + matrix[0][0] * x + matrix[0][1] * y, b + matrix[1][0] * x + matrix[1][1] * y]
    });
    (lattice, positions)
}

/// One plane drawn through a backward affine map, and how many samples are bad.
fn shrunk(matrix: Matrix, source: Rect, dst: Rect, edge: Edge, clamp_ringing: bool, plane: &[f32]) -> (Vec<f32>, u64) {
    let (lattice, positions) = affine(matrix, source, dst);
    let map = Map::Backward { lattice: &lattice, positions: &positions };
    let mut out = vec![f32::NAN; dst.width() * dst.height()];
    let views = [View::packed(plane, source.width(), source.height())];
    let outs = vec![ViewMut::packed(&mut out, dst.width(), dst.height())];
    let sampling = Sampling { filter: Filter::Ewa, edge, clamp_ringing };
    let drawn = draw(&map, source, dst, &sampling, &views, outs, UNWATCHED).expect("unwatched");
    (out, drawn.bad)
}

/// A plane by the place of each pixel's centre.
fn painted(window: Rect, value: impl Fn(f64, f64) -> f64) -> Vec<f32> {
    let center = |i: usize, x0: i64, by: usize| (x0 + (i % by) as i64) as f64 + 0.5;
    let width = window.width();
    (0..width * window.height())
        .map(|i| value(center(i, window.x0, width), center(i / width, window.y0, usize::MAX)) as f32)
        .collect()
}

const SOURCE: Rect = Rect::new(-20, 10, 172, 161);

fn worst(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn a_constant_stays(m in prop::array::uniform4(-14.0..14.0f64), edge in 1..4usize) {
        let dst = Rect::new(-4, 0, 15, 13);
        let plane = vec![0.7_f32; SOURCE.width() * SOURCE.height()];
        let (out, bad) = shrunk([[m[0], m[1]], [m[2], m[3]]], SOURCE, dst, EDGES[edge], false, &plane);
        prop_assert_eq!(bad, 0);
        prop_assert!(out.iter().all(|value| (value - 0.7).abs() < 1e-6), "{:?}", out);
    }
}

#[test]
fn without_a_shrink_it_is_cubic_bit_for_bit() {
    let dst = Rect::new(0, 0, 210, 170);
    let planes = [hard_picture(SOURCE, 1), noise(SOURCE.width() * SOURCE.height(), 2)];
    for matrix in
        [turned(1.0, 1.0, 0.0), turned(1.0, 1.0, 33.0), turned(-1.0, 1.0, 90.0), turned(0.5, 0.8, 10.0), [[0.0; 2]; 2]]
    {
        let (lattice, positions) = affine(matrix, SOURCE, dst);
        let (from, _) = affine(matrix, dst, SOURCE);
        let det = matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0];
        let inverse = [[matrix[1][1], -matrix[0][1]], [-matrix[1][0], matrix[0][0]]].map(|row| row.map(|m| m / det));
        let (_, ahead) = affine(inverse, dst, SOURCE);
        let backward = Map::Backward { lattice: &lattice, positions: &positions };
        let forward = Map::Forward { lattice: &from, positions: &ahead };
        for (map, edge) in [backward, forward].iter().flat_map(|map| EDGES.map(|edge| (map, edge))) {
            let [ewa, cubic] =
                [Filter::Ewa, Filter::Cubic].map(|filter| drawn(map, SOURCE, dst, filter, edge, &planes));
            assert!((0..2).all(|i| bits(&ewa.0[i]) == bits(&cubic.0[i])), "{matrix:?} {edge:?}");
            assert_eq!(ewa.1, cubic.1, "{matrix:?} {edge:?}");
        }
    }
}

#[test]
fn weight_and_place_of_a_spot_are_kept() {
    let dst = Rect::new(3, -5, 100, 84);
    let [cx, cy] = middle(SOURCE);
    let plane = painted(SOURCE, |x, y| libm::exp(-((x - cx - 7.0).powi(2) + (y - cy + 4.0).powi(2)) / 2.0 / 81.0));
    let total: f64 = plane.iter().map(|&value| f64::from(value)).sum();
    // In a level the ellipse is 1.7 to 2 pixels long: the sums of its few weights differ by 1 % from place to place, of which
    // a spot no larger than a pixel drawn keeps up to 0.3 %; in the source itself they would by 1e-5.
    for (matrix, tolerance) in [
        (turned(2.0, 2.0, 0.0), 2e-3),
        (turned(3.0, 2.2, 20.0), 2e-3),
        (turned(6.0, 2.0, -70.0), 2e-3),
        (turned(5.0, 4.5, 30.0), 2e-3),
        (turned(1.1, 1.0, 5.0), 2e-3),
        (turned(9.0, -8.0, 45.0), 3e-3),
    ] {
        let (out, _) = shrunk(matrix, SOURCE, dst, Edge::Transparent, false, &plane);
        let [mx, my] = middle(dst);
        let mut sums = [0.0; 3];
        for (i, &value) in out.iter().enumerate() {
            let [x, y] = [(i % 97) as f64 + 3.5 - mx, (i / 97) as f64 - 4.5 - my];
            let place = [matrix[0][0] * x + matrix[0][1] * y, matrix[1][0] * x + matrix[1][1] * y];
            let value = f64::from(value);
            sums = [sums[0] + value, sums[1] + value * place[0], sums[2] + value * place[1]];
        }
        let area = (matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0]).abs();
        assert!((sums[0] * area / total - 1.0).abs() < tolerance, "{matrix:?}: {}", sums[0] * area / total);
        let [x, y] = [sums[1] / sums[0], sums[2] / sums[0]];
        assert!((x - 7.0).abs() < 0.05 && (y + 4.0).abs() < 0.05, "{matrix:?}: {x} {y}");
    }
}

#[test]
fn weights_spread_as_the_pixel_does() {
    // The pixel's image, a parallelogram, has the second moments J J^T / 12.
    for (matrix, tolerance) in [
        (turned(9.0, 5.0, 0.0), 0.01),
        (turned(9.0, 5.0, 30.0), 0.01),
        (turned(12.0, 4.0, -50.0), 0.01),
        (turned(40.0, 4.0, 100.0), 0.01),
        (turned(2.0, 2.0, 0.0), 0.03),
        (turned(2.0, 1.5, 10.0), 0.06),
    ] {
        let axes = axes::Axes::of([[matrix[0][0], matrix[1][0]], [matrix[0][1], matrix[1][1]]]);
        let mut weights = ellipse::Weights::default();
        let center = [50.3, 60.8];
        weights.lay(lanes::Plain, &ellipse::Ellipse::new(&axes, 0, [1.0; 2]), center);
        let mut groups = weights.groups.iter();
        let mut sums = [0.0; 6];
        for run in &weights.runs {
            for (i, &weight) in groups.by_ref().take(run.groups).flatten().enumerate() {
                let x = f64::from(run.first) + i as f64 + 0.5 - center[0];
                let y = f64::from(run.row) + 0.5 - center[1];
                for (sum, power) in sums.iter_mut().zip([1.0, x, y, x * x, x * y, y * y]) {
                    *sum += f64::from(weight) * power;
                }
            }
        }
        assert!((sums[0] - f64::from(weights.sum)).abs() < 1e-4 * sums[0]);
        let [_, x, y, xx, xy, yy] = sums.map(|sum| sum / sums[0]);
        let [[a, b], [c, d]] = matrix;
        let size = (a * a + b * b + c * c + d * d) / 12.0;
        assert!(x.abs() < 0.05 && y.abs() < 0.05, "{matrix:?}: {x} {y}");
        for (found, expected) in [(xx, a * a + b * b), (xy, a * c + b * d), (yy, c * c + d * d)] {
            assert!((found - expected / 12.0).abs() < tolerance * size, "{matrix:?}: {found} {}", expected / 12.0);
        }
    }
}

#[test]
fn quarter_turns_commute() {
    // The square picture, turned clockwise before and after.
    let (source, dst) = (Rect::new(0, 0, 92, 92), Rect::new(0, 0, 30, 30));
    let turn = |plane: &[f32], size: usize| -> Vec<f32> {
        (0..size * size).map(|i| plane[(size - 1 - i % size) * size + i / size]).collect()
    };
    let plane = noise(92 * 92, 5);
    for [[a, b], [c, d]] in
        [turned(3.0, 3.0, 0.0), turned(2.5, 1.2, 25.0), turned(7.0, 2.0, 70.0), turned(6.0, 5.0, 0.0)]
    {
        for edge in EDGES {
            let whole = shrunk([[a, b], [c, d]], source, dst, edge, false, &plane).0;
            // R M R^-1 with R = [[0, -1], [1, 0]].
            let other = shrunk([[d, -c], [-b, a]], source, dst, edge, false, &turn(&plane, 92)).0;
            let difference = worst(&turn(&whole, 30), &other);
            assert!(difference < 2e-5, "{:?} {edge:?}: {difference}", [[a, b], [c, d]]);
        }
    }
}

#[test]
fn a_ramp_stays_a_ramp() {
    let dst = Rect::new(0, 0, 23, 19);
    let plane = painted(SOURCE, |x, y| 0.5 * x - 0.25 * y);
    let [[sx, sy], [dx, dy]] = [middle(SOURCE), middle(dst)];
    for matrix in [
        turned(2.0, 2.0, 0.0),
        turned(4.0, 1.0, 0.0),
        turned(4.0, 1.0, 30.0),
        turned(3.3, 2.7, 50.0),
        turned(5.0, 4.4, 8.0),
    ] {
        let (out, _) = shrunk(matrix, SOURCE, dst, Edge::Mirror, false, &plane);
        for (i, &value) in out.iter().enumerate() {
            let [x, y] = [(i % 23) as f64 + 0.5 - dx, (i / 23) as f64 + 0.5 - dy];
            let [x, y] = matrix.map(|row| row[0] * x + row[1] * y);
            let far = x.abs().max(y.abs()) > 60.0;
            let expected = 0.5 * (x + sx) - 0.25 * (y + sy);
            assert!(far || (f64::from(value) - expected).abs() < 0.03, "{matrix:?}: {value}, not {expected}");
        }
    }
}

#[test]
fn detail_finer_than_the_pixels_turns_grey() {
    // Of odd height, so that its rows meet rows where nothing shrinks.
    let dst = Rect::new(0, 0, 20, 21);
    let checker = painted(SOURCE, |x, y| ((x.floor() + y.floor()) as i64).rem_euclid(2) as f64);
    let [rows, columns] = [1, 0].map(|axis| painted(SOURCE, |x, y| ([x, y][axis].floor() as i64).rem_euclid(2) as f64));
    let contrast = |plane: &[f32], matrix| {
        let out = shrunk(matrix, SOURCE, dst, Edge::Mirror, false, plane).0;
        let least = out.iter().copied().fold(f32::INFINITY, f32::min);
        (least, out.into_iter().fold(f32::NEG_INFINITY, f32::max))
    };
    for matrix in [turned(3.0, 3.0, 0.0), turned(3.1, 2.9, 20.0), turned(6.0, 6.0, 0.0), turned(7.0, 2.5, 33.0)] {
        let (least, most) = contrast(&checker, matrix);
        assert!(least > 0.45 && most < 0.55, "{matrix:?}: {least} to {most}");
    }
    // Shrunk along x alone the columns go and the rows stay.
    let matrix = turned(4.0, 1.0, 0.0);
    let ((least, most), (low, high)) = (contrast(&columns, matrix), contrast(&rows, matrix));
    assert!(least > 0.45 && most < 0.55, "{least} to {most}");
    assert!(low < 0.35 && high > 0.65, "{low} to {high}");
}

/// The mean over 8 x 8 places of each pixel of a picture known everywhere.
fn supersampled(matrix: Matrix, dst: Rect, value: impl Fn(f64, f64) -> f64) -> Vec<f32> {
    let [[sx, sy], [dx, dy]] = [middle(SOURCE), middle(dst)];
    painted(dst, |x, y| {
        let places = (0..64).map(|i| [x + (i % 8) as f64 / 8.0 - 0.4375 - dx, y + (i / 8) as f64 / 8.0 - 0.4375 - dy]);
        places
            .map(|[x, y]| value(sx + matrix[0][0] * x + matrix[0][1] * y, sy + matrix[1][0] * x + matrix[1][1] * y))
            .sum::<f64>()
            / 64.0
    })
}

#[test]
fn it_is_near_the_mean_over_the_pixel() {
    let wave = |x: f64, y: f64| 0.5 + 0.25 * libm::sin(0.31 * x + 0.1 * y) + 0.25 * libm::cos(0.27 * y - 0.13 * x);
    let (dst, plane) = (Rect::new(0, 0, 14, 14), painted(SOURCE, wave));
    for (matrix, tolerance) in [
        (turned(2.0, 2.0, 0.0), 0.005),
        (turned(4.0, 4.0, 0.0), 0.01),
        (turned(4.0, 1.0, 30.0), 0.01),
        (turned(8.0, 2.0, 45.0), 0.03),
        (turned(8.0, 8.0, 10.0), 0.03),
    ] {
        let out = shrunk(matrix, SOURCE, dst, Edge::Mirror, false, &plane).0;
        let difference = worst(&out, &supersampled(matrix, dst, wave));
        assert!(difference < tolerance, "{matrix:?}: {difference}");
    }
}

#[test]
fn it_changes_over_without_a_step() {
    // The same pixel while the shrink grows by thousandths: 1 is where Cubic ends, 4 and 8 where the next level starts.
    let source = Rect::new(-3, 2, 62, 66);
    let (dst, plane) =
        (Rect::new(0, 0, 1, 1), painted(source, |x, y| ((x * 7.0 + y * 13.0) as i64 % 17) as f64 / 17.0));
    for (down, turn) in [(1.0, 0.0), (0.6, 35.0), (0.1, 20.0)] {
        let at = |step: i32| {
            let shrink = 0.9 * libm::pow(1.001, f64::from(step));
            shrunk(turned(shrink, down * shrink, turn), source, dst, Edge::Mirror, false, &plane).0[0]
        };
        let values: Vec<f32> = (0..2600).map(at).collect();
        let jump = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max);
        assert!(jump < 0.01, "{down} {turn}: {jump}");
    }
}

#[test]
fn nan_spreads_over_the_ellipse_only() {
    let dst = Rect::new(0, 0, 40, 40);
    let [cx, cy] = middle(SOURCE);
    let mut plane = vec![1.0; SOURCE.width() * SOURCE.height()];
    plane[75 * SOURCE.width() + 96] = f32::NAN;
    // The broken pixel's centre, from the middle.
    let broken = [f64::from(-20 + 96) + 0.5 - cx, f64::from(10 + 75) + 0.5 - cy];
    // The radii, of which the halved picture's broken pixel adds a little.
    for (across, down, turn, along, beside) in
        [(3.0, 3.0, 0.0, 3.5, 3.5), (4.0, 1.0, 30.0, 6.0, 1.5), (9.0, 9.0, 0.0, 13.0, 13.0), (1.1, 1.1, 0.0, 2.9, 2.9)]
    {
        let matrix = turned(across, down, turn);
        let (out, bad) = shrunk(matrix, SOURCE, dst, Edge::Clamp, false, &plane);
        assert_eq!(bad, out.iter().filter(|value| value.is_nan()).count() as u64);
        assert!(bad > 0 && out.iter().all(|&value| value.is_nan() || (value - 1.0).abs() < 1e-6));
        for (i, _) in out.iter().enumerate().filter(|(_, value)| value.is_nan()) {
            // In the ellipse's frame the turn is undone: the destination's own axes, scaled.
            let (s, c) = (libm::sin(turn * PI / 180.0), libm::cos(turn * PI / 180.0));
            let there = [c * broken[0] + s * broken[1], c * broken[1] - s * broken[0]];
            let [x, y] = [((i % 40) as f64 - 19.5) * across - there[0], ((i / 40) as f64 - 19.5) * down - there[1]];
            assert!((x / along).powi(2) + (y / beside).powi(2) < 1.0, "{matrix:?}: {x} {y}");
        }
    }
}

#[test]
fn clamped_ringing_leaves_a_step_its_range() {
    let dst = Rect::new(0, 0, 40, 40);
    let mut ringing = 0;
    let step = painted(SOURCE, |x, _| f64::from(u8::from(x > 71.3)));
    for matrix in [turned(1.1, 1.1, 3.0), turned(2.0, 2.0, 0.0), turned(3.0, 1.0, 50.0), turned(4.6, 4.6, 0.0)] {
        let range = |clamp| {
            let out = shrunk(matrix, SOURCE, dst, Edge::Clamp, clamp, &step).0;
            let least = out.iter().copied().fold(f32::INFINITY, f32::min);
            (least, out.into_iter().fold(f32::NEG_INFINITY, f32::max))
        };
        let (free, cut) = (range(false), range(true));
        assert!(free.0 > -0.1 && free.1 < 1.1, "{matrix:?}: {free:?}");
        ringing += u32::from(free.0 < -0.001 && free.1 > 1.001);
        assert!(cut.0 == 0.0 && (cut.1 - 1.0).abs() < 1e-6, "{matrix:?}: {cut:?}");
    }
    assert!(ringing >= 2, "{ringing}");
}

/// A warp over a source of 300 x 200 that shrinks by 1 at the left to some 12 at the right.
fn funnel() -> (Lattice, Positions) {
    let lattice = over(Rect::new(0, 0, 300, 200), [25, 20]);
    let positions = Positions::from_map(&lattice, |[x, y]| {
        let scale = 1.0 / (1.0 + x / 40.0);
        [40.0 * libm::log1p(x / 40.0), 50.0 + (y - 100.0) * scale + 2.0 * libm::sin(x * 0.1)]
    });
    (lattice, positions)
}

#[test]
fn thread_counts_and_windows_do_not_show() {
    let (source, dst) = (Rect::new(0, 0, 300, 200), Rect::new(-20, -40, 110, 160));
    let planes: Vec<_> = (0..5).map(|seed| noise(300 * 200, seed)).collect();
    let (lattice, positions) = funnel();
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    for edge in EDGES {
        let results = [1, 2, 3, 8].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let (out, count) = pool.install(|| drawn(&map, source, dst, Filter::Ewa, edge, &planes));
            (out.iter().map(|plane| bits(plane)).collect::<Vec<_>>(), count)
        });
        assert!(results.iter().all(|result| *result == results[0]), "{edge:?}");
        assert!(results[0].1 > 5_000);
        let part = drawn(&map, source, Rect::new(7, -9, 80, 100), Filter::Ewa, edge, &planes[..1]).0;
        for (i, value) in part[0].iter().enumerate() {
            let (x, y) = (i % 73 + 27, i / 73 + 31);
            assert_eq!(value.to_bits(), results[0].0[0][y * 130 + x], "{edge:?} {x} {y}");
        }
    }
}

#[test]
fn forward_and_backward_shrink_alike() {
    let dst = Rect::new(0, 0, 50, 50);
    let plane = noise(SOURCE.width() * SOURCE.height(), 9);
    for matrix in [turned(3.0, 3.0, 0.0), turned(6.0, 2.0, 40.0), turned(9.0, -9.0, 10.0), turned(1.2, 0.7, 20.0)] {
        let det = matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0];
        let inverse = [[matrix[1][1], -matrix[0][1]], [-matrix[1][0], matrix[0][0]]].map(|row| row.map(|m| m / det));
        let (lattice, ahead) = affine(inverse, dst, SOURCE);
        let map = Map::Forward { lattice: &lattice, positions: &ahead };
        for edge in EDGES {
            let backward = shrunk(matrix, SOURCE, dst, edge, false, &plane).0;
            let (forward, _) = drawn(&map, SOURCE, dst, Filter::Ewa, edge, std::slice::from_ref(&plane));
            let difference = worst(&forward[0], &backward);
            assert!(difference < 1e-4, "{matrix:?} {edge:?}: {difference}");
        }
    }
}

#[test]
fn a_wrapped_picture_is_the_picture_side_by_side() {
    // Odd sides, so that the halved pictures do not repeat by themselves; the mirrored picture stands at its side.
    let (small, dst) = (Rect::new(0, 0, 75, 75), Rect::new(0, 0, 40, 40));
    let plane = painted(small, |x, y| {
        let [x, y] = [x, y].map(|at| 2.0 * PI / 75.0 * at);
        0.5 + 0.5 * libm::sin(2.0 * x) * libm::cos(3.0 * y + x)
    });
    let large = Rect::new(-225, -225, 300, 300);
    for (edge, matrix) in [Edge::Wrap, Edge::Mirror]
        .into_iter()
        .flat_map(|edge| [turned(3.0, 3.0, 0.0), turned(9.0, 5.0, 30.0)].map(|matrix| (edge, matrix)))
    {
        let copied = painted(large, |x, y| {
            let [x, y] = [x, y].map(|at| match (edge, (at.floor() + 300.0) as usize % 150) {
                (Edge::Mirror, phase @ 75..) => 149 - phase,
                (_, phase) => phase % 75,
            });
            f64::from(plane[y * 75 + x])
        });
        let whole = shrunk(matrix, large, dst, Edge::Clamp, false, &copied).0;
        let repeated = shrunk(matrix, small, dst, edge, false, &plane).0;
        let difference = worst(&whole, &repeated);
        assert!(difference < 0.02, "{edge:?} {matrix:?}: {difference}");
    }
}

/// Counts the bytes asked for.
struct Asked(AtomicUsize);

impl Watcher for Asked {
    fn progress(&self, _: f64) -> Result<(), Interrupted> {
        Ok(())
    }

    fn go_on(&self) -> Result<(), Interrupted> {
        Ok(())
    }

    fn reserve(&self, bytes: usize) -> Result<(), Interrupted> {
        self.0.fetch_add(bytes, Ordering::Relaxed);
        Ok(())
    }
}

#[test]
fn the_picture_is_halved_only_where_it_shrinks_more_than_4_times() {
    let dst = Rect::new(0, 0, 9, 9);
    let plane = noise(SOURCE.width() * SOURCE.height(), 9);
    let asked = |matrix| {
        let (lattice, positions) = affine(matrix, SOURCE, dst);
        let map = Map::Backward { lattice: &lattice, positions: &positions };
        let (mut out, asked) = (vec![0.0; 81], Asked(AtomicUsize::new(0)));
        let views = [View::packed(&plane, SOURCE.width(), SOURCE.height())];
        let sampling = Sampling { filter: Filter::Ewa, edge: Edge::Mirror, clamp_ringing: false };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
        let outs = vec![ViewMut::packed(&mut out, 9, 9)];
        pool.install(|| draw(&map, SOURCE, dst, &sampling, &views, outs, &asked)).expect("nobody stops it");
        asked.0.into_inner()
    };
    let least = asked(turned(1.0, 1.0, 0.0));
    assert_eq!(asked(turned(3.99, 3.99, 10.0)), least);
    assert_eq!(asked(turned(60.0, 3.0, 10.0)), least, "the minor axis is what counts");
    // 96 x 76 and 48 x 38 pixels; from 7.5 on the first is not needed.
    assert_eq!(asked(turned(5.5, 5.5, 10.0)), least + 96 * 76 * 4);
    assert_eq!(asked(turned(7.0, 7.0, 10.0)), least + (96 * 76 + 48 * 38) * 4);
    assert_eq!(asked(turned(9.0, 9.0, 10.0)), least + 48 * 38 * 4);
}

#[test]
fn levels_cover_the_picture_exactly() {
    let plane = [1.0, 3.0, 5.0, 3.0, 5.0, 7.0, 8.0, 0.0, 20.0];
    let view = [View::packed(&plane, 3, 3)];
    for edge in EDGES {
        let source = sample::Source { window: Rect::new(4, 4, 7, 7), edge };
        let levels = pyramid::halved(&source, &view, [1, 2], UNWATCHED).expect("unwatched");
        // A level pixel is 3/2 px wide and high.
        let [a, b, c, d] = [5.25, 11.25, 10.75, 24.75].map(|sum| sum / 2.25);
        let [level, once] = [0, 1].map(|i| levels[i].view(0));
        if edge == Edge::Clamp {
            // The rim: means along the border, and its corners.
            let expected = [
                [1.0, 5.0 / 3.0, 13.0 / 3.0, 5.0],
                [5.0 / 3.0, a, b, 17.0 / 3.0],
                [19.0 / 3.0, c, d, 47.0 / 3.0],
                [8.0, 16.0 / 3.0, 40.0 / 3.0, 20.0],
            ];
            for (row, expected) in expected.iter().enumerate() {
                assert!(worst(level.row(row), expected) < 1e-5, "{row}: {:?}", level.row(row));
            }
            assert!((once.row(1)[1] - 52.0 / 9.0).abs() < 1e-6);
        } else {
            assert!(worst(&[level.row(0), level.row(1)].concat(), &[a, b, c, d]) < 1e-6, "{edge:?}");
            assert!((once.row(0)[0] - 52.0 / 9.0).abs() < 1e-6);
        }
        let alone = pyramid::halved(&source, &view, [2, 2], UNWATCHED).expect("unwatched");
        assert_eq!(bits(alone[0].view(0).row(0)), bits(once.row(0)), "a level is the same whichever others there are");
    }
    assert_eq!([1, 2, 3, 5].map(|side| pyramid::most(&Rect::new(0, 0, side, 1))), [0, 1, 2, 3]);
}

#[test]
#[cfg(target_arch = "x86_64")]
fn wide_and_plain_lanes_have_the_same_bits() {
    let Some(wide) = pulp::x86::V4::try_new() else { return };
    let samples: Vec<[f32; 4]> = noise(4 * 60 * 60, 3).as_chunks().0.to_vec();
    for (i, matrix) in [turned(2.0, 2.0, 0.0), turned(4.0, 4.0, 8.0), turned(9.0, 2.0, 30.0), turned(1.3, 1.0, 80.0)]
        .into_iter()
        .enumerate()
    {
        let axes = axes::Axes::of([[matrix[0][0], matrix[1][0]], [matrix[0][1], matrix[1][1]]]);
        let ellipse = ellipse::Ellipse::new(&axes, 0, [1.0; 2]);
        let [x, y] = ellipse.reach();
        let spot = ellipse.spot(0.3 - x, 0.6 - y);
        let (narrow, rows) = (ellipse.is_narrow(), ellipse.rows() as usize);
        assert_eq!(narrow, i != 2);
        let plain = spot.sums(lanes::Plain, narrow, rows, &samples, 60);
        let vectors = spot.sums(wide, narrow, rows, &samples, 60);
        let plain = ellipse::means(lanes::Plain, [plain; 4]);
        let vectors = ellipse::means(wide, [vectors; 4]);
        assert_eq!(bits(plain.as_flattened()), bits(vectors.as_flattened()), "{matrix:?}");
    }
}

/// Draws one plane shrunk about the source's corner, which comes to stand at `shift`.
fn shrunk_to(source: Rect, plane: &[f32], edge: Edge, dst: Rect, shrink: f64, shift: f64) -> Vec<f32> {
    let lattice = over(Rect::new(-40, -40, 40, 40), [2, 2]);
    let positions = Positions::from_map(&lattice, |[x, y]| [shrink * (x - shift), shrink * (y - shift)]);
    let map = Map::Backward { lattice: &lattice, positions: &positions };
    drawn(&map, source, dst, Filter::Ewa, edge, &[plane.to_vec()]).0.remove(0)
}

#[test]
fn outside_a_clamped_picture_is_its_border() {
    let source = Rect::new(0, 0, 61, 64);
    let plane: Vec<f32> = (0..61 * 64).map(|i| if i % 61 == 0 { 1.0 } else { 0.0 }).collect();
    for shrink in [2.0, 4.0, 5.0, 8.0, 20.0, 64.0, 700.0] {
        for value in shrunk_to(source, &plane, Edge::Clamp, Rect::new(-40, -9, -30, 9), shrink, 0.0) {
            assert!((value - 1.0).abs() < 1e-5, "{shrink}: {value}");
        }
    }
}

#[test]
fn a_picture_shrunk_to_less_than_a_pixel_does_not_vanish() {
    let source = Rect::new(0, 0, 16, 16);
    for shrink in [10.0, 20.0, 30.0] {
        for shift in [-3.0, -2.5, -2.25, -2.1] {
            let dst = Rect::new(-12, -12, 12, 12);
            let light: f32 = shrunk_to(source, &[1.0; 256], Edge::Transparent, dst, shrink, shift).iter().sum();
            let expected = (16.0 / shrink as f32).powi(2);
            // A picture smaller than a pixel meets the kernel at a point or two.
            assert!((0.2..1.3).contains(&(light / expected)), "{shrink} {shift}: {light}, not {expected}");
        }
    }
}

#[test]
fn a_strong_shrink_cropped_is_part_of_the_whole() {
    let source = Rect::new(0, 0, 65, 67);
    let plane = noise(65 * 67, 5);
    let (whole, part) = (Rect::new(0, 0, 120, 20), Rect::new(90, 3, 118, 17));
    let lattice = over(whole, [24, 4]);
    // From 1 to 40 times.
    let positions = Positions::from_map(&lattice, |[x, y]| [x + x * x * 0.16, (1.0 + 0.32 * x) * y]);
    let map = Map::Backward { lattice: &lattice, positions: &positions };
    for edge in EDGES {
        let [all, some] = [whole, part]
            .map(|dst| drawn(&map, source, dst, Filter::Ewa, edge, std::slice::from_ref(&plane)).0.remove(0));
        for (i, value) in some.iter().enumerate() {
            let at = (3 + i / 28) * 120 + 90 + i % 28;
            assert_eq!(value.to_bits(), all[at].to_bits(), "{edge:?} {i}");
        }
    }
}
