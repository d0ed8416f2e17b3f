use super::*;
use crate::UNWATCHED;
use crate::lattice::Lattice;
use crate::rect::Rect;
use crate::resample::{Map, pixel_sources};
use crate::transfer::Encoding;
use blur::blurred;
use local_blur::LocalBlur;
use look::distance;
use tree::Tree;

/// Planes of one size, row by row.
#[derive(Clone, PartialEq, Debug)]
struct Planes {
    width: usize,
    planes: [Vec<f32>; 3],
}

impl Planes {
    fn of(width: usize, height: usize, sample: impl Fn(usize, usize, usize) -> f32) -> Self {
        let plane = |channel| (0..width * height).map(|i| sample(channel, i % width, i / width)).collect();
        Self { width, planes: [0, 1, 2].map(plane) }
    }

    fn height(&self) -> usize {
        self.planes[0].len() / self.width
    }

    fn views(&self) -> [View<'_, f32>; 3] {
        self.planes.each_ref().map(|plane| View::packed(plane, self.width, self.height()))
    }

    fn bits(&self) -> Vec<u32> {
        self.planes.iter().flatten().map(|sample| sample.to_bits()).collect()
    }
}

/// A number in 0..1 of three.
fn noise(channel: usize, x: usize, y: usize) -> f32 {
    let mut state =
        (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77) ^ (channel as u32) << 20;
    state = (state ^ state >> 15).wrapping_mul(0x2C1B_3C6D);
    state = (state ^ state >> 12).wrapping_mul(0x297A_2D39);
    (state >> 8) as f32 / (1 << 24) as f32
}

/// Stones: discs in a lattice that differ in brightness, with grain on them.
fn stones(channel: usize, x: usize, y: usize) -> f32 {
    let [dx, dy] = [x % 12, y % 12].map(|at| at as f32 - 5.5);
    let inside = if dx * dx + dy * dy < 30.0 { 0.25 + 0.4 * noise(7, x / 12, y / 12) } else { 0.05 };
    inside + 0.1 * noise(0, x, y) + 0.02 * channel as f32
}

const SETTINGS: Settings = Settings { method: Method::Coherent, coherence: 1.0, blur: None, back_projections: 3 };

fn sets_of(training: &Planes, encoding: Encoding) -> SimilarSets {
    similar_sets(&training.views(), encoding, 3, UNWATCHED).expect("nobody stops it")
}

/// The result where nothing is known of where pixels come from.
fn run(sets: &SimilarSets, picture: &Planes, magnification: &[f32], settings: Settings) -> (Planes, Detailed) {
    let origins = Positions { x: vec![f64::NAN; magnification.len()], y: vec![f64::NAN; magnification.len()] };
    run_from(sets, picture, magnification, &origins, settings)
}

fn run_from(
    sets: &SimilarSets,
    picture: &Planes,
    magnification: &[f32],
    origins: &Positions,
    settings: Settings,
) -> (Planes, Detailed) {
    let (width, height) = (picture.width, picture.height());
    let mut out = Planes::of(width, height, |_, _, _| 9.0);
    let outs = out.planes.each_mut().map(|plane| ViewMut::packed(plane, width, height));
    let done = detail(sets, &picture.views(), magnification, origins, &settings, outs, UNWATCHED);
    (out, done.expect("nobody stops it"))
}

fn blur_of(picture: &Planes, deviation: f64) -> Planes {
    let blurred =
        |plane: &Vec<f32>| blurred(plane, picture.width, deviation * deviation, UNWATCHED).expect("unwatched");
    Planes { width: picture.width, planes: picture.planes.each_ref().map(blurred) }
}

fn root_mean_square(a: &Planes, b: &Planes) -> f64 {
    let pairs = a.planes.iter().flatten().zip(b.planes.iter().flatten());
    let sum: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (sum / (3 * a.planes[0].len()) as f64).sqrt()
}

/// Mean square of what the Laplacian leaves.
fn sharpness(picture: &Planes) -> f64 {
    let (plane, width) = (&picture.planes[1], picture.width);
    let inner = (1..picture.height() - 1).flat_map(|y| (1..width - 1).map(move |x| y * width + x));
    let bend = |i: usize| 4.0 * plane[i] - plane[i - 1] - plane[i + 1] - plane[i - width] - plane[i + width];
    inner.map(|i| f64::from(bend(i)).powi(2)).sum::<f64>() / plane.len() as f64
}

