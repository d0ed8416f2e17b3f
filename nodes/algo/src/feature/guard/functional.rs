//! The functional that a feature-aware warp minimises.

use super::shape::Field;
use super::system::{Blocks, System};
use super::{Error, Freedom, Functional};
use crate::Watch;
use crate::lattice::Positions;
use crate::poisson::{self, Edge, Edges, horizontal_edges, vertical_edges};
use crate::room::Room;

impl Functional<'_> {
    /// `sum over edges of c |d_q - d_p|^2 - 2 phi . (d_q - d_p)` of the displacement d = x - base.
    ///
    /// Up to a constant the weighted squares of Gal, Sorkine and Cohen-Or, Equation 5; px^2, and negative where x does
    /// better than the base.
    ///
    /// * `x`: position of every node, px.
    ///
    /// O(nodes).
    pub fn energy(&self, x: &Positions) -> f64 {
        let d = self.displacement(x);
        let part = |of: fn(&Edges) -> &[f64], edges: &mut dyn Iterator<Item = Edge>| -> f64 {
            edges
                .map(|(e, from, to)| {
                    let delta = [d[0][to] - d[0][from], d[1][to] - d[1][from]];
                    let pull = [of(&self.fluxes[0])[e], of(&self.fluxes[1])[e]];
                    of(self.conductances)[e] * (delta[0] * delta[0] + delta[1] * delta[1])
                        - 2.0 * (pull[0] * delta[0] + pull[1] * delta[1])
                })
                .sum()
        };
        part(|edges| &edges.horizontal, &mut self.horizontal()) + part(|edges| &edges.vertical, &mut self.vertical())
    }

    /// Where the energy is least, the literal solution: one sparse Cholesky factorization of all free coordinates.
    ///
    /// The base where nothing may move. Fails where the conductances are not positive or nothing is pinned. It serves
    /// any [`Freedom`]; of pinned frames [`crate::poisson`] makes less work. O(n^1.5) time, O(n log n) memory.
    pub fn minimiser(&self, watch: Watch) -> Result<Positions, Error> {
        self.minimised(&mut Room::new(watch), watch)
    }

    pub(super) fn minimised(&self, room: &mut Room, watch: Watch) -> Result<Positions, Error> {
        let Some(mut system) = System::new(self.lattice.nodes, self.freedom, 0, room, watch)? else {
            return Ok(self.base.clone());
        };
        let step = system.step(&Blocks::new(self), &self.gradient(self.base));
        Ok(moved(self.base, &step.ok_or(poisson::Error::NotPositiveDefinite)?, 1.0))
    }

    /// `sum of c |s_q - s_p|^2`: the second order of the energy along a step.
    pub(super) fn square(&self, step: &Field) -> f64 {
        let part = |c: &[f64], edges: &mut dyn Iterator<Item = Edge>| -> f64 {
            edges
                .map(|(e, from, to)| {
                    let delta = [step[0][to] - step[0][from], step[1][to] - step[1][from]];
                    c[e] * (delta[0] * delta[0] + delta[1] * delta[1])
                })
                .sum()
        };
        let Edges { horizontal, vertical } = self.conductances;
        part(horizontal, &mut self.horizontal()) + part(vertical, &mut self.vertical())
    }

    /// The gradient of the energy at `x`.
    pub(super) fn gradient(&self, x: &Positions) -> Field {
        let d = self.displacement(x);
        let mut gradient = [vec![0.0; d[0].len()], vec![0.0; d[1].len()]];
        for ((gradient, d), flux) in gradient.iter_mut().zip(&d).zip(self.fluxes) {
            let mut add = |(c, phi): (f64, f64), from: usize, to: usize| {
                let pull = 2.0 * (c * (d[to] - d[from]) - phi);
                gradient[to] += pull;
                gradient[from] -= pull;
            };
            let Edges { horizontal, vertical } = self.conductances;
            self.horizontal().for_each(|(e, from, to)| add((horizontal[e], flux.horizontal[e]), from, to));
            self.vertical().for_each(|(e, from, to)| add((vertical[e], flux.vertical[e]), from, to));
        }
        gradient
    }

    /// The fluxes that ask for nothing but short edges: their solution is the convex combination map.
    pub(super) fn contraction(&self) -> [Edges; 2] {
        let Edges { horizontal, vertical } = self.conductances;
        [&self.base.x, &self.base.y].map(|base| {
            let pull = |c: f64, from: usize, to: usize| c * (base[from] - base[to]);
            Edges {
                horizontal: self.horizontal().map(|(e, from, to)| pull(horizontal[e], from, to)).collect(),
                vertical: self.vertical().map(|(e, from, to)| pull(vertical[e], from, to)).collect(),
            }
        })
    }

    /// The largest conductance of an edge with a node that is not pinned, 0 if there is none.
    pub(super) fn stiffest(&self) -> f64 {
        let pinned = |node: usize| matches!(self.freedom[node], Freedom::Pinned);
        let part = |c: &[f64], edges: &mut dyn Iterator<Item = Edge>| {
            edges.filter(|&(_, from, to)| !(pinned(from) && pinned(to))).map(|(e, ..)| c[e]).fold(0.0, f64::max)
        };
        let Edges { horizontal, vertical } = self.conductances;
        part(horizontal, &mut self.horizontal()).max(part(vertical, &mut self.vertical()))
    }

    fn displacement(&self, x: &Positions) -> Field {
        difference(self.base, x)
    }

    pub(super) fn horizontal(&self) -> impl Iterator<Item = Edge> + use<> {
        horizontal_edges(self.lattice.nodes)
    }

    pub(super) fn vertical(&self) -> impl Iterator<Item = Edge> + use<> {
        vertical_edges(self.lattice.nodes)
    }
}

/// The step from one to the other.
pub(super) fn difference(from: &Positions, to: &Positions) -> Field {
    let step = |from: &[f64], to: &[f64]| from.iter().zip(to).map(|(from, to)| to - from).collect();
    [step(&from.x, &to.x), step(&from.y, &to.y)]
}

/// `x + t step`; a node that the step does not move keeps its bits.
pub(super) fn moved(x: &Positions, step: &Field, t: f64) -> Positions {
    let add = |x: &[f64], step: &[f64]| x.iter().zip(step).map(|(x, step)| x + t * step).collect();
    Positions { x: add(&x.x, &step[0]), y: add(&x.y, &step[1]) }
}
