use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::UNWATCHED;
use crate::view::{View, ViewMut};

fn square_on() -> Look {
    // 2 tan(45 deg) = 2 units high at distance 1.
    let camera = Camera {
        target: [0.0; 3],
        distance: 1.0,
        azimuth_deg: 0.0,
        elevation_deg: 0.0,
        roll_deg: 0.0,
        field_of_view_deg: 90.0,
        near: 0.01,
    };
    Look { camera, samples: 4, edges: [Edge::Clamp; 2], light_deg: [0.0; 2], ambient: 1.0, two_sided: true }
}

/// Planes R, G, B, A.
fn picture(surface: Surface, texture: [Option<View<f32>>; 4], look: &Look, size: [usize; 2]) -> [Vec<f32>; 4] {
    let mut planes = [(); 4].map(|()| vec![-1.0; size[0] * size[1]]);
    let out = planes.each_mut().map(|plane| ViewMut::packed(plane, size[0], size[1]));
    render(surface, texture, look, out, UNWATCHED).expect("nobody interrupts");
    planes
}

fn white(surface: Surface, look: &Look, size: [usize; 2]) -> [Vec<f32>; 4] {
    let one = [1.0];
    picture(surface, [Some(View::packed(&one, 1, 1)); 4], look, size)
}

/// A square from -1 to 1 that faces +z, as a picture on a wall.
fn wall(z: f64) -> Mesh {
    Mesh {
        positions: vec![[-1.0, 1.0, z], [1.0, 1.0, z], [1.0, -1.0, z], [-1.0, -1.0, z]],
        uvs: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        normals: vec![],
        triangles: vec![[0, 3, 2], [0, 2, 1]],
    }
}

fn shapes() -> Vec<(Mesh, f64)> {
    let (pi, n) = (std::f64::consts::PI, 96);
    let shapes = [
        (sphere(2.0, n, n, UNWATCHED), 16.0 * pi),
        (cylinder(1.0, 3.0, n, 4, true, UNWATCHED), 8.0 * pi),
        (torus(2.0, 0.5, n, n, UNWATCHED), 4.0 * pi * pi),
    ];
    shapes.map(|(mesh, area)| (mesh.expect("nobody interrupts"), area)).into()
}

fn corners(mesh: &Mesh) -> impl Iterator<Item = [[f64; 3]; 3]> {
    mesh.triangles.iter().map(|triangle| triangle.map(|vertex| mesh.positions[vertex as usize]))
}

#[test]
fn shapes_are_closed_and_turn_one_way() {
    for (mesh, _) in shapes() {
        let bits = |point: [f64; 3]| point.map(|component| (component + 0.0).to_bits());
        let mut edges: HashMap<_, i32> = HashMap::new();
        for triangle in corners(&mesh) {
            for at in 0..3 {
                let (from, to) = (bits(triangle[at]), bits(triangle[(at + 1) % 3]));
                assert_ne!(from, to, "{triangle:?} has three corners");
                *edges.entry((from, to)).or_default() += 1;
                *edges.entry((to, from)).or_default() -= 1;
            }
        }
        assert!(edges.values().all(|count| *count == 0), "each edge is passed once each way");
    }
}

#[test]
fn shapes_have_their_area_and_face_outward() {
    for (mesh, area) in shapes() {
        let (mut sum, mut volume) = (0.0, 0.0);
        for (triangle, [p, q, r]) in mesh.triangles.iter().zip(corners(&mesh)) {
            let twice = cross(sub(q, p), sub(r, p));
            sum += dot(twice, twice).sqrt() / 2.0;
            volume += dot(p, cross(q, r)) / 6.0;
            for vertex in triangle {
                let normal = mesh.normals[*vertex as usize];
                assert!((dot(normal, normal) - 1.0).abs() < 1e-12);
                assert!(dot(normal, twice) > 0.0, "normals point to the front");
            }
        }
        assert!(sum < area && sum > 0.998 * area, "{sum} of {area}");
        assert!(volume > 0.0, "the front is outside");
        assert!(mesh.uvs.iter().flatten().all(|uv| (0.0..=1.0).contains(uv)));
    }
}

