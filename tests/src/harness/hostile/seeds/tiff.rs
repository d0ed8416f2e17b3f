//! TIFF: strips and tiles, planes and pixels, both orders of bytes, both sizes of offsets, every packing.

use std::io::Cursor;
use std::ops::Range;

use tiff::encoder::{Compression, DeflateLevel, Predictor, TiffEncoder, colortype};

use crate::Random;
use crate::harness::hostile::repair::deflated;

/// How a TIFF is laid out.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Columns and rows of a tile; of strips of that many rows where the columns are 0.
    pub tile: [usize; 2],
    /// Samples of a pixel.
    pub count: usize,
    /// Bits of a sample; 32 are floats.
    pub bits: usize,
    /// 1 none, 5 LZW, 8 deflate, 32773 runs.
    pub compression: u32,
    /// 1 none, 2 differences.
    pub predictor: u32,
    /// Plane by plane.
    pub is_planar: bool,
    /// Offsets of 8 bytes.
    pub is_big: bool,
    /// The high byte first.
    pub high_first: bool,
    /// As Exif numbers it.
    pub orientation: u32,
}

const PLAIN: Layout = Layout {
    size: [21, 19],
    tile: [0, 8],
    count: 3,
    bits: 8,
    compression: 1,
    predictor: 1,
    is_planar: false,
    is_big: false,
    high_first: false,
    orientation: 1,
};

/// All variations of our own.
fn layouts() -> Vec<Layout> {
    let mut layouts = vec![PLAIN];
    for compression in [1, 8, 32773] {
        for (tile, is_planar) in [([0, 5], false), ([16, 16], false), ([0, 5], true), ([16, 16], true)] {
            for (count, bits) in [(1, 16), (3, 8), (4, 16), (3, 32)] {
                let high_first = compression == 8 && bits == 16;
                let is_big = is_planar && count == 3;
                let predictor = if compression == 8 && bits < 32 { 2 } else { 1 };
                layouts.push(Layout {
                    tile,
                    count,
                    bits,
                    compression,
                    predictor,
                    is_planar,
                    is_big,
                    high_first,
                    ..PLAIN
                });
            }
        }
    }
    layouts
}

/// All variations.
pub fn all() -> Vec<(String, Vec<u8>)> {
    let turned = Layout { orientation: 6, ..PLAIN };
    let layouts = layouts().into_iter().chain([turned]);
    let mut files: Vec<_> = layouts.map(|layout| (format!("{layout:?}"), file(layout))).collect();
    for (name, compression) in [
        ("LZW", Compression::Lzw),
        ("packbits", Compression::Packbits),
        ("deflate", Compression::Deflate(DeflateLevel::Fast)),
    ] {
        for predictor in [Predictor::None, Predictor::Horizontal] {
            files.push((format!("{name} by a library, {predictor:?}"), packed(compression, predictor)));
        }
    }
    files
}

fn packed(compression: Compression, predictor: Predictor) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let samples: Vec<u8> = samples(40 * 30 * 3);
    let encoder = TiffEncoder::new(&mut bytes).expect("a header");
    let mut encoder = encoder.with_compression(compression).with_predictor(predictor);
    encoder.write_image::<colortype::RGB8>(40, 30, &samples).expect("it can be written");
    bytes.into_inner()
}

fn samples(count: usize) -> Vec<u8> {
    let mut random = Random(5);
    (0..count).map(|i| (i / 8 % 60 + random.below(2)) as u8).collect()
}

/// Numbers of a file's order and size.
struct Numbers(Layout, Vec<u8>);

impl Numbers {
    fn push(&mut self, number: u64, bytes: usize) {
        match self.0.high_first {
            true => self.1.extend(&number.to_be_bytes()[8 - bytes..]),
            false => self.1.extend(&number.to_le_bytes()[..bytes]),
        }
    }

    /// An entry of a directory, of long numbers; those that do not fit into it stand at `values_at`.
    fn entry(&mut self, tag: u64, kind: u64, values: &[u32], more: &mut Numbers, values_at: u64) {
        let word = self.word();
        let value_bytes = if kind == 3 { 2 } else { 4 };
        self.push(tag, 2);
        self.push(kind, 2);
        self.push(values.len() as u64, word);
        if values.len() * value_bytes > word {
            self.push(values_at + more.1.len() as u64, word);
            values.iter().for_each(|&value| more.push(value.into(), value_bytes));
        } else {
            let end = self.1.len() + word;
            values.iter().for_each(|&value| self.push(value.into(), value_bytes));
            self.1.resize(end, 0);
        }
    }

    fn word(&self) -> usize {
        if self.0.is_big { 8 } else { 4 }
    }
}

/// The file of a layout: head, strips or tiles, directory, values that do not fit into it.
pub fn file(layout: Layout) -> Vec<u8> {
    let mut file = Numbers(layout, if layout.high_first { b"MM".to_vec() } else { b"II".to_vec() });
    let chunks: Vec<Vec<u8>> = chunks(layout);
    let head = if layout.is_big { 16 } else { 8 };
    let mut at = head as u32;
    let mut offsets = Vec::new();
    for chunk in &chunks {
        offsets.push(at);
        at += chunk.len() as u32;
    }
    file.push(if layout.is_big { 43 } else { 42 }, 2);
    if layout.is_big {
        file.push(8, 2);
        file.push(0, 2);
    }
    file.push(at.into(), file.word());
    chunks.iter().for_each(|chunk| file.1.extend(chunk));
    let sizes: Vec<u32> = chunks.iter().map(|chunk| chunk.len() as u32).collect();
    directory(&mut file, &offsets, &sizes);
    file.1
}

