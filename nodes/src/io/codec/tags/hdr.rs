//! Lines of the header of a Radiance HDR.

use warploom_algo::colorimetry::{Chromaticities, Curve, Matrix, is_identity, rec709_from_chromaticities};
use warploom_core::node::NodeError;

use super::super::coding::{Coding, refused};
use super::super::{unreadable, unsupported};

/// Most bytes of a header.
const MAX_HEADER: usize = 1 << 16;

const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// How colour is stored: EXPOSURE and COLORCORR were multiplied in and are divided out again, PRIMARIES adapted.
pub fn coding(bytes: &[u8]) -> Result<Option<Coding>, NodeError> {
    let mut matrix = IDENTITY;
    for primaries in values(bytes, "PRIMARIES") {
        let [rx, ry, gx, gy, bx, by, wx, wy] = numbers(primaries, "PRIMARIES")?;
        let from = Chromaticities { primaries: [[rx, ry], [gx, gy], [bx, by]], white: [wx, wy] };
        let adapted = rec709_from_chromaticities(&from);
        let adapted = adapted.ok_or_else(|| refused("the PRIMARIES of its header span no space"))?;
        matrix = if is_identity(&adapted) { IDENTITY } else { adapted };
    }
    let mut scale = [1.0; 3];
    for exposure in values(bytes, "EXPOSURE") {
        let [exposure] = numbers(exposure, "EXPOSURE")?;
        scale = scale.map(|s| s * exposure);
    }
    for correction in values(bytes, "COLORCORR") {
        let correction: [f64; 3] = numbers(correction, "COLORCORR")?;
        scale = [0, 1, 2].map(|c| scale[c] * correction[c]);
    }
    if scale.iter().any(|s| !s.is_normal() || *s < 0.0) {
        return Err(refused(format!(
            "the EXPOSURE and COLORCORR of its header make {scale:?}, and not numbers above 0"
        )));
    }
    for gamma in values(bytes, "GAMMA") {
        let [gamma] = numbers(gamma, "GAMMA")?;
        if gamma != 1.0 {
            return Err(refused(format!("the GAMMA of its header is {gamma:e}; only 1 can be honoured")));
        }
    }
    let matrix = matrix.map(|row| [0, 1, 2].map(|c| row[c] / scale[c]));
    Ok(Some(Coding::of([Curve::Linear, Curve::Linear, Curve::Linear], Some(matrix))))
}

/// Width of a pixel by its height; the header has it the other way round.
pub fn pixel_aspect(bytes: &[u8]) -> Result<f64, NodeError> {
    let mut aspect = 1.0;
    for value in values(bytes, "PIXASPECT") {
        // No encoding helps against this one.
        let [ratio]: [f64; 1] = numbers(value, "PIXASPECT").map_err(|error| unreadable(error.message))?;
        aspect /= ratio;
    }
    // An EXR has it in 32 bits.
    match (aspect as f32).is_normal() && aspect > 0.0 {
        true => Ok(aspect),
        false => Err(unreadable(format!(
            "the file is damaged: the PIXASPECT of its header makes pixels {aspect:e} times as wide as high"
        ))),
    }
}

/// Refuses pixels of another sort than RGB, and more lines than anybody writes: the decoder keeps each.
pub fn check(bytes: &[u8]) -> Result<(), NodeError> {
    let mut lines = bytes[..bytes.len().min(MAX_HEADER)].split(|&byte| byte == b'\n');
    if bytes.len() > MAX_HEADER && lines.all(|line| !line.is_empty()) {
        return Err(unreadable(format!("the file is damaged: its header is longer than {} KiB", MAX_HEADER >> 10)));
    }
    match values(bytes, "FORMAT").any(|format| format == "32-bit_rle_xyze") {
        true => Err(unsupported("the file holds XYZ colour (FORMAT=32-bit_rle_xyze), which cannot be read")
            .hint("convert it: ra_xyze -r in.hdr out.hdr")),
        false => Ok(()),
    }
}

/// Values of every line `key=value` of a key.
fn values<'a>(bytes: &'a [u8], key: &'static str) -> impl Iterator<Item = &'a str> {
    let lines = bytes.split(|&byte| byte == b'\n').take_while(|line| !line.is_empty());
    let pairs = lines.filter_map(|line| std::str::from_utf8(line).ok()?.split_once('='));
    pairs.filter(move |(name, _)| name.trim() == key).map(|(_, value)| value.trim())
}

fn numbers<const N: usize>(value: &str, key: &str) -> Result<[f64; N], NodeError> {
    let numbers: Option<Vec<f64>> = value.split_whitespace().take(N + 1).map(|number| number.parse().ok()).collect();
    let numbers: Option<[f64; N]> = numbers.and_then(|numbers| numbers.try_into().ok());
    let finite = numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite()));
    let shown: String = value.chars().filter(|c| !c.is_control()).take(80).collect();
    finite.ok_or_else(|| refused(format!("the {key} of its header is \"{shown}\", and not {N} numbers")))
}
