use warploom_core::node::ErrorClass;

use super::*;

type Tag<'a> = (&'a [u8; 4], Vec<u8>);

fn xyz(values: [f64; 3]) -> Vec<u8> {
    [b"XYZ \0\0\0\0", &fixed(&values)[..]].concat()
}

fn curv(entries: &[u16]) -> Vec<u8> {
    let mut tag = [b"curv\0\0\0\0", &(entries.len() as u32).to_be_bytes()[..]].concat();
    tag.extend(entries.iter().flat_map(|entry| entry.to_be_bytes()));
    tag.resize(tag.len().next_multiple_of(4), 0);
    tag
}

/// A profile of RGB with the primaries of Display P3.
fn p3(curve: &[u8]) -> Vec<Tag<'static>> {
    let columns = [[0.51512, 0.24120, -0.00105], [0.29198, 0.69225, 0.04189], [0.15710, 0.06657, 0.78407]];
    let mut tags = vec![(b"desc", text("Wide"))];
    tags.extend([b"rXYZ", b"gXYZ", b"bXYZ"].into_iter().zip(columns.map(xyz)));
    tags.extend([b"rTRC", b"gTRC", b"bTRC"].map(|name| (name, curve.to_vec())));
    tags
}

fn rgb(tags: &[Tag]) -> Vec<u8> {
    assembled(b"RGB ", tags)
}

fn grey(curve: &[u8]) -> Coding {
    read(&assembled(b"GRAY", &[(b"kTRC", curve.to_vec())]), true).expect("it is honoured")
}

fn linear(coding: &Coding, stored: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|c| coding.linear(c, |k| stored[k]))
}

#[test]
fn what_is_written_is_read_as_what_it_was() {
    for (coding, is_grey) in [Coding::Linear, Coding::Srgb].iter().flat_map(|c| [(c, false), (c, true)]) {
        let profile = written(coding, is_grey).expect("it has a profile");
        assert_eq!(read(&profile, is_grey), Ok(coding.clone()));
        assert_eq!(u32_at(&profile, 0), Some(profile.len() as u32));
        assert!(profile.len().is_multiple_of(4) && profile.len() < 800, "{}", profile.len());
    }
    assert_eq!(written(&Coding::Raw, false), None);
}

#[test]
fn curves_of_every_sort() {
    let near = |curve: &[u8], value: f32, expected: f64| {
        let linear = grey(curve).linear(0, |_| value);
        assert!((f64::from(linear) - expected).abs() < 1e-6, "{value}: {linear}, not {expected}");
    };
    near(&curv(&[]), 0.3, 0.3);
    near(&curv(&[0x0233]), 0.5, 0.5f64.powf(563.0 / 256.0));
    near(&curv(&[0, 16384, 65535]), 0.25, 16384.0 / 65535.0 / 2.0);
    near(&para(0, &[2.5]), 0.5, 0.5f64.powf(2.5));
    near(&para(1, &[2.0, 1.5, -0.5]), 0.25, 0.0);
    near(&para(1, &[2.0, 1.5, -0.5]), 0.75, 0.625 * 0.625);
    near(&para(2, &[2.0, 1.5, -0.5, 0.125]), 0.25, 0.125);
    near(&para(2, &[2.0, 1.5, -0.5, 0.125]), 0.75, 0.625 * 0.625 + 0.125);
    near(&para(3, &[2.0, 1.5, -0.5, 0.25, 0.5]), 0.25, 0.0625);
    near(&para(4, &[2.0, 1.5, -0.5, 0.25, 0.5, 0.125, 0.0625]), 0.25, 0.125);
    near(&para(4, &[2.0, 1.5, -0.5, 0.25, 0.5, 0.125, 0.0625]), 0.75, 0.625 * 0.625 + 0.125);
}

