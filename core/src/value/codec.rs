//! Values as bytes, for the disk tier: a JSON header, then raw little-endian blocks.

use std::io::{self, Read, Write};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{
    Buffer, BufferMut, Channel, Component, Digest, Direction, Field, Grid, Image, Labels, Layer, Mask, Mesh, Metadata,
    Plane, Points, Raster, Rect, Sample, SampleType, Value, Warp, Windows,
};

/// Everything of a value but its large arrays.
#[derive(Serialize, Deserialize)]
enum Header {
    Image { display: Rect, pixel_aspect: f64, metadata: Metadata, layers: Vec<LayerHeader> },
    Mask(Windows),
    Field(Windows),
    Labels { windows: Windows, table: Vec<Component> },
    Grid(Grid),
    Warp { grid: Grid, direction: Direction },
    Points(Points),
    Mesh { positions: usize, uvs: usize, normals: usize, triangles: usize },
    Number(u64),
    Text(String),
}

#[derive(Serialize, Deserialize)]
struct LayerHeader {
    name: String,
    data: Rect,
    metadata: Metadata,
    channels: Vec<(String, SampleType, bool)>,
}

/// Writes the bytes of a value. Kinds that live in memory only ([`Value::is_storable`]) are an error.
///
/// First the checksum, length and text of the header, then the large arrays: their bytes are all in the value's digest.
pub fn encode(value: &Value, out: &mut dyn Write) -> io::Result<()> {
    let header = header(value).ok_or_else(|| io::Error::from(io::ErrorKind::Unsupported))?;
    let header = serde_json::to_vec(&header)?;
    out.write_all(&Digest::of_bytes(&header).0)?;
    out.write_all(&(header.len() as u64).to_le_bytes())?;
    out.write_all(&header)?;
    for plane in value.planes() {
        match &plane {
            Plane::F32(buffer) => write_rows(out, buffer)?,
            Plane::U32(buffer) => write_rows(out, buffer)?,
        }
    }
    if let Value::Warp(warp) = value {
        out.write_all(bytemuck::cast_slice(&warp.x))?;
        out.write_all(bytemuck::cast_slice(&warp.y))?;
    }
    if let Value::Mesh(mesh) = value {
        out.write_all(bytemuck::cast_slice(&mesh.positions))?;
        out.write_all(bytemuck::cast_slice(&mesh.uvs))?;
        out.write_all(bytemuck::cast_slice(&mesh.normals))?;
        out.write_all(bytemuck::cast_slice(&mesh.triangles))?;
    }
    Ok(())
}

fn header(value: &Value) -> Option<Header> {
    Some(match value {
        Value::Image(image) => image_header(image),
        Value::Mask(mask) => Header::Mask(mask.0.windows),
        Value::Field(field) => Header::Field(field.0.windows),
        Value::Labels(labels) => Header::Labels { windows: labels.raster.windows, table: labels.table.clone() },
        Value::Grid(grid) => Header::Grid(**grid),
        Value::Warp(warp) => Header::Warp { grid: warp.grid, direction: warp.direction },
        Value::Points(points) => Header::Points((**points).clone()),
        Value::Mesh(mesh) => Header::Mesh {
            positions: mesh.positions.len(),
            uvs: mesh.uvs.len(),
            normals: mesh.normals.len(),
            triangles: mesh.triangles.len(),
        },
        Value::Number(number) => Header::Number(number.to_bits()),
        Value::Text(text) => Header::Text(text.to_string()),
        Value::Factor(_) | Value::Plugin(_) => return None,
    })
}

fn image_header(image: &Image) -> Header {
    let layers = image.layers.iter().map(|layer| LayerHeader {
        name: layer.name.to_string(),
        data: layer.data,
        metadata: (*layer.metadata).clone(),
        channels: layer
            .channels
            .iter()
            .map(|channel| (channel.name.to_string(), channel.sample_type, matches!(channel.plane, Plane::U32(_))))
            .collect(),
    });
    Header::Image {
        display: image.display,
        pixel_aspect: image.pixel_aspect,
        metadata: (*image.metadata).clone(),
        layers: layers.collect(),
    }
}

fn write_rows<T: Sample>(out: &mut dyn Write, buffer: &Buffer<T>) -> io::Result<()> {
    if buffer.width() == buffer.stride() {
        return out.write_all(bytemuck::cast_slice(buffer.samples()));
    }
    buffer.rows().try_for_each(|row| out.write_all(bytemuck::cast_slice(row)))
}

/// The value that [`encode`] wrote, from a file of `size` bytes; `None` if the bytes are anything else. The caller
/// compares the value's digest with the one it asked for. Nothing larger than the file is allocated, but for
/// the padding of rows.
pub fn decode(input: &mut dyn Read, size: u64) -> io::Result<Option<Value>> {
    match read_value(&mut Blocks { input, left: size }) {
        Ok(value) => Ok(Some(value)),
        Err(Broken::Content) => Ok(None),
        Err(Broken::Input(error)) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(None),
        Err(Broken::Input(error)) => Err(error),
    }
}

