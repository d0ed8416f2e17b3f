//! Long runs beyond the edges, and whole positions among them.

use super::*;

#[test]
fn long_runs_beyond_the_edges_are_the_source_again() {
    let dst = Rect::new(0, 0, 300, 3);
    let lattice = over(dst, [300, 3]);
    for width in [1_i64, 2, 17, 50, 90] {
        let source = Rect::new(0, 0, width, 3);
        let planes: Vec<_> = (0..4).map(|seed| noise(3 * width as usize, seed)).collect();
        let positions = Positions::from_map(&lattice, |[x, y]| [x - 120.0, y]);
        let map = Map::Backward { lattice: &lattice, positions: &positions };
        for (filter, edge) in FILTERS.into_iter().flat_map(|filter| EDGES.map(|edge| (filter, edge))) {
            let (out, _) = drawn(&map, source, dst, filter, edge, &planes);
            for (out, plane) in out.iter().zip(&planes) {
                for (i, &value) in out.iter().enumerate() {
                    let (x, row) = (i as i64 % 300 - 120, &plane[i / 300 * width as usize..][..width as usize]);
                    let phase = x.rem_euclid(2 * width);
                    let column = match edge {
                        Edge::Transparent if !(0..width).contains(&x) => None,
                        Edge::Transparent => Some(x),
                        Edge::Clamp => Some(x.clamp(0, width - 1)),
                        Edge::Wrap => Some(x.rem_euclid(width)),
                        Edge::Mirror => Some(phase.min(2 * width - 1 - phase)),
                    };
                    assert_eq!(value, column.map_or(0.0, |at| row[at as usize]), "{filter:?} {edge:?} {width} {x}");
                }
            }
        }
    }
}

/// Where a row's finite values are taken as they are, a pixel drawn alone is the same, zeros' signs included.
#[test]
fn whole_positions_give_the_same_bits_in_a_row_and_alone() {
    let (source, dst) = (Rect::new(0, 0, 40, 6), Rect::new(-2, 0, 44, 6));
    let values = [0.0, -0.0, 1e-41, f32::MAX, 0.25, -3.0, -0.0];
    let planes: Vec<Vec<f32>> =
        (0..4).map(|k| (0..240).map(|i| values[(i * (k + 2) + i / 40) % 7]).collect()).collect();
    let lattice = over(dst, [46, 6]);
    for shift in [[0.0, 0.0], [0.0, 0.25], [3.0, -1.0], [0.5, 0.0]] {
        let positions = Positions::from_map(&lattice, |[x, y]| [x + shift[0], y + shift[1]]);
        let map = Map::Backward { lattice: &lattice, positions: &positions };
        for filter in FILTERS.into_iter().chain([Filter::Mitchell]) {
            for clamp_ringing in [false, true] {
                let sampling = Sampling { filter, edge: Edge::Transparent, clamp_ringing };
                let draw = |window: Rect| {
                    let [width, height] = [window.width(), window.height()];
                    let mut out = vec![vec![f32::NAN; width * height]; 4];
                    let views: Vec<_> = planes.iter().map(|plane| View::packed(plane, 40, 6)).collect();
                    let outs = out.iter_mut().map(|out| ViewMut::packed(out, width, height)).collect();
                    draw(&map, source, window, &sampling, &views, outs, UNWATCHED).expect("unwatched");
                    out.iter().map(|plane| bits(plane)).collect::<Vec<_>>()
                };
                let whole = draw(dst);
                for (i, (x, y)) in (0..6).flat_map(|y| (-2..44).map(move |x| (x, y))).enumerate() {
                    for (together, alone) in whole.iter().zip(draw(Rect::new(x, y, x + 1, y + 1))) {
                        assert_eq!(together[i], alone[0], "{filter:?} {clamp_ringing} {shift:?} {x} {y}");
                    }
                }
            }
        }
    }
}
