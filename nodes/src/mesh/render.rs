use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::composite::{self, Plane as Placement};
use warploom_algo::mesh::{self, Camera, Edge as Border, Look, Surface};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs};
use warploom_core::value::{Buffer, Channel, Image, Kind, Mesh, Plane, Rect, SampleType};

use crate::adapt::{view, view_mut, watched};

/// Draws a mesh with a picture on it, seen by a camera that circles it; transparent where nothing is.
///
/// Texture coordinates 0..1 span the picture's format. The result has channels R, G, B and A; a picture without alpha is
/// opaque, one with `Y` alone is grey. The nearest surface hides what lies behind it, even where the picture is
/// transparent. Lengths are in the mesh's own unit.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Render {
    /// What is drawn; it has texture coordinates.
    pub mesh: In<Mesh>,
    /// The picture on it.
    pub texture: In<Image>,
    /// Width and height of the result.
    #[default([512, 512])]
    #[schemars(inner(range(min = 1, max = 65536)), extend("x-unit" = "px"))]
    pub size: [u32; 2],
    /// The point that the camera circles and looks at, in the middle of the result.
    pub target: [f64; 3],
    /// From that point to the camera.
    #[default(4.0)]
    #[schemars(range(min = 0.000001, max = 1000000.0), extend("x-soft" = [0.5, 20.0]))]
    pub distance: f64,
    /// Where the camera stands around the y axis: 0 at +z, 90 at +x.
    #[schemars(extend("x-unit" = "deg", "x-soft" = [-180.0, 180.0]))]
    pub azimuth: f64,
    /// How high the camera stands; 90 looks straight down.
    #[schemars(extend("x-unit" = "deg", "x-soft" = [-90.0, 90.0]))]
    pub elevation: f64,
    /// How far the result is turned, positive clockwise.
    #[schemars(extend("x-unit" = "deg", "x-soft" = [-180.0, 180.0]))]
    pub roll: f64,
    /// Angle between the result's upper and lower edge.
    #[default(35.0)]
    #[schemars(range(min = 0.01, max = 170.0), extend("x-unit" = "deg", "x-soft" = [10.0, 90.0]))]
    pub field_of_view: f64,
    /// What is nearer to the camera, along the view, is cut off.
    #[default(0.01)]
    #[schemars(range(min = 0.000000001, max = 1000000.0), extend("x-soft" = [0.001, 1.0]))]
    pub near: f64,
    /// Samples along each side of a pixel: 4 look at 16 points in each.
    #[default(4)]
    #[schemars(range(min = 1, max = 8))]
    pub samples: u32,
    /// What lies beyond the picture's left and right edge.
    pub edge_u: Edge,
    /// What lies beyond the picture's upper and lower edge.
    pub edge_v: Edge,
    /// Azimuth and elevation of the light, as seen from the camera and moving with it: (0, 0) comes from the camera.
    #[schemars(extend("x-unit" = "deg"))]
    pub light: [f64; 2],
    /// Part of the light that comes from all sides; at 1 nothing is shaded.
    #[default(0.3)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub ambient: f64,
    /// Which sides of a triangle are drawn.
    pub sides: Sides,
}

/// What texture coordinates outside 0..1 see.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Edge {
    /// The border pixel, on and on.
    #[default]
    Clamp,
    /// The picture again.
    Wrap,
}

/// Sides of a triangle; its front is where its corners run counter-clockwise.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Sides {
    /// The front and the back.
    #[default]
    Both,
    /// The front alone: backs are as if they were not there.
    Front,
}

const NAMES: [&str; 4] = ["R", "G", "B", "A"];

