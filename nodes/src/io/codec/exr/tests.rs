use std::io::Cursor;
use std::sync::Arc;

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks as ExrBlocks, Encoding as ExrEncoding, FlatSamples, Levels, WritableImage,
};
use proptest::prelude::*;
use warploom_core::node::{ErrorClass, Reads};
use warploom_core::value::{Attribute, Buffer, Channel, Image, Layer, Metadata, Plane, Rect, SampleType};

use super::super::tests::{FREE, limit};
use super::super::{Compression, Depth, Encoding, WriteOptions, decode, decode_wanted, encode_image};
use super::header::{ChannelHeader, Part};

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

fn noise(seed: u32, i: usize) -> u32 {
    (i as u32 ^ seed).wrapping_mul(0x9e37_79b9).rotate_left(13).wrapping_mul(0x85eb_ca6b)
}

fn channel(name: &str, sample_type: SampleType, data: Rect) -> Channel {
    let (width, height) = (data.width(), data.height());
    let seed = name.len() as u32 * 77 + sample_type as u32;
    let plane = match sample_type {
        SampleType::Uint => {
            let ids: Vec<u32> = (0..width * height).map(|i| noise(seed, i) | 1 << 31).collect();
            Plane::U32(Buffer::from_packed(&ids, width, height))
        }
        _ => {
            // Multiples of 1/8 up to 128 are exact in half.
            let values: Vec<f32> = (0..width * height).map(|i| (noise(seed, i) >> 22) as f32 / 8.0 - 32.0).collect();
            Plane::F32(Buffer::from_packed(&values, width, height))
        }
    };
    Channel { name: name.into(), sample_type, plane }
}

fn layer(name: &str, data: Rect, channels: &[(&str, SampleType)]) -> Layer {
    let channels = channels.iter().map(|&(name, sample_type)| channel(name, sample_type, data)).collect();
    Layer { name: name.into(), data, channels, metadata: Arc::default() }
}

/// Channels in the order a file has them.
const MIXED: [(&str, SampleType); 6] = [
    ("A", SampleType::Half),
    ("B", SampleType::Half),
    ("Z", SampleType::Float),
    ("diffuse.R", SampleType::Half),
    ("id", SampleType::Uint),
    ("ähnlich.é", SampleType::Float),
];

fn attribute(kind: &str, bytes: &[u8]) -> Attribute {
    Attribute { kind: kind.into(), bytes: bytes.to_vec() }
}

fn picture(display: Rect, layers: Vec<Layer>) -> Image {
    Image { display, pixel_aspect: 1.0, metadata: Arc::default(), layers }
}

fn write(image: &Image, compression: Compression) -> Vec<u8> {
    let options = WriteOptions { compression, ..WriteOptions::default() };
    encode_image(image, "exr", &options, FREE).expect("it can be written")
}

fn read(bytes: &[u8]) -> Image {
    decode(bytes, Encoding::Auto, FREE).expect("it can be read")
}

/// `image` with what a file adds: compression and the screen window.
fn without_additions(mut image: Image) -> Image {
    Arc::make_mut(&mut image.metadata)
        .retain(|name, _| !["compression", "screenWindowCenter", "screenWindowWidth"].contains(&&**name));
    image
}

#[test]
fn every_type_window_and_lossless_compression_comes_back() {
    let display = Rect { x0: -3, y0: 5, x1: 30, y1: 40 };
    let windows = [
        display,
        Rect { x0: -20, y0: -10, x1: 50, y1: 60 },
        Rect { x0: 2, y0: 9, x1: 3, y1: 10 },
        Rect { x0: 500, y0: -900, x1: 517, y1: -867 },
    ];
    for data in windows {
        let image = Image { pixel_aspect: 2.0, ..picture(display, vec![layer("", data, &MIXED)]) };
        for compression in &ALL[..5] {
            let back = read(&write(&image, *compression));
            assert_eq!(without_additions(back), image, "{compression:?} {data:?}");
        }
    }
}

