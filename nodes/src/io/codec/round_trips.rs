//! What is read and written again is the same, wherever the format allows it.

use flate2::Crc;
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::ExtraSamples;
use warploom_algo::transfer;
use warploom_core::value::{Image, SampleType};

use super::tests::{FREE, options, picture, plane};
use super::{Depth, Encoding, WriteOptions, decode, encode_image};

const SIGNATURE: &[u8] = &[0x89, b'P', b'N', b'G', 0x0d, 0x0a, 0x1a, 0x0a];

fn read(file: &[u8], encoding: Encoding) -> Image {
    decode(file, encoding, FREE).expect("it can be read")
}

fn write(image: &Image, extension: &str, encoding: Encoding) -> Vec<u8> {
    encode_image(image, extension, &options(encoding, Depth::Auto), FREE).expect("it can be written")
}

/// The codes of a picture's channels, channel by channel.
fn codes(file: &[u8], max: u16) -> Vec<Vec<u16>> {
    let image = read(file, Encoding::Raw);
    let names = image.primary().channels.iter().map(|channel| &*channel.name);
    names.map(|name| plane(&image, name).rows().flatten().map(|&v| transfer::code(v, max)).collect()).collect()
}

/// A picture of codes `0..=max` of red and others of green, under alpha as `alpha(column, row)` tells it.
fn colours(max: u16, rows: usize, alpha: impl Fn(usize, usize) -> u16) -> Image {
    let value = |code: usize| code as f32 / f32::from(max);
    let width = usize::from(max) + 1;
    let pixel = |i: usize| {
        let (x, y) = (i % width, i / width);
        [value(x), value((x * 31 + y) % width), value(width - 1 - x), value(alpha(x, y).into())]
    };
    let samples: Vec<f32> = (0..width * rows).flat_map(pixel).collect();
    let sample_type = if max == 255 { SampleType::U8 } else { SampleType::U16 };
    picture(&["R", "G", "B", "A"], sample_type, if max == 255 { 256 } else { 4096 }, &samples)
}

#[test]
fn every_code_under_every_alpha_comes_back() {
    let bytes = colours(255, 255, |_, y| y as u16 + 1);
    // Alpha of 16 bits: small ones, all bits, and everything between.
    let words = colours(65535, 3, |x, y| [(x % 300) as u16 + 1, 65535, ((x * 40_503) % 65535) as u16 + 1][y]);
    for (extension, image, max) in
        [("png", &bytes, 255), ("tif", &bytes, 255), ("png", &words, 65535), ("tif", &words, 65535)]
    {
        for encoding in [Encoding::Srgb, Encoding::Linear] {
            // Straight codes, said to be so encoded.
            let raw = write(image, extension, Encoding::Raw);
            let raw = if extension == "png" { raw } else { marked_straight(&raw) };
            let file = write(&read(&raw, encoding), extension, encoding);
            assert!(codes(&file, max) == codes(&raw, max), ".{extension}, {max}, {encoding:?}");
            // The file says how it is encoded, so nobody need.
            assert!(read(&file, Encoding::Auto) == read(&raw, encoding), ".{extension}, {max}, {encoding:?}");
            assert!(write(&read(&file, Encoding::Auto), extension, encoding) == file);
        }
    }
}

/// A TIFF of ours, of premultiplied samples, that calls them straight.
fn marked_straight(file: &[u8]) -> Vec<u8> {
    let mut file = file.to_vec();
    // Tag 338 (ExtraSamples), of 16 bits, one.
    let entry = file.windows(8).position(|entry| entry == [0x52, 1, 3, 0, 1, 0, 0, 0]).expect("the tag");
    file[entry + 8] = 2;
    file
}

