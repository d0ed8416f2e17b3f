//! Random magnifications, the same on every run, and what must be true of each.

use super::algo::UNWATCHED;
use super::algo::lattice::{Lattice, Positions};
use super::algo::magnify::{Frame, Magnified, Method, Normalise, Wish, magnify};

/// Numbers in 0..1, the same on every run.
pub struct Noise(u64);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d)
    }

    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1u64 << 31) as f64
    }

    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    pub fn below(&mut self, count: usize) -> usize {
        (self.next() * count as f64) as usize
    }
}

/// What a field looks like.
#[derive(Clone, Copy, Debug)]
pub enum Look {
    /// Smooth bumps and hollows.
    Blobs,
    /// The exponential of smooth noise.
    LogNormal,
    /// Hard discs, up to a hundred times as strong as the rest.
    Discs,
    /// A number of its own in every cell.
    White,
    /// One cell in two.
    Checkerboard,
    /// One cell alone, a hundred times as strong as the rest.
    Cell,
}

const LOOKS: [Look; 6] = [Look::Blobs, Look::LogNormal, Look::Discs, Look::White, Look::Checkerboard, Look::Cell];

/// A lattice over whole pixels, and what its cells are asked for.
#[derive(Debug)]
pub struct Case {
    pub lattice: Lattice,
    pub look: Look,
    pub frame: Frame,
    pub normalise: Normalise,
    /// Areas less 1.
    pub strength: Vec<f64>,
}

impl Case {
    pub fn random(seed: u64) -> Self {
        let mut noise = Noise::new(seed);
        let size = [0, 1].map(|_| 8 + noise.below(90));
        let cells = size.map(|size| (size / (1 + noise.below(6))).max(1));
        let lattice = Lattice {
            origin: [noise.below(100) as f64 - 50.0, noise.below(100) as f64 - 50.0],
            spacing: [size[0] as f64 / cells[0] as f64, size[1] as f64 / cells[1] as f64],
            nodes: cells.map(|count| count + 1),
        };
        // Discs every other time.
        let look = if noise.next() < 0.4 { Look::Discs } else { LOOKS[noise.below(LOOKS.len())] };
        let frame = [Frame::Slide, Frame::Slide, Frame::Periodic, Frame::Pin][noise.below(4)];
        let normalise = [Normalise::Multiply, Normalise::Background, Normalise::Subtract][noise.below(3)];
        let areas = areas(&mut noise, look, cells);
        Self { lattice, look, frame, normalise, strength: areas.into_iter().map(|area| area - 1.0).collect() }
    }

    pub fn solved(&self) -> Magnified {
        let Self { lattice, frame, normalise, ref strength, .. } = *self;
        let wish = Wish { strength, method: Method::Transport, normalise, frame };
        magnify(&lattice, &wish, UNWATCHED).expect("nobody stops it")
    }

    /// What is wrong with a solution.
    pub fn violations(&self, found: &Magnified) -> Vec<String> {
        let mut wrong = Vec::new();
        let certificate = &found.certificate;
        if certificate.folds > 0 || certificate.min_jacobian <= 0.0 {
            wrong.push(format!("{certificate:?}"));
        }
        if (found.total_area - 1.0).abs() > 1e-12 {
            wrong.push(format!("the total area is off by {:e}", found.total_area - 1.0));
        }
        let owners = owners(&self.lattice, &found.positions);
        let (none, several) = (owners.iter().filter(|&&c| c == 0).count(), owners.iter().filter(|&&c| c > 1).count());
        if none + several > 0 {
            wrong.push(format!("{none} pixels have no owner, {several} have several"));
        }
        wrong
    }
}

