use warploom_core::node::{ErrorClass, NodeError};
use warploom_core::value::Mesh;

use super::read;

fn mesh(bytes: &[u8]) -> Mesh {
    read(bytes, &|_| Ok(())).expect("a sound file")
}

/// What is said of a file, which may take no more memory than it needs to be refused.
fn error(bytes: &[u8]) -> NodeError {
    let budget = 200 * bytes.len() as u128 + 1000;
    let host = |asked: u128| match asked <= budget {
        true => Ok(()),
        false => Err(NodeError::new(ErrorClass::OverBudget, format!("{asked} bytes"))),
    };
    read(bytes, &host).expect_err("a damaged file")
}

const OBJ: &str = "# a square and a triangle
mtllib some.mtl
v 0 0 0
v 1 0 0 1.0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0 0
vt 1 1
vt 0 1
vn 0 0 1
o thing
usemtl red
f 1/1/1 2/2/1 3/3/1 4/4/1 # counter-clockwise
v 2 0 0
f -4/-3/1 -1/3/-1 -3/2/1\r
";

#[test]
fn an_obj_is_read_with_v_down() {
    let mesh = mesh(OBJ.as_bytes());
    let (zero, one) = ([0.0, 1.0], [1.0, 1.0]);
    assert_eq!(
        mesh.positions,
        [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0]]
    );
    assert_eq!(mesh.uvs, [zero, one, one, [1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]);
    assert_eq!(mesh.normals, [[0.0, 0.0, 1.0]; 6]);
    assert_eq!(mesh.triangles, [[0, 1, 3], [0, 3, 4], [1, 5, 2]]);
}

#[test]
fn normals_count_if_all_corners_have_one() {
    let some = mesh(OBJ.replace("4/4/1", "4/4").as_bytes());
    assert!(some.normals.is_empty());
    assert_eq!(some.triangles.len(), 3);
}

#[test]
fn damaged_objs_are_refused_by_line() {
    let cases = [
        ("f 1/1 2/1 1/9", "line 4: there is no texture coordinate 9; the file has 1, numbered from 1"),
        ("f 1/1 2/1 3/1", "line 4: there is no vertex 3; the file has 2, numbered from 1"),
        ("f 1/1 2/1 -3/1", "line 4: there is no vertex -3; the file has 2, numbered from 1"),
        ("f 0/1 1/1 2/1", "line 4: there is no vertex 0; the file has 2, numbered from 1"),
        ("f 1/1 2/1 1/1/7", "line 4: there is no normal 7; the file has 0, numbered from 1"),
        ("f 1 2 1", "line 4: corner `1` has no texture coordinates"),
        ("f 1/1 2/1 /1", "line 4: `/1` is not a corner"),
        ("f 1/1 2/1 x", "line 4: `x` is not a corner"),
        ("f 1/1 2/1 99999999999999999999/1", "line 4: `99999999999999999999/1` is not a corner"),
        ("f 1/1 2/1\nf 1/1 1/1 1/1", "line 4: a face has 2 corners, not 3 or more"),
        ("v 1 nan 2\nf 1/1 1/1 1/1", "line 4: `nan` is not a finite number"),
        ("v 1 1e999 2\nf 1/1 1/1 1/1", "line 4: `1e999` is not a finite number"),
        ("v 1 2\nf 1/1 1/1 1/1", "line 4: a vertex takes 3 numbers"),
        ("vt\nf 1/1 1/1 1/1", "line 4: a vertex takes 1 numbers"),
        ("f 3/1 1/1 1/1\nv 0 0 0", "line 4: vertex 3 comes only later in the file"),
        ("", "OBJ: there are no faces, and 2 vertices"),
    ];
    for (lines, expected) in cases {
        let error = error(format!("v 0 0 0\nv 1 0 0\nvt 0 0\n{lines}").as_bytes());
        assert_eq!((error.class, error.message.as_str()), (ErrorClass::InputUnreadable, expected), "{lines}");
    }
    let many = format!("v 0 0 0\nvt 0 0\nf{}", " 1/1".repeat(256));
    assert_eq!(error(many.as_bytes()).message, "line 3: a face has more than 255 corners");
    assert!(mesh(many.replacen(" 1/1", "", 1).as_bytes()).triangles.len() == 253);
    assert_eq!(error(b"\x76\x2f\x31\x01\0\0").class, ErrorClass::InputUnsupported);
    assert_eq!(error(b"").class, ErrorClass::InputUnreadable);
}

