//! OpenEXR: every compression, several parts, tiles with smaller levels and without.

use std::io::Cursor;
use std::sync::Arc;

use exr::compression::Compression as Packing;
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Layer as ExrLayer, Levels};
use exr::math::{RoundingMode, Vec2};
use exr::meta::attribute::LineOrder;
use exr::meta::header::LayerAttributes;
use exr::prelude::WritableImage;
use warploom_core::value::{Attribute, Buffer, Channel, Image, Layer, Plane, SampleType};
use warploom_nodes::io::codec::{Compression, WriteOptions, encode_image};

/// Those the codec can write.
const ALL: [Compression; 10] = [
    Compression::None,
    Compression::Rle,
    Compression::Zips,
    Compression::Zip,
    Compression::Piz,
    Compression::Pxr24,
    Compression::B44,
    Compression::B44a,
    Compression::Dwaa,
    Compression::Dwab,
];

/// All variations.
pub fn all() -> Vec<(String, Vec<u8>)> {
    let one = picture();
    let mut two = one.clone();
    let first = &one.layers[0];
    two.layers = ["left", "right"].map(|name| Layer { name: name.into(), ..first.clone() }).into();
    let packed = |image: &Image, compression| {
        let options = WriteOptions { compression, ..WriteOptions::default() };
        encode_image(image, "exr", &options, &|_: u128| Ok(())).expect("it can be written")
    };
    let mut files: Vec<_> = ALL.iter().map(|&c| (format!("{c:?}"), packed(&one, c))).collect();
    let parts = [Compression::Zip, Compression::Rle, Compression::Dwaa];
    files.extend(parts.map(|c| (format!("two parts, {c:?}"), packed(&two, c))));
    let tiles = [Packing::Uncompressed, Packing::RLE, Packing::ZIP16, Packing::PIZ, Packing::PXR24, Packing::B44];
    files.extend(tiles.map(|packing| (format!("tiles, {packing}"), tiled(packing, false))));
    files.push(("levels of tiles".to_owned(), tiled(Packing::ZIP16, true)));
    files
}

/// All types of samples, a name that is not ASCII, and attributes nobody knows.
fn picture() -> Image {
    let mut image = super::picture(&["A", "B", "G", "R"], SampleType::Half);
    let data = image.layers[0].data;
    let depth = super::picture(&["Z"], SampleType::Float).layers[0].channels[0].clone();
    let ids: Vec<u32> = (0..data.width() * data.height()).map(|i| 7 * (i as u32 / 50)).collect();
    let plane = Plane::U32(Buffer::from_packed(&ids, data.width(), data.height()));
    image.layers[0].channels.extend([depth, Channel { name: "äid".into(), sample_type: SampleType::Uint, plane }]);
    let odd = |kind: &str, bytes: &[u8]| Attribute { kind: kind.to_owned(), bytes: bytes.to_vec() };
    image.metadata =
        Arc::new([("odd".to_owned(), odd("unknown", &[1, 2, 3])), ("t".to_owned(), odd("string", b"x"))].into());
    image
}

fn tiled(compression: Packing, with_levels: bool) -> Vec<u8> {
    let size = Vec2(37usize, 23usize);
    let rounding_mode = RoundingMode::Down;
    let samples = |size: Vec2<usize>| FlatSamples::F32((0..size.area()).map(|i| (i / 3) as f32).collect());
    let samples = match with_levels {
        false => Levels::Singular(samples(size)),
        true => {
            let sizes = exr::meta::mip_map_levels(rounding_mode, size);
            Levels::Mip { rounding_mode, level_data: sizes.map(|(_, size)| samples(size)).collect() }
        }
    };
    let encoding = Encoding { compression, blocks: Blocks::Tiles(Vec2(16, 8)), line_order: LineOrder::Decreasing };
    let channels = AnyChannels::sort([AnyChannel::new("Y", samples)].into_iter().collect());
    let layer = ExrLayer::new(size, LayerAttributes::named("tiles"), encoding, channels);
    let mut bytes = Cursor::new(Vec::new());
    exr::image::Image::from_layer(layer).write().to_buffered(&mut bytes).expect("it can be written");
    bytes.into_inner()
}
