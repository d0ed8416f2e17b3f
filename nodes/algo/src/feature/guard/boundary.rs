//! The image of a lattice's boundary: a closed polygon.

use crate::lattice::Positions;
use robust::{Coord, orient2d};

/// Twice the area that the boundary's image encloses; positive where it runs clockwise on screen.
pub(super) fn doubled_area(x: &Positions, border: &[usize]) -> f64 {
    let origin = border[0];
    let at = |node: usize| [x.x[node] - x.x[origin], x.y[node] - x.y[origin]];
    let pairs = border.iter().zip(border.iter().cycle().skip(1));
    pairs.map(|(&p, &q)| at(p)[0] * at(q)[1] - at(p)[1] * at(q)[0]).sum()
}

/// The first nodes of two edges of the boundary's image that cross or touch, beyond sharing an end; by exact tests.
///
/// Edges are put into buckets of a square grid over the image, about one edge to a bucket row: O(n) for boundaries
/// with edges of like length, O(n^2) at worst.
pub(super) fn crossing(x: &Positions, border: &[usize]) -> Option<[usize; 2]> {
    let n = border.len();
    let at = |i: usize| Coord { x: x.x[border[i % n]], y: x.y[border[i % n]] };
    let (mut low, mut high) = (at(0), at(0));
    for i in 1..n {
        let p = at(i);
        low = Coord { x: low.x.min(p.x), y: low.y.min(p.y) };
        high = Coord { x: high.x.max(p.x), y: high.y.max(p.y) };
    }
    let side = (n as f64).sqrt().ceil() as usize;
    let place = |value: f64, low: f64, high: f64| {
        let part = if high > low { (value - low) / (high - low) } else { 0.0 };
        ((part * side as f64) as usize).min(side - 1)
    };
    let mut buckets: Vec<Vec<u32>> = vec![Vec::new(); side * side];
    for i in 0..n {
        let (p, q) = (at(i), at(i + 1));
        let (columns, rows) =
            ([p.x, q.x].map(|v| place(v, low.x, high.x)), [p.y, q.y].map(|v| place(v, low.y, high.y)));
        for row in rows[0].min(rows[1])..=rows[0].max(rows[1]) {
            for column in columns[0].min(columns[1])..=columns[0].max(columns[1]) {
                buckets[row * side + column].push(i as u32);
            }
        }
    }
    let meet = |i: usize, j: usize| match (j + n - i) % n {
        1 => fold_back(at(i), at(i + 1), at(i + 2)),
        apart if apart + 1 == n => fold_back(at(j), at(j + 1), at(j + 2)),
        _ => touch([at(i), at(i + 1)], [at(j), at(j + 1)]),
    };
    buckets.iter().find_map(|bucket| {
        let pairs =
            bucket.iter().enumerate().flat_map(|(k, &i)| bucket[..k].iter().map(move |&j| [j as usize, i as usize]));
        pairs.into_iter().find(|&[i, j]| meet(i, j)).map(|pair| pair.map(|i| border[i]))
    })
}

/// Two edges that share q run over each other, or one is a point.
fn fold_back(p: Coord<f64>, q: Coord<f64>, r: Coord<f64>) -> bool {
    let ahead = (q.x - p.x) * (r.x - q.x) + (q.y - p.y) * (r.y - q.y);
    p == q || q == r || (orient2d(p, q, r) == 0.0 && ahead < 0.0)
}

fn touch(a: [Coord<f64>; 2], b: [Coord<f64>; 2]) -> bool {
    let overlap = |a: [f64; 2], b: [f64; 2]| a[0].min(a[1]) <= b[0].max(b[1]) && b[0].min(b[1]) <= a[0].max(a[1]);
    if !overlap(a.map(|p| p.x), b.map(|p| p.x)) || !overlap(a.map(|p| p.y), b.map(|p| p.y)) {
        return false;
    }
    let apart = |[p, q]: [Coord<f64>; 2], [r, s]: [Coord<f64>; 2]| {
        let (first, second) = (orient2d(p, q, r), orient2d(p, q, s));
        (first > 0.0 && second > 0.0) || (first < 0.0 && second < 0.0)
    };
    !apart(a, b) && !apart(b, a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::{Lattice, border};

    fn lattice(nodes: [usize; 2]) -> Lattice {
        Lattice { origin: [0.0; 2], spacing: [1.0; 2], nodes }
    }

    #[test]
    fn the_border_runs_once_around() {
        assert_eq!(border([3, 4]), [0, 1, 2, 5, 8, 11, 10, 9, 6, 3]);
        assert_eq!(border([2, 2]), [0, 1, 3, 2]);
        let rest = Positions::from_map(&lattice([5, 4]), |p| p);
        assert_eq!(doubled_area(&rest, &border([5, 4])), 24.0);
        let mirrored = Positions::from_map(&lattice([5, 4]), |[x, y]| [-x, y]);
        assert_eq!(doubled_area(&mirrored, &border([5, 4])), -24.0);
    }

    #[test]
    fn crossing_and_touching_are_found_and_nothing_else() {
        let nodes = [12, 9];
        let around = border(nodes);
        let of = |map: fn([f64; 2]) -> [f64; 2]| crossing(&Positions::from_map(&lattice(nodes), map), &around);
        assert_eq!(of(|p| p), None);
        assert_eq!(of(|[x, y]| [x * (1.0 + y), y * y + 0.3 * x]), None);
        assert!(of(|[x, y]| [x * (4.5 - y), y]).is_some(), "a bow tie");
        assert!(of(|[x, _]| [x, 0.0]).is_some(), "a line");
        assert!(of(|_| [1.0, 1.0]).is_some(), "a point");
        // Node (5, 0) touches the lower side between its nodes, then passes it.
        for (y, meets) in [(7.9, false), (8.0, true), (8.1, true)] {
            let mut x = Positions::from_map(&lattice(nodes), |p| p);
            (x.x[5], x.y[5]) = (5.5, y);
            assert_eq!(crossing(&x, &around).is_some(), meets, "{y}");
        }
        // A spike without width.
        let mut x = Positions::from_map(&lattice(nodes), |p| p);
        x.x[5] = 3.5;
        assert!(crossing(&x, &around).is_some());
    }

    #[test]
    fn buckets_miss_no_pair() {
        let nodes = [9, 7];
        let around = border(nodes);
        let n = around.len();
        let (mut state, mut found) = (1u32, 0);
        let mut number = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 23) - 1.0
        };
        for _ in 0..400 {
            let mut x = Positions::from_map(&lattice(nodes), |p| p);
            x.x.iter_mut().chain(&mut x.y).for_each(|value| *value += 0.8 * number());
            let at = |i: usize| Coord { x: x.x[around[i % n]], y: x.y[around[i % n]] };
            let pairs = (0..n).flat_map(|i| (i + 2..n).map(move |j| [i, j])).filter(|&[i, j]| (i + n - j) % n != 1);
            let any = pairs.into_iter().any(|[i, j]| touch([at(i), at(i + 1)], [at(j), at(j + 1)]));
            assert_eq!(crossing(&x, &around).is_some(), any);
            found += usize::from(any);
        }
        assert!(found > 40 && found < 360, "{found} of 400");
    }
}
