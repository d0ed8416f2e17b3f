//! Runs under memory budgets: `memory PATH-OF-WARPLOOM [FRAMES]`.

use std::process::ExitCode;

use warploom_tests::harness::{arguments, memory};

fn main() -> ExitCode {
    let (binary, frames) = arguments(100);
    let load = memory::Load::full(frames);
    let mut outcome = memory::memory(&binary, &load);
    let group = memory::in_control_group(&binary, &load);
    outcome.figures.extend(group.figures);
    outcome.violations.extend(group.violations);
    outcome.print()
}
