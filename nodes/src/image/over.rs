use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::composite;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Image, Layer};

/// Lays pictures over each other, premultiplied; the first is in front.
///
/// Format, metadata and further layers are the last one's; the data window holds all of them. A picture without alpha
/// hides what lies behind it. Identities are not mixed: they are the hindmost picture's.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Over {
    /// Pictures, front to back.
    pub images: Vec<In<Image>>,
}

impl Node for Over {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::IMAGE;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let images = cx.get_all(&self.images);
        let mut behind = (*images[images.len() - 1]).clone();
        for front in images[..images.len() - 1].iter().rev() {
            behind = over(cx, front, behind)?;
        }
        Ok(behind.into())
    }
}

fn over(cx: &Context, front: &Image, behind: Image) -> Result<Image, NodeError> {
    let (f, b) = (front.primary(), behind.primary());
    let data = f.data.union(&b.data);
    let (x0, y0) = (data.x0.into(), data.y0.into());
    let channels = super::combined(
        cx,
        &[b, f],
        &data,
        |_| true,
        |name, out| {
            let (front, back) = match name {
                "A" => (super::alpha(f), super::alpha(b)),
                name => (super::placement(f, name), super::placement(b, name)),
            };
            composite::over(front, super::alpha(f), back, x0, y0, out);
        },
    )?;
    let mut layers = behind.layers.clone();
    layers[0] = Layer { data, channels, ..b.clone() };
    Ok(Image { layers, ..behind })
}
