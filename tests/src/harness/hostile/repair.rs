//! Checksums and packed streams, so that what is spoiled reaches the decoder behind them.

use std::io::{Read, Write};
use std::ops::Range;

use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use flate2::{Compression, Crc, Decompress, FlushDecompress};

/// The checksum of PNG's chunks.
pub fn crc(bytes: &[u8]) -> u32 {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.sum()
}

/// A zlib stream.
pub fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut packer = ZlibEncoder::new(Vec::new(), Compression::best());
    packer.write_all(bytes).and_then(|()| packer.finish()).expect("a vector takes it")
}

/// What a zlib stream holds; none if it is not sound.
pub fn inflated(stream: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    ZlibDecoder::new(stream).read_to_end(&mut bytes).ok().map(|_| bytes)
}

/// Where sound zlib streams lie, in any format.
pub fn streams(file: &[u8]) -> Vec<Range<usize>> {
    let (mut found, mut at) = (Vec::new(), 0);
    while at + 8 < file.len() {
        let mut decoder = ZlibDecoder::new(&file[at..]);
        let is_head = file[at] & 0xf == 8 && (u32::from(file[at]) * 256 + u32::from(file[at + 1])).is_multiple_of(31);
        if is_head && decoder.read_to_end(&mut Vec::new()).is_ok() {
            let length = decoder.total_in() as usize;
            found.push(at..at + length);
            at += length;
        } else {
            at += 1;
        }
    }
    found
}

/// Writes the right checksum behind a stream that was spoiled, if it can still be unpacked.
pub fn mend_stream(stream: &mut [u8]) {
    const ROOM: usize = 1 << 20;
    let Some(body) = stream.get(2..) else { return };
    let mut unpacker = Decompress::new(false);
    let mut bytes = Vec::with_capacity(ROOM);
    let unpacked = unpacker.decompress_vec(body, &mut bytes, FlushDecompress::Finish);
    let end = 2 + unpacker.total_in() as usize;
    if let (Ok(flate2::Status::StreamEnd), Some(sum)) = (unpacked, stream.get_mut(end..end + 4)) {
        sum.copy_from_slice(&adler(&bytes).to_be_bytes());
    }
}

/// The checksum of zlib streams.
fn adler(bytes: &[u8]) -> u32 {
    const PRIME: u32 = 65_521;
    let step = |(low, high): (u32, u32), &byte: &u8| {
        let low = (low + u32::from(byte)) % PRIME;
        (low, (high + low) % PRIME)
    };
    let (low, high) = bytes.iter().fold((1, 0), step);
    high << 16 | low
}

/// Where the contents of a PNG's chunks lie, as far as their lengths make sense; the name stands before each.
pub fn chunks(png: &[u8]) -> Vec<Range<usize>> {
    let (mut found, mut at) = (Vec::new(), 8);
    while let Some(length) = png.get(at..).and_then(|rest| rest.first_chunk::<4>()) {
        let range = at + 8..(at + 8).saturating_add(u32::from_be_bytes(*length) as usize);
        at = range.end + 4;
        if at > png.len() {
            break;
        }
        found.push(range);
    }
    found
}

/// Writes the right checksum behind every chunk of a PNG.
pub fn mend_chunks(png: &mut [u8]) {
    for chunk in chunks(png) {
        let sum = crc(&png[chunk.start - 4..chunk.end]);
        png[chunk.end..chunk.end + 4].copy_from_slice(&sum.to_be_bytes());
    }
}
