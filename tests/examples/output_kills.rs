//! Kills runs that write over existing frames: `output_kills PATH-OF-WARPLOOM [COUNT]`.

use std::process::ExitCode;

use warploom_tests::harness::{arguments, output_kills};

fn main() -> ExitCode {
    if output_kills::write_in_place_if_asked() {
        return ExitCode::SUCCESS;
    }
    let (binary, count) = arguments(1000);
    output_kills::output_kills(&binary, count, &[]).print()
}
