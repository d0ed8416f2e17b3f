use std::sync::atomic::{AtomicU64, Ordering};

use warploom_algo::transfer;
use warploom_core::node::{ErrorClass, NodeError};
use warploom_core::value::{Buffer, Channel, Image, Labels, Mask, Plane, Raster, Rect, SampleType, Windows};

use super::*;

/// Lets everything pass.
pub const FREE: &dyn Host = &|_| Ok(());

/// Lets `budget` bytes pass.
pub fn limit(budget: u64) -> impl Fn(u128) -> Result<(), NodeError> {
    let taken = AtomicU64::new(0);
    move |bytes| {
        let bytes = u64::try_from(bytes).unwrap_or(u64::MAX / 2);
        match taken.fetch_add(bytes, Ordering::Relaxed).saturating_add(bytes) <= budget {
            true => Ok(()),
            false => Err(NodeError::new(ErrorClass::OverBudget, "too much")),
        }
    }
}

pub fn options(encoding: Encoding, depth: Depth) -> WriteOptions {
    WriteOptions { encoding, depth, ..WriteOptions::default() }
}

/// A picture of rows of `names.len()` samples per pixel.
pub fn picture(names: &[&str], sample_type: SampleType, width: usize, samples: &[f32]) -> Image {
    let (count, height) = (names.len(), samples.len() / names.len() / width);
    let channels = names.iter().enumerate().map(|(c, &name)| {
        let plane: Vec<f32> = samples.iter().skip(c).step_by(count).copied().collect();
        Channel { name: name.into(), sample_type, plane: Plane::F32(Buffer::from_packed(&plane, width, height)) }
    });
    Image::new(Rect::at(0, 0, width, height), channels.collect())
}

pub fn plane<'a>(image: &'a Image, name: &str) -> &'a Buffer<f32> {
    match &image.primary().channel(name).expect("the channel").plane {
        Plane::F32(plane) => plane,
        Plane::U32(_) => panic!("{name} holds identities"),
    }
}

pub fn row<'a>(image: &'a Image, name: &str) -> &'a [f32] {
    plane(image, name).row(0)
}

fn names(image: &Image) -> Vec<&str> {
    image.primary().channels.iter().map(|channel| &*channel.name).collect()
}

/// Every code of 8 or 16 bits as colour, under several alphas.
fn codes(max: u16) -> Image {
    let table = transfer::srgb_table(max);
    let alphas = [1, max / 3, max];
    let samples = alphas.iter().flat_map(|&alpha| {
        let alpha = f32::from(alpha) / f32::from(max);
        table.iter().flat_map(move |&v| [v * alpha, 0.5 * alpha, 0.0, alpha])
    });
    let samples: Vec<f32> = samples.collect();
    let sample_type = if max == 255 { SampleType::U8 } else { SampleType::U16 };
    picture(&["R", "G", "B", "A"], sample_type, 256, &samples)
}

#[test]
fn integer_files_give_every_code_back() {
    for (extension, max) in [("png", 255), ("png", 65535), ("tif", 255), ("tiff", 65535)] {
        let image = codes(max);
        let bytes = encode_image(&image, extension, &WriteOptions::default(), FREE).expect("it can be written");
        let stored = decode(&bytes, Encoding::Raw, FREE).expect("it can be read");
        let mut red = plane(&stored, "R").rows().flatten();
        for alpha in 0..3 {
            for code in 0..=max {
                let stored = transfer::code(*red.next().expect("a sample"), max);
                assert_eq!(stored, code, ".{extension}, alpha {alpha}");
            }
        }
        let back = decode(&bytes, Encoding::Auto, FREE).expect("it can be read");
        assert_eq!(encode_image(&back, extension, &WriteOptions::default(), FREE), Ok(bytes), ".{extension}");
        assert_eq!(back.primary().channels[0].sample_type, image.primary().channels[0].sample_type);
    }
}

#[test]
fn encodings_of_a_straight_integer_file() {
    let straight = picture(&["R", "G", "B", "A"], SampleType::U8, 2, &[1.0, 0.5, 0.0, 0.5, 0.2, 0.2, 0.2, 0.0]);
    let bytes = encode_image(&straight, "png", &options(Encoding::Raw, Depth::Auto), FREE).expect("it can be written");
    let (half, fifth) = (128.0 / 255.0, 51.0 / 255.0);
    let read = |encoding| decode(&bytes, encoding, FREE).expect("it can be read");
    assert_eq!(row(&read(Encoding::Raw), "R"), [1.0, fifth]);
    assert_eq!(row(&read(Encoding::Raw), "G"), [half, fifth]);
    assert_eq!(row(&read(Encoding::Linear), "G"), [half * half, 0.0]);
    let decoded = transfer::srgb_to_linear(half);
    for encoding in [Encoding::Auto, Encoding::Srgb] {
        let image = read(encoding);
        assert!((row(&image, "G")[0] - decoded * half).abs() < 1e-7);
        assert_eq!((row(&image, "R")[0], row(&image, "A")[0]), (half, half), "alpha is linear");
        assert_eq!(row(&image, "G")[1], 0.0, "nothing is left of a transparent pixel");
    }
}

