//! The long harnesses at a small count; the examples of `warploom-tests` run them at full length.

#![cfg(unix)]
#![allow(missing_docs)]

use std::path::Path;

use warploom_tests::harness;

#[global_allocator]
static HEAP: peak_alloc::PeakAlloc = peak_alloc::PeakAlloc;

const BINARY: &str = env!("CARGO_BIN_EXE_warploom");

#[test]
fn an_interrupted_shot_is_finished_by_another_run() {
    harness::interrupts::interrupts(Path::new(BINARY), 3).expect_none();
}

#[test]
fn a_killed_run_tears_no_file() {
    if harness::output_kills::write_in_place_if_asked() {
        return;
    }
    let control = ["--exact", "a_killed_run_tears_no_file"];
    harness::output_kills::output_kills(Path::new(BINARY), 12, &control).expect_none();
}

#[test]
fn memory_stays_near_its_budget() {
    harness::memory::memory(Path::new(BINARY), &harness::memory::Load::small()).expect_none();
}

#[test]
fn a_run_fits_its_control_group() {
    let outcome = harness::memory::in_control_group(Path::new(BINARY), &harness::memory::Load::small());
    outcome.figures.iter().for_each(|line| println!("{line}"));
    outcome.expect_none();
}

#[test]
fn spoiled_pictures_are_errors_soon_and_in_little_memory() {
    if harness::hostile::work_if_asked(&HEAP) {
        return;
    }
    let arguments = ["--exact", "--nocapture", "spoiled_pictures_are_errors_soon_and_in_little_memory"];
    harness::hostile::hostile(1, 1000, &arguments).expect_none();
}

#[test]
fn bombs_are_refused_before_they_go_off() {
    harness::hostile::files::explosive(Path::new(BINARY)).expect_none();
}
