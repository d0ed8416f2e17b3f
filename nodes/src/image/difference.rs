use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::composite;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Image, Layer};

use super::Planes;

/// How far two pictures differ: the absolute difference of each channel.
///
/// Format and metadata are the first one's, and so are channels of identities; of each, the first layer is compared.
/// The data window holds both, and what a picture lacks is 0.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Difference {
    /// One picture.
    pub a: In<Image>,
    /// The other.
    pub b: In<Image>,
}

impl Node for Difference {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::IMAGE;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (a, b) = (cx.get(&self.a), cx.get(&self.b));
        let (first, second) = (a.primary(), b.primary());
        let data = first.data.union(&second.data);
        let channels = super::combined(
            &Planes { cx, reserved: false },
            &[first, second],
            &data,
            |_| true,
            |name, out| {
                let (x0, y0) = (data.x0.into(), data.y0.into());
                composite::difference(super::placement(first, name), super::placement(second, name), x0, y0, out);
            },
        )?;
        let layer = Layer { data, channels, ..first.clone() };
        Ok(Image { layers: vec![layer], ..(*a).clone() }.into())
    }
}
