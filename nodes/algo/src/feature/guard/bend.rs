//! Bending features until nothing folds.

use super::barrier::Barrier;
use super::boundary::crossing;
use super::coarse::Coarse;
use super::functional::{difference, moved};
use super::newton::{Judge, Newton};
use super::shape::{Shape, exact_cross, in_single_precision};
use super::start::{Start, mean_jacobian};
use super::system::{Blocks, System};
use super::{Error, Freedom, Functional};
use crate::Watch;
use crate::lattice::{Positions, border};
use crate::room::Room;
use crate::steps::Span;

/// Most steps of Newton's method.
const STEPS: usize = 200;

/// The barrier is felt below this share of the start's Jacobian, or of 1.
const REACH: f64 = 0.1;

/// The barrier's strength by the largest conductance, which is twice the largest squared weight.
const STRENGTH: f64 = 0.05;

/// Part of the work that is done once a start without folds is known,
const LIFTED: f64 = 0.3;

/// and part of the rest once the halved lattice is bent.
const HALVED: f64 = 0.3;

/// Untangling gives up after so many rounds in a row that lift the lowest corner by next to nothing.
const VAIN_ROUNDS: usize = 5;

pub(super) struct Bend<'a> {
    pub(super) functional: &'a Functional<'a>,
    pub(super) shape: &'a Shape,
    pub(super) literal: &'a Positions,
    pub(super) floor: f64,
}

