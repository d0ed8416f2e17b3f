//! Warps made of warps: one after the other, and one blended into another.

use crate::lattice::{Lattice, Positions};
use crate::resample::{Net, Place};
use crate::{Interrupted, Watch};
use rayon::prelude::*;

/// A warp made of others on a lattice, and how well the lattice holds it.
#[derive(Clone, Debug, PartialEq)]
pub struct Composed {
    /// Positions of the lattice's nodes.
    pub positions: Positions,
    /// Largest distance between what is meant and what lies between the nodes, at the centres of the cells, px;
    /// infinite where a position is not finite.
    pub interpolation_error: f64,
}

/// One map after another: the outer at the positions of the inner.
///
/// Each node of the inner's lattice goes to outer(inner(node)). The outer is bilinear inside its lattice's cells and
/// continued outside by its border cells' bilinear patches. The composition is exact at the nodes; between them the
/// bilinear result differs from outer(inner(p)) by an error that falls with the square of the spacing where both are
/// smooth.
///
/// * `inner`, `outer`: lattices with their positions, one per node (asserted). Both point the same way: of two warps
///   `dst_from_src`, the inner is the one applied first; of two `src_from_dst`, the one applied last.
///
/// A node whose position is not finite, on either, makes what depends on it not finite.
///
/// Cost: linear in the inner's nodes, rows side by side. Stops when `watch` says so.
pub fn compose(
    inner: (&Lattice, &Positions),
    outer: (&Lattice, &Positions),
    watch: Watch,
) -> Result<Composed, Interrupted> {
    let (lattice, through) = (inner.0, inner.1);
    let (inner, outer) = (Net::new(inner.0, inner.1), Net::new(outer.0, outer.1));
    let map = |[x, y]: [f64; 2]| outer.position(outer.place(0, x), outer.place(1, y));
    let mut positions = through.clone();
    let columns = lattice.nodes[0];
    let rows = positions.x.par_chunks_mut(columns).zip(positions.y.par_chunks_mut(columns));
    rows.try_for_each(|(xs, ys)| {
        xs.iter_mut().zip(ys).for_each(|(x, y)| [*x, *y] = map([*x, *y]));
        watch.go_on()
    })?;
    let exact = |column, row| Some(map(inner.position(half(column), half(row))));
    let interpolation_error = interpolation_error(lattice, &positions, exact, watch)?;
    Ok(Composed { positions, interpolation_error })
}

/// The middle of a cell, along one axis.
fn half(cell: usize) -> Place {
    Place { node: cell, next: cell + 1, t: 0.5 }
}

/// The largest distance between `exact` at the centres of the cells (column, row) and the bilinear map there; cells
/// where nothing is exact are left out, positions that are not finite count as infinitely far.
pub(super) fn interpolation_error(
    lattice: &Lattice,
    positions: &Positions,
    exact: impl Fn(usize, usize) -> Option<[f64; 2]> + Sync,
    watch: Watch,
) -> Result<f64, Interrupted> {
    let [columns, rows] = lattice.cells();
    let net = Net::new(lattice, positions);
    let rows = (0..rows).into_par_iter().map(|row| {
        watch.go_on()?;
        Ok((0..columns).fold(0.0, |worst: f64, column| {
            let between = net.position(half(column), half(row));
            exact(column, row).map_or(worst, |exact| worst.max(distance(exact, between)))
        }))
    });
    rows.try_reduce(|| 0.0, |a, b| Ok(a.max(b)))
}

/// How far apart two points are, px; infinitely if a coordinate is not finite.
pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let distance = libm::hypot(a[0] - b[0], a[1] - b[1]);
    if distance.is_nan() { f64::INFINITY } else { distance }
}

