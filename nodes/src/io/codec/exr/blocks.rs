//! Blocks of pixels as the exr crate sees them.

use exr::compression::Compression;
use exr::math::{RoundingMode, Vec2};
use exr::meta::BlockDescription;
use exr::meta::attribute::{
    ChannelDescription, IntegerBounds, LevelMode, LineOrder, SampleType as ExrType, Text, TileDescription,
};
use warploom_core::value::SampleType;

use super::header::Part;

/// How a part is cut into blocks, level 0 of it.
pub struct Blocks {
    header: exr::meta::header::Header,
    /// Columns and rows of the largest block.
    pub size: [usize; 2],
    /// Columns and rows of blocks.
    pub count: [usize; 2],
    /// Columns and rows of the part.
    pub picture: [usize; 2],
}

impl Blocks {
    /// Blocks of `part`, whose data window is not empty.
    pub fn of(part: &Part) -> Self {
        let picture = [part.data.width(), part.data.height()];
        let size = match part.tile {
            Some(tile) => [tile[0].min(picture[0]), tile[1].min(picture[1])],
            None => [picture[0], part.compression.scan_lines_per_block()],
        };
        let channels = part.channels.iter().map(|channel| ChannelDescription {
            name: Text::from_slice_unchecked(channel.name.as_bytes()),
            sample_type: exr_type(channel.sample_type),
            quantize_linearly: channel.is_linear,
            sampling: Vec2(1, 1),
        });
        let description = match part.tile {
            Some(_) => BlockDescription::Tiles(TileDescription {
                tile_size: Vec2(size[0], size[1]),
                level_mode: LevelMode::Singular,
                rounding_mode: RoundingMode::Down,
            }),
            None => BlockDescription::ScanLines,
        };
        let header = exr::meta::header::Header::new(Text::default(), Vec2(picture[0], picture[1]), channels.collect())
            .with_encoding(part.compression, description, LineOrder::Increasing);
        let count = [picture[0].div_ceil(size[0]), picture[1].div_ceil(size[1])];
        Self { header, size, count, picture }
    }

    /// Bytes of the largest block when unpacked.
    pub fn max_bytes(&self) -> usize {
        self.size[0] * self.size[1].min(self.picture[1]) * self.header.channels.bytes_per_pixel
    }

    /// Left, top, columns and rows of the block in that column and row.
    pub fn rectangle(&self, column: usize, row: usize) -> [usize; 4] {
        let (x, y) = (column * self.size[0], row * self.size[1]);
        [x, y, self.size[0].min(self.picture[0] - x), self.size[1].min(self.picture[1] - y)]
    }

    /// The samples of a block: for each row, for each channel, those of the row, native-endian.
    pub fn unpack(&self, packed: &[u8], rectangle: [usize; 4]) -> Result<Vec<u8>, exr::error::Error> {
        let compression: Compression = self.header.compression;
        if matches!(compression, Compression::DWAA(_) | Compression::DWAB(_)) && !self.holds_dwa(packed, rectangle) {
            return Err(exr::error::Error::Invalid("a DWA block claims more than it can hold".into()));
        }
        compression.decompress_image_section_from_le(&self.header, packed.to_vec(), bounds(rectangle), false)
    }

    /// Whether the counts in a DWA block's head are such as its pixels can give: the decoder allocates what they say.
    /// They are eleven u64: version, sizes of the raw section (unpacked, packed), packed sizes of AC, DC and RLE
    /// sections, RLE unpacked to tokens and to samples, counts of AC and DC values, and how AC is packed.
    fn holds_dwa(&self, packed: &[u8], [_, _, width, height]: [usize; 4]) -> bool {
        let channels = &self.header.channels;
        let bytes = (width * height * channels.bytes_per_pixel) as u64;
        if packed.len() as u64 == bytes {
            return true; // Stored as it is, without a head.
        }
        // One DC and at most 63 AC values, or as many marks for runs of zeros, per tile of 8 x 8.
        let tiles = (width.div_ceil(8) * height.div_ceil(8) * channels.list.len()) as u64;
        let limits = [(1, bytes), (6, 2 * bytes + 64), (7, bytes), (8, 64 * tiles), (9, tiles)];
        limits.iter().all(|&(counter, limit)| {
            let count = packed.get(8 * counter..).and_then(|rest| rest.first_chunk::<8>());
            // A head that ends early is the decoder's to refuse.
            count.is_none_or(|count| u64::from_le_bytes(*count) <= limit)
        })
    }

    /// The bytes that hold the samples of a block in a file.
    pub fn pack(&self, samples: Vec<u8>, rectangle: [usize; 4]) -> Result<Vec<u8>, exr::error::Error> {
        self.header.compression.compress_image_section_to_le(&self.header, samples, bounds(rectangle))
    }
}

fn bounds([x, y, width, height]: [usize; 4]) -> IntegerBounds {
    IntegerBounds { position: Vec2(x as i32, y as i32), size: Vec2(width, height) }
}

fn exr_type(sample_type: SampleType) -> ExrType {
    match sample_type {
        SampleType::Half => ExrType::F16,
        SampleType::Uint => ExrType::U32,
        _ => ExrType::F32,
    }
}
