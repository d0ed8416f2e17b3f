//! Small files that claim, or unpack to, far more than they hold.

use std::io::Write;

use flate2::write::ZlibEncoder;
use warploom_core::value::{Buffer, Channel, Image, Plane, Rect, SampleType};
use warploom_nodes::io::codec::{Compression, WriteOptions, encode_image};

use super::repair::{chunks, mend_chunks};
use super::seeds::png::{Head, SIGNATURE, file as png, push_chunk};
use super::seeds::seeds;
use super::seeds::tiff::{Layout, file as tiff};

/// A file, and the exit codes of a run that may come of it.
pub struct Bomb {
    pub name: String,
    pub bytes: Vec<u8>,
    pub codes: &'static [i32],
}

/// A harmless PNG.
pub const SMALL: Head = Head { size: [16, 16], depth: 8, color: 2, is_interlaced: false };

/// Refused for what it claims.
const CLAIM: &[i32] = &[7];
/// Refused for what it is.
const DAMAGE: &[i32] = &[3, 4];

/// All bombs.
pub fn bombs() -> Vec<Bomb> {
    let of = |format: &'static str, bombs: Vec<(&str, Vec<u8>, &'static [i32])>| {
        let named = bombs.into_iter().map(move |(name, bytes, codes)| (format!("{format}: {name}"), bytes, codes));
        named.map(|(name, bytes, codes)| Bomb { name, bytes, codes }).collect::<Vec<_>>()
    };
    [
        of("PNG", pngs()),
        of("PNG", broken_pngs()),
        of("JPEG", jpegs()),
        of("TIFF", tiffs()),
        of("HDR", hdrs()),
        of("EXR", exrs()),
    ]
    .into_iter()
    .flatten()
    .collect()
}

type Bombs = Vec<(&'static str, Vec<u8>, &'static [i32])>;

/// A zlib stream of so many MiB of zeros.
fn zeros(mib: usize) -> Vec<u8> {
    let mut packer = ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    let zeros = vec![0; 1 << 20];
    (0..mib).try_for_each(|_| packer.write_all(&zeros)).and_then(|()| packer.finish()).expect("a vector takes it")
}

fn png_of(head: Head, packed: &[u8]) -> Vec<u8> {
    let mut file = SIGNATURE.to_vec();
    push_chunk(&mut file, b"IHDR", &head.bytes());
    push_chunk(&mut file, b"IDAT", packed);
    push_chunk(&mut file, b"IEND", &[]);
    file
}

fn pngs() -> Bombs {
    let zeros = zeros(100);
    let large = |width, height| png_of(Head { size: [width, height], ..SMALL }, &zeros);
    let texts = |name: &'static [u8; 4], head: &[u8]| png(SMALL, &[(name, [head, &zeros].concat())]);
    vec![
        ("65536 x 65536", large(65_536, 65_536), CLAIM),
        ("6000 x 6000, whose codes fit but not its planes", large(6000, 6000), CLAIM),
        ("a side too long", large(70_000, 1), DAMAGE),
        ("2147483647 x 2147483647", large(0x7fff_ffff, 0x7fff_ffff), DAMAGE),
        ("more pixels than it has", png_of(SMALL, &zeros), &[0, 3]),
        ("a profile", texts(b"iCCP", b"icc\0\0"), &[3, 4, 7]),
        ("a text", texts(b"zTXt", b"text\0\0"), &[0, 3, 7]),
        ("an international text", texts(b"iTXt", b"text\0\x01\0\0\0"), &[0, 3, 7]),
        ("50,000 texts", png(SMALL, &vec![(b"tEXt", b"Title\0text".to_vec()); 50_000]), &[0, 3, 7]),
    ]
}

