use super::*;
use crate::UNWATCHED;

fn labelled(mask: &[f32], width: usize, connectivity: Connectivity, min_area: u64) -> (Vec<u32>, Vec<Component>) {
    let height = mask.len() / width;
    let mut out = vec![u32::MAX; mask.len()];
    let view = ViewMut::packed(&mut out, width, height);
    let components = label(View::packed(mask, width, height), connectivity, min_area, 0, 0, view, UNWATCHED).unwrap();
    (out, components)
}

/// The definition: flood fill from each pixel in raster order.
fn flooded(mask: &[f32], width: usize, connectivity: Connectivity, min_area: u64) -> (Vec<u32>, Vec<Component>) {
    let (mut labels, mut components) = (vec![0; mask.len()], Vec::new());
    let mut seen = vec![false; mask.len()];
    for start in 0..mask.len() {
        let pixels = flood(mask, width, connectivity, start, &mut seen);
        if pixels.is_empty() || (pixels.len() as u64) < min_area {
            continue;
        }
        components.push(described(&pixels, width));
        pixels.iter().for_each(|&pixel| labels[pixel] = components.len() as u32);
    }
    (labels, components)
}

fn flood(mask: &[f32], width: usize, connectivity: Connectivity, start: usize, seen: &mut [bool]) -> Vec<usize> {
    let (mut pixels, mut waiting) = (Vec::new(), vec![start]);
    while let Some(pixel) = waiting.pop() {
        if seen[pixel] || mask[pixel].is_nan() || mask[pixel] <= 0.5 {
            continue;
        }
        seen[pixel] = true;
        pixels.push(pixel);
        let (x, y) = ((pixel % width) as i64, (pixel / width) as i64);
        for (dx, dy) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
            let (nx, ny) = (x + dx, y + dy);
            let inside = (0..width as i64).contains(&nx) && (0..(mask.len() / width) as i64).contains(&ny);
            if inside && (connectivity == Connectivity::Eight || dx == 0 || dy == 0) {
                waiting.push(ny as usize * width + nx as usize);
            }
        }
    }
    pixels
}

fn described(pixels: &[usize], width: usize) -> Component {
    let (xs, ys) = (pixels.iter().map(|pixel| pixel % width), pixels.iter().map(|pixel| pixel / width));
    let area = pixels.len() as f64;
    Component {
        area: pixels.len() as u64,
        bounds: [
            xs.clone().min().unwrap() as i64,
            ys.clone().min().unwrap() as i64,
            xs.clone().max().unwrap() as i64 + 1,
            ys.clone().max().unwrap() as i64 + 1,
        ],
        centroid: [
            xs.map(|x| 2 * x + 1).sum::<usize>() as f64 / (2.0 * area),
            ys.map(|y| 2 * y + 1).sum::<usize>() as f64 / (2.0 * area),
        ],
    }
}

fn noise(count: usize, density: f32, seed: u32) -> Vec<f32> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0
    };
    (0..count).map(|_| if next() < density { 1.0 } else { 0.0 }).collect()
}

#[test]
fn diagonal_neighbours_connect_only_by_eight() {
    #[rustfmt::skip]
    let mask = [
        1.0, 0.0, 0.0, 0.0, 1.0,
        0.0, 1.0, 0.0, 1.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0,
        1.0, 1.0, 0.0, 0.0, f32::NAN,
        1.0, 0.5, 0.0, 0.0, 1.0,
    ];
    let (eight, components) = labelled(&mask, 5, Connectivity::Eight, 0);
    #[rustfmt::skip]
    assert_eq!(eight, [
        1, 0, 0, 0, 2,
        0, 1, 0, 2, 0,
        0, 0, 0, 0, 0,
        3, 3, 0, 0, 0,
        3, 0, 0, 0, 4,
    ]);
    assert_eq!(components[0], Component { area: 2, bounds: [0, 0, 2, 2], centroid: [1.0, 1.0] });
    assert_eq!(components[2], Component { area: 3, bounds: [0, 3, 2, 5], centroid: [5.0 / 6.0, 23.0 / 6.0] });
    let (four, components) = labelled(&mask, 5, Connectivity::Four, 2);
    assert_eq!(components, [Component { area: 3, bounds: [0, 3, 2, 5], centroid: [5.0 / 6.0, 23.0 / 6.0] }]);
    assert_eq!(four.iter().sum::<u32>(), 3);
}