#[test]
fn lossy_compressions_stay_near_and_keep_identities_and_floats_as_promised() {
    let data = Rect::at(0, 0, 40, 70);
    let mut image = picture(data, vec![layer("", data, &MIXED)]);
    let smooth: Vec<f32> = (0..40 * 70).map(|i| (i % 40) as f32 / 64.0).collect();
    image.layers[0].channels[1].plane = Plane::F32(Buffer::from_packed(&smooth, 40, 70));
    for compression in &ALL[5..] {
        let back = read(&write(&image, *compression));
        let (before, after) = (&image.layers[0], &back.layers[0]);
        assert_eq!(before.channel("id"), after.channel("id"), "{compression:?}");
        if !matches!(compression, Compression::Dwaa | Compression::Dwab) {
            let exact = ["Z", "diffuse.R"][usize::from(*compression == Compression::Pxr24)];
            assert_eq!(before.channel(exact), after.channel(exact), "{compression:?}");
        }
        let Plane::F32(plane) = &after.channels[1].plane else { panic!("B holds floats") };
        let worst = plane.rows().flatten().zip(&smooth).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 0.02, "{compression:?}: {worst}");
    }
}

#[test]
fn every_half_comes_back_bit_for_bit() {
    let halves: Vec<half::f16> = (0..=u16::MAX).map(half::f16::from_bits).collect();
    let mut values = vec![0.0; halves.len()];
    super::half_bits::widen(&halves, &mut values);
    let plane = Plane::F32(Buffer::from_packed(&values, 256, 256));
    let channels = vec![Channel { name: "Y".into(), sample_type: SampleType::Half, plane }];
    let back = read(&write(&Image::new(Rect::at(0, 0, 256, 256), channels), Compression::Zip));
    let Plane::F32(plane) = &back.layers[0].channels[0].plane else { panic!("Y holds floats") };
    for (before, after) in values.iter().zip(plane.rows().flatten()) {
        assert_eq!(before.to_bits(), after.to_bits());
    }
}

#[test]
fn attributes_come_back_byte_for_byte_where_they_were() {
    let data = Rect::at(0, 0, 4, 3);
    let shared: Metadata = [
        ("capDate", attribute("string", b"2024:01:01 00:00:00")),
        ("timeCode", attribute("timecode", &[0xff; 8])),
        ("odd", attribute("nobody/knows", &[1, 2, 3, 0, 255])),
        ("empty", attribute("string", b"")),
        ("framesPerSecond", attribute("rational", &[24, 0, 0, 0, 1, 0, 0, 0])),
        ("screenWindowCenter", attribute("v2f", &[7; 8])),
        ("screenWindowWidth", attribute("float", &[0, 0, 0, 64])),
        ("an attribute name of more than thirty-one bytes", attribute("int", &[9, 0, 0, 0])),
    ]
    .map(|(name, attribute)| (name.to_owned(), attribute))
    .into();
    let mut left = layer("left", data, &[("R", SampleType::Half), ("Z", SampleType::Float)]);
    let mut right = layer("right", Rect::at(1, 1, 2, 2), &[("id", SampleType::Uint)]);
    for (layer, view) in [(&mut left, "left"), (&mut right, "right")] {
        layer.metadata = Arc::new([("view".to_owned(), attribute("string", view.as_bytes()))].into());
    }
    let mut image = picture(data, vec![left, right]);
    image.metadata = Arc::new(shared);
    let bytes = write(&image, Compression::Piz);
    let back = read(&bytes);
    assert_eq!(back.metadata.get("compression"), Some(&attribute("compression", &[4])));
    let mut expected = image.clone();
    Arc::make_mut(&mut expected.metadata).insert("compression".into(), attribute("compression", &[4]));
    assert_eq!(back, expected);
    assert_eq!(write(&back, Compression::Auto), bytes, "the same picture gives the same bytes, packed as before");
    let meta = exr::meta::MetaData::read_from_buffered(bytes.as_slice(), true).expect("the exr crate reads it too");
    assert!(meta.requirements.has_long_names && meta.requirements.has_multiple_layers);
}

/// Sets the mark of a channel in a file.
fn marked(mut file: Vec<u8>, channel: &str) -> Vec<u8> {
    let name = [channel.as_bytes(), b"\0"].concat();
    let at = file.windows(name.len()).position(|window| window == name).expect("the channel") + name.len() + 4;
    file[at] = 1;
    file
}

