use super::level::disc;
use super::*;
use crate::UNWATCHED;
use proptest::prelude::*;

const BOUNDARIES: [Boundary; 3] = [Boundary::Wrap, Boundary::Mirror, Boundary::Clamp];

/// Three planes of codes.
#[derive(Clone, Debug, PartialEq)]
struct Picture {
    planes: [Vec<u8>; 3],
    size: [usize; 2],
}

impl Picture {
    fn new(size: [usize; 2], seed: usize) -> Self {
        let code = |i: usize| ((i + 977 * seed).wrapping_mul(2_654_435_761) >> 11) as u8;
        let pixels = size[0] * size[1];
        Self { planes: [0, 1, 2].map(|plane| (0..pixels).map(|i| code(3 * i + plane)).collect()), size }
    }

    fn guide(&self, diameter: usize, levels: &[u32], boundary: Boundary) -> Guide {
        let views = self.planes.each_ref().map(|plane| View::packed(plane, self.size[0], self.size[1]));
        guide(&views, diameter, levels, boundary, UNWATCHED).expect("unwatched")
    }

    fn at(&self, plane: usize, x: isize, y: isize, boundary: Boundary) -> i64 {
        let [x, y] = [beyond(x, self.size[0], boundary), beyond(y, self.size[1], boundary)];
        self.planes[plane][y * self.size[0] + x].into()
    }

    fn smaller(&self, boundary: Boundary) -> Self {
        const TAPS: [i64; 5] = [1, 4, 6, 4, 1];
        let size = self.size.map(|side| side.div_ceil(2));
        let sample = |plane: usize, x: isize, y: isize| {
            let column =
                |dy: isize| (0..5).map(|i| TAPS[i] * self.at(plane, 2 * x + i as isize - 2, dy, boundary)).sum::<i64>();
            let sum: i64 = (0..5).map(|i| TAPS[i] * column(2 * y + i as isize - 2)).sum();
            ((sum + 128) / 256) as u8
        };
        let places = || (0..size[1] as isize).flat_map(|y| (0..size[0] as isize).map(move |x| (x, y)));
        Self { planes: [0, 1, 2].map(|plane| places().map(|(x, y)| sample(plane, x, y)).collect()), size }
    }

    /// The definition, term by term.
    fn literal(&self, diameter: usize, levels: &[u32], boundary: Boundary, point: [usize; 2]) -> Vec<i64> {
        let mut pyramid = vec![self.clone()];
        (0..levels.iter().copied().max().unwrap_or(0))
            .for_each(|n| pyramid.push(pyramid[n as usize].smaller(boundary)));
        let reach = diameter as isize / 2;
        let offsets: Vec<_> = (-reach..=reach)
            .flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)))
            .filter(|(dx, dy)| 4 * (dx * dx + dy * dy) <= (diameter * diameter) as isize)
            .collect();
        let level = |n: u32, x: usize, y: usize| {
            let (picture, [x, y, sx, sy]) =
                (&pyramid[n as usize], [x, y, point[0], point[1]].map(|at| (at >> n) as isize));
            let squares = offsets.iter().flat_map(|(dx, dy)| {
                (0..3).map(move |plane| {
                    let [p, c] = [(x, y), (sx, sy)].map(|(x, y)| picture.at(plane, x + dx, y + dy, boundary));
                    (p - c) * (p - c)
                })
            });
            squares.sum::<i64>()
        };
        let pixels = (0..self.size[1]).flat_map(|y| (0..self.size[0]).map(move |x| (x, y)));
        pixels.map(|(x, y)| levels.iter().map(|n| level(*n, x, y)).sum()).collect()
    }

    /// Moved by whole pixels, as a tile.
    fn shifted(&self, by: [usize; 2]) -> Self {
        let planes = self.planes.each_ref().map(|plane| shifted(plane, self.size, by));
        Self { planes, ..*self }
    }
}

fn shifted<T: Copy>(plane: &[T], [width, height]: [usize; 2], [dx, dy]: [usize; 2]) -> Vec<T> {
    let from = |x: usize, y: usize| (y + height - dy) % height * width + (x + width - dx) % width;
    (0..height).flat_map(|y| (0..width).map(move |x| plane[from(x, y)])).collect()
}

/// The index that stands for another, found step by step.
fn beyond(mut at: isize, count: usize, boundary: Boundary) -> usize {
    let last = count as isize - 1;
    while !(0..=last).contains(&at) {
        at = match boundary {
            Boundary::Wrap if at < 0 => at + count as isize,
            Boundary::Wrap => at - count as isize,
            Boundary::Clamp => at.signum().max(0) * last,
            Boundary::Mirror if last == 0 => 0,
            Boundary::Mirror if at < 0 => -at,
            Boundary::Mirror => 2 * last - at,
        };
    }
    at as usize
}

fn map(guide: &Guide, points: &[[usize; 2]]) -> Vec<f32> {
    let [width, height] = guide.size();
    let mut out = vec![-1.0; width * height];
    distances(guide, points, ViewMut::packed(&mut out, width, height), UNWATCHED).expect("unwatched");
    out
}

