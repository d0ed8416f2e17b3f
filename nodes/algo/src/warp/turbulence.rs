//! Smooth noise.

use crate::lattice::{Lattice, Positions};
use crate::{Interrupted, Watch};

/// Parameters of [`turbulence`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turbulence {
    /// The largest displacement along each axis, px, any finite number; 0 is the identity.
    pub amount: f64,
    /// Size of the coarsest octave's cells, px, > 0 (asserted).
    pub scale: f64,
    /// Count of octaves, 1..=16 (asserted), each of half the size and half the height of the one before.
    pub octaves: u32,
    /// Other seeds give other noise.
    pub seed: u32,
}

/// Moves the lattice by seeded gradient noise, sums of octaves of it.
///
/// Along each axis, p' = p + amount (sum of 2^-o n(2^o p / scale) over the octaves o) / (sum of 2^-o). The noise n is
/// 0 at whole points; between them it is, with (i, j) the whole part of its argument, (f, e) the fraction and
/// F(t) = t^3 (6 t^2 - 15 t + 10),
///
/// ```text
/// mix(F(e), mix(F(f), g00 . (f, e),     g10 . (f - 1, e)),
///           mix(F(f), g01 . (f, e - 1), g11 . (f - 1, e - 1)))
/// ```
///
/// The gradients g are uniform in [-1, 1]^2, by a hash of the point, the octave, the axis and the seed. So |n| <= 1 and
/// the warp is C2. All of it is products and sums: the bits are those of any machine.
///
/// * `lattice`: the nodes to move. The noise hangs on the picture's origin, so a grown lattice sees the same.
/// * `parameters`: see [`Turbulence`].
///
/// A slope of n is at most 4.75, so nothing folds while |amount| < scale (sum of 2^-o) / (9.5 octaves). Octaves
/// smaller than the lattice's cells are sampled too coarsely.
///
/// Cost: linear in the nodes times octaves, rows side by side. Stops when `watch` says so.
///
/// K. Perlin, "Improving Noise", ACM TOG 21, 2002 (the fade curve).
pub fn turbulence(lattice: &Lattice, parameters: &Turbulence, watch: Watch) -> Result<Positions, Interrupted> {
    let Turbulence { amount, scale, octaves, seed } = *parameters;
    assert!(scale > 0.0, "a scale of {scale} px is not positive");
    assert!((1..=16).contains(&octaves), "{octaves} octaves are not 1 to 16");
    let total = 2.0 - 1.0 / f64::from(1 << (octaves - 1));
    Positions::mapped(lattice, watch, |[x, y]| {
        let [dx, dy] = [0, 1].map(|axis| {
            let octave = |octave: u32| {
                let zoom = f64::from(1 << octave);
                noise([x / scale * zoom, y / scale * zoom], key(seed, 2 * octave + axis)) / zoom
            };
            amount * ((0..octaves).fold(0.0, |sum, number| sum + octave(number)) / total)
        });
        [x + dx, y + dy]
    })
}

/// Gradient noise in -1..=1, 0 at whole points.
fn noise(at: [f64; 2], key: u64) -> f64 {
    let whole = at.map(f64::floor);
    let [f, e] = [at[0] - whole[0], at[1] - whole[1]];
    let [i, j] = whole.map(|whole| whole as i64);
    let slope = |di: i64, dj: i64| {
        let hash = mixed(mixed(key ^ i.wrapping_add(di) as u64) ^ j.wrapping_add(dj) as u64);
        let [gx, gy] = [hash as u32, (hash >> 32) as u32].map(|bits| f64::from(bits) / f64::from(u32::MAX) * 2.0 - 1.0);
        gx * (f - di as f64) + gy * (e - dj as f64)
    };
    let (across, down) = (fade(f), fade(e));
    let mix = |t: f64, from: f64, to: f64| from + t * (to - from);
    mix(down, mix(across, slope(0, 0), slope(1, 0)), mix(across, slope(0, 1), slope(1, 1)))
}

