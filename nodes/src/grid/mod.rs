//! Lattices.

mod lattice;

pub use lattice::Lattice;