fn exact(literal: &[i64]) -> Vec<f32> {
    literal.iter().map(|distance| *distance as f32).collect()
}

#[test]
fn the_disc_has_the_papers_counts() {
    let count = |diameter| disc(diameter).iter().map(|wide| 2 * wide + 1).sum::<usize>();
    let counts = [1, 3, 5, 7, 9, 11, 21].map(count);
    assert_eq!(counts, [1, 9, 21, 37, 69, 97, 349]);
}

#[test]
fn every_diameter_level_and_boundary_is_the_definition() {
    let lists: [&[u32]; 6] = [&[0], &[0, 1], &[1, 2], &[1], &[2, 0], &[0, 1, 3]];
    for (number, (diameter, levels)) in (1..=11).step_by(2).flat_map(|d| lists.map(|l| (d, l))).enumerate() {
        for boundary in BOUNDARIES {
            let picture = Picture::new([[37, 23], [16, 8], [9, 33], [67, 7]][number % 4], number);
            let [width, height] = picture.size;
            let point = [number * 7 % width, number * 5 % height];
            let guide = picture.guide(diameter, levels, boundary);
            let expected = picture.literal(diameter, levels, boundary, point);
            assert_eq!(map(&guide, &[point]), exact(&expected), "{diameter} {levels:?} {boundary:?} {point:?}");
        }
    }
}

#[test]
fn pictures_smaller_than_a_neighbourhood_are_the_definition() {
    for size in [[1, 1], [2, 1], [1, 3], [4, 3]] {
        for (boundary, levels) in BOUNDARIES.into_iter().flat_map(|b| [&[0][..], &[0, 1]].map(|levels| (b, levels))) {
            let picture = Picture::new(size, 5);
            let expected = picture.literal(9, levels, boundary, [0, 0]);
            assert_eq!(map(&picture.guide(9, levels, boundary), &[[0, 0]]), exact(&expected), "{size:?} {boundary:?}");
        }
    }
}

#[test]
fn extreme_codes_and_the_widest_disc_do_not_overflow() {
    let mut picture = Picture::new([130, 40], 0);
    let black = |i: usize| i % 130 < 40;
    picture.planes.iter_mut().for_each(|plane| {
        plane.iter_mut().enumerate().for_each(|(i, code)| *code = if black(i) { 0 } else { 255 });
    });
    let levels: Vec<u32> = (0..=coarsest(picture.size)).collect();
    let guide = picture.guide(21, &levels, Boundary::Mirror);
    let expected = picture.literal(21, &levels, Boundary::Mirror, [0, 0]);
    assert!(*expected.iter().max().expect("pixels") > 60_000_000 * 3);
    assert_eq!(map(&guide, &[[0, 0]]), exact(&expected));
    assert_eq!(guide.diameter(), 21);
}

#[test]
fn the_papers_maximum() {
    let planes = [0, 1, 2].map(|_| [vec![0; 64 * 32], vec![255; 64 * 32]].concat());
    let picture = Picture { planes, size: [64, 64] };
    let [one, two] =
        [(9, &[0][..]), (5, &[0, 1])].map(|(d, levels)| map(&picture.guide(d, levels, Boundary::Clamp), &[[32, 2]]));
    let largest = |map: Vec<f32>| map.into_iter().fold(0.0, f32::max);
    assert_eq!([largest(one), largest(two)], [13_460_175.0, 8_193_150.0]);
}

#[test]
fn points_are_alike_themselves_and_each_other_equally() {
    let picture = Picture::new([41, 30], 3);
    for boundary in BOUNDARIES {
        let guide = picture.guide(7, &[0, 1], boundary);
        let points = [[0, 0], [40, 29], [17, 3], [20, 14]];
        let maps = points.map(|point| map(&guide, &[point]));
        for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
            let [at_j, at_i] = [(i, j), (j, i)].map(|(of, at)| maps[of][points[at][1] * 41 + points[at][0]]);
            assert_eq!(at_j, at_i, "roles are symmetric");
            assert_eq!(at_j == 0.0, i == j);
        }
    }
}

#[test]
fn several_points_have_the_least_distance() {
    let guide = Picture::new([45, 31], 4).guide(5, &[1, 2], Boundary::Mirror);
    let points = [[3, 4], [30, 30], [44, 0]];
    let single = points.map(|point| map(&guide, &[point]));
    let least: Vec<f32> = (0..45 * 31).map(|i| single.iter().map(|map| map[i]).fold(f32::INFINITY, f32::min)).collect();
    assert_eq!(map(&guide, &points), least);
    assert_eq!(map(&guide, &[points[2], points[0], points[1], points[2]]), least, "in any order, any number of times");
}

#[test]
fn threads_do_not_change_it() {
    let picture = Picture::new([150, 97], 8);
    let run = || {
        let guide = picture.guide(9, &[0, 1, 2], Boundary::Wrap);
        let map = map(&guide, &[[5, 6], [100, 50]]);
        let reached = quantile(View::packed(&map, 150, 97), 0.37, UNWATCHED).expect("unwatched");
        let mut part = vec![0.0; map.len()];
        opacity(View::packed(&map, 150, 97), reached, 0.7, ViewMut::packed(&mut part, 150, 97));
        (map, reached, part)
    };
    let expected = run();
    for threads in [1, 2, 3, 8] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        assert!(pool.install(run) == expected, "{threads} threads");
    }
}

