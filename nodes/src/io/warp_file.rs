//! What LoadWarp and SaveWarp share: what the numbers of a map mean, and which channels hold them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::exchange::{self, Convention};

/// Programs that read or write warps as pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Preset {
    /// Nuke's STMap: positions as fractions of the format, y up. Channels `R`, `G` and `A`, which is 0 where there is
    /// no position.
    #[default]
    NukeStMap,
    /// Nuke's IDistort: offsets in px, y up. Channels `forward.u`, `forward.v` and `A`.
    NukeIDistort,
    /// `st_warp` of OpenImageIO: positions as fractions of the format, y down. Channels `R`, `G` and `A`.
    OiioStWarp,
    /// Blender's Map UV: positions as fractions of the format, y up. Channels `R`, `G` and `B`, which is 0 where there
    /// is no position.
    BlenderMapUv,
    /// Blender's Displace: pixel less position in px, y up. Channels `R`, `G` and `A`.
    BlenderDisplace,
}

impl Preset {
    fn convention(self) -> Convention {
        match self {
            Self::NukeStMap => Convention::NUKE_ST_MAP,
            Self::NukeIDistort => Convention::NUKE_IDISTORT,
            Self::OiioStWarp => Convention::OIIO_ST_WARP,
            Self::BlenderMapUv => Convention::BLENDER_MAP_UV,
            Self::BlenderDisplace => Convention::BLENDER_DISPLACE,
        }
    }

    fn channels(self) -> [&'static str; 3] {
        match self {
            Self::NukeIDistort => ["forward.u", "forward.v", "A"],
            Self::BlenderMapUv => ["R", "G", "B"],
            Self::NukeStMap | Self::OiioStWarp | Self::BlenderDisplace => ["R", "G", "A"],
        }
    }
}

/// What is other than the preset has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Choices {
    /// What the numbers are.
    pub meaning: Option<Meaning>,
    /// Which way y points.
    pub y_axis: Option<YAxis>,
    /// What 1 stands for.
    pub unit: Option<Unit>,
    /// Whether the numbers are negated.
    pub sign: Option<Sign>,
    /// Where pixels have their coordinates.
    pub centers: Option<Centers>,
}

/// What the numbers are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Meaning {
    /// Positions.
    Absolute,
    /// Positions less the pixel's own.
    Offset,
}

/// Which way y points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum YAxis {
    /// Up from the lower edge of the format.
    Up,
    /// Down from the upper edge of the format.
    Down,
}

/// What 1 stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Unit {
    /// Width and height of the format.
    Format,
    /// A pixel.
    Pixel,
}

/// Whether the numbers are negated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Sign {
    /// They are not.
    Plus,
    /// They are.
    Minus,
}

/// Where pixels have their coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Centers {
    /// The first pixel's centre is at 1/2; 1 is the far edge of the format.
    Half,
    /// The first pixel's centre is at 0; as a fraction, the last one's at 1.
    Whole,
}

impl Choices {
    /// The preset's convention, but for these choices.
    pub fn of(self, preset: Preset) -> Convention {
        let usual = preset.convention();
        Convention {
            meaning: self.meaning.map_or(usual.meaning, |meaning| match meaning {
                Meaning::Absolute => exchange::Meaning::Absolute,
                Meaning::Offset => exchange::Meaning::Offset,
            }),
            y_axis: self.y_axis.map_or(usual.y_axis, |y_axis| match y_axis {
                YAxis::Up => exchange::YAxis::Up,
                YAxis::Down => exchange::YAxis::Down,
            }),
            unit: self.unit.map_or(usual.unit, |unit| match unit {
                Unit::Format => exchange::Unit::Format,
                Unit::Pixel => exchange::Unit::Pixel,
            }),
            sign: self.sign.map_or(usual.sign, |sign| match sign {
                Sign::Plus => exchange::Sign::Plus,
                Sign::Minus => exchange::Sign::Minus,
            }),
            centers: self.centers.map_or(usual.centers, |centers| match centers {
                Centers::Half => exchange::Centers::Half,
                Centers::Whole => exchange::Centers::Whole,
            }),
        }
    }
}

/// Channels that are named otherwise than by the preset.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Channels {
    /// Numbers along x.
    pub x: Option<String>,
    /// Numbers along y.
    pub y: Option<String>,
    /// 0 where there is no position.
    pub alpha: Option<String>,
}

impl Channels {
    /// The names for x, y and alpha.
    pub fn of(&self, preset: Preset) -> [&str; 3] {
        let [x, y, alpha] = preset.channels();
        [(&self.x, x), (&self.y, y), (&self.alpha, alpha)].map(|(given, usual)| given.as_deref().unwrap_or(usual))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_replace_one_thing_each() {
        assert_eq!(Choices::default().of(Preset::BlenderDisplace), Convention::BLENDER_DISPLACE);
        let whole = Choices { centers: Some(Centers::Whole), ..Choices::default() };
        let expected = Convention { centers: exchange::Centers::Whole, ..Convention::NUKE_ST_MAP };
        assert_eq!(whole.of(Preset::NukeStMap), expected);
        let all = Choices {
            meaning: Some(Meaning::Offset),
            y_axis: Some(YAxis::Up),
            unit: Some(Unit::Pixel),
            sign: Some(Sign::Minus),
            centers: Some(Centers::Half),
        };
        assert_eq!(all.of(Preset::OiioStWarp), Convention::BLENDER_DISPLACE);
    }

    #[test]
    fn names_are_the_presets_where_none_is_given() {
        let channels = Channels { y: Some("v".into()), ..Channels::default() };
        assert_eq!(channels.of(Preset::NukeIDistort), ["forward.u", "v", "A"]);
        assert_eq!(channels.of(Preset::BlenderMapUv), ["R", "v", "B"]);
    }
}