/// Seen from outside, no shape mirrors its texture.
#[test]
fn u_runs_right_and_v_down_as_seen_from_outside() {
    for (mesh, _) in shapes() {
        for triangle in &mesh.triangles {
            let [p, q, r] = triangle.map(|vertex| mesh.uvs[vertex as usize]);
            // Counter-clockwise with v down is a negative area.
            let area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
            assert!(area < 0.0, "{p:?} {q:?} {r:?}");
        }
    }
}

#[test]
fn the_middle_of_a_picture_faces_the_front() {
    let at_middle = |mesh: Mesh| {
        let found = mesh.uvs.iter().position(|uv| *uv == [0.5, 0.5]).expect("there is such a vertex");
        mesh.positions[found].map(|component| (component * 1e9).round() / 1e9)
    };
    assert_eq!(at_middle(sphere(2.0, 8, 4, UNWATCHED).expect("done")), [0.0, 0.0, 2.0]);
    assert_eq!(at_middle(cylinder(2.0, 1.0, 8, 4, false, UNWATCHED).expect("done")), [0.0, 0.0, 2.0]);
    assert_eq!(at_middle(torus(2.0, 0.5, 8, 4, UNWATCHED).expect("done")), [0.0, 0.0, 2.5]);
}

#[test]
fn polygons_are_cut_into_triangles_of_their_area() {
    let quad = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [1.0, 1.0, 5.0], [0.0, 1.0, 5.0]];
    assert_eq!(triangulate(&quad), [[0, 1, 2], [0, 2, 3]]);
    let area = |corners: &[[f64; 3]]| {
        let triangles = triangulate(corners);
        assert_eq!(triangles.len(), corners.len() - 2);
        let areas = triangles.into_iter().map(|triangle| {
            let [p, q, r] = triangle.map(|corner| corners[corner]);
            cross(sub(q, p), sub(r, p))[1]
        });
        areas.inspect(|area| assert!(*area > 0.0, "none turns the other way")).sum::<f64>() / 2.0
    };
    // An arrowhead and an E, both in the plane y = 3 and seen from above; any corner may come first.
    let arrow = [[0.0, 0.0], [2.0, 4.0], [4.0, 0.0], [2.0, 1.0]];
    let letter = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 2], [3, 2], [3, 3], [1, 3], [1, 4], [3, 4], [3, 5], [0, 5]]
        .map(|corner| corner.map(f64::from));
    for (flat, expected) in [(&arrow[..], 6.0), (&letter[..], 11.0)] {
        for first in 0..flat.len() {
            let turned = flat.iter().cycle().skip(first).take(flat.len());
            let corners: Vec<_> = match flat.len() {
                4 => turned.map(|[x, y]| [*x, 3.0, *y]).collect(),
                _ => turned.map(|[x, y]| [*y, 3.0, *x]).collect(),
            };
            assert_eq!(area(&corners), expected, "from corner {first}");
        }
    }
}

#[test]
fn polygons_without_sense_give_triangles_of_their_corners() {
    assert!(triangulate(&[[0.0; 3], [1.0; 3]]).is_empty());
    let twisted = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f64::NAN; 3]];
    for polygon in [&[[1.0; 3]; 7][..], &twisted] {
        let triangles = triangulate(polygon);
        assert_eq!(triangles.len(), polygon.len() - 2);
        assert!(triangles.iter().flatten().all(|corner| *corner < polygon.len()));
    }
}

