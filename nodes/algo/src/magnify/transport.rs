//! Cells get their areas along the gradient of a potential.

use std::ops::Range;

use rayon::prelude::*;

use super::areas::row_areas;
use super::potential::Poisson;
use super::target::mean_of;
use super::{Frame, Moved};
use crate::lattice::{Lattice, Positions};
use crate::warp::certify;
use crate::{Interrupted, Watch};

/// Largest relative error of a cell's area at which the solver stops.
const TOLERANCE: f64 = 2e-4;

/// Steps after which the solver stops however large errors are.
const STEPS: usize = 16;

/// Halvings of the interval in which the exponent lies.
const HALVINGS: usize = 8;

/// Parts of the shorter side over which a pinned frame holds back its neighbours.
const BANDS: usize = 8;

/// Numbers that are summed one after the other, their sums then likewise, whichever thread made them.
const CHUNK: usize = 2048;

/// Bytes per cell beside the areas and the positions that come out: eight arrays of the solver.
const BYTES_PER_CELL: usize = 8 * size_of::<f64>();

/// Bytes per cell of positions that are kept beside others: of a nearer step, or of an attempt that fitted.
const KEPT_BYTES_PER_CELL: usize = 2 * size_of::<f64>();

/// What is compared with the area asked for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Measure {
    /// The moved cell's area.
    Cell,
    /// det(I + D^2 p) by differences at the cell's centre. Where areas jump it does not follow all the way.
    Determinant,
}

impl Measure {
    /// How much the potential answers to the cells' areas, and not to its Laplacian.
    fn response(self) -> f64 {
        match self {
            Self::Cell => 0.99,
            Self::Determinant => 0.0,
        }
    }
}

struct Transport<'a> {
    lattice: &'a Lattice,
    frame: Frame,
    measure: Measure,
    poisson: Poisson,
}

/// Moves the nodes so that the cells have `areas`, or as near as they can without folds.
pub(super) fn transport(lattice: &Lattice, areas: &[f64], frame: Frame, watch: Watch) -> Result<Moved, Interrupted> {
    watch.reserve(areas.len() * BYTES_PER_CELL)?;
    if frame == Frame::Pin {
        watch.reserve(areas.len() * KEPT_BYTES_PER_CELL)?;
    }
    let mut steps = 0;
    let mut attempt = |transport: &Transport, exponent: f64, done: f64| {
        watch.progress(done)?;
        let (positions, taken) = transport.solve(&tempered(areas, exponent), watch)?;
        steps += taken;
        let certificate = certify(lattice, &positions, watch)?;
        let moved = Moved { positions, certificate, exponent, steps };
        Ok((certificate.folds == 0).then_some(moved))
    };
    let exact = Transport::new(lattice, frame, Measure::Cell);
    if let Some(moved) = attempt(&exact, 1.0, 0.0)? {
        return Ok(moved);
    }
    drop(exact);
    let forgiving = Transport::new(lattice, frame, Measure::Determinant);
    if let Some(moved) = attempt(&forgiving, 1.0, 0.1)? {
        return Ok(moved);
    }
    watch.reserve(areas.len() * KEPT_BYTES_PER_CELL)?;
    let (mut found, mut least, mut most) = (None, 0.0, 1.0);
    for halving in 0..HALVINGS {
        let middle = 0.5 * (least + most);
        match attempt(&forgiving, middle, 0.2 + 0.8 * halving as f64 / HALVINGS as f64)? {
            Some(moved) => (found, least) = (Some(moved), middle),
            None => most = middle,
        }
    }
    match found {
        Some(moved) => Ok(Moved { steps, ..moved }),
        None => {
            let positions = Positions::from_map(lattice, |p| p);
            let certificate = certify(lattice, &positions, watch)?;
            Ok(Moved { positions, certificate, exponent: 0.0, steps })
        }
    }
}

/// `areas` to a power, with a mean of 1.
fn tempered(areas: &[f64], exponent: f64) -> Vec<f64> {
    let mut tempered: Vec<f64> = match exponent {
        1.0 => areas.to_vec(),
        _ => areas.par_iter().map(|&area| libm::pow(area, exponent)).collect(),
    };
    let mean = mean_of(&tempered);
    tempered.iter_mut().for_each(|area| *area /= mean);
    tempered
}

/// The secant's memory: the state before this one, and how it was to change.
struct Secant {
    growth: Vec<f64>,
    change: Vec<f64>,
}

