//! Checks texts and graphs that nobody would write: `fuzz_graphs [COUNT [FIRST]]`. No case may panic, take longer than a
//! second, or break a promise of the check; each is told with its number.

use std::process::ExitCode;

use warploom_core::registry::Registry;
use warploom_tests::graphs::{Pool, fuzz};

fn main() -> ExitCode {
    let mut numbers = std::env::args().skip(1).map(|word| word.parse().expect("counts are whole numbers"));
    let (count, first) = (numbers.next().unwrap_or(10_000), numbers.next().unwrap_or(0));
    let registry = Registry::new(warploom_nodes::NODES);
    fuzz(&Pool::new(&registry), &registry, first, count).print()
}