#[test]
fn analogies_give_the_original_for_itself() {
    let picture = Planes::of(23, 18, |_, x, y| noise(0, x, y));
    let settings = Settings { method: Method::Analogies, blur: Some(0.0), back_projections: 0, ..SETTINGS };
    for coherence in [0.0, 5.0] {
        let sets = sets_of(&picture, Encoding::Linear);
        let (out, done) = run(&sets, &picture, &[9.0; 23 * 18], Settings { coherence, ..settings });
        assert_eq!(out.bits(), picture.bits());
        assert_eq!((done.pixels, done.residual), (23 * 18, [0.0; 2]));
    }
}

#[test]
fn what_is_not_magnified_stays() {
    let picture = Planes::of(50, 40, stones);
    let soft = blur_of(&picture, 1.0);
    let limit = |x: usize| if x < 20 { 1.02 } else { 1.02 + 0.01 * (x - 20) as f32 };
    let magnification: Vec<f32> = (0..2000).map(|i| limit(i % 50)).collect();
    for (method, encoding) in [(Method::Coherent, Encoding::Srgb), (Method::Analogies, Encoding::Linear)] {
        let settings = Settings { method, blur: Some(1.0), ..SETTINGS };
        let (out, done) = run(&sets_of(&picture, encoding), &soft, &magnification, settings);
        assert_eq!(done.pixels, 29 * 40, "{method:?}");
        let differs = |x: usize| (0..40).any(|y| out.planes[0][y * 50 + x] != soft.planes[0][y * 50 + x]);
        assert!((0..=20).all(|x| !differs(x)) && (22..50).all(differs), "{method:?}");
        // It fades in: least where the magnification has only just begun.
        let change = |x: usize| (0..40).map(|y| (out.planes[0][y * 50 + x] - soft.planes[0][y * 50 + x]).abs()).sum();
        let [first, last]: [f32; 2] = [22, 45].map(change);
        assert!(3.0 * first < last, "{method:?}: {first} {last}");
    }
}

/// What was blurred becomes as sharp as it was, and blurring it gives back what was there.
#[test]
fn detail_returns_and_the_constraint_holds() {
    let training = Planes::of(72, 60, stones);
    let truth = Planes::of(60, 60, |channel, x, y| stones(channel, x + 101, y + 64));
    let soft = blur_of(&truth, 1.5);
    let sets = sets_of(&training, Encoding::Linear);
    for method in [Method::Coherent, Method::Analogies] {
        let settings = Settings { method, blur: Some(1.5), ..SETTINGS };
        let without = run(&sets, &soft, &[4.0; 3600], Settings { back_projections: 0, ..settings });
        let (out, done) = run(&sets, &soft, &[4.0; 3600], settings);
        assert_eq!(done.blur, 1.5);
        let share = sharpness(&out) / sharpness(&truth);
        assert!(
            (0.6..1.4).contains(&share),
            "{method:?}: {share}, {} of it before",
            sharpness(&soft) / sharpness(&truth)
        );
        let residual = root_mean_square(&blur_of(&out, 1.5), &soft);
        assert!((residual - done.residual[1]).abs() < 1e-6, "{residual} {done:?}");
        assert!(done.residual[1] < 0.6 * done.residual[0] && done.residual[1] < 0.02, "{method:?}: {done:?}");
        assert!(
            (without.1.residual[0] - done.residual[0]).abs() < 1e-9 && without.1.residual[0] == without.1.residual[1]
        );
    }
}

/// A magnified picture, drawn linearly: where its pixels come from is told, and they come from there.
#[test]
fn the_warp_says_where_pixels_come_from() {
    let training = Planes::of(64, 64, noise);
    let [shift_x, shift_y] = [9, 4];
    let truth = Planes::of(40, 40, |channel, x, y| noise(channel, x + shift_x, y + shift_y));
    let soft = blur_of(&truth, 1.0);
    let at =
        |axis: usize| (0..1600).map(move |i| [(i % 40 + shift_x) as f64 + 0.5, (i / 40 + shift_y) as f64 + 0.5][axis]);
    let origins = Positions { x: at(0).collect(), y: at(1).collect() };
    let settings = Settings { blur: Some(1.0), back_projections: 0, ..SETTINGS };
    let (out, _) = run_from(&sets_of(&training, Encoding::Linear), &soft, &[4.0; 1600], &origins, settings);
    let inner = (8..32).flat_map(|y| (8..32).map(move |x| y * 40 + x));
    assert!(inner.clone().all(|i| (out.planes[2][i] - truth.planes[2][i]).abs() < 1e-6), "the very pixels");
}

