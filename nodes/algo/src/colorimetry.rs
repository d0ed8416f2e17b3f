//! From stored colour to linear Rec.709: tone curves and primaries, in f64.

use crate::transfer;

/// A 3 by 3 matrix by rows; it multiplies columns.
pub type Matrix = [[f64; 3]; 3];

/// White of the profile connection space: D50 in the very numbers that ICC profiles store.
pub const D50: [f64; 3] = [63_190.0 / 65_536.0, 1.0, 54_061.0 / 65_536.0];

/// The farthest that a curve may be from a named one, in linear light, to be taken for it. Tables of 256 entries and
/// more in 16 bits are 1.2e-5 off, and gamma 2.2 is 8.5e-3 away from sRGB. The step between 8-bit codes at black is
/// 3e-4.
const CURVE_TOLERANCE: f64 = 5e-5;

/// The farthest that an element of a matrix may be from the identity's to be taken for it. Profiles of the same
/// primaries differ by 2e-4 in how they round white; the step between 8-bit codes at white is 9e-3.
const MATRIX_TOLERANCE: f64 = 5e-4;

/// How stored values become linear ones.
#[derive(Clone, Debug, PartialEq)]
pub enum Curve {
    /// As they are.
    Linear,
    /// By the sRGB transfer function.
    Srgb,
    /// `v^gamma`.
    Power(f64),
    /// `(a v + b)^gamma + e` from `d` on, `c v + f` below.
    Parametric {
        /// The exponent.
        gamma: f64,
        /// Slope, shift, slope below, where the power begins, shifts of both parts.
        abcdef: [f64; 6],
    },
    /// Linear values at equal distances from 0 to 1, and straight lines between them; at least two.
    Table(Vec<f64>),
}

impl Curve {
    /// The linear value of a stored one.
    ///
    /// `value`: any; 0..=1 is what curves are made for. Below 0 every curve is continued as an odd function; above 1 by
    /// its formula, a table by its last line. Powers of negative bases are 0. NaN stays NaN. O(1).
    /// ICC.1:2022, 10.6 and 10.18, for the parametric forms and the tables.
    pub fn linear(&self, value: f64) -> f64 {
        let v = value.abs();
        let linear = match self {
            Self::Linear => v,
            Self::Srgb => transfer::srgb_to_linear_f64(v),
            Self::Power(gamma) => libm::pow(v, *gamma),
            Self::Parametric { gamma, abcdef: [a, b, c, d, e, f] } => {
                let base = a * v + b;
                match v < *d {
                    true => c * v + f,
                    false if base < 0.0 => *e,
                    false => libm::pow(base, *gamma) + e,
                }
            }
            Self::Table(values) => between(values, v),
        };
        if value < 0.0 { -linear } else { linear }
    }

    /// The named curve that this one is but for rounding, or itself.
    ///
    /// `Linear` or `Srgb` if nowhere in 0..=1 the linear values are farther apart than 5e-5. Hundreds of powers.
    pub fn named(self) -> Self {
        let near = |named: &Self| {
            let mut values = (0..=510).map(|i| f64::from(i) / 510.0);
            values.all(|v| (self.linear(v) - named.linear(v)).abs() <= CURVE_TOLERANCE)
        };
        [Self::Linear, Self::Srgb].into_iter().find(near).unwrap_or(self)
    }
}

fn between(values: &[f64], v: f64) -> f64 {
    assert!(values.len() >= 2, "a table has two ends");
    let place = v * (values.len() - 1) as f64;
    // The cast saturates, and takes NaN to 0.
    let at = (place as usize).min(values.len() - 2);
    let (low, high) = (values[at], values[at + 1]);
    // A flat end stays flat, at infinity too.
    if low == high && !v.is_nan() { low } else { low + (place - at as f64) * (high - low) }
}

/// Where primaries and white lie: x and y of CIE 1931.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chromaticities {
    /// Red, green, blue.
    pub primaries: [[f64; 2]; 3],
    /// White.
    pub white: [f64; 2],
}

/// Those of Rec.709 and sRGB.
pub const REC_709: Chromaticities =
    Chromaticities { primaries: [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]], white: [0.3127, 0.3290] };

/// Linear Rec.709 from linear colour of other primaries; white goes to white by the Bradford adaptation.
///
/// `from`: finite chromaticities. None where they span no space: primaries on one line, white on an edge of their
/// triangle, y of white 0. SMPTE RP 177, 3.3, for the matrix of primaries; ICC.1:2022, annex E, for the adaptation.
pub fn rec709_from_chromaticities(from: &Chromaticities) -> Option<Matrix> {
    let adapted = product(&bradford(white_of(from)?, white_of(&REC_709)?)?, &xyz_from(from)?);
    Some(product(&inverse(&xyz_from(&REC_709)?)?, &adapted))
}

