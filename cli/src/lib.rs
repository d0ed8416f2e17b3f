//! The warploom command.