#[test]
fn a_channel_that_is_marked_as_linear_stays_so() {
    let data = Rect::at(0, 0, 4, 3);
    let one = picture(data, vec![layer("", data, &[("hue", SampleType::Half), ("other", SampleType::Half)])]);
    let two = picture(
        data,
        vec![layer("x", data, &[("R", SampleType::Half)]), layer("y", data, &[("hue", SampleType::Float)])],
    );
    for image in [one, two] {
        let file = marked(write(&image, Compression::Piz), "hue");
        assert_eq!(write(&read(&file), Compression::Auto), file);
    }
}

#[test]
fn parts_share_display_window_and_pixel_aspect() {
    let y = [("Y", SampleType::Half)];
    let data = Rect::at(0, 0, 4, 4);
    let mut file = write(&picture(data, vec![layer("a", data, &y), layer("b", data, &y)]), Compression::Zip);
    let name = b"pixelAspectRatio\0float\0";
    let at = file.windows(name.len()).rposition(|window| window == name).expect("that of the second part");
    file[at + name.len() + 4..][..4].copy_from_slice(&2.0f32.to_le_bytes());
    let error = decode(&file, Encoding::Auto, FREE).expect_err("OpenEXR does not read it either");
    assert_eq!(error.class, ErrorClass::InputUnreadable);
    assert!(
        error.message.starts_with("part 2: part `b` has a display window (0, 0 to 4, 4) or pixel aspect ratio (2)"),
        "{error:?}"
    );
}

#[test]
fn channels_are_sorted_whatever_the_order_of_the_list() {
    let data = Rect::at(0, 0, 4, 3);
    let image = picture(data, vec![layer("", data, &[("A", SampleType::Half), ("B", SampleType::Half)])]);
    let file = write(&image, Compression::None);
    let swapped = patch(&file, "channels", "chlist", b"B\0\x01\0\0\0\0\0\0\0\x01\0\0\0\x01\0\0\0A");
    assert_eq!(read(&swapped), read(&file));
    let twice = patch(&file, "channels", "chlist", b"B");
    assert!(
        decode(&twice, Encoding::Auto, FREE).expect_err("two of a name").message.contains("channel B is there twice")
    );
}

fn wants(names: &[&str]) -> Reads {
    Reads::Channels(names.iter().map(|name| name.to_string()).collect())
}

/// A file of two parts with all blocks of the second, or of both, overwritten, and the first channels that are there.
fn spoilt(compression: Compression, from_part: usize) -> (Image, Vec<u8>) {
    let data = Rect::at(-2, 3, 19, 45);
    let image = picture(data, vec![layer("a", data, &MIXED), layer("b", data, &MIXED)]);
    let mut file = write(&image, compression);
    let headers = super::header::read(&file, FREE).expect("a sound header");
    let count = super::blocks::Blocks::of(&headers.parts[0]).count[1];
    let entry = headers.end + 8 * count * from_part;
    let start = u64::from_le_bytes(file[entry..][..8].try_into().expect("an offset")) as usize;
    file[start..].fill(0xa5);
    (image, file)
}

#[test]
fn what_is_not_wanted_is_not_unpacked() {
    for compression in [Compression::None, Compression::Zip, Compression::Piz, Compression::Dwaa] {
        let (_, file) = spoilt(compression, 1);
        assert!(decode(&file, Encoding::Auto, FREE).is_err(), "the second part cannot be unpacked");
        for names in [&["A"][..], &["id", "diffuse.R", "nowhere"], &["Z", "A", "B", "id"]] {
            let some = decode_wanted(&file, Encoding::Auto, &wants(names), FREE).expect("the first part is sound");
            let data = Rect::at(-2, 3, 19, 45);
            let whole = read(&write(&picture(data, vec![layer("a", data, &MIXED)]), compression));
            let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
            assert_eq!(some, whole.with_channels_only(&names), "{compression:?}");
        }
        let (image, file) = spoilt(compression, 0);
        assert!(decode_wanted(&file, Encoding::Auto, &wants(&["A"]), FREE).is_err(), "neither can the first");
        for nothing in [Reads::Windows, wants(&["nowhere"])] {
            let windows =
                decode_wanted(&file, Encoding::Auto, &nothing, &limit(16_000)).expect("no block is looked at");
            assert_eq!((windows.windows(), windows.bytes()), (image.windows(), 0));
        }
    }
}

