//! Values, node trait, graph, engine and diagnostics of Warploom.