impl Bend<'_> {
    /// The repaired warp and the steps it took; where no start without folds was found, the best that was.
    pub(super) fn bend(&self, start: Start, room: &mut Room, watch: Watch) -> Result<(Positions, usize), Error> {
        let functional = self.functional;
        let Some(mut system) = System::new(functional.lattice.nodes, functional.freedom, 0, room, watch)? else {
            return Ok((functional.base.clone(), 0));
        };
        let blocks = Blocks::new(functional);
        let (from, lifting) = match start {
            Start::Free { positions, .. } => (positions, 0),
            Start::Folded { combination } => {
                let (positions, steps) =
                    self.untangle(&combination, &blocks, &mut system, &Span::new(watch, 0.0, LIFTED))?;
                if self.shape.least_exactly(&positions) < 3.0 * self.floor {
                    return Ok((self.best_folded(positions), steps));
                }
                (positions, steps)
            }
        };
        let judge = self.judge(&from);
        let (x, steps) =
            self.descend(&from, Some(&judge), &blocks, &mut system, room, &Span::new(watch, LIFTED, 1.0))?;
        Ok((self.best(x, from, &judge), lifting + steps))
    }

    /// Goes down from the lowest point known on the way from `from`, which does not fold.
    fn descend(
        &self,
        from: &Positions,
        judge: Option<&Judge>,
        blocks: &Blocks,
        system: &mut System,
        room: &mut Room,
        watch: Watch,
    ) -> Result<(Positions, usize), Error> {
        let mut x = self.towards(from, self.literal, judge, 0.9, self.level()).unwrap_or_else(|| from.clone());
        if let Some(other) = self.halved_start(from, judge, system.bytes, room, &Span::new(watch, 0.0, HALVED))?
            && self.functional.energy(&other) < self.functional.energy(&x)
        {
            x = other;
        }
        let level = self.level();
        let mut reach = vec![f64::INFINITY; self.shape.corner_count()];
        for (number, corner) in self.shape.movable() {
            reach[number] = f64::max(REACH * self.shape.jacobian(from, corner).min(1.0), 2.0 * level);
        }
        let barrier = self.barrier(level, reach);
        let mut newton = Newton { functional: self.functional, barrier, blocks, system };
        let steps = newton.descend(&mut x, judge, STEPS, &Span::new(watch, HALVED, 1.0))?;
        Ok((x, steps))
    }

    /// What the halved lattice comes to, brought back to this one as far as nothing folds.
    ///
    /// * `before`: bytes that are held beside it meanwhile.
    fn halved_start(
        &self,
        from: &Positions,
        judge: Option<&Judge>,
        before: usize,
        room: &mut Room,
        watch: Watch,
    ) -> Result<Option<Positions>, Error> {
        let Some(coarse) = Coarse::new(self.functional) else {
            return Ok(None);
        };
        let functional = coarse.functional();
        let (shape, literal) = (Shape::new(functional.lattice, functional.freedom), coarse.injected(self.literal));
        let below = Bend { functional: &functional, shape: &shape, literal: &literal, floor: self.floor };
        let start = coarse.injected(from);
        if shape.least(&start) < 2.0 * below.level() {
            return Ok(None);
        }
        let Some(mut system) = System::new(functional.lattice.nodes, functional.freedom, before, room, watch)? else {
            return Ok(None);
        };
        let (x, _) = below.descend(&start, None, &Blocks::new(&functional), &mut system, room, watch)?;
        Ok(self.towards(from, &coarse.prolonged(&start, &x, from), judge, 0.99, self.level()))
    }

    /// Rounding in single precision counts where the start survives it.
    fn judge(&self, from: &Positions) -> Judge<'_> {
        let single = self.shape.least_exactly(&in_single_precision(from)) >= self.floor;
        Judge { shape: self.shape, floor: self.floor, single }
    }

    /// The barrier's level: the floor, and as much more as rounding to single precision takes, up to twice the floor.
    fn level(&self) -> f64 {
        let Functional { lattice, base, .. } = self.functional;
        let largest = base.x.iter().chain(&base.y).fold(0.0, |most, value| f64::max(most, value.abs()));
        let unit = largest * f64::from(f32::EPSILON);
        let lost = 4.0 * unit * (lattice.spacing[0] + lattice.spacing[1]) / self.shape.area;
        self.floor + lost.clamp(1e-3 * self.floor, self.floor)
    }

    fn barrier(&self, level: f64, reach: Vec<f64>) -> Barrier<'_> {
        let strength = STRENGTH * self.functional.stiffest() * self.shape.area;
        Barrier { shape: self.shape, strength, level, reach }
    }

    /// The point at `part` of the last stretch on the way with all corners at or above `level`, or before it.
    fn towards(
        &self,
        from: &Positions,
        to: &Positions,
        judge: Option<&Judge>,
        part: f64,
        level: f64,
    ) -> Option<Positions> {
        let step = difference(from, to);
        let [low, high] = self.shape.last_stretch(from, &step, level)?;
        let mut back = f64::max(1.0 - part, 1e-12);
        while back < 1.0 {
            let x = moved(from, &step, high - back * (high - low));
            if judge.is_none_or(|judge| judge.accepts(&x)) {
                return Some(x);
            }
            back *= 1.6;
        }
        None
    }

    /// The bent warp, or a point between base and literal solution where that does better or its boundary is simple.
    fn best(&self, bent: Positions, from: Positions, judge: &Judge) -> Positions {
        let border = border(self.functional.lattice.nodes);
        let slides = self.functional.freedom.iter().any(|freedom| matches!(freedom, Freedom::Along(_)));
        let mut candidates = vec![bent];
        candidates.extend(self.towards(self.functional.base, self.literal, Some(judge), 1.0, self.floor));
        candidates.sort_by(|a, b| self.functional.energy(a).total_cmp(&self.functional.energy(b)));
        if slides && crossing(&from, &border).is_none() {
            candidates.push(from);
            candidates.retain(|x| crossing(x, &border).is_none());
        }
        candidates.swap_remove(0)
    }

    /// Lifts the lowest corner from the best warp there is: the barrier's level follows it from below.
    fn untangle(
        &self,
        combination: &Positions,
        blocks: &Blocks,
        system: &mut System,
        watch: Watch,
    ) -> Result<(Positions, usize), Error> {
        let least = |x: &&Positions| self.shape.least(x);
        let best =
            [self.functional.base, combination, self.literal].into_iter().max_by(|a, b| least(a).total_cmp(&least(b)));
        let mut x = best.expect("three").clone();
        let aim = REACH * mean_jacobian(self.functional).min(1.0);
        let (mut lowest, mut steps, mut vain) = (self.shape.least(&x), 0, 0);
        while steps < STEPS && vain < VAIN_ROUNDS && lowest < 4.0 * self.floor && lowest.is_finite() {
            let barrier = self.barrier(lowest - 0.1 * (aim - lowest), vec![aim; self.shape.corner_count()]);
            let mut newton = Newton { functional: self.functional, barrier, blocks, system: &mut *system };
            let part = |steps: usize| steps as f64 / STEPS as f64;
            let done = newton.descend(&mut x, None, 2, &Span::new(watch, part(steps), part(steps + 2)))?;
            let lifted = self.shape.least(&x);
            vain = if lifted - lowest > 1e-2 * (aim - lowest) { 0 } else { vain + 1 };
            (lowest, steps) = (lifted, steps + done.max(1));
        }
        Ok((x, steps))
    }

    /// Of the untangled warp, the base and the literal solution that with the fewest corners folded, and those least.
    fn best_folded(&self, untangled: Positions) -> Positions {
        let rank = |x: &Positions| {
            let folds = self.shape.movable().filter(|&(_, corner)| exact_cross(x, corner) <= 0.0).count();
            (folds, self.shape.least(x))
        };
        let mut best = (rank(&untangled), untangled);
        for x in [self.functional.base, self.literal] {
            let found = rank(x);
            if found.0 < best.0.0 || (found.0 == best.0.0 && found.1 > best.0.1) {
                best = (found, x.clone());
            }
        }
        best.1
    }
}
