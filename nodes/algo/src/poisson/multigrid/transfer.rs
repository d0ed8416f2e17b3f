//! Between a lattice and that of every other node: interpolation by the conductances, and its transpose.
//!
//! A node between two coarse ones takes their mean weighted by the conductances towards them; a node amid four takes
//! the mean of its four neighbours, weighted likewise.

use super::level::Level;

/// Interpolates from the coarser lattice, row after row.
pub(super) struct Interpolation {
    /// The finished even rows above and below the row at work.
    above: Vec<f32>,
    below: Vec<f32>,
    between: Vec<f32>,
    /// The coarse rows of these, columns in order.
    coarse: [Vec<f32>; 2],
}

impl Interpolation {
    pub(super) fn new(level: &Level) -> Self {
        let row = || vec![0.0; 2 * level.half];
        Self { above: row(), below: row(), between: row(), coarse: [row(), row()] }
    }

    /// The interpolated row; to be asked for the inner rows from the first to the last.
    #[inline(always)]
    pub(super) fn row(&mut self, level: &Level, coarser: &Level, values: &[f32], row: usize) -> &[f32] {
        if row.is_multiple_of(2) {
            return &self.below;
        }
        std::mem::swap(&mut self.above, &mut self.below);
        self.coarse.swap(0, 1);
        if row + 2 < level.rows {
            self.even(level, coarser, values, row + 1);
        } else {
            self.below.fill(0.0);
            self.coarse[1].fill(0.0);
        }
        self.odd(level, row);
        &self.between
    }

    #[inline(always)]
    fn even(&mut self, level: &Level, coarser: &Level, values: &[f32], row: usize) {
        let coarse = &mut self.coarse[1];
        merge(coarser.row(values, row / 2), coarser.half, coarse);
        let (even, odd) = self.below.split_at_mut(level.half);
        let (first, end) = level.inner(0);
        even[first..end].copy_from_slice(&coarse[first..end]);
        let (first, end) = level.inner(1);
        let n = end - first;
        let (a, b) = (&level.half_row(&level.right, row, 0)[..n], &level.half_row(&level.right, row, 1)[..n]);
        let (left, right, out) = (&coarse[..n], &coarse[1..][..n], &mut odd[..n]);
        for i in 0..n {
            out[i] = (a[i] * left[i] + b[i] * right[i]) / (a[i] + b[i]);
        }
    }

    #[inline(always)]
    fn odd(&mut self, level: &Level, row: usize) {
        let (even, odd) = self.between.split_at_mut(level.half);
        let (first, end) = level.inner(0);
        let n = end - first;
        let stencil = level.stencil(row, 0).cut(n);
        let (up, down, out) = (&self.coarse[0][first..][..n], &self.coarse[1][first..][..n], &mut even[first..][..n]);
        for i in 0..n {
            out[i] = (stencil.up[i] * up[i] + stencil.down[i] * down[i]) / (stencil.up[i] + stencil.down[i]);
        }
        let (first, end) = level.inner(1);
        let around = level.around(1, &self.above[level.half..], even, &self.below[level.half..]);
        let out = &mut odd[first..end];
        let n = out.len();
        let (stencil, around) = (level.stencil(row, 1).cut(n), around.cut(n));
        for i in 0..n {
            out[i] = stencil.flow(i, &around) * stencil.inverse[i];
        }
    }
}

/// Restricts to the coarser lattice, row after row.
pub(super) struct Restriction {
    /// What the even row at work and the next one gather: at coarse nodes, and between them.
    nodes: [Vec<f32>; 2],
    between: [Vec<f32>; 2],
    amid: Vec<f32>,
    parts: Vec<f32>,
}

impl Restriction {
    pub(super) fn new(level: &Level) -> Self {
        let row = || vec![0.0; level.half + 1];
        Self { nodes: [row(), row()], between: [row(), row()], amid: row(), parts: row() }
    }

