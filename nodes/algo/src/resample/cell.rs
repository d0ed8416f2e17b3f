//! One cell's map from the picture back to the cell.

use super::spans::{Point, turn};
use crate::simd::counted;
use pulp::Simd;

/// A cell's corners in the destination: those of (u, v) = (0, 0), (1, 0), (1, 1), (0, 1).
pub(super) type Corners = [Point; 4];

/// How a cell lies in the destination.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    /// Strictly convex, so that its bilinear map is one-to-one. `mirrored`: it runs against the clock.
    Convex { mirrored: bool },
    /// A corner's Jacobian is zero or differs in sign; `split`: the corner at which the diagonal starts that cuts
    /// the cell in two triangles. They lie the same way round if any diagonal can have that.
    Folded { split: usize },
}

impl Shape {
    /// Decided exactly.
    pub fn of(corners: &Corners) -> Self {
        let turns: [f64; 4] = std::array::from_fn(|i| turn(corners[(i + 3) % 4], corners[i], corners[(i + 1) % 4]));
        let alike = |a: f64, b: f64| (a > 0.0 && b > 0.0) || (a < 0.0 && b < 0.0);
        if alike(turns[0], turns[1]) && alike(turns[1], turns[2]) && alike(turns[2], turns[3]) {
            return Self::Convex { mirrored: turns[0] < 0.0 };
        }
        // The triangles beside the diagonal from corner 0 turn at corners 1 and 3.
        Self::Folded { split: if !alike(turns[1], turns[3]) && alike(turns[0], turns[2]) { 1 } else { 0 } }
    }
}

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

/// The inverse of a strictly convex cell's bilinear map `p(u, v) = p0 + u e + v f + u v g`.
///
/// With h = p - p0, eliminating u or v leaves a quadratic in the other; both have the discriminant J^2, where
/// J = e x f + u e x g + v g x f is the Jacobian at the solution. Written as
/// `u = 2 h x f / (e x f - h x g + J)` and `v = 2 e x h / (e x f + h x g + J)` the denominators are twice the
/// Jacobians at (0, v) and (u, 0), which do not vanish in a strictly convex cell, and g = 0 is no special case.
#[derive(Clone, Copy, Debug)]
pub(super) struct InverseBilinear {
    origin: Point,
    e: Point,
    f: Point,
    g: Point,
    ef: f64,
    four_gf: f64,
    sign: f64,
    /// Whether rounding may cost more than a few thousand units in the last place, see [`Self::EVEN`].
    uneven: bool,
}

impl InverseBilinear {
    /// Where the corners' Jacobians differ by no more than this factor the discriminant keeps all but its last
    /// digits, and no Newton step is needed.
    const EVEN: f64 = 16.0;

    pub fn new(&[p00, p10, p11, p01]: &Corners, mirrored: bool) -> Self {
        let (e, f) = (minus(p10, p00), minus(p01, p00));
        let g = minus(minus(p11, p01), e);
        let sign = if mirrored { -1.0 } else { 1.0 };
        let (ef, eg, gf) = (cross(e, f), cross(e, g), cross(g, f));
        let jacobians = [ef, ef + eg, ef + gf, ef + eg + gf].map(|jacobian| sign * jacobian);
        let least = jacobians.into_iter().fold(f64::INFINITY, f64::min);
        let uneven = jacobians.into_iter().any(|jacobian| jacobian > Self::EVEN * least);
        Self { origin: p00, e, f, g, ef, four_gf: 4.0 * gf, sign, uneven }
    }

    /// Whether the root of the quadratics alone may be inexact; [`Self::polished`] then is not.
    pub fn is_uneven(&self) -> bool {
        self.uneven
    }

    /// (u, v) of a point of a cell that is not uneven, within 0..=1.
    #[inline(always)]
    pub fn at(&self, p: Point) -> [f64; 2] {
        self.root(p).map(unit)
    }

    /// The root of the quadratics.
    #[inline(always)]
    fn root(&self, p: Point) -> [f64; 2] {
        let h = minus(p, self.origin);
        let (hf, eh, hg) = (cross(h, self.f), cross(self.e, h), cross(h, self.g));
        let b = self.ef + hg;
        let square = b * b + self.four_gf * eh;
        let jacobian = self.sign * if square > 0.0 { square.sqrt() } else { 0.0 };
        let (below_u, below_v) = (self.ef - hg + jacobian, b + jacobian);
        let scale = 2.0 / (below_u * below_v);
        [hf * below_v * scale, eh * below_u * scale]
    }