impl<'a> Transport<'a> {
    fn new(lattice: &'a Lattice, frame: Frame, measure: Measure) -> Self {
        Self { lattice, frame, measure, poisson: Poisson::new(lattice, frame, measure.response()) }
    }

    /// Positions for `areas` of mean 1, and the steps it took. With a pinned frame the nearest of all steps.
    fn solve(&self, areas: &[f64], watch: Watch) -> Result<(Positions, usize), Interrupted> {
        let zeros = || vec![0.0; areas.len()];
        let (mut growth, mut change, mut potential, mut spare) = (zeros(), zeros(), zeros(), zeros());
        let mut secant = Secant { growth: zeros(), change: zeros() };
        let mut positions = Positions::from_map(self.lattice, |p| p);
        let mut nearest = None;
        for step in 0..STEPS {
            watch.go_on()?;
            let worst = self.changes(areas, &positions, &potential, &growth, &mut change);
            if self.frame == Frame::Pin && nearest.as_ref().is_none_or(|(least, _)| worst < *least) {
                nearest = Some((worst, positions.clone()));
            }
            if worst <= TOLERANCE {
                return Ok((positions, step));
            }
            secant.advance(&mut growth, &mut change, step > 0);
            potential.copy_from_slice(&growth);
            self.poisson.solve(&mut potential, &mut spare);
            self.place(&potential, &mut positions);
        }
        Ok((nearest.map_or(positions, |(_, nearest)| nearest), STEPS))
    }

    /// How the growth of every cell, the Laplacian of the potential, is to change; gives the largest relative error.
    fn changes(
        &self,
        areas: &[f64],
        positions: &Positions,
        potential: &[f64],
        growth: &[f64],
        change: &mut [f64],
    ) -> f64 {
        let [columns, _] = self.lattice.cells();
        let rows = change.par_chunks_mut(columns).zip(areas.par_chunks(columns).zip(growth.par_chunks(columns)));
        let errors = rows.enumerate().map(|(row, (change, (areas, growth)))| {
            match self.measure {
                Measure::Cell => row_areas(self.lattice, positions, row, change),
                Measure::Determinant => self.row_determinants(potential, row, change),
            }
            let mut worst = 0.0;
            for ((change, area), growth) in change.iter_mut().zip(areas).zip(growth) {
                let (missing, trace) = (area - *change, 2.0 + growth);
                let error = missing.abs() / area;
                worst = if error > worst { error } else { worst };
                *change = (trace * trace + 4.0 * missing).max(0.0).sqrt() - trace;
            }
            worst
        });
        let worst = errors.reduce(|| 0.0, f64::max);
        let mean = sums(change.len(), |part| [change[part].iter().sum()])[0] / change.len() as f64;
        change.par_chunks_mut(CHUNK).for_each(|values| values.iter_mut().for_each(|value| *value -= mean));
        worst
    }

    /// Determinants at the centres of a row of cells.
    fn row_determinants(&self, potential: &[f64], row: usize, out: &mut [f64]) {
        let ([columns, rows], [dx, dy]) = (self.lattice.cells(), self.lattice.spacing);
        let line = |row: usize| &potential[row * columns..][..columns];
        let [(above, _), (_, below)] = [row, row + 1].map(|node| self.beside(node, rows));
        let (above, here, below) = (line(above), line(row), line(below));
        for (column, out) in out.iter_mut().enumerate() {
            let [(left, _), (_, right)] = [column, column + 1].map(|node| self.beside(node, columns));
            let xx = (here[left] - 2.0 * here[column] + here[right]) / (dx * dx);
            let yy = (above[column] - 2.0 * here[column] + below[column]) / (dy * dy);
            let xy = (below[right] - below[left] - above[right] + above[left]) / (4.0 * dx * dy);
            *out = (1.0 + xx) * (1.0 + yy) - xy * xy;
        }
    }

    /// The cells before and after a node, of `count` in a row.
    fn beside(&self, node: usize, count: usize) -> (usize, usize) {
        match self.frame {
            Frame::Periodic => ((node + count - 1) % count, node % count),
            Frame::Slide | Frame::Pin => (node.saturating_sub(1), node.min(count - 1)),
        }
    }

