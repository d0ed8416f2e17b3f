//! From pixels to the bytes of a PNG, row by row, so that it can be stopped. Rows are filtered side by side.

use std::io::Write;

use flate2::write::ZlibEncoder;
use flate2::{Compression, Crc};
use rayon::prelude::*;
use warploom_core::node::NodeError;

use super::host::{Host, PIECE, Sink};
use super::pixels::{Pixels, Samples};
use super::tags;

const SIGNATURE: [u8; 8] = [0x89, b'P', b'N', b'G', 0x0d, 0x0a, 0x1a, 0x0a];
/// A chunk's length has 31 bits.
const MAX_CHUNK: usize = i32::MAX as usize;
/// Rows that are filtered side by side before they are packed.
const BATCH: usize = 64;
/// Rows that a thread holds while it filters one: itself, the one above, the best and the last.
const ROWS_AT_WORK: usize = 4;

/// The file of pixels of 8 or 16 bits.
pub fn encode(pixels: &Pixels, host: &dyn Host) -> Result<Vec<u8>, NodeError> {
    let row_bytes = 1 + pixels.width * pixels.samples_per_pixel() * pixels.sample_bytes();
    host.reserve(((BATCH + ROWS_AT_WORK * rayon::current_num_threads()) * row_bytes) as u128)?;
    let mut packer = ZlibEncoder::new(Sink::new(host), Compression::default());
    for top in (0..pixels.height).step_by(BATCH) {
        let rows = top..pixels.height.min(top + BATCH);
        let filtered: Vec<Vec<u8>> = rows.into_par_iter().map(|y| filtered(pixels, y)).collect();
        for row in &filtered {
            if packer.write_all(row).is_err() {
                break; // The sink keeps the reason.
            }
            host.go_on()?;
        }
        host.progress(top as f64 / pixels.height as f64)?;
    }
    let packed = packer.try_finish();
    let pieces = std::mem::replace(packer.get_mut(), Sink::new(host)).pieces()?;
    packed.map_err(|e| NodeError::refused(format!("cannot be encoded: {e}")))?;
    let told = tags::png::chunks(&pixels.coding);
    let told_bytes: usize = told.iter().map(|(_, content)| 12 + content.len()).sum();
    let size = pieces.iter().map(Vec::len).sum::<usize>() + 12 * (pieces.len() + 2) + SIGNATURE.len() + 13 + told_bytes;
    host.reserve(size as u128)?;
    let mut file = Vec::with_capacity(size);
    file.extend(SIGNATURE);
    push_chunk(&mut file, *b"IHDR", &[header(pixels)]);
    told.into_iter().for_each(|(name, content)| push_chunk(&mut file, name, &[content]));
    pieces.chunks(MAX_CHUNK / PIECE).for_each(|pieces| push_chunk(&mut file, *b"IDAT", pieces));
    push_chunk(&mut file, *b"IEND", &[]);
    Ok(file)
}

/// Width, height, depth, sort of colour; the only sorts of packing and filtering there are; not interlaced.
fn header(pixels: &Pixels) -> Vec<u8> {
    let [width, height] = [pixels.width, pixels.height].map(|side| (side as u32).to_be_bytes());
    let color = [0, 4, 2, 6][pixels.samples_per_pixel() - 1];
    [&width[..], &height, &[8 * pixels.sample_bytes() as u8, color, 0, 0, 0]].concat()
}

/// Appends a chunk: its length, name, content and checksum.
fn push_chunk(file: &mut Vec<u8>, name: [u8; 4], pieces: &[Vec<u8>]) {
    let mut checksum = Crc::new();
    checksum.update(&name);
    file.extend((pieces.iter().map(Vec::len).sum::<usize>() as u32).to_be_bytes());
    file.extend(name);
    for piece in pieces {
        checksum.update(piece);
        file.extend_from_slice(piece);
    }
    file.extend(checksum.sum().to_be_bytes());
}

/// Row `y` as it is packed: the number of its filter, then each byte less what the filter foresees. The filter is
/// that which leaves the least sum of magnitudes; of equals the last.
fn filtered(pixels: &Pixels, y: usize) -> Vec<u8> {
    let step = pixels.samples_per_pixel() * pixels.sample_bytes();
    let row = stored(pixels, y);
    let above = if y == 0 { vec![0; row.len()] } else { stored(pixels, y - 1) };
    let mut best = (u64::MAX, Vec::new());
    for number in [2, 1, 3, 4] {
        let out = match number {
            2 => less(&row, &above, step, number, |_, up, _| up),
            1 => less(&row, &above, step, number, |left, _, _| left),
            3 => less(&row, &above, step, number, |left, up, _| (left & up) + ((left ^ up) >> 1)),
            _ => less(&row, &above, step, number, paeth),
        };
        let sum = out[1..].iter().map(|&byte| u64::from(byte.cast_signed().unsigned_abs())).sum();
        if sum <= best.0 {
            best = (sum, out);
        }
        if sum == 0 {
            break;
        }
    }
    best.1
}

/// The filter's number, and the row less what `foresee` makes of the bytes left of, above and above left of each.
fn less(row: &[u8], above: &[u8], step: usize, number: u8, foresee: impl Fn(u8, u8, u8) -> u8) -> Vec<u8> {
    let mut out = vec![number; 1 + row.len()];
    for i in 0..step {
        out[1 + i] = row[i].wrapping_sub(foresee(0, above[i], 0));
    }
    let inner = row.len() - step;
    let seen = row[..inner].iter().zip(&above[step..]).zip(&above[..inner]);
    for ((out, byte), ((&left, &up), &corner)) in out[1 + step..].iter_mut().zip(&row[step..]).zip(seen) {
        *out = byte.wrapping_sub(foresee(left, up, corner));
    }
    out
}

/// Whichever of the three is nearest to left + up - corner; of equals the first.
fn paeth(left: u8, up: u8, corner: u8) -> u8 {
    let (to_left, to_up) = (up.abs_diff(corner), left.abs_diff(corner));
    // Where both neighbours lie on one side of the corner it is the farthest.
    let between = (corner >= up) == (left >= corner);
    let to_corner = if between { to_left.abs_diff(to_up) } else { u8::MAX };
    if to_left <= to_up && to_left <= to_corner {
        left
    } else if to_up <= to_corner {
        up
    } else {
        corner
    }
}

/// The bytes of row `y`, the high one of a sample first.
fn stored(pixels: &Pixels, y: usize) -> Vec<u8> {
    let count = pixels.width * pixels.samples_per_pixel();
    match &pixels.samples {
        Samples::U8(samples) => samples[y * count..][..count].to_vec(),
        Samples::U16(samples) => samples[y * count..][..count].iter().flat_map(|sample| sample.to_be_bytes()).collect(),
        Samples::F32(_) => unreachable!("a PNG holds integers"),
    }
}
