use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::magnify::{self, Wish};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::Grid;

use crate::adapt::{Strength, view, watched};

/// Makes every cell of a lattice as large as a field asks, without folds.
///
/// M of a cell is 1 + `amount` times the mean strength over its area, at least 0.05: 1 doubles the area, -0.5 halves it.
/// The nodes move by the gradient of a potential p with det(I + D^2 p) = M (Benamou, Froese, Oberman 2010), or by the
/// published relaxation (Keahey, Robertson 1997). What cannot be had without folds is had as M^t with the largest t.
///
/// In the stats `largest_error` and `rms_error` are |area / asked - 1| of the cells by their signed areas, `exponent` is t,
/// `mean` that of M before it was normalised, `normalised` how that was done, `raised` the cells that asked for less than
/// 0.05, `total_area` the sum of all areas over the lattice's rectangle, `steps` the solver's; with `frame: Pin`
/// `residual` is the largest error again.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Magnify {
    /// How much larger, pixel by pixel; 0 outside its data window.
    pub strength: In<Strength>,
    /// Lattice to warp.
    pub grid: In<Grid>,
    /// What the strength is multiplied by.
    #[default(1.0)]
    #[schemars(range(min = -1000.0, max = 1000.0), extend("x-soft" = [-1.0, 4.0]))]
    pub amount: f64,
    /// How nodes are moved.
    pub method: Method,
    /// How the areas asked for are made to fill the lattice.
    pub normalise: Normalise,
    /// What the lattice's border does. The relaxation always pins it.
    pub frame: Frame,
    /// Sweeps of the relaxation over the lattice, on every level.
    #[default(100)]
    #[schemars(range(min = 0, max = 100000), extend("x-soft" = [0, 1000]))]
    pub sweeps: u32,
    /// Part of an error that the relaxation removes at a time.
    #[default(0.3)]
    #[schemars(range(min = 0.001, max = 1.0))]
    pub refine: f64,
    /// Most of the way to the next node that the relaxation moves a node at a time.
    #[default(0.1)]
    #[schemars(range(min = 0.001, max = 0.5))]
    pub limit: f64,
    /// Errors count times M to this power in the relaxation.
    #[default(1.0)]
    #[schemars(range(min = -1.0, max = 1.0))]
    pub weight: f64,
    /// Lattices that are relaxed, from the coarsest on, each with half the cells of the next along a side; 1 is the
    /// published relaxation.
    #[default(1)]
    #[schemars(range(min = 1, max = 16))]
    pub levels: u32,
}

/// How nodes are moved.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Method {
    /// By the gradient of a potential: exact areas, no folds.
    #[default]
    Transport,
    /// By the published relaxation, for comparison: nodes push and pull their neighbours. Cells may fold.
    Keahey,
}

/// How the areas asked for are made to fill the lattice: their mean must be 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Normalise {
    /// Divided by their mean: cells keep their ratios.
    #[default]
    Multiply,
    /// The strongest cells get what they ask for, the others pay; where they cannot, as `Multiply`.
    Background,
    /// Less what their mean is above 1, and at least 0.05.
    Subtract,
    /// Not at all. The relaxation then never ends near them; the transport does as with `Multiply`.
    None,
}

/// What the lattice's border does.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Frame {
    /// Its nodes slide along it.
    #[default]
    Slide,
    /// Its nodes stay; areas beside it are had only nearly.
    Pin,
    /// It moves with the other side: a picture that repeats goes on repeating. For a lattice that is periodic in both.
    Periodic,
}

/// A part of the area asked for by which missing it is worth a warning.
const LARGE_ERROR: f64 = 0.1;

impl Node for Magnify {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::WARP;

    fn check(&self) -> Result<(), NodeError> {
        if self.frame != Frame::Periodic || self.method != Method::Keahey {
            return Ok(());
        }
        let error = NodeError::refused("the relaxation pins the frame; it is never periodic");
        Err(error.at("frame").hint("use method: Transport, or frame: Pin"))
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (strength, grid) = (cx.get(&self.strength), cx.get(&self.grid));
        if self.frame == Frame::Periodic && grid.periodic != [true, true] {
            let error = NodeError::refused("the frame is to be periodic, and the lattice is not so in both directions");
            return Err(error.at("grid").hint("use a Lattice with periodic: Both, or frame: Slide"));
        }
        let lattice = super::lattice(cx, &grid)?;
        cx.reserve(grid.node_count() as u128 * size_of::<f64>() as u128)?;
        let (samples, data) = (view(&strength.samples), strength.windows.data);
        let mut means =
            watched(cx, |watch| magnify::cell_means(&lattice, samples, data.x0.into(), data.y0.into(), watch))?;
        means.iter_mut().for_each(|mean| *mean *= self.amount);
        let wish = Wish {
            strength: &means,
            method: self.method(),
            normalise: self.normalise.into(),
            frame: self.frame.into(),
        };
        let found = watched(cx, |watch| magnify::magnify(&lattice, &wish, watch))?;
        drop(means);
        let missed = self.missed(found.largest_error, found.exponent);
        let outputs = super::certified(cx, &grid, found.positions)?
            .warning(missed)
            .stat("largest_error", found.largest_error)
            .stat("rms_error", found.rms_error)
            .stat("exponent", found.exponent)
            .stat("mean", found.mean)
            .stat("normalised", format!("{:?}", found.normalised))
            .stat("raised", found.raised)
            .stat("total_area", found.total_area)
            .stat("steps", found.steps);
        Ok(match self.frame {
            Frame::Pin => outputs.stat("residual", found.largest_error),
            Frame::Slide | Frame::Periodic => outputs,
        })
    }
}

impl Magnify {
    /// What is to be said of areas that were not had. The relaxation is known to miss them, and a pinned frame costs some.
    fn missed(&self, error: f64, exponent: f64) -> Option<String> {
        if self.method == Method::Keahey || self.frame == Frame::Pin || (error <= LARGE_ERROR && exponent == 1.0) {
            return None;
        }
        let asked = if exponent < 1.0 { format!("M^{exponent:.2}, as M itself would fold,") } else { "M".into() };
        Some(format!("areas are {asked} to within {:.1} %: ask for less, or use smaller cells", 100.0 * error))
    }

    fn method(&self) -> magnify::Method {
        let Self { refine, limit, weight, .. } = *self;
        let [sweeps, levels] = [self.sweeps, self.levels].map(|count| count as usize);
        match self.method {
            Method::Transport => magnify::Method::Transport,
            Method::Keahey => magnify::Method::Keahey(magnify::Keahey { sweeps, refine, limit, weight, levels }),
        }
    }
}

impl From<Normalise> for magnify::Normalise {
    fn from(normalise: Normalise) -> Self {
        match normalise {
            Normalise::Multiply => Self::Multiply,
            Normalise::Background => Self::Background,
            Normalise::Subtract => Self::Subtract,
            Normalise::None => Self::None,
        }
    }
}

impl From<Frame> for magnify::Frame {
    fn from(frame: Frame) -> Self {
        match frame {
            Frame::Slide => Self::Slide,
            Frame::Pin => Self::Pin,
            Frame::Periodic => Self::Periodic,
        }
    }
}
