//! Random feature-aware warps, the same on every run, and what must be true of each once it is guarded.

use super::algo::UNWATCHED;
use super::algo::feature::Error;
use super::algo::feature::guard::{Fit, Freedom, Functional, Guarded, How, guard};
use super::algo::lattice::{Lattice, Positions};
use super::algo::poisson::Edges;
use super::algo::warp::{certify, swirl};

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
}

/// A warp, labelled cells and their weights.
pub struct Case {
    pub lattice: Lattice,
    pub base: Positions,
    pub rigid: bool,
    pub freedom: Vec<Freedom>,
    pub conductances: Edges,
    /// Of every quad: the label it follows (0: none), and its squared weight.
    quads: Vec<(usize, f64)>,
    labels: Vec<usize>,
}

impl Case {
    /// Discs of cells at `(column, row, radius)`, each a feature of weight 10 with a transition of 2 cells.
    pub fn new(lattice: Lattice, base: Positions, discs: &[[f64; 3]], rigid: bool) -> Self {
        let [columns, rows] = lattice.cells();
        let within = |cell: usize, [x, y, radius]: [f64; 3]| {
            ((cell % columns) as f64 - x).hypot((cell / columns) as f64 - y) <= radius
        };
        let label = |cell: usize| discs.iter().position(|&disc| within(cell, disc)).map_or(0, |index| index + 1);
        let labels: Vec<usize> = (0..columns * rows).map(label).collect();
        let quads: Vec<(usize, f64)> = (0..columns * rows).map(|cell| follow(&labels, columns, cell)).collect();
        let mut conductances = Edges::zeros(lattice.nodes);
        for (cell, &(_, stiffness)) in quads.iter().enumerate() {
            let (across, down) = edges(cell, lattice.nodes[0]);
            across.iter().for_each(|&(e, ..)| conductances.horizontal[e] += stiffness);
            down.iter().for_each(|&(e, ..)| conductances.vertical[e] += stiffness);
        }
        let [width, height] = lattice.nodes;
        let inside = |node: usize| {
            let (column, row) = (node % width, node / width);
            column > 0 && row > 0 && column + 1 < width && row + 1 < height
        };
        let freedom =
            (0..width * height).map(|node| if inside(node) { Freedom::Free } else { Freedom::Pinned }).collect();
        Self { lattice, base, rigid, freedom, conductances, quads, labels }
    }

    /// Lattices of 24 to 64 nodes a side, one to four discs, and a warp without folds of one of four kinds.
    pub fn random(seed: u64) -> Self {
        let mut noise = Noise::new(seed);
        let mut side = || 24 + (noise.next() * 41.0) as usize;
        let nodes = [side(), side()];
        let spacing = [noise.within(0.5, 8.0), noise.within(0.5, 8.0)];
        let spacing = if noise.next() < 0.6 { [spacing[0]; 2] } else { spacing };
        let lattice = Lattice { origin: [noise.within(-50.0, 50.0), noise.within(-50.0, 50.0)], spacing, nodes };
        let count = 1 + (noise.next() * 4.0) as usize;
        let discs: Vec<[f64; 3]> = (0..count)
            .map(|_| {
                let size = nodes[0].min(nodes[1]) as f64;
                let [x, y] = [0, 1].map(|axis| noise.within(-1.0, nodes[axis] as f64));
                [x, y, noise.within(0.05, 0.28) * size]
            })
            .collect();
        let rigid = noise.next() < 0.5;
        let base = warp(&lattice, &mut noise);
        Self::new(lattice, base, &discs, rigid)
    }

    /// What the quads ask of each edge beyond what the warp does, scales multiplied by `factor`.
    pub fn fluxes(&self, factor: f64) -> [Edges; 2] {
        let columns = self.lattice.nodes[0];
        let count = self.labels.iter().max().map_or(0, |most| most + 1);
        let (mut scales, mut sizes) = (vec![0.0; count], vec![0.0; count]);
        for (cell, &label) in self.labels.iter().enumerate() {
            let [[_, _], [a, b]] = self.linear(cell);
            scales[label] += (a - b).max(0.0);
            sizes[label] += 1.0;
        }
        let mut fluxes = [Edges::zeros(self.lattice.nodes), Edges::zeros(self.lattice.nodes)];
        for (cell, &(label, stiffness)) in self.quads.iter().enumerate().filter(|(_, quad)| quad.0 != 0) {
            let [[cos, sin], _] = self.linear(cell);
            let scale = factor * if self.rigid { 1.0 } else { (scales[label] / sizes[label]).max(1e-3) };
            let [hx, hy] = self.lattice.spacing;
            let images = [[scale * cos * hx, scale * sin * hx], [-scale * sin * hy, scale * cos * hy]];
            let (across, down) = edges(cell, columns);
            for axis in 0..2 {
                let values = if axis == 0 { &self.base.x } else { &self.base.y };
                for (e, from, to) in across {
                    fluxes[axis].horizontal[e] += stiffness * (images[0][axis] - (values[to] - values[from]));
                }
                for (e, from, to) in down {
                    fluxes[axis].vertical[e] += stiffness * (images[1][axis] - (values[to] - values[from]));
                }
            }
        }
        fluxes
    }

