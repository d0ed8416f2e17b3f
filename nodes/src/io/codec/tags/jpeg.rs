//! Segments of a JPEG before its first scan.

use warploom_algo::colorimetry::{Chromaticities, Curve, REC_709};
use warploom_core::node::NodeError;

use super::super::coding::{Coding, refused};
use super::super::host::Host;
use super::super::{icc, unreadable, unsupported};
use super::exif::{self, ColorSpace};

const START_OF_SCAN: u8 = 0xda;

/// How colour is stored: by a profile, else by Exif.
pub fn coding(bytes: &[u8], host: &dyn Host) -> Result<Option<Coding>, NodeError> {
    let is_grey = component_count(bytes) == Some(1);
    if let Some(profile) = profile(bytes, host)? {
        return icc::read(&profile, is_grey).map(Some);
    }
    match exif(bytes).and_then(exif::color_space) {
        None => Ok(None),
        Some(ColorSpace::Srgb) => Ok(Some(Coding::Srgb)),
        Some(ColorSpace::AdobeRgb) => {
            let primaries = Chromaticities { primaries: [[0.64, 0.33], [0.21, 0.71], [0.15, 0.06]], ..REC_709 };
            Ok(Coding::of_primaries(Curve::Power(563.0 / 256.0), Some(&primaries), is_grey))
        }
        Some(ColorSpace::Other(number)) => Err(refused(format!(
            "its Exif says of its colour space that it is not sRGB ({number}), and there is no profile to say which"
        ))),
    }
}

/// Which way up it is to be seen, as Exif tells it.
pub fn orientation(bytes: &[u8]) -> u16 {
    exif(bytes).map_or(1, exif::orientation)
}

/// Refuses what is cut off, and inks.
pub fn check(bytes: &[u8]) -> Result<(), NodeError> {
    if !is_whole(bytes) {
        return Err(unreadable("the file ends early"));
    }
    match component_count(bytes) {
        Some(4) => Err(unsupported("the file holds inks (CMYK or YCCK), which cannot be read")
            .hint("convert it to RGB by its profile: magick in.jpg -profile sRGB.icc out.png")),
        _ => Ok(()),
    }
}

/// Whether the end marker follows the start of the first scan; the decoder would fill up what is missing with grey.
fn is_whole(bytes: &[u8]) -> bool {
    let scan = segments(bytes).find(|(marker, _, _)| *marker == START_OF_SCAN);
    scan.is_some_and(|(_, _, rest)| rest.windows(2).any(|pair| pair == [0xff, 0xd9]))
}

/// Samples per pixel, as the frame's header tells.
fn component_count(bytes: &[u8]) -> Option<u8> {
    let is_frame = |marker| matches!(marker, 0xc0..=0xcf) && !matches!(marker, 0xc4 | 0xc8 | 0xcc);
    segments(bytes).find(|(marker, _, _)| is_frame(*marker))?.1.get(5).copied()
}

fn exif(bytes: &[u8]) -> Option<&[u8]> {
    segments(bytes).filter(|(marker, _, _)| *marker == 0xe1).find_map(|(_, data, _)| data.strip_prefix(b"Exif\0\0"))
}

/// The profile, of numbered parts in any order.
fn profile(bytes: &[u8], host: &dyn Host) -> Result<Option<Vec<u8>>, NodeError> {
    let segments = segments(bytes).filter(|(marker, _, _)| *marker == 0xe2);
    let parts = segments.filter_map(|(_, data, _)| data.strip_prefix(b"ICC_PROFILE\0"));
    // One more than can be numbered.
    let mut parts: Vec<&[u8]> = parts.take(256).collect();
    if parts.is_empty() {
        return Ok(None);
    }
    parts.sort_by_key(|part| part.first().copied());
    let count = parts.len();
    let is_whole = parts.iter().enumerate().all(|(i, part)| {
        part.first_chunk().is_some_and(|&[number, of]| usize::from(number) == i + 1 && usize::from(of) == count)
    });
    if !is_whole {
        return Err(refused("its ICC profile is damaged: a part is missing, or there twice"));
    }
    host.reserve(parts.iter().map(|part| part.len() as u128).sum())?;
    Ok(Some(parts.iter().flat_map(|part| &part[2..]).copied().collect()))
}

/// Marker and content of each segment, and what follows it, to the first scan.
fn segments(bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8], &[u8])> {
    let mut rest = bytes.get(2..).unwrap_or_default();
    let next = move || {
        while let [0xff, 0xff, ..] = rest {
            rest = &rest[1..];
        }
        let [0xff, marker, high, low, ..] = *rest else { return None };
        let length = usize::from(u16::from_be_bytes([high, low])).max(2);
        let (segment, tail) = rest.split_at_checked(2 + length)?;
        rest = if marker == START_OF_SCAN { &[] } else { tail };
        Some((marker, &segment[4..], tail))
    };
    std::iter::from_fn(next)
}
