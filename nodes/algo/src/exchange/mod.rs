//! Pixel maps as programs exchange them: a pair of numbers for each pixel that says where it comes from, or goes.
//!
//! Five choices say what the numbers mean ([`Convention`]), two formats what they refer to ([`PixelMap`]). A map that
//! is read becomes a warp on the lattice of its pixels' centres ([`pixel_lattice`]): at the centre of a pixel the warp
//! is what the file says, to the rounding of a double. Written again it says the same positions, to 1e-11 px in
//! formats of 4096 px; numbers come back bit for bit unless they are tiny. Alpha comes back as 0 or 1, and under 0 the
//! numbers are those of [`PixelMap::nowhere`].

mod convert;

pub use convert::{DecodeError, Decoded, Encoded, decode, encode};

use crate::lattice::Lattice;
use crate::rect::Rect;

/// What the pair of numbers is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Meaning {
    /// A position.
    Absolute,
    /// A position less the pixel's own.
    Offset,
}

/// Where y starts and which way it points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum YAxis {
    /// From the lower edge of the format up.
    Up,
    /// From the upper edge of the format down.
    Down,
}

/// What 1 stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Unit {
    /// The width of the format along x, its height along y.
    Format,
    /// A pixel.
    Pixel,
}

/// Whether the numbers are what is meant or its negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sign {
    /// As they are.
    Plus,
    /// Negated.
    Minus,
}

/// Where pixels have their coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Centers {
    /// The first pixel's centre is at 1/2, the format's edges at 0 and its size.
    Half,
    /// The first pixel's centre is at 0, the last one's at the format's size less 1, which is what a fraction is of.
    Whole,
}

/// The five choices that say what the numbers of a pixel map mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Convention {
    /// What the pair of numbers is.
    pub meaning: Meaning,
    /// Where y starts and which way it points.
    pub y_axis: YAxis,
    /// What 1 stands for.
    pub unit: Unit,
    /// Whether the numbers are what is meant or its negative.
    pub sign: Sign,
    /// Where pixels have their coordinates.
    pub centers: Centers,
}

impl Convention {
    /// Nuke's STMap: positions as fractions, y up.
    pub const NUKE_ST_MAP: Self = Self {
        meaning: Meaning::Absolute,
        y_axis: YAxis::Up,
        unit: Unit::Format,
        sign: Sign::Plus,
        centers: Centers::Half,
    };
    /// Nuke's IDistort: offsets in px, y up.
    pub const NUKE_IDISTORT: Self = Self { meaning: Meaning::Offset, unit: Unit::Pixel, ..Self::NUKE_ST_MAP };
    /// `st_warp` of OpenImageIO: positions as fractions, y down.
    pub const OIIO_ST_WARP: Self = Self { y_axis: YAxis::Down, ..Self::NUKE_ST_MAP };
    /// Blender's Map UV: positions as fractions, y up.
    pub const BLENDER_MAP_UV: Self = Self::NUKE_ST_MAP;
    /// Blender's Displace: what a pixel's position is to be lessened by, px, y up.
    pub const BLENDER_DISPLACE: Self = Self { sign: Sign::Minus, ..Self::NUKE_IDISTORT };
}

/// What the numbers of a map refer to. Coordinates in a file count from the corner of a format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelMap {
    /// What the numbers mean.
    pub convention: Convention,
    /// Format that the map's pixels lie in, not empty.
    pub pixels: Rect,
    /// Format that the positions lie in, not empty; fractions are of its size.
    pub positions: Rect,
}

impl PixelMap {
    /// The numbers that say that the pixel centred at `center` belongs to `position`, both px.
    ///
    /// A position at distance d from the format's edge is `(d - shift) / span`, an offset the difference of both
    /// distances over `span`. Shift is 1/2 px with whole centres, else 0; span is 1 px, or for fractions the format
    /// less two shifts.
    pub fn numbers(&self, center: [f64; 2], position: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| {
            let (shift, span) = self.scale(axis);
            let distance = self.distance(&self.positions, axis, position[axis]);
            let start = match self.convention.meaning {
                Meaning::Absolute => shift,
                Meaning::Offset => self.distance(&self.pixels, axis, center[axis]),
            };
            self.sign() * (distance - start) / span
        })
    }

    /// The position, px, that `numbers` say the pixel centred at `center` belongs to; undoes [`Self::numbers`].
    pub fn position(&self, center: [f64; 2], numbers: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| {
            let (shift, span) = self.scale(axis);
            let start = match self.convention.meaning {
                Meaning::Absolute => shift,
                Meaning::Offset => self.distance(&self.pixels, axis, center[axis]),
            };
            let distance = start + self.sign() * numbers[axis] * span;
            let [low, high] = ends(&self.positions, axis);
            if self.points_up(axis) { high - distance } else { low + distance }
        })
    }

    /// A position for pixels that have none: outside the format, a whole format before the corner that coordinates
    /// count from. As a fraction it is (-1, -1), with [`Centers::Whole`] (-W - 1/2) / (W - 1) and likewise for H.
    pub fn nowhere(&self) -> [f64; 2] {
        [0, 1].map(|axis| {
            let [low, high] = ends(&self.positions, axis);
            if self.points_up(axis) { high + (high - low) } else { low - (high - low) }
        })
    }

    fn scale(&self, axis: usize) -> (f64, f64) {
        let [low, high] = ends(&self.positions, axis);
        scale(self.convention.unit, self.convention.centers, high - low)
    }

    /// From the edge of a format where the file's coordinates start.
    fn distance(&self, format: &Rect, axis: usize, at: f64) -> f64 {
        let [low, high] = ends(format, axis);
        if self.points_up(axis) { high - at } else { at - low }
    }

    fn points_up(&self, axis: usize) -> bool {
        axis == 1 && self.convention.y_axis == YAxis::Up
    }

    fn sign(&self) -> f64 {
        match self.convention.sign {
            Sign::Plus => 1.0,
            Sign::Minus => -1.0,
        }
    }
}

/// Shift and span of a coordinate: the point at distance d from the edge of a format of `size` px is at
/// `(d - shift) / span`. This is all that the half pixel is about: with whole centres coordinates start half a pixel
/// later, and a fraction is of the way from the first centre to the last (of 1 px where these are one).
fn scale(unit: Unit, centers: Centers, size: f64) -> (f64, f64) {
    let shift = match centers {
        Centers::Half => 0.0,
        Centers::Whole => 0.5,
    };
    match unit {
        Unit::Pixel => (shift, 1.0),
        Unit::Format => (shift, (size - 2.0 * shift).max(1.0)),
    }
}

fn ends(format: &Rect, axis: usize) -> [f64; 2] {
    let [low, high] = [[format.x0, format.x1], [format.y0, format.y1]][axis];
    [low as f64, high as f64]
}

/// The lattice of the centres of a window's pixels, 1 px apart. A side of one pixel gets a second node.
pub fn pixel_lattice(window: Rect) -> Lattice {
    Lattice {
        origin: [window.x0 as f64 + 0.5, window.y0 as f64 + 0.5],
        spacing: [1.0, 1.0],
        nodes: [window.width().max(2), window.height().max(2)],
    }
}

#[cfg(test)]
mod tests;
