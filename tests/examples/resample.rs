//! Draws a raw picture through a raw map on one thread, times it and writes the result.
//!
//! Usage: resample PICTURE WIDTH HEIGHT PLANES MAP COLUMNS ROWS ORIGIN SPACING forward|backward FILTER REPEATS OUT
//!        [OUT_WIDTH OUT_HEIGHT]
//!
//! PICTURE: planes of f32; MAP: all x, then all y, f64, of a lattice from (ORIGIN, ORIGIN) on; OUT: as PICTURE, of
//! its size if no other is given. All little-endian, row by row. Prints the processor seconds of each repeat.

use rustix::time::{ClockId, clock_gettime};
use warploom_algo::UNWATCHED;
use warploom_algo::lattice::{Lattice, Positions};
use warploom_algo::rect::Rect;
use warploom_algo::resample::{Edge, Filter, Map, Sampling, draw};
use warploom_algo::view::{View, ViewMut};

/// Samples in a cache line.
const LINE: usize = 16;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let text = |i: usize| arguments.get(i).unwrap_or_else(|| panic!("argument {} is missing", i + 1)).as_str();
    let whole = |i: usize| text(i).parse::<usize>().unwrap_or_else(|error| panic!("{}: {error}", text(i)));
    let number = |i: usize| text(i).parse::<f64>().unwrap_or_else(|error| panic!("{}: {error}", text(i)));
    let (width, height, planes) = (whole(1), whole(2), whole(3));
    let lattice = Lattice { origin: [number(7); 2], spacing: [number(8); 2], nodes: [whole(5), whole(6)] };
    let picture: Vec<f32> = read(text(0)).as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    let mut x: Vec<f64> = read(text(4)).as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let y = x.split_off(lattice.node_count());
    let positions = Positions { x, y };
    let map = match text(9) {
        "forward" => Map::Forward { lattice: &lattice, positions: &positions },
        "backward" => Map::Backward { lattice: &lattice, positions: &positions },
        other => panic!("{other}: neither forward nor backward"),
    };
    let filter = match text(10) {
        "nearest" => Filter::Nearest,
        "linear" => Filter::Linear,
        "cubic" => Filter::Cubic,
        "mitchell" => Filter::Mitchell,
        "lanczos3" => Filter::Lanczos3,
        "ewa" => Filter::Ewa,
        other => panic!("{other}: no such filter"),
    };
    let sampling = Sampling { filter, edge: Edge::Transparent, clamp_ringing: false };
    let window = Rect::new(0, 0, width as i64, height as i64);
    let views: Vec<_> = picture.chunks(width * height).map(|plane| View::packed(plane, width, height)).collect();
    let [out_width, out_height] = if arguments.len() > 13 { [whole(13), whole(14)] } else { [width, height] };
    let out_window = Rect::new(0, 0, out_width as i64, out_height as i64);
    // Planes start at a cache line, as those of pictures do.
    let mut room = vec![1.0_f32; out_width * out_height * planes + LINE];
    let start = room.as_ptr().align_offset(LINE * size_of::<f32>());
    let out = &mut room[start..start + out_width * out_height * planes];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    for _ in 0..whole(11) {
        let planes = out.chunks_mut(out_width * out_height);
        let outs = planes.map(|plane| ViewMut::packed(plane, out_width, out_height)).collect();
        let start = processor_seconds();
        pool.install(|| draw(&map, window, out_window, &sampling, &views, outs, UNWATCHED)).expect("unwatched");
        println!("{}", processor_seconds() - start);
    }
    let bytes: Vec<u8> = out.iter().flat_map(|value| value.to_le_bytes()).collect();
    std::fs::write(text(12), bytes).unwrap_or_else(|error| panic!("{}: {error}", text(12)));
}

fn read(path: &str) -> Vec<u8> {
    std::fs::read(path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn processor_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
