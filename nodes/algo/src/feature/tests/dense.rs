//! The functional minimised densely, its constraints put in as they are said.

use super::*;

/// A vector over x and y of all nodes.
type Vector = Vec<f64>;

fn gradient_of(functional: &Functional, d: &[f64]) -> Vector {
    let [columns, rows] = functional.lattice.nodes;
    let count = columns * rows;
    let mut gradient = vec![0.0; 2 * count];
    for axis in 0..2 {
        let mut add = |p: usize, q: usize, c: f64| {
            let (p, q) = (axis * count + p, axis * count + q);
            gradient[q] += c * (d[q] - d[p]);
            gradient[p] -= c * (d[q] - d[p]);
        };
        for row in 0..rows {
            for column in 0..columns {
                let node = row * columns + column;
                if column + 1 < columns {
                    add(node, node + 1, functional.conductances.horizontal[row * (columns - 1) + column]);
                }
                if row + 1 < rows {
                    add(node, node + columns, functional.conductances.vertical[node]);
                }
            }
        }
    }
    gradient
}

/// What the fluxes push.
fn pushed(functional: &Functional) -> Vector {
    let [columns, rows] = functional.lattice.nodes;
    let mut push = Vec::new();
    for flux in functional.fluxes {
        let mut of_axis = vec![0.0; columns * rows];
        for row in 0..rows {
            for column in 0..columns {
                let node = row * columns + column;
                if column + 1 < columns {
                    of_axis[node + 1] += flux.horizontal[row * (columns - 1) + column];
                    of_axis[node] -= flux.horizontal[row * (columns - 1) + column];
                }
                if row + 1 < rows {
                    of_axis[node + columns] += flux.vertical[node];
                    of_axis[node] -= flux.vertical[node];
                }
            }
        }
        push.extend(of_axis);
    }
    push
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The functional at a displacement.
pub fn energy(functional: &Functional, positions: &Positions) -> f64 {
    let moved = |after: &[f64], before: &[f64]| after.iter().zip(before).map(|(a, b)| a - b).collect::<Vector>();
    let d = [moved(&positions.x, &functional.base.x), moved(&positions.y, &functional.base.y)].concat();
    dot(&d, &gradient_of(functional, &d)) - 2.0 * dot(&d, &pushed(functional))
}

/// An exact feature: its nodes, whether it mirrors, and `a` where that is fixed.
pub struct Similar {
    pub nodes: Vec<usize>,
    pub mirrored: bool,
    pub a: Option<[f64; 2]>,
}

/// Positions that minimise the functional over free and sliding nodes and the similarities of exact features.
pub fn minimise(functional: &Functional, exact: &[Similar]) -> Positions {
    let (lattice, base) = (functional.lattice, functional.base);
    let count = lattice.node_count();
    let mut moves: Vec<Vector> = Vec::new();
    let mut start = vec![0.0; 2 * count];
    let unit = |values: &[(usize, f64)]| {
        let mut vector = vec![0.0; 2 * count];
        values.iter().for_each(|&(index, value)| vector[index] = value);
        vector
    };
    for (node, freedom) in functional.freedom.iter().enumerate() {
        match *freedom {
            Freedom::Free => moves.extend([unit(&[(node, 1.0)]), unit(&[(count + node, 1.0)])]),
            Freedom::Along([x, y]) => moves.push(unit(&[(node, x), (count + node, y)])),
            Freedom::Pinned => {}
        }
    }
    for similar in exact {
        let rest = |node: usize| {
            let [x, y] = lattice.rest(node % lattice.nodes[0], node / lattice.nodes[0]);
            [x, if similar.mirrored { -y } else { y }]
        };
        let all = |of: &dyn Fn(usize) -> [f64; 2]| {
            let pairs = similar.nodes.iter().flat_map(|&node| [(node, of(node)[0]), (count + node, of(node)[1])]);
            unit(&pairs.collect::<Vec<_>>())
        };
        for &node in &similar.nodes {
            let ([x, y], [re, im]) = (rest(node), similar.a.unwrap_or_default());
            start[node] = re * x - im * y - base.x[node];
            start[count + node] = im * x + re * y - base.y[node];
        }
        moves.extend([all(&|_| [1.0, 0.0]), all(&|_| [0.0, 1.0])]);
        if similar.a.is_none() && similar.nodes.len() > 1 {
            moves.extend([all(&|node| rest(node)), all(&|node| [-rest(node)[1], rest(node)[0]])]);
        }
    }
    let target: Vector =
        pushed(functional).iter().zip(gradient_of(functional, &start)).map(|(push, pull)| push - pull).collect();
    let matrix: Vec<Vector> = moves
        .iter()
        .map(|one| {
            let pulled = gradient_of(functional, one);
            moves.iter().map(|other| dot(other, &pulled)).chain([dot(one, &target)]).collect()
        })
        .collect();
    for (size, vector) in eliminated(matrix).iter().zip(&moves) {
        start.iter_mut().zip(vector).for_each(|(d, value)| *d += size * value);
    }
    let moved = |before: &[f64], d: &[f64]| before.iter().zip(d).map(|(before, d)| before + d).collect();
    Positions { x: moved(&base.x, &start[..count]), y: moved(&base.y, &start[count..]) }
}

/// Gauss and Jordan with pivots; the last column is the right-hand side.
fn eliminated(mut m: Vec<Vector>) -> Vector {
    let n = m.len();
    for pivot in 0..n {
        let best = (pivot..n).max_by(|&a, &b| m[a][pivot].abs().total_cmp(&m[b][pivot].abs())).expect("a row");
        m.swap(pivot, best);
        let pivot_row = m[pivot].clone();
        for (_, values) in m.iter_mut().enumerate().filter(|(row, _)| *row != pivot) {
            let factor = values[pivot] / pivot_row[pivot];
            if factor != 0.0 {
                (pivot..=n).for_each(|column| values[column] -= factor * pivot_row[column]);
            }
        }
    }
    (0..n).map(|row| m[row][n] / m[row][row]).collect()
}
