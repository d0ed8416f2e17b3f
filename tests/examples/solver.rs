//! Times the grid Poisson solver on the system of a feature-aware warp: 13 % mask, weight 10, radius 2.
//!
//! Usage: solver SIZE FILE [RUNS]. Writes the system to FILE for a peer: as little-endian f64 the horizontal and
//! vertical conductances, then for x and y the horizontal and vertical fluxes. Prints one JSON object: CPU seconds
//! of one thread, medians, and the largest distance in cells to the direct solution.

use std::error::Error;
use std::fs;
use std::io::{BufWriter, Write};
use warploom_algo::UNWATCHED;
use warploom_algo::poisson::{Edges, Factor, GridLaplacian, Pins};
use warploom_tests::cpu_seconds;

const WEIGHT: f64 = 10.0;
const RADIUS: f64 = 2.0;

/// Part of a disc's spacing that its radius is: 13 % of the area.
const DISC: f64 = 0.2034;

/// Errors allowed to a node, cells.
const TOLERANCES: [f64; 3] = [1e-3, 1e-2, 1e-6];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [size, file, rest @ ..] = &arguments[..] else {
        return Err("usage: solver SIZE FILE [RUNS]".into());
    };
    let (size, runs) = (size.parse()?, rest.first().map_or(Ok(5), |runs| runs.parse())?);
    let (conductances, fluxes) = system(size);
    let arrays = [&conductances, &fluxes[0], &fluxes[1]];
    let mut written = BufWriter::new(fs::File::create(file)?);
    for value in arrays.iter().flat_map(|edges| edges.horizontal.iter().chain(&edges.vertical)) {
        written.write_all(&value.to_le_bytes())?;
    }
    written.flush()?;

    let mut seconds = Vec::new();
    let mut factored = |conductances: Edges| -> Result<Factor, Box<dyn Error>> {
        let start = cpu_seconds()?;
        let laplacian = GridLaplacian::new([size, size], conductances, Pins::Frame);
        let factor = laplacian.factor(UNWATCHED).map_err(|error| format!("{error:?}"))?;
        seconds.push(cpu_seconds()? - start);
        Ok(factor)
    };
    let mut factor = factored(conductances)?;
    for _ in 1..runs {
        let conductances = factor.conductances().clone();
        drop(factor);
        factor = factored(conductances)?;
    }
    println!(
        "{{\"backend\": \"{}\", \"bytes\": {}, \"factor\": {:.6}",
        factor.backend(),
        factor.bytes(),
        median(seconds)
    );
    let mut solutions = Vec::new();
    for tolerance in TOLERANCES {
        let (seconds, fields) = solve(size, &factor, &fluxes, tolerance, runs)?;
        println!(", \"solve_{tolerance:e}\": {seconds:.6}");
        if solutions.is_empty() {
            println!(", \"peak\": {}", peak_bytes()?);
        }
        solutions.push(fields);
    }
    let exact = solve(size, &exact_factor(size, factor.conductances())?, &fluxes, TOLERANCES[0], 1)?.1;
    for (tolerance, fields) in TOLERANCES.iter().zip(solutions) {
        let apart = fields.iter().flatten().zip(exact.iter().flatten()).map(|(a, b)| (a - b).abs());
        println!(", \"distance_{tolerance:e}\": {:e}", apart.fold(0.0, f64::max));
    }
    println!("}}");
    Ok(())
}

/// The same system solved directly: a frame given as a mask of pins takes no other way.
fn exact_factor(size: usize, conductances: &Edges) -> Result<Factor, Box<dyn Error>> {
    let on_frame = |node: usize| [node % size, node / size].iter().any(|&at| at == 0 || at + 1 == size);
    let pins = Pins::Nodes((0..size * size).map(on_frame).collect());
    let laplacian = GridLaplacian::new([size, size], conductances.clone(), pins);
    laplacian.factor(UNWATCHED).map_err(|error| format!("{error:?}").into())
}

/// Median CPU seconds, and the fields of x and y.
type Timed = (f64, Vec<Vec<f64>>);

