//! The bends: nine warps of one form, told apart by which edges they bow and how.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp::{self, Bend, Shape};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

/// Along which axis a bent warp lies.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Orientation {
    /// As described.
    #[default]
    Horizontal,
    /// With the axes exchanged: what was up is left, what was down is right.
    Vertical,
}

impl From<Orientation> for warp::Orientation {
    fn from(orientation: Orientation) -> Self {
        match orientation {
            Orientation::Horizontal => Self::Horizontal,
            Orientation::Vertical => Self::Vertical,
        }
    }
}

/// Declares a bend: what it does, its name, and what its main parameter says.
macro_rules! bends {
    ($($(#[$what:meta])* $name:ident { $(#[$how:meta])* bend })*) => {$(
        $(#[$what])*
        #[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            /// Lattice to warp.
            pub grid: In<Grid>,
            $(#[$how])*
            #[default(50.0)]
            #[schemars(range(min = -100.0, max = 100.0), extend("x-unit" = "percent"))]
            pub bend: f64,
            /// Along which axis; upright exchanges up with left and down with right.
            pub orientation: Orientation,
            /// How much taller the right end becomes than the middle.
            #[schemars(range(min = -100.0, max = 100.0), extend("x-unit" = "percent"))]
            pub horizontal_distortion: f64,
            /// How much wider the lower end becomes than the middle.
            #[schemars(range(min = -100.0, max = 100.0), extend("x-unit" = "percent"))]
            pub vertical_distortion: f64,
        }

        impl Node for $name {
            const VERSION: u32 = 1;
            const OUTPUTS: &'static [Output] = super::WARP;

            fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
                let bend = Bend {
                    bend: self.bend,
                    orientation: self.orientation.into(),
                    horizontal_distortion: self.horizontal_distortion,
                    vertical_distortion: self.vertical_distortion,
                };
                super::warped(cx, &cx.get(&self.grid), |lattice, watch| {
                    warp::bend(lattice, Shape::$name, &bend, watch)
                })
            }
        }
    )*};
}

bends! {
    /// Bows the lower edge; the upper one stays.
    ArcLower {
        /// How far, positive downwards.
        bend
    }
    /// Bows the upper edge; the lower one stays.
    ArcUpper {
        /// How far, positive upwards.
        bend
    }
    /// Shifts all rows along one arch; the left and right edges stay.
    Arch {
        /// How far, positive upwards.
        bend
    }
    /// Bows both long edges; the left and right ones stay.
    Bulge {
        /// How far, positive outwards.
        bend
    }
    /// Swells the left half to a body and pinches the right one before a tail.
    Fish {
        /// How far, positive with the body on the left.
        bend
    }
    /// Shifts all rows along one period of a sine wave, like a flag in the wind.
    Flag {
        /// How far, positive with the crest on the left.
        bend
    }
    /// Lets all rows rise from left to right along half a wave.
    Rise {
        /// How far, positive upwards.
        bend
    }
    /// Fans the lower edge out like a shell; the upper one stays.
    ShellLower {
        /// How far, positive outwards.
        bend
    }
    /// Fans the upper edge out like a shell; the lower one stays.
    ShellUpper {
        /// How far, positive outwards.
        bend
    }
}