/// A texture pixel per pixel: the picture is the texture, and stands upright.
#[test]
fn a_wall_shows_its_texture_pixel_by_pixel() {
    let size = [32, 32];
    let texture: Vec<f32> = (0..32 * 32).map(|i| if (i / 4 + i / 128) % 2 == 0 { 0.2 } else { 0.9 }).collect();
    let marked: Vec<f32> = (0..32 * 32).map(|i| (i as f32) / 1024.0).collect();
    let views = [Some(View::packed(&texture, 32, 32)), Some(View::packed(&marked, 32, 32)), None, None];
    let [r, g, b, a] = picture(wall(0.0).surface(), views, &square_on(), size);
    assert!(a.iter().all(|alpha| *alpha == 1.0) && b.iter().all(|blue| *blue == 0.0));
    for (at, (found, expected)) in r.iter().zip(&texture).enumerate() {
        // Where the two triangles meet, a pixel is made of two samples away from its middle.
        let on_diagonal = at % 32 == at / 32;
        assert!((found - expected).abs() < if on_diagonal { 0.3 } else { 1e-5 }, "{at}: {found} for {expected}");
    }
    assert!(g.iter().zip(&marked).all(|(found, expected)| (found - expected).abs() < 0.01));
}

#[test]
fn a_smaller_wall_covers_the_pixels_it_should() {
    let mesh = Mesh { positions: wall(0.0).positions.iter().map(|p| p.map(|c| c / 4.0)).collect(), ..wall(0.0) };
    let [.., a] = white(mesh.surface(), &square_on(), [16, 16]);
    for (at, alpha) in a.iter().enumerate() {
        let inside = (6..10).contains(&(at % 16)) && (6..10).contains(&(at / 16));
        assert_eq!(*alpha, if inside { 1.0 } else { 0.0 }, "{at}");
    }
}

/// A floor that runs away from the camera, against the point where each pixel's ray meets it.
#[test]
fn texture_coordinates_are_right_in_perspective() {
    let floor = Mesh {
        positions: vec![[-8.0, -1.0, -20.0], [8.0, -1.0, -20.0], [8.0, -1.0, 0.5], [-8.0, -1.0, 0.5]],
        ..wall(0.0)
    };
    let coordinate = |i: usize| (i as f32 + 0.5) / 1024.0;
    let across: Vec<f32> = (0..1024 * 1024).map(|i| coordinate(i % 1024)).collect();
    let along: Vec<f32> = (0..1024 * 1024).map(|i| coordinate(i / 1024)).collect();
    let views = [&across, &along].map(|plane| Some(View::packed(plane, 1024, 1024)));
    let size = [40, 40];
    let [u, v, _, a] = picture(floor.surface(), [views[0], views[1], None, None], &square_on(), size);
    let mut seen = 0;
    for (at, alpha) in a.iter().enumerate() {
        let [x, y] = [at % 40, at / 40].map(|side| (side as f64 + 0.5 - 20.0) / 20.0);
        // From the eye at (0, 0, 1) along (x, -y, -1) to the plane y = -1.
        let (hit_x, hit_z) = (x / y, 1.0 - 1.0 / y);
        // Away from the far edge, where a pixel sees much of the floor.
        if y > 0.1 && hit_x.abs() < 7.0 && *alpha == 1.0 {
            let expected = [(hit_x + 8.0) / 16.0, (hit_z + 20.0) / 20.5];
            let near = |found: f32, expected: f64| (f64::from(found) - expected).abs() < 4e-3;
            assert!(near(u[at], expected[0]) && near(v[at], expected[1]), "{at}: {} {} {expected:?}", u[at], v[at]);
            seen += 1;
        }
    }
    assert!(seen > 600, "{seen} pixels");
}

#[test]
fn coverage_is_the_area() {
    // In pixels: (2.3, 1.7), (30.1, 9.4), (11.6, 29.2).
    let corners = [[2.3, 1.7], [30.1, 9.4], [11.6, 29.2]];
    let positions = corners.map(|[x, y]: [f64; 2]| [(x - 16.0) / 16.0, (16.0 - y) / 16.0, 0.0]);
    let uvs = [[0.0; 2]; 3];
    let surface = Surface { positions: &positions, uvs: &uvs, normals: &[], triangles: &[[0, 2, 1]] };
    let [p, q, r] = corners;
    let area = ((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])) / 2.0;
    for (samples, tolerance) in [(1, 6.0), (4, 0.6), (8, 0.3)] {
        let [.., a] = white(surface, &Look { samples, ..square_on() }, [32, 32]);
        let sum: f64 = a.iter().map(|alpha| f64::from(*alpha)).sum();
        assert!((sum - area).abs() < tolerance, "{samples}: {sum} of {area}");
    }
}

