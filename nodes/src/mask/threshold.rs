use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::mask;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs, Reads};
use warploom_core::value::{Buffer, Image, Plane};

use crate::adapt::{view, view_mut};

/// The pixels whose sample lies between two bounds.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Threshold {
    /// Picture to look at.
    pub image: In<Image>,
    /// A channel's name, or `luma`: Rec.709 of R, G and B, or Y where there is no colour.
    #[schemars(extend("x-required" = true))]
    pub channel: String,
    /// In are samples above this; none means no such bound.
    #[schemars(extend("x-soft" = [0.0, 1.0]))]
    pub above: Option<f64>,
    /// In are samples below this; none means no such bound.
    #[schemars(extend("x-soft" = [0.0, 1.0]))]
    pub below: Option<f64>,
}

const LUMA: &str = "luma";

impl Node for Threshold {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::MASK;

    fn reads(&self, _: &str) -> Reads {
        let names: &[&str] = if self.channel == LUMA { &["R", "G", "B", "Y"] } else { &[&self.channel] };
        Reads::Channels(names.iter().map(|name| name.to_string()).collect())
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let image = cx.get(&self.image);
        let samples = self.samples(cx, &image)?;
        let mask = super::drawn(cx, image.windows(), |out| {
            mask::threshold(view(&samples), self.above, self.below, view_mut(out));
            Ok(())
        })?;
        Ok(mask.into())
    }
}

impl Threshold {
    fn samples(&self, cx: &Context, image: &Image) -> Result<Buffer<f32>, NodeError> {
        let plane = |name: &str| match image.primary().channel(name).map(|channel| &channel.plane) {
            Some(Plane::F32(plane)) => Some(plane),
            _ => None,
        };
        if self.channel != LUMA {
            return plane(&self.channel).cloned().ok_or_else(|| match image.primary().channel(&self.channel) {
                Some(_) => NodeError::refused(format!("channel {} holds identities, not numbers", self.channel))
                    .at("channel")
                    .hint("name a channel of numbers, such as R, G, B, A or Y, or luma"),
                None => NodeError::refused(format!("the picture has no channel {}", self.channel))
                    .at("channel")
                    .hint("name one that it has, such as R, G, B, A or Y, or luma"),
            });
        }
        match (plane("R"), plane("G"), plane("B"), plane("Y")) {
            (Some(r), Some(g), Some(b), _) => {
                let mut luma = cx.plane(r.width(), r.height())?;
                mask::luma(view(r), view(g), view(b), view_mut(&mut luma));
                Ok(luma.freeze())
            }
            (_, _, _, Some(y)) => Ok(y.clone()),
            _ => Err(NodeError::refused("luma needs channels R, G and B, or Y; the picture's first layer has neither")
                .at("channel")
                .hint("name a channel that it has, such as A")),
        }
    }
}
