//! Simple closed shapes with texture coordinates.

use super::Mesh;
use crate::{Interrupted, Watch};

/// A sphere about the origin.
///
/// The vertex at (u, v) is radius * (sin v' sin u', cos v', sin v' cos u') with u' = 2 pi (u - 1/2) and v' = pi v: u runs
/// once around the y axis, v from the upper pole to the lower one, and the middle of a picture faces +z.
///
/// * `radius`: positive and finite.
/// * `segments`, `rings`: cells around the axis, at least 3, and from pole to pole, at least 2.
///
/// The seam at u = 0 = 1 has vertices of its own for either side, at the same positions; so has a pole for each of its
/// triangles, with the u of the triangle's middle. Vertices and normals are the sphere's own, triangles lie within it.
///
/// Cost: linear in the vertices, (segments + 1) (rings + 1) - 2.
pub fn sphere(radius: f64, segments: usize, rings: usize, watch: Watch) -> Result<Mesh, Interrupted> {
    assert!(segments >= 3 && rings >= 2, "{segments} segments, {rings} rings");
    let mut mesh = Mesh::default();
    sheet(&mut mesh, segments, rings, true, watch, |column, row| {
        let ([sin_u, cos_u], [sin_v, cos_v]) = (around(column, segments), turn(row, 2 * rings));
        let sin_v = if row == 0 || row == rings { 0.0 } else { sin_v };
        let normal = [sin_v * sin_u, cos_v, sin_v * cos_u];
        (normal.map(|component| radius * component), normal)
    })?;
    Ok(mesh)
}

/// A cylinder about the y axis, half of it below the origin.
///
/// The vertex of its side at (u, v) is (radius sin u', height (1/2 - v), radius cos u') with u' = 2 pi (u - 1/2): u runs once
/// around the axis, v down. A cap shows the disc in the middle of a picture, as seen from above or below with +x to
/// the right: u = 1/2 + x / (2 radius), v = 1/2 + z / (2 radius) above and v = 1/2 - z / (2 radius) below.
///
/// * `radius`, `height`: positive and finite.
/// * `segments`, `rings`: cells around the axis, at least 3, and along it, at least 1.
/// * `caps`: whether its ends are closed.
///
/// The seam at u = 0 = 1 has vertices of its own for either side, at the same positions; so have the rims of the caps.
///
/// Cost: linear in the vertices, (segments + 1) (rings + 1), and (segments + 1) per cap.
pub fn cylinder(
    radius: f64,
    height: f64,
    segments: usize,
    rings: usize,
    caps: bool,
    watch: Watch,
) -> Result<Mesh, Interrupted> {
    assert!(segments >= 3 && rings >= 1, "{segments} segments, {rings} rings");
    let level = |row: usize| height * (0.5 - row as f64 / rings as f64);
    let mut mesh = Mesh::default();
    let cap_count = if caps { 2 } else { 0 };
    make_room(&mut mesh, (segments + 1) * (rings + 1 + cap_count), segments * (2 * rings + cap_count));
    sheet(&mut mesh, segments, rings, false, watch, |column, row| {
        let [sin_u, cos_u] = around(column, segments);
        ([radius * sin_u, level(row), radius * cos_u], [sin_u, 0.0, cos_u])
    })?;
    if caps {
        cap(&mut mesh, radius, level(0), 1.0, segments);
        cap(&mut mesh, radius, level(rings), -1.0, segments);
    }
    Ok(mesh)
}

/// A disc across the y axis that faces up (`side` 1) or down (-1).
fn cap(mesh: &mut Mesh, radius: f64, level: f64, side: f64, segments: usize) {
    let center = mesh.positions.len() as u32;
    let rim = (0..segments).map(|column| around(column, segments));
    for [x, z] in std::iter::once([0.0; 2]).chain(rim) {
        mesh.positions.push([radius * x, level, radius * z]);
        mesh.uvs.push([0.5 + x / 2.0, 0.5 + side * z / 2.0]);
        mesh.normals.push([0.0, side, 0.0]);
    }
    for column in 0..segments as u32 {
        let (here, next) = (center + 1 + column, center + 1 + (column + 1) % segments as u32);
        mesh.triangles.push(if side > 0.0 { [center, here, next] } else { [center, next, here] });
    }
}