impl Node for Render {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("image", Kind::Image)];

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let (mesh, texture) = (cx.get(&self.mesh), cx.get(&self.texture));
        let surface = surface(&mesh).map_err(|error| error.at("mesh"))?;
        let texture = texture_planes(cx, &texture)?;
        let [width, height] = self.size.map(|side| side as usize);
        let mut planes = cx.planes::<f32>(4, width, height)?;
        let [r, g, b, a] = &mut planes[..] else { unreachable!("four were asked for") };
        let out = [r, g, b, a].map(view_mut);
        let views = texture.each_ref().map(|plane| plane.as_ref().map(view));
        watched(cx, |watch| mesh::render(surface, views, &self.look(), out, watch))?;
        let channels = NAMES.iter().zip(planes).map(|(name, plane)| Channel {
            name: (*name).into(),
            sample_type: SampleType::Float,
            plane: Plane::F32(plane.freeze()),
        });
        Ok(Image::new(Rect::at(0, 0, width, height), channels.collect()).into())
    }
}

impl Render {
    fn look(&self) -> Look {
        let border = |edge: Edge| if edge == Edge::Wrap { Border::Wrap } else { Border::Clamp };
        Look {
            camera: Camera {
                target: self.target,
                distance: self.distance,
                azimuth_deg: self.azimuth,
                elevation_deg: self.elevation,
                roll_deg: self.roll,
                field_of_view_deg: self.field_of_view,
                near: self.near,
            },
            samples: self.samples as usize,
            edges: [border(self.edge_u), border(self.edge_v)],
            light_deg: self.light,
            ambient: self.ambient,
            two_sided: self.sides == Sides::Both,
        }
    }
}

/// The mesh's arrays, if they fit together; a plugin may have made it.
fn surface(mesh: &Mesh) -> Result<Surface<'_>, NodeError> {
    let vertex_count = mesh.positions.len();
    if mesh.uvs.is_empty() && vertex_count > 0 {
        let error = NodeError::refused("the mesh has no texture coordinates, so no picture can lie on it");
        return Err(error.at("mesh").hint("unwrap it where it was made"));
    }
    if mesh.uvs.len() != vertex_count || ![0, vertex_count].contains(&mesh.normals.len()) {
        let (uvs, normals) = (mesh.uvs.len(), mesh.normals.len());
        let message =
            format!("the mesh has {vertex_count} vertices, but {uvs} texture coordinates and {normals} normals");
        return Err(NodeError::refused(message).at("mesh").hint("look at the node that makes it"));
    }
    let wrong = |triangle: &[u32; 3]| triangle.iter().any(|vertex| *vertex as usize >= vertex_count);
    if let Some(number) = mesh.triangles.iter().position(wrong) {
        let message = format!("triangle {number} has a vertex beyond the {vertex_count} there are");
        return Err(NodeError::refused(message).at("mesh").hint("look at the node that makes it"));
    }
    Ok(Surface { positions: &mesh.positions, uvs: &mesh.uvs, normals: &mesh.normals, triangles: &mesh.triangles })
}

/// R, G, B, A of a picture over its whole format.
fn texture_planes(cx: &Context, image: &Image) -> Result<[Option<Buffer<f32>>; 4], NodeError> {
    let (layer, format) = (image.primary(), image.display);
    if format.is_empty() {
        return Err(NodeError::refused("the texture's format has no pixels; it needs at least one")
            .at("texture")
            .hint("connect a picture that has pixels"));
    }
    let is_grey = ["R", "G", "B"].iter().all(|name| layer.channel(name).is_none());
    let planes = NAMES.map(|name| {
        let name = if is_grey && name != "A" { "Y" } else { name };
        let plane = match layer.channel(name).map(|channel| &channel.plane) {
            Some(Plane::F32(plane)) if layer.data == format => return Ok(Some(plane.clone())),
            Some(Plane::F32(_)) => crate::image::placement(layer, name),
            // Opaque in its data window alone.
            None if name == "A" && layer.data != format => crate::image::alpha(layer),
            _ => return Ok(None),
        };
        let mut whole = cx.plane(format.width(), format.height())?;
        let (x0, y0) = (format.x0.into(), format.y0.into());
        composite::over(plane, Placement::Zero, Placement::Zero, x0, y0, view_mut(&mut whole));
        Ok(Some(whole.freeze()))
    });
    let [r, g, b, a] = planes;
    Ok([r?, g?, b?, a?])
}