/// An upright edge has a step for each of the samples, not for each of their rows.
#[test]
fn edges_have_many_steps() {
    let steps = (0..64).map(|i| {
        let x = f64::from(i) / 64.0 / 4.0;
        let positions = [[-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [x, -1.0, 0.0], [x, 1.0, 0.0]];
        let triangles = [[0, 1, 2], [0, 2, 3]];
        let surface = Surface { positions: &positions, uvs: &[[0.0; 2]; 4], normals: &[], triangles: &triangles };
        let [.., a] = white(surface, &square_on(), [8, 8]);
        assert!((f64::from(a[3 * 8 + 4]) - f64::from(i) / 64.0).abs() < 1.0 / 16.0);
        a[3 * 8 + 4].to_bits()
    });
    assert!(steps.collect::<std::collections::BTreeSet<_>>().len() >= 16);
}

#[test]
fn the_nearest_surface_is_seen_in_any_order() {
    // Two walls that pass through each other: the left half of one and the right half of the other are in front.
    let slanted = |slope: f64, value: f64| {
        let mut mesh = wall(0.0);
        mesh.positions.iter_mut().for_each(|position| position[2] = slope * position[0]);
        mesh.uvs = vec![[value, 0.5]; 4];
        mesh
    };
    let (a, b) = (slanted(0.2, 0.25), slanted(-0.2, 0.75));
    for (first, second) in [(&a, &b), (&b, &a)] {
        let mut both = first.clone();
        both.positions.extend(&second.positions);
        both.uvs.extend(&second.uvs);
        both.triangles.extend(second.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + 4)));
        let two = [0.25, 0.75];
        let [r, ..] =
            picture(both.surface(), [Some(View::packed(&two, 2, 1)), None, None, None], &square_on(), [16, 16]);
        assert_eq!((r[8 * 16 + 4], r[8 * 16 + 11]), (0.75, 0.25));
    }
}

#[test]
fn what_is_nearer_than_the_near_plane_is_cut_off() {
    // A floor from far behind the camera to far before it.
    let positions = [[-9.0, -1.0, 50.0], [9.0, -1.0, 50.0], [0.0, -1.0, -50.0]];
    let surface = Surface { positions: &positions, uvs: &[[0.0; 2]; 3], normals: &[], triangles: &[[0, 1, 2]] };
    let look = |near: f64| Look { camera: Camera { near, ..square_on().camera }, samples: 1, ..square_on() };
    let rows = |near: f64| {
        let [.., a] = white(surface, &look(near), [33, 33]);
        (0..33).filter(|row| a[row * 33 + 16] == 1.0).collect::<Vec<_>>()
    };
    // Row y sees the floor at depth 16.5 / (y + 0.5 - 16.5).
    assert_eq!(rows(0.01), (17..33).collect::<Vec<_>>());
    assert_eq!(rows(3.2), (17..22).collect::<Vec<_>>());
    assert!(rows(60.0).is_empty());
}

#[test]
fn backs_are_seen_only_if_asked_for() {
    let mut turned = wall(0.0);
    turned.triangles.iter_mut().for_each(|triangle| triangle.swap(0, 1));
    let alpha = |mesh: &Mesh, two_sided: bool| {
        let [.., a] = white(mesh.surface(), &Look { two_sided, ..square_on() }, [4, 4]);
        a[5]
    };
    assert_eq!([true, false].map(|two_sided| alpha(&turned, two_sided)), [1.0, 0.0]);
    assert_eq!([true, false].map(|two_sided| alpha(&wall(0.0), two_sided)), [1.0, 1.0]);
}