#[test]
fn a_file_says_how_it_is_encoded() {
    let samples = [0.1, 0.5, 0.9, 0.3, 0.7, 0.2].map(|v: f32| f32::from(transfer::code(v, 255)) / 255.0);
    for (names, extension) in [("RGB", "png"), ("Y", "png"), ("RGB", "tif"), ("Y", "tif"), ("RGB", "jpg"), ("Y", "jpg")]
    {
        let names: Vec<&str> = if names == "Y" { vec!["Y"] } else { vec!["R", "G", "B"] };
        let image = picture(&names, SampleType::U8, 2, &samples);
        let file = |encoding| write(&image, extension, encoding);
        assert!(file(Encoding::Auto) == file(Encoding::Srgb), ".{extension}");
        for encoding in [Encoding::Linear, Encoding::Srgb] {
            let file = file(encoding);
            assert!(read(&file, Encoding::Auto) == read(&file, encoding), ".{extension}, {encoding:?}");
        }
        assert!(read(&file(Encoding::Linear), Encoding::Auto) != read(&file(Encoding::Linear), Encoding::Srgb));
        let raw = file(Encoding::Raw);
        assert!(read(&raw, Encoding::Auto) == read(&raw, Encoding::Srgb), "one that says nothing");
    }
    // Floats too.
    let image = picture(&["R", "G", "B"], SampleType::Float, 2, &samples);
    let file = write(&image, "tif", Encoding::Srgb);
    assert!(read(&file, Encoding::Auto) == read(&file, Encoding::Srgb));
    assert!(read(&file, Encoding::Auto) != read(&file, Encoding::Linear));
}

#[test]
fn floats_of_a_tiff_keep_their_bits() {
    let odd = [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, f32::MIN_POSITIVE / 8.0, f32::MAX, -3.5];
    let bits = |image: &Image, name: &str| plane(image, name).rows().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
    let mut noise = 1u32;
    let mut random = || {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from_bits(noise)
    };
    let samples: Vec<f32> = odd.into_iter().chain((0..3 * 64 * 64 - 8).map(|_| random())).collect();
    for names in [&["R", "G", "B"][..], &["Y"]] {
        let image = picture(names, SampleType::Float, 64, &samples);
        for encoding in [Encoding::Auto, Encoding::Linear, Encoding::Raw] {
            let file = write(&image, "tif", encoding);
            let back = read(&file, Encoding::Auto);
            assert!(names.iter().all(|name| bits(&back, name) == bits(&image, name)), "{names:?}, {encoding:?}");
            assert!(write(&back, "tif", encoding) == file);
        }
    }
    // Associated alpha: what is stored is what pictures are.
    let image = picture(&["R", "G", "B", "A"], SampleType::Float, 64, &samples);
    let file = write(&image, "tif", Encoding::Raw);
    assert!(["R", "G", "B", "A"].iter().all(|name| bits(&read(&file, Encoding::Auto), name) == bits(&image, name)));
}

#[test]
fn associated_alpha_of_integers_is_not_multiplied_again() {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).expect("it can be written");
    let mut image = encoder.new_image::<colortype::RGB8>(256, 1).expect("it can be written");
    image.extra_samples(&[ExtraSamples::AssociatedAlpha]).expect("it can be written");
    let pixel = |alpha: u8| [alpha, alpha / 2, 0, alpha];
    let samples: Vec<u8> = (0..=255).flat_map(pixel).collect();
    image.write_data(&samples).expect("it can be written");
    let linear = read(file.get_ref(), Encoding::Linear);
    let expected: Vec<f32> = (0..=255u8).map(|alpha| f32::from(alpha / 2) / 255.0).collect();
    assert_eq!(plane(&linear, "G").row(0), expected);
    // White under any alpha is white in any encoding.
    let srgb = read(file.get_ref(), Encoding::Srgb);
    assert_eq!(plane(&srgb, "R").row(0), plane(&srgb, "A").row(0));
}

