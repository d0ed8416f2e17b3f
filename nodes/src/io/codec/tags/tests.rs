use flate2::Crc;
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::Tag;
use warploom_algo::transfer;
use warploom_core::node::ErrorClass;
use warploom_core::value::{Image, SampleType};

use super::super::coding::Coding;
use super::super::tests::{FREE, options, picture, plane, row};
use super::super::{Depth, Encoding, decode, encode_image, icc};

type Chunk<'a> = (&'a [u8; 4], &'a [u8]);

/// A file of four greys, or of four reds, that says nothing of its colour.
fn plain(extension: &str, is_grey: bool) -> Vec<u8> {
    let names: &[&str] = if is_grey { &["Y"] } else { &["R", "G", "B"] };
    let samples = [0.0f32, 0.2, 0.6, 1.0].iter().flat_map(|&v| if is_grey { vec![v] } else { vec![v, 0.4, 0.4] });
    let samples: Vec<f32> = samples.collect();
    let image = picture(names, SampleType::U8, 2, &samples);
    encode_image(&image, extension, &options(Encoding::Raw, Depth::Auto), FREE).expect("it can be written")
}

/// A PNG with chunks before its pixels.
fn with_chunks(file: &[u8], chunks: &[Chunk]) -> Vec<u8> {
    let mut out = file[..33].to_vec();
    for (name, content) in chunks {
        let mut sum = Crc::new();
        sum.update(*name);
        sum.update(content);
        out.extend((content.len() as u32).to_be_bytes());
        out.extend([&name[..], content, &sum.sum().to_be_bytes()].concat());
    }
    out.extend(&file[33..]);
    out
}

/// A JPEG with segments after its first marker.
fn with_segments(file: &[u8], segments: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut out = file[..2].to_vec();
    for (marker, content) in segments {
        out.extend([0xff, *marker]);
        out.extend((content.len() as u16 + 2).to_be_bytes());
        out.extend(content);
    }
    out.extend(&file[2..]);
    out
}

fn read(file: &[u8], encoding: Encoding) -> Image {
    decode(file, encoding, FREE).expect("it can be read")
}

fn refusal(file: &[u8]) -> String {
    let error = decode(file, Encoding::Auto, FREE).expect_err("it is refused");
    assert_eq!(error.class, ErrorClass::InputUnsupported, "{error:?}");
    for encoding in [Encoding::Srgb, Encoding::Linear, Encoding::Raw] {
        let read = decode(file, encoding, FREE);
        assert!(read.is_ok(), "an encoding overrules what the file says: {read:?}");
    }
    error.message
}

fn iccp(profile: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut packer = flate2::write::ZlibEncoder::new(b"name\0\0".to_vec(), flate2::Compression::default());
    packer.write_all(profile).expect("a vector takes it");
    packer.finish().expect("a vector takes it")
}

/// A block of Exif of some tags of numbers in its first directory, and some in that of the photograph.
fn exif(first: &[(u16, u16)], photo: &[(u16, u16)], is_big_endian: bool) -> Vec<u8> {
    let word = |v: u16| if is_big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
    let long = |v: u32| if is_big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
    let short = |&(tag, value): &(u16, u16)| [&word(tag)[..], &word(3), &long(1), &word(value), &[0; 2]].concat();
    let photo_at = 8 + 2 + 12 * (first.len() as u32 + 1) + 4;
    let pointer = [&word(0x8769)[..], &word(4), &long(1), &long(photo_at)].concat();
    let start: &[u8] = if is_big_endian { b"MM\0\x2a" } else { b"II\x2a\0" };
    let mut out = [start, &long(8), &word(first.len() as u16 + 1)].concat();
    first.iter().for_each(|entry| out.extend(short(entry)));
    out.extend([&pointer[..], &long(0), &word(photo.len() as u16)].concat());
    photo.iter().for_each(|entry| out.extend(short(entry)));
    out.extend(long(0));
    out
}

