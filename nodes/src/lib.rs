//! The nodes of Warploom: thin adapters between the graph and `warploom-algo`. One node, one file; one list of all.

mod adapt;
pub mod card;
pub mod feature;
pub mod grid;
pub mod image;
pub mod io;
pub mod mask;
pub mod mesh;
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
    def::<mesh::Cylinder>("Cylinder"),
    def::<image::Difference>("Difference"),
    def::<image::DrawGrid>("DrawGrid"),
    def::<feature::FeatureFactor>("FeatureFactor"),
    def::<feature::FeatureWarp>("FeatureWarp"),
    def::<time::FrameHold>("FrameHold"),
    def::<mask::Grow>("Grow"),
    def::<grid::Lattice>("Lattice"),
    def::<io::Load>("Load"),
    def::<mesh::LoadMesh>("LoadMesh"),
    def::<image::Over>("Over"),
    def::<mask::Polygon>("Polygon"),
    def::<card::Ramp>("Ramp"),
    def::<mesh::Render>("Render"),
    def::<image::Resample>("Resample"),
    def::<io::Save>("Save"),
    def::<mesh::Sphere>("Sphere"),
    def::<warp::Stretch>("Stretch"),
    def::<warp::Swirl>("Swirl"),
    def::<mask::Threshold>("Threshold"),
    def::<mesh::Torus>("Torus"),
    def::<warp::Wave>("Wave"),
];
