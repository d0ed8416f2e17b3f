//! Four planes drawn together beside each drawn alone.

use super::*;

/// Four planes are weighed by other vectors than one alone, where the processor has them.
#[test]
fn planes_drawn_together_and_alone_have_the_same_bits() {
    let window = Rect::new(0, 0, 150, 130);
    let hard: Vec<_> = (0..4).map(|seed| hard_picture(window, seed)).collect();
    let tame: Vec<_> = (0..4).map(|seed| noise(window.width() * window.height(), seed)).collect();
    let lattice = over(window, [150, 130]);
    // Shrunk by 0.8 a block is drawn from one copy, by 9 pixel by pixel.
    for shrink in [0.8, 9.0] {
        let turned = |[x, y]: [f64; 2]| [shrink * (x - 0.6 * y) + 40.3, shrink * (0.6 * x + y) - 30.7];
        let positions = Positions::from_map(&lattice, turned);
        let map = Map::Backward { lattice: &lattice, positions: &positions };
        for (planes, filter) in [&hard, &tame].into_iter().flat_map(|planes| FILTERS.map(|filter| (planes, filter))) {
            for clamp_ringing in [false, true] {
                let sampling = Sampling { filter, edge: Edge::Transparent, clamp_ringing };
                let draw = |planes: &[Vec<f32>]| {
                    let mut out = vec![vec![f32::NAN; 150 * 130]; planes.len()];
                    let views: Vec<_> = planes.iter().map(|plane| View::packed(plane, 150, 130)).collect();
                    let outs = out.iter_mut().map(|out| ViewMut::packed(out, 150, 130)).collect();
                    draw(&map, window, window, &sampling, &views, outs, UNWATCHED).expect("unwatched");
                    out.iter().map(|plane| bits(plane)).collect::<Vec<_>>()
                };
                let alone: Vec<_> = planes.iter().flat_map(|plane| draw(std::slice::from_ref(plane))).collect();
                for count in [2, 3, 4] {
                    assert!(draw(&planes[..count]) == alone[..count], "{count}: {filter:?} {clamp_ringing} {shrink}");
                }
            }
        }
    }
}

/// A block whose pixels lie far apart is drawn from the planes themselves, a pixel alone from a copy.
#[test]
fn scattered_pixels_drawn_together_and_alone_have_the_same_bits() {
    let (window, mut state) = (Rect::new(-3, 2, 13, 18), 7);
    let mut place = || [0, 1].map(|_: usize| (random(&mut state) % 300_000) as f64 / 1000.0 - 120.0);
    let lattice = Lattice { origin: [-2.5, 2.5], spacing: [1.0; 2], nodes: [16; 2] };
    let places: Vec<_> = (0..256).map(|_| place()).collect();
    let positions =
        Positions { x: places.iter().map(|at| at[0]).collect(), y: places.iter().map(|at| at[1]).collect() };
    let map = Map::Backward { lattice: &lattice, positions: &positions };
    for source in [Rect::new(0, 0, 80, 90), Rect::new(-40, 3, 120, 5), Rect::new(9, -30, 12, 100)] {
        let planes = [hard_picture(source, 1), noise(source.width() * source.height(), 2)];
        for (filter, edge) in FILTERS.into_iter().take(4).flat_map(|filter| EDGES.map(|edge| (filter, edge))) {
            for clamp_ringing in [false, true] {
                let sampling = Sampling { filter, edge, clamp_ringing };
                let draw = |window: Rect| {
                    let [width, height] = [window.width(), window.height()];
                    let mut out = vec![vec![f32::NAN; width * height]; 2];
                    let views: Vec<_> =
                        planes.iter().map(|plane| View::packed(plane, source.width(), source.height())).collect();
                    let outs = out.iter_mut().map(|out| ViewMut::packed(out, width, height)).collect();
                    draw(&map, source, window, &sampling, &views, outs, UNWATCHED).expect("unwatched");
                    out.iter().map(|plane| bits(plane)).collect::<Vec<_>>()
                };
                let together = draw(window);
                for i in 0..256 {
                    let (x, y) = (window.x0 + i % 16, window.y0 + i / 16);
                    let alone = draw(Rect::new(x, y, x + 1, y + 1));
                    for plane in 0..2 {
                        assert_eq!(
                            alone[plane][0], together[plane][i as usize],
                            "{filter:?} {edge:?} {:?}",
                            places[i as usize]
                        );
                    }
                }
            }
        }
    }
}
