use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use smart_default::SmartDefault;
use warploom_algo::similarity::{self, Guide, coarsest};
use warploom_algo::view::View;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs, Reads};
use warploom_core::value::{Buffer, Digest, Factor, Grid, Hasher, Image, Kind};

use super::Prepared;
use crate::adapt::{view, watched};
use crate::image::colour::{COLOUR, Encoding, colour};

/// Prepares a picture for Similarity: its pyramid of codes.
///
/// This depends on the picture alone: another selection point leaves it as it is. It looks at R, G and B, or Y, of the
/// first layer, premultiplied as they are, as codes of 0 to 255: what is below 0 and NaN count as 0, what is above white
/// as 255. The pyramid's levels begin at the corner of the data window.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct SimilarityGuide {
    /// Picture whose pixels are compared.
    pub image: In<Image>,
    /// Diameter of the neighbourhoods, px of each level, odd: 21 pixels have a diameter of 5, 69 one of 9.
    #[default(5)]
    #[schemars(range(min = 1, max = 21), extend("x-unit" = "px"))]
    pub diameter: u32,
    /// Levels of the pyramid that are compared, each half as large as the one before; 0 is the picture.
    #[default(vec![0, 1])]
    #[schemars(inner(range(min = 0, max = 12)))]
    pub levels: Vec<u32>,
    /// What lies beyond the picture's border.
    pub boundary: Boundary,
    /// What is compared of its samples.
    pub encoding: Encoding,
    /// The sample that becomes the code 255.
    #[default(1.0)]
    #[schemars(range(min = 0.000001, max = 1000000.0), extend("x-soft" = [0.1, 100.0]))]
    pub white: f64,
}

/// What lies beyond a picture's border.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Boundary {
    /// The other side: for pictures that repeat.
    Wrap,
    /// The picture mirrored at its outermost pixels.
    #[default]
    Mirror,
    /// The outermost pixels.
    Clamp,
}

impl Node for SimilarityGuide {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("guide", Kind::Factor)];

    fn reads(&self, _: &str) -> Reads {
        Reads::Channels(COLOUR.concat().iter().map(|name| name.to_string()).collect())
    }

    fn check(&self) -> Result<(), NodeError> {
        let diameter = self.diameter;
        let even = diameter.is_multiple_of(2).then(|| {
            let error = NodeError::refused(format!("the diameter is {diameter} px; it must be odd, from 1 to 21 px"));
            error.at("diameter").hint(format!("use {} or {}", diameter - 1, diameter + 1))
        });
        let none = self.levels.is_empty().then(|| {
            NodeError::refused("there are no levels; at least one is needed")
                .at("levels")
                .hint("compare the picture: [0]")
        });
        let twice = self.levels.iter().enumerate().filter_map(|(index, level)| {
            let first = self.levels[..index].iter().position(|other| other == level)?;
            let error = NodeError::refused(format!("levels[{first}] and levels[{index}] are both {level}"));
            Some(error.at("levels").hint("name each level once"))
        });
        NodeError::all(even.into_iter().chain(none).chain(twice).map(Err))
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let image = cx.get(&self.image);
        let (layer, windows) = (image.primary(), image.windows());
        self.check_depth([layer.data.width(), layer.data.height()])?;
        let (names, planes) = colour(layer, "image")?;
        let guide = self.prepare(cx, planes)?;
        let grid = Grid {
            origin: [layer.data.x0.into(), layer.data.y0.into()],
            spacing: [1.0, 1.0],
            nodes: [layer.data.width().max(1) + 1, layer.data.height().max(1) + 1],
            periodic: [self.boundary == Boundary::Wrap; 2],
        };
        let channels = names.iter().map(|name| layer.channel(name).expect("it was found").digest());
        let ([width, height], diameter) = (guide.size(), self.diameter);
        let (solver, levels) = ("similarity", &self.levels);
        let value = Factor {
            grid,
            structure: self.structure(&windows.digest(), channels),
            bytes: guide.bytes() as u64,
            summary: json!({ "kind": "Factor", "solver": solver, "width": width, "height": height,
                "diameter": diameter, "levels": levels }),
            solver: Arc::new(Prepared { guide, windows }),
        };
        Ok(value.into())
    }
}

impl SimilarityGuide {
    fn check_depth(&self, size: [usize; 2]) -> Result<(), NodeError> {
        let ([width, height], coarsest) = (size, coarsest(size));
        let Some(index) = self.levels.iter().position(|level| *level > coarsest) else { return Ok(()) };
        let level = self.levels[index];
        let message =
            format!("levels[{index}] is {level}; a picture of {width} x {height} px has levels 0 to {coarsest}");
        Err(NodeError::refused(message).at("levels").hint("leave it out"))
    }

    fn prepare(&self, cx: &Context, planes: [&Buffer<f32>; 3]) -> Result<Guide, NodeError> {
        let boundary = match self.boundary {
            Boundary::Wrap => similarity::Boundary::Wrap,
            Boundary::Mirror => similarity::Boundary::Mirror,
            Boundary::Clamp => similarity::Boundary::Clamp,
        };
        let (width, height) = (planes[0].width(), planes[0].height());
        watched(cx, |watch| {
            let [r, g, b] =
                planes.map(|plane| similarity::codes(view(plane), self.encoding.into(), self.white as f32, watch));
            let codes = [r?, g?, b?];
            let views = codes.each_ref().map(|codes| View::packed(codes, width, height));
            similarity::guide(&views, self.diameter as usize, &self.levels, boundary, watch)
        })
    }

    fn structure(&self, windows: &Digest, channels: impl Iterator<Item = Digest>) -> Digest {
        let mut structure = Hasher::new("similarity guide");
        structure.digest(windows).int(self.diameter.into()).int(self.boundary as i128).int(self.encoding as i128);
        structure.number(self.white).int(self.levels.len() as i128);
        self.levels.iter().for_each(|level| {
            structure.int((*level).into());
        });
        channels.for_each(|channel| {
            structure.digest(&channel);
        });
        structure.finish()
    }
}