fn solve(
    size: usize,
    factor: &Factor,
    fluxes: &[Edges; 2],
    tolerance: f64,
    runs: usize,
) -> Result<Timed, Box<dyn Error>> {
    let still = &vec![0.0; size * size][..];
    let mut seconds = Vec::new();
    let mut fields: Vec<Vec<f64>> = Vec::new();
    for _ in 0..runs {
        // The last solution's memory serves again.
        fields.clear();
        let start = cpu_seconds()?;
        fields =
            factor.solve(fluxes, &[still, still], tolerance, UNWATCHED).map_err(|error| format!("{error:?}"))?.fields;
        seconds.push(cpu_seconds()? - start);
    }
    Ok((median(seconds), fields))
}

/// Conductances of a square lattice with discs as features, and what a swirl asks of its edges, for x and y.
fn system(size: usize) -> (Edges, [Edges; 2]) {
    let cells = size - 1;
    let spacing = cells as f64 / 5.0;
    let is_feature = |column: usize, row: usize| {
        let from_disc = |at: usize| (at as f64 + 0.5) / spacing - ((at as f64 + 0.5) / spacing).floor() - 0.5;
        from_disc(column).hypot(from_disc(row)) < DISC
    };
    let mask: Vec<bool> = (0..cells * cells).map(|cell| is_feature(cell % cells, cell / cells)).collect();
    let mut edges = [Edges::zeros([size, size]), Edges::zeros([size, size]), Edges::zeros([size, size])];
    for cell in 0..cells * cells {
        let (column, row) = (cell % cells, cell / cells);
        let part = (distance(&mask, cells, column, row) / RADIUS).min(1.0);
        let weight = 1.0 + (WEIGHT - 1.0) * (2.0 * part.powi(3) - 3.0 * part.powi(2) + 1.0);
        let stiffness = weight * weight;
        let corner = |right: usize, down: usize| swirl(column + right, row + down, size);
        let corners = [corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)];
        let across = |k: usize| (0..2).map(|y| corners[2 * y + 1][k] - corners[2 * y][k]).sum::<f64>() / 2.0;
        let down = |k: usize| (0..2).map(|x| corners[2 + x][k] - corners[x][k]).sum::<f64>() / 2.0;
        let (re, im) = (across(0) + down(1), across(1) - down(0));
        let turn = [re / re.hypot(im), im / re.hypot(im)];
        let asked = |wanted: f64, from: f64, to: f64| if part < 1.0 { stiffness * (wanted - (to - from)) } else { 0.0 };
        for side in 0..2 {
            let (horizontal, vertical) = ((row + side) * cells + column, row * size + column + side);
            edges[0].horizontal[horizontal] += stiffness;
            edges[0].vertical[vertical] += stiffness;
            for k in 0..2 {
                let (from, to) = (corners[2 * side][k], corners[2 * side + 1][k]);
                edges[1 + k].horizontal[horizontal] += asked(turn[k], from, to);
                let (from, to) = (corners[side][k], corners[2 + side][k]);
                edges[1 + k].vertical[vertical] += asked([-turn[1], turn[0]][k], from, to);
            }
        }
    }
    let [conductances, x, y] = edges;
    (conductances, [x, y])
}

/// From a cell's centre to the union of the features, cells; at least the radius where none is near.
fn distance(mask: &[bool], cells: usize, column: usize, row: usize) -> f64 {
    let reach = RADIUS as usize + 1;
    let mut nearest = RADIUS;
    for y in row.saturating_sub(reach)..(row + reach + 1).min(cells) {
        for x in column.saturating_sub(reach)..(column + reach + 1).min(cells) {
            if mask[y * cells + x] {
                let gap = |a: usize, b: usize| (a.abs_diff(b) as f64 - 0.5).max(0.0);
                nearest = gap(x, column).hypot(gap(y, row)).min(nearest);
            }
        }
    }
    nearest
}

/// Where a swirl of 1.2 radians about the middle takes a node.
fn swirl(column: usize, row: usize, size: usize) -> [f64; 2] {
    let middle = (size - 1) as f64 / 2.0;
    let (x, y) = (column as f64 - middle, row as f64 - middle);
    let angle = 1.2 * (1.0 - (x.hypot(y) / middle).min(1.0)).powi(2);
    let (sin, cos) = angle.sin_cos();
    [middle + cos * x - sin * y, middle + sin * x + cos * y]
}

/// Most bytes that the process had resident.
fn peak_bytes() -> Result<u64, Box<dyn Error>> {
    let text = fs::read_to_string("/proc/self/status")?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:")).ok_or("no peak in the status")?;
    Ok(1024 * line.trim().trim_end_matches(" kB").parse::<u64>()?)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
