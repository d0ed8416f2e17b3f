//! Poisson's equation on the nodes of a lattice: conductances on the edges, values given on some nodes.
//!
//! Minimise `sum over edges e = (p, q) of c_e (x_q - x_p)^2 - 2 phi_e (x_q - x_p)` over the nodes that are not pinned.
//! The normal equations are `L x = div phi`, L the weighted five-point Laplacian, with the pinned values eliminated. L
//! depends on the conductances alone, so one factor serves any number of fluxes and pinned values.

mod direct;
mod multigrid;
mod sine;
mod substitute;

#[cfg(test)]
mod tests;

use crate::lattice::is_on_border;
use crate::simd::vectorized;
use crate::{Interrupted, Watch};
use direct::Cholesky;
use faer::sparse::FaerError;
use multigrid::Multigrid;
use rayon::prelude::*;
use sine::Sine;

/// Solutions are refined once when their relative residual is above this. Below it a million nodes of a weight-10
/// system are good to about 1e-9 cells.
const REFINE_ABOVE: f64 = 1e-12;

/// A factor whose probe keeps a relative residual above this is refused, and so is a solution.
const PROBE_LIMIT: f64 = 1e-9;

/// Nodes on a side, and unknowns, from which multigrid is used.
const MULTIGRID_SIDE: usize = 32;
const MULTIGRID_UNKNOWNS: usize = 60_000;

/// Least conductance over the largest one that multigrid is used for.
const MULTIGRID_RANGE: f64 = 0.5e-4;

/// Maxima taken side by side.
const LANES: usize = 16;

/// Right-hand sides solved for together by the direct backend.
const BLOCK: usize = 64;

/// Why a Laplacian was not factored or a system not solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Error {
    /// The watch stopped it.
    Interrupted,
    /// The factor needs more entries than its index type counts.
    TooLarge,
    /// The memory for the factor or for a solution was refused.
    OutOfMemory,
    /// The conductances do not make the Laplacian positive definite.
    NotPositiveDefinite,
    /// What was found for a system, or for the probe of a factor, does not solve it, however often it was refined.
    Inaccurate {
        /// Its relative residual; NaN where it is not a number.
        residual: f64,
    },
}

impl From<Interrupted> for Error {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

impl From<FaerError> for Error {
    fn from(error: FaerError) -> Self {
        match error {
            FaerError::IndexOverflow => Self::TooLarge,
            _ => Self::OutOfMemory,
        }
    }
}

/// One number for every edge of a lattice of C x R nodes, row-major; edges point right and down.
#[derive(Clone, Debug, PartialEq)]
pub struct Edges {
    /// (C - 1) * R of them: `[r * (C - 1) + c]` leads from node (c, r) to node (c + 1, r).
    pub horizontal: Vec<f64>,
    /// C * (R - 1) of them: `[r * C + c]` leads from node (c, r) to node (c, r + 1).
    pub vertical: Vec<f64>,
}

impl Edges {
    /// Zero on every edge of a lattice of `nodes` columns and rows, at least 1 each.
    pub fn zeros([columns, rows]: [usize; 2]) -> Self {
        Self { horizontal: vec![0.0; (columns - 1) * rows], vertical: vec![0.0; columns * (rows - 1)] }
    }

    fn assert_shape(&self, [columns, rows]: [usize; 2]) {
        assert_eq!(self.horizontal.len(), (columns - 1) * rows, "horizontal edges of {columns} x {rows} nodes");
        assert_eq!(self.vertical.len(), columns * (rows - 1), "vertical edges of {columns} x {rows} nodes");
    }
}

/// An edge: its index among those of its direction, and the nodes it leads from and to.
pub(crate) type Edge = (usize, usize, usize);

/// The horizontal edges of a lattice.
pub(crate) fn horizontal_edges([columns, rows]: [usize; 2]) -> impl Iterator<Item = Edge> {
    (0..(columns - 1) * rows).map(move |e| (e, e + e / (columns - 1), e + e / (columns - 1) + 1))
}

/// Its vertical edges.
pub(crate) fn vertical_edges([columns, rows]: [usize; 2]) -> impl Iterator<Item = Edge> {
    (0..columns * (rows - 1)).map(move |e| (e, e, e + columns))
}

/// The nodes whose values are given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Pins {
    /// Those of the first and last column and row.
    Frame,
    /// Those marked, row-major; at least one.
    Nodes(Vec<bool>),
}

