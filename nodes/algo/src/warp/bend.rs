//! Bent envelopes: the warps that design tools offer for type, over the unit square of a lattice.

use super::sin_cos_deg;
use crate::lattice::{Lattice, Positions};
use crate::{Interrupted, Watch};

/// The ways of bending a rectangle; see [`bend`] for their formulas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// The lower edge bows downwards, the upper one stays.
    ArcLower,
    /// The upper edge bows upwards, the lower one stays.
    ArcUpper,
    /// All rows are shifted along one arch.
    Arch,
    /// Both long edges bow outwards.
    Bulge,
    /// The lower edge fans out like a shell, the upper one stays.
    ShellLower,
    /// The upper edge fans out like a shell, the lower one stays.
    ShellUpper,
    /// All rows are shifted along one period of a sine wave.
    Flag,
    /// A thick body on the left, a tail on the right.
    Fish,
    /// All rows rise from left to right along half a wave.
    Rise,
    /// The middle is magnified, the border stays.
    Fisheye,
    /// All four edges bow outwards, the corners stay.
    Inflate,
    /// The left and right edges bow inwards, the others outwards, the corners stay.
    Squeeze,
    /// The middle turns, the border stays.
    Twist,
}

/// Along which axis a [`Shape`] lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Orientation {
    /// As described.
    #[default]
    Horizontal,
    /// With the axes exchanged: what was up is left, what was down is right.
    Vertical,
}

/// How far a [`Shape`] is bent; the default is the identity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bend {
    /// Per cent; 0 is the identity.
    pub bend: f64,
    /// Along which axis.
    pub orientation: Orientation,
    /// Growth of heights from the left to the right end, per cent of the middle's.
    pub horizontal_distortion: f64,
    /// Growth of widths from the upper to the lower end, per cent of the middle's.
    pub vertical_distortion: f64,
}

/// Bends the lattice's rectangle into a [`Shape`].
///
/// With u and v from -1 to 1 across and down the rectangle, b = bend / 100, a = 1 - u^2, and everything in halves of
/// the rectangle's width and height, the node at (u, v) moves to (u + du, v + dv):
///
/// ```text
/// ArcLower    du = 0                   dv =  b a (1 + v) / 2
/// ArcUpper    du = 0                   dv = -b a (1 - v) / 2
/// Arch        du = 0                   dv = -b a
/// Bulge       du = 0                   dv =  b a v
/// ShellLower  du = b w u / 2           dv =  b w (1/2 - u^2)        w = ((1 + v) / 2)^2
/// ShellUpper  du = b w u / 2           dv = -b w (1/2 - u^2)        w = ((1 - v) / 2)^2
/// Flag        du = 0                   dv =  b sin(pi u) / 2
/// Fish        du = 0                   dv = -3/4 b v sin(pi u)
/// Rise        du = 0                   dv = -b sin(pi u / 2)
/// Fisheye     du = 3/4 b u f           dv =  3/4 b v f              f = max(0, 1 - u^2 - v^2)^2
/// Inflate     du = 3/8 b u (1 - v^2)   dv =  3/8 b v (1 - u^2)
/// Squeeze     du = -b u (1 - v^2) / 2  dv =  b v (1 - u^2) / 2
/// Twist       (u, v) turns about (0, 0) by 180 b f degrees, clockwise on screen
/// ```
///
/// Vertical exchanges u with v and du with dv. The distortions h and k, fractions, then taper the shape: the node ends
/// at ((u + du) (1 + k v), (v + dv) (1 + h u)), u and v being those before any exchange.
///
/// * `lattice`: the nodes to move.
/// * `shape`: one row of the table. Fisheye and Inflate look the same either way; a vertical Twist turns against the
///   clock.
/// * `parameters`: any finite numbers, see [`Bend`]; meant are -100..=100.
///
/// Without distortion the continuous warp does not fold for a bend of -100..=100, Bulge excepted, which collapses in
/// its middle at -100; Arch, Flag, Rise and Twist do not change areas. A distortion of 100 either way collapses one
/// end. [`super::certify`] tells of the cells.
///
/// Cost: linear in the nodes, rows side by side. Stops when `watch` says so.
pub fn bend(lattice: &Lattice, shape: Shape, parameters: &Bend, watch: Watch) -> Result<Positions, Interrupted> {
    let center = lattice.center();
    let half = lattice.size().map(|side| side / 2.0);
    let [b, h, k] = [parameters.bend, parameters.horizontal_distortion, parameters.vertical_distortion]
        .map(|per_cent| per_cent / 100.0);
    Positions::mapped(lattice, watch, |[x, y]| {
        let [u, v] = [(x - center[0]) / half[0], (y - center[1]) / half[1]];
        let [du, dv] = match parameters.orientation {
            Orientation::Horizontal => shape.moved(b, u, v),
            Orientation::Vertical => {
                let [dv, du] = shape.moved(b, v, u);
                [du, dv]
            }
        };
        [x + half[0] * (du + (u + du) * k * v), y + half[1] * (dv + (v + dv) * h * u)]
    })
}

impl Shape {
    /// How far the node at (u, v) moves, in halves of the rectangle's sides.
    fn moved(self, b: f64, u: f64, v: f64) -> [f64; 2] {
        let (across, along) = (1.0 - u * u, 1.0 - v * v);
        match self {
            Self::ArcLower => [0.0, 0.5 * b * across * (1.0 + v)],
            Self::ArcUpper => [0.0, -0.5 * b * across * (1.0 - v)],
            Self::Arch => [0.0, -b * across],
            Self::Bulge => [0.0, b * across * v],
            Self::ShellLower => shell(b, u, v),
            Self::ShellUpper => {
                let [du, dv] = shell(b, u, -v);
                [du, -dv]
            }
            Self::Flag => [0.0, 0.5 * b * sin_cos_deg(180.0 * u).0],
            Self::Fish => [0.0, -0.75 * b * v * sin_cos_deg(180.0 * u).0],
            Self::Rise => [0.0, -b * sin_cos_deg(90.0 * u).0],
            Self::Fisheye => {
                let growth = 0.75 * b * falloff(u, v);
                [growth * u, growth * v]
            }
            Self::Inflate => [0.375 * b * u * along, 0.375 * b * v * across],
            Self::Squeeze => [-0.5 * b * u * along, 0.5 * b * v * across],
            Self::Twist => {
                let (sin, cos) = sin_cos_deg(180.0 * b * falloff(u, v));
                [(cos - 1.0) * u - sin * v, sin * u + (cos - 1.0) * v]
            }
        }
    }
}

fn shell(b: f64, u: f64, v: f64) -> [f64; 2] {
    let side = 0.5 * (1.0 + v);
    let weight = b * side * side;
    [0.5 * weight * u, weight * (0.5 - u * u)]
}

/// 1 with slope 0 in the middle, 0 with slope 0 on and beyond the inscribed ellipse.
fn falloff(u: f64, v: f64) -> f64 {
    let inside = (1.0 - u * u - v * v).max(0.0);
    inside * inside
}

#[cfg(test)]
mod tests;