    /// Rotation (cosine and sine) of the warp on a quad, and the moduli of its conformal part and of the rest.
    fn linear(&self, cell: usize) -> [[f64; 2]; 2] {
        let (across, down) = edges(cell, self.lattice.nodes[0]);
        let mean = |edges: [(usize, usize, usize); 2], spacing: f64| {
            [&self.base.x, &self.base.y]
                .map(|v| edges.iter().map(|&(_, p, q)| v[q] - v[p]).sum::<f64>() / 2.0 / spacing)
        };
        let (x, y) = (mean(across, self.lattice.spacing[0]), mean(down, self.lattice.spacing[1]));
        let a = [(x[0] + y[1]) / 2.0, (x[1] - y[0]) / 2.0];
        let size = a[0].hypot(a[1]);
        let rotation = if size > 0.0 { a.map(|part| part / size) } else { [1.0, 0.0] };
        [rotation, [size, ((x[0] - y[1]) / 2.0).hypot((x[1] + y[0]) / 2.0)]]
    }

    pub fn functional<'a>(&'a self, fluxes: &'a [Edges; 2]) -> Functional<'a> {
        Functional {
            lattice: &self.lattice,
            conductances: &self.conductances,
            fluxes,
            base: &self.base,
            freedom: &self.freedom,
        }
    }

    /// The literal solution with scales multiplied by `factor`.
    pub fn literal(&self, factor: f64) -> Result<Positions, Error> {
        self.functional(&self.fluxes(factor)).minimiser(UNWATCHED)
    }

    pub fn guarded(&self, fit: Fit) -> Guarded {
        let fluxes = self.fluxes(1.0);
        let functional = self.functional(&fluxes);
        let literal = self.literal(1.0).expect("solved");
        guard(&functional, &literal, fit, true, &|factor| self.literal(factor), UNWATCHED).expect("nobody stops it")
    }

    /// What is wrong with a result for a base without folds.
    pub fn violations(&self, found: &Guarded) -> Vec<String> {
        let least = |x: &Positions| certify(&self.lattice, x, UNWATCHED).expect("nobody stops it").min_jacobian;
        let fluxes = self.fluxes(1.0);
        let functional = self.functional(&fluxes);
        let literal = self.literal(1.0).expect("solved");
        let floor = 0.01 * least(&self.base).min(1.0);
        let rounded = |values: &[f64]| values.iter().map(|&value| f64::from(value as f32)).collect();
        let single = Positions { x: rounded(&found.positions.x), y: rounded(&found.positions.y) };
        let mut wrong = Vec::new();
        let mut check = |good: bool, what: &str, value: f64| {
            if !good {
                wrong.push(format!("{what}: {value}"))
            }
        };
        check(found.verdict.floor == floor, "floor", found.verdict.floor);
        check(found.verdict.reached && found.verdict.folds == 0, "reached", found.verdict.min_jacobian);
        check(least(&found.positions) >= floor, "least Jacobian", least(&found.positions));
        check(least(&single) >= floor, "in single precision", least(&single));
        let pinned = |node: usize| self.freedom[node] == Freedom::Pinned;
        let same =
            |node: usize| found.positions.x[node] == self.base.x[node] && found.positions.y[node] == self.base.y[node];
        check((0..self.freedom.len()).all(|node| !pinned(node) || same(node)), "pins", 0.0);
        if found.verdict.how == How::Literal {
            check(found.positions == literal, "untouched", 0.0);
        }
        if matches!(found.verdict.how, How::Bent { .. }) {
            let at = |t: f64| {
                let mix = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + t * (b - a)).collect();
                Positions { x: mix(&self.base.x, &literal.x), y: mix(&self.base.y, &literal.y) }
            };
            let best = (0..=100).rev().map(|step| at(f64::from(step) / 100.0)).find(|x| least(x) >= floor);
            let (best, energy) = (functional.energy(&best.expect("the base")), functional.energy(&found.positions));
            check(energy <= best + 1e-9 * best.abs(), "functional above the segment's", energy - best);
        }
        wrong
    }
}