impl Pins {
    fn holds(&self, node: usize, nodes: [usize; 2]) -> bool {
        match self {
            Self::Frame => is_on_border(nodes, node),
            Self::Nodes(pinned) => pinned[node],
        }
    }

    /// Sets the values of a node array to 0, those on pins (`on_pins`) or the others.
    fn clear(&self, on_pins: bool, values: &mut [f64], [columns, rows]: [usize; 2]) {
        match self {
            Self::Frame => values.chunks_mut(columns).enumerate().for_each(|(row, values)| {
                let whole = row == 0 || row + 1 == rows;
                let inner = if whole || columns < 3 { 0..0 } else { 1..columns - 1 };
                if !on_pins {
                    values[inner].fill(0.0);
                } else if inner.is_empty() {
                    values.fill(0.0);
                } else {
                    (values[0], values[columns - 1]) = (0.0, 0.0);
                }
            }),
            Self::Nodes(pinned) => {
                values
                    .iter_mut()
                    .zip(pinned)
                    .filter(|(_, pinned)| **pinned == on_pins)
                    .for_each(|(value, _)| *value = 0.0);
            }
        }
    }
}

/// The weighted five-point Laplacian of a lattice, the values on its pins given.
#[derive(Clone, Debug)]
pub struct GridLaplacian {
    nodes: [usize; 2],
    conductances: Edges,
    pins: Pins,
}

/// A factored Laplacian: solves for any fluxes and any values on the pins.
#[derive(Debug)]
pub struct Factor {
    laplacian: GridLaplacian,
    backend: Backend,
}

#[derive(Debug)]
enum Backend {
    /// Every node is pinned.
    Nothing,
    Direct(Box<Cholesky>),
    Sine(Sine),
    Multigrid(Box<Multigrid>),
}

type GoOn<'a> = &'a dyn Fn() -> Result<(), Interrupted>;

/// Adds to fields the solutions for right-hand sides, which it may overwrite.
type AddSolutions<'a> = &'a dyn Fn(&mut [Vec<f64>], &mut [Vec<f64>], GoOn) -> Result<(), Error>;

/// Node values that solve the systems they were asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// One array of node values per right-hand side, row-major.
    pub fields: Vec<Vec<f64>>,
    /// Largest |b - A x| over largest |b| of the normal equations, the worst of the right-hand sides; 0 where b = 0.
    pub residual: f64,
}

impl GridLaplacian {
    /// The Laplacian of the given conductances.
    ///
    /// `(L x)_i = sum over neighbours j of c_ij (x_i - x_j)` for the nodes i that are not pinned.
    ///
    /// * `nodes`: columns and rows, at least 1 each.
    /// * `conductances`: finite and positive; those between two pinned nodes do not matter.
    /// * `pins`: the nodes whose values are given; a mask has one entry per node, at least one of them true.
    ///
    /// Keeps the arrays; nothing is computed.
    pub fn new(nodes: [usize; 2], conductances: Edges, pins: Pins) -> Self {
        conductances.assert_shape(nodes);
        if let Pins::Nodes(pinned) = &pins {
            assert_eq!(pinned.len(), nodes[0] * nodes[1], "pins of {} x {} nodes", nodes[0], nodes[1]);
            assert!(pinned.contains(&true), "no node is pinned");
        }
        Self { nodes, conductances, pins }
    }

    /// Count of nodes that are not pinned.
    pub fn unknowns(&self) -> usize {
        match &self.pins {
            Pins::Frame => self.nodes[0].saturating_sub(2) * self.nodes[1].saturating_sub(2),
            Pins::Nodes(pinned) => pinned.iter().filter(|pinned| !**pinned).count(),
        }
    }

    /// The conductances it was made of.
    pub fn conductances(&self) -> &Edges {
        &self.conductances
    }