#[test]
fn shifted_pictures_give_shifted_results() {
    let training = Planes::of(48, 48, stones);
    let sets = sets_of(&training, Encoding::Srgb);
    let soft = blur_of(&Planes::of(120, 110, |channel, x, y| stones(channel, x + 40, y + 90)), 1.0);
    let disc = |x: usize, y: usize| if (x as f32 - 56.0).hypot(y as f32 - 52.0) < 9.0 { 4.0 } else { 1.0 };
    let cut = |left: usize, top: usize| {
        let part = Planes::of(104, 96, |channel, x, y| soft.planes[channel][(y + top) * 120 + x + left]);
        let magnification: Vec<f32> = (0..104 * 96).map(|i| disc(i % 104 + left, i / 104 + top)).collect();
        run(&sets, &part, &magnification, SETTINGS).0
    };
    let (one, other) = (cut(0, 0), cut(7, 5));
    for channel in 0..3 {
        for (x, y) in (30..90).flat_map(|x| (25..85).map(move |y| (x, y))) {
            let [a, b] = [one.planes[channel][y * 104 + x], other.planes[channel][(y - 5) * 104 + x - 7]];
            assert_eq!(a.to_bits(), b.to_bits(), "{x} {y}");
        }
    }
}

#[test]
fn any_count_of_threads_gives_the_same_bits() {
    let training = Planes::of(90, 75, stones);
    let soft = blur_of(&Planes::of(70, 65, |channel, x, y| stones(channel, x + 40, y + 90)), 1.3);
    let magnification: Vec<f32> = (0..70 * 65).map(|i| 0.9 + 0.04 * (i % 70) as f32).collect();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let (out, done) = run(&sets_of(&training, Encoding::Srgb), &soft, &magnification, SETTINGS);
            (out.bits(), done)
        })
    };
    let one = with(1);
    for threads in [2, 3, 8] {
        assert!(with(threads) == one, "{threads} threads");
    }
}

#[test]
fn tiny_pictures_and_training_pictures() {
    let sizes = [[1, 1], [2, 3], [5, 1], [1, 7], [9, 8]];
    for [width, height] in sizes {
        for [across, down] in sizes {
            let (training, picture) = (Planes::of(across, down, noise), Planes::of(width, height, stones));
            for method in [Method::Coherent, Method::Analogies] {
                let settings = Settings { method, ..SETTINGS };
                let (out, done) =
                    run(&sets_of(&training, Encoding::Srgb), &picture, &vec![4.0; width * height], settings);
                assert_eq!(done.pixels, (width * height) as u64);
                assert!(out.planes.iter().flatten().all(|sample| sample.is_finite()));
            }
        }
    }
}

#[test]
fn nothing_to_do_and_nothing_to_do_it_with() {
    let (picture, nothing) = (Planes::of(9, 7, noise), Planes { width: 0, planes: Default::default() });
    let empty = similar_sets(&[View::packed(&[], 0, 0); 3], Encoding::Srgb, 3, UNWATCHED).expect("nobody stops it");
    assert_eq!((empty.size(), empty.bytes()), ([0, 0], 0));
    assert_eq!(run(&empty, &picture, &[4.0; 63], SETTINGS), (picture.clone(), Detailed::default()));
    let sets = sets_of(&picture, Encoding::Srgb);
    for m in [1.0, 0.3, 1.02, f32::NAN] {
        assert_eq!(run(&sets, &picture, &[m; 63], SETTINGS), (picture.clone(), Detailed::default()));
    }
    let outs = [&mut [], &mut [], &mut []].map(|plane| ViewMut::packed(plane, 0, 0));
    let none = Positions { x: Vec::new(), y: Vec::new() };
    let views = nothing.planes.each_ref().map(|plane| View::packed(plane, 0, 0));
    assert_eq!(detail(&sets, &views, &[], &none, &SETTINGS, outs, UNWATCHED), Ok(Detailed::default()));
}

