//! Rectangles of whole pixels.

/// The pixels (i, j) with `x0 <= i < x1` and `y0 <= j < y1`; empty where an end does not lie after its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rect {
    /// First column.
    pub x0: i64,
    /// First row.
    pub y0: i64,
    /// One past the last column.
    pub x1: i64,
    /// One past the last row.
    pub y1: i64,
}

impl Rect {
    /// Columns `x0..x1` of rows `y0..y1`.
    pub const fn new(x0: i64, y0: i64, x1: i64, y1: i64) -> Self {
        Self { x0, y0, x1, y1 }
    }

    /// Count of columns.
    pub fn width(&self) -> usize {
        self.x1.saturating_sub(self.x0).max(0) as usize
    }

    /// Count of rows.
    pub fn height(&self) -> usize {
        self.y1.saturating_sub(self.y0).max(0) as usize
    }

    /// Whether it holds no pixel.
    pub fn is_empty(&self) -> bool {
        self.x1 <= self.x0 || self.y1 <= self.y0
    }

    /// The pixels in both.
    pub fn intersect(&self, other: &Self) -> Self {
        Self {
            x0: self.x0.max(other.x0),
            y0: self.y0.max(other.y0),
            x1: self.x1.min(other.x1),
            y1: self.y1.min(other.y1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_intersections() {
        let a = Rect::new(-2, 1, 3, 4);
        assert_eq!((a.width(), a.height(), a.is_empty()), (5, 3, false));
        assert_eq!(a.intersect(&Rect::new(0, 0, 9, 2)), Rect::new(0, 1, 3, 2));
        let apart = a.intersect(&Rect::new(5, 1, 6, 4));
        assert!(apart.is_empty());
        assert_eq!(apart.width(), 0);
        assert_eq!(Rect::new(i64::MIN, 0, i64::MAX, 1).width(), i64::MAX as usize);
    }
}
