//! One lattice of the hierarchy: conductances in single precision, rows split into even and odd columns.
//!
//! A row of an array holds its even columns, then its odd ones, so that what a half-sweep reads and writes is
//! contiguous: the neighbours of a half row are the other half of the row and the same halves of the rows around it.

/// Conductances and reciprocal diagonals of a lattice whose frame is pinned at 0.
#[derive(Debug)]
pub(super) struct Level {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Length of half a row; also the columns of the next coarser lattice.
    pub(super) half: usize,
    /// From every node to the right one; 0 where there is none or both are pinned.
    pub(super) right: Vec<f32>,
    /// From every node to the one below.
    pub(super) down: Vec<f32>,
    /// Of the sums of the conductances at every inner node; 0 on the frame.
    pub(super) inverse: Vec<f32>,
}

/// The couplings of half a row to its neighbours, inner nodes only.
#[derive(Clone, Copy)]
pub(super) struct Stencil<'a> {
    pub(super) up: &'a [f32],
    pub(super) down: &'a [f32],
    pub(super) left: &'a [f32],
    pub(super) right: &'a [f32],
    pub(super) inverse: &'a [f32],
}

/// The values next to half a row, inner nodes only.
#[derive(Clone, Copy)]
pub(super) struct Around<'a> {
    pub(super) up: &'a [f32],
    pub(super) down: &'a [f32],
    pub(super) left: &'a [f32],
    pub(super) right: &'a [f32],
}

impl Level {
    /// Of the conductances from the node at a column and a row to the right one and to the one below, asked for where
    /// there is such a node and not both are on the frame.
    fn new(
        [columns, rows]: [usize; 2],
        right: impl Fn(usize, usize) -> f32,
        down: impl Fn(usize, usize) -> f32,
    ) -> Self {
        let half = columns / 2 + 1;
        let empty = || vec![0.0; 2 * half * rows];
        let mut level = Self { columns, rows, half, right: empty(), down: empty(), inverse: empty() };
        for row in 0..rows {
            for column in 0..columns {
                let at = row * 2 * half + (column % 2) * half + column / 2;
                if row > 0 && row + 1 < rows && column + 1 < columns {
                    level.right[at] = right(column, row);
                }
                if column > 0 && column + 1 < columns && row + 1 < rows {
                    level.down[at] = down(column, row);
                }
            }
        }
        for row in 1..rows - 1 {
            for s in 0..2 {
                let stencil = level.stencil(row, s);
                let sum = |i: usize| stencil.up[i] + stencil.down[i] + stencil.left[i] + stencil.right[i];
                let inverse: Vec<f32> = (0..stencil.up.len()).map(|i| 1.0 / sum(i)).collect();
                let first = row * 2 * half + s * half + level.inner(s).0;
                level.inverse[first..first + inverse.len()].copy_from_slice(&inverse);
            }
        }
        level
    }

    /// The finest level: conductances times `scale`.
    pub(super) fn finest(nodes: [usize; 2], horizontal: &[f64], vertical: &[f64], scale: f64) -> Self {
        let columns = nodes[0];
        let right = |column: usize, row: usize| (horizontal[row * (columns - 1) + column] * scale) as f32;
        Self::new(nodes, right, |column, row| (vertical[row * columns + column] * scale) as f32)
    }

    /// The lattice of every other node. Two edges in line are joined in series; half of what lies beside on either
    /// side is added in parallel.
    pub(super) fn coarser(&self) -> Self {
        let nodes = [self.columns / 2 + 1, self.rows / 2 + 1];
        let (columns, rows) = (self.columns, self.rows);
        // An edge that ends behind the frame has no second part.
        let series = |a: f32, b: f32, whole: bool| if !whole { a } else { a * b / (a + b).max(f32::MIN_POSITIVE) };
        let across = |column: usize, row: usize| {
            series(self.edge(&self.right, column, row), self.edge(&self.right, column + 1, row), column + 2 < columns)
        };
        let along = |column: usize, row: usize| {
            series(self.edge(&self.down, column, row), self.edge(&self.down, column, row + 1), row + 2 < rows)
        };
        let right = |column: usize, row: usize| {
            let (c, r) = (2 * column, 2 * row);
            across(c, r) + 0.5 * (across(c, r - 1) + if r + 1 < rows { across(c, r + 1) } else { 0.0 })
        };
        let down = |column: usize, row: usize| {
            let (c, r) = (2 * column, 2 * row);
            along(c, r) + 0.5 * (along(c - 1, r) + if c + 1 < columns { along(c + 1, r) } else { 0.0 })
        };
        Self::new(nodes, right, down)
    }

    pub(super) fn edge(&self, edges: &[f32], column: usize, row: usize) -> f32 {
        if row >= self.rows || column >= self.columns {
            return 0.0;
        }
        edges[row * 2 * self.half + (column % 2) * self.half + column / 2]
    }