    /// The nodes whose values are given.
    pub fn pins(&self) -> &Pins {
        &self.pins
    }

    /// Factors the Laplacian for repeated solves.
    ///
    /// Direct: `P L P^T = G G^T` in f64, P a nested dissection of the lattice; then a probe: a constant on the pins and
    /// no flux must be solved for. Sine, for lattices pinned on their frame whose horizontal conductances are all equal
    /// and whose vertical ones are, both positive: sines across and elimination down. Multigrid, for lattices pinned on
    /// their frame with at least 60,000 unknowns, 32 nodes a side and conductances within a factor of 20,000 of each
    /// other: the hierarchy of coarser lattices.
    ///
    /// * `watch`: called between the phases; a phase runs to its end. Asked for all memory, for the factor's once its
    ///   entries are counted.
    ///
    /// Where all nodes are pinned there is nothing to solve for and nothing is factored. Conductances that are not
    /// finite and positive give `NotPositiveDefinite` or `Inaccurate`. One thread, so the bits do not depend on the
    /// thread count. Direct: time O(n^1.5) and memory O(n log n) for n unknowns, half a GB held at a million.
    /// Sine: linear, 8 bytes a node held. Multigrid: linear, 32 bytes a node held.
    pub fn factor(self, watch: Watch) -> Result<Factor, Error> {
        let backend = match self.unknowns() {
            0 => Backend::Nothing,
            _ if self.is_even() => Backend::Sine(Sine::new(&self, watch)?),
            _ if self.suits_multigrid() => Backend::Multigrid(Box::new(Multigrid::new(&self, watch)?)),
            _ => Backend::Direct(Box::new(Cholesky::new(&self, watch)?)),
        };
        let factor = Factor { laplacian: self, backend };
        if let Backend::Direct(_) = factor.backend {
            factor.probe(watch)?;
        }
        Ok(factor)
    }

    /// Whether it is pinned on its frame and the same everywhere.
    fn is_even(&self) -> bool {
        let (mut horizontal, mut vertical) = self.inner();
        let usable = |first: Option<&f64>| first.is_some_and(|first| *first > 0.0 && first.is_finite());
        let (across, down) = (horizontal.next(), vertical.next());
        self.pins == Pins::Frame
            && usable(across)
            && usable(down)
            && horizontal.all(|c| Some(c) == across)
            && vertical.all(|c| Some(c) == down)
    }

    /// The horizontal and the vertical conductances off the frame.
    fn inner(&self) -> (impl Iterator<Item = &f64>, impl Iterator<Item = &f64>) {
        let [columns, rows] = self.nodes;
        let Edges { horizontal, vertical } = &self.conductances;
        let horizontal = horizontal.get(columns - 1..(columns - 1) * (rows - 1)).unwrap_or_default().iter();
        (horizontal, vertical.chunks(columns).flat_map(move |row| row.get(1..columns - 1).unwrap_or_default()))
    }

    /// Whether multigrid serves it better than a factor: a wide lattice pinned on its frame, its conductances within
    /// the range of single precision.
    fn suits_multigrid(&self) -> bool {
        let off_frame = self.pins == Pins::Frame && self.nodes[0].min(self.nodes[1]) >= MULTIGRID_SIDE;
        let inner = || {
            let (horizontal, vertical) = self.inner();
            horizontal.chain(vertical)
        };
        off_frame && self.unknowns() >= MULTIGRID_UNKNOWNS && {
            let least = self.stiffest() * MULTIGRID_RANGE;
            inner().all(|c| *c >= least && c.is_finite())
        }
    }

    /// The largest conductance at an unknown; NaN where one is.
    fn stiffest(&self) -> f64 {
        if self.pins == Pins::Frame {
            let (horizontal, vertical) = self.inner();
            return horizontal.chain(vertical).fold(0.0, |most, c| larger(most, *c));
        }
        let matters = |&(_, from, to): &Edge| [from, to].iter().any(|&node| !self.pins.holds(node, self.nodes));
        let Edges { horizontal, vertical } = &self.conductances;
        let most = |edges: &mut dyn Iterator<Item = Edge>, c: &[f64]| {
            edges.filter(matters).fold(0.0, |most, (edge, ..)| larger(most, c[edge]))
        };
        let (across, down) = (&mut horizontal_edges(self.nodes), &mut vertical_edges(self.nodes));
        larger(most(across, horizontal), most(down, vertical))
    }