/// Appends the directory and what stands behind it.
fn directory(file: &mut Numbers, offsets: &[u32], sizes: &[u32]) {
    let layout = file.0;
    let is_tiled = layout.tile[0] > 0;
    let count = layout.count as u32;
    let [width, height] = layout.size.map(|side| side as u32);
    let [tile_width, tile_height] = layout.tile.map(|side| side as u32);
    let each = |value: u32| vec![value; layout.count];
    let mut entries: Vec<(u64, u64, Vec<u32>)> = vec![
        (256, 4, vec![width]),
        (257, 4, vec![height]),
        (258, 3, each(layout.bits as u32)),
        (259, 3, vec![layout.compression]),
        (262, 3, vec![if count < 3 { 1 } else { 2 }]),
        (274, 3, vec![layout.orientation]),
        (277, 3, vec![count]),
        (284, 3, vec![1 + u32::from(layout.is_planar)]),
        (317, 3, vec![layout.predictor]),
        (339, 3, each(if layout.bits == 32 { 3 } else { 1 })),
    ];
    match is_tiled {
        true => entries.extend([
            (322, 4, vec![tile_width]),
            (323, 4, vec![tile_height]),
            (324, 4, offsets.to_vec()),
            (325, 4, sizes.to_vec()),
        ]),
        false => {
            entries.extend([(273, 4, offsets.to_vec()), (278, 4, vec![tile_height]), (279, 4, sizes.to_vec())]);
        }
    }
    if count == 4 {
        entries.push((338, 3, vec![2]));
    }
    entries.sort_by_key(|entry| entry.0);
    let word = file.word();
    let counter = if layout.is_big { 8 } else { 2 };
    let values_at = file.1.len() + counter + entries.len() * (4 + 2 * word) + word;
    let mut more = Numbers(layout, Vec::new());
    file.push(entries.len() as u64, counter);
    for (tag, kind, values) in entries {
        file.entry(tag, kind, &values, &mut more, values_at as u64);
    }
    file.push(0, word);
    file.1.extend(more.1);
}

/// The strips or tiles of all planes, packed.
fn chunks(layout: Layout) -> Vec<Vec<u8>> {
    let [width, height] = layout.size;
    let is_tiled = layout.tile[0] > 0;
    let chunk_width = if is_tiled { layout.tile[0] } else { width };
    let planes = if layout.is_planar { layout.count } else { 1 };
    let samples = layout.count / planes;
    let mut chunks = Vec::new();
    for plane in 0..planes {
        for top in (0..height).step_by(layout.tile[1]) {
            for left in (0..width).step_by(chunk_width) {
                let bottom = if is_tiled { top + layout.tile[1] } else { height.min(top + layout.tile[1]) };
                let (columns, channels) = (left..left + chunk_width, plane * samples..(plane + 1) * samples);
                let rows = (top..bottom).flat_map(|y| row(layout, columns.clone(), y, channels.clone()));
                let bytes: Vec<u8> = rows.collect();
                chunks.push(match layout.compression {
                    8 => deflated(&bytes),
                    32773 => bytes.chunks(100).flat_map(|run| [&[run.len() as u8 - 1], run].concat()).collect(),
                    _ => bytes,
                });
            }
        }
    }
    chunks
}

/// A row of samples that depend on their place alone, so that every layout holds the same picture.
fn row(layout: Layout, columns: Range<usize>, y: usize, channels: Range<usize>) -> Vec<u8> {
    let value = |x: usize, c: usize| ((3 * x + 5 * y + 7 * c) % 60) as u16;
    let mut bytes = Vec::new();
    for x in columns.clone() {
        for c in channels.clone() {
            let before = if layout.predictor == 2 && x > columns.start { value(x - 1, c) } else { 0 };
            let number = value(x, c).wrapping_sub(before);
            let bits = if layout.bits == 32 { (f32::from(number) / 60.0).to_bits() } else { number.into() };
            let size = layout.bits / 8;
            match layout.high_first {
                true => bytes.extend(&bits.to_be_bytes()[4 - size..]),
                false => bytes.extend(&bits.to_le_bytes()[..size]),
            }
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use warploom_core::value::Image;
    use warploom_nodes::io::codec::{Encoding, decode};

    use super::*;

    #[test]
    fn every_layout_of_a_picture_is_read_as_the_same() {
        let mut pictures = BTreeMap::<(usize, usize), Image>::new();
        for layout in layouts() {
            let read = decode(&file(layout), Encoding::Raw, &|_: u128| Ok(())).expect("a good file");
            let first = pictures.entry((layout.count, layout.bits)).or_insert_with(|| read.clone());
            assert!(*first == read, "{layout:?}");
        }
        assert_eq!(pictures.len(), 4);
    }
}
