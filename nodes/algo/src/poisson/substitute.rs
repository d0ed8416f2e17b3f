//! Forward and backward substitution with a supernodal Cholesky factor for two right-hand sides.

use crate::simd::vectorized;
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;

/// Columns of the factor taken together.
const TOGETHER: usize = 4;

/// Partial sums of a scalar product, so that its order does not depend on the machine's vectors.
const LANES: usize = 8;

/// Values of the rows of one supernode, for both right-hand sides.
type Local<'a> = [&'a mut [f64]; 2];

/// Solves `G G^T x = b` in place, G lower triangular, for two right-hand sides in order of elimination.
///
/// * `values`: the supernodes one after the other, each column-major: first the rows of its own columns.
///
/// Every entry is read twice. The bits do not depend on the machine.
pub(super) fn solve(symbolic: &SymbolicSupernodalCholesky<u32>, values: &[f64], [x, y]: [&mut [f64]; 2]) {
    vectorized(
        #[inline(always)]
        || walk(symbolic, values, [&mut *x, &mut *y]),
    );
}

#[inline(always)]
fn walk(symbolic: &SymbolicSupernodalCholesky<u32>, values: &[f64], [x, y]: Local) {
    let supernodes = symbolic.n_supernodes();
    let ends = symbolic.supernode_end();
    let rows =
        |s: usize| symbolic.supernode(s).pattern().len() + ends[s] as usize - symbolic.supernode_begin()[s] as usize;
    let most = (0..supernodes).map(rows).max().unwrap_or(0);
    let (mut a, mut b) = (vec![0.0; most], vec![0.0; most]);
    let starts = symbolic.col_ptr_for_val();
    for s in 0..supernodes {
        let supernode = symbolic.supernode(s);
        let (first, last, pattern) = (supernode.start(), ends[s] as usize, supernode.pattern());
        let (width, height) = (last - first, last - first + pattern.len());
        let (a, b) = (&mut a[..height], &mut b[..height]);
        for (local, x) in [(&mut *a, &*x), (&mut *b, &*y)] {
            local[..width].copy_from_slice(&x[first..last]);
            local[width..].fill(0.0);
        }
        forward(&values[starts[s] as usize..starts[s + 1] as usize], width, [a, b]);
        for (local, x) in [(&*a, &mut *x), (&*b, &mut *y)] {
            x[first..last].copy_from_slice(&local[..width]);
            local[width..].iter().zip(pattern).for_each(|(value, &row)| x[row as usize] += value);
        }
    }
    for s in (0..supernodes).rev() {
        let supernode = symbolic.supernode(s);
        let (first, last, pattern) = (supernode.start(), ends[s] as usize, supernode.pattern());
        let (width, height) = (last - first, last - first + pattern.len());
        let (a, b) = (&mut a[..height], &mut b[..height]);
        for (local, x) in [(&mut *a, &*x), (&mut *b, &*y)] {
            local[..width].copy_from_slice(&x[first..last]);
            local[width..].iter_mut().zip(pattern).for_each(|(value, &row)| *value = x[row as usize]);
        }
        backward(&values[starts[s] as usize..starts[s + 1] as usize], width, [a, b]);
        x[first..last].copy_from_slice(&a[..width]);
        y[first..last].copy_from_slice(&b[..width]);
    }
}

/// Solves for the `width` columns of a supernode and subtracts their share from its other rows.
#[inline(always)]
fn forward(columns: &[f64], width: usize, [a, b]: Local) {
    let whole = width - width % TOGETHER;
    for column in (0..whole).step_by(TOGETHER) {
        forward_columns::<TOGETHER>(columns, column, [a, b]);
    }
    for column in whole..width {
        forward_columns::<1>(columns, column, [a, b]);
    }
}

#[inline(always)]
fn forward_columns<const N: usize>(columns: &[f64], column: usize, [a, b]: Local) {
    let height = a.len();
    let entries: [&[f64]; N] = std::array::from_fn(|k| &columns[(column + k) * height..(column + k + 1) * height]);
    let (mut p, mut q) = ([0.0; N], [0.0; N]);
    for k in 0..N {
        let (mut rest_a, mut rest_b) = (a[column + k], b[column + k]);
        for j in 0..k {
            rest_a -= entries[j][column + k] * p[j];
            rest_b -= entries[j][column + k] * q[j];
        }
        (p[k], q[k]) = (rest_a / entries[k][column + k], rest_b / entries[k][column + k]);
        (a[column + k], b[column + k]) = (p[k], q[k]);
    }
    let (a, b) = (&mut a[column + N..], &mut b[column + N..]);
    let length = a.len();
    let b = &mut b[..length];
    let entries: [&[f64]; N] = std::array::from_fn(|k| &entries[k][column + N..][..length]);
    for i in 0..length {
        let (mut value_a, mut value_b) = (a[i], b[i]);
        for k in 0..N {
            value_a -= entries[k][i] * p[k];
            value_b -= entries[k][i] * q[k];
        }
        (a[i], b[i]) = (value_a, value_b);
    }
}

/// Solves with the transpose of a supernode for its `width` columns, its other rows known.
#[inline(always)]
fn backward(columns: &[f64], width: usize, [a, b]: Local) {
    let whole = width - width % TOGETHER;
    for column in (whole..width).rev() {
        backward_columns::<1>(columns, column, [a, b]);
    }
    for column in (0..whole).step_by(TOGETHER).rev() {
        backward_columns::<TOGETHER>(columns, column, [a, b]);
    }
}

#[inline(always)]
fn backward_columns<const N: usize>(columns: &[f64], column: usize, [a, b]: Local) {
    let height = a.len();
    let entries: [&[f64]; N] = std::array::from_fn(|k| &columns[(column + k) * height..(column + k + 1) * height]);
    let below: [&[f64]; N] = std::array::from_fn(|k| &entries[k][column + N..]);
    let (p, q) = products(below, [&a[column + N..], &b[column + N..]]);
    for k in (0..N).rev() {
        let (mut rest_a, mut rest_b) = (a[column + k] - p[k], b[column + k] - q[k]);
        for j in k + 1..N {
            rest_a -= entries[k][column + j] * a[column + j];
            rest_b -= entries[k][column + j] * b[column + j];
        }
        (a[column + k], b[column + k]) = (rest_a / entries[k][column + k], rest_b / entries[k][column + k]);
    }
}

/// Scalar products of N columns with two vectors.
#[inline(always)]
fn products<const N: usize>(columns: [&[f64]; N], [a, b]: [&[f64]; 2]) -> ([f64; N], [f64; N]) {
    let length = a.len();
    let whole = length - length % LANES;
    let (mut p, mut q) = ([[0.0; LANES]; N], [[0.0; LANES]; N]);
    for at in (0..whole).step_by(LANES) {
        let (a, b) = (&a[at..at + LANES], &b[at..at + LANES]);
        for k in 0..N {
            let column = &columns[k][at..at + LANES];
            for lane in 0..LANES {
                p[k][lane] += column[lane] * a[lane];
                q[k][lane] += column[lane] * b[lane];
            }
        }
    }
    for at in whole..length {
        for k in 0..N {
            p[k][at - whole] += columns[k][at] * a[at];
            q[k][at - whole] += columns[k][at] * b[at];
        }
    }
    (p.map(sum), q.map(sum))
}

#[inline(always)]
fn sum([a, b, c, d, e, f, g, h]: [f64; LANES]) -> f64 {
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}