type Edge = (usize, usize, usize);

/// The horizontal and the vertical edges of a cell: index, from, to.
fn edges(cell: usize, columns: usize) -> ([Edge; 2], [Edge; 2]) {
    let node = cell + cell / (columns - 1);
    let below = node + columns;
    (
        [(cell, node, node + 1), (cell + columns - 1, below, below + 1)],
        [(node, node, below), (node + 1, node + 1, below + 1)],
    )
}

/// The label that a cell follows and its squared weight: 10 on features, falling to 1 over two cells.
fn follow(labels: &[usize], columns: usize, cell: usize) -> (usize, f64) {
    let (column, row, rows) = (cell % columns, cell / columns, labels.len() / columns);
    let gap = |a: usize, b: usize| (a.abs_diff(b) as f64 - 0.5).max(0.0);
    let mut nearest = (2.0, 0);
    for r in row.saturating_sub(2)..(row + 3).min(rows) {
        for c in column.saturating_sub(2)..(column + 3).min(columns) {
            let distance = gap(c, column).hypot(gap(r, row));
            if labels[r * columns + c] != 0 && distance < nearest.0 {
                nearest = (distance, labels[r * columns + c]);
            }
        }
    }
    let t = nearest.0 / 2.0;
    let weight = 1.0 + 9.0 * ((2.0 * t - 3.0) * t * t + 1.0);
    (nearest.1, weight * weight)
}

/// A warp without folds: waves, a stretch, a swirl or an arc, as strong as a random number says but where it folds.
fn warp(lattice: &Lattice, noise: &mut Noise) -> Positions {
    let kind = (noise.next() * 4.0) as usize;
    let strength = noise.next();
    let numbers: Vec<f64> = (0..12).map(|_| noise.within(-1.0, 1.0)).collect();
    let mut part = 1.0;
    loop {
        let base = shape(lattice, kind, part * strength, &numbers);
        if certify(lattice, &base, UNWATCHED).expect("nobody stops it").min_jacobian > 0.01 {
            return base;
        }
        part *= 0.8;
    }
}

fn shape(lattice: &Lattice, kind: usize, strength: f64, numbers: &[f64]) -> Positions {
    let ([width, height], center) = (lattice.size(), lattice.center());
    let size = width.min(height);
    Positions::from_map(lattice, |[x, y]| {
        let [u, v] = [(x - center[0]) / width, (y - center[1]) / height];
        match kind {
            0 => {
                let wave =
                    |n: &[f64]| (6.0 * (n[0] * u + n[1] * v + n[2])).sin() + 0.5 * (15.0 * (n[1] * u - n[0] * v)).sin();
                [x + 0.3 * strength * size * wave(&numbers[..3]), y + 0.3 * strength * size * wave(&numbers[3..6])]
            }
            1 => {
                let scale = |n: f64| 1.0 + strength * if n < 0.0 { 0.7 * n.signum() } else { n };
                [center[0] + scale(numbers[0]) * (x - center[0]), center[1] + scale(numbers[1]) * (y - center[1])]
            }
            2 => {
                let middle = [center[0] + 0.1 * numbers[0] * width, center[1] + 0.1 * numbers[1] * height];
                swirled([x, y], strength * 3.0 * numbers[2].signum(), 0.5 * size, middle)
            }
            _ => {
                let angle = 0.1 + 2.8 * strength;
                let radius = width / angle;
                let (sin, cos) = (angle * u).sin_cos();
                [center[0] + (radius + center[1] - y) * sin, center[1] + radius - (radius + center[1] - y) * cos]
            }
        }
    })
}

/// One point of a swirl by `angle` radians.
fn swirled([x, y]: [f64; 2], angle: f64, radius: f64, middle: [f64; 2]) -> [f64; 2] {
    let point = Lattice { origin: [x, y], spacing: [1.0, 1.0], nodes: [2, 2] };
    let moved = swirl(&point, angle.to_degrees(), radius, middle, UNWATCHED).expect("nobody stops it");
    [moved.x[0], moved.y[0]]
}
