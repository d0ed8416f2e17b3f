//! How stored colour becomes scene-linear, with the primaries of Rec.709.

use warploom_algo::colorimetry::{Chromaticities, Curve, Matrix, is_identity, rec709_from_chromaticities};
use warploom_algo::transfer;
use warploom_core::node::NodeError;

use super::{Encoding, unsupported};

/// How the colour of a file is stored. Alpha is linear in every coding.
#[derive(Clone, Debug, PartialEq)]
pub enum Coding {
    /// Samples as they are, whatever alpha is.
    Raw,
    /// Scene-linear already.
    Linear,
    /// By the sRGB transfer function.
    Srgb,
    /// By curves and a matrix of its own.
    Profile(Box<Profile>),
}

/// A curve for each channel, then a matrix; grey has three equal curves and no matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    curves: [Curve; 3],
    matrix: Option<Matrix>,
}

impl Coding {
    /// Of curves and a matrix to linear Rec.709: the named coding that says the same, if there is one.
    pub fn of(curves: [Curve; 3], matrix: Option<Matrix>) -> Self {
        let (curves, matrix) = (curves.map(Curve::named), matrix.filter(|matrix| !is_identity(matrix)));
        match (&curves, &matrix) {
            ([Curve::Linear, Curve::Linear, Curve::Linear], None) => Self::Linear,
            ([Curve::Srgb, Curve::Srgb, Curve::Srgb], None) => Self::Srgb,
            _ => Self::Profile(Box::new(Profile { curves, matrix })),
        }
    }

    /// Of one curve, and of primaries, which grey has not; None where they span no space.
    pub fn of_primaries(curve: Curve, primaries: Option<&Chromaticities>, is_grey: bool) -> Option<Self> {
        let matrix = match primaries.filter(|_| !is_grey) {
            Some(primaries) => Some(rec709_from_chromaticities(primaries)?),
            None => None,
        };
        Some(Self::of([curve.clone(), curve.clone(), curve], matrix))
    }

    /// That of a file: `said` finds out what it says of itself, which any encoding but `Auto` overrules.
    pub fn of_file(
        encoding: Encoding,
        is_float: bool,
        said: impl FnOnce() -> Result<Option<Self>, NodeError>,
    ) -> Result<Self, NodeError> {
        let said = if encoding == Encoding::Auto { said()? } else { None };
        Ok(said.unwrap_or_else(|| Self::named(encoding, is_float)))
    }

    /// That of an encoding; of `Auto` what is usual for integers or floats.
    pub fn named(encoding: Encoding, is_float: bool) -> Self {
        match encoding {
            Encoding::Raw => Self::Raw,
            Encoding::Linear => Self::Linear,
            Encoding::Srgb => Self::Srgb,
            Encoding::Auto if is_float => Self::Linear,
            Encoding::Auto => Self::Srgb,
        }
    }

    /// Whether samples are linear as they are.
    pub fn is_linear(&self) -> bool {
        matches!(self, Self::Raw | Self::Linear)
    }

    /// Linear colour `c` of a pixel of straight stored colours.
    pub fn linear(&self, c: usize, stored: impl Fn(usize) -> f32) -> f32 {
        match self {
            Self::Raw | Self::Linear => stored(c),
            Self::Srgb => transfer::srgb_to_linear(stored(c)),
            Self::Profile(profile) => profile.mixed(c, |k| profile.curves[k].linear(f64::from(stored(k)))),
        }
    }

    /// Linear colour `c`, multiplied by alpha, of a pixel of stored colours that are. Where alpha is 0 they are light
    /// without coverage, and taken as they are.
    pub fn linear_premultiplied(&self, c: usize, alpha: f32, stored: impl Fn(usize) -> f32) -> f32 {
        match alpha == 0.0 {
            true => self.linear(c, stored),
            false => self.linear(c, |k| stored(k) / alpha) * alpha,
        }
    }
}

impl Profile {
    /// Values of the codes `0..=max` of each channel, before the matrix.
    pub fn levels(&self, max: u16) -> [Vec<f64>; 3] {
        let value = |code: u16| f64::from(code) / f64::from(max);
        [0, 1, 2].map(|c| (0..=max).map(|code| self.curves[c].linear(value(code))).collect())
    }

    /// Linear colour `c` of a pixel of which `level` tells the channels' values.
    pub fn mixed(&self, c: usize, level: impl Fn(usize) -> f64) -> f32 {
        match &self.matrix {
            None => level(c) as f32,
            Some(matrix) => (matrix[c][0] * level(0) + matrix[c][1] * level(1) + matrix[c][2] * level(2)) as f32,
        }
    }
}

/// What a file says of its colour and cannot be honoured.
pub fn refused(message: impl Into<String>) -> NodeError {
    unsupported(message).hint(
        "`encoding: Srgb` reads the samples as sRGB whatever the file says of them, `Linear` as linear, `Raw` as they are",
    )
}
