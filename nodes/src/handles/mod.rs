//! Warps that are dragged by handles (Gal, Sorkine, Cohen-Or 2006, section 3).

mod factor;
mod warp;

pub use factor::HandleFactor;
pub use warp::Handles;

use std::sync::{Arc, Mutex, PoisonError};

use warploom_algo::handles::{self, Error, Handle, HandleWarp, Held, Mode};
use warploom_algo::{Interrupted, Watch};
use warploom_core::node::NodeError;
use warploom_core::value::Grid;

use crate::adapt::{AtWork, described, too_large};

/// A prepared lattice, and the handles that were last prepared on it: a drag moves their targets alone.
struct Prepared {
    factor: handles::HandleFactor,
    last: Mutex<Option<Arc<Held>>>,
}

/// Of the factor's bytes prepared handles may take one in so many to be kept.
const KEPT: usize = 2;

impl Prepared {
    fn new(factor: handles::HandleFactor) -> Self {
        Self { factor, last: Mutex::default() }
    }

    /// Bytes held at most.
    fn bytes(&self) -> usize {
        self.factor.bytes() + self.factor.bytes() / KEPT
    }

    /// The handles prepared; what is found there gives the same bits as what is made anew.
    fn drag(&self, handles: &[Handle], mode: Mode, watch: Watch) -> Result<HandleWarp, Error> {
        let last = || self.last.lock().unwrap_or_else(PoisonError::into_inner);
        // One that does not serve makes room for the next.
        drop(last().take_if(|held| !held.holds(handles, mode)));
        let kept = last().clone();
        let (warp, made) = handles::drag(&self.factor, kept.as_deref(), handles, mode, watch)?;
        if let Some(made) = made.filter(|held| held.bytes() <= self.factor.bytes() / KEPT) {
            *last() = Some(Arc::new(made));
        }
        Ok(warp)
    }
}

/// Why the solver gave nothing; what the handles are to blame for is told before.
fn refusal(error: Error, grid: &Grid, at_work: AtWork) -> NodeError {
    let squarer = "use cells that are nearer to squares, or fewer handles";
    match error {
        Error::Interrupted => at_work.error(Interrupted),
        Error::TooLarge | Error::OutOfMemory => too_large(grid),
        Error::Overflow => {
            NodeError::refused("the targets lie so far away that positions overflow").hint("move them nearer")
        }
        Error::Inaccurate { residual } => {
            let message =
                format!("in double precision the solution keeps a relative residual of {residual:e}, too large");
            NodeError::refused(message).hint(squarer)
        }
        Error::NotPositiveDefinite => {
            let message = format!(
                "of the lattice ({}), the system is not positive definite in double precision",
                described(grid)
            );
            NodeError::refused(message).hint(squarer)
        }
        Error::NotFinite { .. } | Error::Outside { .. } | Error::Contradiction { .. } => {
            unreachable!("{error:?} is told with the handle's name")
        }
    }
}