#[test]
fn primaries_are_those_of_rec_709() {
    let coding = read(&rgb(&p3(&curv(&[]))), false).expect("it is honoured");
    for (stored, expected) in [
        ([1.0, 0.0, 0.0], [1.2249, -0.0420, -0.0196]),
        ([0.0, 0.0, 0.5], [0.0, 0.0, 0.5491]),
        ([0.7, 0.7, 0.7], [0.7, 0.7, 0.7]),
    ] {
        let values = linear(&coding, stored);
        assert!(values.iter().zip(expected).all(|(a, b): (_, f32)| (a - b).abs() < 2e-4), "{values:?}");
    }
    // The same with sRGB's curve; it keeps its name, so that greys have the bits of sRGB but for the matrix.
    let curve = para(3, &[2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045]);
    let wide = linear(&read(&rgb(&p3(&curve)), false).expect("it is honoured"), [0.5; 3]);
    assert!(wide.iter().all(|v| (v - 0.214_041).abs() < 1e-4), "{wide:?}");
}

#[test]
fn a_grey_picture_may_have_an_rgb_profile_without_a_cast() {
    let profile = rgb(&p3(&curv(&[0x0200])));
    let coding = read(&profile, true).expect("it is honoured");
    assert_eq!(coding.linear(0, |_| 0.5), 0.25);
    let mut cast = p3(&curv(&[0x0200]));
    cast[5].1 = curv(&[0x0300]);
    assert!(read(&rgb(&cast), true).expect_err("it is refused").message.contains("colour a grey"));
}

#[test]
fn what_cannot_be_honoured_is_told() {
    let without = |name: &[u8; 4]| {
        let mut tags = p3(&curv(&[]));
        tags.retain(|tag| tag.0 != name);
        tags
    };
    let mut tables = without(b"rTRC");
    tables.push((b"A2B0", vec![0; 64]));
    let mut odd = p3(&curv(&[]));
    odd[1].1 = xyz([0.0; 3]);
    let mut lab = rgb(&tables);
    lab[20..24].copy_from_slice(b"Lab ");
    for (profile, is_grey, expected) in [
        (rgb(&tables), false, "\"Wide\" cannot be honoured: it has tables of colours only (A2B)"),
        (rgb(&without(b"gTRC")), false, "it has no gTRC"),
        (lab, false, "it leads to Lab by tables"),
        (assembled(b"CMYK", &tables), false, "it is of CMYK colour, and the picture is RGB"),
        (assembled(b"GRAY", &[(b"kTRC", curv(&[]))]), false, "it is of GRAY colour, and the picture is RGB"),
        (rgb(&odd), false, "its primaries span no space"),
        (rgb(&p3(b"curv\0\0\0\0\xff\xff\xff\xff")), false, "its rTRC is damaged"),
        (rgb(&p3(&curv(&[0; 65_537]))), false, "its rTRC is damaged"),
        (rgb(&p3(&para(9, &[1.0; 9]))), false, "its rTRC is damaged"),
        (vec![0; 200], false, "without a name cannot be honoured: it is damaged"),
        (Vec::new(), true, "it is damaged"),
    ] {
        let error = read(&profile, is_grey).expect_err(expected);
        assert_eq!(error.class, ErrorClass::InputUnsupported);
        assert!(error.message.contains(expected), "{}", error.message);
        assert!(error.hint.is_some_and(|hint| hint.contains("`encoding: Srgb`")));
    }
}

#[test]
fn rubbish_is_read_or_refused() {
    let profiles = [
        rgb(&p3(&curv(&[0, 100, 65535]))),
        rgb(&p3(&para(4, &[2.0, 1.5, -0.5, 0.25, 0.5, 0.125, 0.0]))),
        written(&Coding::Srgb, true).expect("it has a profile"),
    ];
    let mut honoured = 0;
    for profile in &profiles {
        for length in 0..profile.len() {
            honoured += usize::from(read(&profile[..length], false).is_ok());
        }
        for i in 0..4000usize {
            let mut broken = profile.clone();
            for k in 0..1 + i % 3 {
                let place = (i * 7919 + k * 104_729) % broken.len();
                broken[place] = [0, 0xff, 0x80, (i / 7) as u8][(i + k) % 4];
            }
            for is_grey in [false, true] {
                if let Ok(coding) = read(&broken, is_grey) {
                    honoured += 1;
                    linear(&coding, [0.5, f32::NAN, -1e30]);
                }
            }
        }
    }
    assert!(honoured > 1000, "most damage is to what is not looked at: {honoured}");
}