#[test]
fn encodings_of_a_float_file() {
    let image = picture(&["R", "G", "B", "A"], SampleType::Float, 2, &[0.25, 2.0, -0.5, 0.5, 0.3, 0.0, 0.0, 0.0]);
    let write = |encoding| encode_image(&image, "tif", &options(encoding, Depth::Auto), FREE).expect("written");
    let read = |bytes: &[u8], encoding| decode(bytes, encoding, FREE).expect("it can be read");
    let linear = write(Encoding::Auto);
    assert_eq!(row(&read(&linear, Encoding::Raw), "G"), [4.0, 0.0], "stored straight");
    assert_eq!(row(&read(&linear, Encoding::Auto), "B")[0], -0.5);
    assert_eq!(row(&read(&linear, Encoding::Linear), "R")[0], 0.25);
    let encoded = write(Encoding::Srgb);
    assert!((row(&read(&encoded, Encoding::Raw), "R")[0] - transfer::linear_to_srgb(0.5)).abs() < 1e-6);
    for name in ["R", "G", "B", "A"] {
        let (before, after) = (row(&image, name)[0], row(&read(&encoded, Encoding::Srgb), name)[0]);
        assert!((before - after).abs() < 1e-6, "{name}: {before} {after}");
    }
    // Raw samples of a premultiplied picture are marked as such, and light without coverage comes back.
    let raw = write(Encoding::Raw);
    assert_eq!(read(&raw, Encoding::Auto), read(&raw, Encoding::Raw));
    assert_eq!(row(&read(&raw, Encoding::Auto), "R"), [0.25, 0.3]);
    assert_eq!(row(&read(&raw, Encoding::Srgb), "R")[1], transfer::srgb_to_linear(0.3));
}

#[test]
fn an_exr_stays_as_it_is_unless_it_is_said_to_be_encoded() {
    let names = ["A", "B", "G", "R", "Z"];
    let image = picture(&names, SampleType::Float, 2, &[0.5, 0.1, f32::NAN, 0.4, 9.0, 0.0, 3.0, -1.0, 0.3, -7.0]);
    let write = |encoding| encode_image(&image, "exr", &options(encoding, Depth::Auto), FREE).expect("written");
    let plain = write(Encoding::Auto);
    assert!(plain == write(Encoding::Linear) && plain == write(Encoding::Raw));
    let read = |bytes: &[u8], encoding| decode(bytes, encoding, FREE).expect("it can be read");
    for encoding in [Encoding::Auto, Encoding::Linear, Encoding::Raw] {
        assert_eq!(read(&plain, encoding).primary().channels, image.primary().channels);
    }
    let encoded = read(&write(Encoding::Srgb), Encoding::Auto);
    assert_eq!(row(&encoded, "R")[0], transfer::linear_to_srgb(0.8) * 0.5);
    assert_eq!(row(&encoded, "R")[1], transfer::linear_to_srgb(0.3), "light without coverage is kept");
    assert_eq!((row(&encoded, "Z"), row(&encoded, "A")), (row(&image, "Z"), row(&image, "A")));
    assert!(row(&encoded, "G")[0].is_nan());
    let back = read(&write(Encoding::Srgb), Encoding::Srgb);
    assert!((row(&back, "R")[0] - 0.4).abs() < 1e-6);
}

#[test]
fn other_formats_hold_the_display_window_only() {
    let mut image = picture(&["A", "Y", "Z"], SampleType::U8, 3, &[1.0; 3 * 3 * 3]);
    image.display = Rect { x0: -1, y0: 1, x1: 2, y1: 5 };
    let bytes = encode_image(&image, "png", &WriteOptions::default(), FREE).expect("it can be written");
    let back = decode(&bytes, Encoding::Auto, FREE).expect("it can be read");
    assert_eq!((names(&back), back.display), (vec!["Y", "A"], Rect::at(0, 0, 3, 4)));
    let rows: Vec<&[f32]> = plane(&back, "Y").rows().collect();
    assert_eq!(rows, [[0.0, 1.0, 1.0], [0.0, 1.0, 1.0], [0.0; 3], [0.0; 3]]);
    image.display = Rect::at(100, 100, 2, 2);
    let bytes = encode_image(&image, "png", &WriteOptions::default(), FREE).expect("disjoint windows");
    assert_eq!(row(&decode(&bytes, Encoding::Auto, FREE).expect("it can be read"), "A"), [0.0, 0.0]);
}

