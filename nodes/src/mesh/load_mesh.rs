use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_core::node::{Context, Node, NodeError, Output, Outputs, ReadPath};

use super::file;
use crate::io::codec::NodeHost;

/// Reads a mesh: OBJ or PLY, by the content of the file.
///
/// Polygons are cut into triangles. Texture coordinates are needed; in the file v points up, in the mesh down. Normals are
/// kept if every corner has one. Materials, groups, lines and points of an OBJ and further elements of a PLY are
/// passed over.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct LoadMesh {
    /// The file; `####` stands for the frame.
    pub path: ReadPath,
}

impl Node for LoadMesh {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = super::MESH;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let bytes = cx.read(&self.path)?;
        let mesh = file::read(&bytes, &NodeHost(cx)).or_else(|error| {
            cx.go_on()?;
            let message = format!("{}: {}", self.path.path().display(), error.message);
            Err(NodeError { message, ..error }.at("path"))
        })?;
        Ok(mesh.into())
    }
}