/// Each thing that a PNG can have wrong: first bytes, ends of lines, checksums, sort of colour, depth, no pixels.
fn broken_pngs() -> Bombs {
    let whole = png(SMALL, &[]);
    let with = |at: usize, bytes: &[u8]| [&whole[..at], bytes, &whole[at + bytes.len()..]].concat();
    let mended = |at: usize, byte: u8| {
        let mut file = with(at, &[byte]);
        mend_chunks(&mut file);
        file
    };
    let data = chunks(&whole)[1].clone();
    let without_data = [&whole[..data.start - 8], &whole[whole.len() - 12..]].concat();
    vec![
        ("first byte without its high bit", with(0, &[0x09]), DAMAGE),
        ("second byte is Q", with(1, b"Q"), DAMAGE),
        ("fourth byte is g", with(3, b"g"), DAMAGE),
        ("seventh byte is a space", with(6, b" "), DAMAGE),
        ("ends of lines with one more", [&whole[..4], b"\r\r\n\x1a\r\n", &whole[8..]].concat(), DAMAGE),
        ("ends of lines with one less", [&whole[..4], b"\n\x1a\n", &whole[8..]].concat(), DAMAGE),
        ("checksum of the header", with(29, &[1]), DAMAGE),
        ("checksum of the pixels", with(data.end, &[1]), DAMAGE),
        ("sort of colour 1", mended(25, 1), DAMAGE),
        ("sort of colour 9", mended(25, 9), DAMAGE),
        ("depth 0", mended(24, 0), DAMAGE),
        ("depth 3", mended(24, 3), DAMAGE),
        ("depth 99", mended(24, 99), DAMAGE),
        ("packing 1", mended(26, 1), DAMAGE),
        ("filters 1", mended(27, 1), DAMAGE),
        ("order of rows 2", mended(28, 2), DAMAGE),
        ("0 columns", mended(19, 0), DAMAGE),
        ("no pixels", without_data, DAMAGE),
    ]
}

fn jpegs() -> Bombs {
    let seeds = seeds();
    let seed = |name: &str| seeds.iter().find(|seed| seed.name == name).expect("a good file");
    let with_size = |name: &str, [width, height]: [u16; 2]| {
        let mut file = seed(name).bytes.clone();
        let head = file.windows(2).position(|pair| pair == [0xff, 0xc0] || pair == [0xff, 0xc2]).expect("a frame");
        file[head + 5..head + 7].copy_from_slice(&height.to_be_bytes());
        file[head + 7..head + 9].copy_from_slice(&width.to_be_bytes());
        file
    };
    let with_scans = |count| {
        let mut file = with_size("progressive grey", [9000; 2]);
        let scan = file.windows(2).rposition(|pair| pair == [0xff, 0xda]).expect("a scan");
        let last = file[scan..file.len() - 2].repeat(count);
        file.splice(scan..scan, last);
        file
    };
    vec![
        ("9000 x 9000, 90 scans of nothing", with_scans(80), &[0, 3]),
        ("10,000 scans", with_scans(10_000), &[0, 3]),
        ("65535 x 65535", with_size("baseline", [65_535; 2]), CLAIM),
        ("65535 x 65535, progressive", with_size("progressive grey", [65_535; 2]), CLAIM),
        ("7000 x 7000, whose codes fit but not its planes", with_size("baseline", [7000; 2]), CLAIM),
        ("the same, progressive", with_size("progressive, quartered colour", [7000; 2]), CLAIM),
    ]
}

fn tiffs() -> Bombs {
    let plain = Layout {
        size: [16, 16],
        tile: [0, 16],
        count: 3,
        bits: 8,
        compression: 8,
        predictor: 1,
        is_planar: false,
        is_big: false,
        high_first: true,
        orientation: 1,
    };
    // Sets the count (if it is not 0) and the value of entries of the directory, known by their tags.
    let patched = |entries: &[(u16, u32, u32)]| {
        let mut file = tiff(plain);
        let start = u32::from_be_bytes(*file[4..].first_chunk().expect("an offset")) as usize + 2;
        for &(tag, count, value) in entries {
            let is_entry = |at: &usize| file[*at..].starts_with(&tag.to_be_bytes());
            let at = (start..file.len()).step_by(12).find(is_entry).expect("the entry");
            if count > 0 {
                file[at + 4..at + 8].copy_from_slice(&count.to_be_bytes());
            }
            file[at + 8..at + 12].copy_from_slice(&value.to_be_bytes());
        }
        file
    };
    let square = |side| patched(&[(256, 0, side), (257, 0, side), (278, 0, side)]);
    vec![
        ("60000 x 60000", square(60_000), CLAIM),
        ("6000 x 6000, whose codes fit but not its planes", square(6000), CLAIM),
        ("4294967295 columns", patched(&[(256, 0, u32::MAX)]), DAMAGE),
        ("4294967295 strips", patched(&[(273, u32::MAX, 8)]), DAMAGE),
        ("1073741824 sizes of strips", patched(&[(279, 1 << 30, 8)]), DAMAGE),
        ("4294967295 samples of a pixel", patched(&[(277, u32::MAX, 8)]), DAMAGE),
        ("4294967295 depths", patched(&[(258, u32::MAX, 8)]), DAMAGE),
        ("strips of 4294967295 rows", patched(&[(278, 0, u32::MAX)]), &[0, 3, 4, 7]),
        ("a strip of zeros", zip_tiff(), &[0, 3]),
    ]
}

