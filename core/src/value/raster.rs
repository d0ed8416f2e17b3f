//! Single-plane pictures: masks, fields, labels.

use super::{Buffer, Digest, Hasher, Rect, Sample, Windows};

/// One plane of samples and where it lies.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster<T: Sample> {
    /// Display window, data window (the samples' own) and pixel aspect.
    pub windows: Windows,
    /// Samples of the data window.
    pub samples: Buffer<T>,
}

impl<T: Sample> Raster<T> {
    fn hash_into(&self, hasher: &mut Hasher) {
        hasher.digest(&self.windows.digest()).digest(&self.samples.digest());
    }
}

/// Coverage 0..=1 per pixel; as a set of pixels: coverage > 0.5.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask(pub Raster<f32>);

/// Any finite number per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Field(pub Raster<f32>);

/// One row of a label table.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Component {
    /// Its number, from 1.
    pub label: u32,
    /// Pixels.
    pub area: u64,
    /// Smallest rectangle that holds it.
    pub bounds: Rect,
    /// Mean of its pixel centres, px.
    pub centroid: [f64; 2],
}

/// A number per pixel that says to which component it belongs; 0 is background.
#[derive(Clone, Debug, PartialEq)]
pub struct Labels {
    /// Label per pixel.
    pub raster: Raster<u32>,
    /// One row per label, rising.
    pub table: Vec<Component>,
}

impl Mask {
    /// Digest of windows and samples.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("mask");
        self.0.hash_into(&mut hasher);
        hasher.finish()
    }
}

impl Field {
    /// Digest of windows and samples.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("field");
        self.0.hash_into(&mut hasher);
        hasher.finish()
    }
}

impl Labels {
    /// Digest of windows, samples and table.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("labels");
        self.raster.hash_into(&mut hasher);
        hasher.int(self.table.len() as i128);
        for row in &self.table {
            hasher.int(row.label.into()).int(row.area.into()).numbers(&row.centroid);
            row.bounds.hash_into(&mut hasher);
        }
        hasher.finish()
    }
}