    /// `div (flux - c grad x)` at every node, 0 on the pins.
    fn residual(&self, flux: &Edges, x: &[f64]) -> Vec<f64> {
        let mut residual = vec![0.0; x.len()];
        let rows = residual.par_chunks_mut(self.nodes[0]).enumerate();
        rows.for_each(|(row, out)| self.residual_row(flux, x, row, out));
        self.pins.clear(true, &mut residual, self.nodes);
        residual
    }

    /// `div (flux - c grad x)` at the nodes of a row.
    fn residual_row(&self, flux: &Edges, x: &[f64], row: usize, out: &mut [f64]) {
        vectorized(
            #[inline(always)]
            || {
                let columns = out.len();
                let at = row * (columns - 1)..(row + 1) * (columns - 1);
                let (across, c) = (&flux.horizontal[at.clone()], &self.conductances.horizontal[at]);
                let here = &x[row * columns..(row + 1) * columns];
                let drop = |i: usize| across[i] - c[i] * (here[i + 1] - here[i]);
                (out[0], out[columns - 1]) = (0.0, 0.0);
                if columns > 1 {
                    out[0] -= drop(0);
                    out[columns - 1] += drop(columns - 2);
                    subtract_drops(&mut out[1..], across, c, here);
                }
                for (row, sign) in [(row.wrapping_sub(1), 1.0), (row, -1.0)] {
                    if row < self.nodes[1] - 1 {
                        let at = row * columns..(row + 1) * columns;
                        let below = &x[at.start + columns..at.end + columns];
                        let (along, c) = (&flux.vertical[at.clone()], &self.conductances.vertical[at.clone()]);
                        add_drops(out, sign, along, c, &x[at], below);
                    }
                }
            },
        );
    }
}

/// For the nodes of a row from the second to the last but one: what the edge from the left brings less what the one to
/// the right takes.
#[inline(always)]
fn subtract_drops(out: &mut [f64], flux: &[f64], c: &[f64], x: &[f64]) {
    let n = out.len() - 1;
    let (out, x) = (&mut out[..n], &x[..n + 2]);
    let (left_flux, left_c, flux, c) = (&flux[..n], &c[..n], &flux[1..][..n], &c[1..][..n]);
    for i in 0..n {
        out[i] = (left_flux[i] - left_c[i] * (x[i + 1] - x[i])) - (flux[i] - c[i] * (x[i + 2] - x[i + 1]));
    }
}

/// Adds `sign (flux - c (to - from))`.
#[inline(always)]
fn add_drops(out: &mut [f64], sign: f64, flux: &[f64], c: &[f64], from: &[f64], to: &[f64]) {
    let n = out.len();
    let (flux, c, from, to) = (&flux[..n], &c[..n], &from[..n], &to[..n]);
    for i in 0..n {
        out[i] += sign * (flux[i] - c[i] * (to[i] - from[i]));
    }
}

