use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use smart_default::SmartDefault;
use warploom_algo::detail;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs, Reads};
use warploom_core::value::{Factor, Grid, Hasher, Image, Kind};

use crate::adapt::{view, watched};
use crate::image::colour::{COLOUR, Encoding, colour};

/// Prepares a training picture for Detail: for each pixel, others whose surroundings are alike.
///
/// This depends on the training picture alone: no change of a warp touches it. It looks at R, G and B, or Y, of the first
/// layer, before they are multiplied by alpha.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct SimilarSets {
    /// Picture that shows what detail looks like: the one that is warped, or another.
    pub image: In<Image>,
    /// What is compared of its samples and of those that detail is made for.
    pub encoding: Encoding,
    /// Levels of its pyramid: how far around a pixel structure is seen.
    #[default(3)]
    #[schemars(range(min = 1, max = 8))]
    pub levels: u32,
}

impl Node for SimilarSets {
    const VERSION: u32 = 2;
    const OUTPUTS: &'static [Output] = &[Output::new("sets", Kind::Factor)];

    fn reads(&self, _: &str) -> Reads {
        Reads::Channels(COLOUR.concat().into_iter().chain(["A"]).map(str::to_owned).collect())
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let image = cx.get(&self.image);
        let layer = image.primary();
        let (names, planes) = colour(layer, "image")?;
        let straight = super::straight(cx, layer, names)?;
        let views = straight.as_ref().map_or(planes, |(_, straight)| straight.each_ref()).map(view);
        let sets =
            watched(cx, |watch| detail::similar_sets(&views, self.encoding.into(), self.levels as usize, watch))?;
        let grid = Grid {
            origin: [layer.data.x0.into(), layer.data.y0.into()],
            spacing: [1.0, 1.0],
            nodes: [layer.data.width().max(1) + 1, layer.data.height().max(1) + 1],
            periodic: [false, false],
        };
        let mut structure = Hasher::new("similar sets");
        structure.digest(&grid.digest()).int(self.levels.into()).int(self.encoding as i128);
        for channel in names.iter().chain(&["A"]).filter_map(|name| layer.channel(name)) {
            structure.digest(&channel.digest());
        }
        let [width, height] = sets.size();
        let value = Factor {
            grid,
            structure: structure.finish(),
            bytes: sets.bytes() as u64,
            summary: json!({ "kind": "Factor", "solver": "similar-sets", "width": width, "height": height }),
            solver: Arc::new(sets),
        };
        Ok(value.into())
    }
}
