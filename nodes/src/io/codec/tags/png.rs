//! Chunks of a PNG before its pixels (PNG specification, third edition, 11.3 and 12).

use std::io::Read;

use flate2::Crc;
use flate2::read::ZlibDecoder;
use warploom_algo::colorimetry::{Chromaticities, Curve, REC_709};
use warploom_core::node::NodeError;

use super::super::coding::{Coding, refused};
use super::super::host::Host;
use super::super::{icc, unreadable};
use super::{MAX_PROFILE, exif, too_long};

/// The most that deflate makes of a byte.
const MAX_INFLATION: usize = 1032;

/// How colour is stored, by the first there is of cICP, iCCP, sRGB, and gAMA with cHRM.
pub fn coding(bytes: &[u8], host: &dyn Host) -> Result<Option<Coding>, NodeError> {
    let is_grey = bytes.get(25).is_some_and(|color| color & 2 == 0);
    if let Some(chunk) = find(bytes, b"cICP")? {
        return cicp(chunk, is_grey).map(Some);
    }
    if let Some(chunk) = find(bytes, b"iCCP")? {
        return icc::read(&unpacked(chunk, host)?, is_grey).map(Some);
    }
    if find(bytes, b"sRGB")?.is_some() {
        return Ok(Some(Coding::Srgb));
    }
    let gamma = find(bytes, b"gAMA")?.map(gamma).transpose()?;
    let primaries = find(bytes, b"cHRM")?.map(chromaticities).transpose()?;
    if gamma.is_none() && primaries.is_none() {
        return Ok(None);
    }
    let coding = Coding::of_primaries(gamma.unwrap_or(Curve::Srgb), primaries.as_ref(), is_grey);
    coding.map(Some).ok_or_else(|| refused("the primaries of its cHRM chunk span no space"))
}

/// Which way up it is to be seen, as Exif tells it.
pub fn orientation(bytes: &[u8]) -> u16 {
    find(bytes, b"eXIf").ok().flatten().map_or(1, exif::orientation)
}

/// The content of the first chunk of a name before the pixels.
fn find<'a>(bytes: &'a [u8], name: &[u8; 4]) -> Result<Option<&'a [u8]>, NodeError> {
    let mut rest = bytes.get(8..).unwrap_or_default();
    while let Some((length, tail)) = rest.split_first_chunk() {
        let Some((chunk, tail)) = tail.split_at_checked((u32::from_be_bytes(*length) as usize).saturating_add(4))
        else {
            break;
        };
        let Some((checksum, tail)) = tail.split_first_chunk() else { break };
        if chunk.starts_with(name) {
            let mut sum = Crc::new();
            sum.update(chunk);
            let damaged = || unreadable(format!("the file is damaged: its {} chunk is", String::from_utf8_lossy(name)));
            return if sum.sum() == u32::from_be_bytes(*checksum) { Ok(Some(&chunk[4..])) } else { Err(damaged()) };
        }
        if chunk.starts_with(b"IDAT") {
            break;
        }
        rest = tail;
    }
    Ok(None)
}

/// The profile that a chunk holds after a name and the number of its packing.
fn unpacked(chunk: &[u8], host: &dyn Host) -> Result<Vec<u8>, NodeError> {
    let damaged = || unreadable("the file is damaged: its iCCP chunk is");
    let end = chunk.iter().position(|&byte| byte == 0).ok_or_else(damaged)?;
    let packed = chunk.get(end + 2..).ok_or_else(damaged)?;
    host.reserve(packed.len().saturating_mul(MAX_INFLATION).min(MAX_PROFILE) as u128)?;
    let mut profile = Vec::new();
    let read = ZlibDecoder::new(packed).take(MAX_PROFILE as u64 + 1).read_to_end(&mut profile);
    match read {
        Ok(size) if size > MAX_PROFILE => Err(too_long()),
        Ok(_) => Ok(profile),
        Err(_) => Err(damaged()),
    }
}

fn gamma(chunk: &[u8]) -> Result<Curve, NodeError> {
    match numbers::<1>(chunk) {
        Some([gamma]) if gamma > 0.0 => Ok(Curve::Power(1.0 / gamma)),
        _ => Err(refused("its gAMA chunk says 0 or nothing")),
    }
}

