//! Contract, golden, engine and command-line tests of Warploom.
