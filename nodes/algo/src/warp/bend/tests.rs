use super::super::certify;
use super::super::tests::{assert_identity, assert_threads_agree, fractional_lattices};
use super::*;
use crate::UNWATCHED;

const ALL: [Shape; 13] = [
    Shape::ArcLower,
    Shape::ArcUpper,
    Shape::Arch,
    Shape::Bulge,
    Shape::ShellLower,
    Shape::ShellUpper,
    Shape::Flag,
    Shape::Fish,
    Shape::Rise,
    Shape::Fisheye,
    Shape::Inflate,
    Shape::Squeeze,
    Shape::Twist,
];

/// (u, v) are x and y.
const UNIT: Lattice = Lattice { origin: [-1.0, -1.0], spacing: [0.125, 0.125], nodes: [17, 17] };

fn bent(lattice: &Lattice, shape: Shape, parameters: &Bend) -> Positions {
    super::bend(lattice, shape, parameters, UNWATCHED).expect("nobody stops it")
}

fn by(bend: f64) -> Bend {
    Bend { bend, ..Bend::default() }
}

/// Where the node at (u, v) of `UNIT` goes; both multiples of 1/8.
fn at(positions: &Positions, u: f64, v: f64) -> [f64; 2] {
    let node = ((v + 1.0) * 8.0) as usize * 17 + ((u + 1.0) * 8.0) as usize;
    [positions.x[node], positions.y[node]]
}

#[test]
fn identity_is_exact() {
    for shape in ALL {
        for orientation in [Orientation::Horizontal, Orientation::Vertical] {
            assert_identity(|lattice| bent(lattice, shape, &Bend { orientation, ..Bend::default() }));
        }
    }
}

#[test]
fn the_middle_and_the_edges_go_where_they_should() {
    // Shape, (u, v), where it goes at a bend of 40 per cent.
    let cases = [
        (Shape::ArcLower, [0.0, 1.0], [0.0, 1.4]),
        (Shape::ArcLower, [0.5, 0.0], [0.5, 0.15]),
        (Shape::ArcUpper, [0.0, -1.0], [0.0, -1.4]),
        (Shape::Arch, [0.0, 1.0], [0.0, 0.6]),
        (Shape::Arch, [0.5, -1.0], [0.5, -1.3]),
        (Shape::Bulge, [0.0, -1.0], [0.0, -1.4]),
        (Shape::Bulge, [0.0, 0.5], [0.0, 0.7]),
        (Shape::ShellLower, [1.0, 1.0], [1.2, 0.8]),
        (Shape::ShellLower, [0.0, 1.0], [0.0, 1.2]),
        (Shape::ShellUpper, [-1.0, -1.0], [-1.2, -0.8]),
        (Shape::ShellUpper, [0.0, -1.0], [0.0, -1.2]),
        (Shape::Flag, [-0.5, 0.0], [-0.5, -0.2]),
        (Shape::Flag, [0.5, 1.0], [0.5, 1.2]),
        (Shape::Fish, [-0.5, 1.0], [-0.5, 1.3]),
        (Shape::Fish, [0.5, -1.0], [0.5, -0.7]),
        (Shape::Rise, [-1.0, 0.0], [-1.0, 0.4]),
        (Shape::Rise, [1.0, 0.0], [1.0, -0.4]),
        (Shape::Fisheye, [0.5, 0.0], [0.5 + 0.5 * 0.3 * 0.5625, 0.0]),
        (Shape::Inflate, [1.0, 0.0], [1.15, 0.0]),
        (Shape::Inflate, [0.0, -1.0], [0.0, -1.15]),
        (Shape::Squeeze, [1.0, 0.0], [0.8, 0.0]),
        (Shape::Squeeze, [0.0, 1.0], [0.0, 1.2]),
    ];
    for (shape, [u, v], expected) in cases {
        let found = at(&bent(&UNIT, shape, &by(40.0)), u, v);
        assert!((0..2).all(|i| (found[i] - expected[i]).abs() < 1e-14), "{shape:?} at {u} {v}: {found:?}");
    }
}

#[test]
fn a_twist_turns_clockwise_in_its_middle_and_keeps_distances() {
    let twisted = bent(&UNIT, Shape::Twist, &by(50.0));
    let [x, y] = at(&twisted, 0.125, 0.0);
    assert!(x.abs() < 0.01 && y > 0.12, "what lay to the right turns downwards: {x} {y}");
    for (i, (x, y)) in twisted.x.iter().zip(&twisted.y).enumerate() {
        let [u, v] = UNIT.rest(i % 17, i / 17);
        assert!((x.hypot(*y) - u.hypot(v)).abs() < 1e-14, "node {i}");
    }
}