impl Factor {
    /// Solves for several fluxes and pinned values together.
    ///
    /// Minimises `sum of c_e (x_q - x_p)^2 - 2 phi_e (x_q - x_p)`: `A x = div phi - (the pins' share)`.
    ///
    /// * `fluxes`: phi, one per right-hand side.
    /// * `fields`: node values, one array of C * R per right-hand side; only those on pins are read.
    /// * `tolerance`: the largest error of a node value allowed against the exact solution, in the unit of the values,
    ///   positive. The direct and the sine backend always solve in full precision.
    /// * `watch`: called before every substitution.
    ///
    /// Direct: one refinement step follows where the relative residual is above 1e-12; time and memory traffic
    /// O(n log n) for n unknowns; right-hand sides are best given by the dozen, up to 64 are solved for together. The
    /// substitution runs on one thread. Sine: likewise, in O(n log n) and 16 bytes a node and right-hand side; its
    /// transforms run on the pool, the bits do not depend on the thread count. Both: `Inaccurate` where the residual
    /// stays above 1e-9 of what the numbers in it allow. Multigrid: one right-hand side at a time, conjugate gradients
    /// until the estimated error is within the tolerance, which the true one may exceed by half where weights of 100
    /// meet a tolerance that is no small part of the solution; `Inaccurate` where it does not get there; linear for a
    /// given tolerance, 21 bytes a node. Numbers that are not finite, and in multigrid those that single precision does
    /// not hold, are `Inaccurate` too. Where all nodes are pinned the fields are the result.
    pub fn solve(&self, fluxes: &[Edges], fields: &[&[f64]], tolerance: f64, watch: Watch) -> Result<Solution, Error> {
        let nodes = self.laplacian.nodes;
        assert_eq!(fluxes.len(), fields.len(), "fluxes and fields");
        assert!(tolerance > 0.0, "tolerance {tolerance}");
        fluxes.iter().for_each(|flux| flux.assert_shape(nodes));
        let count = nodes[0] * nodes[1];
        fields.iter().for_each(|field| assert_eq!(field.len(), count, "values of {} x {} nodes", nodes[0], nodes[1]));
        let together = fields.len().min(BLOCK);
        let scratch = match &self.backend {
            Backend::Nothing => 0,
            Backend::Direct(cholesky) => cholesky.solve_bytes(count, together),
            Backend::Sine(sine) => sine.solve_bytes(count, together),
            Backend::Multigrid(multigrid) => multigrid.solve_bytes(),
        };
        watch.reserve(fields.len() * count * size_of::<f64>() + scratch)?;
        let mut fields: Vec<Vec<f64>> = fields.iter().map(|field| field.to_vec()).collect();
        let residual = match &self.backend {
            Backend::Nothing => 0.0,
            Backend::Direct(cholesky) => {
                self.solve_in_blocks(fluxes, &mut fields, &|rest, x, _| cholesky.add_solutions(rest, x), watch)?
            }
            Backend::Sine(sine) => {
                self.solve_in_blocks(fluxes, &mut fields, &|rest, x, go_on| sine.add_solutions(rest, x, go_on), watch)?
            }
            Backend::Multigrid(multigrid) => self.solve_in_turn(multigrid, fluxes, &mut fields, tolerance, watch)?,
        };
        Ok(Solution { fields, residual })
    }

    /// Solves by multigrid for fields whose pinned values are set; gives the relative residual.
    fn solve_in_turn(
        &self,
        multigrid: &Multigrid,
        fluxes: &[Edges],
        fields: &mut [Vec<f64>],
        tolerance: f64,
        watch: Watch,
    ) -> Result<f64, Error> {
        fields.iter_mut().for_each(|field| self.laplacian.pins.clear(false, field, self.laplacian.nodes));
        let mut arrays = multigrid.arrays();
        let mut residual = 0.0;
        for (flux, field) in fluxes.iter().zip(fields) {
            residual = larger(residual, multigrid.solve(&self.laplacian, flux, field, tolerance, &mut arrays, watch)?);
        }
        Ok(residual)
    }

    /// Solves in full precision for fields whose pinned values are set; gives the relative residual.
    fn solve_in_blocks(
        &self,
        fluxes: &[Edges],
        fields: &mut [Vec<f64>],
        add_solutions: AddSolutions,
        watch: Watch,
    ) -> Result<f64, Error> {
        let blocks = fields.len().div_ceil(BLOCK);
        let mut residual = 0.0;
        for (block, (fluxes, fields)) in fluxes.chunks(BLOCK).zip(fields.chunks_mut(BLOCK)).enumerate() {
            let go_on = || watch.progress(block as f64 / blocks as f64);
            residual = larger(residual, self.solve_block(fluxes, fields, add_solutions, &go_on)?);
        }
        Ok(residual)
    }