/// A small TIFF whose strip unpacks to 100 MiB.
fn zip_tiff() -> Vec<u8> {
    let mut file = b"MM\0\x2a".to_vec();
    let strip = zeros(100);
    file.extend((8 + strip.len() as u32).to_be_bytes());
    file.extend(&strip);
    let entries: [(u16, u16, u32); 8] = [
        (256, 4, 16),
        (257, 4, 16),
        (258, 3, 8 << 16),
        (259, 3, 8 << 16),
        (262, 3, 1 << 16),
        (273, 4, 8),
        (278, 4, 16),
        (279, 4, strip.len() as u32),
    ];
    file.extend((entries.len() as u16).to_be_bytes());
    for (tag, kind, value) in entries {
        file.extend(tag.to_be_bytes());
        file.extend(kind.to_be_bytes());
        file.extend(1u32.to_be_bytes());
        file.extend(value.to_be_bytes());
    }
    file.extend([0; 4]);
    file
}

fn hdrs() -> Bombs {
    let sized = |size: &str, pixels: usize| {
        let head = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n");
        [head.into_bytes(), vec![9; pixels]].concat()
    };
    vec![
        ("65536 x 65536", sized("-Y 65536 +X 65536", 1000), CLAIM),
        ("5000 x 5000, whose colours fit but not its planes", sized("-Y 5000 +X 5000", 1000), CLAIM),
        ("a side too long", sized("-Y 4294967295 +X 4294967295", 1000), DAMAGE),
        ("a side no number can be", sized("-Y 99999999999999999999 +X 1", 1000), DAMAGE),
        ("a head without end", sized(&"x".repeat(20 << 20), 0), DAMAGE),
        ("a head of 10,000,000 lines", sized(&"x\n".repeat(10_000_000), 0), DAMAGE),
        (
            "a line of 1,000,000 runs of nothing",
            [sized("-Y 4 +X 4", 4), [1, 1, 1, 0].repeat(1_000_000)].concat(),
            DAMAGE,
        ),
    ]
}

/// What a made-up EXR says of itself.
#[derive(Clone)]
struct Exr {
    size: [i32; 2],
    compression: u8,
    tile: Option<[u32; 2]>,
    channels: usize,
    more: Vec<u8>,
}

impl Exr {
    /// The attributes of a part.
    fn part(&self) -> Vec<u8> {
        let word = |numbers: &[i32]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
        let mut channels = Vec::new();
        for number in 0..self.channels {
            channels.extend(format!("c{number:05}\0").bytes());
            channels.extend(word(&[1, 0, 1, 1]));
        }
        channels.push(0);
        let window = word(&[0, 0, self.size[0] - 1, self.size[1] - 1]);
        let mut part = Vec::new();
        push_attribute(&mut part, "channels", "chlist", &channels);
        push_attribute(&mut part, "compression", "compression", &[self.compression]);
        push_attribute(&mut part, "dataWindow", "box2i", &window);
        push_attribute(&mut part, "displayWindow", "box2i", &window);
        if let Some(tile) = self.tile {
            push_attribute(&mut part, "tiles", "tiledesc", &[&word(&tile.map(|side| side as i32))[..], &[0]].concat());
        }
        part.extend(&self.more);
        part.push(0);
        part
    }

    /// A file of one part; then its table and whatever stands behind.
    fn file(&self, behind: &[u8]) -> Vec<u8> {
        let flags = if self.tile.is_some() { 1 << 9 } else { 0 };
        [&head(flags)[..], &self.part(), behind].concat()
    }
}

fn head(flags: u32) -> Vec<u8> {
    [&[0x76, 0x2f, 0x31, 0x01][..], &(2 | flags).to_le_bytes()].concat()
}