#[test]
fn colour_of_a_straight_encoding_wants_its_alpha() {
    let data = Rect::at(0, 0, 9, 5);
    let channels = [("A", SampleType::Float), ("R", SampleType::Float), ("Z", SampleType::Float)];
    let file = write(&picture(data, vec![layer("", data, &channels)]), Compression::Zip);
    for encoding in [Encoding::Linear, Encoding::Srgb] {
        let whole = decode(&file, encoding, FREE).expect("it can be read");
        for names in [&["R"][..], &["A"], &["Z", "R"]] {
            let some = decode_wanted(&file, encoding, &wants(names), FREE).expect("it can be read");
            let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
            assert!(some.digest() == whole.with_channels_only(&names).digest(), "{encoding:?} {names:?}");
        }
    }
}

#[test]
fn a_lossy_source_is_written_without_loss_by_itself() {
    let data = Rect::at(0, 0, 4, 3);
    let back = read(&write(&picture(data, vec![layer("", data, &MIXED)]), Compression::B44));
    assert_eq!(back.metadata["compression"].bytes, [6]);
    assert_eq!(read(&write(&back, Compression::Auto)).metadata["compression"].bytes, [3]);
}

#[test]
fn parts_get_names_that_differ_and_empty_layers_a_pixel() {
    let data = Rect::at(0, 0, 2, 2);
    let y = [("Y", SampleType::Float)];
    let nothing = Rect::default();
    let layers =
        vec![layer("", data, &y), layer("part1", data, &y), layer("part1", nothing, &y), layer("x", data, &[])];
    let back = read(&write(&picture(Rect::at(7, 8, 9, 9), layers), Compression::Zip));
    let names: Vec<&str> = back.layers.iter().map(|layer| &*layer.name).collect();
    assert_eq!(names, ["part2", "part1", "part3"]);
    assert_eq!(back.layers[2].data, Rect::at(7, 8, 1, 1));
    let none = encode_image(&picture(data, vec![layer("", data, &[])]), "exr", &WriteOptions::default(), FREE);
    assert_eq!(none.map_err(|e| e.class), Err(ErrorClass::Refused));
}

#[test]
fn depth_chooses_the_type_of_samples_but_not_of_identities() {
    let data = Rect::at(0, 0, 3, 3);
    let types = [
        ("a", SampleType::U8),
        ("b", SampleType::U16),
        ("c", SampleType::Half),
        ("d", SampleType::Float),
        ("e", SampleType::Uint),
    ];
    let image = picture(data, vec![layer("", data, &types)]);
    let stored = |depth| {
        let options = WriteOptions { depth, ..WriteOptions::default() };
        let bytes = encode_image(&image, "exr", &options, FREE).map_err(|e| (e.class, e.parameter))?;
        Ok(read(&bytes).layers[0].channels.iter().map(|channel| channel.sample_type).collect::<Vec<_>>())
    };
    use SampleType::{Float, Half, Uint};
    assert_eq!(stored(Depth::Auto), Ok(vec![Half, Float, Half, Float, Uint]));
    assert_eq!(stored(Depth::Half), Ok(vec![Half, Half, Half, Half, Uint]));
    assert_eq!(stored(Depth::Float), Ok(vec![Float, Float, Float, Float, Uint]));
    assert_eq!(stored(Depth::U8), Err((ErrorClass::Refused, Some("depth"))));
}