/// Blends one warp into another, node by node.
///
/// p' = from + amount (to - from). At 0 and 1 the result is `from` and `to` bit for bit.
///
/// * `lattice`: that of both.
/// * `from`: the positions at 0, one per node (asserted); `None` for rest.
/// * `to`: the positions at 1, one per node (asserted).
/// * `amount`: any finite number; beyond 0..=1 it overshoots.
///
/// Neither map without folds, nor a small amount, keeps a blend from folding; [`super::certify`] reports it.
///
/// Cost: linear in the nodes, rows side by side. Stops when `watch` says so.
pub fn blend(
    lattice: &Lattice,
    from: Option<&Positions>,
    to: &Positions,
    amount: f64,
    watch: Watch,
) -> Result<Positions, Interrupted> {
    let columns = lattice.nodes[0];
    for positions in from.into_iter().chain([to]) {
        assert!([&positions.x, &positions.y].iter().all(|at| at.len() == lattice.node_count()), "one per node");
    }
    let mut blended = match from {
        Some(from) => from.clone(),
        None => Positions::mapped(lattice, watch, |p| p)?,
    };
    let mix = |from: f64, to: f64| match amount {
        0.0 => from,
        1.0 => to,
        _ => from + amount * (to - from),
    };
    for (out, to) in [(&mut blended.x, &to.x), (&mut blended.y, &to.y)] {
        out.par_chunks_mut(columns).zip(to.par_chunks(columns)).try_for_each(|(out, to)| {
            out.iter_mut().zip(to).for_each(|(out, to)| *out = mix(*out, *to));
            watch.go_on()
        })?;
    }
    Ok(blended)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{assert_threads_agree, fractional_lattices};
    use super::super::{Affine, affine, arc, wave};
    use super::*;
    use crate::UNWATCHED;

    const LATTICE: Lattice = Lattice { origin: [10.0, 20.0], spacing: [2.0, 3.0], nodes: [31, 21] };
    const OTHER: Lattice = Lattice { origin: [0.0, 15.0], spacing: [4.0, 4.0], nodes: [15, 12] };

    fn bent(lattice: &Lattice) -> Positions {
        arc(lattice, 70.0, UNWATCHED).expect("nobody stops it")
    }

    fn turned(lattice: &Lattice) -> Positions {
        let turn = Affine { rotate_deg: 30.0, scale: [2.0, 0.5], translate: [3.0, 4.0], ..Affine::default() };
        affine(lattice, &turn, UNWATCHED).expect("nobody stops it")
    }

    fn after(inner: (&Lattice, &Positions), outer: (&Lattice, &Positions)) -> Composed {
        compose(inner, outer, UNWATCHED).expect("nobody stops it")
    }

    fn far(a: &Positions, b: &Positions) -> f64 {
        (0..a.x.len()).map(|i| distance([a.x[i], a.y[i]], [b.x[i], b.y[i]])).fold(0.0, f64::max)
    }

    #[test]
    fn an_affine_map_after_any_is_exact_inside_and_outside_its_lattice() {
        let bend = bent(&LATTICE);
        let outer = turned(&OTHER);
        let composed = after((&LATTICE, &bend), (&OTHER, &outer));
        let (sin, cos) = 30f64.to_radians().sin_cos();
        let expected = Positions {
            x: (0..651).map(|i| cos * 2.0 * bend.x[i] - sin * 0.5 * bend.y[i] + 3.0).collect(),
            y: (0..651).map(|i| sin * 2.0 * bend.x[i] + cos * 0.5 * bend.y[i] + 4.0).collect(),
        };
        assert!(far(&composed.positions, &expected) < 1e-11);
        assert!(composed.interpolation_error < 1e-11, "{}", composed.interpolation_error);
    }

    #[test]
    fn composition_is_associative_at_the_nodes_and_the_identity_is_neutral() {
        let (a, b) = (bent(&LATTICE), wave(&OTHER, 2.0, 17.0, 20.0, 40.0, UNWATCHED).expect("nobody stops it"));
        let rest = Positions::from_map(&OTHER, |p| p);
        assert!(far(&after((&LATTICE, &a), (&OTHER, &rest)).positions, &a) < 1e-11);
        let ab = after((&LATTICE, &a), (&OTHER, &b)).positions;
        assert!(far(&after((&OTHER, &rest), (&OTHER, &b)).positions, &b) < 1e-11);
        // The outer pair is affine, so its composition is exact everywhere.
        let c = turned(&OTHER);
        let cc = after((&OTHER, &c), (&OTHER, &c)).positions;
        let one = after((&LATTICE, &after((&LATTICE, &ab), (&OTHER, &c)).positions), (&OTHER, &c)).positions;
        assert!(far(&one, &after((&LATTICE, &ab), (&OTHER, &cc)).positions) < 1e-9);
    }

    #[test]
    fn the_reported_error_falls_with_the_square_of_the_spacing() {
        let error = |cells: usize| {
            let lattice = Lattice { origin: [0.0; 2], spacing: [64.0 / cells as f64; 2], nodes: [cells + 1; 2] };
            let fine = Lattice { origin: [-80.0; 2], spacing: [0.125; 2], nodes: [1800; 2] };
            let outer = wave(&fine, 3.0, 40.0, 20.0, 25.0, UNWATCHED).expect("nobody stops it");
            after((&lattice, &bent(&lattice)), (&fine, &outer)).interpolation_error
        };
        let (coarse, fine) = (error(8), error(32));
        assert!(coarse > 0.1 && (10.0..22.0).contains(&(coarse / fine)), "{coarse} and {fine}");
    }

    #[test]
    fn what_is_not_finite_is_infinitely_wrong() {
        let mut bend = bent(&LATTICE);
        bend.x[40] = f64::NAN;
        let composed = after((&LATTICE, &bend), (&OTHER, &turned(&OTHER)));
        assert!(composed.positions.x[40].is_nan() && composed.positions.x[42].is_finite());
        assert_eq!(composed.interpolation_error, f64::INFINITY);
    }

    #[test]
    fn blends_begin_and_end_bit_for_bit() {
        for lattice in fractional_lattices() {
            let (a, b, rest) = (bent(&lattice), turned(&lattice), Positions::from_map(&lattice, |p| p));
            let mix = |from, to, amount| blend(&lattice, from, to, amount, UNWATCHED).expect("nobody stops it");
            assert_eq!(mix(None, &a, 0.0), rest);
            assert_eq!(mix(None, &a, 1.0), a);
            assert_eq!(mix(Some(&b), &a, 0.0), b);
            assert_eq!(mix(Some(&b), &a, 1.0), a);
            let beyond = mix(Some(&b), &a, -0.5);
            assert!((beyond.x[1] - (1.5 * b.x[1] - 0.5 * a.x[1])).abs() < 1e-9 * b.x[1].abs().max(1.0));
        }
    }

    #[test]
    fn threads_do_not_change_it() {
        let (a, b) = (bent(&LATTICE), turned(&OTHER));
        assert_threads_agree(|| after((&LATTICE, &a), (&OTHER, &b)).positions);
        assert_threads_agree(|| blend(&LATTICE, None, &a, 0.3, UNWATCHED).expect("nobody stops it"));
    }
}
