//! Triangle meshes: from files, simple shapes, and pictures of them.

mod cylinder;
mod file;
mod load_mesh;
mod render;
mod sphere;
mod torus;

pub use cylinder::Cylinder;
pub use load_mesh::LoadMesh;
pub use render::Render;
pub use sphere::Sphere;
pub use torus::Torus;

use warploom_algo::mesh as algo;
use warploom_algo::{Interrupted, Watch};
use warploom_core::node::{Context, NodeError, Output, Outputs};
use warploom_core::value::{Kind, Mesh};

use crate::adapt::watched;

const MESH: &[Output] = &[Output::new("mesh", Kind::Mesh)];

/// Bytes of a vertex: position, texture coordinates, normal.
const BYTES_PER_VERTEX: u128 = 64;
const BYTES_PER_TRIANGLE: u128 = 12;

/// A shape of about so many cells, once there is room for it.
fn shape(
    cx: &Context,
    [columns, rows]: [u32; 2],
    make: impl FnOnce(Watch) -> Result<algo::Mesh, Interrupted>,
) -> Result<Outputs, NodeError> {
    let [columns, rows] = [columns, rows].map(u128::from);
    cx.reserve((columns + 1) * (rows + 1) * BYTES_PER_VERTEX + 2 * columns * rows * BYTES_PER_TRIANGLE)?;
    let algo::Mesh { positions, uvs, normals, triangles } = watched(cx, make)?;
    Ok(Outputs::from(Mesh { positions, uvs, normals, triangles }))
}