fn push_attribute(part: &mut Vec<u8>, name: &str, kind: &str, value: &[u8]) {
    part.extend(format!("{name}\0{kind}\0").bytes());
    part.extend((value.len() as i32).to_le_bytes());
    part.extend(value);
}

/// A file of many equal parts of one block each, which say that they have `chunks`.
fn parts(count: usize, part: &Exr, chunks: i32) -> Vec<u8> {
    let mut part = part.clone();
    push_attribute(&mut part.more, "type", "string", b"scanlineimage");
    push_attribute(&mut part.more, "chunkCount", "int", &chunks.to_le_bytes());
    let mut file = [head(1 << 12), part.part().repeat(count), vec![0]].concat();
    let block = vec![0; part.channels * 2 * (part.size[0] * part.size[1]) as usize];
    let first = file.len() + 8 * count;
    (0..count).for_each(|number| file.extend(((first + number * (12 + block.len())) as u64).to_le_bytes()));
    for number in 0..count {
        file.extend([number as i32, 0, block.len() as i32].iter().flat_map(|n| n.to_le_bytes()));
        file.extend(&block);
    }
    file
}

/// Very many blocks of pixels so few and so much alike that each block is little but its tables.
fn thin(compression: Compression) -> Vec<u8> {
    let size = (16, 32_768);
    let plane = Plane::F32(Buffer::from_packed(&vec![0.5; size.0 * size.1], size.0, size.1));
    let channels = vec![Channel { name: "Y".into(), sample_type: SampleType::Half, plane }];
    let image = Image::new(Rect::at(0, 0, size.0, size.1), channels);
    let options = WriteOptions { compression, ..WriteOptions::default() };
    encode_image(&image, "exr", &options, &|_: u128| Ok(())).expect("it can be written")
}

fn exrs() -> Bombs {
    let plain = Exr { size: [64, 16], compression: 3, tile: None, channels: 1, more: Vec::new() };
    let large = Exr { size: [60_000; 2], ..plain.clone() };
    let tile = |size: i32, tile: u32| Exr { size: [size; 2], tile: Some([tile; 2]), ..plain.clone() };
    let wide = |channels| Exr { size: [4096; 2], channels, ..plain.clone() };
    let mut long = plain.clone();
    push_attribute(&mut long.more, "note", "string", b"");
    let end = long.more.len();
    long.more[end - 4..].copy_from_slice(&i32::MAX.to_le_bytes());
    // One block of 16 rows, which unpacks to more than them.
    let packed = zeros(100);
    let start = plain.file(&[]).len() as u64 + 8;
    let block = [&start.to_le_bytes()[..], &[0; 4], &(packed.len() as u32).to_le_bytes(), &packed].concat();
    let narrow = Exr { size: [1, 1], channels: 1024, ..plain.clone() };
    vec![
        ("a header alone", large.file(&[]), DAMAGE),
        ("60000 x 60000", large.file(&vec![1; 8 * 3750]), CLAIM),
        ("60000 x 60000 in one tile", tile(60_000, 60_000).file(&[1; 8]), CLAIM),
        ("9000 x 9000 in one tile", tile(9000, 9000).file(&[1; 8]), CLAIM),
        ("tiles of a pixel", tile(60_000, 1).file(&[1; 8]), DAMAGE),
        ("tiles of 4294967295 px", tile(60_000, u32::MAX).file(&[1; 8]), DAMAGE),
        ("a part of 2147483647 blocks", parts(1, &plain, i32::MAX), DAMAGE),
        ("parts of -1 blocks", parts(1, &plain, -1), DAMAGE),
        ("300 parts", parts(300, &plain, 1), DAMAGE),
        ("256 parts of 1024 channels", parts(256, &narrow, 1), &[0]),
        ("an attribute of 2147483647 bytes", long.file(&[]), DAMAGE),
        ("1024 channels", wide(1024).file(&[1; 8 * 256]), CLAIM),
        ("5000 channels", wide(5000).file(&[1; 8 * 256]), DAMAGE),
        ("a block of zeros", plain.file(&block), DAMAGE),
        ("32768 rows of 16 pixels, by wavelets", thin(Compression::Piz), &[0]),
        ("32768 rows of 16 pixels, by cosines", thin(Compression::Dwaa), &[0]),
    ]
}
