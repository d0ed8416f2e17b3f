//! The few tags of Exif that change what pixels mean. A block that cannot be read says nothing.

/// Exif's directories are those of a TIFF.
struct Tiff<'a> {
    bytes: &'a [u8],
    is_big_endian: bool,
}

/// What a picture's colour is, if Exif tells.
#[derive(Debug, PartialEq)]
pub enum ColorSpace {
    Srgb,
    AdobeRgb,
    /// Some other one, not told which.
    Other(u32),
}

/// Which way up a picture is to be seen: 1..=8, 1 being as it is stored.
pub fn orientation(exif: &[u8]) -> u16 {
    let told = Tiff::new(exif).and_then(|(tiff, first)| tiff.number(first, 0x0112));
    told.filter(|orientation| (1..=8).contains(orientation)).map_or(1, |orientation| orientation as u16)
}

/// The colour space, if one is told.
pub fn color_space(exif: &[u8]) -> Option<ColorSpace> {
    let (tiff, first) = Tiff::new(exif)?;
    let photo = tiff.number(first, 0x8769)?;
    let is_adobe = || Some(tiff.entry(tiff.number(photo, 0xa005)?, 1)?.get(8..11)? == b"R03");
    Some(match tiff.number(photo, 0xa001)? {
        1 => ColorSpace::Srgb,
        2 => ColorSpace::AdobeRgb,
        0xffff if is_adobe() == Some(true) => ColorSpace::AdobeRgb,
        other => ColorSpace::Other(other),
    })
}

impl<'a> Tiff<'a> {
    /// With where its first directory lies.
    fn new(bytes: &'a [u8]) -> Option<(Self, u32)> {
        let is_big_endian = match bytes.get(..4)? {
            b"II\x2a\0" => false,
            b"MM\0\x2a" => true,
            _ => return None,
        };
        let tiff = Self { bytes, is_big_endian };
        let first = tiff.u32(bytes.get(4..)?)?;
        Some((tiff, first))
    }

    /// The 12 bytes of a tag of a directory.
    fn entry(&self, directory: u32, tag: u16) -> Option<&'a [u8]> {
        let directory = self.bytes.get(directory as usize..)?;
        let count = self.u16(directory)?;
        let mut entries = directory.get(2..)?.chunks_exact(12).take(count.into());
        entries.find(|entry| self.u16(entry) == Some(tag))
    }

    /// The first number of a tag, of 16 or 32 bits.
    fn number(&self, directory: u32, tag: u16) -> Option<u32> {
        let entry = self.entry(directory, tag)?;
        match self.u16(&entry[2..])? {
            3 => self.u16(&entry[8..]).map(u32::from),
            4 => self.u32(&entry[8..]),
            _ => None,
        }
    }

    fn u16(&self, bytes: &[u8]) -> Option<u16> {
        let bytes = *bytes.first_chunk()?;
        Some(if self.is_big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }

    fn u32(&self, bytes: &[u8]) -> Option<u32> {
        let bytes = *bytes.first_chunk()?;
        Some(if self.is_big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }
}
