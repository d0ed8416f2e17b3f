//! ICC profiles of matrix and curves, read and written (ICC.1:2022; the same tags as of version 2).
//!
//! Only the tags that colour needs are read, whatever else a profile holds and however it is damaged there.

use warploom_algo::colorimetry::{Curve, D50, Matrix, pcs_from_d65, pcs_from_rec709, rec709_from_pcs};
use warploom_core::node::NodeError;

use super::coding::{Coding, refused};

/// Bytes of the header, which the table of tags follows.
const HEADER: usize = 128;
/// Bytes of an entry of that table.
const ENTRY: usize = 12;
/// Entries of the longest table, one for each code of 16 bits.
const MAX_ENTRIES: usize = 1 << 16;
/// Letters of a name that a message shows.
const NAME: usize = 80;

/// The bytes of a profile.
struct Icc<'a>(&'a [u8]);

/// What a profile says of a grey or coloured picture.
///
/// Curves and a matrix are honoured, relative to white. Where a profile has tables of colours (A2B) as well, they are
/// left aside; where it has nothing else, it is refused.
pub fn read(bytes: &[u8], is_grey: bool) -> Result<Coding, NodeError> {
    let icc = Icc(bytes);
    icc.coding(is_grey).map_err(|why| refused(format!("the ICC profile {} cannot be honoured: {why}", icc.name())))
}

impl Icc<'_> {
    fn coding(&self, is_grey: bool) -> Result<Coding, String> {
        if self.0.get(36..40) != Some(b"acsp") {
            return Err("it is damaged".into());
        }
        let (space, pcs) = (self.text_at(16), self.text_at(20));
        let fits = space == "RGB " || space == "GRAY" && is_grey;
        if !fits {
            let picture = if is_grey { "grey" } else { "RGB" };
            return Err(format!("it is of {} colour, and the picture is {picture}", space.trim_end()));
        }
        if pcs != "XYZ " {
            let tables = if self.tag(b"A2B0").is_some() { " by tables" } else { "" };
            return Err(format!("it leads to {}{tables}; only curves and a matrix to XYZ can be", pcs.trim_end()));
        }
        if space == "GRAY" {
            let curve = self.curve(b"kTRC")?;
            return Ok(Coding::of([curve.clone(), curve.clone(), curve], None));
        }
        let curves = [self.curve(b"rTRC")?, self.curve(b"gTRC")?, self.curve(b"bTRC")?];
        if is_grey {
            // Equal amounts of the primaries are white.
            let equal = curves[0] == curves[1] && curves[1] == curves[2];
            return if equal { Ok(Coding::of(curves, None)) } else { Err("its curves would colour a grey".into()) };
        }
        let columns = [self.xyz(b"rXYZ")?, self.xyz(b"gXYZ")?, self.xyz(b"bXYZ")?];
        let colorants: Matrix = std::array::from_fn(|r| std::array::from_fn(|c| columns[c][r]));
        let matrix = rec709_from_pcs(&colorants).ok_or("its primaries span no space")?;
        Ok(Coding::of(curves, Some(matrix)))
    }

    fn tag(&self, name: &[u8; 4]) -> Option<&[u8]> {
        let count = u32_at(self.0, HEADER)? as usize;
        let entries = self.0.get(HEADER + 4..)?.chunks_exact(ENTRY).take(count);
        let entry = entries.into_iter().find(|entry| entry.starts_with(name))?;
        let (start, length) = (u32_at(entry, 4)? as usize, u32_at(entry, 8)? as usize);
        self.0.get(start..start.checked_add(length)?)
    }

    fn needed(&self, name: &[u8; 4]) -> Result<&[u8], String> {
        let tables = || self.tag(b"A2B0").or(self.tag(b"A2B1")).is_some();
        self.tag(name).ok_or_else(|| match tables() {
            true => "it has tables of colours only (A2B), and neither curves nor a matrix".into(),
            false => format!("it has no {}", shown(name)),
        })
    }

    fn xyz(&self, name: &[u8; 4]) -> Result<[f64; 3], String> {
        let tag = self.needed(name)?;
        let read = || Some([fixed_at(tag, 8)?, fixed_at(tag, 12)?, fixed_at(tag, 16)?]);
        read().filter(|_| tag.starts_with(b"XYZ ")).ok_or_else(|| format!("its {} is damaged", shown(name)))
    }

    fn curve(&self, name: &[u8; 4]) -> Result<Curve, String> {
        let tag = self.needed(name)?;
        let curve = match tag.get(..4) {
            Some(b"curv") => table(tag),
            Some(b"para") => parametric(tag),
            _ => None,
        };
        curve.ok_or_else(|| format!("its {} is damaged", shown(name)))
    }

    /// What the profile calls itself.
    fn name(&self) -> String {
        let name = self.tag(b"desc").and_then(|tag| match tag.get(..4)? {
            b"desc" => {
                let text = tag.get(12..12usize.checked_add(u32_at(tag, 8)? as usize)?)?;
                Some(String::from_utf8_lossy(text).into_owned())
            }
            b"mluc" => {
                let (length, start) = (u32_at(tag, 20)? as usize, u32_at(tag, 24)? as usize);
                let words = tag.get(start..start.checked_add(length)?)?.as_chunks().0;
                let words: Vec<u16> = words.iter().take(NAME).map(|&word| u16::from_be_bytes(word)).collect();
                Some(String::from_utf16_lossy(&words))
            }
            _ => None,
        });
        let name: String = name.unwrap_or_default().chars().filter(|c| !c.is_control()).take(NAME).collect();
        if name.is_empty() { "without a name".into() } else { format!("\"{name}\"") }
    }

    fn text_at(&self, at: usize) -> String {
        shown(self.0.get(at..at + 4).unwrap_or_default())
    }
}

