use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::Watch;
use warploom_algo::feature::{self, guard::Verdict};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Direction, Factor, Kind, Value, Warp};

use super::Prepared;
use crate::adapt::{self, check_lattice, positions, watch};

/// Makes a warp keep features in shape while the rest of the picture follows it (Gal, Sorkine, Cohen-Or 2006).
///
/// The lattice's border stays where the warp puts it, unless the factor says otherwise. `components` is a JSON table,
/// a row for every feature: its label, the largest distance of its nodes from the similarity next to what became of
/// it (in mean cell sizes), that similarity's scale and rotation (positive clockwise), and `mirrored` if it mirrors.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureWarp {
    /// The warp to rectify; on the lattice that the factor was made for.
    pub warp: In<Warp>,
    /// The prepared solver.
    #[schemars(extend("x-maker" = "FeatureFactor"))]
    pub factor: In<Factor>,
    /// What a feature may do.
    pub mode: Mode,
    /// Features that may do something else. Exact ones that touch must be given the same.
    pub overrides: Vec<ModeOverride>,
    /// Whether the cells around a feature are asked for less and less of what the feature does. Without it only their
    /// weight falls.
    pub blend: bool,
    /// What features that are kept exactly do on a border that does not move freely.
    pub on_conflict: OnConflict,
    /// Whether cells may fold.
    pub guard: Guard,
    /// What gives way where features do not fit without folding cells.
    pub when_it_does_not_fit: Fit,
    /// Largest distance of a node from the exact solution.
    #[default(1e-6)]
    #[schemars(range(min = 1e-9, max = 0.1), extend("x-unit" = "cells", "x-soft" = [1e-9, 0.01]))]
    pub tolerance: f64,
}

/// What a feature may do.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Mode {
    /// Turn, and take one scale from the warp: where it stretches, the smaller of the two. A scale below 0.001 becomes
    /// 0.001: there the feature comes out larger than in the warp, even if the warp keeps its shape.
    #[default]
    Similarity,
    /// Turn, and keep its size.
    Rigid,
}

/// What features that are kept exactly do on a border that does not move freely.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum OnConflict {
    /// Their nodes on the border stay with it; the others keep the shape. Cells that fold all the same are left to the
    /// guard.
    #[default]
    NoFold,
    /// All their nodes keep the shape, on the border and in the lattice's corners too.
    KeepShape,
}

/// Whether cells may fold.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Guard {
    /// No: a warp that folds is repaired, for certain where the one to rectify does not fold and features may bend
    /// (exact ones may not with `KeepShape`). Where no repair succeeds `guard.reached` in the stats is false, and the
    /// warp that folds is kept unless a repair leaves fewer folds and none worse.
    #[default]
    Certified,
    /// Yes; folds are counted.
    Off,
}

/// What gives way where features do not fit without folding cells.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Fit {
    /// The size of all features, by one factor; their shape where no size helps.
    #[default]
    Shrink,
    /// Their shape.
    Bend,
}

/// What one feature may do.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
#[schemars(extend("default" = ModeOverride::default()))]
pub struct ModeOverride {
    /// Its label.
    #[default(1)]
    #[schemars(range(min = 1))]
    pub label: u32,
    /// What it may do.
    pub mode: Option<Mode>,
    /// Its scale, whatever the mode.
    #[schemars(range(min = 0.001, max = 1000.0), extend("x-soft" = [0.1, 10.0]))]
    pub scale: Option<f64>,
}

/// What to do where nothing holds the picture.
const MEND: &str = "use on_conflict: NoFold, or widen the picture's border with Lattice(overscan: ..)";

/// Bytes per lattice node beside the warp's positions and the solve: fluxes, the result, what is held still, and how
/// each node may move.
const BYTES_PER_NODE: u128 = 104;

impl Node for FeatureWarp {
    const VERSION: u32 = 5;
    const OUTPUTS: &'static [Output] = &[Output::new("warp", Kind::Warp), Output::new("components", Kind::Text)];
    const CPU_FAMILY: bool = true;

