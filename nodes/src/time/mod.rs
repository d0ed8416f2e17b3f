//! Nodes that ask for other frames.

mod frame_hold;

pub use frame_hold::FrameHold;
