//! Adds detail to a raw blurred picture on one thread, times it and writes the result.
//!
//! Usage: detail TRAINING WIDTH HEIGHT PICTURE WIDTH HEIGHT BLUR coherent|analogies COHERENCE REPEATS OUT
//!
//! TRAINING, PICTURE and OUT: planes R, G, B of f32, 0..=1, little-endian, row by row. BLUR: standard deviation of the
//! blur that PICTURE went through, px. All of PICTURE counts as magnified, and as from nowhere in TRAINING. Prints
//! the processor seconds of each repeat: those of the similar sets, and those of the rest.

use rustix::time::{ClockId, clock_gettime};
use warploom_algo::UNWATCHED;
use warploom_algo::detail::{Method, Settings, detail, similar_sets};
use warploom_algo::lattice::Positions;
use warploom_algo::transfer::Encoding;
use warploom_algo::view::{View, ViewMut};

/// Levels of the pyramid.
const LEVELS: usize = 3;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let text = |i: usize| arguments.get(i).unwrap_or_else(|| panic!("argument {} is missing", i + 1)).as_str();
    let whole = |i: usize| text(i).parse::<usize>().unwrap_or_else(|error| panic!("{}: {error}", text(i)));
    let number = |i: usize| text(i).parse::<f64>().unwrap_or_else(|error| panic!("{}: {error}", text(i)));
    let (training, picture) = (read(text(0), whole(1) * whole(2)), read(text(3), whole(4) * whole(5)));
    let training = training.each_ref().map(|plane| View::packed(plane, whole(1), whole(2)));
    let views = picture.each_ref().map(|plane| View::packed(plane, whole(4), whole(5)));
    let method = match text(7) {
        "coherent" => Method::Coherent,
        "analogies" => Method::Analogies,
        other => panic!("{other}: neither coherent nor analogies"),
    };
    let settings = Settings { method, coherence: number(8), blur: Some(number(6)), back_projections: 3 };
    let pixels = whole(4) * whole(5);
    let nowhere = Positions { x: vec![f64::NAN; pixels], y: vec![f64::NAN; pixels] };
    let mut out = picture.clone();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    for _ in 0..whole(9) {
        let outs = out.each_mut().map(|plane| ViewMut::packed(plane, whole(4), whole(5)));
        let magnification = vec![f32::INFINITY; pixels];
        let start = processor_seconds();
        let sets = pool.install(|| similar_sets(&training, Encoding::Linear, LEVELS, UNWATCHED)).expect("unwatched");
        let between = processor_seconds();
        let run = || detail(&sets, &views, &magnification, &nowhere, &settings, outs, UNWATCHED);
        pool.install(run).expect("unwatched");
        println!("{} {}", between - start, processor_seconds() - between);
    }
    let bytes: Vec<u8> = out.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    std::fs::write(text(10), bytes).unwrap_or_else(|error| panic!("{}: {error}", text(10)));
}

/// Three planes of samples.
fn read(path: &str, pixels: usize) -> [Vec<f32>; 3] {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let samples: Vec<f32> = bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    assert_eq!(samples.len(), 3 * pixels, "{path}: samples of three planes");
    [0, 1, 2].map(|plane| samples[plane * pixels..(plane + 1) * pixels].to_vec())
}

fn processor_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
