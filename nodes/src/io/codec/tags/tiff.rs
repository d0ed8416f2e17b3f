//! Tags of the first picture of a TIFF.

use tiff::decoder::Decoder;
use tiff::decoder::ifd::Value;
use tiff::tags::Tag;
use warploom_algo::colorimetry::{Chromaticities, Curve, REC_709};
use warploom_core::node::NodeError;

use super::super::coding::{Coding, refused};
use super::super::host::{Host, Source};
use super::super::icc;
use super::super::tiff::tiff_error;
use super::{MAX_PROFILE, too_long};

const TRANSFER_FUNCTION: Tag = Tag::Unknown(301);
const WHITE_POINT: Tag = Tag::Unknown(318);
const PRIMARY_CHROMATICITIES: Tag = Tag::Unknown(319);

/// How colour is stored: by a profile, else by its primaries.
pub fn coding(
    decoder: &mut Decoder<Source>,
    is_grey: bool,
    is_float: bool,
    host: &dyn Host,
) -> Result<Option<Coding>, NodeError> {
    if let Some(entry) = decoder.image_ifd().find_entry(Tag::IccProfile) {
        let size = entry.count() as usize;
        if size > MAX_PROFILE {
            return Err(too_long());
        }
        host.reserve(size as u128)?;
        let mut profile = vec![0; size];
        decoder.image_ifd().find_tag_bytes(Tag::IccProfile, &mut profile, 0).map_err(tiff_error)?;
        return icc::read(&profile, is_grey).map(Some);
    }
    if decoder.image_ifd().find_entry(TRANSFER_FUNCTION).is_some() {
        return Err(refused("its TransferFunction cannot be honoured"));
    }
    let mut points =
        |tag| -> Result<Option<Vec<f64>>, NodeError> { Ok(decoder.find_tag(tag).map_err(tiff_error)?.map(fractions)) };
    let (primaries, white) = (points(PRIMARY_CHROMATICITIES)?, points(WHITE_POINT)?);
    let Some(primaries) = primaries.filter(|_| !is_grey) else { return Ok(None) };
    let white = white.unwrap_or(REC_709.white.to_vec());
    let damaged = || refused("its PrimaryChromaticities and WhitePoint are not 6 and 2 fractions that span a space");
    let (&[rx, ry, gx, gy, bx, by], &[wx, wy]) = (&primaries[..], &white[..]) else { return Err(damaged()) };
    let from = Chromaticities { primaries: [[rx, ry], [gx, gy], [bx, by]], white: [wx, wy] };
    let curve = if is_float { Curve::Linear } else { Curve::Srgb };
    Coding::of_primaries(curve, Some(&from), is_grey).map(Some).ok_or_else(damaged)
}

/// The fractions of a list; none of anything else.
fn fractions(value: Value) -> Vec<f64> {
    let Value::List(values) = value else { return Vec::new() };
    let fraction = |value: &Value| match value {
        Value::Rational(above, below) => f64::from(*above) / f64::from(*below),
        _ => f64::NAN,
    };
    values.iter().map(fraction).collect()
}

/// Which way up it is to be seen.
pub fn orientation(decoder: &mut Decoder<Source>) -> Result<u16, NodeError> {
    let orientation = decoder.find_tag_unsigned::<u16>(Tag::Orientation).map_err(tiff_error)?;
    Ok(orientation.filter(|orientation| (1..=8).contains(orientation)).unwrap_or(1))
}