#[test]
fn equals_flood_fill_on_noise() {
    for (seed, (width, height)) in [(1, 1), (1, 200), (67, 131), (64, 65), (129, 77), (333, 3)].into_iter().enumerate()
    {
        for density in [0.2, 0.4, 0.5, 0.6, 0.9] {
            let mask = noise(width * height, density, seed as u32 + 7);
            for connectivity in [Connectivity::Eight, Connectivity::Four] {
                for min_area in [0, 1, 4] {
                    let expected = flooded(&mask, width, connectivity, min_area);
                    let found = labelled(&mask, width, connectivity, min_area);
                    assert_eq!(found, expected, "{width} x {height}, {density}, {connectivity:?}, {min_area}");
                }
            }
        }
    }
}

#[test]
fn a_spiral_across_all_bands_is_one_component() {
    let side = 4 * BAND_ROWS + 3;
    let mut mask = vec![0.0; side * side];
    let (mut x, mut y, mut dx, mut dy) = (0i64, 0i64, 1i64, 0i64);
    let is_set = |mask: &[f32], x: i64, y: i64| {
        let inside = (0..side as i64).contains(&x) && (0..side as i64).contains(&y);
        inside && mask[(y * side as i64 + x) as usize] > 0.0
    };
    let blocked = |mask: &[f32], x: i64, y: i64, dx: i64, dy: i64| {
        let inside = (0..side as i64).contains(&(x + dx)) && (0..side as i64).contains(&(y + dy));
        !inside || is_set(mask, x + 2 * dx, y + 2 * dy)
    };
    let mut turns = 0;
    while turns < 2 {
        mask[(y * side as i64 + x) as usize] = 1.0;
        if blocked(&mask, x, y, dx, dy) {
            (dx, dy) = (-dy, dx);
            turns += 1;
        } else {
            (x, y, turns) = (x + dx, y + dy, 0);
        }
    }
    let (_, components) = labelled(&mask, side, Connectivity::Four, 0);
    assert_eq!(components.len(), 1);
    assert_eq!(components[0].area, mask.iter().filter(|&&sample| sample > 0.0).count() as u64);
}

#[test]
fn positions_are_absolute() {
    let mask = [0.0, 1.0, 1.0, 0.0, 1.0, 1.0];
    let mut out = [0; 6];
    let view = ViewMut::packed(&mut out, 3, 2);
    let found = label(View::packed(&mask, 3, 2), Connectivity::Four, 0, -10, 20, view, UNWATCHED).unwrap();
    assert_eq!(found, [Component { area: 4, bounds: [-9, 20, -7, 22], centroid: [-8.0, 21.0] }]);
}

#[test]
fn empty_views_have_no_components() {
    for (width, height) in [(0, 0), (0, 3), (3, 0)] {
        let out = ViewMut::packed(&mut [], width, height);
        let found = label(View::packed(&[], width, height), Connectivity::Eight, 0, 0, 0, out, UNWATCHED);
        assert_eq!(found, Ok(Vec::new()));
    }
}

#[test]
fn threads_do_not_matter() {
    let mask = noise(151 * 203, 0.55, 3);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| labelled(&mask, 151, Connectivity::Four, 2))
    };
    let alone = run(1);
    assert!([2, 3, 8].into_iter().all(|threads| run(threads) == alone));
}

#[test]
fn a_watch_stops_it() {
    let mut out = [0; 4];
    let stop: Watch = &|_| Err(Interrupted);
    let view = ViewMut::packed(&mut out, 2, 2);
    assert_eq!(label(View::packed(&[1.0; 4], 2, 2), Connectivity::Four, 0, 0, 0, view, stop), Err(Interrupted));
}
