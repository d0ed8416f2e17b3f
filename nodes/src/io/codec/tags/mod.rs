//! What files say of their pixels beside the samples: colour, and which way up.

pub mod exif;
pub mod hdr;
pub mod jpeg;
pub mod png;
pub mod tiff;

/// Bytes of the longest colour profile that is read.
const MAX_PROFILE: usize = 16 << 20;

#[cfg(test)]
mod tests;
