//! Values, node trait, graph, engine and diagnostics of Warploom.
//!
//! This package knows no concrete node, no file format and no window.

pub mod diag;
pub mod engine;
pub mod graph;
pub mod node;
pub mod registry;
pub mod schema;
pub mod value;