#[test]
fn hdr_and_jpeg_come_back_nearly() {
    let samples: Vec<f32> = (0..32 * 32).flat_map(|i| [(i % 32) as f32 / 31.0, (i / 32) as f32 / 31.0, 0.5]).collect();
    let image = picture(&["R", "G", "B"], SampleType::Half, 32, &samples);
    for (extension, tolerance) in [("hdr", 0.008), ("jpg", 0.07), ("jpeg", 0.07)] {
        let bytes = encode_image(&image, extension, &WriteOptions::default(), FREE).expect("it can be written");
        let back = decode(&bytes, Encoding::Auto, FREE).expect("it can be read");
        for name in ["R", "G", "B"] {
            let pairs = plane(&image, name).rows().flatten().zip(plane(&back, name).rows().flatten());
            let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst < tolerance, ".{extension} {name}: {worst}");
        }
    }
    let bright = picture(&["Y"], SampleType::Float, 8, &[100.0; 64]);
    let bytes = encode_image(&bright, "HDR", &WriteOptions::default(), FREE).expect("grey, and in capitals");
    let back = decode(&bytes, Encoding::Auto, FREE).expect("it can be read");
    assert!(names(&back) == ["R", "G", "B"] && (row(&back, "G")[3] - 100.0).abs() < 0.5);
    let quality = |quality| {
        let options = WriteOptions { quality, ..WriteOptions::default() };
        encode_image(&image, "jpg", &options, FREE).expect("it can be written").len()
    };
    assert!(quality(20) < quality(95));
}

#[test]
fn grey_with_alpha_and_without() {
    for (names_in, extension) in [(&["Y"][..], "png"), (&["Y", "A"], "png"), (&["Y"], "tif"), (&["Y", "A"], "tif")] {
        for sample_type in [SampleType::U8, SampleType::U16, SampleType::Float] {
            let image = picture(names_in, sample_type, 2, &vec![1.0; 4 * names_in.len()]);
            let bytes = encode_image(&image, extension, &WriteOptions::default(), FREE).expect("it can be written");
            let back = decode(&bytes, Encoding::Auto, FREE).expect("it can be read");
            assert_eq!(names(&back), names_in);
            assert_eq!((row(&back, "Y"), row(&back, names_in[names_in.len() - 1])), (&[1.0, 1.0][..], &[1.0, 1.0][..]));
        }
    }
}

#[test]
fn depths_and_compressions_a_format_does_not_have_are_refused() {
    let image = picture(&["Y"], SampleType::Half, 1, &[0.5]);
    let refused = |extension, options: WriteOptions| {
        let error = encode_image(&image, extension, &options, FREE).expect_err("it is refused");
        assert_eq!(error.class, ErrorClass::Refused);
        error.parameter
    };
    for (extension, depth) in [("png", Depth::Half), ("png", Depth::Float), ("jpg", Depth::U16), ("tif", Depth::Half)] {
        assert_eq!(refused(extension, options(Encoding::Auto, depth)), Some("depth"));
    }
    assert_eq!(refused("hdr", options(Encoding::Auto, Depth::U8)), Some("depth"));
    let zip = WriteOptions { compression: Compression::Zip, ..WriteOptions::default() };
    assert_eq!(refused("png", zip), Some("compression"));
    for extension in ["", "bmp", "exr2"] {
        assert_eq!(refused(extension, zip), Some("path"));
    }
    let no_color = picture(&["A", "Z"], SampleType::Half, 1, &[0.5, 1.0]);
    let error = encode_image(&no_color, "png", &WriteOptions::default(), FREE).expect_err("no colour");
    assert!(error.message.contains("there is A, Z"), "{error:?}");
}

#[test]
fn single_planes_become_pictures() {
    let windows = Windows { display: Rect::at(0, 0, 9, 9), data: Rect::at(2, 3, 2, 1), pixel_aspect: 2.0 };
    let mask = Mask(Raster { windows, samples: Buffer::from_packed(&[0.25, 1.0], 2, 1) });
    let labels =
        Labels { raster: Raster { windows, samples: Buffer::from_packed(&[0, u32::MAX], 2, 1) }, table: Vec::new() };
    for (value, name, sample_type) in
        [(Value::from(mask), "A", SampleType::Float), (Value::from(labels), "id", SampleType::Uint)]
    {
        let image = as_image(&value).expect("it has pixels");
        let bytes = encode_image(&image, "exr", &WriteOptions::default(), FREE).expect("it can be written");
        let back = decode(&bytes, Encoding::Auto, FREE).expect("it can be read");
        assert_eq!((back.windows(), &back.primary().channels), (windows, &image.primary().channels));
        assert_eq!((names(&back), back.primary().channels[0].sample_type), (vec![name], sample_type));
    }
    assert!(as_image(&Value::Number(1.0)).is_none());
}