/// Why bytes give no value.
enum Broken {
    /// They are not what was written.
    Content,
    /// They cannot be read.
    Input(io::Error),
}

impl From<io::Error> for Broken {
    fn from(error: io::Error) -> Self {
        Broken::Input(error)
    }
}

fn read_value(blocks: &mut Blocks<'_>) -> Result<Value, Broken> {
    let checksum = blocks.bytes(32)?;
    let length = blocks.bytes(8)?.try_into().map_or(0, u64::from_le_bytes);
    let header = blocks.bytes(length)?;
    if Digest::of_bytes(&header).0 != *checksum {
        return Err(Broken::Content);
    }
    let value = match serde_json::from_slice(&header).map_err(|_| Broken::Content)? {
        Header::Image { display, pixel_aspect, metadata, layers } => {
            let layers = layers.into_iter().map(|layer| read_layer(layer, blocks)).collect::<Result<Vec<_>, _>>()?;
            if layers.is_empty() {
                return Err(Broken::Content);
            }
            Image { display, pixel_aspect, metadata: Arc::new(metadata), layers }.into()
        }
        Header::Mask(windows) => Mask(blocks.raster(windows)?).into(),
        Header::Field(windows) => Field(blocks.raster(windows)?).into(),
        Header::Labels { windows, table } => Labels { raster: blocks.raster(windows)?, table }.into(),
        Header::Grid(grid) => grid.into(),
        Header::Warp { grid, direction } => {
            let count = grid.nodes[0].checked_mul(grid.nodes[1]).ok_or(Broken::Content)?;
            let (x, y) = (blocks.array(count)?, blocks.array(count)?);
            Warp { grid, direction, x: Arc::new(x), y: Arc::new(y) }.into()
        }
        Header::Points(points) => points.into(),
        Header::Mesh { positions, uvs, normals, triangles } => Mesh {
            positions: blocks.array(positions)?,
            uvs: blocks.array(uvs)?,
            normals: blocks.array(normals)?,
            triangles: blocks.array(triangles)?,
        }
        .into(),
        Header::Number(bits) => Value::Number(f64::from_bits(bits)),
        Header::Text(text) => Value::Text(text.into()),
    };
    if blocks.left > 0 { Err(Broken::Content) } else { Ok(value) }
}

fn read_layer(layer: LayerHeader, blocks: &mut Blocks<'_>) -> Result<Layer, Broken> {
    let (width, height) = (layer.data.width(), layer.data.height());
    let mut channels = Vec::with_capacity(layer.channels.len());
    for (name, sample_type, is_uint) in layer.channels {
        let plane = match is_uint {
            true => Plane::U32(blocks.buffer(width, height)?),
            false => Plane::F32(blocks.buffer(width, height)?),
        };
        channels.push(Channel { name: name.into(), sample_type, plane });
    }
    Ok(Layer { name: layer.name.into(), data: layer.data, channels, metadata: Arc::new(layer.metadata) })
}

/// What is left of a file. Lengths are held against it before anything is allocated.
struct Blocks<'a> {
    input: &'a mut dyn Read,
    left: u64,
}

impl Blocks<'_> {
    fn take(&mut self, length: u64) -> Result<(), Broken> {
        self.left = self.left.checked_sub(length).ok_or(Broken::Content)?;
        Ok(())
    }

    fn bytes(&mut self, length: u64) -> Result<Vec<u8>, Broken> {
        self.take(length)?;
        let mut bytes = vec![0; usize::try_from(length).map_err(|_| Broken::Content)?];
        self.input.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    fn buffer<T: Sample>(&mut self, width: usize, height: usize) -> Result<Buffer<T>, Broken> {
        if width == 0 {
            return Ok(BufferMut::zeroed(0, height).freeze());
        }
        let bytes = (width as u128 * height as u128).checked_mul(size_of::<T>() as u128).ok_or(Broken::Content)?;
        self.take(u64::try_from(bytes).map_err(|_| Broken::Content)?)?;
        let mut buffer = BufferMut::<T>::zeroed(width, height);
        if buffer.stride() == width {
            self.input.read_exact(bytemuck::cast_slice_mut(buffer.samples_mut()))?;
        } else {
            (0..height).try_for_each(|y| self.input.read_exact(bytemuck::cast_slice_mut(buffer.row_mut(y))))?;
        }
        Ok(buffer.freeze())
    }

    fn raster<T: Sample>(&mut self, windows: Windows) -> Result<Raster<T>, Broken> {
        Ok(Raster { windows, samples: self.buffer(windows.data.width(), windows.data.height())? })
    }

    fn array<T: bytemuck::Pod>(&mut self, count: usize) -> Result<Vec<T>, Broken> {
        self.take((count as u64).checked_mul(size_of::<T>() as u64).ok_or(Broken::Content)?)?;
        let mut items = vec![T::zeroed(); count];
        self.input.read_exact(bytemuck::cast_slice_mut(&mut items))?;
        Ok(items)
    }
}
