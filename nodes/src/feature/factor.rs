use std::sync::Arc;
use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use smart_default::SmartDefault;
use warploom_algo::feature;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Factor, Grid, Hasher, Kind, Labels};

use crate::adapt::{lattice, view, watch, watched};

/// Prepares the solver that keeps features in shape: the expensive part, which no change of the warp touches.
///
/// A cell belongs to a feature if it holds the centre of one of its pixels; where it holds several, to the one with the
/// lowest label.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureFactor {
    /// Lattice to solve on; not a periodic one.
    pub grid: In<Grid>,
    /// The features, each with a label.
    pub features: In<Labels>,
    /// How much more a feature's shape counts than the rest of the picture.
    #[default(10.0)]
    #[schemars(range(min = 0.001, max = 1000.0), extend("x-soft" = [1.0, 100.0]))]
    pub weight: f64,
    /// How far the weight reaches beyond a feature, smoothly falling; 0 ends it sharply.
    #[default(2.0)]
    #[schemars(range(min = 0.0, max = 64.0), extend("x-unit" = "cells", "x-soft" = [0.0, 8.0]))]
    pub radius: f64,
}

impl Node for FeatureFactor {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("factor", Kind::Factor)];
    const CPU_FAMILY: bool = true;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (grid, labels) = (cx.get(&self.grid), cx.get(&self.features));
        if grid.periodic != [false, false] {
            let error = NodeError::refused("the lattice is periodic; the solver pins its border to the warp");
            return Err(error.at("grid").hint("use a Lattice with periodic: None"));
        }
        cx.reserve(grid.node_count() as u128 * size_of::<u32>() as u128)?;
        let lattice = lattice(&grid);
        let start = Instant::now();
        let data = labels.raster.windows.data;
        let (samples, x0, y0) = (view(&labels.raster.samples), data.x0.into(), data.y0.into());
        let cells = watched(cx, |watch| feature::feature_cells(&lattice, samples, x0, y0, watch))?;
        let mut structure = Hasher::new("feature factor");
        structure.digest(&grid.digest()).numbers(&[self.weight, self.radius]);
        cells.labels.iter().for_each(|&label| {
            structure.int(label.into());
        });
        let system = watched(cx, |watch| feature::setup(&lattice, &cells, self.weight, self.radius, watch))?;
        let setup = start.elapsed();
        let at_work = watch(cx);
        let factor = feature::factor(system, &at_work).map_err(|error| super::refusal(error, at_work))?;
        let factored = start.elapsed();

        let unknowns = factor.unknowns();
        let feature_cells = cells.labels.iter().filter(|&&label| label != 0).count();
        let value = Factor {
            grid: *grid,
            structure: structure.finish(),
            bytes: factor.bytes() as u64,
            summary: json!({
                "kind": "Factor",
                "solver": "feature-aware",
                "unknowns": unknowns,
                "feature_cells": feature_cells,
                "weight": self.weight,
                "radius": self.radius,
            }),
            solver: Arc::new(factor),
        };
        Ok(Outputs::from(value)
            .stat("unknowns", unknowns)
            .stat("feature_cells", feature_cells)
            .stat("cells_of_several_labels", cells.mixed)
            .stat("pixels_outside_the_lattice", cells.outside)
            .stat("seconds_setup", setup.as_secs_f64())
            .stat("seconds_factor", (factored - setup).as_secs_f64()))
    }
}
