//! Ways to spoil a good file.

use std::ops::Range;

use super::repair::{chunks, deflated, inflated, mend_chunks, mend_stream, streams};
use super::seeds::{Format, Seed};
use crate::Random;

/// A good file with what of it is worth to be spoiled.
pub struct Target {
    /// The good file.
    pub seed: Seed,
    fields: Vec<Field>,
    streams: Vec<Range<usize>>,
}

/// A number in a file.
struct Field {
    at: usize,
    bytes: usize,
    high_first: bool,
}

/// Numbers that programs stumble over; also cut to fewer bytes.
const EXTREMES: [u64; 19] = [
    0,
    1,
    2,
    0x7f,
    0x80,
    0xff,
    0x100,
    0x7fff,
    0x8000,
    0xffff,
    0x1_0000,
    0x1_0001,
    0x00ff_ffff,
    0x4000_0000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0xffff_ffff_ffff_ffff,
];

impl Target {
    /// Looks through a good file.
    pub fn new(seed: Seed) -> Self {
        let (fields, streams) = (fields(seed.format, &seed.bytes), streams(&seed.bytes));
        Self { seed, fields, streams }
    }

    /// The file spoiled in one to four ways, and most times its checksums mended.
    pub fn spoiled(&self, random: &mut Random) -> Vec<u8> {
        let mut file = self.seed.bytes.clone();
        let is_inside = !self.streams.is_empty() && random.below(4) == 0;
        if is_inside {
            self.spoil_inside(&mut file, random);
        }
        // What moves bytes comes last, since streams and fields are known by their places.
        for _ in 0..random.below(3) + usize::from(!is_inside) {
            match random.below(5) {
                0 | 1 => self.spoil_field(&mut file, random),
                2 if !self.streams.is_empty() => self.spoil_packed(&mut file, random),
                _ => spoil_bytes(&mut file, random),
            }
        }
        if random.below(3) == 0 {
            move_blocks(&mut file, self.seed.format, random);
        }
        if self.seed.format == Format::Png && random.below(8) > 0 {
            mend_chunks(&mut file);
        }
        file
    }

    fn spoil_field(&self, file: &mut [u8], random: &mut Random) {
        if self.seed.format == Format::Hdr {
            return spoil_text(file, random);
        }
        let Some(field) = self.fields.get(random.below(self.fields.len().max(1))) else { return };
        let Some(place) = file.get_mut(field.at..field.at + field.bytes) else { return };
        let old = place.iter().fold(0, |n, &byte| n << 8 | u64::from(byte));
        let old = if field.high_first { old } else { old.swap_bytes() >> (64 - 8 * field.bytes) };
        let near = [old.wrapping_add(1), old.wrapping_sub(1), old.wrapping_mul(2), old / 2, old ^ 0x8000];
        let number = if random.below(3) == 0 { *random.pick(&near) } else { *random.pick(&EXTREMES) };
        match field.high_first {
            true => place.copy_from_slice(&number.to_be_bytes()[8 - field.bytes..]),
            false => place.copy_from_slice(&number.to_le_bytes()[..field.bytes]),
        }
    }

    /// Spoils packed bytes and mends the checksum behind them.
    fn spoil_packed(&self, file: &mut [u8], random: &mut Random) {
        let Some(stream) = file.get_mut(random.pick(&self.streams).clone()) else { return };
        spoil_bytes(stream, random);
        mend_stream(stream);
    }

    /// Unpacks a stream, spoils what is in it, and packs it again where it was, if there is room.
    fn spoil_inside(&self, file: &mut [u8], random: &mut Random) {
        let stream = &mut file[random.pick(&self.streams).clone()];
        let Some(mut inside) = inflated(stream) else { return };
        spoil_bytes(&mut inside, random);
        if random.below(4) == 0 {
            // More or less than is wanted.
            let length = random.below(2 * inside.len() + 2);
            inside.resize(length, *random.pick(&[0, 1, 0xff]));
        }
        let packed = deflated(&inside);
        if packed.len() <= stream.len() {
            stream.fill(0);
            stream[..packed.len()].copy_from_slice(&packed);
        }
    }
}

/// Flips bits, sets bytes, or lays some bytes over others.
fn spoil_bytes(file: &mut [u8], random: &mut Random) {
    if file.is_empty() {
        return;
    }
    // Half the time near the start, where heads are.
    let reach = if random.below(2) == 0 { file.len().min(400) } else { file.len() };
    for _ in 0..=random.below(6) {
        let at = random.below(reach);
        match random.below(3) {
            0 => file[at] ^= 1 << random.below(8),
            1 => file[at] = *random.pick(&[0, 0xff, 0x7f, 0x80, 1]),
            _ => {
                let from = random.below(file.len());
                let count = random.below(16).min(file.len() - from.max(at));
                file.copy_within(from..from + count, at);
            }
        }
    }
}

/// Replaces a number of a head that is text.
fn spoil_text(file: &mut [u8], random: &mut Random) {
    let numbers = ["0", "-1", "65536", "99999", "4294967295", "4294967296", "99999999999999999999", "1e9", "nan", "+X"];
    let reach = file.len().min(130);
    let start = random.below(reach.max(1));
    let Some(at) = file[start..reach].iter().position(u8::is_ascii_digit) else { return };
    let number = random.pick(&numbers).as_bytes();
    let count = number.len().min(file.len() - start - at);
    file[start + at..][..count].copy_from_slice(&number[..count]);
}