const VERTICES: [[f32; 5]; 4] =
    [[0.0, 0.0, 5.0, 0.0, 0.25], [1.0, 0.0, 5.0, 1.0, 0.25], [1.0, 1.0, 5.0, 1.0, 1.0], [0.0, 1.0, 5.0, 0.0, 1.0]];

fn ply_header(format: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty float y\n\
         property uchar flags\nproperty float z\nproperty float s\nproperty float t\nelement face 1\n\
         property short material\nproperty list uchar int vertex_indices\nelement edge 1\nproperty list uint double w\n\
         end_header\n"
    )
}

fn ascii_ply() -> Vec<u8> {
    let vertices = VERTICES.map(|[x, y, z, s, t]| format!("{x} {y} 7 {z} {s} {t}\n"));
    format!("{}{}3 4 0 1 2 3\n2 0.5 0.5\n", ply_header("ascii"), vertices.concat()).into_bytes()
}

fn binary_ply(is_big: bool) -> Vec<u8> {
    let mut bytes = ply_header(if is_big { "binary_big_endian" } else { "binary_little_endian" }).into_bytes();
    let mut put = |little: &[u8]| match is_big {
        true => bytes.extend(little.iter().rev()),
        false => bytes.extend(little),
    };
    for [x, y, z, s, t] in VERTICES {
        put(&x.to_le_bytes());
        put(&y.to_le_bytes());
        put(&[7]);
        [z, s, t].iter().for_each(|number| put(&number.to_le_bytes()));
    }
    put(&3_i16.to_le_bytes());
    put(&[4]);
    (0..4_i32).for_each(|index| put(&index.to_le_bytes()));
    put(&2_u32.to_le_bytes());
    [0.5_f64; 2].iter().for_each(|number| put(&number.to_le_bytes()));
    bytes
}