fn chromaticities(chunk: &[u8]) -> Result<Chromaticities, NodeError> {
    let [wx, wy, rx, ry, gx, gy, bx, by] = numbers(chunk).ok_or_else(|| refused("its cHRM chunk is too short"))?;
    Ok(Chromaticities { primaries: [[rx, ry], [gx, gy], [bx, by]], white: [wx, wy] })
}

/// Numbers in units of 1e-5.
fn numbers<const N: usize>(chunk: &[u8]) -> Option<[f64; N]> {
    let words = chunk.as_chunks().0.first_chunk::<N>()?;
    Some(words.map(|word| f64::from(u32::from_be_bytes(word)) / 1e5))
}

/// Code points of ITU-T H.273: primaries, transfer function, matrix, range.
fn cicp(chunk: &[u8], is_grey: bool) -> Result<Coding, NodeError> {
    const P3: [[f64; 2]; 3] = [[0.68, 0.32], [0.265, 0.69], [0.15, 0.06]];
    let d65 = |primaries| Chromaticities { primaries, white: REC_709.white };
    let &[primaries, transfer, 0, 1] = chunk else {
        let shown = &chunk[..chunk.len().min(4)];
        return Err(refused(format!("its cICP chunk says {shown:?}; only full-range RGB can be honoured (.., 0, 1)")));
    };
    let from = match primaries {
        1 => REC_709,
        5 => d65([[0.64, 0.33], [0.29, 0.60], [0.15, 0.06]]),
        6 | 7 => d65([[0.630, 0.340], [0.310, 0.595], [0.155, 0.070]]),
        9 => d65([[0.708, 0.292], [0.170, 0.797], [0.131, 0.046]]),
        11 => Chromaticities { primaries: P3, white: [0.314, 0.351] },
        12 => d65(P3),
        other => return Err(refused(format!("the primaries {other} of its cICP chunk cannot be honoured"))),
    };
    let curve = match transfer {
        1 | 6 | 14 | 15 => rec709_curve(),
        4 => Curve::Power(2.2),
        5 => Curve::Power(2.8),
        8 => Curve::Linear,
        13 => Curve::Srgb,
        other => {
            let name = [(16, " (PQ)"), (18, " (HLG)")].iter().find(|(code, _)| *code == other).map_or("", |(_, n)| n);
            return Err(refused(format!("the transfer function {other}{name} of its cICP chunk cannot be honoured")));
        }
    };
    Coding::of_primaries(curve, Some(&from), is_grey).ok_or_else(|| refused("its cICP chunk is damaged"))
}

/// What cameras encode by (ITU-R BT.709 and BT.2020), the other way round.
fn rec709_curve() -> Curve {
    const A: f64 = 1.099_296_826_809_44;
    const B: f64 = 0.018_053_968_510_807;
    Curve::Parametric { gamma: 1.0 / 0.45, abcdef: [1.0 / A, (A - 1.0) / A, 1.0 / 4.5, 4.5 * B, 0.0, 0.0] }
}

/// The chunks that say a named coding: names and contents.
pub fn chunks(coding: &Coding) -> Vec<([u8; 4], Vec<u8>)> {
    let hundred_thousandths =
        |values: &[f64]| values.iter().flat_map(|v| ((v * 1e5).round() as u32).to_be_bytes()).collect();
    let Chromaticities { primaries: [[rx, ry], [gx, gy], [bx, by]], white: [wx, wy] } = REC_709;
    let primaries = (*b"cHRM", hundred_thousandths(&[wx, wy, rx, ry, gx, gy, bx, by]));
    match coding {
        // The standard's nearest power stands beside it, for readers that know only that.
        Coding::Srgb => vec![(*b"sRGB", vec![0]), (*b"gAMA", hundred_thousandths(&[0.45455])), primaries],
        Coding::Linear => vec![(*b"gAMA", hundred_thousandths(&[1.0])), primaries],
        Coding::Raw | Coding::Profile(_) => Vec::new(),
    }
}
