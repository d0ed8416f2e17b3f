//! Where all pixels of a window come from.

use super::{Map, Net, sources};
use crate::lattice::Positions;
use crate::rect::Rect;
use crate::steps::Steps;
use crate::{Interrupted, Watch};
use rayon::prelude::*;

/// The source positions of the centres of all pixels of a window: those that [`draw`](super::draw) samples at.
///
/// A backward map is evaluated there, a forward map inverted exactly; its continuation reaches as far as with any edge
/// but [`Edge::Transparent`](super::Edge), and where cells overlap the last in row-major order counts.
///
/// - `map`: the warp; nodes may be non-finite.
/// - `window`: the pixels; an empty one gives no position.
///
/// One position per pixel, px, row-major; NaN where neither the map nor its continuation reaches. Positions of a
/// backward map may be anything that its nodes make.
///
/// Cost: as drawing without a picture. Asks `watch` for 16 bytes per pixel, and stops when it says so.
pub fn pixel_sources(map: &Map, window: Rect, watch: Watch) -> Result<Positions, Interrupted> {
    if window.is_empty() {
        return Ok(Positions { x: Vec::new(), y: Vec::new() });
    }
    watch.reserve(window.width() * window.height() * size_of::<[f64; 2]>())?;
    sources(map, window, watch)
}

/// How far, px, a forward map takes the sources of a window's pixels from the pixels' centres, at most; for a backward
/// map, how far they lie from where it says.
///
/// - `map`: the warp.
/// - `window`: the pixels.
/// - `positions`: a source per pixel, px, row-major (asserted); those that are not finite are left out.
///
/// Cost: linear in the pixels, rows side by side. Stops when `watch` says so.
pub fn residual(map: &Map, window: Rect, positions: &Positions, watch: Watch) -> Result<f64, Interrupted> {
    let width = window.width();
    assert_eq!(positions.x.len(), width * window.height(), "one position per pixel");
    if window.is_empty() {
        return Ok(0.0);
    }
    let (net, is_forward) = match *map {
        Map::Forward { lattice, positions } => (Net::new(lattice, positions), true),
        Map::Backward { lattice, positions } => (Net::new(lattice, positions), false),
    };
    let at = |[x, y]: [f64; 2]| net.position(net.place(0, x), net.place(1, y));
    let steps = Steps::new(watch, window.height());
    let rows = positions.x.par_chunks(width).zip(positions.y.par_chunks(width)).enumerate();
    let worst = rows.map(|(row, (xs, ys))| {
        let far = xs.iter().zip(ys).enumerate().map(|(column, (&x, &y))| {
            let center = [(window.x0 + column as i64) as f64 + 0.5, (window.y0 + row as i64) as f64 + 0.5];
            let (found, sought) = if is_forward { (at([x, y]), center) } else { ([x, y], at(center)) };
            libm::hypot(found[0] - sought[0], found[1] - sought[1])
        });
        let worst = far.filter(|far| far.is_finite()).fold(0.0, f64::max);
        steps.step().map(|()| worst)
    });
    worst.try_reduce(|| 0.0, |a, b| Ok(a.max(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UNWATCHED;
    use crate::lattice::Lattice;
    use crate::resample::{Edge, Filter, Sampling, draw};
    use crate::view::{View, ViewMut};

    const LATTICE: Lattice = Lattice { origin: [-2.0, 1.0], spacing: [4.0, 3.0], nodes: [9, 8] };
    const WINDOW: Rect = Rect::new(-9, -3, 41, 31);

    fn bent() -> Positions {
        Positions::from_map(&LATTICE, |[x, y]| [x + 0.1 * y + 0.01 * x * y, y - 0.15 * x + 0.004 * y * y])
    }

    fn sources_of(map: &Map) -> Positions {
        pixel_sources(map, WINDOW, UNWATCHED).expect("nobody stops it")
    }

    #[test]
    fn sources_go_back_to_the_pixels() {
        let positions = bent();
        let map = Map::Forward { lattice: &LATTICE, positions: &positions };
        let found = sources_of(&map);
        let worst = residual(&map, WINDOW, &found, UNWATCHED).expect("nobody stops it");
        assert!(worst < 1e-9, "{worst}");
        // A source moved by half a pixel shows.
        let mut moved = found.clone();
        moved.x[700] += 0.5;
        let worst = residual(&map, WINDOW, &moved, UNWATCHED).expect("nobody stops it");
        assert!((0.4..0.7).contains(&worst), "{worst}");
        assert!(found.x.iter().chain(&found.y).all(|at| at.is_finite()), "it is continued over all of the window");
    }

    #[test]
    fn a_backward_map_is_evaluated() {
        let positions = bent();
        let map = Map::Backward { lattice: &LATTICE, positions: &positions };
        let found = sources_of(&map);
        let worst = residual(&map, WINDOW, &found, UNWATCHED).expect("nobody stops it");
        assert!(worst < 1e-12, "{worst}");
        // Pixel (0, 2) has its centre half across the first column of cells and half down the first row.
        let pixel = (2 + 3) * WINDOW.width() + 9;
        let [a, b] = [0, 1].map(|column| [bent().x[column], bent().x[9 + column]]);
        let mean = |t: f64, a: f64, b: f64| a + t * (b - a);
        let expected = mean(0.5, mean(0.625, a[0], b[0]), mean(0.625, a[1], b[1]));
        assert!((found.x[pixel] - expected).abs() < 1e-12, "{} {expected}", found.x[pixel]);
    }

    #[test]
    fn nothing_of_nothing() {
        let positions = bent();
        let map = Map::Forward { lattice: &LATTICE, positions: &positions };
        let empty = Rect::new(3, 3, 3, 9);
        let found = pixel_sources(&map, empty, UNWATCHED).expect("nobody stops it");
        assert_eq!((found.x.len(), residual(&map, empty, &found, UNWATCHED)), (0, Ok(0.0)));
    }

    /// A lattice of pixel centres: a pixel is drawn from its own node alone, whatever stands beside it.
    #[test]
    fn a_node_without_a_position_leaves_its_neighbours_theirs() {
        let lattice = Lattice { origin: [0.5, 0.5], spacing: [1.0, 1.0], nodes: [5, 4] };
        let mut positions = Positions::from_map(&lattice, |p| p);
        let holes = [7, 13, 19];
        holes.iter().for_each(|&hole| (positions.x[hole], positions.y[hole]) = (f64::NAN, f64::NAN));
        let (window, picture) = (Rect::new(0, 0, 5, 4), (1..=20).map(|n| n as f32).collect::<Vec<_>>());
        let map = Map::Backward { lattice: &lattice, positions: &positions };
        let found = pixel_sources(&map, window, UNWATCHED).expect("nobody stops it");
        for filter in [Filter::Nearest, Filter::Linear, Filter::Cubic] {
            let mut out = vec![9.0; 20];
            let (planes, outs) = ([View::packed(&picture, 5, 4)], vec![ViewMut::packed(&mut out, 5, 4)]);
            let sampling = Sampling { filter, edge: Edge::Transparent, clamp_ringing: false };
            draw(&map, window, window, &sampling, &planes, outs, UNWATCHED).expect("nobody stops it");
            for pixel in 0..20 {
                let expected = if holes.contains(&pixel) { 0.0 } else { picture[pixel] };
                assert_eq!(out[pixel], expected, "{filter:?}, pixel {pixel}");
                assert_eq!(found.x[pixel].is_nan(), holes.contains(&pixel), "pixel {pixel}");
            }
        }
    }
}
