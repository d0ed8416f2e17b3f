//! PNG of every sort of colour, depth and order of rows, and with every chunk.

use super::{EXIF, profile};
use crate::Random;
use crate::harness::hostile::repair::{crc, deflated};

/// A PNG's first bytes.
pub const SIGNATURE: [u8; 8] = [0x89, b'P', b'N', b'G', 0x0d, 0x0a, 0x1a, 0x0a];

/// What the header of a PNG says.
#[derive(Clone, Copy)]
pub struct Head {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Bits of a sample.
    pub depth: u8,
    /// 0 grey, 2 RGB, 3 palette, 4 grey with alpha, 6 RGB with alpha.
    pub color: u8,
    /// Whether rows come in seven passes.
    pub is_interlaced: bool,
}

impl Head {
    /// The content of the chunk.
    pub fn bytes(self) -> Vec<u8> {
        let [width, height] = self.size.map(|side| (side as u32).to_be_bytes());
        [&width[..], &height, &[self.depth, self.color, 0, 0, u8::from(self.is_interlaced)]].concat()
    }

    /// Rows of random bytes; any filter of any bytes gives a picture.
    fn rows(self) -> Vec<u8> {
        /// First column and row of each pass, and the steps between.
        const PASSES: [[usize; 4]; 7] =
            [[0, 0, 8, 8], [4, 0, 8, 8], [0, 4, 4, 8], [2, 0, 4, 4], [0, 2, 2, 4], [1, 0, 2, 2], [0, 1, 1, 2]];
        let passes = if self.is_interlaced { &PASSES[..] } else { &[[0, 0, 1, 1]] };
        let count = [1, 0, 3, 1, 2, 0, 4][usize::from(self.color)];
        let mut random = Random(u64::from(self.depth));
        // Small numbers: as differences they give slopes, as places in a palette they lie in it.
        let most = if self.color == 3 && self.depth == 8 { 3 } else { 9 };
        let mut rows = Vec::new();
        for &[left, top, right, down] in passes {
            let width = self.size[0].saturating_sub(left).div_ceil(right);
            let height = if width == 0 { 0 } else { self.size[1].saturating_sub(top).div_ceil(down) };
            for y in 0..height {
                rows.push(if self.color == 3 { 0 } else { (y % 5) as u8 });
                rows.extend(
                    (0..(width * count * usize::from(self.depth)).div_ceil(8)).map(|_| random.below(most) as u8),
                );
            }
        }
        rows
    }
}

/// All variations.
pub fn all() -> Vec<(String, Vec<u8>)> {
    let sorts = [
        (0, &[1, 2, 4, 8, 16][..], "grey"),
        (2, &[8, 16], "RGB"),
        (3, &[1, 2, 4, 8], "palette"),
        (4, &[8, 16], "grey with alpha"),
        (6, &[8, 16], "RGB with alpha"),
    ];
    let mut files = Vec::new();
    for (color, depths, name) in sorts {
        for (&depth, is_interlaced) in depths.iter().flat_map(|depth| [(depth, false), (depth, true)]) {
            let head = Head { size: [23, 17], depth, color, is_interlaced };
            let order = if is_interlaced { ", interlaced" } else { "" };
            files.push((format!("{name}, {depth} bits{order}"), file(head, &[])));
            let transparent: &[u8] = match color {
                0 => &[0, 1],
                2 => &[0, 1, 0, 2, 0, 3],
                3 => &[0, 128],
                _ => continue,
            };
            files.push((format!("{name}, {depth} bits, tRNS{order}"), file(head, &[(b"tRNS", transparent.to_vec())])));
        }
    }
    let head = Head { size: [23, 17], depth: 8, color: 2, is_interlaced: false };
    files.push(("all chunks".to_owned(), file(head, &extras())));
    let named = [b"icc\0\0", &*deflated(&profile())].concat();
    files.push(("a profile".to_owned(), file(head, &[(b"iCCP", named)])));
    let curve = [(b"cHRM", numbers(&PRIMARIES)), (b"gAMA", numbers(&[45455])), (b"eXIf", EXIF.to_vec())];
    files.push(("gamma, primaries, orientation".to_owned(), file(head, &curve)));
    files
}

/// The file of a header and more chunks, which stand before the pixels; a palette among them where there must be one.
pub fn file(head: Head, extras: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
    let palette = vec![(b"PLTE", (0..3u8 << head.depth.min(4)).map(|i| 5 * i).collect::<Vec<u8>>())];
    let palette = if head.color == 3 { palette } else { Vec::new() };
    let mut bytes = SIGNATURE.to_vec();
    push_chunk(&mut bytes, b"IHDR", &head.bytes());
    palette.iter().chain(extras).for_each(|(name, content)| push_chunk(&mut bytes, name, content));
    let packed = deflated(&head.rows());
    let (first, second) = packed.split_at(packed.len() / 2);
    push_chunk(&mut bytes, b"IDAT", first);
    push_chunk(&mut bytes, b"IDAT", second);
    push_chunk(&mut bytes, b"IEND", &[]);
    bytes
}

/// Appends a chunk.
pub fn push_chunk(file: &mut Vec<u8>, name: &[u8; 4], content: &[u8]) {
    file.extend((content.len() as u32).to_be_bytes());
    let start = file.len();
    file.extend(name);
    file.extend(content);
    let sum = crc(&file[start..]);
    file.extend(sum.to_be_bytes());
}

/// White, red, green and blue, in units of 1e-5.
const PRIMARIES: [u32; 8] = [31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000];

fn numbers(numbers: &[u32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_be_bytes()).collect()
}

/// Every ancillary chunk that may stand before the pixels of an RGB file.
fn extras() -> Vec<(&'static [u8; 4], Vec<u8>)> {
    let text = |head: &[u8], packed: Vec<u8>| [head, &packed].concat();
    // The least profile: its size and mark, and no tags.
    let mut profile = vec![0; 132];
    profile[3] = 132;
    profile[36..40].copy_from_slice(b"acsp");
    let mut splt = b"few\0\x08".to_vec();
    splt.extend([1, 2, 3, 255, 0, 1]);
    vec![
        (b"cHRM", numbers(&PRIMARIES)),
        (b"gAMA", numbers(&[45455])),
        (b"iCCP", text(b"icc\0\0", deflated(&profile))),
        (b"sBIT", vec![8, 8, 8]),
        (b"cICP", vec![1, 13, 0, 1]),
        (b"mDCV", vec![1; 24]),
        (b"cLLI", numbers(&[100_000, 50_000])),
        (b"eXIf", b"MM\0\x2a\0\0\0\x08\0\0\0\0\0\0".to_vec()),
        (b"PLTE", vec![7; 12]),
        (b"bKGD", vec![0, 1, 0, 2, 0, 3]),
        (b"hIST", vec![0; 8]),
        (b"pHYs", numbers(&[1, 1, 0])[..9].to_vec()),
        (b"sPLT", splt),
        (b"tIME", vec![7, 232, 1, 2, 3, 4, 5]),
        (b"tEXt", b"Title\0a slope".to_vec()),
        (b"zTXt", text(b"Comment\0\0", deflated(&[b'z'; 300]))),
        (b"iTXt", text(b"Author\0\x01\0de\0Autor\0", deflated("ähnlich".as_bytes()))),
        (b"acTL", numbers(&[1, 0])),
        (b"fcTL", [numbers(&[0, 23, 17, 0, 0]), vec![0, 1, 0, 10, 0, 0]].concat()),
    ]
}