/// Linear Rec.709 from linear colour whose primaries are known in the profile connection space, at D50.
///
/// `colorants`: XYZ of red, green and blue as columns, white being of Y 1. None where they span no space. The way
/// back from D50 to D65 is the Bradford adaptation. ICC.1:2022, annex E and F.3.
pub fn rec709_from_pcs(colorants: &Matrix) -> Option<Matrix> {
    inverse(colorants)?;
    Some(product(&inverse(&pcs_from_rec709())?, colorants))
}

/// XYZ at D50 of the primaries of Rec.709, as columns: the inverse of [`rec709_from_pcs`].
pub fn pcs_from_rec709() -> Matrix {
    let adaptation = pcs_from_d65();
    product(&adaptation, &xyz_from(&REC_709).expect("Rec.709 spans a space"))
}

/// The Bradford adaptation from D65 to D50.
pub fn pcs_from_d65() -> Matrix {
    let white = white_of(&REC_709).expect("white has a Y");
    bradford(white, D50).expect("both whites are bright")
}

/// Whether a matrix is the identity but for rounding: no element farther from it than 5e-4.
pub fn is_identity(matrix: &Matrix) -> bool {
    let mut elements = (0..9).map(|i| (i / 3, i % 3));
    elements.all(|(r, c)| (matrix[r][c] - f64::from(r == c)).abs() <= MATRIX_TOLERANCE)
}

/// The product of a matrix and a matrix.
pub fn product(left: &Matrix, right: &Matrix) -> Matrix {
    let mut product = [[0.0; 3]; 3];
    for (r, row) in product.iter_mut().enumerate() {
        for (c, element) in row.iter_mut().enumerate() {
            *element = (0..3).map(|k| left[r][k] * right[k][c]).sum();
        }
    }
    product
}

/// XYZ from linear colour, white of Y 1.
fn xyz_from(from: &Chromaticities) -> Option<Matrix> {
    let column = |[x, y]: [f64; 2]| [x, y, 1.0 - x - y];
    let mut primaries = transposed(&from.primaries.map(column));
    let amounts = times(&inverse(&primaries)?, white_of(from)?);
    for row in &mut primaries {
        row.iter_mut().zip(amounts).for_each(|(element, amount)| *element *= amount);
    }
    inverse(&primaries).map(|_| primaries)
}

fn white_of(of: &Chromaticities) -> Option<[f64; 3]> {
    let [x, y] = of.white;
    (y > 0.0).then(|| [x / y, 1.0, (1.0 - x - y) / y])
}

/// What takes one white to another, each cone by itself.
fn bradford(from: [f64; 3], to: [f64; 3]) -> Option<Matrix> {
    const CONES: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
    let (from, to) = (times(&CONES, from), times(&CONES, to));
    let mut scaled = CONES;
    for (row, (from, to)) in scaled.iter_mut().zip(from.into_iter().zip(to)) {
        if from <= 0.0 || !from.is_finite() {
            return None;
        }
        row.iter_mut().for_each(|element| *element *= to / from);
    }
    Some(product(&inverse(&CONES)?, &scaled))
}

fn times(matrix: &Matrix, column: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * column[0] + row[1] * column[1] + row[2] * column[2])
}

fn transposed(matrix: &Matrix) -> Matrix {
    std::array::from_fn(|r| std::array::from_fn(|c| matrix[c][r]))
}