    /// (u, v) of a point of any cell, within 0..=1: one Newton step takes back what rounding cost.
    pub fn polished(&self, p: Point) -> [f64; 2] {
        let [u, v] = self.at(p);
        let Self { e, f, g, .. } = *self;
        let h = minus(p, self.origin);
        let (along_u, along_v) = ([e[0] + v * g[0], e[1] + v * g[1]], [f[0] + u * g[0], f[1] + u * g[1]]);
        let rest = [h[0] - u * along_u[0] - v * f[0], h[1] - u * along_u[1] - v * f[1]];
        let jacobian = cross(along_u, along_v);
        let [du, dv] = [cross(rest, along_v) / jacobian, cross(along_u, rest) / jacobian];
        // Where the Jacobian rounds to zero the step is not finite.
        if (du + dv).is_finite() { [unit(u + du), unit(v + dv)] } else { [u, v] }
    }
}

/// The inverse of the bilinear map of a cell that is nearly a parallelogram.
///
/// From the cell's middle m, with s = u - 1/2 and t = v - 1/2, the map is `p = m + s a + t b + s t g`. With [a b] taken
/// back, w of p - m and k of g, `s = w0 - q k0` and `t = w1 - q k1` where q = s t: the fixed point of
/// `q -> (w0 - q k0) (w1 - q k1)`, which comes nearer by |k0 t + k1 s|, about (|k0| + |k1|) / 2 at most, each time; it
/// starts 1/4 from it at most. A few such steps need neither roots nor divisions.
#[derive(Clone, Copy, Debug)]
pub(super) struct InverseNearlyAffine {
    middle: Point,
    /// The rows of the inverse of [a b].
    across: [Point; 2],
    bend: Point,
    /// Bits of q that a step gives, at least.
    bits: u64,
}

impl InverseNearlyAffine {
    /// Steps come nearer by 2 to this power at least.
    const LEAST_BITS: u64 = 3;
    /// q is known to 2 to minus this after the last step.
    const BITS: u64 = 55;

    /// Of a strictly convex cell; none if it bends more than steps of [`Self::LEAST_BITS`] serve.
    #[inline(always)]
    pub fn new(&[p00, p10, p11, p01]: &Corners) -> Option<Self> {
        let (top, bottom, left) = (minus(p10, p00), minus(p11, p01), minus(p01, p00));
        let g = minus(bottom, top);
        let [a, b] = [[top, bottom], [left, minus(p11, p10)]].map(|[p, q]| [0, 1].map(|i| 0.5 * (p[i] + q[i])));
        let per = 1.0 / cross(a, b);
        let across = [[b[1] * per, -b[0] * per], [-a[1] * per, a[0] * per]];
        let bend = across.map(|row| row[0] * g[0] + row[1] * g[1]);
        let nearer = 0.5 * (bend[0].abs() + bend[1].abs());
        // From the exponent: a bound that all machines agree on.
        let bits = 1022_u64.saturating_sub(nearer.to_bits() >> 52);
        let middle = [0, 1].map(|i| 0.25 * ((p00[i] + p10[i]) + (p01[i] + p11[i])));
        (bits >= Self::LEAST_BITS).then_some(Self { middle, across, bend, bits })
    }

    /// u and v, within 0..=1, of points of the cell at `y`, from `x` on, 1 apart.
    #[inline(always)]
    pub fn at<S: Simd>(&self, simd: S, x: f64, y: f64) -> [S::f64s; 2] {
        let dx = simd.sub_f64s(counted(simd, x), simd.splat_f64s(self.middle[0]));
        let dy = y - self.middle[1];
        let [w0, w1] = self.across.map(|[x, y]| simd.mul_add_f64s(simd.splat_f64s(x), dx, simd.splat_f64s(y * dy)));
        let [k0, k1] = self.bend.map(|bend| simd.splat_f64s(-bend));
        let mut q = simd.mul_f64s(w0, w1);
        let mut known = self.bits;
        while known < Self::BITS {
            q = simd.mul_f64s(simd.mul_add_f64s(k0, q, w0), simd.mul_add_f64s(k1, q, w1));
            known += self.bits;
        }
        let [zero, half, one] = [0.0, 0.5, 1.0].map(|at| simd.splat_f64s(at));
        // NaN becomes 0, on all processors.
        [simd.mul_add_f64s(k0, q, w0), simd.mul_add_f64s(k1, q, w1)].map(|at| {
            let at = simd.add_f64s(at, half);
            let at = simd.select_f64s(simd.less_than_f64s(zero, at), at, zero);
            simd.select_f64s(simd.less_than_f64s(at, one), at, one)
        })
    }
}