/// A file of tiles with mip levels or without, as the exr crate writes it.
fn tiled(mip: bool) -> (Vec<u8>, Vec<f32>) {
    let size = exr::math::Vec2(37usize, 23usize);
    let full: Vec<f32> = (0..37 * 23).map(|i| i as f32).collect();
    let rounding_mode = exr::math::RoundingMode::Down;
    let samples = match mip {
        false => Levels::Singular(FlatSamples::F32(full.clone())),
        true => {
            let sizes = exr::meta::mip_map_levels(rounding_mode, size);
            let level_data = sizes.map(|(level, size)| match level {
                0 => FlatSamples::F32(full.clone()),
                _ => FlatSamples::F32(vec![-1.0; size.area()]),
            });
            Levels::Mip { rounding_mode, level_data: level_data.collect() }
        }
    };
    let encoding = ExrEncoding {
        compression: exr::compression::Compression::ZIP16,
        blocks: ExrBlocks::Tiles(exr::math::Vec2(7, 5)),
        line_order: exr::meta::attribute::LineOrder::Decreasing,
    };
    let channels = AnyChannels::sort([AnyChannel::new("Y", samples)].into_iter().collect());
    let attributes = exr::meta::header::LayerAttributes::named("tiles").with_position(exr::math::Vec2(-4, 9));
    let layer = exr::image::Layer::new(size, attributes, encoding, channels);
    let mut bytes = Vec::new();
    exr::image::Image::from_layer(layer).write().to_buffered(Cursor::new(&mut bytes)).expect("it can be written");
    (bytes, full)
}

#[test]
fn tiles_are_read_at_full_resolution() {
    for mip in [false, true] {
        let (bytes, full) = tiled(mip);
        let image = read(&bytes);
        assert_eq!(image.layers[0].data, Rect::at(-4, 9, 37, 23));
        assert_eq!(image.layers[0].channels[0].plane, Plane::F32(Buffer::from_packed(&full, 37, 23)), "mip: {mip}");
        assert_eq!(&*image.layers[0].name, "tiles");
    }
}

#[test]
fn same_bits_for_any_thread_count() {
    let data = Rect::at(0, 0, 60, 300);
    let image = picture(data, vec![layer("", data, &MIXED)]);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let bytes = write(&image, Compression::Zips);
            let broken = decode(&bytes[..bytes.len() / 2], Encoding::Auto, FREE).expect_err("half a file");
            (read(&bytes).digest(), bytes, broken)
        })
    };
    let one = run(1);
    assert!([2, 3, 8].into_iter().all(|threads| run(threads) == one));
}

fn header_of(data: Rect, tile: Option<[usize; 2]>) -> Part {
    Part {
        name: String::new(),
        display: Rect::at(0, 0, 10, 10),
        data,
        pixel_aspect: 1.0,
        channels: vec![ChannelHeader { name: "Y".into(), sample_type: SampleType::Half, is_linear: false }],
        compression: exr::compression::Compression::ZIP16,
        tile,
        chunk_count: None,
        metadata: Metadata::new(),
    }
}

#[test]
fn what_a_header_claims_is_refused_before_memory_is_taken() {
    let header = |data| super::header::write(&[&header_of(data, None)], &[0]).expect("a header");
    let mut file = header(Rect::at(0, 0, 60_000, 60_000));
    let early = decode(&file, Encoding::Auto, FREE).expect_err("a file of a header only");
    assert_eq!(early.class, ErrorClass::InputUnreadable);
    file.resize(file.len() + 8 * 3750, 1);
    let over = decode(&file, Encoding::Auto, &limit(1 << 30)).expect_err("14 GB");
    assert_eq!(over.class, ErrorClass::OverBudget);
    let sides = decode(&header(Rect::at(0, 0, 65_537, 1)), Encoding::Auto, FREE).expect_err("a side too long");
    assert_eq!(sides.class, ErrorClass::InputUnsupported);
}

/// Sets the bytes after an attribute's name, type and size.
fn patch(file: &[u8], name: &str, kind: &str, value: &[u8]) -> Vec<u8> {
    let start = [name.as_bytes(), b"\0", kind.as_bytes(), b"\0"].concat();
    let at = file.windows(start.len()).position(|window| window == start).expect("the attribute") + start.len() + 4;
    [&file[..at], value, &file[at + value.len()..]].concat()
}

