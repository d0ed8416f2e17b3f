//! Mesh files to meshes, in memory.
//!
//! Nothing here knows paths or nodes. Whatever a file claims is held against its size, and reserved with the caller, before
//! memory is taken for it.

mod obj;
mod ply;
#[cfg(test)]
mod tests;

use warploom_algo::mesh::triangulate;
use warploom_core::node::{ErrorClass, NodeError};
use warploom_core::value::Mesh;

use crate::io::codec::Host;

/// The mesh of a file.
pub fn read(bytes: &[u8], host: &dyn Host) -> Result<Mesh, NodeError> {
    let soup = match () {
        () if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") => ply::read(bytes, host)?,
        () if bytes.iter().take(4096).any(|byte| *byte == 0) => {
            let error = NodeError::new(ErrorClass::InputUnsupported, "this is neither an OBJ nor a PLY");
            return Err(error.hint("convert it to one of these"));
        }
        () => obj::read(bytes, host)?,
    };
    soup.welded(host)
}

fn damaged(place: impl std::fmt::Display, problem: impl std::fmt::Display) -> NodeError {
    NodeError::new(ErrorClass::InputUnreadable, format!("{place}: {problem}"))
}

/// An index that leads nowhere, in a list of `count` things that the format numbers from `first`.
fn beyond(
    error: impl Fn(String) -> NodeError,
    thing: &str,
    index: impl std::fmt::Display,
    count: usize,
    first: u8,
) -> NodeError {
    let problem = format!("there is no {thing} {index}; the file has {count}, numbered from {first}");
    error(problem).hint("export the mesh again")
}

/// What stands in a file, short enough to be shown.
fn shown(text: &[u8]) -> String {
    String::from_utf8_lossy(&text[..text.len().min(40)]).into_owned()
}

/// A file's texture coordinates, v up, as a mesh's, v down.
fn v_down([u, v]: [f64; 2]) -> [f64; 2] {
    [u, 1.0 - v]
}

/// Most corners of a face.
const MAX_CORNERS: usize = 255;

/// No normal.
const NONE: u32 = u32::MAX;

/// Indices of a corner's position, texture coordinates and normal, or [`NONE`].
type Corner = [u32; 3];

/// Triangles whose corners choose from lists, as files have them.
struct Soup {
    positions: Vec<[f64; 3]>,
    uvs: Vec<[f64; 2]>,
    normals: Vec<[f64; 3]>,
    triangles: Vec<[Corner; 3]>,
}

impl Soup {
    fn with_room_for(counts: &Counts, host: &dyn Host) -> Result<Self, NodeError> {
        let [positions, uvs, normals, triangles] =
            [counts.positions, counts.uvs, counts.normals, counts.triangles].map(|count| count as u128);
        host.reserve(24 * positions + 16 * uvs + 24 * normals + 36 * triangles)?;
        if counts.positions.max(counts.uvs).max(counts.normals).max(counts.triangles * 3) >= NONE as usize {
            return Err(NodeError::new(ErrorClass::InputUnsupported, "more than 4294967295 vertices"));
        }
        Ok(Self {
            positions: Vec::with_capacity(counts.positions),
            uvs: Vec::with_capacity(counts.uvs),
            normals: Vec::with_capacity(counts.normals),
            triangles: Vec::with_capacity(counts.triangles),
        })
    }

    /// Adds a face, in triangles.
    fn face(&mut self, corners: &[Corner]) {
        if let [p, q, r] = corners {
            return self.triangles.push([*p, *q, *r]);
        }
        let positions: Vec<_> = corners.iter().map(|corner| self.positions[corner[0] as usize]).collect();
        let triangles = triangulate(&positions).into_iter();
        self.triangles.extend(triangles.map(|triangle| triangle.map(|corner| corners[corner])));
    }

    /// One vertex for all corners that are alike, in the order of their indices.
    fn welded(mut self, host: &dyn Host) -> Result<Mesh, NodeError> {
        let corner_count = 3 * self.triangles.len();
        host.reserve((corner_count * size_of::<Corner>()) as u128)?;
        let has_normals = self.triangles.as_flattened().iter().all(|corner| corner[2] != NONE);
        if !has_normals {
            self.triangles.as_flattened_mut().iter_mut().for_each(|corner| corner[2] = NONE);
        }
        let mut vertices = self.triangles.as_flattened().to_vec();
        vertices.sort_unstable();
        vertices.dedup();
        host.reserve(vertices.len() as u128 * if has_normals { 64 } else { 40 } + 4 * corner_count as u128)?;
        let index = |corner: &Corner| vertices.binary_search(corner).expect("every corner is there") as u32;
        let normals = if has_normals { &vertices[..] } else { &[] };
        let mut triangles = Vec::with_capacity(self.triangles.len());
        for portion in self.triangles.chunks(PORTION) {
            host.go_on()?;
            triangles.extend(portion.iter().map(|triangle| triangle.each_ref().map(index)));
        }
        Ok(Mesh {
            positions: vertices.iter().map(|vertex| self.positions[vertex[0] as usize]).collect(),
            uvs: vertices.iter().map(|vertex| v_down(self.uvs[vertex[1] as usize])).collect(),
            normals: normals.iter().map(|vertex| self.normals[vertex[2] as usize]).collect(),
            triangles,
        })
    }
}

/// How much a file holds.
#[derive(Default)]
struct Counts {
    positions: usize,
    uvs: usize,
    normals: usize,
    triangles: usize,
}

/// Lines, elements or triangles between two looks at the host.
const PORTION: usize = 4096;
