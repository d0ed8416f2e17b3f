//! Polygons into triangles.

use super::{cross, sub};

/// Cuts a polygon in space into triangles.
///
/// A convex polygon is a fan about its first corner. Of another one ears are cut off until a triangle is left: an ear
/// is a corner that turns the polygon's own way and whose triangle holds no other corner. Ways are judged in the
/// coordinate plane that the polygon is most parallel to.
///
/// `corners`: in order, each once. Result: `corners.len() - 2` triangles as numbers of corners, turning as the polygon
/// does.
///
/// Fewer than 3 corners give nothing. A polygon that crosses itself or has no area gives some triangles between its
/// corners.
///
/// Cost: linear for a convex polygon, else up to cubic in the corners.
///
/// G. H. Meisters, "Polygons have ears", American Mathematical Monthly 82, 1975.
pub fn triangulate(corners: &[[f64; 3]]) -> Vec<[usize; 3]> {
    let flat = flattened(corners);
    let mut left: Vec<usize> = (0..corners.len()).collect();
    let mut triangles = Vec::with_capacity(corners.len().saturating_sub(2));
    while left.len() > 2 {
        let count = left.len();
        let around = |at: usize| [left[(at + count - 1) % count], left[at], left[(at + 1) % count]];
        let convex = (0..count).all(|at| area(around(at).map(|corner| flat[corner])) >= 0.0);
        if convex {
            triangles.extend((1..count - 1).map(|at| [left[0], left[at], left[at + 1]]));
            break;
        }
        let is_ear = |at: &usize| {
            let ear = around(*at);
            let points = ear.map(|corner| flat[corner]);
            let is_free = || left.iter().all(|corner| ear.contains(corner) || !holds(points, flat[*corner]));
            area(points) > 0.0 && is_free()
        };
        let ear = (0..count).find(is_ear).unwrap_or(1);
        triangles.push(around(ear));
        left.remove(ear);
    }
    triangles
}

/// The corners in the coordinate plane they are most parallel to, turning the positive way.
fn flattened(corners: &[[f64; 3]]) -> Vec<[f64; 2]> {
    let first = corners.first().copied().unwrap_or_default();
    let mut normal = [0.0; 3];
    for pair in corners.windows(2) {
        let twice_area = cross(sub(pair[0], first), sub(pair[1], first));
        normal = std::array::from_fn(|axis| normal[axis] + twice_area[axis]);
    }
    let axis = (0..3).max_by(|a, b| normal[*a].abs().total_cmp(&normal[*b].abs())).unwrap_or(2);
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let (a, b) = if normal[axis] < 0.0 { (b, a) } else { (a, b) };
    corners.iter().map(|corner| [corner[a], corner[b]]).collect()
}

/// Twice a triangle's area, positive if it turns the positive way.
fn area([p, q, r]: [[f64; 2]; 3]) -> f64 {
    (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
}

/// Whether a point lies in a triangle that turns the positive way, or on its border.
fn holds([p, q, r]: [[f64; 2]; 3], at: [f64; 2]) -> bool {
    area([p, q, at]) >= 0.0 && area([q, r, at]) >= 0.0 && area([r, p, at]) >= 0.0
}
