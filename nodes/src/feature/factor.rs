use std::sync::Arc;
use std::time::{Duration, Instant};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use smart_default::SmartDefault;
use warploom_algo::feature::{self, FeatureCells};
use warploom_algo::lattice::Lattice;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Factor, Grid, Hasher, Kind, Labels, Mask, Rect, Windows};

use super::Prepared;
use crate::adapt::{lattice, view, watch, watched};

/// Prepares the solver that keeps features in shape: the expensive part, which no change of the warp touches.
///
/// A cell belongs to a feature if it holds the centre of one of its pixels; where it holds several, to the one with the
/// lowest label. Features on the border slide or are free one by one: each border node of theirs costs time with
/// `Slide`, as each feature does with `exact`.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureFactor {
    /// Lattice to solve on; not a periodic one.
    pub grid: In<Grid>,
    /// The features, each with a label.
    pub features: In<Labels>,
    /// Softens the weight: on a feature's cells the weight above 1 is multiplied by the mean of this mask over the
    /// cell's pixels. Around features the weight is not softened.
    pub soft: Option<In<Mask>>,
    /// How much more a feature's shape counts than the rest of the picture.
    #[default(10.0)]
    #[schemars(range(min = 0.001, max = 1000.0), extend("x-soft" = [1.0, 100.0]))]
    pub weight: f64,
    /// How far the weight reaches beyond a feature, smoothly falling; 0 ends it sharply.
    #[default(2.0)]
    #[schemars(range(min = 0.0, max = 64.0), extend("x-unit" = "cells", "x-soft" = [0.0, 8.0]))]
    pub radius: f64,
    /// What the lattice's border does where it meets a feature; elsewhere it stays where the warp puts it.
    pub boundary: Boundary,
    /// Whether features keep their shape exactly, not only as far as their weight goes. Features that touch are then
    /// one, and cannot differ in what FeatureWarp overrides.
    pub exact: Exact,
    /// Features with a weight of their own.
    pub overrides: Vec<WeightOverride>,
}

/// What the lattice's border does where it meets a feature.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Boundary {
    /// It stays where the warp puts it.
    #[default]
    Pin,
    /// It slides along the warp's border; the lattice's corners stay.
    Slide,
    /// It moves freely.
    Free,
}

/// Whether features keep their shape exactly.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Exact {
    /// As nearly as their weight makes them.
    #[default]
    Off,
    /// Exactly, turned and scaled as fits best.
    Similarity,
    /// Exactly, turned as the warp turns them, at their own size or at a scale that FeatureWarp overrides.
    Rigid,
}

/// The weight of one feature.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
#[schemars(extend("default" = WeightOverride::default()))]
pub struct WeightOverride {
    /// Its label.
    #[default(1)]
    #[schemars(range(min = 1))]
    pub label: u32,
    /// How much more its shape counts than the rest of the picture.
    #[default(10.0)]
    #[schemars(range(min = 0.001, max = 1000.0), extend("x-soft" = [1.0, 100.0]))]
    pub weight: f64,
}

/// What to do where nothing holds the picture.
const MEND: &str = "use boundary: Slide, or widen the picture's border with Lattice(overscan: ..)";

impl Node for FeatureFactor {
    const VERSION: u32 = 3;
    const OUTPUTS: &'static [Output] = &[Output::new("factor", Kind::Factor)];
    const CPU_FAMILY: bool = true;

    fn check(&self) -> Result<(), NodeError> {
        super::once_each(self.overrides.iter().map(|wish| wish.label).collect())
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (grid, labels) = (cx.get(&self.grid), cx.get(&self.features));
        if grid.periodic != [false, false] {
            let error = NodeError::refused("the lattice is periodic; the solver pins its border to the warp");
            return Err(error.at("grid").hint("use a Lattice with periodic: None"));
        }
        let known: Vec<u32> = labels.table.iter().map(|row| row.label).collect();
        super::check_labels(self.overrides.iter().map(|wish| wish.label), &known)?;
        let lattice = lattice(&grid);
        let start = Instant::now();
        let (cells, soft) = self.cells(cx, &lattice, &labels)?;
        let structure = self.structure(&grid, &cells, soft.as_deref(), &known).finish();
        let (factor, setup) = self.factored(cx, &grid, &cells, soft.as_deref(), start)?;
        let factored = start.elapsed();
        let unknowns = factor.unknowns();
        let feature_cells = cells.labels.iter().filter(|&&label| label != 0).count();
        let merged: Vec<Vec<u32>> = factor.merged().map(<[u32]>::to_vec).collect();
        let value = Factor {
            grid: *grid,
            structure,
            bytes: factor.bytes() as u64,
            summary: self.summary(unknowns, feature_cells),
            solver: Arc::new(Prepared { factor, labels: known }),
        };
        Ok(Outputs::from(value)
            .stat("unknowns", unknowns)
            .stat("feature_cells", feature_cells)
            .stat("cells_of_several_labels", cells.mixed)
            .stat("pixels_outside_the_lattice", cells.outside)
            .stat("merged", merged)
            .warning(self.soft_doubt(cx, &lattice, &labels))
            .stat("seconds_setup", setup.as_secs_f64())
            .stat("seconds_factor", (factored - setup).as_secs_f64()))
    }
}

