//! Long checks of the real binary, as processes. Examples run them at full count, tests at a small one.

pub mod hostile;
pub mod interrupts;
pub mod memory;
pub mod output_kills;
mod place;

pub use place::Place;

use std::fmt::Display;
use std::path::PathBuf;
use std::process::ExitCode;

/// What a harness measured, and what was not as it must be.
#[derive(Default)]
pub struct Outcome {
    /// Lines to print.
    pub figures: Vec<String>,
    /// Broken promises.
    pub violations: Vec<String>,
}

impl Outcome {
    /// Notes a violation unless `holds`.
    pub fn check<T: Display>(&mut self, holds: bool, violation: impl FnOnce() -> T) {
        if !holds {
            self.violations.push(violation().to_string());
        }
    }

    /// Prints the figures and the first violations; fails if there are any.
    pub fn print(&self) -> ExitCode {
        const SHOWN: usize = 20;
        self.figures.iter().for_each(|line| println!("{line}"));
        self.violations.iter().take(SHOWN).for_each(|violation| eprintln!("violation: {violation}"));
        match self.violations.len() {
            0 => return ExitCode::SUCCESS,
            count if count > SHOWN => eprintln!("violation: and {} more", count - SHOWN),
            _ => {}
        }
        ExitCode::FAILURE
    }

    /// Panics if there are violations; for tests.
    #[track_caller]
    pub fn expect_none(&self) {
        assert!(self.violations.is_empty(), "{:#?}\n{:#?}", self.violations, self.figures);
    }
}

/// Arguments of an example: the path of the binary, then a count.
pub fn arguments(count: usize) -> (PathBuf, usize) {
    let mut words = std::env::args().skip(1);
    let binary = PathBuf::from(words.next().expect("the first argument is the path of warploom"));
    let count = words.next().map_or(count, |word| word.parse().expect("the second argument is a count"));
    (binary.canonicalize().expect("the binary is there"), count)
}

/// The middle one, or 0 of none.
pub fn median(numbers: &[f64]) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

fn max(numbers: &[f64]) -> f64 {
    numbers.iter().copied().fold(0.0, f64::max)
}
