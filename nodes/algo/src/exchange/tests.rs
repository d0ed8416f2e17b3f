use super::*;
use crate::UNWATCHED;
use crate::lattice::Positions;
use crate::view::{View, ViewMut};

/// The presets, one with whole centres, and the rest of what the choices allow at its strangest.
const CONVENTIONS: [Convention; 7] = [
    Convention::NUKE_ST_MAP,
    Convention::NUKE_IDISTORT,
    Convention::OIIO_ST_WARP,
    Convention::BLENDER_MAP_UV,
    Convention::BLENDER_DISPLACE,
    Convention { centers: Centers::Whole, ..Convention::OIIO_ST_WARP },
    Convention { meaning: Meaning::Offset, sign: Sign::Minus, centers: Centers::Whole, ..Convention::OIIO_ST_WARP },
];

fn same_format(convention: Convention, format: Rect) -> PixelMap {
    PixelMap { convention, pixels: format, positions: format }
}

/// Rows of numbers for the pixels of a window, as a file holds them.
struct Planes {
    x: Vec<f32>,
    y: Vec<f32>,
    alpha: Vec<f32>,
}

fn encoded(map: &PixelMap, window: Rect, positions: &Positions) -> (Planes, Positions, Encoded) {
    let (width, height) = (window.width(), window.height());
    let [mut x, mut y, mut alpha] = [0, 1, 2].map(|_| vec![9.0; width * height]);
    let mut stored = positions.clone();
    let planes = [&mut x, &mut y, &mut alpha].map(|plane| ViewMut::packed(plane, width, height));
    let found = encode(map, window, &mut stored, planes, UNWATCHED).expect("nobody stops it");
    (Planes { x, y, alpha }, stored, found)
}

fn decoded(map: &PixelMap, window: Rect, planes: &Planes) -> Result<Decoded, DecodeError> {
    let [x, y, alpha] =
        [&planes.x, &planes.y, &planes.alpha].map(|plane| View::packed(plane, window.width(), window.height()));
    decode(map, window, [x, y], Some(alpha), UNWATCHED)
}

fn positions_of(window: Rect, map: impl Fn([f64; 2]) -> [f64; 2] + Sync) -> Positions {
    let lattice = Lattice { nodes: [window.width(), window.height()], ..pixel_lattice(window) };
    Positions::from_map(&lattice, map)
}

#[test]
fn literal_numbers_of_every_preset() {
    // In 8 x 4 px, pixel (2, 1) comes from (3.25, 0.5): 3/4 px farther right, 1 px higher.
    let expected = [
        (Convention::NUKE_ST_MAP, [0.40625, 0.875]),
        (Convention::NUKE_IDISTORT, [0.75, 1.0]),
        (Convention::OIIO_ST_WARP, [0.40625, 0.125]),
        (Convention::BLENDER_MAP_UV, [0.40625, 0.875]),
        (Convention::BLENDER_DISPLACE, [-0.75, -1.0]),
    ];
    for [x0, y0] in [[0, 0], [100, 50], [-7, 9]] {
        let format = Rect::new(x0, y0, x0 + 8, y0 + 4);
        let at = |[x, y]: [f64; 2]| [x0 as f64 + x, y0 as f64 + y];
        for (convention, numbers) in expected {
            let map = same_format(convention, format);
            assert_eq!(map.numbers(at([2.5, 1.5]), at([3.25, 0.5])), numbers, "{convention:?}");
            assert_eq!(map.position(at([2.5, 1.5]), numbers), at([3.25, 0.5]), "{convention:?}");
        }
    }
}

#[test]
fn the_identity_is_half_a_pixel_from_the_edge() {
    // (x + 1/2) / W; the corners of the picture are (0, 0) and (1, 1).
    let format = Rect::new(0, 0, 8, 4);
    let st = same_format(Convention::OIIO_ST_WARP, format);
    assert_eq!(
        [st.numbers([0.5; 2], [0.5, 0.5]), st.numbers([0.5; 2], [7.5, 3.5])],
        [[0.0625, 0.125], [0.9375, 0.875]]
    );
    assert_eq!([st.numbers([0.5; 2], [0.0, 0.0]), st.numbers([0.5; 2], [8.0, 4.0])], [[0.0, 0.0], [1.0, 1.0]]);
    let up = same_format(Convention::NUKE_ST_MAP, format);
    assert_eq!([up.numbers([0.5; 2], [0.0, 4.0]), up.numbers([0.5; 2], [8.0, 0.0])], [[0.0, 0.0], [1.0, 1.0]]);
    // Whole centres: x / (W - 1), and x in px.
    let whole = |unit| Convention { centers: Centers::Whole, unit, ..Convention::OIIO_ST_WARP };
    let st = same_format(whole(Unit::Format), format);
    assert_eq!([st.numbers([0.5; 2], [0.5, 0.5]), st.numbers([0.5; 2], [7.5, 3.5])], [[0.0, 0.0], [1.0, 1.0]]);
    assert_eq!(same_format(whole(Unit::Pixel), format).numbers([0.5; 2], [7.5, 3.5]), [7.0, 3.0]);
    // A format of one pixel has no way from its first centre to its last.
    assert_eq!(same_format(whole(Unit::Format), Rect::new(0, 0, 1, 1)).position([0.5; 2], [0.25, 0.5]), [0.75, 1.0]);
}

