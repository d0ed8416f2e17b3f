use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::{composite, similarity};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::schema::shown;
use warploom_core::value::{Buffer, BufferMut, Factor, Field, Kind, Mask, Raster, Rect};

use super::Prepared;
use crate::adapt::{point, solver, view, view_mut, watched};

/// How strongly an edit at a pixel is repeated at all pixels whose surroundings are similar.
///
/// The distance D of a pixel is the sum of the squared differences of codes of 0 to 255 over R, G and B, the neighbourhood
/// and the levels that SimilarityGuide prepared; of several points the nearest counts. The strength falls linearly,
/// strength * max(0, 1 - D / distance). Positive it is an opacity for Paint and Clone or a magnification for Magnify,
/// negative a contraction. The stats tell the `threshold` from which on it is 0.
///
/// D is exact to 16777216, then rounded to the nearest number of 32 bits.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Similarity {
    /// The picture whose pixels are compared, prepared by SimilarityGuide.
    #[schemars(extend("x-maker" = "SimilarityGuide"))]
    pub guide: In<Factor>,
    /// Selection points on the picture; each stands for the pixel that it lies in.
    #[schemars(extend("x-unit" = "px", "x-required" = true))]
    pub at: Vec<[f64; 2]>,
    /// The distance from which on nothing happens, 800000 if neither it nor `quantile` is given; 0 leaves identical
    /// surroundings alone. Levels and diameters make it larger: at most 8193150 with a diameter of 5 and two levels.
    #[schemars(range(min = 0.0, max = 1000000000.0), extend("x-soft" = [0.0, 2000000.0]))]
    pub distance: Option<f64>,
    /// The part of the picture's pixels that are nearer or as near, given instead of `distance`.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub quantile: Option<f64>,
    /// The strength at the selection points.
    #[default(1.0)]
    #[schemars(range(min = -1000.0, max = 1000.0), extend("x-soft" = [-1.0, 1.0]))]
    pub strength: f64,
    /// Where the strength may be other than 0: it is multiplied by this coverage. Distances and quantiles do not see it.
    pub within: Option<In<Mask>>,
}

/// The distance where none is given.
const DISTANCE: f64 = 800_000.0;

impl Node for Similarity {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("strength", Kind::Field), Output::new("distance", Kind::Field)];

    fn check(&self) -> Result<(), NodeError> {
        let none = self.at.is_empty().then(|| {
            let error = NodeError::refused("there are no selection points; at least one is needed");
            error.at("at").hint("give the centre of a pixel, such as [(0.5, 0.5)]")
        });
        let both = self.distance.zip(self.quantile).map(|(distance, part)| {
            let (distance, part) = (shown(distance), shown(part));
            let message = format!("a distance ({distance}) and a quantile ({part}) exclude each other");
            NodeError::refused(message).at("quantile").hint("leave one of them out")
        });
        NodeError::all([none, both].into_iter().flatten().map(Err))
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let factor = cx.get(&self.guide);
        let Prepared { guide, windows } = solver(&factor, "guide", "SimilarityGuide")?;
        let (data, [width, height]) = (windows.data, guide.size());
        let points = self.points(&data)?;
        let mut planes = cx.planes(2, width, height)?.into_iter();
        let mut plane = || -> BufferMut<f32> { planes.next().expect("one of two") };
        let (mut distance, mut strength) = (plane(), plane());
        watched(cx, |watch| similarity::distances(guide, &points, view_mut(&mut distance), watch))?;
        let distance = distance.freeze();
        let threshold = self.threshold(cx, &distance)?;
        similarity::opacity(view(&distance), threshold, self.strength as f32, view_mut(&mut strength));
        if let Some(within) = &self.within {
            let Mask(within) = &*cx.get(within);
            let [x0, y0] = [within.windows.data.x0, within.windows.data.y0].map(i64::from);
            let matte = composite::Plane::Samples(composite::Placed { view: view(&within.samples), x0, y0 });
            composite::within(matte, data.x0.into(), data.y0.into(), view_mut(&mut strength));
        }
        let field = |samples| Field(Raster { windows: *windows, samples });
        Ok(Outputs::new([field(strength.freeze()).into(), field(distance).into()]).stat("threshold", threshold))
    }
}

impl Similarity {
    /// The distance from which on nothing happens.
    fn threshold(&self, cx: &Context, distance: &Buffer<f32>) -> Result<f32, NodeError> {
        match self.quantile {
            Some(part) => watched(cx, |watch| similarity::quantile(view(distance), part, watch)),
            None => Ok(self.distance.unwrap_or(DISTANCE) as f32),
        }
    }

    /// The pixels that are selected, counted in the data window.
    fn points(&self, data: &Rect) -> Result<Vec<[usize; 2]>, NodeError> {
        let inside = |at: f64, start: i32, end: i32| {
            let at = at.floor();
            (at >= f64::from(start) && at < f64::from(end)).then(|| (at - f64::from(start)) as usize)
        };
        let pixel = |(index, &[x, y]): (usize, &[f64; 2])| {
            let Rect { x0, y0, x1, y1 } = *data;
            let found = inside(x, x0, x1).zip(inside(y, y0, y1)).map(|(column, row)| [column, row]);
            found.ok_or_else(|| {
                let message = format!(
                    "at[{index}] is {} px, outside the picture: x must be at least {x0} and less than {x1} px, y at least \
                     {y0} and less than {y1} px",
                    point([x, y])
                );
                NodeError::refused(message).at("at").hint("move it onto the picture")
            })
        };
        self.at.iter().enumerate().map(pixel).collect()
    }
}
