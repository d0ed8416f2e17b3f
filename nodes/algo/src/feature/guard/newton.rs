//! Newton's method on the functional with the barrier: every iterate keeps the floor.

use super::barrier::Barrier;
use super::functional::moved;
use super::shape::{Shape, in_single_precision};
use super::system::{Blocks, System};
use super::{Error, Functional};
use crate::Watch;
use crate::lattice::Positions;

/// It has converged where no node moves by more than this, mean cell sizes.
const CONVERGED: f64 = 1e-3;

/// It has settled where the energy falls by less than this part of all that it fell,
const SETTLED: f64 = 1e-6;

/// and where nobody judges what is a start for others only, by less than this.
const SETTLED_ROUGHLY: f64 = 1e-3;

/// Decides what counts as free of folds.
pub(super) struct Judge<'a> {
    pub(super) shape: &'a Shape,
    pub(super) floor: f64,
    /// Positions rounded to single precision must reach the floor too.
    pub(super) single: bool,
}

impl Judge<'_> {
    /// Every movable corner reaches the floor.
    pub(super) fn accepts(&self, x: &Positions) -> bool {
        let reaches = |x: &Positions| self.shape.least_exactly(x) >= self.floor;
        reaches(x) && (!self.single || reaches(&in_single_precision(x)))
    }
}

/// A functional with its barrier, and the system that its steps are solved with.
pub(super) struct Newton<'a> {
    pub(super) functional: &'a Functional<'a>,
    pub(super) barrier: Barrier<'a>,
    /// Second derivatives of the functional itself.
    pub(super) blocks: &'a Blocks,
    pub(super) system: &'a mut System,
}

/// What one step comes to.
struct Step {
    next: Positions,
    /// Of the node that moved farthest, px.
    movement: f64,
    /// Of the energy, barrier included.
    fall: f64,
}

impl Newton<'_> {
    /// Lowers the energy from `x`, whose corners lie above the barrier's level, by at most `steps` steps.
    ///
    /// With a judge, every iterate is one that it accepts. Gives the number of steps made; fewer than asked where the
    /// nodes or the energy hardly move any more, or nowhere.
    pub(super) fn descend(
        &mut self,
        x: &mut Positions,
        judge: Option<&Judge>,
        steps: usize,
        watch: Watch,
    ) -> Result<usize, Error> {
        let spacing = self.functional.lattice.spacing;
        let converged = CONVERGED * 0.5 * (spacing[0] + spacing[1]);
        let settled = if judge.is_some() { SETTLED } else { SETTLED_ROUGHLY };
        let mut fallen = 0.0;
        for done in 0..steps {
            watch.progress(done as f64 / steps as f64)?;
            let Some(Step { next, movement, fall }) = self.step(x, judge) else {
                return Ok(done);
            };
            *x = next;
            fallen += fall;
            if movement < converged || fall < settled * fallen {
                return Ok(done + 1);
            }
        }
        Ok(steps)
    }

    /// None where no step lowers the energy.
    fn step(&mut self, x: &Positions, judge: Option<&Judge>) -> Option<Step> {
        let mut gradient = self.functional.gradient(x);
        let slope_of = gradient.clone();
        let mut blocks = self.blocks.clone();
        self.barrier.add(x, &mut gradient, &mut blocks);
        let step = self.system.step(&blocks, &gradient)?;
        let slope = slope_of.iter().flatten().zip(step.iter().flatten()).map(|(g, s)| g * s).sum();
        let [mut t, fall] = self.barrier.line(x, &step, slope, self.functional.square(&step)).least()?;
        let length = step[0].iter().zip(&step[1]).map(|(x, y)| x.abs().max(y.abs())).fold(0.0, f64::max);
        for _ in 0..20 {
            let next = moved(x, &step, t);
            if judge.is_none_or(|judge| judge.accepts(&next)) {
                return Some(Step { next, movement: t * length, fall });
            }
            t *= 0.5;
        }
        None
    }
}