#[test]
fn png_chunks_stand_in_their_order() {
    let file = plain("png", false);
    let gama = 100_000u32.to_be_bytes();
    let (srgb, linear) = (icc::written(&Coding::Srgb, false), icc::written(&Coding::Linear, false));
    let (srgb, linear) = (iccp(&srgb.expect("a profile")), iccp(&linear.expect("a profile")));
    let as_linear = read(&file, Encoding::Linear);
    let as_srgb = read(&file, Encoding::Srgb);
    assert!(as_linear != as_srgb && read(&file, Encoding::Auto) == as_srgb);
    let cicp_linear: Chunk = (b"cICP", &[1, 8, 0, 1]);
    let cicp_srgb: Chunk = (b"cICP", &[1, 13, 0, 1]);
    for (chunks, expected) in [
        (vec![(b"gAMA", &gama[..])], &as_linear),
        (vec![(b"gAMA", &gama), (b"sRGB", &[0])], &as_srgb),
        (vec![(b"sRGB", &[0]), (b"iCCP", &linear[..])], &as_linear),
        (vec![(b"gAMA", &gama), (b"iCCP", &srgb)], &as_srgb),
        (vec![(b"iCCP", &srgb), cicp_linear], &as_linear),
        (vec![(b"iCCP", &linear), (b"gAMA", &gama), cicp_srgb], &as_srgb),
    ] {
        let names: Vec<_> = chunks.iter().map(|chunk| String::from_utf8_lossy(chunk.0)).collect();
        let file = with_chunks(&file, &chunks);
        assert!(read(&file, Encoding::Auto) == *expected, "{names:?}");
        assert!(read(&file, Encoding::Srgb) == as_srgb && read(&file, Encoding::Linear) == as_linear);
    }
}

#[test]
fn gamma_and_primaries_of_a_png() {
    let gama = 45_455u32.to_be_bytes();
    let numbers = |values: [u32; 8]| values.map(u32::to_be_bytes).concat();
    let rec709 = numbers([31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000]);
    let p3 = numbers([31270, 32900, 68000, 32000, 26500, 69000, 15000, 6000]);
    let power = |v: f64| v.powf(1.0 / 0.45455);
    let image = read(&with_chunks(&plain("png", false), &[(b"gAMA", &gama), (b"cHRM", &rec709)]), Encoding::Auto);
    assert!((f64::from(row(&image, "G")[0]) - power(0.4)).abs() < 1e-7);
    let wide = read(&with_chunks(&plain("png", false), &[(b"gAMA", &gama), (b"cHRM", &p3)]), Encoding::Auto);
    let (red, rest) = (power(0.2), power(0.4));
    assert!((f64::from(row(&wide, "R")[1]) - (1.224_940_1 * red - 0.224_940_4 * rest)).abs() < 1e-6);
    let cicp = read(&with_chunks(&plain("png", false), &[(b"cICP", &[12, 4, 0, 1])]), Encoding::Auto);
    assert!((row(&cicp, "R")[1] - row(&wide, "R")[1]).abs() < 1e-4, "gamma 2.2 and P3 once more");
    // Primaries alone leave the curve, and a grey as it is.
    let grey = plain("png", true);
    assert!(read(&with_chunks(&grey, &[(b"cHRM", &p3)]), Encoding::Auto) == read(&grey, Encoding::Srgb));
    let curved = read(&with_chunks(&plain("png", false), &[(b"cHRM", &rec709)]), Encoding::Auto);
    assert!(curved == read(&plain("png", false), Encoding::Srgb));
}

#[test]
fn pngs_that_are_refused() {
    let file = plain("png", false);
    let refusal = |chunk: Chunk| refusal(&with_chunks(&file, &[chunk]));
    assert!(refusal((b"cICP", &[9, 16, 0, 1])).contains("16 (PQ)"));
    assert!(refusal((b"cICP", &[9, 18, 0, 1])).contains("18 (HLG)"));
    assert!(refusal((b"cICP", &[1, 13, 0, 0])).contains("full-range RGB"));
    assert!(refusal((b"cICP", &[2, 13, 0, 1])).contains("primaries 2"));
    let dark = with_chunks(&file, &[(b"gAMA", &[0; 4])]);
    assert!(decode(&dark, Encoding::Auto, FREE).expect_err("it is refused").message.contains("gAMA"));
    assert!(refusal((b"cHRM", &[0; 32])).contains("cHRM"));
    assert!(refusal((b"iCCP", &iccp(&[7; 300]))).contains("ICC profile without a name"));
    let damaged = with_chunks(&file, &[(b"iCCP", b"name\0\0rubbish")]);
    assert_eq!(decode(&damaged, Encoding::Auto, FREE).expect_err("rubbish").class, ErrorClass::InputUnreadable);
}