    /// Takes an inner row, from the first to the last; writes rows of `out` as they are done.
    #[inline(always)]
    pub(super) fn row(&mut self, level: &Level, coarser: &Level, values: &[f32], row: usize, out: &mut [f32]) {
        let half = level.half;
        let (even, odd) = values.split_at(half);
        if row.is_multiple_of(2) {
            add(&mut self.nodes[0][..half], even);
            add(&mut self.between[0][..half], odd);
        } else {
            self.odd(level, even, odd, row);
            self.finish(level, coarser, row - 1, out);
        }
        if row.is_multiple_of(2) && row + 2 == level.rows {
            self.finish(level, coarser, row, out);
        }
    }

    #[inline(always)]
    fn odd(&mut self, level: &Level, even: &[f32], odd: &[f32], row: usize) {
        let (first, end) = level.inner(1);
        let n = end - first;
        let stencil = level.stencil(row, 1).cut(n);
        let [here, next] = &mut self.between;
        let (amid, here, next, odd) = (&mut self.amid[..n], &mut here[..n], &mut next[..n], &odd[..n]);
        for i in 0..n {
            amid[i] = odd[i] * stencil.inverse[i];
            here[i] += amid[i] * stencil.up[i];
            next[i] += amid[i] * stencil.down[i];
        }
        let (first, end) = level.inner(0);
        let n = end - first;
        let stencil = level.stencil(row, 0).cut(n);
        let [here, next] = &mut self.nodes;
        let (here, next, even) = (&mut here[first..][..n], &mut next[first..][..n], &even[first..][..n]);
        let (left, right) = (&self.amid[first - 1..][..n], &self.amid[first..][..n]);
        for i in 0..n {
            let sum = even[i] + (left[i] * stencil.left[i] + right[i] * stencil.right[i]);
            let part = sum / (stencil.up[i] + stencil.down[i]);
            here[i] += part * stencil.up[i];
            next[i] += part * stencil.down[i];
        }
    }

    /// Writes the coarse row of an even row.
    #[inline(always)]
    fn finish(&mut self, level: &Level, coarser: &Level, row: usize, out: &mut [f32]) {
        if row > 0 {
            let n = level.inner(1).1;
            let (a, b) = (&level.half_row(&level.right, row, 0)[..n], &level.half_row(&level.right, row, 1)[..n]);
            let (between, parts) = (&self.between[0][..n], &mut self.parts[..n]);
            let nodes = &mut self.nodes[0];
            for i in 0..n {
                parts[i] = between[i] / (a[i] + b[i]);
            }
            add_products(&mut nodes[..n], a, parts);
            add_products(&mut nodes[1..][..n], b, parts);
            // What falls on the frame is lost.
            nodes[0] = 0.0;
            nodes[level.columns / 2..].fill(0.0);
            let at = 2 * coarser.half * (row / 2);
            split(nodes, coarser.columns, coarser.half, &mut out[at..at + 2 * coarser.half]);
        }
        self.nodes.swap(0, 1);
        self.between.swap(0, 1);
        self.nodes[1].fill(0.0);
        self.between[1].fill(0.0);
    }
}

#[inline(always)]
fn add(sums: &mut [f32], values: &[f32]) {
    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
}

#[inline(always)]
fn add_products(sums: &mut [f32], a: &[f32], b: &[f32]) {
    sums.iter_mut().zip(a).zip(b).for_each(|((sum, a), b)| *sum += a * b);
}

/// Even columns, then odd ones, from columns in order.
#[inline(always)]
fn split(values: &[f32], columns: usize, half: usize, out: &mut [f32]) {
    let (even, odd) = out.split_at_mut(half);
    let pairs = values[..columns].chunks_exact(2);
    if let [last] = pairs.remainder() {
        even[columns / 2] = *last;
    }
    for ((pair, even), odd) in pairs.zip(even).zip(odd) {
        (*even, *odd) = (pair[0], pair[1]);
    }
}

/// Columns in order from even columns, then odd ones.
#[inline(always)]
fn merge(values: &[f32], half: usize, out: &mut [f32]) {
    let (even, odd) = values.split_at(half);
    for ((pair, even), odd) in out.chunks_exact_mut(2).zip(even).zip(odd) {
        (pair[0], pair[1]) = (*even, *odd);
    }
}
