//! Has spoiled, damaged and explosive picture files read: `hostile_images PATH-OF-WARPLOOM [COUNT [SEED]]`. The damaged
//! ones are those of openexr-images if they lie in `../shared/data` beside the checkout.

use std::path::Path;
use std::process::ExitCode;

use warploom_tests::harness::hostile::files::{damaged, explosive};
use warploom_tests::harness::hostile::{hostile, work_if_asked};
use warploom_tests::harness::{Outcome, arguments};

#[global_allocator]
static HEAP: peak_alloc::PeakAlloc = peak_alloc::PeakAlloc;

fn main() -> ExitCode {
    if work_if_asked(&HEAP) {
        return ExitCode::SUCCESS;
    }
    let (binary, count) = arguments(10_000);
    let seed = std::env::args().nth(3).map_or(1, |word| word.parse().expect("the third argument is a seed"));
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/openexr-images/Damaged");
    let mut outcome = Outcome::default();
    for part in [hostile(seed, count, &[]), damaged(&binary, &samples), explosive(&binary)] {
        outcome.figures.extend(part.figures);
        outcome.violations.extend(part.violations);
    }
    outcome.print()
}