fn fade(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

/// What tells the noise of one seed and use from another's.
fn key(seed: u32, channel: u32) -> u64 {
    mixed(u64::from(channel) << 32 | u64::from(seed))
}

/// A bijection of 64 bits that spreads every bit over all others: an odd multiplier and xor-shifts, twice.
fn mixed(mut bits: u64) -> u64 {
    bits = bits.wrapping_add(0x9E37_79B9_7F4A_7C15);
    bits = (bits ^ bits >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ bits >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    bits ^ bits >> 31
}

#[cfg(test)]
mod tests {
    use super::super::certify;
    use super::super::tests::{assert_identity, assert_threads_agree};
    use super::*;
    use crate::UNWATCHED;

    const LATTICE: Lattice = Lattice { origin: [-20.0, -30.0], spacing: [0.5, 0.5], nodes: [121, 101] };
    const USUAL: Turbulence = Turbulence { amount: 2.0, scale: 12.0, octaves: 3, seed: 7 };

    fn turbulence(lattice: &Lattice, parameters: &Turbulence) -> Positions {
        super::turbulence(lattice, parameters, UNWATCHED).expect("nobody stops it")
    }

    #[test]
    fn identity_is_exact() {
        assert_identity(|lattice| turbulence(lattice, &Turbulence { amount: 0.0, ..USUAL }));
    }

    #[test]
    fn these_bits_hold_on_every_machine() {
        let cell = Lattice { origin: [3.0, 4.0], spacing: [1.25, 2.5], nodes: [2, 2] };
        let warped = turbulence(&cell, &USUAL);
        let bits = [warped.x[0], warped.y[0], warped.x[3], warped.y[3]].map(f64::to_bits);
        // By the formula, in another language.
        let expected = [0x4006_c77c_b38f_2402, 0x4010_8170_5771_e996, 0x4010_0ba1_d0df_d316, 0x401b_8607_3bc3_ea90];
        assert_eq!(bits, expected, "{bits:#x?}");
    }

    #[test]
    fn displacements_are_bounded_centred_and_of_either_sign() {
        let warped = turbulence(&LATTICE, &USUAL);
        let rest = Positions::from_map(&LATTICE, |p| p);
        for (moved, rest) in [(&warped.x, &rest.x), (&warped.y, &rest.y)] {
            let by: Vec<f64> = moved.iter().zip(rest).map(|(a, b)| a - b).collect();
            assert!(by.iter().all(|by| by.abs() <= 2.0));
            let (low, high) = by.iter().fold((0.0f64, 0.0f64), |(low, high), by| (low.min(*by), high.max(*by)));
            assert!(low < -0.5 && high > 0.5, "{low} to {high}");
            assert!((by.iter().sum::<f64>() / by.len() as f64).abs() < 0.2);
        }
        assert!((0..200).any(|i| (warped.x[i] - rest.x[i] - warped.y[i] + rest.y[i]).abs() > 0.1), "axes differ");
    }

    #[test]
    fn noise_is_smooth_and_nothing_at_whole_points() {
        for at in [[0.0, 0.0], [3.0, -5.0], [1e6, 7.0]] {
            assert_eq!(noise(at, 9), 0.0);
        }
        // Value and slope agree on both sides of the cells' borders.
        for y in [0.2, 0.5, 0.9] {
            let [left, at, right] = [-1e-5, 0.0, 1e-5].map(|x| noise([4.0 + x, y], 9));
            assert!((left - at).abs() < 1e-4 && (right - 2.0 * at + left).abs() < 1e-8, "{left} {at} {right}");
        }
    }

    #[test]
    fn a_grown_lattice_sees_the_same_and_another_seed_does_not() {
        let inner = Lattice { origin: [-10.0, -20.0], nodes: [41, 31], ..LATTICE };
        let (whole, part) = (turbulence(&LATTICE, &USUAL), turbulence(&inner, &USUAL));
        let at = |i: usize| (i / 41 + 20) * 121 + i % 41 + 20;
        assert!((0..inner.node_count()).all(|i| part.x[i] == whole.x[at(i)] && part.y[i] == whole.y[at(i)]));
        let other = turbulence(&inner, &Turbulence { seed: 8, ..USUAL });
        assert!((0..inner.node_count()).filter(|&i| (part.x[i] - other.x[i]).abs() > 0.05).count() > 600);
    }

    #[test]
    fn gentle_noise_does_not_fold() {
        for (octaves, total) in [(1, 1.0), (2, 1.5), (5, 1.9375)] {
            for seed in 0..10 {
                let amount = 0.99 * 12.0 * total / (9.5 * f64::from(octaves));
                let warped = turbulence(&LATTICE, &Turbulence { amount, octaves, seed, ..USUAL });
                assert_eq!(certify(&LATTICE, &warped, UNWATCHED).expect("nobody stops it").folds, 0);
            }
        }
    }

    #[test]
    fn huge_parameters_stay_finite() {
        let far = Lattice { origin: [-1e300, 1e18], spacing: [1e3, 1e3], nodes: [4, 4] };
        let warped = turbulence(&far, &Turbulence { amount: 1e9, scale: 0.01, octaves: 16, seed: u32::MAX });
        assert!(warped.x.iter().chain(&warped.y).all(|at| at.is_finite()));
    }

    #[test]
    fn threads_do_not_change_it() {
        assert_threads_agree(|| turbulence(&LATTICE, &USUAL));
    }
}