impl FeatureFactor {
    /// The label of every cell of the lattice, and how much of it the soft mask covers.
    fn cells(
        &self,
        cx: &Context,
        lattice: &Lattice,
        labels: &Labels,
    ) -> Result<(FeatureCells, Option<Vec<f64>>), NodeError> {
        let cell_count = lattice.node_count() as u128;
        cx.reserve(cell_count * size_of::<u32>() as u128)?;
        let data = labels.raster.windows.data;
        let (samples, x0, y0) = (view(&labels.raster.samples), data.x0.into(), data.y0.into());
        let cells = watched(cx, |watch| feature::feature_cells(lattice, samples, x0, y0, watch))?;
        let Some(soft) = cx.get_optional(&self.soft) else {
            return Ok((cells, None));
        };
        cx.reserve(cell_count * size_of::<f64>() as u128)?;
        let data = soft.0.windows.data;
        let (samples, x0, y0) = (view(&soft.0.samples), data.x0.into(), data.y0.into());
        let coverage = watched(cx, |watch| feature::cell_coverage(lattice, samples, x0, y0, watch))?;
        Ok((cells, Some(coverage)))
    }

    /// What is to be said of a soft mask that lies elsewhere than the features.
    fn soft_doubt(&self, cx: &Context, lattice: &Lattice, labels: &Labels) -> Option<String> {
        let Windows { display, data, .. } = cx.get_optional(&self.soft)?.0.windows;
        let features = labels.raster.windows.display;
        let of = |Rect { x0, y0, x1, y1 }: Rect| format!("x from {x0} to {x1} and y from {y0} to {y1}");
        let ([left, top], [width, height]) = (lattice.origin, lattice.size());
        let [x0, y0, x1, y1] = [data.x0, data.y0, data.x1, data.y1].map(f64::from);
        let is_beside = x1 <= left || x0 >= left + width || y1 <= top || y0 >= top + height;
        if is_beside || data.is_empty() {
            let pixels = if data.is_empty() { "has no pixels".into() } else { format!("covers {}", of(data)) };
            return Some(format!("the soft mask {pixels}, nothing of the lattice: no feature keeps a weight above 1"));
        }
        (display != features).then(|| {
            let (its, theirs) = (of(display), of(features));
            format!("the soft mask's format is {its}, the features' {theirs}: make both from one picture")
        })
    }

    /// The factor, and how long after `start` its system was set up.
    fn factored(
        &self,
        cx: &Context,
        grid: &Grid,
        cells: &FeatureCells,
        soft: Option<&[f64]>,
        start: Instant,
    ) -> Result<(feature::FeatureFactor, Duration), NodeError> {
        let weights: Vec<_> = self.overrides.iter().map(|wish| (wish.label, wish.weight)).collect();
        let structure = feature::Structure {
            lattice: &lattice(grid),
            cells,
            weight: self.weight,
            weights: &weights,
            soft,
            radius: self.radius,
            boundary: self.boundary.into(),
            exact: self.exact.into(),
        };
        let at_work = watch(cx);
        let system = feature::setup(&structure, &at_work).map(|system| (system, start.elapsed()));
        let factor = system.and_then(|(system, setup)| Ok((feature::factor(system, &at_work)?, setup)));
        factor.map_err(|error| super::refusal(error, MEND, grid, at_work))
    }

    fn summary(&self, unknowns: usize, feature_cells: usize) -> serde_json::Value {
        json!({
            "kind": "Factor",
            "solver": "feature-aware",
            "unknowns": unknowns,
            "feature_cells": feature_cells,
            "weight": self.weight,
            "radius": self.radius,
            "boundary": self.boundary,
            "exact": self.exact,
        })
    }

    /// All that the factor is made of, and nothing else.
    fn structure(&self, grid: &Grid, cells: &FeatureCells, soft: Option<&[f64]>, known: &[u32]) -> Hasher {
        let mut structure = Hasher::new("feature factor");
        structure.digest(&grid.digest()).numbers(&[self.weight, self.radius]);
        structure.int(self.boundary as i128).int(self.exact as i128);
        cells.labels.iter().for_each(|&label| {
            structure.int(label.into());
        });
        structure.int(self.overrides.len() as i128);
        self.overrides.iter().for_each(|wish| {
            structure.int(wish.label.into()).numbers(&[wish.weight]);
        });
        structure.int(soft.is_some().into());
        let feature_cells = |soft: &'_ [f64]| -> Vec<f64> {
            let of_features = soft.iter().zip(&cells.labels).filter(|(_, label)| **label != 0);
            of_features.map(|(covered, _)| *covered).collect()
        };
        structure.numbers(&soft.map(feature_cells).unwrap_or_default());
        known.iter().for_each(|&label| {
            structure.int(label.into());
        });
        structure
    }
}

impl From<Boundary> for feature::Boundary {
    fn from(boundary: Boundary) -> Self {
        match boundary {
            Boundary::Pin => Self::Pin,
            Boundary::Slide => Self::Slide,
            Boundary::Free => Self::Free,
        }
    }
}

impl From<Exact> for feature::Exact {
    fn from(exact: Exact) -> Self {
        match exact {
            Exact::Off => Self::Off,
            Exact::Similarity => Self::Similarity,
            Exact::Rigid => Self::Rigid,
        }
    }
}