#[test]
fn plys_of_all_formats_are_one_mesh() {
    let expected = Mesh {
        positions: vec![[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [1.0, 1.0, 5.0], [0.0, 1.0, 5.0]],
        uvs: vec![[0.0, 0.75], [1.0, 0.75], [1.0, 0.0], [0.0, 0.0]],
        normals: vec![],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    for bytes in [ascii_ply(), binary_ply(false), binary_ply(true)] {
        assert_eq!(mesh(&bytes), expected);
    }
    let windows = String::from_utf8(ascii_ply()).expect("text").replace('\n', "\r\n");
    assert_eq!(mesh(windows.as_bytes()), expected);
}

#[test]
fn corners_of_a_ply_may_have_texture_coordinates_of_their_own() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n\
        property float nx\nproperty float ny\nproperty float nz\nelement face 2\n\
        property list uchar uint vertex_index\nproperty list uchar float texcoord\nend_header\n\
        0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2 6 0 0 1 0 0 1\n3 2 1 0 6 0 1 0.5 0.5 0 0\n";
    let mesh = mesh(text.as_bytes());
    assert_eq!(mesh.triangles.len(), 2);
    assert_eq!(mesh.normals, [[0.0, 0.0, 1.0]; 6]);
    let uvs = mesh.triangles[1].map(|vertex| mesh.uvs[vertex as usize]);
    assert_eq!(uvs, [[0.0, 0.0], [0.5, 0.5], [0.0, 1.0]]);
}

#[test]
fn damaged_plys_are_refused_by_place() {
    let text = String::from_utf8(ascii_ply()).expect("text");
    let cases = [
        (
            "element vertex 4",
            "element vertex 4000000000000",
            "element vertex: 4000000000000 entries are announced, but",
        ),
        ("element edge 1", "element edge 18446744073709551615", "element edge: 18446744073709551615 entries are"),
        ("element vertex 4", "element vertex -4", "line 4: `element vertex -4` is not of a PLY"),
        ("3 4 0 1 2 3", "3 4 0 1 2 4", "face 0: there is no vertex 4; the file has 4, numbered from 0"),
        ("3 4 0 1 2 3", "3 4 0 1 2 -1", "face 0: there is no vertex -1; the file has 4, numbered from 0"),
        ("3 4 0 1 2 3", "3 4 0 1 2 nan", "face 0: there is no vertex NaN; the file has 4, numbered from 0"),
        ("3 4 0 1 2 3", "3 4 0 1 2 x", "face 0: vertex_indices: `x` is not a number"),
        ("3 4 0 1 2 3", "3 2 0 1", "face 0: 2 corners, not 3 to 255"),
        ("3 4 0 1 2 3", "3 1e9 0 1 2 3", "face 0: vertex_indices: a list of 1000000000 items, more than 510"),
        ("2 0.5 0.5", "4e18 0.5", "edge 0: w: the file ends here"),
        ("2 0.5 0.5", "-2", "edge 0: w: a list of -2 items"),
        ("1 0 7", "1 inf 7", "vertex 1: inf is not a finite number"),
        ("property float t\n", "property float other\n", "PLY header: texture coordinates"),
        ("property float z\n", "property float depth\n", "PLY header: `x`, `y` or `z` of vertices is missing"),
        ("vertex_indices", "corners", "PLY header: the list `vertex_indices` of faces is missing"),
        ("element face 1", "element faces 1", "PLY header: there is no element `face`"),
        ("format ascii 1.0\n", "", "PLY header: there is no format"),
        ("format ascii 1.0", "format ascii 2.0", "line 2: `format ascii 2.0` is not of a PLY"),
        ("property uchar flags", "property bits flags", "line 7: `property bits flags` is not of a PLY"),
        ("element vertex 4\n", "", "line 4: `property float x` is not of a PLY"),
        ("end_header\n", "", "line 16: `0 0 7 5 0 0.25` is not of a PLY"),
    ];
    for (sound, damaged, expected) in cases {
        let error = error(text.replacen(sound, damaged, 1).as_bytes());
        assert_eq!(error.class, ErrorClass::InputUnreadable, "{damaged}: {}", error.message);
        assert!(error.message.starts_with(expected), "{damaged}: {}", error.message);
        assert!(error.hint.is_some() || !expected.contains("numbered from"), "{damaged}");
    }
}

#[test]
fn truncated_files_are_refused_wherever_they_end() {
    for whole in [ascii_ply(), binary_ply(false), binary_ply(true)] {
        // The last number of the text may lose a digit and still be one.
        for length in 0..whole.len() - 4 {
            let error = error(&whole[..length]);
            assert!(error.class == ErrorClass::InputUnreadable && error.message.len() > 10, "{}", error.message);
        }
    }
}

#[test]
fn damaged_bytes_do_no_harm() {
    let files = [OBJ.as_bytes().to_vec(), ascii_ply(), binary_ply(false), binary_ply(true)];
    for whole in files {
        for at in 0..whole.len() {
            for byte in [0, b'-', b'9', b' ', b'\n', 0xff, whole[at] ^ 0x40] {
                let mut damaged = whole.clone();
                damaged[at] = byte;
                if let Ok(mesh) = read(&damaged, &|_| Ok(())) {
                    assert!(mesh.uvs.len() == mesh.positions.len());
                    let vertices = mesh.triangles.as_flattened().iter();
                    assert!(vertices.into_iter().all(|vertex| (*vertex as usize) < mesh.positions.len()));
                    assert!(mesh.positions.as_flattened().iter().all(|number| number.is_finite()));
                }
            }
        }
    }
}
