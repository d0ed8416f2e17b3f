//! Feature-aware warps before and after the fold guard: `fold_guard [COUNT]` random cases, both fits.
//!
//! `fold_guard large [SIDE]` repairs a swirl of 3 rad and a rigid squeeze to 0.3 on a square lattice instead.

use std::io;
use std::process::ExitCode;

use warploom_algo as algo;
use warploom_algo::feature::guard::{Fit, How, Verdict};
use warploom_algo::lattice::{Lattice, Positions};
use warploom_algo::warp::{stretch, swirl};
use warploom_tests::cpu_seconds;

#[path = "../../nodes/algo/src/feature/guard/cases.rs"]
mod cases;

use cases::Case;

fn main() -> io::Result<ExitCode> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize, otherwise: u64| arguments.get(at).and_then(|text| text.parse().ok()).unwrap_or(otherwise);
    if arguments.first().is_some_and(|word| word == "large") {
        large(number(1, 200) as usize)?;
        return Ok(ExitCode::SUCCESS);
    }
    let wrong = run(Fit::Bend, number(0, 1000))? + run(Fit::Shrink, number(0, 1000))?;
    Ok(ExitCode::from(u8::from(wrong > 0)))
}

/// Guards cases 0 to `count` and prints what came of it; gives the count of violations.
fn run(fit: Fit, count: u64) -> io::Result<usize> {
    let (mut folded, mut before, mut after, mut wrong) = (0, 0, 0, 0);
    let (mut steps, mut shrunk, mut seconds) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 0..count {
        let case = Case::random(seed);
        let begun = cpu_seconds()?;
        let found = case.guarded(fit);
        seconds.push(cpu_seconds()? - begun);
        folded += usize::from(found.verdict.literal_folds > 0);
        before += found.verdict.literal_folds;
        after += found.verdict.folds;
        match found.verdict.how {
            How::Literal => {}
            How::Kept => unreachable!("features may bend here"),
            How::Shrunk { factor } => shrunk.push(factor),
            How::Bent { steps: made } => steps.push(made as f64),
        }
        for violation in case.violations(&found) {
            println!("case {seed}, {fit:?}: {violation}");
            wrong += 1;
        }
    }
    println!("{fit:?}: {count} cases, {folded} of them fold without the guard: {before} cells; with it {after}");
    let show = |what: &str, values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        if let (Some(median), Some(largest)) = (values.get(values.len() / 2), values.last()) {
            let sum: f64 = values.iter().sum();
            println!("  {what}: {} times, median {median:.4}, largest {largest:.4}, sum {sum:.1}", values.len());
        }
    };
    show("Newton steps", &mut steps);
    show("factor on the scales", &mut shrunk);
    show("seconds, the literal solution included", &mut seconds);
    println!("  violations: {wrong}");
    Ok(wrong)
}

fn large(side: usize) -> io::Result<()> {
    let lattice = Lattice { origin: [0.0; 2], spacing: [5.0; 2], nodes: [side, side] };
    let size = side as f64;
    let discs = [[0.35, 0.4, 0.12], [0.62, 0.55, 0.1], [0.4, 0.75, 0.08]].map(|disc| disc.map(|part| part * size));
    let turn = 3f64.to_degrees();
    let swirled = swirl(&lattice, turn, 2.4 * size, lattice.center(), algo::UNWATCHED).expect("nobody stops it");
    let squeezed = stretch(&lattice, [0.3, 1.0], lattice.center(), algo::UNWATCHED).expect("nobody stops it");
    let one = |name: &str, base: &Positions, rigid: bool, fit: Fit| -> io::Result<()> {
        let case = Case::new(lattice, base.clone(), &discs, rigid);
        let begun = cpu_seconds()?;
        let Verdict { how, min_jacobian, floor, folds, literal_folds, .. } = case.guarded(fit).verdict;
        let seconds = cpu_seconds()? - begun;
        println!(
            "{name}, {fit:?}: {how:?}, folds {literal_folds} -> {folds}, J {min_jacobian:.2e} (floor {floor:.2e}), {seconds:.2} s"
        );
        Ok(())
    };
    one("swirl of 3 rad, similarity", &swirled, false, Fit::Bend)?;
    one("squeeze to 0.3, rigid", &squeezed, true, Fit::Shrink)?;
    one("squeeze to 0.3, rigid", &squeezed, true, Fit::Bend)
}