#[test]
fn offsets_as_the_programs_document_them() {
    // IDistort: pixel (51, 23), y up, with (-1, 5) reads (50, 28). Displace takes the vector away.
    let format = Rect::new(0, 0, 120, 100);
    let center = |column: i64, row_from_below: i64| [column as f64 + 0.5, (99 - row_from_below) as f64 + 0.5];
    let read = |convention, numbers| same_format(convention, format).position(center(51, 23), numbers);
    assert_eq!(read(Convention::NUKE_IDISTORT, [-1.0, 5.0]), center(50, 28));
    assert_eq!(read(Convention::BLENDER_DISPLACE, [1.0, -5.0]), center(50, 28));
}

#[test]
fn fractions_are_of_the_format_of_the_positions() {
    // Pixels of a format of 4 x 2 come from one of 40 x 20 somewhere else.
    let map =
        |convention| PixelMap { convention, pixels: Rect::new(0, 0, 4, 2), positions: Rect::new(100, 50, 140, 70) };
    assert_eq!(map(Convention::OIIO_ST_WARP).numbers([1.5, 0.5], [110.0, 55.0]), [0.25, 0.25]);
    assert_eq!(map(Convention::NUKE_ST_MAP).numbers([1.5, 0.5], [110.0, 55.0]), [0.25, 0.75]);
    // 10 px from the left edge less 1.5; 15 px above the lower edge less 1.5.
    assert_eq!(map(Convention::NUKE_IDISTORT).numbers([1.5, 0.5], [110.0, 55.0]), [8.5, 13.5]);
}

#[test]
fn what_comes_from_nowhere_lies_outside() {
    let format = Rect::new(100, 50, 108, 54);
    for convention in [Convention::NUKE_ST_MAP, Convention::OIIO_ST_WARP, Convention::BLENDER_MAP_UV] {
        let map = same_format(convention, format);
        assert_eq!(map.numbers([103.5, 51.5], map.nowhere()), [-1.0, -1.0], "{convention:?}");
    }
    let whole = same_format(Convention { centers: Centers::Whole, ..Convention::OIIO_ST_WARP }, format);
    assert_eq!(whole.numbers([103.5, 51.5], whole.nowhere()), [-8.5 / 7.0, -4.5 / 3.0]);
    for convention in CONVENTIONS {
        let map = same_format(convention, format);
        let position = map.position([103.5, 51.5], map.numbers([103.5, 51.5], map.nowhere()));
        assert!(position[0] < 99.0 && !(49.0..55.0).contains(&position[1]), "{convention:?}: {position:?}");
    }
}

