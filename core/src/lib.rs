//! Values, node trait, graph, engine and diagnostics of Warploom.
//!
//! This package knows no concrete node, no file format and no window.
//!
//! - [`docs::architecture`]: the rooms and what is absent from each
//! - [`docs::conventions`], [`docs::glossary`]: pixels, windows, angles, words
//! - [`docs::add_a_node`]: one file, one line, one golden

pub mod diag;
pub mod engine;
pub mod graph;
pub mod node;
pub mod registry;
pub mod schema;
pub mod value;

/// The project's documents.
pub mod docs {
    #[doc = include_str!("../docs/architecture.md")]
    pub mod architecture {}
    #[doc = include_str!("../docs/conventions.md")]
    pub mod conventions {}
    #[doc = include_str!("../docs/glossary.md")]
    pub mod glossary {}
    #[doc = include_str!("../docs/add-a-node.md")]
    pub mod add_a_node {}
}
