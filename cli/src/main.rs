//! The warploom command.

use std::process::ExitCode;

fn main() -> ExitCode {
    warploom::main()
}