type Field = (&'static str, fn([f64; 2], [f64; 2]) -> [f64; 2]);

/// Maps of a format with that centre; from the notes on what pipelines expect.
const FIELDS: [Field; 5] = [
    ("identity", |p, _| p),
    ("translation", |[x, y], _| [x + 3.25, y - 7.5]),
    ("rotation", |[x, y], [cx, cy]| {
        let angle = 10.0_f64.to_radians();
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        [cx + cos * (x - cx) - sin * (y - cy), cy + sin * (x - cx) + cos * (y - cy)]
    }),
    ("radial", |[x, y], [cx, cy]| {
        let [dx, dy] = [x - cx, y - cy];
        let factor = 1.0 + 0.08 * (dx * dx + dy * dy) / 1920.0_f64.powi(2);
        [cx + factor * dx, cy + factor * dy]
    }),
    ("smooth", |[x, y], _| {
        let wave = |a: f64, b: f64, phase: f64| libm::sin(a * x + b * y + phase);
        [
            x + 23.7 * wave(0.0031, -0.0017, 0.3) + 9.1 * wave(-0.0009, 0.0083, 1.9),
            y + 31.3 * wave(0.0013, 0.0029, 2.2) - 7.7 * wave(0.0091, 0.0011, 0.7),
        ]
    }),
];

#[test]
fn positions_come_back_within_a_thousandth_of_a_pixel() {
    for [width, height] in [[1920, 1080], [4096, 2160]] {
        for [x0, y0] in [[0, 0], [100, 50]] {
            let format = Rect::new(x0, y0, x0 + width, y0 + height);
            let center = [x0 as f64 + width as f64 / 2.0, y0 as f64 + height as f64 / 2.0];
            // Rows of the format and of what it is grown by.
            for (top, overscan) in [(y0, 0), (y0 + height / 2, 64), (y0 - 64, 64), (y0 + height + 62, 64)] {
                let window = Rect::new(x0 - overscan, top, x0 + width + overscan, top + 2);
                for ((name, field), convention) in FIELDS.iter().flat_map(|field| CONVENTIONS.map(|c| (field, c))) {
                    let (map, positions) =
                        (same_format(convention, format), positions_of(window, |p| field(p, center)));
                    let (planes, stored, found) = encoded(&map, window, &positions);
                    let back = decoded(&map, window, &planes).expect("it is sound");
                    let pairs = back.positions.x.iter().zip(&positions.x);
                    let pairs = pairs.chain(back.positions.y.iter().zip(&positions.y));
                    let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    assert!(worst <= 1e-3, "{name} {convention:?} {format:?} {window:?}: {worst}");
                    assert_eq!((worst, &stored), (found.rounding, &back.positions), "{name} {convention:?}");
                    assert_eq!((found.without_source, back.without_source), (0, 0));
                }
            }
        }
    }
}

/// A number that looks random, in -1..2 and not tiny: a tiny one may come back as its neighbour.
fn number(i: usize) -> f32 {
    let bits = (i as u32 + 1).wrapping_mul(0x9E37_79B1).rotate_left(11).wrapping_mul(0x85EB_CA77);
    let number = (bits >> 8) as f32 / (1 << 24) as f32 * 3.0 - 1.0;
    if number.abs() < 1e-3 { 0.3 } else { number }
}

#[test]
fn what_was_read_is_written_bit_for_bit() {
    let window = Rect::new(3, -2, 40, 31);
    let count = window.width() * window.height();
    let planes = Planes {
        x: (0..count).map(number).collect(),
        y: (0..count).map(|i| number(i + count)).collect(),
        alpha: (0..count).map(|i| if i % 7 == 3 { 0.0 } else { 1.0 }).collect(),
    };
    for (convention, origin) in CONVENTIONS.iter().flat_map(|c| [0, 100].map(|origin| (*c, origin))) {
        let map = same_format(convention, Rect::new(origin, origin / 2, origin + 4096, origin / 2 + 2160));
        let back = decoded(&map, window, &planes).expect("it is sound");
        let (again, ..) = encoded(&map, window, &back.positions);
        assert_eq!(again.alpha, planes.alpha);
        for i in (0..count).filter(|i| i % 7 != 3) {
            let [read, written] = [&planes, &again].map(|planes| [planes.x[i], planes.y[i]].map(f32::to_bits));
            assert_eq!(read, written, "{convention:?}, pixel {i}");
        }
    }
}

#[test]
fn tiny_numbers_come_back_to_the_same_positions() {
    let window = Rect::new(-30, -20, 4126, 2);
    let count = window.width() * window.height();
    // From 1e-2 to 1e-30, as small as offsets get and as near to a format's edge.
    let tiny = |i: usize| number(i) * libm::powf(10.0, -2.0 - 28.0 * (i % 97) as f32 / 97.0);
    let planes = Planes {
        x: (0..count).map(tiny).collect(),
        y: (0..count).map(|i| tiny(i + count)).collect(),
        alpha: vec![0.25; count],
    };
    for convention in CONVENTIONS {
        let map = same_format(convention, Rect::new(0, 0, 4096, 2160));
        let back = decoded(&map, window, &planes).expect("it is sound");
        let (again, stored, found) = encoded(&map, window, &back.positions);
        assert!(again.alpha.iter().all(|alpha| *alpha == 1.0));
        let pairs = back.positions.x.iter().zip(&stored.x).chain(back.positions.y.iter().zip(&stored.y));
        let worst = pairs.map(|(read, written)| (read - written).abs()).fold(0.0, f64::max);
        assert!(worst <= 1e-11, "{convention:?}: {worst}");
        assert_eq!(worst, found.rounding, "{convention:?}");
    }
}

#[test]
#[should_panic(expected = "planes of 4 x 2 px")]
fn planes_of_another_size_than_the_window_are_refused() {
    let window = Rect::new(0, 0, 4, 2);
    let mut positions = positions_of(window, |p| p);
    let [mut x, mut y, mut alpha] = [0; 3].map(|_| vec![0.0; 8]);
    let planes = [ViewMut::packed(&mut x, 4, 2), ViewMut::packed(&mut y, 2, 4), ViewMut::packed(&mut alpha, 4, 2)];
    let _ = encode(&same_format(Convention::NUKE_ST_MAP, window), window, &mut positions, planes, UNWATCHED);
}

#[test]
fn pixels_without_a_source_keep_to_themselves() {
    let (format, window) = (Rect::new(0, 0, 4, 2), Rect::new(0, 0, 4, 2));
    let map = same_format(Convention::NUKE_ST_MAP, format);
    let mut positions = positions_of(window, |p| p);
    positions.x[1] = f64::NAN;
    positions.y[2] = f64::INFINITY;
    positions.x[6] = 1e300;
    let (planes, stored, found) = encoded(&map, window, &positions);
    assert_eq!(found, Encoded { without_source: 3, rounding: 0.0 });
    assert_eq!(planes.alpha, [1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 1.0]);
    assert_eq!(planes.x, [0.125, -1.0, -1.0, 0.875, 0.125, 0.375, -1.0, 0.875]);
    assert_eq!(planes.y, [0.75, -1.0, -1.0, 0.75, 0.25, 0.25, -1.0, 0.25]);
    let back = decoded(&map, window, &planes).expect("it is sound");
    assert_eq!(back.without_source, 3);
    for pixel in 0..8 {
        let [x, y] = [back.positions.x[pixel], back.positions.y[pixel]];
        let expected =
            if planes.alpha[pixel] == 0.0 { [f64::NAN; 2] } else { [positions.x[pixel], positions.y[pixel]] };
        assert_eq!([x, y].map(f64::to_bits), expected.map(f64::to_bits), "pixel {pixel}");
        assert_eq!(stored.x[pixel].to_bits(), x.to_bits(), "pixel {pixel}");
    }
}

#[test]
fn bad_numbers_are_named_and_empty_maps_refused() {
    let window = Rect::new(10, 20, 13, 42);
    let map = same_format(Convention::OIIO_ST_WARP, window);
    let (sound, ..) = encoded(&map, window, &positions_of(window, |p| p));
    let with = |change: fn(&mut Planes)| {
        let mut planes = Planes { x: sound.x.clone(), y: sound.y.clone(), alpha: sound.alpha.clone() };
        change(&mut planes);
        decoded(&map, window, &planes)
    };
    let bad = |pixel, count| Err(DecodeError::NotFinite { pixel, count });
    // Index 62 is column 2 of row 20, in the second band.
    assert_eq!(with(|p| (p.y[62], p.x[64]) = (f32::NAN, f32::INFINITY)), bad([12, 40], 2));
    assert_eq!(with(|p| (p.x[62], p.alpha[4]) = (f32::NAN, f32::NAN)), bad([11, 21], 2));
    assert_eq!(with(|p| (p.x[5], p.alpha[5]) = (f32::NAN, 0.0)).map(|map| map.without_source), Ok(1));
    assert_eq!(with(|p| (p.x[5], p.alpha[5]) = (f32::NAN, -1e-3)).map(|map| map.without_source), Ok(1));
    assert_eq!(with(|p| p.alpha[5] = f32::NEG_INFINITY), bad([12, 21], 1));
    assert_eq!(with(|p| p.alpha.fill(0.0)), Err(DecodeError::NoSource));
    assert_eq!(with(|p| p.alpha.fill(0.25)).map(|map| map.without_source), Ok(0));
}

#[test]
fn a_side_of_one_pixel_goes_on_a_pixel_at_a_time() {
    for window in [Rect::new(5, 7, 6, 8), Rect::new(5, 7, 6, 40), Rect::new(5, 7, 38, 8)] {
        let map = same_format(Convention::NUKE_IDISTORT, Rect::new(0, 0, 60, 50));
        let moved = |[x, y]: [f64; 2]| [x + 3.0, y - 2.0];
        let (planes, ..) = encoded(&map, window, &positions_of(window, moved));
        let back = decoded(&map, window, &planes).expect("it is sound");
        let lattice = pixel_lattice(window);
        assert_eq!(lattice.nodes, [window.width().max(2), window.height().max(2)]);
        assert_eq!(back.positions, Positions::from_map(&lattice, moved), "{window:?}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same() {
    let window = Rect::new(-3, 2, 70, 100);
    let map = same_format(Convention::NUKE_ST_MAP, Rect::new(0, 0, 64, 98));
    let mut positions = positions_of(window, |[x, y]| [x + 0.3 * y, 1.7 * y - 0.2 * x]);
    positions.x[500] = f64::NAN;
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let (planes, _, found) = encoded(&map, window, &positions);
            let back = decoded(&map, window, &planes).expect("it is sound");
            let bits: Vec<u64> = back.positions.x.iter().chain(&back.positions.y).map(|at| at.to_bits()).collect();
            (planes.x, planes.y, planes.alpha, found, bits)
        })
    };
    let one = run(1);
    for threads in [2, 3, 8] {
        assert!(one == run(threads), "{threads} threads");
    }
}
