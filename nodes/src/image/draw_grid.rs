use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::composite::{self, Placed, Plane as Placement};
use warploom_algo::draw;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Image, Layer, Warp};

use super::Planes;
use super::colour::luma;
use crate::adapt::{positions, view, view_mut, watched};

/// Draws a warp's lattice over a picture: lines between the positions of neighbouring nodes.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct DrawGrid {
    /// Picture to draw on.
    pub image: In<Image>,
    /// Warp whose lattice is drawn.
    pub warp: In<Warp>,
    /// Each how many-th line is drawn; those at the border always.
    #[default(4)]
    #[schemars(range(min = 1, max = 65536), extend("x-unit" = "cells"))]
    pub every: u32,
    /// Width of the lines.
    #[default(1.5)]
    #[schemars(range(min = 0.01, max = 1000.0), extend("x-unit" = "px", "x-soft" = [0.5, 8.0]))]
    pub width: f64,
    /// Colour of the lines: red, green, blue and alpha, scene-linear and premultiplied.
    #[default([0.0, 0.6, 1.0, 1.0])]
    #[schemars(inner(range(min = -1000000.0, max = 1000000.0)))]
    pub color: [f64; 4],
}

impl Node for DrawGrid {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::IMAGE;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (image, warp) = (cx.get(&self.image), cx.get(&self.warp));
        let layer = image.primary();
        let data = layer.data.union(&image.display);
        let (x0, y0) = (data.x0.into(), data.y0.into());
        let mut coverage = cx.plane(data.width(), data.height())?;
        let (lines, every) = (positions(cx, &warp)?, self.every as usize);
        let out = view_mut(&mut coverage);
        watched(cx, |watch| draw::lattice_lines(&lines, warp.grid.nodes, every, self.width, x0, y0, out, watch))?;
        drop(lines);
        let coverage = coverage.freeze();
        let tinted = |factor: f64| -> Result<_, NodeError> {
            let mut plane = cx.plane(data.width(), data.height())?;
            composite::scale(view(&coverage), factor as f32, view_mut(&mut plane));
            Ok(plane.freeze())
        };
        let [r, g, b, a] = self.color;
        let luma = luma([r, g, b]);
        let alpha = tinted(a)?;
        let mut paints = Vec::new();
        for (name, value) in [("R", r), ("G", g), ("B", b), ("Y", luma), ("A", a)] {
            if layer.channel(name).is_some() {
                paints.push((name, tinted(value)?));
            }
        }
        let paint = |name: &str| paints.iter().find(|(painted, _)| *painted == name).map(|(_, plane)| plane);
        let placed = |plane| Placement::Samples(Placed { view: view(plane), x0, y0 });
        let channels = super::combined(
            &Planes { cx, reserved: false },
            &[layer],
            &data,
            |name| paint(name).is_some(),
            |name, out| {
                let front = paint(name).map_or(Placement::Zero, placed);
                composite::over(front, placed(&alpha), super::placement(layer, name), x0, y0, out);
            },
        )?;
        let mut layers = image.layers.clone();
        layers[0] = Layer { data, channels, ..layer.clone() };
        Ok(Image { layers, ..(*image).clone() }.into())
    }
}
