//! The nodes of Warploom: thin adapters between the graph and `warploom-algo`. One node, one file
//! (the bends share one); one list of all.

mod adapt;
pub mod card;
pub mod detail;
pub mod edit;
pub mod feature;
pub mod grid;
pub mod handles;
pub mod image;
pub mod io;
pub mod mask;
pub mod mesh;
#[cfg(test)]
mod refusals;
pub mod similarity;
pub mod time;
pub mod warp;

use warploom_core::registry::{Definition, def};

/// All node types, by name. To add one: its file, and its line here.
pub const NODES: &[Definition] = &[
    def::<warp::Affine>("Affine"),
    def::<warp::Arc>("Arc"),
    def::<warp::ArcLower>("ArcLower"),
    def::<warp::ArcUpper>("ArcUpper"),
    def::<warp::Arch>("Arch"),
    def::<warp::BezierEnvelope>("BezierEnvelope"),
    def::<warp::Blend>("Blend"),
    def::<warp::Bulge>("Bulge"),
    def::<card::Checker>("Checker"),
    def::<edit::Clone>("Clone"),
    def::<mask::Combine>("Combine"),
    def::<mask::Components>("Components"),
    def::<warp::Compose>("Compose"),
    def::<card::Constant>("Constant"),
    def::<mesh::Cylinder>("Cylinder"),
    def::<detail::Detail>("Detail"),
    def::<image::Difference>("Difference"),
    def::<image::DrawGrid>("DrawGrid"),
    def::<feature::FeatureFactor>("FeatureFactor"),
    def::<feature::FeatureWarp>("FeatureWarp"),
    def::<warp::Fish>("Fish"),
    def::<warp::Fisheye>("Fisheye"),
    def::<warp::Flag>("Flag"),
    def::<time::FrameHold>("FrameHold"),
    def::<warp::FreeLattice>("FreeLattice"),
    def::<mask::Grow>("Grow"),
    def::<handles::HandleFactor>("HandleFactor"),
    def::<handles::Handles>("Handles"),
    def::<warp::Inflate>("Inflate"),
    def::<warp::Invert>("Invert"),
    def::<grid::Lattice>("Lattice"),
    def::<warp::Lens>("Lens"),
    def::<io::Load>("Load"),
    def::<mesh::LoadMesh>("LoadMesh"),
    def::<io::LoadWarp>("LoadWarp"),
    def::<warp::Magnify>("Magnify"),
    def::<image::Over>("Over"),
    def::<edit::Paint>("Paint"),
    def::<warp::Perspective>("Perspective"),
    def::<mask::Polygon>("Polygon"),
    def::<card::Ramp>("Ramp"),
    def::<mesh::Render>("Render"),
    def::<image::Resample>("Resample"),
    def::<warp::Ripple>("Ripple"),
    def::<warp::Rise>("Rise"),
    def::<io::Save>("Save"),
    def::<io::SaveWarp>("SaveWarp"),
    def::<warp::ShellLower>("ShellLower"),
    def::<warp::ShellUpper>("ShellUpper"),
    def::<detail::SimilarSets>("SimilarSets"),
    def::<similarity::Similarity>("Similarity"),
    def::<similarity::SimilarityGuide>("SimilarityGuide"),
    def::<mesh::Sphere>("Sphere"),
    def::<warp::Squeeze>("Squeeze"),
    def::<warp::Stretch>("Stretch"),
    def::<warp::Swirl>("Swirl"),
    def::<mask::Threshold>("Threshold"),
    def::<mesh::Torus>("Torus"),
    def::<warp::Turbulence>("Turbulence"),
    def::<warp::Twist>("Twist"),
    def::<warp::Wave>("Wave"),
];
