//! Which triangle is seen where.

use rayon::prelude::*;

use super::cross;
use crate::{Interrupted, Watch};

/// Side of a tile, px.
pub(super) const TILE: usize = 16;

/// No triangle.
pub(super) const NONE: u32 = u32::MAX;

/// A picture plane: its size, px, and its distance from the eye, px.
#[derive(Clone, Copy)]
pub(super) struct Screen {
    pub size: [usize; 2],
    pub focal: f64,
    /// What is nearer is cut off.
    pub near: f64,
}

impl Screen {
    /// A position in pixels from the upper left corner, as one from the picture's middle.
    fn about_middle(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x - self.size[0] as f64 / 2.0, y - self.size[1] as f64 / 2.0]
    }

    pub(super) fn tiles(&self) -> [usize; 2] {
        self.size.map(|side| side.div_ceil(TILE))
    }

    /// The pixels (x0, y0, x1, y1) that the part of a triangle beyond the near plane may touch.
    fn bounds(&self, corners: [[f64; 3]; 3]) -> Option<[usize; 4]> {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        let mut take = |[x, y, z]: [f64; 3]| {
            for (axis, at) in [x, -y].into_iter().enumerate() {
                let at = at / z * self.focal + self.size[axis] as f64 / 2.0;
                (low[axis], high[axis]) = (low[axis].min(at), high[axis].max(at));
            }
        };
        for at in 0..3 {
            let (here, next) = (corners[at], corners[(at + 1) % 3]);
            if here[2] >= self.near {
                take(here);
            }
            if (here[2] >= self.near) != (next[2] >= self.near) {
                let part = (self.near - here[2]) / (next[2] - here[2]);
                let [x, y] = [0, 1].map(|axis| here[axis] + part * (next[axis] - here[axis]));
                take([x, y, self.near]);
            }
        }
        let first = |axis: usize| low[axis].floor().max(0.0);
        let end = |axis: usize| (high[axis].floor() + 1.0).min(self.size[axis] as f64);
        let is_seen = first(0) < end(0) && first(1) < end(1);
        is_seen.then(|| [first(0), first(1), end(0), end(1)].map(|edge| edge as usize))
    }
}

/// A triangle as three planes through the eye.
///
/// At (x, y) px from the picture's middle, `edge[i]` . (x, y, 1) is the share of corner i in the point that is seen
/// there, times a factor that the three have in common; the point lies in the triangle and before the eye iff none is
/// negative. The edge that two triangles have in common is the same plane with opposite sign, bit for bit, so no
/// sample falls between them.
pub(super) struct Edges {
    edges: [[f64; 3]; 3],
    /// From the sum of the shares to 1 / depth.
    scale: f64,
    /// Whether its front is seen.
    pub is_front: bool,
}

impl Edges {
    /// `corners`: as seen by the camera. None for a triangle that is seen edge-on, or has no area or no position.
    pub(super) fn new(corners: [[f64; 3]; 3], focal: f64) -> Option<Self> {
        let [p, q, r] = corners;
        let normals = [cross(q, r), cross(r, p), cross(p, q)];
        let volume = super::dot(p, normals[0]);
        let scale = 1.0 / (volume.abs() * focal);
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        // The camera's space is left-handed: right, up, forward.
        let is_front = volume > 0.0;
        let sign = if is_front { 1.0 } else { -1.0 };
        let edges = normals.map(|[x, y, z]| [sign * x, sign * -y, sign * (z * focal)]);
        Some(Self { edges, scale, is_front })
    }

    /// Shares of the corners, and their sum.
    pub(super) fn at(&self, x: f64, y: f64) -> ([f64; 3], f64) {
        let shares = self.edges.map(|[a, b, c]| a * x + b * y + c);
        (shares, shares[0] + shares[1] + shares[2])
    }

    /// How the shares change from pixel to pixel along x (0) or y (1).
    pub(super) fn slopes(&self, axis: usize) -> [f64; 3] {
        self.edges.map(|edge| edge[axis])
    }

    /// Whether a pixel about (x, y) lies beyond one of the edges.
    fn misses(&self, x: f64, y: f64) -> bool {
        self.edges.iter().any(|[a, b, c]| a * x + b * y + c < -0.5 * (a.abs() + b.abs()))
    }
}

/// Sample positions in a pixel, from its centre: `side` squared of them, one in each cell of a square grid and in each of
/// as many columns and rows, so that an upright edge has as many steps as there are samples.
///
/// K. Chiu, P. Shirley, C. Wang, "Multi-jittered sampling", Graphics Gems IV, 1994; here without the jitter.
pub(super) fn pattern(side: usize) -> Vec<[f64; 2]> {
    let at = |cell: usize, other: usize| (cell as f64 + (other as f64 + 0.5) / side as f64) / side as f64 - 0.5;
    (0..side * side).map(|i| (i % side, i / side)).map(|(i, j)| [at(i, j), at(j, i)]).collect()
}

/// What is seen at the samples of a tile.
pub(super) struct Tile<'a> {
    screen: Screen,
    pattern: &'a [[f64; 2]],
    /// First and end pixel: x0, y0, x1, y1.
    window: [usize; 4],
    /// 1 / depth of the nearest triangle per sample, pixel by pixel.
    inverse_depth: Vec<f64>,
    nearest: Vec<u32>,
}