/// Areas asked of cells.
fn areas(noise: &mut Noise, look: Look, cells: [usize; 2]) -> Vec<f64> {
    let [columns, rows] = cells;
    let each = |area: &mut dyn FnMut(f64, f64) -> f64| {
        let at = |cell: usize| [(cell % columns) as f64 + 0.5, (cell / columns) as f64 + 0.5];
        let places = (0..columns * rows).map(at);
        places.map(|[x, y]| area(x / columns as f64, y / rows as f64)).collect::<Vec<f64>>()
    };
    let shapes: Vec<[f64; 4]> = (0..1 + noise.below(6)).map(|_| [0; 4].map(|_| noise.next())).collect();
    let contrast = noise.within(-3.0, 100f64.ln()).exp();
    match look {
        Look::Blobs => each(&mut |x, y| {
            let blob = |&[u, v, r, s]: &[f64; 4]| {
                let part = (x - u).hypot(y - v) / (0.08 + 0.2 * r);
                (1.8 * s - 0.7) * (-part * part).exp()
            };
            (1.0 + shapes.iter().map(blob).sum::<f64>()).max(0.1)
        }),
        Look::LogNormal => each(&mut |x, y| {
            let wave = |&[u, v, r, s]: &[f64; 4]| (10.0 * (x * (u - 0.5) + y * (v - 0.5)) + 6.3 * r).sin() * s;
            (2.5 * shapes.iter().map(wave).sum::<f64>()).exp()
        }),
        Look::Discs => each(&mut |x, y| {
            let is_inside = |&[u, v, r, _]: &[f64; 4]| (x - u).hypot(y - v) < 0.05 + 0.25 * r;
            if shapes.iter().any(is_inside) { contrast } else { 1.0 }
        }),
        Look::White => each(&mut |_, _| noise.within(0.05, 3.0)),
        Look::Checkerboard => {
            let cell = |cell: usize| if (cell % columns + cell / columns).is_multiple_of(2) { contrast } else { 1.0 };
            (0..columns * rows).map(cell).collect()
        }
        Look::Cell => {
            let one = noise.below(columns * rows);
            (0..columns * rows).map(|cell| if cell == one { 100.0 } else { 1.0 }).collect()
        }
    }
}

/// How many cells own each pixel of a lattice's rectangle; pixels beyond it are those a period nearer.
pub fn owners(lattice: &Lattice, positions: &Positions) -> Vec<u32> {
    let ([columns, rows], [nodes, _]) = (lattice.cells(), lattice.nodes);
    let [width, height] = lattice.size().map(|size| size.round() as i64);
    let mut owners = vec![0; (width * height) as usize];
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let node = row * nodes + column;
        let quad = [node, node + 1, node + nodes + 1, node + nodes].map(|at| [positions.x[at], positions.y[at]]);
        let reach = |axis: usize| {
            let (low, high) = quad.iter().fold((f64::MAX, f64::MIN), |(l, h), at| (l.min(at[axis]), h.max(at[axis])));
            (low - 1.0).floor() as i64..(high + 1.0).ceil() as i64
        };
        for (y, x) in reach(1).flat_map(|y| reach(0).map(move |x| (y, x))) {
            if owns(&quad, [x as f64 + 0.5, y as f64 + 0.5]) {
                let [x, y] = [x - lattice.origin[0] as i64, y - lattice.origin[1] as i64];
                owners[(y.rem_euclid(height) * width + x.rem_euclid(width)) as usize] += 1;
            }
        }
    }
    owners
}

/// Whether a convex quad, clockwise on screen, owns a point: each edge is tested from its upper end, the left one of two
/// on a level, so that both its cells see the same; a point on an edge counts as a little to the right and down.
fn owns(quad: &[[f64; 2]; 4], [x, y]: [f64; 2]) -> bool {
    (0..4).all(|side| {
        let (from, to) = (quad[side], quad[(side + 1) % 4]);
        let is_canonical = [from[1], from[0]] < [to[1], to[0]];
        let (first, last) = if is_canonical { (from, to) } else { (to, from) };
        let (dx, dy) = (last[0] - first[0], last[1] - first[1]);
        let cross = dx * (y - first[1]) - dy * (x - first[0]);
        (cross > 0.0 || (cross == 0.0 && dy == 0.0)) == is_canonical
    })
}