    /// Moves the nodes by the gradient of the potential at the cells around them.
    fn place(&self, potential: &[f64], positions: &mut Positions) {
        let ([columns, rows], [nodes, _]) = (self.lattice.cells(), self.lattice.nodes);
        let [per_x, per_y] = self.lattice.spacing.map(|spacing| 0.5 / spacing);
        let lines = positions.x.par_chunks_mut(nodes).zip(positions.y.par_chunks_mut(nodes));
        lines.enumerate().for_each(|(row, (x, y))| {
            let (above, below) = self.beside(row, rows);
            let [above, below] = [above, below].map(|row| &potential[row * columns..][..columns]);
            let slopes = |left: usize, right: usize| {
                let (falling, rising) = (below[right] - above[left], below[left] - above[right]);
                [(falling - rising) * per_x, (falling + rising) * per_y]
            };
            for node in 0..nodes {
                let (left, right) = self.beside(node, columns);
                [x[node], y[node]] = slopes(left, right);
            }
            self.put(row, x, y);
        });
        if self.frame == Frame::Periodic {
            self.close(positions);
        }
    }

    /// Adds rest positions to the displacements of a row of nodes, which a pinned frame holds back.
    fn put(&self, row: usize, x: &mut [f64], y: &mut [f64]) {
        let [columns, rows] = self.lattice.cells();
        let pinned = self.frame == Frame::Pin;
        let reach = (columns.min(rows) / BANDS).max(1);
        let held = |node: usize, count: usize| {
            let part = node.min(count - node).min(reach) as f64 / reach as f64;
            part * part * (3.0 - 2.0 * part)
        };
        let along_row = if pinned { held(row, rows) } else { 1.0 };
        for (node, (x, y)) in x.iter_mut().zip(y).enumerate() {
            let [rest_x, rest_y] = self.lattice.rest(node, row);
            *x = rest_x + *x * along_row;
            *y = rest_y + if pinned { *y * held(node, columns) } else { *y };
        }
    }

    /// Makes the last column and row the first ones, a period further.
    fn close(&self, positions: &mut Positions) {
        let ([nodes, _], [width, height]) = (self.lattice.nodes, self.lattice.size());
        for (x, y) in positions.x.chunks_mut(nodes).zip(positions.y.chunks_mut(nodes)) {
            (x[nodes - 1], y[nodes - 1]) = (x[0] + width, y[0]);
        }
        let last = positions.x.len() - nodes;
        for node in 0..nodes {
            positions.x[last + node] = positions.x[node];
            positions.y[last + node] = positions.y[node] + height;
        }
    }
}

impl Secant {
    /// Changes the growth; from the second step on by as much less of the last step as the change still points its way.
    ///
    /// D. G. Anderson, "Iterative Procedures for Nonlinear Integral Equations", J. ACM 12, 1965 (one step back).
    fn advance(&mut self, growth: &mut Vec<f64>, change: &mut Vec<f64>, is_known: bool) {
        let Self { growth: last_growth, change: last_change } = self;
        let [along, length] = sums(change.len(), |part| {
            let turns = change[part.clone()].iter().zip(&last_change[part]).map(|(now, last)| (now - last, now));
            turns.fold([0.0; 2], |[along, length], (turn, now)| [along + turn * now, length + turn * turn])
        });
        let back = if is_known && length > 0.0 { along / length } else { 0.0 };
        let last = last_growth.par_chunks_mut(CHUNK).zip(last_change.par_chunks(CHUNK));
        last.zip(growth.par_chunks(CHUNK).zip(change.par_chunks(CHUNK))).for_each(|(last, now)| {
            for ((last_growth, last_change), (growth, change)) in
                last.0.iter_mut().zip(last.1).zip(now.0.iter().zip(now.1))
            {
                *last_growth = growth + change - back * (growth - *last_growth + change - last_change);
            }
        });
        std::mem::swap(last_growth, growth);
        std::mem::swap(last_change, change);
    }
}

/// Sums over `count` numbers that `of` makes of a part of them, added in order.
fn sums<const N: usize>(count: usize, of: impl Fn(Range<usize>) -> [f64; N] + Sync) -> [f64; N] {
    let part = |part: usize| of(part * CHUNK..count.min((part + 1) * CHUNK));
    let parts: Vec<[f64; N]> = (0..count.div_ceil(CHUNK)).into_par_iter().map(part).collect();
    parts.into_iter().fold([0.0; N], |sum, part| std::array::from_fn(|at| sum[at] + part[at]))
}
