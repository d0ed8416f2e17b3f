//! Magnification by transport: `magnify [COUNT]` random fields, what must be true of each.
//!
//! `magnify smooth` times smooth fields on 128 x 128 cells; `magnify brick [PICTURE]` measures the transport against the
//! published relaxation on the field of a similarity to one point of a brick wall, a drawn one if none is given.

use std::collections::BTreeMap;
use std::process::ExitCode;

use warploom_algo as algo;
use warploom_algo::UNWATCHED;
use warploom_algo::lattice::Lattice;
use warploom_algo::magnify::{Frame, Keahey, Magnified, Method, Normalise, Wish, magnify};

#[path = "../../nodes/algo/src/magnify/cases.rs"]
mod cases;

use cases::{Case, Noise};

/// Cells along each side of the timed lattices.
const CELLS: usize = 128;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.first().map(String::as_str) {
        Some("smooth") => smooth(),
        Some("brick") => brick(arguments.get(1).map(String::as_str)),
        count => return ExitCode::from(u8::from(random(count.and_then(|text| text.parse().ok()).unwrap_or(1000)) > 0)),
    }
    ExitCode::SUCCESS
}

/// Magnifies cases 0 to `count` and prints what came of it; gives the count of violations.
fn random(count: u64) -> usize {
    let (mut wrong, mut tempered) = (0, BTreeMap::<String, Vec<f64>>::new());
    let mut worst: f64 = 0.0;
    for seed in 0..count {
        let case = Case::random(seed);
        let found = case.solved();
        for violation in case.violations(&found) {
            println!("case {seed}, {:?}, {:?}: {violation}", case.look, case.frame);
            wrong += 1;
        }
        worst = worst.max((found.total_area - 1.0).abs());
        tempered.entry(format!("{:?}", case.look)).or_default().push(found.exponent);
    }
    println!("{count} fields, {wrong} violations, largest error of the total area {worst:.1e}");
    for (look, mut exponents) in tempered {
        exponents.sort_by(f64::total_cmp);
        let whole = exponents.iter().filter(|&&exponent| exponent == 1.0).count();
        let (least, median) = (exponents[0], exponents[exponents.len() / 2]);
        println!(
            "  {look}: {} fields, {whole} whole; exponent {least:.3} at least, median {median:.3}",
            exponents.len()
        );
    }
    wrong
}

/// A lattice of 512 x 512 px.
fn lattice() -> Lattice {
    Lattice { origin: [0.0; 2], spacing: [512.0 / CELLS as f64; 2], nodes: [CELLS + 1; 2] }
}

/// The median CPU time of `runs` on one thread, ms, and what was found.
fn timed(strength: &[f64], method: Method, frame: Frame, runs: usize) -> (f64, Magnified) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread can be had");
    let wish = Wish { strength, method, normalise: Normalise::Multiply, frame };
    let run = || {
        let begun = cpu_seconds();
        let found = magnify(&lattice(), &wish, UNWATCHED).expect("nobody stops it");
        (cpu_seconds() - begun, found)
    };
    let mut found: Vec<_> = (0..runs).map(|_| pool.install(run)).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (seconds, magnified) = found.swap_remove(runs / 2);
    (1e3 * seconds, magnified)
}

fn show(name: &str, (ms, found): &(f64, Magnified)) {
    let Magnified { steps, exponent, largest_error, rms_error, certificate, .. } = found;
    println!(
        "{name:>28}: {ms:8.2} ms, {steps:4} steps, error {largest_error:.1e}, rms {rms_error:.2e}, t {exponent:.3}, \
         J {:.3}, {} folds",
        certificate.min_jacobian, certificate.folds
    );
}

/// Strengths of cells by the places of their centres, 0..1.
fn field(strength: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let at = |at: usize| (at as f64 + 0.5) / CELLS as f64;
    (0..CELLS * CELLS).map(|cell| strength(at(cell % CELLS), at(cell / CELLS))).collect()
}

fn smooth() {
    let bump = |x: f64, y: f64, width: f64| (-((x - 0.45).powi(2) + (y - 0.55).powi(2)) / (2.0 * width * width)).exp();
    let mut noise = Noise::new(1);
    let blobs: Vec<[f64; 4]> =
        (0..14).map(|_| [noise.next(), noise.next(), noise.within(0.04, 0.08), noise.within(-0.6, 0.9)]).collect();
    let blob = |x: f64, y: f64| {
        let sum = blobs.iter().map(|[u, v, w, s]| s * (-((x - u).powi(2) + (y - v).powi(2)) / (2.0 * w * w)).exp());
        sum.sum::<f64>().max(-0.9)
    };
    for (name, strength) in [
        ("bump +85 %", field(|x, y| 0.85 * bump(x, y, 0.1))),
        ("hollow -85 %", field(|x, y| -0.85 * bump(x, y, 0.1))),
        ("14 blobs", field(blob)),
        ("bump 9:1", field(|x, y| 8.0 * bump(x, y, 0.12))),
    ] {
        for frame in [Frame::Slide, Frame::Periodic, Frame::Pin] {
            show(&format!("{name}, {frame:?}"), &timed(&strength, Method::Transport, frame, 15));
        }
    }
}

