//! Values as bytes, for the disk tier: a JSON header, then raw little-endian blocks.
//!
//! The bytes carry no checksum of their own: whoever reads them back compares the decoded value's digest with the
//! one it asked for.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{
    Buffer, BufferMut, Channel, Component, Direction, Field, Grid, Image, Labels, Layer, Mask, Mesh, Metadata, Plane,
    Points, Raster, Rect, Sample, SampleType, Value, Warp, Windows,
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
    Mesh(Mesh),
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

/// The bytes of a value; `None` for kinds that live in memory only.
pub fn encode(value: &Value) -> Option<Vec<u8>> {
    let header = serde_json::to_vec(&header(value)?).ok()?;
    let mut bytes = Vec::with_capacity(8 + header.len() + value.bytes() as usize);
    bytes.extend_from_slice(&(header.len() as u64).to_le_bytes());
    bytes.extend_from_slice(&header);
    match value {
        Value::Image(image) => {
            for channel in image.layers.iter().flat_map(|layer| &layer.channels) {
                match &channel.plane {
                    Plane::F32(buffer) => push_rows(&mut bytes, buffer),
                    Plane::U32(buffer) => push_rows(&mut bytes, buffer),
                }
            }
        }
        Value::Mask(mask) => push_rows(&mut bytes, &mask.0.samples),
        Value::Field(field) => push_rows(&mut bytes, &field.0.samples),
        Value::Labels(labels) => push_rows(&mut bytes, &labels.raster.samples),
        Value::Warp(warp) => {
            bytes.extend_from_slice(bytemuck::cast_slice(&warp.x));
            bytes.extend_from_slice(bytemuck::cast_slice(&warp.y));
        }
        _ => {}
    }
    Some(bytes)
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
        Value::Mesh(mesh) => Header::Mesh((**mesh).clone()),
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

fn push_rows<T: Sample>(blocks: &mut Vec<u8>, buffer: &Buffer<T>) {
    for row in buffer.rows() {
        blocks.extend_from_slice(bytemuck::cast_slice(row));
    }
}

/// The value that [`encode`] wrote; `None` if the bytes are anything else.
pub fn decode(bytes: &[u8]) -> Option<Value> {
    let (length, rest) = bytes.split_at_checked(8)?;
    let length = usize::try_from(u64::from_le_bytes(length.try_into().ok()?)).ok()?;
    let (header, blocks) = rest.split_at_checked(length)?;
    let mut blocks = Blocks(blocks);
    let value = match serde_json::from_slice(header).ok()? {
        Header::Image { display, pixel_aspect, metadata, layers } => {
            let layers = layers.into_iter().map(|layer| read_layer(layer, &mut blocks)).collect::<Option<Vec<_>>>()?;
            if layers.is_empty() {
                return None;
            }
            Image { display, pixel_aspect, metadata: Arc::new(metadata), layers }.into()
        }
        Header::Mask(windows) => Mask(blocks.raster(windows)?).into(),
        Header::Field(windows) => Field(blocks.raster(windows)?).into(),
        Header::Labels { windows, table } => Labels { raster: blocks.raster(windows)?, table }.into(),
        Header::Grid(grid) => grid.into(),
        Header::Warp { grid, direction } => {
            let count = grid.nodes[0].checked_mul(grid.nodes[1])?;
            let (x, y) = (blocks.numbers(count)?, blocks.numbers(count)?);
            Warp { grid, direction, x: Arc::new(x), y: Arc::new(y) }.into()
        }
        Header::Points(points) => points.into(),
        Header::Mesh(mesh) => mesh.into(),
        Header::Number(bits) => Value::Number(f64::from_bits(bits)),
        Header::Text(text) => Value::Text(text.into()),
    };
    blocks.0.is_empty().then_some(value)
}

fn read_layer(layer: LayerHeader, blocks: &mut Blocks<'_>) -> Option<Layer> {
    let (width, height) = (layer.data.width(), layer.data.height());
    let mut channels = Vec::with_capacity(layer.channels.len());
    for (name, sample_type, is_uint) in layer.channels {
        let plane = match is_uint {
            true => Plane::U32(blocks.buffer(width, height)?),
            false => Plane::F32(blocks.buffer(width, height)?),
        };
        channels.push(Channel { name: name.into(), sample_type, plane });
    }
    Some(Layer { name: layer.name.into(), data: layer.data, channels, metadata: Arc::new(layer.metadata) })
}

/// The blocks not read yet. Lengths are checked before anything is allocated.
struct Blocks<'a>(&'a [u8]);

impl<'a> Blocks<'a> {
    fn take(&mut self, length: usize) -> Option<&'a [u8]> {
        let (block, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(block)
    }

    fn buffer<T: Sample>(&mut self, width: usize, height: usize) -> Option<Buffer<T>> {
        let row_bytes = width.checked_mul(size_of::<T>())?;
        let block = self.take(row_bytes.checked_mul(height)?)?;
        let mut buffer = BufferMut::<T>::zeroed(width, if width == 0 { 0 } else { height });
        if width > 0 {
            for (y, row) in block.chunks_exact(row_bytes).enumerate() {
                bytemuck::cast_slice_mut(buffer.row_mut(y)).copy_from_slice(row);
            }
            return Some(buffer.freeze());
        }
        Some(BufferMut::zeroed(0, height).freeze())
    }

    fn raster<T: Sample>(&mut self, windows: Windows) -> Option<Raster<T>> {
        Some(Raster { windows, samples: self.buffer(windows.data.width(), windows.data.height())? })
    }

    fn numbers(&mut self, count: usize) -> Option<Vec<f64>> {
        let block = self.take(count.checked_mul(8)?)?;
        Some(block.chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap_or_default())).collect())
    }
}