    fn check(&self) -> Result<(), NodeError> {
        super::once_each(self.overrides.iter().map(|wish| wish.label).collect())
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (warp, factor) = (cx.get(&self.warp), cx.get(&self.factor));
        let Prepared { factor: solver, labels } = adapt::solver(&factor, "factor", "FeatureFactor")?;
        check_warp(&warp, &factor)?;
        super::check_labels(self.overrides.iter().map(|wish| wish.label), labels)?;
        let overrides: Vec<_> = self.overrides.iter().map(|&wish| feature::Override::from(wish)).collect();
        let targets = feature::Targets {
            mode: self.mode.into(),
            overrides: &overrides,
            blend: self.blend,
            on_conflict: self.on_conflict.into(),
            ..feature::Targets::default()
        };
        let tolerance = self.tolerance * (warp.grid.spacing[0] + warp.grid.spacing[1]) / 2.0;
        cx.reserve(warp.grid.node_count() as u128 * BYTES_PER_NODE)?;
        let start = Instant::now();
        let input = positions(cx, &warp)?;
        let at_work = watch(cx);
        let prepared = feature::rhs(solver, &input, &targets, &at_work).map(|rhs| (rhs, start.elapsed()));
        let solved = prepared.and_then(|(rhs, prepared)| Ok((self.solve(&rhs, tolerance, &at_work)?, prepared)));
        let ((solved, guarded), prepared) = solved.map_err(|error| super::refusal(error, MEND, &warp.grid, at_work))?;
        let seconds = start.elapsed();
        let rows = serde_json::Value::Array(solved.features.iter().map(super::report::component).collect());
        let verdict = guarded.as_ref().map(|verdict| super::report::guarded(verdict, &warp.grid, &solved.positions));
        let unreached = guarded.as_ref().zip(verdict.as_ref()).and_then(|(v, told)| super::report::unreached(v, told));
        let mut outputs = crate::warp::certified(cx, &warp.grid, solved.positions)?;
        outputs.values.push(Value::Text(rows.to_string().into()));
        Ok(outputs
            .stat("unknowns", solver.unknowns())
            .stat("residual", solved.residual)
            .stat("seconds_rhs", prepared.as_secs_f64())
            .stat("seconds_solve", (seconds - prepared).as_secs_f64())
            .warning(unreached)
            .warning(self.conflict(&solved.conflicts))
            .stat("guard", verdict)
            .stat("conflicts", solved.conflicts)
            .stat("components", rows))
    }
}

impl FeatureWarp {
    /// What is to be said of exact features with these labels, which touch a border that does not move freely.
    fn conflict(&self, labels: &[u32]) -> Option<String> {
        let keeps_to_the_border = self.on_conflict == OnConflict::NoFold && !labels.is_empty();
        keeps_to_the_border.then(|| {
            format!(
                "exact features keep to the border where they touch it, not to their shape (labels {}); \
                 use on_conflict: KeepShape here, or boundary: Free in the FeatureFactor",
                super::numbers(labels)
            )
        })
    }

    fn solve(
        &self,
        rhs: &feature::Rhs,
        tolerance: f64,
        watch: Watch,
    ) -> Result<(feature::FeatureWarp, Option<Verdict>), feature::Error> {
        Ok(match self.guard {
            Guard::Certified => {
                let (solved, guarded) =
                    feature::solve_certified(rhs, self.when_it_does_not_fit.into(), tolerance, watch)?;
                (solved, Some(guarded))
            }
            Guard::Off => (feature::solve(rhs, tolerance, watch)?, None),
        })
    }
}

fn check_warp(warp: &Warp, factor: &Factor) -> Result<(), NodeError> {
    if warp.direction != Direction::DstFromSrc {
        return Err(NodeError::refused("the warp says where pixels come from, not where they go")
            .at("warp")
            .hint("turn it round with Invert(gives: OtherWay)"));
    }
    check_lattice(warp, "warp", &factor.grid, "the factor")?;
    crate::warp::refuse_holes(warp, "warp")
}

impl From<Mode> for feature::Mode {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::Similarity => Self::Similarity,
            Mode::Rigid => Self::Rigid,
        }
    }
}

impl From<Fit> for feature::guard::Fit {
    fn from(fit: Fit) -> Self {
        match fit {
            Fit::Shrink => Self::Shrink,
            Fit::Bend => Self::Bend,
        }
    }
}

impl From<OnConflict> for feature::OnConflict {
    fn from(on_conflict: OnConflict) -> Self {
        match on_conflict {
            OnConflict::NoFold => Self::NoFold,
            OnConflict::KeepShape => Self::KeepShape,
        }
    }
}

impl From<ModeOverride> for feature::Override {
    fn from(wish: ModeOverride) -> Self {
        Self { label: wish.label, mode: wish.mode.map(Into::into), scale: wish.scale }
    }
}