#[test]
fn damaged_and_foreign_files_are_errors_within_the_budget() {
    let image = picture(&["R", "G", "B"], SampleType::U8, 40, &vec![0.3; 40 * 40 * 3]);
    for extension in EXTENSIONS {
        let bytes = encode_image(&image, extension, &WriteOptions::default(), FREE).expect("it can be written");
        let over = decode(&bytes, Encoding::Auto, &limit(10_000)).expect_err("19 kB of samples");
        assert_eq!(over.class, ErrorClass::OverBudget, ".{extension}");
        let whole = decode(&bytes, Encoding::Auto, FREE).expect("it can be read");
        for length in (0..bytes.len()).step_by(bytes.len() / 60 + 1) {
            match decode(&bytes[..length], Encoding::Auto, &limit(1 << 28)) {
                // The name of an HDR's pixel format is text, and may be cut.
                Err(error) if extension == "hdr" && error.class == ErrorClass::InputUnsupported => {}
                Err(error) => assert_eq!(error.class, ErrorClass::InputUnreadable, ".{extension}: {error:?}"),
                // What is missing may be a checksum at the end.
                Ok(image) => assert_eq!(image, whole, ".{extension} of {length} bytes"),
            }
        }
        for i in 0..200 {
            let mut broken = bytes.clone();
            let place = (i * 7919 + i / 3) % broken.len().min(if i % 2 == 0 { 200 } else { usize::MAX });
            broken[place] ^= (i % 255 + 1) as u8;
            let _ = decode(&broken, Encoding::Auto, &limit(1 << 28));
        }
    }
    let class = |bytes: &[u8]| decode(bytes, Encoding::Auto, FREE).expect_err("not a picture").class;
    assert_eq!(class(b""), ErrorClass::InputUnreadable);
    assert_eq!(class(b"GIF89a"), ErrorClass::InputUnsupported);
    assert_eq!(class(&[0x76, 0x2f, 0x31, 0x01]), ErrorClass::InputUnreadable);
}

/// Of a file that was cut behind its head, so that it would be damaged if it were looked at any further.
#[test]
fn what_does_not_fit_is_refused_before_pixels_are_read() {
    let image = picture(&["R", "G", "B"], SampleType::Float, 200, &vec![0.3; 200 * 200 * 3]);
    for (extension, sample_bytes) in [("png", 1), ("hdr", 4)] {
        let bytes = encode_image(&image, extension, &WriteOptions::default(), FREE).expect("it can be written");
        let class = |budget| decode(&bytes[..120], Encoding::Auto, &limit(budget)).expect_err("it ends early").class;
        let samples = 200 * 200 * 3;
        assert_eq!(class(samples * (sample_bytes + 5)), ErrorClass::InputUnreadable, ".{extension}");
        assert_eq!(class(samples * (sample_bytes + 3)), ErrorClass::OverBudget, ".{extension}: planes of 4 bytes");
    }
}

/// The same filters, packing and chunks.
#[test]
fn a_png_is_the_one_that_the_png_crate_writes() {
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    use image::{ExtendedColorType as Color, ImageEncoder};
    let colors = [
        (1, [Color::L8, Color::L16]),
        (2, [Color::La8, Color::La16]),
        (3, [Color::Rgb8, Color::Rgb16]),
        (4, [Color::Rgba8, Color::Rgba16]),
    ];
    for ((count, colors), (width, height)) in
        colors.into_iter().flat_map(|color| [(color, (211, 150)), (color, (1, 3))])
    {
        // Flat, sloping, and noisy by rows.
        let byte = |i: usize| match (i / count / width) % 3 {
            0 => 77,
            1 => (i / 5) as u8,
            _ => (i as u32).wrapping_mul(0x9e37_79b9).to_be_bytes()[0] & 31,
        };
        let bytes: Vec<u8> = (0..width * height * count * 2).map(byte).collect();
        let words: Vec<u16> = bytes.as_chunks().0.iter().map(|&word| u16::from_ne_bytes(word)).collect();
        let wide = pixels::Samples::U16(words);
        for (samples, color) in [(pixels::Samples::U8(bytes[..bytes.len() / 2].to_vec()), colors[0]), (wide, colors[1])]
        {
            let (alpha, coding) = (pixels::Alpha::None, coding::Coding::Raw);
            let pixels = pixels::Pixels { width, height, alpha, coding, samples };
            let raw = if pixels.sample_bytes() == 1 { &bytes[..bytes.len() / 2] } else { &bytes };
            let mut expected = Vec::new();
            PngEncoder::new_with_quality(&mut expected, CompressionType::Default, FilterType::Adaptive)
                .write_image(raw, width as u32, height as u32, color)
                .expect("it can be written");
            assert!(png::encode(&pixels, FREE).expect("it can be written") == expected, "{color:?}");
        }
    }
}