/// A PNG of rows of packed samples.
fn png(size: [u32; 2], depth: u8, color: u8, chunks: &[(&[u8; 4], &[u8])], rows: &[u8], interlaced: bool) -> Vec<u8> {
    use std::io::Write;
    let header =
        [&size[0].to_be_bytes()[..], &size[1].to_be_bytes(), &[depth, color, 0, 0, interlaced.into()]].concat();
    let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    packer.write_all(rows).expect("a vector takes it");
    let packed = packer.finish().expect("a vector takes it");
    let mut file = SIGNATURE.to_vec();
    let all = [(b"IHDR", &header[..])].into_iter().chain(chunks.iter().copied());
    for (name, content) in all.chain([(b"IDAT", &packed[..]), (b"IEND", &[])]) {
        let mut sum = Crc::new();
        sum.update(name);
        sum.update(content);
        file.extend((content.len() as u32).to_be_bytes());
        file.extend([&name[..], content, &sum.sum().to_be_bytes()].concat());
    }
    file
}

/// Rows of samples of `depth` bits, unfiltered, of those pixels of a picture that `columns` and `lines` name.
fn packed(depth: u8, columns: &[usize], lines: &[usize], sample: impl Fn(usize, usize) -> u16) -> Vec<u8> {
    let mut out = Vec::new();
    for &y in lines {
        out.push(0);
        let bits: Vec<u16> = columns
            .iter()
            .flat_map(|&x| (0..depth).rev().map(move |bit| (x, bit)))
            .map(|(x, bit)| sample(x, y) >> bit & 1)
            .collect();
        out.extend(
            bits.chunks(8).map(|byte| byte.iter().enumerate().fold(0u8, |sum, (i, &bit)| sum | (bit as u8) << (7 - i))),
        );
    }
    out
}

#[test]
fn greys_of_few_bits_and_interlaced_ones() {
    // First column and row, and steps, of Adam7's passes.
    const PASSES: [[usize; 4]; 7] =
        [[0, 0, 8, 8], [4, 0, 8, 8], [0, 4, 4, 8], [2, 0, 4, 4], [0, 2, 2, 4], [1, 0, 2, 2], [0, 1, 1, 2]];
    let (width, height) = (37usize, 29usize);
    for depth in [1u8, 2, 4, 8, 16] {
        let max = ((1u32 << depth) - 1) as u16;
        let sample = |x: usize, y: usize| ((x * 7 + y * 1237) as u32 & u32::from(max)) as u16;
        let all: (Vec<usize>, Vec<usize>) = ((0..width).collect(), (0..height).collect());
        let straight = packed(depth, &all.0, &all.1, sample);
        let passes = PASSES.iter().flat_map(|&[x, y, dx, dy]| {
            let columns: Vec<usize> = (x..width).step_by(dx).collect();
            packed(depth, &columns, &(y..height).step_by(dy).collect::<Vec<_>>(), sample)
        });
        let size = [width as u32, height as u32];
        let file = png(size, depth, 0, &[], &straight, false);
        let interlaced = png(size, depth, 0, &[], &passes.collect::<Vec<u8>>(), true);
        assert!(read(&file, Encoding::Auto) == read(&interlaced, Encoding::Auto), "{depth} bits");
        let stored_max = if depth == 16 { 65535 } else { 255 };
        let expected: Vec<u16> =
            (0..width * height).map(|i| sample(i % width, i / width) * (stored_max / max)).collect();
        assert!(codes(&file, stored_max) == [expected.clone()], "{depth} bits");
        for encoding in [Encoding::Srgb, Encoding::Linear] {
            let back = write(&read(&file, encoding), "png", encoding);
            assert!(codes(&back, stored_max) == [expected.clone()], "{depth} bits, {encoding:?}");
        }
        // One grey that is told to be transparent.
        let told = sample(5, 3);
        let clear = png(size, depth, 0, &[(b"tRNS", &told.to_be_bytes())], &straight, false);
        let alpha = (0..width * height).map(|i| if sample(i % width, i / width) == told { 0 } else { stored_max });
        assert!(codes(&clear, stored_max) == [expected, alpha.collect()], "{depth} bits, transparent");
    }
}

