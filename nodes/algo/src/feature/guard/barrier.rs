//! The barrier that keeps corners from folding: next to nothing until they nearly do.

use super::shape::{Corner, Field, Quadratic, Shape, edges};
use super::system::Blocks;
use crate::lattice::Positions;

/// `strength b(r)` of every movable corner, with r = (J - level) / (reach - level), `b(r) = -(r - 1)^2 ln r` for r < 1
/// and 0 beyond.
pub(super) struct Barrier<'a> {
    pub(super) shape: &'a Shape,
    /// px^2.
    pub(super) strength: f64,
    /// No corner may come down to this Jacobian.
    pub(super) level: f64,
    /// Jacobian of each corner below which it feels the barrier, above the level.
    pub(super) reach: Vec<f64>,
}

/// The energy along a step: a polynomial of second degree, and the corners that feel the barrier on the way.
pub(super) struct Line {
    slope: f64,
    square: f64,
    strength: f64,
    level: f64,
    /// Corners and the widths of their barriers.
    corners: Vec<(Quadratic, f64)>,
    /// How far it may go.
    pub(super) end: f64,
}

impl Barrier<'_> {
    /// Adds the barrier's gradient and its second derivatives, with negative eigenvalues left out.
    pub(super) fn add(&self, x: &Positions, gradient: &mut Field, blocks: &mut Blocks) {
        for (number, corner) in self.shape.movable() {
            let width = self.reach[number] - self.level;
            let r = (self.shape.jacobian(x, corner) - self.level) / width;
            if r >= 1.0 {
                continue;
            }
            // Derivatives in the cross product of the edges, px^2.
            let per_cross = 1.0 / (width * self.shape.area);
            let (first, second) =
                (self.strength * slope(r) * per_cross, self.strength * curvature(r) * per_cross * per_cross);
            let (a, b) = edges(&x.x, &x.y, corner);
            add_gradient(gradient, corner, [first * b[1], -first * b[0], -first * a[1], first * a[0]]);
            blocks.add_corner(corner, &clamped(a, b, first, second));
        }
    }

    /// The energy along `step`, of slope `slope` and second order `square` without the barrier.
    ///
    /// It ends where the first corner would lose nine tenths of its way down to the level, a tenth of that before.
    pub(super) fn line(&self, x: &Positions, step: &Field, slope: f64, square: f64) -> Line {
        let stop = |(_, corner): (usize, Corner)| {
            let jacobian = self.shape.along(x, step, corner);
            jacobian.falls_to(self.level + 0.1 * (jacobian.at_0 - self.level))
        };
        let end = self.shape.movable().filter_map(stop).fold(f64::INFINITY, f64::min);
        let end = (0.9 * end).min(LONGEST);
        let near = |(number, corner): (usize, Corner)| {
            let jacobian = self.shape.along(x, step, corner);
            (jacobian.least(end) < self.reach[number]).then(|| (jacobian, self.reach[number] - self.level))
        };
        let corners = self.shape.movable().filter_map(near).collect();
        Line { slope, square, strength: self.strength, level: self.level, corners, end }
    }
}

/// Steps are at most so many times Newton's own.
const LONGEST: f64 = 4.0;

impl Line {
    /// The change of the energy.
    fn value(&self, t: f64) -> f64 {
        let barrier: f64 = self.corners.iter().map(|(j, width)| value((j.at(t) - self.level) / width)).sum();
        t * (self.slope + t * self.square) + self.strength * barrier
    }

    fn derivative(&self, t: f64) -> f64 {
        let of_corner = |(j, width): &(Quadratic, f64)| slope((j.at(t) - self.level) / width) * j.slope_at(t) / width;
        let barrier: f64 = self.corners.iter().map(of_corner).sum();
        self.slope + 2.0 * t * self.square + self.strength * barrier
    }

    /// Where the energy along the line is least, or nearly, and how far it falls: by bisection of its slope, then
    /// Armijo's rule.
    ///
    /// None where no step lowers the energy.
    pub(super) fn least(&self) -> Option<[f64; 2]> {
        let (start, descent) = (self.value(0.0), self.derivative(0.0));
        if !(descent < 0.0 && self.end > 0.0) {
            return None;
        }
        let (mut low, mut high) = (0.0, self.end);
        if self.derivative(high) > 0.0 {
            while high - low > 0.01 * high {
                let middle = 0.5 * (low + high);
                if self.derivative(middle) > 0.0 { high = middle } else { low = middle }
            }
        }
        let mut t = high;
        for _ in 0..60 {
            let value = self.value(t);
            if value <= start + 1e-4 * t * descent {
                return Some([t, start - value]);
            }
            t *= 0.5;
        }
        None
    }
}

fn value(r: f64) -> f64 {
    if r < 1.0 { -(r - 1.0) * (r - 1.0) * libm::log(r) } else { 0.0 }
}

fn slope(r: f64) -> f64 {
    if r < 1.0 { -2.0 * (r - 1.0) * libm::log(r) - (r - 1.0) * (r - 1.0) / r } else { 0.0 }
}

