//! How alike the surroundings of pixels are (Brooks, Dodgson 2002).

mod guide;
mod map;

pub use guide::SimilarityGuide;
pub use map::Similarity;

use warploom_algo::similarity::Guide;
use warploom_core::value::Windows;

/// What a factor of SimilarityGuide holds.
struct Prepared {
    guide: Guide,
    /// Of the picture.
    windows: Windows,
}