/// A torus about the y axis.
///
/// The vertex at (u, v) is (p sin u', tube sin v', p cos u') with p = radius - tube cos v', u' = 2 pi (u - 1/2) and v' = 2 pi v: u
/// runs once around the axis, v around the tube from the inmost circle over the upper one, and the middle of a picture
/// lies outmost and faces +z.
///
/// * `radius`: from the axis to the tube's middle, finite; `tube`: of the tube, positive, at most `radius`.
/// * `segments`, `sides`: cells around the axis and around the tube, at least 3 each.
///
/// The seams at u = 0 = 1 and v = 0 = 1 have vertices of their own for either side, at the same positions.
///
/// Cost: linear in the vertices, (segments + 1) (sides + 1).
pub fn torus(radius: f64, tube: f64, segments: usize, sides: usize, watch: Watch) -> Result<Mesh, Interrupted> {
    assert!(segments >= 3 && sides >= 3, "{segments} segments, {sides} sides");
    let mut mesh = Mesh::default();
    sheet(&mut mesh, segments, sides, false, watch, |column, row| {
        let ([sin_u, cos_u], [sin_v, cos_v]) = (around(column, segments), turn(row, sides));
        let from_axis = radius - tube * cos_v;
        ([from_axis * sin_u, tube * sin_v, from_axis * cos_u], [-cos_v * sin_u, sin_v, -cos_v * cos_u])
    })?;
    Ok(mesh)
}

/// Sine and cosine of step `i` of `n` once around; the last step is the first again, bit for bit.
fn turn(i: usize, n: usize) -> [f64; 2] {
    let angle = std::f64::consts::TAU * (i % n) as f64 / n as f64;
    [libm::sin(angle), libm::cos(angle)]
}

/// The same, half a turn ahead: x and z of a column of cells around the y axis.
fn around(i: usize, n: usize) -> [f64; 2] {
    turn(i, n).map(|component| -component)
}

/// So that nothing moves while a mesh grows to this size.
fn make_room(mesh: &mut Mesh, vertex_count: usize, triangle_count: usize) {
    mesh.positions.reserve_exact(vertex_count);
    mesh.uvs.reserve_exact(vertex_count);
    mesh.normals.reserve_exact(vertex_count);
    mesh.triangles.reserve_exact(triangle_count);
}

/// A sheet of `columns` by `rows` cells, u to the right and v down as seen from its front; `vertex(column, row)` is a
/// position and a normal. A `pinched` one has a point for its first and its last row.
fn sheet(
    mesh: &mut Mesh,
    columns: usize,
    rows: usize,
    pinched: bool,
    watch: Watch,
    vertex: impl Fn(usize, usize) -> ([f64; 3], [f64; 3]),
) -> Result<(), Interrupted> {
    let is_point = |row: usize| pinched && (row == 0 || row == rows);
    let vertex_count = (columns + 1) * (rows + 1) - if pinched { 2 } else { 0 };
    make_room(mesh, vertex_count, 2 * columns * (rows - usize::from(pinched)));
    for row in 0..=rows {
        watch.progress(row as f64 / (rows + 1) as f64)?;
        let (count, middle) = if is_point(row) { (columns, 0.5) } else { (columns + 1, 0.0) };
        for column in 0..count {
            let (position, normal) = vertex(column, row);
            mesh.positions.push(position);
            mesh.normals.push(normal);
            mesh.uvs.push([(column as f64 + middle) / columns as f64, row as f64 / rows as f64]);
        }
    }
    let index = |column, row| (row * (columns + 1) + column - usize::from(pinched && row > 0)) as u32;
    for row in 0..rows {
        for column in 0..columns {
            let [left, right] = [index(column, row), index(column + 1, row)];
            let [below, below_right] = [index(column, row + 1), index(column + 1, row + 1)];
            if !is_point(row + 1) {
                mesh.triangles.push([left, below, below_right]);
            }
            if !is_point(row) {
                mesh.triangles.push([left, if is_point(row + 1) { below } else { below_right }, right]);
            }
        }
    }
    Ok(())
}