    /// Entries of an array over the nodes.
    pub(super) fn len(&self) -> usize {
        2 * self.half * self.rows
    }

    /// First and past-the-end index of the inner nodes in half a row, `s` 0 for even columns.
    #[inline(always)]
    pub(super) fn inner(&self, s: usize) -> (usize, usize) {
        if s == 0 { (1, self.columns / 2) } else { (0, (self.columns - 1) / 2) }
    }

    /// Half a row of an array.
    #[inline(always)]
    pub(super) fn half_row<'a>(&self, values: &'a [f32], row: usize, s: usize) -> &'a [f32] {
        &values[(2 * row + s) * self.half..(2 * row + s + 1) * self.half]
    }

    #[inline(always)]
    pub(super) fn row<'a>(&self, values: &'a [f32], row: usize) -> &'a [f32] {
        &values[2 * row * self.half..2 * (row + 1) * self.half]
    }

    #[inline(always)]
    pub(super) fn stencil(&self, row: usize, s: usize) -> Stencil<'_> {
        let (first, end) = self.inner(s);
        let (even, odd) = (self.half_row(&self.right, row, 0), self.half_row(&self.right, row, 1));
        let (left, right) =
            if s == 0 { (&odd[first - 1..end - 1], &even[first..end]) } else { (&even[first..end], &odd[first..end]) };
        let n = end - first;
        Stencil {
            up: &self.half_row(&self.down, row - 1, s)[first..][..n],
            down: &self.half_row(&self.down, row, s)[first..][..n],
            left: &left[..n],
            right: &right[..n],
            inverse: &self.half_row(&self.inverse, row, s)[first..][..n],
        }
    }

    /// What lies around half `s` of a row, given the halves `s` of the rows above and below and the row's other half.
    #[inline(always)]
    pub(super) fn around<'a>(&self, s: usize, up: &'a [f32], beside: &'a [f32], down: &'a [f32]) -> Around<'a> {
        let (first, end) = self.inner(s);
        let n = end - first;
        let (left, right) = if s == 0 { (first - 1, first) } else { (first, first + 1) };
        Around {
            up: &up[first..][..n],
            down: &down[first..][..n],
            left: &beside[left..][..n],
            right: &beside[right..][..n],
        }
    }
}

impl Stencil<'_> {
    /// Sum of the couplings times the values around.
    #[inline(always)]
    pub(super) fn flow(&self, i: usize, x: &Around) -> f32 {
        (self.up[i] * x.up[i] + self.down[i] * x.down[i]) + (self.left[i] * x.left[i] + self.right[i] * x.right[i])
    }

    /// What flows out of a node that has the value `here`, in differences: values that are nearly the same lose nothing
    /// to rounding.
    #[inline(always)]
    pub(super) fn outflow(&self, i: usize, here: f32, x: &Around) -> f32 {
        (self.up[i] * (here - x.up[i]) + self.down[i] * (here - x.down[i]))
            + (self.left[i] * (here - x.left[i]) + self.right[i] * (here - x.right[i]))
    }

    /// `out = (b + flow) / diagonal`: a Gauss-Seidel step of half a row.
    #[inline(always)]
    pub(super) fn relax(&self, b: &[f32], x: &Around, out: &mut [f32]) {
        let n = out.len();
        let stencil = self.cut(n);
        let (x, b) = (x.cut(n), &b[..n]);
        for i in 0..n {
            out[i] = (b[i] + stencil.flow(i, &x)) * stencil.inverse[i];
        }
    }

    #[inline(always)]
    pub(super) fn cut(&self, n: usize) -> Self {
        Self {
            up: &self.up[..n],
            down: &self.down[..n],
            left: &self.left[..n],
            right: &self.right[..n],
            inverse: &self.inverse[..n],
        }
    }
}

impl Around<'_> {
    #[inline(always)]
    pub(super) fn cut(&self, n: usize) -> Self {
        Self { up: &self.up[..n], down: &self.down[..n], left: &self.left[..n], right: &self.right[..n] }
    }
}

/// The row of an array with what lies around it.
#[inline(always)]
pub(super) fn rows_around(values: &mut [f32], row: usize, stride: usize) -> (&[f32], &mut [f32], &[f32]) {
    let (above, rest) = values.split_at_mut(row * stride);
    let (here, below) = rest.split_at_mut(stride);
    (&above[(row - 1) * stride..], here, &below[..stride])
}

/// The half `s` of a split row to write, and the other half.
#[inline(always)]
pub(super) fn halves(row: &mut [f32], half: usize, s: usize) -> (&mut [f32], &[f32]) {
    let (even, odd) = row.split_at_mut(half);
    if s == 0 { (even, odd) } else { (odd, even) }
}
