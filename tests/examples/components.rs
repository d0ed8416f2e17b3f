//! Labels the components of a raw mask on 2 threads, once per line of the standard input.
//!
//! Usage: components MASK WIDTH CONNECTIVITY OUT
//!
//! MASK: u8, row by row, set where it is not 0; CONNECTIVITY: 8 or 4. A line is `recycled`, where the labels go into the
//! memory of the last run, or `fresh`, where they go into memory that was never touched. The answer is a line with the
//! seconds that passed and the processor's seconds. At the end of the input, OUT.labels gets the labels, u32, and
//! OUT.table per component its label, box (left, top, right, bottom), area and centroid, f64; all little-endian.

use std::error::Error;
use std::io::{BufRead, Write};
use std::time::Instant;

use rustix::time::{ClockId, clock_gettime};
use warploom_algo::UNWATCHED;
use warploom_algo::components::{Component, Connectivity, label};
use warploom_algo::view::{View, ViewMut};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [mask, width, connectivity, out] = &arguments[..] else { return Err("see the head of components.rs".into()) };
    let mask: Vec<f32> = std::fs::read(mask)?.into_iter().map(|set| f32::from(u8::from(set != 0))).collect();
    let width: usize = width.parse()?;
    let connectivity = if connectivity == "4" { Connectivity::Four } else { Connectivity::Eight };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build()?;
    let (mut labels, mut table) = (vec![1u32; mask.len()], Vec::new());
    for line in std::io::stdin().lock().lines() {
        if line? == "fresh" {
            labels = vec![0; mask.len()];
        }
        let (start, processor) = (Instant::now(), processor_seconds());
        let height = mask.len() / width;
        let (set, view) = (View::packed(&mask, width, height), ViewMut::packed(&mut labels, width, height));
        table = pool.install(|| label(set, connectivity, 0, 0, 0, view, UNWATCHED)).expect("unwatched");
        println!("{} {}", start.elapsed().as_secs_f64(), processor_seconds() - processor);
        std::io::stdout().flush()?;
    }
    std::fs::write(format!("{out}.labels"), bytes(labels.into_iter().map(u32::to_le_bytes)))?;
    let rows = table.iter().zip(1..).flat_map(|(component, label)| row(label, component));
    Ok(std::fs::write(format!("{out}.table"), bytes(rows.map(f64::to_le_bytes)))?)
}

fn row(label: u32, component: &Component) -> [f64; 8] {
    let ([left, top, right, bottom], [x, y]) = (component.bounds.map(|edge| edge as f64), component.centroid);
    [label.into(), left, top, right, bottom, component.area as f64, x, y]
}

fn bytes<const N: usize>(words: impl Iterator<Item = [u8; N]>) -> Vec<u8> {
    words.flatten().collect()
}

fn processor_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
