use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::warp;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Direction, Warp};

use crate::adapt::{lattice, positions, watched};

/// Two warps as one: the first, then the second.
///
/// Both say where pixels go, and the result lies on the first one's lattice; or both say where pixels come from, and it
/// lies on the second one's. Outside its lattice a warp is continued. `interpolation_error` in the stats is how far
/// the result is off at the centres of its cells, px.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Compose {
    /// Warp that is applied first.
    pub first: In<Warp>,
    /// Warp that is applied to its result.
    pub second: In<Warp>,
}

impl Node for Compose {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (first, second) = (cx.get(&self.first), cx.get(&self.second));
        super::assert_alike(&first, &second, "second")?;
        let holes = super::Holes::of([&*first, &*second]);
        let (inner, outer) = match first.direction {
            Direction::DstFromSrc => (first, second),
            Direction::SrcFromDst => (second, first),
        };
        cx.reserve(inner.grid.node_count() as u128 * size_of::<[f64; 2]>() as u128)?;
        let [through, beyond] = [positions(cx, &inner)?, positions(cx, &outer)?];
        let (on, under) = (lattice(&inner.grid), lattice(&outer.grid));
        let made = watched(cx, |watch| warp::compose((&on, &through), (&under, &beyond), watch))?;
        drop((through, beyond));
        let error = made.interpolation_error;
        let outputs = super::derived(cx, &inner.grid, inner.direction, made.positions, holes)?;
        Ok(outputs.stat("interpolation_error", error))
    }
}