#[test]
fn opacity_in_literals() {
    let distances = [0.0, 25.0, 50.0, 100.0, 101.0, 0.0f32];
    let made = |threshold: f32, strength: f32| {
        let mut out = [9.0; 6];
        opacity(View::packed(&distances, 3, 2), threshold, strength, ViewMut::packed(&mut out, 3, 2));
        out
    };
    assert_eq!(made(100.0, 0.5), [0.5, 0.375, 0.25, 0.0, 0.0, 0.5]);
    assert_eq!(made(100.0, -2.0), [-2.0, -1.5, -1.0, 0.0, 0.0, -2.0]);
    assert_eq!(made(0.0, 0.5), [0.5, 0.0, 0.0, 0.0, 0.0, 0.5], "identical neighbourhoods only");
    assert!(made(10.0, -1.0)[2].is_sign_positive(), "nothing is 0, not -0");
}

#[test]
fn a_stopped_run_stops_and_refused_memory_refuses() {
    struct Refusing;
    impl crate::Watcher for Refusing {
        fn progress(&self, _: f64) -> Result<(), Interrupted> {
            Ok(())
        }
        fn go_on(&self) -> Result<(), Interrupted> {
            Ok(())
        }
        fn reserve(&self, _: usize) -> Result<(), Interrupted> {
            Err(Interrupted)
        }
    }
    let picture = Picture::new([40, 30], 1);
    let views = picture.planes.each_ref().map(|plane| View::packed(plane, 40, 30));
    for watch in [&Refusing as Watch, &|_| Err(Interrupted)] {
        assert!(guide(&views, 5, &[0, 1], Boundary::Mirror, watch).is_err());
        let (ready, mut out) = (picture.guide(5, &[0, 1], Boundary::Mirror), vec![0.0; 1200]);
        assert_eq!(distances(&ready, &[[0, 0]], ViewMut::packed(&mut out, 40, 30), watch), Err(Interrupted));
    }
}

#[test]
fn a_picture_without_pixels() {
    let views = [View::packed(&[], 0, 5); 3];
    let guide = guide(&views, 5, &[0, 1], Boundary::Wrap, UNWATCHED).expect("unwatched");
    assert_eq!((guide.size(), guide.bytes()), ([0, 5], 0));
    assert_eq!(quantile(View::packed(&[], 0, 5), 0.5, UNWATCHED), Ok(0.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn tiles_commute_with_shifts(dx in 0usize..8, dy in 0usize..6, x in 0usize..32, y in 0usize..24, seed in 0usize..99) {
        let (picture, by) = (Picture::new([32, 24], seed), [4 * dx, 4 * dy]);
        let made = |picture: &Picture, point| map(&picture.guide(5, &[0, 2], Boundary::Wrap), &[point]);
        let moved = made(&picture.shifted(by), [(x + by[0]) % 32, (y + by[1]) % 24]);
        prop_assert_eq!(moved, shifted(&made(&picture, [x, y]), [32, 24], by));
    }

    #[test]
    fn channels_and_axes_are_alike(x in 0usize..21, y in 0usize..17, seed in 0usize..99) {
        let (picture, size) = (Picture::new([21, 17], seed), [21, 17]);
        let made = |picture: &Picture, point| map(&picture.guide(7, &[0, 1, 2], Boundary::Mirror), &[point]);
        let expected = made(&picture, [x, y]);
        let [r, g, b] = picture.planes.clone();
        prop_assert_eq!(&made(&Picture { planes: [b, r, g], size }, [x, y]), &expected);
        let turned = |plane: &[u8]| (0..21).flat_map(|x| (0..17).map(move |y| plane[y * 21 + x])).collect::<Vec<u8>>();
        let turned = Picture { planes: picture.planes.each_ref().map(|plane| turned(plane)), size: [17, 21] };
        let back: Vec<f32> = { let map = made(&turned, [y, x]); (0..17).flat_map(|y| (0..21).map(|x| map[x * 17 + y]).collect::<Vec<_>>()).collect() };
        prop_assert_eq!(back, expected);
    }

    #[test]
    fn quantiles_are_those_of_the_sorted(numbers in proptest::collection::vec(0u32..3000, 1..200), part in 0.0f64..=1.0, by in 0.0f32..3e5) {
        let numbers: Vec<f32> = numbers.iter().map(|number| *number as f32 * by).collect();
        let mut sorted = numbers.clone();
        sorted.sort_by(f32::total_cmp);
        let rank = ((part * numbers.len() as f64).ceil() as usize).max(1) - 1;
        let found = quantile(View::packed(&numbers, 1, numbers.len()), part, UNWATCHED);
        prop_assert_eq!(found, Ok(sorted[rank]));
    }
}