/// Cuts the file, or takes out, repeats or shuffles parts of it: chunks of a PNG, any bytes of others.
fn move_blocks(file: &mut Vec<u8>, format: Format, random: &mut Random) {
    let chunks = if format == Format::Png { chunks(file) } else { Vec::new() };
    let block = match chunks.is_empty() || random.below(3) == 0 {
        true => {
            let (a, b) = (random.below(file.len() + 1), random.below(200));
            a..(a + b).min(file.len())
        }
        false => {
            let chunk = random.pick(&chunks);
            chunk.start - 8..chunk.end + 4
        }
    };
    let bytes = file[block.clone()].to_vec();
    match random.below(4) {
        0 => file.truncate(random.below(file.len() + 1)),
        1 => drop(file.drain(block)),
        2 => drop(file.splice(block.end..block.end, bytes)),
        _ => {
            file.drain(block);
            let place = if chunks.len() > 1 { random.pick(&chunks).start - 8 } else { random.below(file.len() + 1) };
            let place = place.min(file.len());
            file.splice(place..place, bytes);
        }
    }
}

/// The numbers of a file's heads.
fn fields(format: Format, file: &[u8]) -> Vec<Field> {
    let number = |at, bytes, high_first| Field { at, bytes, high_first };
    match format {
        Format::Hdr => Vec::new(),
        Format::Png => {
            let heads = [(16, 4), (20, 4), (24, 1), (25, 1), (26, 1), (27, 1), (28, 1)];
            let of_chunks = chunks(file).into_iter().flat_map(|chunk| [(chunk.start - 8, 4), (chunk.start, 4)]);
            heads.into_iter().chain(of_chunks).map(|(at, bytes)| number(at, bytes, true)).collect()
        }
        Format::Jpeg => segments(file).into_iter().flat_map(|(at, bytes)| [number(at, bytes, true)]).collect(),
        // Both have numbers all over their heads; they need not stand at whole words.
        Format::Exr => {
            let head = (8..file.len().min(1000)).map(|at| number(at, 4, false));
            let known = exr_sizes(file).into_iter().flat_map(|at| (0..8).map(move |_| number(at, 4, false)));
            head.chain(known).collect()
        }
        Format::Tiff => {
            let high_first = file[0] == b'M';
            let directory = file.len().saturating_sub(450)..file.len();
            let words = directory.step_by(2).flat_map(|at| [number(at, 4, high_first), number(at, 2, high_first)]);
            words.chain([number(4, 4, high_first)]).collect()
        }
    }
}

/// Lengths of a JPEG's segments, and the words of their first bytes.
fn segments(file: &[u8]) -> Vec<(usize, usize)> {
    let (mut found, mut at) = (Vec::new(), 2);
    while let Some(&[0xff, marker, high, low]) = file.get(at..).and_then(|rest| rest.first_chunk()) {
        found.push((at + 2, 2));
        let head = if (0xc0..=0xc2).contains(&marker) { 1 } else { 0 };
        found.extend([(at + 4, 1), (at + 4 + head, 2), (at + 6 + head, 2)]);
        found.extend((8..17).map(|byte| (at + byte, 1)));
        at += 2 + usize::from(u16::from_be_bytes([high, low]));
        if marker == 0xda {
            // A progressive one has more scans.
            let next = file[at..].windows(2).position(|pair| pair[0] == 0xff && ![0, 0xd9].contains(&pair[1]));
            at += next.unwrap_or(file.len());
        }
    }
    found
}

/// Where an OpenEXR's attributes have the sizes of what matters most, and the values behind them.
fn exr_sizes(file: &[u8]) -> Vec<usize> {
    let names: [&[u8]; 5] =
        [b"dataWindow\0box2i\0", b"channels\0chlist\0", b"tiles\0tiledesc\0", b"chunkCount\0int\0", b"compression\0"];
    let place = |name: &[u8]| file.windows(name.len()).position(|window| window == name).map(|at| at + name.len());
    names.into_iter().filter_map(place).flat_map(|at| [at, at + 4, at + 8, at + 12, at + 16]).collect()
}

#[cfg(test)]
mod tests {
    use super::super::seeds::seeds;
    use super::*;

    #[test]
    fn spoiled_files_are_the_same_each_time_and_seldom_whole() {
        let targets: Vec<Target> = seeds().into_iter().map(Target::new).collect();
        let of = |seed| targets.iter().map(|target| target.spoiled(&mut Random(seed))).collect::<Vec<_>>();
        assert_eq!(of(1), of(1));
        let whole = of(1).iter().zip(&targets).filter(|(spoiled, target)| **spoiled == target.seed.bytes).count();
        assert!(whole * 5 < targets.len(), "{whole} of {} are as they were", targets.len());
    }

    #[test]
    fn a_spoiled_stream_is_sound_again() {
        let inside: Vec<u8> = (0..=255).collect();
        let mut stream = deflated(&inside);
        let middle = stream.len() / 2;
        stream[middle] ^= 1;
        assert_eq!(inflated(&stream), None);
        mend_stream(&mut stream);
        assert!(inflated(&stream).is_some_and(|other| other != inside));
        let found = streams(&[b"before".to_vec(), stream.clone(), b"behind".to_vec()].concat());
        assert!(found.len() == 1 && found[0] == (6..6 + stream.len()), "{found:?}");
    }
}
