//! Has spoiled picture files decoded: `hostile_images [COUNT] [SEED]`.

use std::process::ExitCode;

use warploom_tests::harness::hostile::{hostile, work_if_asked};

#[global_allocator]
static HEAP: peak_alloc::PeakAlloc = peak_alloc::PeakAlloc;

fn main() -> ExitCode {
    if work_if_asked(&HEAP) {
        return ExitCode::SUCCESS;
    }
    let mut numbers = std::env::args().skip(1).map(|word| word.parse::<u64>().expect("a number"));
    let (count, seed) = (numbers.next().unwrap_or(10_000), numbers.next().unwrap_or(1));
    hostile(seed, count as usize, &[]).print()
}