#[test]
fn samples_that_are_not_numbers_stay_alone() {
    let bad = |plain: f32, x: usize, y: usize| match (x, y) {
        (11, 9) => f32::NAN,
        (20, 14) => f32::INFINITY,
        (5, 20) => f32::MAX,
        _ => plain,
    };
    let picture = Planes::of(32, 28, |channel, x, y| bad(stones(channel, x, y), x, y));
    let training = Planes::of(40, 30, |channel, x, y| bad(noise(channel, x, y), x, y));
    for (method, encoding) in [(Method::Coherent, Encoding::Linear), (Method::Analogies, Encoding::Srgb)] {
        let settings = Settings { method, ..SETTINGS };
        let (out, _) = run(&sets_of(&training, encoding), &picture, &[4.0; 32 * 28], settings);
        for (i, (out, was)) in out.planes.iter().flatten().zip(picture.planes.iter().flatten()).enumerate() {
            assert_eq!(out.is_finite(), was.is_finite(), "sample {i}: {out} of {was}");
        }
    }
}

#[test]
fn a_watch_stops_it() {
    let picture = Planes::of(40, 30, stones);
    let stop = |_: f64| Err(Interrupted);
    assert!(similar_sets(&picture.views(), Encoding::Srgb, 3, &stop).is_err());
    let (sets, mut out) = (sets_of(&picture, Encoding::Srgb), picture.clone());
    let origins = Positions { x: vec![0.0; 1200], y: vec![0.0; 1200] };
    let outs = out.planes.each_mut().map(|plane| ViewMut::packed(plane, 40, 30));
    assert_eq!(detail(&sets, &picture.views(), &[4.0; 1200], &origins, &SETTINGS, outs, &stop), Err(Interrupted));
}

/// Similar pixels are: on a texture that repeats they lie a whole period off.
#[test]
fn sets_hold_similar_pixels() {
    let training = Planes::of(64, 64, |channel, x, y| noise(channel, x % 16, y % 16));
    let level = &sets_of(&training, Encoding::Linear).levels[0];
    let inner = (4..60).flat_map(|y| (4..60).map(move |x| y * 64 + x));
    let off =
        |pixel: usize, member: u32| [pixel % 64 + 64 - member as usize % 64, pixel / 64 + 64 - member as usize / 64];
    let whole =
        inner.filter(|&pixel| level.similar[pixel].iter().all(|&m| off(pixel, m).iter().all(|at| at % 16 == 0)));
    let count = whole.count();
    assert!(count > 56 * 56 * 9 / 10, "{count} of {}", 56 * 56);
    for (pixel, members) in level.similar.iter().enumerate() {
        let far = |a: u32, b: u32| (a % 64).abs_diff(b % 64).max((a / 64).abs_diff(b / 64)) >= 3;
        let [first, second] = *members;
        assert!(
            far(first, pixel as u32) && (second == pixel as u32 || far(first, second) && far(second, pixel as u32))
        );
    }
}

#[test]
fn the_tree_finds_what_is_near() {
    let points: Vec<[f32; 8]> = (0..3000).map(|i| std::array::from_fn(|axis| noise(axis, i % 1000, 3))).collect();
    let tree = Tree::new(&points, UNWATCHED).expect("nobody stops it");
    let mut leaves = 0;
    for number in 0..tree.leaf_count() {
        leaves += tree.leaf(number).len();
        assert!((1..=25).contains(&tree.leaf(number).len()));
    }
    assert_eq!(leaves, 3000);
    for (number, point) in points.iter().enumerate() {
        assert_eq!(tree.nearest(point), number as u32 % 1000, "the first of three that are equal");
    }
    for i in 0..300 {
        let query: [f32; 8] = std::array::from_fn(|axis| noise(axis, i, 77));
        let least = points.iter().map(|point| distance(point, &query)).fold(f32::INFINITY, f32::min);
        assert!(distance(&points[tree.nearest(&query) as usize], &query) <= 4.0 * least);
        assert!(distance(&points[tree.near(&query) as usize], &query) <= 20.0 * least + 0.2);
    }
}

