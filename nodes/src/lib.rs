//! The nodes of Warploom: thin adapters between the graph and `warploom-algo`. One node, one file; one list of all.

mod adapt;
pub mod card;
pub mod feature;
pub mod grid;
pub mod handles;
pub mod image;
pub mod io;
pub mod mask;
pub mod time;
pub mod warp;

use warploom_core::registry::{Definition, def};

/// All node types, by name. To add one: its file, and its line here.
pub const NODES: &[Definition] = &[
    def::<warp::Affine>("Affine"),
    def::<warp::Arc>("Arc"),
    def::<card::Checker>("Checker"),
    def::<mask::Combine>("Combine"),
    def::<mask::Components>("Components"),
    def::<card::Constant>("Constant"),
    def::<image::Difference>("Difference"),
    def::<image::DrawGrid>("DrawGrid"),
    def::<feature::FeatureFactor>("FeatureFactor"),
    def::<feature::FeatureWarp>("FeatureWarp"),
    def::<time::FrameHold>("FrameHold"),
    def::<mask::Grow>("Grow"),
    def::<handles::HandleFactor>("HandleFactor"),
    def::<handles::Handles>("Handles"),
    def::<grid::Lattice>("Lattice"),
    def::<io::Load>("Load"),
    def::<image::Over>("Over"),
    def::<mask::Polygon>("Polygon"),
    def::<card::Ramp>("Ramp"),
    def::<image::Resample>("Resample"),
    def::<io::Save>("Save"),
    def::<warp::Stretch>("Stretch"),
    def::<warp::Swirl>("Swirl"),
    def::<mask::Threshold>("Threshold"),
    def::<warp::Wave>("Wave"),
];
