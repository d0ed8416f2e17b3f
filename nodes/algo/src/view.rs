//! Views over rows of samples: the only form in which pixels enter or leave an algorithm.

use rayon::prelude::*;

/// A rectangle of samples, row by row; rows are `stride` samples apart.
#[derive(Clone, Copy, Debug)]
pub struct View<'a, T> {
    samples: &'a [T],
    width: usize,
    height: usize,
    stride: usize,
}

/// A rectangle of samples to be written, row by row; rows are `stride` samples apart.
#[derive(Debug)]
pub struct ViewMut<'a, T> {
    samples: &'a mut [T],
    width: usize,
    height: usize,
    stride: usize,
}

fn assert_shape(len: usize, width: usize, height: usize, stride: usize) {
    assert!(width <= stride || height == 0, "rows of {width} samples overlap at stride {stride}");
    assert!(height == 0 || width == 0 || len >= (height - 1) * stride + width, "{len} samples are too few");
}

impl<'a, T> View<'a, T> {
    /// `samples`: at least (height - 1) * stride + width of them; `stride >= width`.
    pub fn new(samples: &'a [T], width: usize, height: usize, stride: usize) -> Self {
        assert_shape(samples.len(), width, height, stride);
        Self { samples, width, height, stride }
    }

    /// A view over rows that follow each other without a gap.
    pub fn packed(samples: &'a [T], width: usize, height: usize) -> Self {
        Self::new(samples, width, height, width)
    }

    /// Samples per row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All samples from the first row's first on, and how many a row is from the next.
    pub fn samples(&self) -> (&'a [T], usize) {
        (self.samples, self.stride)
    }

    /// Row `y`, `width` samples; `y < height`.
    pub fn row(&self, y: usize) -> &'a [T] {
        assert!(y < self.height, "row {y} of {}", self.height);
        if self.width == 0 { &[] } else { &self.samples[y * self.stride..y * self.stride + self.width] }
    }

    /// All rows from the top.
    pub fn rows(&self) -> impl Iterator<Item = &'a [T]> + use<'a, T> {
        let view = View { samples: self.samples, width: self.width, height: self.height, stride: self.stride };
        (0..view.height).map(move |y| view.row(y))
    }
}

impl<'a, T: Send> ViewMut<'a, T> {
    /// `samples`: at least (height - 1) * stride + width of them; `stride >= width`.
    pub fn new(samples: &'a mut [T], width: usize, height: usize, stride: usize) -> Self {
        assert_shape(samples.len(), width, height, stride);
        Self { samples, width, height, stride }
    }

    /// A view over rows that follow each other without a gap.
    pub fn packed(samples: &'a mut [T], width: usize, height: usize) -> Self {
        Self::new(samples, width, height, width)
    }

    /// Samples per row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Row `y` to write; `y < height`.
    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        assert!(y < self.height, "row {y} of {}", self.height);
        if self.width == 0 { &mut [] } else { &mut self.samples[y * self.stride..y * self.stride + self.width] }
    }

    /// Cuts the view into bands of `rows` rows (the last may be lower), each with the number of its first row.
    pub fn bands(self, rows: usize) -> Vec<(usize, ViewMut<'a, T>)> {
        let Self { samples, width, height, stride } = self;
        if width == 0 || height == 0 {
            return Vec::new();
        }
        let used = (height - 1) * stride + width;
        samples[..used]
            .chunks_mut(rows * stride)
            .enumerate()
            .map(|(band, samples)| {
                let top = band * rows;
                (top, ViewMut { samples, width, height: rows.min(height - top), stride })
            })
            .collect()
    }

    /// Calls `f(y, row)` for every row, rows side by side on the current thread pool.
    pub fn par_rows(self, f: impl Fn(usize, &mut [T]) + Sync) {
        let Self { samples, width, height, stride } = self;
        if width == 0 || height == 0 {
            return;
        }
        let used = (height - 1) * stride + width;
        samples[..used].par_chunks_mut(stride).enumerate().for_each(|(y, row)| f(y, &mut row[..width]));
    }
}