/// None where the determinant is 0 but for rounding.
fn inverse(m: &Matrix) -> Option<Matrix> {
    let minor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant = m[0][0] * minor(0, 0) + m[0][1] * minor(0, 1) + m[0][2] * minor(0, 2);
    let adjugate: Matrix = std::array::from_fn(|r| std::array::from_fn(|c| minor(c, r)));
    (determinant.abs() > 1e-6 && determinant.is_finite()).then(|| adjugate.map(|row| row.map(|v| v / determinant)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const P3: Chromaticities =
        Chromaticities { primaries: [[0.68, 0.32], [0.265, 0.69], [0.15, 0.06]], white: [0.3127, 0.3290] };
    const PRO_PHOTO: Chromaticities = Chromaticities {
        primaries: [[0.734699, 0.265301], [0.159597, 0.840403], [0.036598, 0.000105]],
        white: [0.345704, 0.358540],
    };

    fn apart(a: &Matrix, b: &Matrix) -> f64 {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn published_matrices() {
        let p3 = [[1.2249401, -0.2249404, 0.0], [-0.0420569, 1.0420571, 0.0], [-0.0196376, -0.0786361, 1.0982735]];
        assert!(apart(&rec709_from_chromaticities(&P3).expect("a space"), &p3) < 1e-6);
        // The colorants of the sRGB profile of 1998, which rounds its whites otherwise, and of younger ones.
        let srgb = [[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]];
        let young = [[0.43604, 0.38512, 0.14305], [0.22249, 0.71690, 0.06061], [0.01392, 0.09706, 0.71391]];
        assert!(apart(&pcs_from_rec709(), &srgb) < 3e-4 && apart(&pcs_from_rec709(), &young) < 4e-5);
        let back = rec709_from_pcs(&srgb).expect("a space");
        assert!(is_identity(&back), "{back:?}");
        assert!(!is_identity(&rec709_from_chromaticities(&P3).expect("a space")));
    }

    #[test]
    fn white_goes_to_white_and_the_same_to_itself() {
        for from in [P3, PRO_PHOTO, Chromaticities { white: [1.0 / 3.0; 2], ..REC_709 }] {
            let matrix = rec709_from_chromaticities(&from).expect("a space");
            assert!(times(&matrix, [1.0; 3]).iter().all(|v| (v - 1.0).abs() < 1e-12), "{matrix:?}");
        }
        let same = rec709_from_chromaticities(&REC_709).expect("a space");
        assert!(apart(&same, &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) < 1e-14);
        let round = rec709_from_pcs(&pcs_from_rec709()).expect("a space");
        assert!(apart(&round, &same) < 1e-14);
    }

    #[test]
    fn what_spans_no_space_has_no_matrix() {
        let line = Chromaticities { primaries: [[0.1, 0.1], [0.2, 0.2], [0.3, 0.3]], ..REC_709 };
        let dark = Chromaticities { white: [0.3, 0.0], ..REC_709 };
        let edge = Chromaticities { white: [0.47, 0.465], ..REC_709 };
        let nothing = Chromaticities { primaries: [[f64::NAN; 2]; 3], ..REC_709 };
        assert!([line, dark, edge, nothing].iter().all(|from| rec709_from_chromaticities(from).is_none()));
        assert!(rec709_from_pcs(&[[0.0; 3]; 3]).is_none());
    }

    #[test]
    fn curves_at_their_ends_and_beyond() {
        let gamma = 2.0;
        let parametric = Curve::Parametric { gamma, abcdef: [1.0, -0.5, 0.25, 0.75, 0.125, 0.0] };
        for (v, expected) in [(0.5, 0.125), (0.75, 0.1875), (1.0, 0.375), (2.5, 4.125), (-0.5, -0.125)] {
            assert_eq!(parametric.linear(v), expected, "{v}");
        }
        let table = Curve::Table(vec![0.0, 0.25, 1.0]);
        for (v, expected) in [(0.25, 0.125), (0.5, 0.25), (0.75, 0.625), (1.0, 1.0), (2.0, 2.5), (-0.5, -0.25)] {
            assert_eq!(table.linear(v), expected, "{v}");
        }
        let flat = Curve::Table(vec![0.0, 1.0, 1.0]);
        assert_eq!((flat.linear(f64::INFINITY), flat.linear(3.0)), (1.0, 1.0));
        let below = Curve::Parametric { gamma: 2.2, abcdef: [1.0, -0.9, 0.0, 0.0, 0.1, 0.0] };
        assert_eq!(below.linear(0.5), 0.1);
        for curve in [table, flat, below, parametric, Curve::Power(2.2), Curve::Srgb, Curve::Linear] {
            assert!(curve.linear(f64::NAN).is_nan(), "{curve:?}");
        }
    }

    #[test]
    fn rounded_curves_have_their_names() {
        let rounded = |curve: &Curve, count: usize| {
            let value = |i: usize| (curve.linear(i as f64 / (count - 1) as f64) * 65535.0).round() / 65535.0;
            Curve::Table((0..count).map(value).collect())
        };
        for named in [Curve::Srgb, Curve::Linear] {
            assert!([256, 1024, 4096].iter().all(|&count| rounded(&named, count).named() == named));
        }
        assert_eq!(Curve::Power(1.0).named(), Curve::Linear);
        let gamma = Curve::Power(2.2);
        assert_eq!(gamma.clone().named(), gamma);
        let table = rounded(&gamma, 1024);
        assert_eq!(table.clone().named(), table);
    }
}