#[test]
fn a_jpegs_profile_comes_in_parts() {
    let file = plain("jpg", false);
    let profile = icc::written(&Coding::Linear, false).expect("a profile");
    let part = |number: u8, count: u8, range: std::ops::Range<usize>| {
        (0xe2, [b"ICC_PROFILE\0", &[number, count][..], &profile[range]].concat())
    };
    let (first, second) = (part(1, 2, 0..300), part(2, 2, 300..profile.len()));
    let whole = with_segments(&file, &[second.clone(), first.clone()]);
    assert!(read(&whole, Encoding::Auto) == read(&file, Encoding::Linear));
    assert!(refusal(&with_segments(&file, std::slice::from_ref(&second))).contains("a part is missing"));
    assert!(refusal(&with_segments(&file, &[first.clone(), second, first])).contains("a part is missing"));
}

#[test]
fn colour_spaces_of_exif() {
    let file = plain("jpg", false);
    let told = |space: u16, is_big_endian| {
        let exif = exif(&[], &[(0xa001, space)], is_big_endian);
        with_segments(&file, &[(0xe1, [b"Exif\0\0", &exif[..]].concat())])
    };
    let srgb = read(&file, Encoding::Srgb);
    assert!(read(&told(1, true), Encoding::Auto) == srgb && read(&told(1, false), Encoding::Auto) == srgb);
    assert!(refusal(&told(0xffff, true)).contains("65535"));
    let (adobe, raw) = (read(&told(2, false), Encoding::Auto), read(&file, Encoding::Raw));
    // White is common to both, and green is where red differs most.
    let level = |name: &str| f64::from(row(&raw, name)[1]).powf(563.0 / 256.0);
    let expected = 1.398_35 * level("R") - 0.398_35 * level("G");
    assert!((f64::from(row(&adobe, "R")[1]) - expected).abs() < 1e-4, "{}", row(&adobe, "R")[1]);
    let (grey, adobe) = (plain("jpg", true), exif(&[], &[(0xa001, 2)], true));
    let told = read(&with_segments(&grey, &[(0xe1, [b"Exif\0\0", &adobe[..]].concat())]), Encoding::Auto);
    let level = f64::from(row(&read(&grey, Encoding::Raw), "Y")[1]).powf(563.0 / 256.0);
    assert!((f64::from(row(&told, "Y")[1]) - level).abs() < 1e-6, "grey has no primaries");
    let rubbish = with_segments(&file, &[(0xe1, b"Exif\0\0MM\0\x2a\xff\xff\xff\xff".to_vec())]);
    assert!(read(&rubbish, Encoding::Auto) == srgb);
}

#[test]
fn inks_are_refused() {
    let mut file = plain("jpg", false);
    let frame = file.windows(2).position(|pair| pair == [0xff, 0xc0]).expect("a frame");
    file[frame + 9] = 4;
    let error = decode(&file, Encoding::Srgb, FREE).expect_err("four inks");
    assert!(error.class == ErrorClass::InputUnsupported && error.message.contains("CMYK"), "{error:?}");
}

/// Where the samples of a picture of 3 x 2 numbered ones come to lie.
const UPRIGHT: [[&[u8]; 3]; 8] = [
    [&[1, 2, 3], &[4, 5, 6], &[]],
    [&[3, 2, 1], &[6, 5, 4], &[]],
    [&[6, 5, 4], &[3, 2, 1], &[]],
    [&[4, 5, 6], &[1, 2, 3], &[]],
    [&[1, 4], &[2, 5], &[3, 6]],
    [&[4, 1], &[5, 2], &[6, 3]],
    [&[6, 3], &[5, 2], &[4, 1]],
    [&[3, 6], &[2, 5], &[1, 4]],
];

