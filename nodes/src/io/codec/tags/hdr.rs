//! Lines of the header of a Radiance HDR.

use warploom_algo::colorimetry::{Chromaticities, Curve, Matrix, is_identity, rec709_from_chromaticities};
use warploom_core::node::NodeError;

use super::super::coding::{Coding, refused};
use super::super::{unreadable, unsupported};

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
        return Err(refused("the EXPOSURE or COLORCORR of its header is not a number above 0"));
    }
    for gamma in values(bytes, "GAMMA") {
        if numbers(gamma, "GAMMA")? != [1.0] {
            return Err(refused(format!("the GAMMA of its header is {gamma}; only 1 can be honoured")));
        }
    }
    let matrix = matrix.map(|row| [0, 1, 2].map(|c| row[c] / scale[c]));
    Ok(Some(Coding::of([Curve::Linear, Curve::Linear, Curve::Linear], Some(matrix).filter(|m| *m != IDENTITY))))
}

/// Width of a pixel by its height; the header has it the other way round.
pub fn pixel_aspect(bytes: &[u8]) -> Result<f64, NodeError> {
    let mut aspect = 1.0;
    for value in values(bytes, "PIXASPECT") {
        let [ratio]: [f64; 1] = numbers(value, "PIXASPECT")?;
        aspect /= ratio;
    }
    match aspect.is_normal() && aspect > 0.0 {
        true => Ok(aspect),
        false => Err(unreadable("the file is damaged: the PIXASPECT of its header is not a number above 0")),
    }
}

/// Refuses pixels of another sort than RGB.
pub fn check(bytes: &[u8]) -> Result<(), NodeError> {
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
    let numbers: Option<Vec<f64>> = value.split_whitespace().map(|number| number.parse().ok()).collect();
    let numbers: Option<[f64; N]> = numbers.and_then(|numbers| numbers.try_into().ok());
    let finite = numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite()));
    let shown: String = value.chars().filter(|c| !c.is_control()).take(80).collect();
    finite.ok_or_else(|| refused(format!("the {key} of its header is \"{shown}\", and not {N} numbers")))
}
