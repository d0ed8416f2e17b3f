//! Stops runs at random moments: `interrupts PATH-OF-WARPLOOM [COUNT]`.

use std::process::ExitCode;

use warploom_tests::harness::{arguments, interrupts::interrupts};

fn main() -> ExitCode {
    let (binary, count) = arguments(200);
    interrupts(&binary, count).print()
}