#[test]
fn pictures_are_turned_upright() {
    for (orientation, expected) in (1..).zip(UPRIGHT) {
        let expected: Vec<&[u8]> = expected.into_iter().filter(|row| !row.is_empty()).collect();
        let check = |file: &[u8], what: &str| {
            let image = read(file, Encoding::Raw);
            let rows: Vec<Vec<u8>> = plane(&image, "Y")
                .rows()
                .map(|row| row.iter().map(|&v| transfer::code(v, 255) as u8).collect())
                .collect();
            assert_eq!(rows, expected, "{what}, orientation {orientation}");
        };
        let mut tiff = std::io::Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut tiff).expect("it can be written");
        let mut image = encoder.new_image::<colortype::Gray8>(3, 2).expect("it can be written");
        image.encoder().write_tag(Tag::Orientation, orientation).expect("it can be written");
        image.write_data(&[1, 2, 3, 4, 5, 6]).expect("it can be written");
        check(tiff.get_ref(), "TIFF");
        let samples = [1, 2, 3, 4, 5, 6].map(|code: u8| f32::from(code) / 255.0);
        let image = picture(&["Y"], SampleType::U8, 3, &samples);
        let png = encode_image(&image, "png", &options(Encoding::Raw, Depth::Auto), FREE).expect("it can be written");
        check(&with_chunks(&png, &[(b"eXIf", &exif(&[(0x0112, orientation)], &[], true))]), "PNG");
    }
    let file = plain("jpg", true);
    let exif = exif(&[(0x0112, 3)], &[], false);
    let turned = read(&with_segments(&file, &[(0xe1, [b"Exif\0\0", &exif[..]].concat())]), Encoding::Raw);
    let (before, after) = (read(&file, Encoding::Raw), turned);
    let rows = |image: &Image| plane(image, "Y").rows().flatten().copied().collect::<Vec<f32>>();
    assert!(rows(&after).into_iter().rev().collect::<Vec<f32>>() == rows(&before));
}

/// A Radiance HDR of one pixel with these lines in its header.
fn hdr(lines: &str, pixel: [u8; 4]) -> Vec<u8> {
    [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", lines.as_bytes(), b"\n-Y 1 +X 1\n", &pixel].concat()
}

#[test]
fn lines_of_an_hdrs_header() {
    let pixel = [128, 64, 32, 129];
    let read = |lines: &str| {
        let image = read(&hdr(lines, pixel), Encoding::Auto);
        ([row(&image, "R")[0], row(&image, "G")[0], row(&image, "B")[0]], image.pixel_aspect)
    };
    assert_eq!(read(""), ([1.0, 0.5, 0.25], 1.0));
    assert_eq!(read("EXPOSURE=4\nEXPOSURE= 0.5\nPIXASPECT=0.5\n"), ([0.5, 0.25, 0.125], 2.0));
    assert_eq!(read("COLORCORR= 2 1 0.5\nGAMMA=1.0\n"), ([0.5, 0.5, 0.5], 1.0));
    assert_eq!(read("PRIMARIES=0.64 0.33 0.30 0.60 0.15 0.06 0.3127 0.3290\n"), ([1.0, 0.5, 0.25], 1.0));
    let (wide, _) = read("PRIMARIES=0.68 0.32 0.265 0.69 0.15 0.06 0.3127 0.3290\n");
    assert!((wide[0] - (1.224_940_1 - 0.5 * 0.224_940_4)).abs() < 1e-6, "{wide:?}");
    for (lines, expected) in [
        ("GAMMA=2.2\n", "GAMMA"),
        ("EXPOSURE=0\n", "EXPOSURE"),
        ("PRIMARIES=1 2 3\n", "\"1 2 3\", and not 8 numbers"),
        ("PRIMARIES=0 0 0 0 0 0 0 0\n", "span no space"),
    ] {
        assert!(refusal(&hdr(lines, pixel)).contains(expected), "{lines}");
    }
    let xyze = hdr("", pixel);
    let xyze = String::from_utf8_lossy(&xyze[..34]).replace("rgbe", "xyze").into_bytes();
    let xyze = [&xyze, &hdr("", pixel)[34..]].concat();
    assert!(decode(&xyze, Encoding::Linear, FREE).expect_err("XYZ").message.contains("XYZ colour"));
}

#[test]
fn the_profile_of_photographs_is_srgb_to_the_bit() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/astronaut.png");
    let file = std::fs::read(path).expect("a picture of the examples");
    assert!(file.windows(4).any(|name| name == b"iCCP"));
    assert!(read(&file, Encoding::Auto) == read(&file, Encoding::Srgb));
}
