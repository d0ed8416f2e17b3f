use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::detail::{self, Settings, SimilarSets};
use warploom_algo::lattice::Positions;
use warploom_algo::resample;
use warploom_algo::transfer;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{BufferMut, Factor, Image, Kind, Layer, Warp};

use crate::adapt::{lattice, map, positions, solver, view, view_mut, watched, window};
use crate::image::colour::{colour, with_planes};

/// Gives a warped picture the detail that it lacks where the warp magnified it.
///
/// Where the magnification (of areas) exceeds 1.02, fully from 1.15 on, each pixel of R, G and B, or Y, of the first layer
/// is taken from the training picture, so that surroundings are alike; then the result is moved until blurring it gives
/// back the warped picture. Colour is made anew as it is before it is multiplied by alpha; alpha and all else pass through. `stats` tells the pixels made anew, the blur that the
/// training picture was compared through, and how far the blurred result is from the warped picture, encoded, root mean
/// square, before (`residual_taken`) and after (`residual`) it was moved.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Detail {
    /// The warped picture.
    pub image: In<Image>,
    /// The warp that it was drawn through: where it magnifies, and where pixels come from.
    pub warp: In<Warp>,
    /// What detail looks like, prepared by SimilarSets: the picture before the warp, or another.
    #[schemars(extend("x-maker" = "SimilarSets"))]
    pub sets: In<Factor>,
    /// How pixels of the training picture are found.
    pub method: Method,
    /// How much better a pixel must fit that does not continue its neighbours' patch.
    #[default(1.0)]
    #[schemars(range(min = 0.0, max = 100.0), extend("x-soft" = [0.0, 25.0]))]
    pub coherence: f64,
    /// Standard deviation of the blur that detail is missing by; by the magnification if not given.
    #[schemars(range(min = 0.0, max = 8.0), extend("x-unit" = "px"))]
    pub blur: Option<f64>,
    /// How often the result is moved towards one that blurred is the warped picture.
    #[default(3)]
    #[schemars(range(min = 0, max = 100), extend("x-soft" = [0, 10]))]
    pub back_projections: u32,
}

/// How pixels of the training picture are found.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Method {
    /// All at once, from coarse to fine, from where the warp says on.
    #[default]
    Coherent,
    /// One after the other in raster order, as Image Analogies was published; slow.
    Analogies,
}

impl Node for Detail {
    const VERSION: u32 = 3;
    const OUTPUTS: &'static [Output] = &[Output::new("image", Kind::Image)];

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (image, warp, factor) = (cx.get(&self.image), cx.get(&self.warp), cx.get(&self.sets));
        let sets: &SimilarSets = solver(&factor, "sets", "SimilarSets")?;
        let layer = image.primary();
        let (names, planes) = colour(layer, "image")?;
        let (width, height) = (layer.data.width(), layer.data.height());
        let mut origins = self.origins(cx, &warp, layer)?;
        cx.reserve((width * height * size_of::<f32>()) as u128)?;
        let magnification = watched(cx, |watch| detail::magnification(&origins, width, watch))?;
        let [left, top] = factor.grid.origin;
        origins.translate([-left, -top]);
        let mut out = cx.planes(3, width, height)?;
        let outs = out.iter_mut().map(view_mut).collect::<Vec<_>>().try_into().expect("three planes");
        let straight = super::straight(cx, layer, names)?;
        let colour = straight.as_ref().map_or(planes, |(_, straight)| straight.each_ref());
        let (views, settings) = (colour.map(view), self.settings());
        let done = watched(cx, |watch| detail::detail(sets, &views, &magnification, &origins, &settings, outs, watch))?;
        if let Some((alpha, straight)) = &straight {
            for ((out, before), premultiplied) in out.iter_mut().zip(straight).zip(planes) {
                view_mut(out).par_rows(|y, row| {
                    transfer::premultiply_changed(row, before.row(y), premultiplied.row(y), alpha.row(y));
                });
            }
        }
        let made = out.into_iter().map(BufferMut::freeze);
        Ok(Outputs::from(with_planes(&image, names, made))
            .stat("pixels", done.pixels)
            .stat("blur", done.blur)
            .stat("residual_taken", done.residual[0])
            .stat("residual", done.residual[1]))
    }
}

impl Detail {
    fn settings(&self) -> Settings {
        let method = match self.method {
            Method::Coherent => detail::Method::Coherent,
            Method::Analogies => detail::Method::Analogies,
        };
        let (blur, back_projections) = (self.blur, self.back_projections as usize);
        Settings { method, coherence: self.coherence, blur, back_projections }
    }

    /// Where each pixel of the layer comes from.
    fn origins(&self, cx: &Context, warp: &Warp, layer: &Layer) -> Result<Positions, NodeError> {
        let (lattice, positions) = (lattice(&warp.grid), positions(cx, warp)?);
        let (map, window) = (map(warp.direction, &lattice, &positions), window(&layer.data));
        watched(cx, |watch| resample::pixel_sources(&map, window, watch))
    }
}