#[test]
fn the_blur_has_its_variance_and_its_transpose() {
    let variances: Vec<f32> =
        (0..40 * 30).map(|i| if i % 11 == 0 { f32::NAN } else { 0.2 * (i % 40) as f32 }).collect();
    let blur = LocalBlur::new(40, &variances);
    let through = |plane: &[f32], transposed: bool| {
        let mut out = vec![9.0; plane.len()];
        let done = if transposed { LocalBlur::transposed } else { LocalBlur::apply }(&blur, plane, &mut out, UNWATCHED);
        done.map(|()| out).expect("unwatched")
    };
    let [a, b] = [0, 1].map(|channel| (0..1200).map(|i| noise(channel, i, 5)).collect::<Vec<f32>>());
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
    let there = dot(&through(&a, false), &b);
    let back = dot(&a, &through(&b, true));
    assert!((there - back).abs() < 1e-4 * there, "{there} {back}");
    // Applied to squared distances along x the blur adds its variance, and to constants nothing.
    let (at, middle) = (15 * 40 + 20, 20.0_f32);
    let squares: Vec<f32> = (0..1200).map(|i| ((i % 40) as f32 - middle).powi(2)).collect();
    let spread = through(&squares, false)[at];
    assert!((spread / variances[at] - 1.0).abs() < 0.05, "{spread} of {}", variances[at]);
    let ones = through(&[1.0; 1200], false);
    assert!(ones.iter().zip(&variances).all(|(one, v)| if v.is_nan() {
        *one == 0.0
    } else {
        (one - 1.0).abs() < 1e-5
    }));
}

/// Of one variance it is the Gaussian, tile by tile, whatever is known beside it.
#[test]
fn a_local_blur_joins_its_tiles() {
    let (width, height) = (150, 90);
    let plane: Vec<f32> = (0..width * height).map(|i| noise(0, i % width, i / width)).collect();
    let is_known = |i: usize| i % width > 69 && i / width < 80;
    let variances: Vec<f32> = (0..plane.len()).map(|i| if is_known(i) { 40.0 } else { f32::NAN }).collect();
    let blur = LocalBlur::new(width, &variances);
    let [mut there, mut back] = [0, 1].map(|_| vec![9.0; plane.len()]);
    blur.apply(&plane, &mut there, UNWATCHED).expect("unwatched");
    blur.transposed(&plane, &mut back, UNWATCHED).expect("unwatched");
    let masked: Vec<f32> = plane.iter().enumerate().map(|(i, v)| if is_known(i) { *v } else { 0.0 }).collect();
    let [all, part] = [&plane, &masked].map(|plane| blurred(plane, width, 40.0, UNWATCHED).expect("unwatched"));
    for i in (0..plane.len()).filter(|&i| is_known(i)) {
        assert_eq!([there[i], back[i]], [all[i], part[i]], "pixel {i}");
    }
}

#[test]
fn the_magnification_of_a_warp() {
    let lattice = Lattice { origin: [0.0, 0.0], spacing: [10.0, 10.0], nodes: [4, 4] };
    // Twice as wide and half as high again, turned over.
    let positions = Positions::from_map(&lattice, |[x, y]| [2.0 * x, 45.0 - 1.5 * y]);
    let map = Map::Forward { lattice: &lattice, positions: &positions };
    let sources = pixel_sources(&map, Rect::new(0, 0, 60, 45), UNWATCHED).expect("nobody stops it");
    let found = magnification(&sources, 60, UNWATCHED).expect("nobody stops it");
    assert!(found.iter().all(|m| (m - 3.0).abs() < 1e-4));
    let mut hole = sources.clone();
    hole.x[20 * 60 + 30] = f64::NAN;
    let found = magnification(&hole, 60, UNWATCHED).expect("nobody stops it");
    assert!(found[20 * 60 + 30].is_nan() && found.iter().filter(|m| m.is_nan()).count() == 1);
    assert!((found[20 * 60 + 31] - 3.0).abs() < 1e-4, "beside it only one side is known");
    let line = Positions { x: vec![1.0, 2.0, 3.0], y: vec![0.0; 3] };
    assert!(magnification(&line, 3, UNWATCHED).expect("nobody stops it").iter().all(|m| m.is_nan()));
}