    fn solve_block(
        &self,
        fluxes: &[Edges],
        fields: &mut [Vec<f64>],
        add_solutions: AddSolutions,
        go_on: GoOn,
    ) -> Result<f64, Error> {
        let residuals = |fields: &[Vec<f64>]| -> Vec<Vec<f64>> {
            fluxes.iter().zip(fields).map(|(flux, field)| self.laplacian.residual(flux, field)).collect()
        };
        fields.iter_mut().for_each(|field| self.laplacian.pins.clear(false, field, self.laplacian.nodes));
        let mut remainders = residuals(fields);
        let right_hand_sides: Vec<f64> = remainders.iter().map(|values| largest(values)).collect();
        let mut residual = f64::INFINITY;
        for _ in 0..2 {
            go_on()?;
            add_solutions(&mut remainders, fields, go_on)?;
            remainders = residuals(fields);
            let relative = |(rest, b): (&Vec<f64>, &f64)| if largest(rest) == 0.0 { 0.0 } else { largest(rest) / b };
            residual = remainders.iter().zip(&right_hand_sides).map(relative).fold(0.0, larger);
            if residual <= REFINE_ABOVE {
                break;
            }
        }
        let solved = || remainders.iter().zip(fluxes).zip(&*fields).all(|((rest, flux), x)| self.solves(rest, flux, x));
        if residual <= PROBE_LIMIT || solved() { Ok(residual) } else { Err(Error::Inaccurate { residual }) }
    }

    /// Whether a field leaves no more than rounding the numbers in its residual may: four fluxes, and four differences
    /// times a conductance.
    fn solves(&self, remainder: &[f64], flux: &Edges, field: &[f64]) -> bool {
        let flux = larger(largest(&flux.horizontal), largest(&flux.vertical));
        let reach = 4.0 * flux + 8.0 * self.laplacian.stiffest() * largest(field);
        largest(remainder) <= PROBE_LIMIT * reach.min(f64::MAX)
    }

    /// Count of unknowns: nodes that are not pinned.
    pub fn unknowns(&self) -> usize {
        self.laplacian.unknowns()
    }

    /// Bytes held, approximately: conductances and what the backend keeps.
    pub fn bytes(&self) -> usize {
        let Edges { horizontal, vertical } = &self.laplacian.conductances;
        let backend = match &self.backend {
            Backend::Nothing => 0,
            Backend::Direct(cholesky) => cholesky.bytes(),
            Backend::Sine(sine) => sine.bytes(),
            Backend::Multigrid(multigrid) => multigrid.bytes(),
        };
        backend + (horizontal.len() + vertical.len()) * size_of::<f64>()
    }

    /// The conductances of the Laplacian.
    pub fn conductances(&self) -> &Edges {
        &self.laplacian.conductances
    }

    /// The nodes whose values are given.
    pub fn pins(&self) -> &Pins {
        &self.laplacian.pins
    }

    /// How it solves, in one word.
    pub fn backend(&self) -> &'static str {
        match self.backend {
            Backend::Nothing => "none",
            Backend::Direct(_) => "direct",
            Backend::Sine(_) => "sine",
            Backend::Multigrid(_) => "multigrid",
        }
    }

    fn probe(&self, watch: Watch) -> Result<(), Error> {
        let nodes = self.laplacian.nodes;
        let constant = vec![1.0; nodes[0] * nodes[1]];
        let quiet: Watch = &|_: f64| watch.progress(0.9);
        let Solution { residual, .. } = self.solve(&[Edges::zeros(nodes)], &[&constant], 1e-6, quiet)?;
        if residual <= PROBE_LIMIT { Ok(()) } else { Err(Error::Inaccurate { residual }) }
    }
}

/// The larger one; NaN where one is.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if b.is_nan() || b > a { b } else { a }
}

/// Largest magnitude; NaN where there is one.
fn largest(values: &[f64]) -> f64 {
    let mut most = [0.0; LANES];
    vectorized(
        #[inline(always)]
        || {
            let runs = values.chunks_exact(LANES);
            most.iter_mut().zip(runs.remainder()).for_each(|(most, value)| *most = value.abs());
            for run in runs {
                most.iter_mut().zip(run).for_each(|(most, value)| *most = larger(*most, value.abs()));
            }
        },
    );
    most.into_iter().fold(0.0, larger)
}
