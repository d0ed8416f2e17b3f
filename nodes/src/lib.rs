//! The nodes of Warploom.
