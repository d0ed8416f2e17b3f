//! Damaged files and bombs through the real binary.