/// The inverse of the affine map of a triangle: `p(u, v) = p0 + u e + v f`.
#[derive(Clone, Copy, Debug)]
pub(super) struct InverseAffine {
    origin: Point,
    e: Point,
    f: Point,
    ef: f64,
}

impl InverseAffine {
    pub fn new([a, b, c]: [Point; 3]) -> Self {
        let (e, f) = (minus(b, a), minus(c, a));
        Self { origin: a, e, f, ef: cross(e, f) }
    }

    /// (u, v) of a point of the triangle, within 0..=1.
    pub fn at(&self, p: Point) -> [f64; 2] {
        let h = minus(p, self.origin);
        [unit(cross(h, self.f) / self.ef), unit(cross(self.e, h) / self.ef)]
    }
}

/// Clamped to 0..=1; NaN becomes 0.
#[inline(always)]
fn unit(t: f64) -> f64 {
    let t = if t > 0.0 { t } else { 0.0 };
    if t < 1.0 { t } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn map(&[p00, p10, p11, p01]: &Corners, [u, v]: Point) -> Point {
        [0, 1].map(|i| {
            let (top, bottom) = (p00[i] + u * (p10[i] - p00[i]), p01[i] + u * (p11[i] - p01[i]));
            top + v * (bottom - top)
        })
    }

    fn round_trip(corners: &Corners, uv: Point) -> Option<(Point, Point)> {
        let Shape::Convex { mirrored } = Shape::of(corners) else { return None };
        let p = map(corners, uv);
        let inverse = InverseBilinear::new(corners, mirrored);
        let found = if inverse.is_uneven() { inverse.polished(p) } else { inverse.at(p) };
        let back = map(corners, found);
        Some((minus(found, uv), minus(back, p)))
    }

    /// Of a nearly affine cell, the inverse of the points right of one on its row, by one lane and by all.
    #[derive(Clone, Copy)]
    struct Inverted<'a>(&'a InverseNearlyAffine, Point);

    impl pulp::WithSimd for Inverted<'_> {
        type Output = Vec<Point>;

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Vec<Point> {
            let [u, v] = self.0.at(simd, self.1[0], self.1[1]);
            let lanes = |lanes: &S::f64s| pulp::bytemuck::cast_slice::<_, f64>(std::slice::from_ref(lanes)).to_vec();
            lanes(&u).into_iter().zip(lanes(&v)).map(|(u, v)| [u, v]).collect()
        }
    }

    fn size([a, b]: Point) -> f64 {
        a.abs().max(b.abs())
    }

    proptest! {
        #[test]
        fn inverse_of_convex_cells(
            jitter in prop::array::uniform8(-0.45..0.45f64),
            u in 0.0..1.0f64,
            v in 0.0..1.0f64,
        ) {
            let [a, b, c, d, e, f, g, h] = jitter;
            let unit = [[a, b], [1.0 + c, d], [1.0 + e, 1.0 + f], [g, 1.0 + h]];
            let corners = unit.map(|[x, y]| [900.0 + 5.0 * x, 5.0 * y]);
            let flopped = corners.map(|[x, y]| [-x, y]);
            if let Some((error, _)) = round_trip(&corners, [u, v]) {
                let (mirrored, _) = round_trip(&flopped, [u, v]).expect("a flopped convex cell is convex");
                // Where the Jacobian nearly vanishes the place is ill-conditioned; only positions count there.
                let InverseBilinear { ef, e, f, g, .. } = InverseBilinear::new(&corners, false);
                let jacobian = ef + u * cross(e, g) + v * cross(g, f);
                if jacobian > 0.01 {
                    prop_assert!(size(error) < 1e-9 && size(mirrored) < 1e-9, "{error:?} {mirrored:?}");
                }
            }
        }

        #[test]
        fn inverse_of_nearly_affine_cells(
            jitter in prop::array::uniform8(-0.12..0.12f64),
            stretch in 1e-3..1e3f64,
            flop in any::<bool>(),
            u in 0.0..1.0f64,
            v in 0.0..1.0f64,
        ) {
            let [a, b, c, d, e, f, g, h] = jitter;
            let unit = [[a, b], [1.0 + c, d], [1.0 + e, 1.0 + f], [g, 1.0 + h]];
            let sign = if flop { -1.0 } else { 1.0 };
            let corners = unit.map(|[x, y]| [sign * (90.0 + 5.0 * x + 2.0 * y), stretch * y - 7.0]);
            let Shape::Convex { mirrored } = Shape::of(&corners) else { return Err(TestCaseError::reject("folded")) };
            if let Some(inverse) = InverseNearlyAffine::new(&corners) {
                let p = map(&corners, [u, v]);
                let plain = pulp::Arch::Scalar.dispatch(Inverted(&inverse, p));
                let expected = InverseBilinear::new(&corners, mirrored).polished(p);
                prop_assert!(size(minus(plain[0], expected)) < 1e-12, "{plain:?} {expected:?}");
                let wide = pulp::Arch::new().dispatch(Inverted(&inverse, p));
                prop_assert_eq!(wide[0].map(f64::to_bits), plain[0].map(f64::to_bits));
            }
        }

        #[test]
        fn inverse_of_parallelograms(
            e in prop::array::uniform2(-9.0..9.0f64),
            f in prop::array::uniform2(-9.0..9.0f64),
            u in 0.0..1.0f64,
            v in 0.0..1.0f64,
        ) {
            prop_assume!(cross(e, f).abs() > 0.1);
            let corners = UNIT.map(|[u, v]| [3.0 + u * e[0] + v * f[0], 4.0 + u * e[1] + v * f[1]]);
            let (error, _) = round_trip(&corners, [u, v]).expect("convex");
            prop_assert!(size(error) < 1e-9, "{error:?}");
        }

        #[test]
        fn inverse_of_nearly_degenerate_cells(
            exponent in 1.0..12.0f64,
            corner in 0..4usize,
            u in 0.0..1.0f64,
            v in 0.0..1.0f64,
        ) {
            // One corner nearly on the diagonal between its neighbours: its Jacobian nearly vanishes.
            let mut corners = UNIT;
            let (opposite, inset) = (corners[(corner + 2) % 4], 0.5 - libm::pow(10.0, -exponent));
            corners[corner] = [0, 1].map(|i| corners[corner][i] + inset * (opposite[i] - corners[corner][i]));
            let (error, miss) = round_trip(&corners, [u, v]).expect("convex");
            prop_assert!(size(miss) < 1e-12, "{miss:?}");
            let least_jacobian = 2.0 * libm::pow(10.0, -exponent);
            prop_assert!(size(error) < 1e-9 || least_jacobian < 1e-5, "{error:?}");
        }
    }

    const UNIT: Corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

    #[test]
    fn shapes() {
        assert_eq!(Shape::of(&UNIT), Shape::Convex { mirrored: false });
        assert_eq!(Shape::of(&UNIT.map(|[x, y]| [y, x])), Shape::Convex { mirrored: true });
        // An arrowhead is cut through its reflex corner, wherever that is.
        for reflex in 0..4 {
            let mut corners = UNIT;
            corners[reflex] = [0, 1].map(|i| 0.25 * UNIT[reflex][i] + 0.75 * UNIT[(reflex + 2) % 4][i]);
            assert_eq!(Shape::of(&corners), Shape::Folded { split: reflex % 2 });
        }
        // Three corners on one line; all on one point; crossed.
        assert_eq!(Shape::of(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0]]), Shape::Folded { split: 1 });
        assert_eq!(Shape::of(&[[1.0, 1.0]; 4]), Shape::Folded { split: 0 });
        assert_eq!(Shape::of(&[UNIT[0], UNIT[2], UNIT[1], UNIT[3]]), Shape::Folded { split: 0 });
    }
}