#[test]
fn light_falls_off_as_the_cosine() {
    let lit = |azimuth: f64, ambient: f64, normals: bool| {
        let mut mesh = wall(0.0);
        if normals {
            // Of any length, and on the other side of a back.
            mesh.normals = vec![[0.0, 0.0, -3.0]; 4];
            mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(0, 1));
        }
        let [r, .., a] = white(mesh.surface(), &Look { light_deg: [azimuth, 0.0], ambient, ..square_on() }, [4, 4]);
        assert_eq!(a[5], 1.0, "alpha is not lit");
        r[5]
    };
    for normals in [false, true] {
        assert_eq!(lit(0.0, 0.0, normals), 1.0);
        assert!((lit(60.0, 0.0, normals) - 0.5).abs() < 1e-6 && (lit(60.0, 0.5, normals) - 0.75).abs() < 1e-6);
        assert_eq!(lit(135.0, 0.25, normals), 0.25);
    }
}

#[test]
fn the_camera_goes_round_its_target() {
    // A dot at +x: seen at the right from +z, in the middle from +x, and at the left from -z.
    let dot = |center: [f64; 3]| {
        let mut mesh = sphere(0.1, 12, 6, UNWATCHED).expect("done");
        mesh.positions.iter_mut().for_each(|p| *p = std::array::from_fn(|i| p[i] + center[i]));
        mesh
    };
    let seen = |mesh: &Mesh, azimuth_deg: f64, elevation_deg: f64, roll_deg: f64| {
        let camera = Camera { distance: 4.0, azimuth_deg, elevation_deg, roll_deg, ..square_on().camera };
        let [.., a] = white(mesh.surface(), &Look { camera, ..square_on() }, [64, 64]);
        let sum: f32 = a.iter().sum();
        let mean = |side: fn(usize) -> usize| {
            (0..64 * 64).map(|at| a[at] * (side(at) as f32 + 0.5)).sum::<f32>() / sum / 8.0 - 4.0
        };
        [mean(|at| at % 64).round(), mean(|at| at / 64).round()]
    };
    let (right, top, front) = (dot([1.0, 0.0, 0.0]), dot([0.0, 1.0, 0.0]), dot([0.0, 0.0, 1.0]));
    let views = |mesh| {
        [(0.0, 0.0, 0.0), (90.0, 0.0, 0.0), (180.0, 0.0, 0.0), (0.0, 90.0, 0.0), (0.0, 0.0, 90.0)]
            .map(|(azimuth, elevation, roll)| seen(mesh, azimuth, elevation, roll))
    };
    assert_eq!(views(&right), [[1.0, 0.0], [0.0, 0.0], [-1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    assert_eq!(views(&top), [[0.0, -1.0], [0.0, -1.0], [0.0, -1.0], [0.0, 0.0], [1.0, 0.0]]);
    assert_eq!(views(&front)[1], [-1.0, 0.0]);
}

/// Fine stripes far below a pixel come out grey, not as other stripes.
#[test]
fn what_is_too_fine_to_see_is_grey() {
    let stripes: Vec<f32> = (0..1024 * 8).map(|i| (i % 2) as f32).collect();
    let views = [Some(View::packed(&stripes, 1024, 8)), None, None, None];
    for size in [[96, 96], [33, 33], [7, 7]] {
        let [r, ..] = picture(wall(0.0).surface(), views, &square_on(), size);
        assert!(r.iter().all(|sample| (sample - 0.5).abs() < 0.06), "{size:?}");
    }
}

#[test]
fn textures_of_any_size_keep_their_mean() {
    for [width, height] in [[1, 1], [2, 3], [7, 5], [1, 9], [13, 4]] {
        let texture: Vec<f32> = (0..width * height).map(|i| ((i * 7) % 5) as f32).collect();
        let mean = texture.iter().sum::<f32>() / texture.len() as f32;
        let [r, ..] = picture(
            wall(0.0).surface(),
            [Some(View::packed(&texture, width, height)), None, None, None],
            &square_on(),
            [1, 1],
        );
        assert!((r[0] - mean).abs() < 0.35 * mean.max(0.1), "{width} x {height}: {} for {mean}", r[0]);
        let pyramid = texture::Pyramid::new(
            &[Some(View::packed(&texture, width, height)), None, None, None],
            [width, height],
            UNWATCHED,
        );
        let smallest = pyramid.expect("nobody interrupts").smallest();
        assert!((smallest.unwrap_or(mean) - mean).abs() < 1e-5, "{width} x {height}: {smallest:?} for {mean}");
    }
}

/// The grey picture of a node is one plane three times over.
#[test]
fn planes_that_are_one_are_reduced_once() {
    struct Asked(AtomicUsize);
    impl crate::Watcher for Asked {
        fn progress(&self, _: f64) -> Result<(), crate::Interrupted> {
            Ok(())
        }
        fn go_on(&self) -> Result<(), crate::Interrupted> {
            Ok(())
        }
        fn reserve(&self, bytes: usize) -> Result<(), crate::Interrupted> {
            self.0.fetch_add(bytes, Ordering::Relaxed);
            Ok(())
        }
    }
    fn planes(samples: [&[f32]; 4]) -> [Option<View<'_, f32>>; 4] {
        samples.map(|samples| Some(View::packed(samples, 8, 6)))
    }
    let grey: Vec<f32> = (0..8 * 6).map(|i| ((i * 7) % 5) as f32).collect();
    let (copy, alpha) = (grey.clone(), vec![0.5; 8 * 6]);
    let (one, two) = ([&*grey, &grey, &grey, &alpha], [&*grey, &copy, &grey, &alpha]);
    let asked = |samples: [&[f32]; 4]| {
        let asked = Asked(AtomicUsize::new(0));
        texture::Pyramid::new(&planes(samples), [8, 6], &asked).expect("nobody interrupts");
        asked.0.into_inner()
    };
    // 4 x 3, 2 x 1 and 1 x 1 samples of 4 bytes.
    assert_eq!((asked(one), asked(two)), (2 * 15 * 4, 3 * 15 * 4));
    let drawn = |samples| picture(wall(0.0).surface(), planes(samples), &square_on(), [3, 2]);
    let (one, two) = (drawn(one), drawn(two));
    assert_eq!(one, two);
    assert!(one[0] == one[1] && one[0] == one[2] && one[0] != one[3]);
}

/// Most tiles see no triangle.
#[test]
fn what_is_empty_is_written_everywhere() {
    let mut mesh = wall(0.0);
    mesh.positions.iter_mut().for_each(|[x, y, _]| (*x, *y) = (0.05 * *x + 0.5, 0.05 * *y + 0.5));
    let [r, .., a] = white(mesh.surface(), &square_on(), [200, 100]);
    let covered = a.iter().zip(0..).filter(|(alpha, _)| **alpha > 0.0).map(|(_, at)| [at % 200, at / 200]);
    let inside = covered.filter(|[x, y]| (122..128).contains(x) && (22..28).contains(y)).count();
    assert_eq!(inside, a.iter().filter(|alpha| **alpha > 0.0).count());
    assert!(inside > 0 && r == a && a.iter().all(|alpha| (0.0..=1.0).contains(alpha)));
}

#[test]
fn edges_clamp_or_wrap() {
    let mut mesh = wall(0.0);
    mesh.uvs.iter_mut().for_each(|uv| *uv = [3.0 * uv[0] - 1.0, uv[1]]);
    let ramp: Vec<f32> = (0..4).map(|i| i as f32).collect();
    let row = |edge: Edge| {
        let look = Look { edges: [edge, Edge::Clamp], samples: 1, ..square_on() };
        let [r, ..] = picture(mesh.surface(), [Some(View::packed(&ramp, 4, 1)), None, None, None], &look, [12, 12]);
        r[..12].iter().map(|sample| (sample * 1e3).round() / 1e3).collect::<Vec<_>>()
    };
    assert_eq!(row(Edge::Clamp), [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0, 3.0]);
    assert_eq!(row(Edge::Wrap), [0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0]);
}

#[test]
fn wild_numbers_do_no_harm() {
    let wild = [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0, 1e-300];
    let texture = [f32::NAN, 1.0, f32::INFINITY, 0.5];
    let views = [Some(View::packed(&texture, 2, 2)); 4];
    for a in wild {
        for b in wild {
            let mut mesh = wall(0.0);
            mesh.positions[1] = [a, b, 0.5];
            mesh.uvs[2] = [b, a];
            mesh.normals = vec![[a, 1.0, b]; 4];
            let [.., alpha] = picture(mesh.surface(), views, &square_on(), [20, 20]);
            assert_eq!(alpha.len(), 400);
            let camera = Camera { distance: a.abs().min(1e300), target: [b; 3], ..square_on().camera };
            picture(wall(0.0).surface(), views, &Look { camera, ..square_on() }, [20, 20]);
        }
    }
    let [.., a] = white(Mesh::default().surface(), &square_on(), [3, 3]);
    assert_eq!(a, [0.0; 9]);
}

/// Neighbours leave no pixel between them open, however the mesh is turned.
#[test]
fn closed_shapes_have_no_cracks() {
    let mesh = sphere(1.0, 24, 12, UNWATCHED).expect("done");
    for turn in 0..6 {
        let angle = f64::from(turn) * 17.3;
        let camera = Camera {
            distance: 1.2,
            azimuth_deg: angle,
            elevation_deg: 2.0 * angle,
            roll_deg: angle,
            ..square_on().camera
        };
        // From so near the sphere fills the picture.
        let [.., a] = white(mesh.surface(), &Look { camera, two_sided: false, ..square_on() }, [48, 48]);
        assert!(a.iter().all(|alpha| *alpha == 1.0), "turned {angle}");
    }
}

#[test]
fn any_count_of_threads_gives_the_same_bits() {
    let mesh = torus(1.0, 0.4, 60, 30, UNWATCHED).expect("done");
    let texture: Vec<f32> = (0..64 * 40).map(|i| ((i * 37) % 101) as f32 / 100.0).collect();
    let views = [Some(View::packed(&texture, 64, 40)); 4];
    let camera = Camera { distance: 3.0, elevation_deg: 35.0, ..square_on().camera };
    let look = Look { camera, ambient: 0.2, edges: [Edge::Wrap; 2], ..square_on() };
    let bits = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let planes = pool.install(|| picture(mesh.surface(), views, &look, [75, 53]));
        planes.concat().into_iter().map(f32::to_bits).collect::<Vec<_>>()
    };
    let one = bits(1);
    assert!(one.iter().any(|bits| *bits != 0));
    assert!([2, 3, 8].into_iter().all(|threads| bits(threads) == one));
}

#[test]
fn refused_memory_and_cancelling_stop_it() {
    struct Refuses(usize);
    impl crate::Watcher for Refuses {
        fn progress(&self, _: f64) -> Result<(), crate::Interrupted> {
            Ok(())
        }
        fn go_on(&self) -> Result<(), crate::Interrupted> {
            Ok(())
        }
        fn reserve(&self, bytes: usize) -> Result<(), crate::Interrupted> {
            if bytes > self.0 { Err(crate::Interrupted) } else { Ok(()) }
        }
    }
    let mesh = sphere(0.5, 64, 32, UNWATCHED).expect("done");
    let run = |watch: crate::Watch| {
        let mut planes = [(); 4].map(|()| vec![0.0; 64 * 64]);
        let out = planes.each_mut().map(|plane| ViewMut::packed(plane, 64, 64));
        let one = [1.0];
        render(mesh.surface(), [Some(View::packed(&one, 1, 1)); 4], &square_on(), out, watch)
    };
    assert_eq!(run(&Refuses(1000)), Err(crate::Interrupted));
    assert_eq!(run(&Refuses(1 << 20)), Ok(()));
    let stopped: crate::Watch = &|_| Err(crate::Interrupted);
    assert_eq!(run(stopped), Err(crate::Interrupted));
    assert_eq!(sphere(1.0, 8, 8, stopped), Err(crate::Interrupted));
}
