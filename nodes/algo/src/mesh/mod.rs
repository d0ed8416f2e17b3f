//! Triangle meshes: shapes, and pictures of them.
//!
//! Object space is right-handed with y up. Texture coordinates run from (0, 0) at a picture's upper left corner to
//! (1, 1) at its lower right one. The front of a triangle is where its corners run counter-clockwise.

mod camera;
mod cover;
mod polygon;
mod render;
mod shape;
#[cfg(test)]
mod tests;
mod texture;

pub use camera::Camera;
pub use polygon::triangulate;
pub use render::{Look, render};
pub use shape::{cylinder, sphere, torus};
pub use texture::Edge;

/// Triangles with texture coordinates and normals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// One per vertex.
    pub positions: Vec<[f64; 3]>,
    /// One per vertex.
    pub uvs: Vec<[f64; 2]>,
    /// One per vertex, of any length; or none.
    pub normals: Vec<[f64; 3]>,
    /// Three vertices per triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// A view of a mesh's arrays.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// One per vertex.
    pub positions: &'a [[f64; 3]],
    /// One per vertex.
    pub uvs: &'a [[f64; 2]],
    /// One per vertex, of any length; or none.
    pub normals: &'a [[f64; 3]],
    /// Three vertices per triangle.
    pub triangles: &'a [[u32; 3]],
}

impl Mesh {
    /// A view of its arrays.
    pub fn surface(&self) -> Surface<'_> {
        Surface { positions: &self.positions, uvs: &self.uvs, normals: &self.normals, triangles: &self.triangles }
    }
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The vector of length 1 in its direction; none where it has none.
fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(a, a).sqrt();
    (length > 0.0 && length.is_finite()).then(|| a.map(|component| component / length))
}

/// The sum of three vectors, each times its weight.
fn blend<const N: usize>(weights: [f64; 3], of: [[f64; N]; 3]) -> [f64; N] {
    std::array::from_fn(|i| weights[0] * of[0][i] + weights[1] * of[1][i] + weights[2] * of[2][i])
}
