//! Masks: planes of coverage from 0 to 1.

mod clamp;
mod combine;
mod grow;
mod polygon;
mod threshold;

pub use clamp::clamp;
pub use combine::{Combination, combine};
pub use grow::grow;
pub use polygon::polygon;
pub use threshold::{luma, threshold};