fn shown(signature: &[u8]) -> String {
    String::from_utf8_lossy(signature).chars().filter(|c| !c.is_control()).collect()
}

/// No entry is a straight line, one a power, more are values.
fn table(tag: &[u8]) -> Option<Curve> {
    let count = Some(u32_at(tag, 8)? as usize).filter(|&count| count <= MAX_ENTRIES)?;
    let entries = tag.get(12..count.checked_mul(2)?.checked_add(12)?)?.as_chunks().0;
    let entries = entries.iter().map(|&entry| f64::from(u16::from_be_bytes(entry)));
    Some(match count {
        0 => Curve::Linear,
        1 => Curve::Power(entries.sum::<f64>() / 256.0),
        _ => Curve::Table(entries.map(|entry| entry / 65535.0).collect()),
    })
}

/// One of the five forms, which differ in what they leave out.
fn parametric(tag: &[u8]) -> Option<Curve> {
    let form = u16::from_be_bytes(*tag.get(8..)?.first_chunk()?);
    let parameter = |i: usize| fixed_at(tag, 12 + 4 * i);
    let gamma = parameter(0)?;
    if form == 0 {
        return Some(Curve::Power(gamma));
    }
    let (a, b) = (parameter(1)?, parameter(2)?);
    // Where the power begins, if that is not told.
    let root = || Some(-b / a).filter(|_| a != 0.0);
    let abcdef = match form {
        1 => [a, b, 0.0, root()?, 0.0, 0.0],
        2 => [a, b, 0.0, root()?, parameter(3)?, parameter(3)?],
        3 => [a, b, parameter(3)?, parameter(4)?, 0.0, 0.0],
        4 => [a, b, parameter(3)?, parameter(4)?, parameter(5)?, parameter(6)?],
        _ => return None,
    };
    Some(Curve::Parametric { gamma, abcdef })
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn fixed_at(bytes: &[u8], at: usize) -> Option<f64> {
    u32_at(bytes, at).map(|bits| f64::from(bits.cast_signed()) / 65536.0)
}

/// A profile of version 4 that says `coding`, of 500 to 700 bytes; none of `Raw` or of what was not named.
pub fn written(coding: &Coding, is_grey: bool) -> Option<Vec<u8>> {
    let (name, curve) = match coding {
        Coding::Linear => ("Linear Rec.709", para(0, &[1.0])),
        Coding::Srgb => ("sRGB", para(3, &[2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045])),
        Coding::Raw | Coding::Profile(_) => return None,
    };
    let numbers = |kind: &[u8; 4], values: &[f64]| [&kind[..], &[0; 4], &fixed(values)].concat();
    let mut tags = vec![
        (b"desc", text(name)),
        (b"cprt", text("CC0")),
        (b"wtpt", numbers(b"XYZ ", &D50)),
        (b"chad", numbers(b"sf32", pcs_from_d65().as_flattened())),
    ];
    if is_grey {
        tags.push((b"kTRC", curve));
    } else {
        let colorants = pcs_from_rec709();
        let column = |c: usize| numbers(b"XYZ ", &colorants.map(|row| row[c]));
        tags.extend([(b"rXYZ", column(0)), (b"gXYZ", column(1)), (b"bXYZ", column(2))]);
        tags.extend([(b"rTRC", curve.clone()), (b"gTRC", curve.clone()), (b"bTRC", curve)]);
    }
    Some(assembled(if is_grey { b"GRAY" } else { b"RGB " }, &tags))
}

/// Header, table and contents; every content is a multiple of 4 bytes.
fn assembled(space: &[u8; 4], tags: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
    let start = HEADER + 4 + ENTRY * tags.len();
    let size = start + tags.iter().map(|(_, content)| content.len()).sum::<usize>();
    let mut file = vec![0; HEADER];
    // Version, for displays, spaces, a day, signature, relative to white, white.
    let fields: [(usize, &[u8]); 9] = [
        (0, &(size as u32).to_be_bytes()),
        (8, &[4, 0x20]),
        (12, b"mntr"),
        (16, space),
        (20, b"XYZ "),
        (24, &[7, 208, 0, 1, 0, 1]),
        (36, b"acsp"),
        (67, &[1]),
        (68, &fixed(&D50)),
    ];
    fields.iter().for_each(|(at, field)| file[*at..at + field.len()].copy_from_slice(field));
    file.extend((tags.len() as u32).to_be_bytes());
    let mut at = start;
    for (name, content) in tags {
        file.extend_from_slice(*name);
        file.extend([at as u32, content.len() as u32].iter().flat_map(|number| number.to_be_bytes()));
        at += content.len();
    }
    tags.iter().for_each(|(_, content)| file.extend_from_slice(content));
    file
}

fn fixed(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| ((value * 65536.0).round() as i32).to_be_bytes()).collect()
}

fn para(form: u8, parameters: &[f64]) -> Vec<u8> {
    [b"para\0\0\0\0\0", &[form, 0, 0][..], &fixed(parameters)].concat()
}

/// A text in one language, filled up to whole words of 4 bytes.
fn text(text: &str) -> Vec<u8> {
    let mut words: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
    let length = (words.len() as u32).to_be_bytes();
    words.resize(words.len().next_multiple_of(4), 0);
    [b"mluc\0\0\0\0\0\0\0\x01\0\0\0\x0cenUS", &length[..], &[0, 0, 0, 28], &words].concat()
}

#[cfg(test)]
mod tests;