fn brick(picture: Option<&str>) {
    let picture = picture.map_or_else(drawn_wall, read);
    let strength = similarity(&picture);
    let transport = timed(&strength, Method::Transport, Frame::Slide, 15);
    show("transport", &transport);
    for (name, keahey) in [
        ("Keahey 300", Keahey { sweeps: 300, ..Keahey::default() }),
        ("Keahey 300 (0.5, 0.25)", Keahey { sweeps: 300, refine: 0.5, limit: 0.25, ..Keahey::default() }),
        ("Keahey 5 levels of 30", Keahey { sweeps: 30, levels: 5, ..Keahey::default() }),
    ] {
        let found = timed(&strength, Method::Keahey(keahey), Frame::Pin, 3);
        show(name, &found);
        let (times, errors) = (found.0 / transport.0, found.1.rms_error / transport.1.rms_error);
        println!("{:>28}  transport: {errors:.0} times smaller rms error in 1/{times:.1} of the time", "");
    }
}

/// Samples of 256 x 256, 0..255.
struct Picture {
    side: usize,
    samples: Vec<f64>,
}

impl Picture {
    /// A sample of the repeated picture.
    fn at(&self, x: usize, y: usize) -> f64 {
        self.samples[y % self.side * self.side + x % self.side]
    }

    /// Half the picture, by the binomial filter.
    fn halved(&self) -> Self {
        const WEIGHTS: [f64; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];
        let side = self.side / 2;
        let sample = |x: usize, y: usize| {
            let tap = |at: usize| (at % 5, at / 5);
            let weighed = (0..25).map(tap).map(|(dx, dy)| {
                WEIGHTS[dx] * WEIGHTS[dy] * self.at(2 * x + dx + self.side - 2, 2 * y + dy + self.side - 2)
            });
            weighed.sum::<f64>() / 256.0
        };
        Self { side, samples: (0..side * side).map(|at| sample(at % side, at / side)).collect() }
    }

    /// Squared differences of the discs of 21 pixels around two places, three times for three equal channels.
    fn distance(&self, [x, y]: [usize; 2], [u, v]: [usize; 2]) -> f64 {
        let disc = (0..25).map(|at: usize| (at % 5, at / 5)).filter(|(dx, dy)| dx.abs_diff(2) + dy.abs_diff(2) < 4);
        let beside = |at: usize, by: usize| at + by + self.side - 2;
        let squares = disc.map(|(dx, dy)| {
            let apart = self.at(beside(x, dx), beside(y, dy)) - self.at(beside(u, dx), beside(v, dy));
            apart * apart
        });
        3.0 * squares.sum::<f64>()
    }
}

/// How similar every pixel of level 1 is to one of them, of two levels together: 0.85 there, 0 for half of them all.
fn similarity(picture: &Picture) -> Vec<f64> {
    const AT: [usize; 2] = [50, 45];
    let fine = picture.halved();
    let coarse = fine.halved();
    let distance = |at: usize| {
        let at = [at % CELLS, at / CELLS];
        fine.distance(at, AT) + coarse.distance(at.map(|at| at / 2), AT.map(|at| at / 2))
    };
    let distances: Vec<f64> = (0..CELLS * CELLS).map(distance).collect();
    let mut sorted = distances.clone();
    sorted.sort_by(f64::total_cmp);
    let threshold = sorted[sorted.len() / 2];
    distances.iter().map(|distance| 0.85 * (1.0 - distance / threshold).max(0.0)).collect()
}

/// A wall of bricks with mortar between them and some grain.
fn drawn_wall() -> Picture {
    let mut noise = Noise::new(7);
    let grain: Vec<f64> = (0..256 * 256).map(|_| noise.within(-20.0, 20.0)).collect();
    let shades: Vec<f64> = (0..64).map(|_| noise.within(90.0, 150.0)).collect();
    let sample = |at: usize| {
        let (x, y) = (at % 256, at / 256);
        let course = y / 32;
        let x = (x + 32 * (course % 2)) % 256;
        let to_edge = (x % 64).min(63 - x % 64).min(y % 32).min(31 - y % 32) as f64;
        let brick = ((to_edge - 1.0) / 3.0).clamp(0.0, 1.0);
        (1.0 - brick) * 200.0 + brick * shades[8 * course + x / 64] + grain[at]
    };
    Picture { side: 256, samples: (0..256 * 256).map(sample).collect() }
}

/// A square picture in grey, averaged to 256 x 256.
fn read(path: &str) -> Picture {
    let grey = image::open(path).expect("a picture that can be read").to_luma8();
    let part = grey.width() as usize / 256;
    let pixel = |x: usize, y: usize| f64::from(grey.get_pixel(x as u32, y as u32).0[0]);
    let sample = |at: usize| {
        let (x, y) = (at % 256 * part, at / 256 * part);
        let block = (0..part * part).map(|at| pixel(x + at % part, y + at / part));
        block.sum::<f64>() / (part * part) as f64
    };
    Picture { side: 256, samples: (0..256 * 256).map(sample).collect() }
}

/// Time that this thread has computed.
fn cpu_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
