//! Values, node trait, graph, engine and diagnostics of Warploom.

pub mod graph;
