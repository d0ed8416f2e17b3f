//! Warps that magnify: cells of a lattice become as large as a field asks (Keahey, Robertson 1997, and by transport).

mod areas;
mod keahey;
mod means;
mod potential;
mod target;
#[cfg(test)]
mod tests;
mod transport;

pub use areas::relative_areas;
pub use keahey::Keahey;
pub use means::cell_means;
pub use target::{FLOOR, Normalise};

use crate::lattice::{Lattice, Positions};
use crate::warp::Certificate;
use crate::{Interrupted, Watch};

/// How the lattice is moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Along the gradient of a potential, found so that every cell has its area: exact, and free of folds.
    Transport,
    /// By the published relaxation, which holds the frame whatever is asked of it.
    Keahey(Keahey),
}

/// What the lattice's frame does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// Its nodes slide along it; the corners stay.
    Slide,
    /// Its nodes stay: areas near it can be had only nearly.
    Pin,
    /// The last column and row are the first ones, a period further.
    Periodic,
}

/// What to magnify, and how.
#[derive(Clone, Copy, Debug)]
pub struct Wish<'a> {
    /// Mean strength of every cell, row-major: 0 leaves it its area, 1 doubles it, -0.5 halves it. What is not finite
    /// counts as 0.
    pub strength: &'a [f64],
    /// How the lattice is moved.
    pub method: Method,
    /// How areas are made to fill the lattice's rectangle.
    pub normalise: Normalise,
    /// What the frame does.
    pub frame: Frame,
}

/// A magnified lattice, and how near it comes to what was asked.
#[derive(Clone, Debug)]
pub struct Magnified {
    /// Where the nodes go.
    pub positions: Positions,
    /// Mean of 1 + strength, before it was normalised.
    pub mean: f64,
    /// Cells whose 1 + strength lay below [`FLOOR`] and was raised to it.
    pub raised: usize,
    /// How it was normalised: `Multiply` where a background cannot pay for what is magnified.
    pub normalised: Normalise,
    /// The areas' part that was taken: M^t. 1 wherever a map without folds was found.
    pub exponent: f64,
    /// Steps of the solver, or sweeps of the relaxation.
    pub steps: usize,
    /// Largest |area / asked - 1| of a cell, by signed areas.
    pub largest_error: f64,
    /// Root of the mean of its square.
    pub rms_error: f64,
    /// Sum of all signed areas over that of the rectangle.
    pub total_area: f64,
    /// Folds, and the least Jacobian determinant.
    pub certificate: Certificate,
}

/// Moves the nodes of a lattice so that the area of each cell is M times what it was.
///
/// M of a cell is 1 + its mean strength, normalised so that a fixed frame can hold all ([`Normalise`]). With
/// [`Method::Transport`] the nodes move by the gradient of a potential p: det(I + D^2 p) = M, on the lattice so that the
/// bilinear cells' own areas are M. Per step the trace s = 2 + laplacian(p) becomes sqrt(s^2 + 4 (M - area)), and one
/// Poisson equation gives the next p; two steps are combined as their secant says. Where that folds, the determinant
/// at the cells' centres takes the area's place, which forgives jumps of M; where that folds too, M^t takes the place of
/// M, by bisection for the largest t without folds. All lengths are in px, so neither cells nor rectangle need be
/// square.
///
/// * `lattice`: at rest; with [`Frame::Periodic`] one period of it.
/// * `wish`: what to do; one strength per cell (asserted).
/// * `watch`: asked for memory, and whether to go on.
///
/// With `Transport` no cell folds, whatever is asked. With [`Keahey`] cells may fold; the certificate tells. Strengths
/// that are all equal give the rest positions. `Frame::Slide` keeps the corners; a period's mean stays where it is, so
/// that a shift of the strength by whole cells is one of the warp.
///
/// Cost: O(n log n) a step, 4 to 12 steps for smooth fields, up to about 200 where M is impossible. Results do not
/// depend on the count of threads.
///
/// J.-D. Benamou, B. Froese, A. Oberman, "Two Numerical Methods for the Elliptic Monge-Ampere Equation", ESAIM M2AN 44,
/// 2010, section 3 (the step, with half its length); A. Keahey, E. Robertson, "Nonlinear Magnification Fields", IEEE
/// InfoVis 1997.
pub fn magnify(lattice: &Lattice, wish: &Wish, watch: Watch) -> Result<Magnified, Interrupted> {
    let [columns, rows] = lattice.cells();
    let Wish { strength, method, normalise, frame } = *wish;
    assert!(strength.len() == columns * rows, "{} strengths do not fit {lattice:?}", strength.len());
    watch.reserve(size_of_val(strength))?;
    let target::Target { areas, mean, raised, normalised } = target::target(strength, normalise);
    let moved = match method {
        Method::Transport => transport::transport(lattice, &areas, frame, watch)?,
        Method::Keahey(parameters) => keahey::keahey(lattice, &areas, &parameters, watch)?,
    };
    let Moved { positions, certificate, exponent, steps } = moved;
    let areas::Score { largest_error, rms_error, total_area } = areas::score(lattice, &positions, &areas);
    Ok(Magnified {
        positions,
        mean,
        raised,
        normalised,
        exponent,
        steps,
        largest_error,
        rms_error,
        total_area,
        certificate,
    })
}

/// What a method gives.
struct Moved {
    positions: Positions,
    certificate: Certificate,
    exponent: f64,
    steps: usize,
}