#[test]
fn what_stays_stays() {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let stays = |shape: Shape, u: f64, v: f64| match shape {
        Shape::ArcLower | Shape::ShellLower if v == -1.0 => true,
        Shape::ArcUpper | Shape::ShellUpper if v == 1.0 => true,
        Shape::Arch | Shape::Bulge | Shape::ArcLower | Shape::ArcUpper | Shape::Flag | Shape::Fish => u.abs() == 1.0,
        Shape::Fisheye | Shape::Twist => u * u + v * v >= 1.0,
        Shape::Inflate | Shape::Squeeze => corners.contains(&[u, v]),
        _ => false,
    };
    for shape in ALL {
        for bend in [-100.0, -30.0, 70.0, 100.0] {
            let warped = bent(&UNIT, shape, &by(bend));
            for i in 0..UNIT.node_count() {
                let [u, v] = UNIT.rest(i % 17, i / 17);
                if stays(shape, u, v) {
                    assert_eq!([warped.x[i], warped.y[i]], [u, v], "{shape:?} by {bend} at {u} {v}");
                }
            }
        }
    }
}

#[test]
fn vertical_is_the_transpose() {
    for shape in ALL {
        let lying = bent(&UNIT, shape, &by(60.0));
        let standing = bent(&UNIT, shape, &Bend { orientation: Orientation::Vertical, ..by(60.0) });
        for i in 0..UNIT.node_count() {
            let transposed = i % 17 * 17 + i / 17;
            assert_eq!([lying.x[i], lying.y[i]], [standing.y[transposed], standing.x[transposed]], "{shape:?}");
        }
    }
}

#[test]
fn distortions_taper_towards_one_end() {
    let tapered =
        bent(&UNIT, Shape::Arch, &Bend { horizontal_distortion: 50.0, vertical_distortion: -20.0, ..by(0.0) });
    assert_eq!(at(&tapered, 1.0, -1.0), [1.2, -1.5]);
    assert_eq!(at(&tapered, -1.0, 1.0), [-0.8, 0.5]);
    assert_eq!(at(&tapered, 0.0, 0.0), [0.0, 0.0]);
}

#[test]
fn nothing_folds_over_the_whole_range() {
    let coarse = Lattice { origin: [3.0, -8.0], spacing: [40.0, 9.0], nodes: [6, 5] };
    let fine = Lattice { origin: [0.0, 0.0], spacing: [1.0, 1.0], nodes: [81, 41] };
    for shape in ALL {
        for lattice in [&coarse, &fine] {
            for bend in [-100.0, -99.0, -50.0, -1.0, 1.0, 50.0, 100.0] {
                if shape == Shape::Bulge && bend == -100.0 || shape == Shape::Twist && lattice.nodes[0] == 6 {
                    continue;
                }
                for orientation in [Orientation::Horizontal, Orientation::Vertical] {
                    let warped = bent(lattice, shape, &Bend { orientation, ..by(bend) });
                    let found = certify(lattice, &warped, UNWATCHED).expect("nobody stops it");
                    assert_eq!(found.folds, 0, "{shape:?} by {bend}, {orientation:?}: {found:?}");
                    if [Shape::Arch, Shape::Flag, Shape::Rise].contains(&shape) {
                        assert!((found.min_jacobian - 1.0).abs() < 1e-9, "{shape:?}: {found:?}");
                    }
                }
            }
        }
    }
    let collapsed = bent(&UNIT, Shape::Bulge, &by(-100.0));
    assert!(certify(&UNIT, &collapsed, UNWATCHED).expect("nobody stops it").folds > 0);
}

#[test]
fn small_changes_move_nodes_little() {
    for shape in ALL {
        for lattice in fractional_lattices() {
            let [width, height] = lattice.size();
            let (one, other) = (bent(&lattice, shape, &by(37.0)), bent(&lattice, shape, &by(37.000_001)));
            let moved = (0..lattice.node_count())
                .map(|i| ((one.x[i] - other.x[i]) / width).hypot((one.y[i] - other.y[i]) / height));
            assert!(moved.fold(0.0, f64::max) < 1e-7, "{shape:?}");
        }
    }
}

#[test]
fn huge_parameters_stay_finite() {
    let huge = Bend { bend: 1e9, horizontal_distortion: -1e9, vertical_distortion: 1e9, ..Bend::default() };
    for shape in ALL {
        for lattice in fractional_lattices() {
            let warped = bent(&lattice, shape, &huge);
            assert!(warped.x.iter().chain(&warped.y).all(|at| at.is_finite()), "{shape:?}");
        }
    }
}

#[test]
fn threads_do_not_change_it() {
    for shape in ALL {
        assert_threads_agree(|| bent(&UNIT, shape, &Bend { horizontal_distortion: 20.0, ..by(80.0) }));
    }
}