fn curvature(r: f64) -> f64 {
    let q = (r - 1.0) / r;
    if r < 1.0 { -2.0 * libm::log(r) - 4.0 * q + q * q } else { 0.0 }
}

/// Adds a gradient in the edges (a, b) of a corner.
fn add_gradient(gradient: &mut Field, [node, next, previous]: Corner, g: [f64; 4]) {
    for (axis, gradient) in gradient.iter_mut().enumerate() {
        gradient[next] += g[axis];
        gradient[previous] += g[axis + 2];
        gradient[node] -= g[axis] + g[axis + 2];
    }
}

/// The second derivatives of a function of a x b in z = (a, b), of which the negative eigenvalues are left out.
///
/// a x b = z.Kz / 2 with K of the eigenvalues 1 and -1, twice each: the conformal part u of z and the other part v,
/// a x b = (|u|^2 - |v|^2) / 2. The derivatives are `second Kz (Kz)' + first K`, first <= 0 <= second: across u the
/// eigenvalue is `first`, left out; across v it is `-first`; what is left is a 2 x 2 matrix in the plane of u and v.
fn clamped([ax, ay]: [f64; 2], [bx, by]: [f64; 2], first: f64, second: f64) -> [[f64; 4]; 4] {
    let h = std::f64::consts::FRAC_1_SQRT_2;
    let (u, u_size) = unit([h * (ax + by), h * (ay - bx)]);
    let (v, v_size) = unit([h * (ax - by), h * (ay + bx)]);
    let e = [h * u[0], h * u[1], -h * u[1], h * u[0]];
    let f = [h * v[0], h * v[1], h * v[1], -h * v[0]];
    let across = [-h * v[1], h * v[0], h * v[0], h * v[1]];
    let [ee, ef, ff] =
        positive_part([second * u_size * u_size + first, -second * u_size * v_size, second * v_size * v_size - first]);
    let mut matrix = [[0.0; 4]; 4];
    for i in 0..4 {
        for j in 0..4 {
            matrix[i][j] =
                ee * e[i] * e[j] + ef * (e[i] * f[j] + f[i] * e[j]) + ff * f[i] * f[j] - first * across[i] * across[j];
        }
    }
    matrix
}

/// Direction and size of a vector; any direction of none.
fn unit([x, y]: [f64; 2]) -> ([f64; 2], f64) {
    let size = (x * x + y * y).sqrt();
    if size > 0.0 { ([x / size, y / size], size) } else { ([1.0, 0.0], 0.0) }
}

/// The symmetric matrix [[a, b], [b, c]] with its negative eigenvalues set to 0.
fn positive_part([a, b, c]: [f64; 3]) -> [f64; 3] {
    let (mean, half) = (0.5 * (a + c), 0.5 * (a - c));
    let radius = (half * half + b * b).sqrt();
    if mean >= radius {
        return [a, b, c];
    }
    let top = mean + radius;
    if top <= 0.0 || top.is_nan() || radius == 0.0 {
        return [0.0; 3];
    }
    // top times the projector on its eigenvector.
    let (cos, sin) = (half / radius, b / radius);
    [0.5 * top * (1.0 + cos), 0.5 * top * sin, 0.5 * top * (1.0 - cos)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_value() {
        for step in 1..40 {
            let (r, h) = (f64::from(step) / 37.0, 1e-5);
            assert!((slope(r) - (value(r + h) - value(r - h)) / (2.0 * h)).abs() < 1e-4 * (1.0 + 1.0 / (r * r)), "{r}");
            let second = (slope(r + h) - slope(r - h)) / (2.0 * h);
            assert!((curvature(r) - second).abs() < 1e-3 * (1.0 + 1.0 / (r * r)), "{r}: {} {second}", curvature(r));
        }
    }

    /// `x' M x >= max(0, x' H x)` for the derivatives H, and M = H where H has no negative eigenvalue to leave out.
    #[test]
    fn clamping_leaves_nothing_negative_and_takes_nothing_away() {
        let mut state = 1u32;
        let mut number = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 23) - 1.0
        };
        for _ in 0..300 {
            let [a, b] = [[number(), number()], [number(), number()]];
            let (first, second) = (-number().abs(), number().abs());
            let matrix = clamped(a, b, first, second);
            let k = |z: [f64; 4]| [z[3], -z[2], -z[1], z[0]];
            let dot = |a: [f64; 4], b: [f64; 4]| (0..4).map(|i| a[i] * b[i]).sum::<f64>();
            let g = k([a[0], a[1], b[0], b[1]]);
            for _ in 0..20 {
                let x = [number(), number(), number(), number()];
                let form = dot(x, [0, 1, 2, 3].map(|i| dot(matrix[i], x)));
                let full = second * dot(g, x) * dot(g, x) + first * dot(x, k(x));
                assert!(form >= full.max(0.0) - 1e-12, "{form} for {full}");
            }
            let flat = clamped(a, b, 0.0, second);
            assert!((0..4).all(|i| (0..4).all(|j| (flat[i][j] - second * g[i] * g[j]).abs() < 1e-12)));
        }
    }
}