impl<'a> Tile<'a> {
    pub(super) fn new(screen: Screen, pattern: &'a [[f64; 2]]) -> Self {
        let samples = TILE * TILE * pattern.len();
        Self { screen, pattern, window: [0; 4], inverse_depth: vec![0.0; samples], nearest: vec![NONE; samples] }
    }

    /// Empties it and moves it to a column and row of tiles.
    pub(super) fn begin(&mut self, column: usize, row: usize) {
        let [x0, y0] = [column * TILE, row * TILE];
        self.window = [x0, y0, (x0 + TILE).min(self.screen.size[0]), (y0 + TILE).min(self.screen.size[1])];
        self.inverse_depth.fill(0.0);
        self.nearest.fill(NONE);
    }

    fn samples_of(&self, x: usize, y: usize) -> std::ops::Range<usize> {
        let pixel = (y - self.window[1]) * TILE + x - self.window[0];
        pixel * self.pattern.len()..(pixel + 1) * self.pattern.len()
    }

    /// The triangle seen at each sample of a pixel.
    pub(super) fn seen(&self, x: usize, y: usize) -> &[u32] {
        &self.nearest[self.samples_of(x, y)]
    }

    /// The middle of a pixel, px from the picture's middle.
    pub(super) fn middle(&self, x: usize, y: usize) -> [f64; 2] {
        self.screen.about_middle([x as f64 + 0.5, y as f64 + 0.5])
    }

    /// Draws a triangle; of two at one depth the first drawn stays.
    pub(super) fn draw(&mut self, number: u32, corners: [[f64; 3]; 3], edges: &Edges) {
        let Some([x0, y0, x1, y1]) = self.screen.bounds(corners) else { return };
        let nearest_allowed = 1.0 / self.screen.near;
        for y in y0.max(self.window[1])..y1.min(self.window[3]) {
            for x in x0.max(self.window[0])..x1.min(self.window[2]) {
                let [mid_x, mid_y] = self.middle(x, y);
                if edges.misses(mid_x, mid_y) {
                    continue;
                }
                let samples = self.samples_of(x, y);
                let found = self.inverse_depth[samples.clone()].iter_mut().zip(&mut self.nearest[samples]);
                for ([dx, dy], (depth, nearest)) in self.pattern.iter().zip(found) {
                    let (shares, sum) = edges.at(mid_x + dx, mid_y + dy);
                    let inverse = sum * edges.scale;
                    let is_inside = shares.iter().all(|share| *share >= 0.0) && inverse <= nearest_allowed;
                    if is_inside && inverse > *depth {
                        (*depth, *nearest) = (inverse, number);
                    }
                }
            }
        }
    }
}

/// The triangles that each tile may see, in their own order.
pub(super) struct Bins {
    /// Where each tile's list starts, and the end of the last.
    starts: Vec<usize>,
    triangles: Vec<u32>,
}

impl Bins {
    /// `corners(triangle)`: as seen by the camera; none for one that is not to be drawn.
    pub(super) fn new(
        screen: &Screen,
        triangle_count: usize,
        corners: impl Fn(usize) -> Option<[[f64; 3]; 3]> + Sync,
        watch: Watch,
    ) -> Result<Self, Interrupted> {
        let [columns, rows] = screen.tiles();
        watch.reserve(triangle_count * size_of::<[u16; 4]>() + (columns * rows + 1) * size_of::<usize>())?;
        let mut windows = vec![[0_u16; 4]; triangle_count];
        windows.par_chunks_mut(PORTION).enumerate().try_for_each(|(portion, windows)| {
            for (triangle, window) in (portion * PORTION..).zip(windows) {
                if let Some([x0, y0, x1, y1]) = corners(triangle).and_then(|corners| screen.bounds(corners)) {
                    *window = [x0 / TILE, y0 / TILE, x1.div_ceil(TILE), y1.div_ceil(TILE)].map(|at| at as u16);
                }
            }
            watch.go_on()
        })?;
        let tiles = |[x0, y0, x1, y1]: [u16; 4]| {
            (y0..y1).flat_map(move |y| (x0..x1).map(move |x| usize::from(y) * columns + usize::from(x)))
        };
        let mut starts = vec![0; columns * rows + 1];
        for windows in windows.chunks(PORTION) {
            watch.go_on()?;
            windows.iter().flat_map(|window| tiles(*window)).for_each(|tile| starts[tile + 1] += 1);
        }
        for tile in 0..columns * rows {
            starts[tile + 1] += starts[tile];
        }
        watch.reserve(starts[columns * rows] * size_of::<u32>())?;
        let mut triangles = vec![0; starts[columns * rows]];
        for (portion, windows) in windows.chunks(PORTION).enumerate() {
            watch.go_on()?;
            for (triangle, window) in (portion * PORTION..).zip(windows) {
                tiles(*window).for_each(|tile| {
                    triangles[starts[tile]] = triangle as u32;
                    starts[tile] += 1;
                });
            }
        }
        // Each start has moved to the next one's place.
        starts.rotate_right(1);
        starts[0] = 0;
        Ok(Self { starts, triangles })
    }

    pub(super) fn of(&self, tile: usize) -> &[u32] {
        &self.triangles[self.starts[tile]..self.starts[tile + 1]]
    }
}

/// Triangles between two questions whether to go on.
pub(super) const PORTION: usize = 1024;
