//! What files say of their pixels beside the samples: colour, and which way up.

pub mod exif;
pub mod hdr;
pub mod jpeg;
pub mod png;
pub mod tiff;

use warploom_core::node::NodeError;

use super::coding::refused;

/// Bytes of the longest colour profile that is read.
const MAX_PROFILE: usize = 16 << 20;

fn too_long() -> NodeError {
    refused(format!("its ICC profile is longer than {} MiB", MAX_PROFILE >> 20))
}

#[cfg(test)]
mod tests;
