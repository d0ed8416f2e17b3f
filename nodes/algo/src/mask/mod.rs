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

/// The sample held to 0..=1, 0 for NaN.
fn coverage(sample: f32) -> f32 {
    if sample > 0.0 { sample.min(1.0) } else { 0.0 }
}
