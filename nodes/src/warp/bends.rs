//! The bends: warps of one form, told apart by which edges they bow and how. Some may lie along either axis.

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

/// Declares a bend: what it does, its name, what its main parameter says, and whether it may lie along either
/// axis.
macro_rules! bends {
    (@orientation) => { warp::Orientation::Horizontal };
    (@orientation $given:expr) => { $given.into() };
    ($($(#[$what:meta])* $name:ident { $(#[$how:meta])* bend $(, $orientation:ident)? })*) => {$(
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
            $(
                /// Along which axis; upright exchanges up with left and down with right.
                pub $orientation: Orientation,
            )?
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
                    orientation: bends!(@orientation $(self.$orientation)?),
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
        bend, orientation
    }
    /// Bows the upper edge; the lower one stays.
    ArcUpper {
        /// How far, positive upwards.
        bend, orientation
    }
    /// Shifts all rows along one arch; the left and right edges stay.
    Arch {
        /// How far, positive upwards.
        bend, orientation
    }
    /// Bows both long edges; the left and right ones stay.
    Bulge {
        /// How far, positive outwards.
        bend, orientation
    }
    /// Swells the left half to a body and pinches the right one before a tail.
    Fish {
        /// How far, positive with the body on the left.
        bend, orientation
    }
    /// Magnifies the middle; the border stays.
    Fisheye {
        /// How far, positive enlarges.
        bend
    }
    /// Shifts all rows along one period of a sine wave, like a flag in the wind.
    Flag {
        /// How far, positive with the crest on the left.
        bend, orientation
    }
    /// Bows all four edges; the corners stay.
    Inflate {
        /// How far, positive outwards.
        bend
    }
    /// Lets all rows rise from left to right along half a wave.
    Rise {
        /// How far, positive upwards.
        bend, orientation
    }
    /// Fans the lower edge out like a shell; the upper one stays.
    ShellLower {
        /// How far, positive outwards.
        bend, orientation
    }
    /// Fans the upper edge out like a shell; the lower one stays.
    ShellUpper {
        /// How far, positive outwards.
        bend, orientation
    }
    /// Squeezes the left and right edges towards each other and bows the others outwards; the corners stay.
    Squeeze {
        /// How far, positive inwards.
        bend, orientation
    }
    /// Turns the middle within the ellipse that touches the edges; the border stays.
    Twist {
        /// How far, positive clockwise, half a turn at 100.
        bend
    }
}