#[test]
fn what_is_not_supported_says_so_and_how_to_mend_it() {
    let data = Rect::at(0, 0, 4, 4);
    let y = [("Y", SampleType::Half)];
    let flat = write(&picture(data, vec![layer("beauty", data, &y)]), Compression::Zip);
    let two = write(&picture(data, vec![layer("beauty", data, &y), layer("depth", data, &y)]), Compression::Zip);
    let mut deep = flat.clone();
    deep[5] |= 8;
    let wants: [(Vec<u8>, &str, &str); 4] = [
        (deep, "part `beauty` holds deep data", "oiiotool -a in.exr --flatten"),
        (patch(&two, "type", "string", b"deepscanline."), "a part is of no known type", ""),
        (patch(&flat, "compression", "compression", &[10]), "HTJ2K", "--compression zip"),
        (patch(&flat, "channels", "chlist", b"Y\0\x01\0\0\0\0\0\0\0\x02\0\0\0\x02\0\0\0"), "subsampled", "R, G, B"),
    ];
    for (file, message, hint) in wants {
        let error = decode(&file, Encoding::Auto, FREE).expect_err(message);
        if hint.is_empty() {
            assert_eq!(error.class, ErrorClass::InputUnreadable);
            continue;
        }
        assert_eq!(error.class, ErrorClass::InputUnsupported, "{error:?}");
        assert!(error.message.contains(message) && error.hint.is_some_and(|h| h.contains(hint)), "{message}");
    }
}

fn samples() -> Vec<Vec<u8>> {
    let data = Rect::at(-2, 3, 19, 45);
    let image = picture(data, vec![layer("a", data, &MIXED), layer("b", Rect::at(0, 0, 3, 3), &MIXED)]);
    let mut files: Vec<Vec<u8>> = ALL.iter().map(|&compression| write(&image, compression)).collect();
    files.extend([tiled(false).0, tiled(true).0]);
    files
}

#[test]
fn truncated_files_are_errors() {
    for file in samples() {
        let before = read(&file);
        let last = file.len() - 1;
        for length in (0..file.len().min(1500)).step_by(7).chain((1..16).map(|i| file.len() * i / 16)).chain([last]) {
            match decode(&file[..length], Encoding::Auto, &limit(1 << 24)) {
                Err(error) => assert_eq!(error.class, ErrorClass::InputUnreadable, "{length}: {error:?}"),
                // Smaller levels may lie behind the last byte that is needed.
                Ok(image) => assert_eq!(image, before),
            }
        }
    }
}

/// The counts in a DWA block's head are its own; the decoder allocates what they say.
#[test]
fn absurd_counts_in_a_dwa_block_are_errors() {
    let data = Rect::at(0, 0, 64, 64);
    let mut image = picture(data, vec![layer("", data, &MIXED)]);
    let smooth: Vec<f32> = (0..64 * 64).map(|i| (i % 64) as f32 / 64.0).collect();
    image.layers[0].channels[1].plane = Plane::F32(Buffer::from_packed(&smooth, 64, 64));
    let file = write(&image, Compression::Dwaa);
    let table = super::header::read(&file, FREE).expect("a sound header").end;
    let first = u64::from_le_bytes(file[table..][..8].try_into().expect("an offset")) as usize;
    let counters = first + 8;
    assert_eq!(file[counters..][..8], 2u64.to_le_bytes(), "a packed block begins with its version");
    for counter in [1, 6, 7, 8, 9] {
        for count in [1u64 << 30, 1 << 56, i64::MAX as u64, u64::MAX] {
            let mut file = file.clone();
            file[counters + 8 * counter..][..8].copy_from_slice(&count.to_le_bytes());
            let error = decode(&file, Encoding::Auto, &limit(1 << 24)).expect_err("no block holds so much");
            assert_eq!(error.class, ErrorClass::InputUnreadable, "counter {counter}: {error:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn flipped_bytes_never_break_the_reader(flips in prop::collection::vec((0.0..1.0f64, 1..=255u8), 1..4), head: bool) {
        for mut file in samples_once() {
            let reach = if head { file.len().min(900) } else { file.len() };
            for (place, bits) in &flips {
                file[(place * reach as f64) as usize] ^= bits;
            }
            // Anything but a panic or an abort will do.
            let _ = decode(&file, Encoding::Auto, &limit(1 << 24));
        }
    }
}

fn samples_once() -> Vec<Vec<u8>> {
    static SAMPLES: std::sync::LazyLock<Vec<Vec<u8>>> = std::sync::LazyLock::new(samples);
    SAMPLES.clone()
}