#[test]
fn palettes_and_transparent_colours() {
    let palette: Vec<u8> = (0..=255u8).flat_map(|i| [i, i.wrapping_mul(37), 255 - i]).collect();
    let alphas: Vec<u8> = (0..200u8).rev().collect();
    let index = |x: usize, y: usize| ((x + 16 * y) % 256) as u16;
    let all: Vec<usize> = (0..16).collect();
    let rows = packed(8, &all, &all, index);
    let opaque = png([16, 16], 8, 3, &[(b"PLTE", &palette)], &rows, false);
    let channel = |c: usize| (0..256).map(|i| u16::from(palette[3 * i + c])).collect::<Vec<u16>>();
    let expected = vec![channel(0), channel(1), channel(2)];
    assert!(codes(&opaque, 255) == expected);
    let clear = png([16, 16], 8, 3, &[(b"PLTE", &palette), (b"tRNS", &alphas)], &rows, false);
    let alpha: Vec<u16> = (0..256).map(|i| alphas.get(i).map_or(255, |&alpha| alpha.into())).collect();
    assert!(codes(&clear, 255) == [expected.clone(), vec![alpha]].concat());
    for encoding in [Encoding::Srgb, Encoding::Linear] {
        assert!(codes(&write(&read(&opaque, encoding), "png", encoding), 255) == expected, "{encoding:?}");
        let back = codes(&write(&read(&clear, encoding), "png", encoding), 255);
        // What cannot be seen has no colour: index 199 alone has alpha 0.
        let black = |c: usize| -> Vec<u16> {
            channel(c).into_iter().enumerate().map(|(i, v)| if i == 199 { 0 } else { v }).collect()
        };
        assert!(back[..3] == [black(0), black(1), black(2)], "{encoding:?}");
    }
    // One colour of 16 bits that is told to be transparent: all six bytes of it count.
    let colors = [0x0102u16, 0x0304, 0x0506, 0x0102, 0x0304, 0x0507];
    let bytes: Vec<u8> = [0].into_iter().chain(colors.iter().flat_map(|v| v.to_be_bytes())).collect();
    let told: Vec<u8> = colors[..3].iter().flat_map(|v| v.to_be_bytes()).collect();
    let file = png([2, 1], 16, 2, &[(b"tRNS", &told)], &bytes, false);
    assert_eq!(codes(&file, 65535)[2..], [vec![0x0506, 0x0507], vec![0, 65535]]);
}

#[test]
fn pixels_of_an_hdr_come_back() {
    // Every exponent but those that floats hold with fewer digits or not at all, mantissas that fill theirs.
    let mut noise = 7u32;
    let mut random = || {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        noise.to_be_bytes()
    };
    let pixels = (0..40).flat_map(|_| (9..=253u8).collect::<Vec<u8>>()).map(|exponent| {
        let [red, green, blue, which] = random();
        let mut pixel = [red, green, blue, exponent];
        pixel[usize::from(which % 3)] |= 128;
        pixel
    });
    let pixels: Vec<u8> = pixels.flatten().collect();
    let mut file = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2450 +X 4\n".to_vec();
    file.extend(&pixels);
    let image = read(&file, Encoding::Auto);
    assert_eq!(image.display.height(), 2450);
    let written = write(&image, "hdr", Encoding::Auto);
    assert!(read(&written, Encoding::Auto) == image);
    assert!(written.ends_with(&pixels), "narrow pictures are stored pixel by pixel");
    let tiny = picture(&["R", "G", "B"], SampleType::Float, 1, &[1e-40, 0.0, 2e-39]);
    let options = WriteOptions::default();
    let black = read(&encode_image(&tiny, "hdr", &options, FREE).expect("it can be written"), Encoding::Auto);
    assert_eq!(plane(&black, "R").row(0), [0.0], "what is too small does not come back as something large");
}
