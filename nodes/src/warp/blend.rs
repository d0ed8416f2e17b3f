use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Warp;

use crate::adapt::{check_lattice, lattice, positions, watched};

/// Fades a warp in, from the identity or from another warp.
///
/// Both lie on one lattice and point the same way.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Blend {
    /// The warp at an amount of 1.
    pub warp: In<Warp>,
    /// The warp at an amount of 0; the identity if not connected.
    pub from: Option<In<Warp>>,
    /// How much of the warp; beyond 0 to 1 it overshoots.
    #[default(1.0)]
    #[schemars(range(min = -1.0, max = 2.0), extend("x-soft" = [0.0, 1.0]))]
    pub amount: f64,
}

impl Node for Blend {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (to, from) = (cx.get(&self.warp), cx.get_optional(&self.from));
        if let Some(from) = &from {
            super::assert_alike(&to, from, "from")?;
            check_lattice(from, "from", &to.grid, "the warp")?;
        }
        cx.reserve(to.grid.node_count() as u128 * size_of::<[f64; 2]>() as u128)?;
        let start = from.map(|from| positions(cx, &from)).transpose()?;
        let (lattice, end) = (lattice(&to.grid), positions(cx, &to)?);
        let blended = watched(cx, |watch| warp::blend(&lattice, start.as_ref(), &end, self.amount, watch))?;
        drop((start, end));
        super::derived(cx, &to.grid, to.direction, blended)
    }
}
