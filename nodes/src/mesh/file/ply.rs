//! Stanford PLY: ASCII, and binary in either byte order.
//!
//! Vertices have `x`, `y`, `z`; texture coordinates `u`, `v` or `s`, `t` or `texture_u`, `texture_v`; normals `nx`, `ny`, `nz`.
//! Faces have a list `vertex_indices` or `vertex_index`, and may have one `texcoord` of pairs, which then counts.

use warploom_core::node::NodeError;

use super::{Counts, MAX_CORNERS, NONE, PORTION, Soup, beyond, damaged, shown};
use crate::io::codec::Host;

/// Longest header.
const MAX_HEADER: usize = 1 << 16;

#[derive(Clone, Copy, PartialEq)]
enum Format {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Copy)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

struct Property {
    name: String,
    /// Type of a list's length.
    list: Option<Scalar>,
    scalar: Scalar,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

struct Header {
    format: Format,
    elements: Vec<Element>,
    /// Bytes of the header.
    length: usize,
}

pub fn read(bytes: &[u8], host: &dyn Host) -> Result<Soup, NodeError> {
    let header = header(bytes)?;
    let layout = Layout::of(&header)?;
    let mut counts = layout.counts(&header);
    let vertex_count = counts.positions;
    each_row(&header, &layout, bytes, host, [0.0, 0.5], &mut |row| {
        if row.element == layout.face {
            counts.triangles += row.lists[layout.indices].len().saturating_sub(2);
            counts.uvs += layout.corner_uvs.map_or(0, |property| row.lists[property].len() / 2);
        }
        Ok(())
    })?;
    let mut soup = Soup::with_room_for(&counts, host)?;
    soup.positions.resize(vertex_count, [0.0; 3]);
    each_row(&header, &layout, bytes, host, [0.5, 1.0], &mut |row| {
        if row.element == layout.vertex {
            soup.positions[row.number as usize] = row.numbers(layout.position)?;
            if let (Some(uv), None) = (layout.uv, layout.corner_uvs) {
                soup.uvs.push(row.numbers(uv)?);
            }
            if let Some(normal) = layout.normal {
                soup.normals.push(row.numbers(normal)?);
            }
        }
        Ok(())
    })?;
    each_row(&header, &layout, bytes, host, [1.0, 1.0], &mut |row| match row.element == layout.face {
        true => face(row, &layout, &mut soup),
        false => Ok(()),
    })?;
    Ok(soup)
}

fn face(row: &Row, layout: &Layout, soup: &mut Soup) -> Result<(), NodeError> {
    let indices = &row.lists[layout.indices];
    let mut corners = [[0; 3]; MAX_CORNERS];
    if !(3..=MAX_CORNERS).contains(&indices.len()) {
        return Err(row.damaged(format!("{} corners, not 3 to {MAX_CORNERS}", indices.len())));
    }
    let pairs = layout.corner_uvs.map(|property| &row.lists[property]);
    if let Some(pairs) = pairs.filter(|pairs| pairs.len() != 2 * indices.len()) {
        return Err(row.damaged(format!("{} texture coordinates for {} corners", pairs.len(), indices.len())));
    }
    for (at, (corner, index)) in corners.iter_mut().zip(indices).enumerate() {
        if !(*index >= 0.0 && *index < soup.positions.len() as f64 && index.fract() == 0.0) {
            return Err(beyond(|problem| row.damaged(problem), "vertex", index, soup.positions.len(), 0));
        }
        let vertex = *index as u32;
        let uv = match pairs {
            None => vertex,
            Some(pairs) => {
                soup.uvs.push(row.finite([pairs[2 * at], pairs[2 * at + 1]])?);
                (soup.uvs.len() - 1) as u32
            }
        };
        *corner = [vertex, uv, if layout.normal.is_some() { vertex } else { NONE }];
    }
    soup.face(&corners[..indices.len()]);
    Ok(())
}

/// Where in the file things stand: numbers of elements and of their properties.
struct Layout {
    vertex: usize,
    position: [usize; 3],
    uv: Option<[usize; 2]>,
    normal: Option<[usize; 3]>,
    face: usize,
    indices: usize,
    corner_uvs: Option<usize>,
}

impl Layout {
    fn of(header: &Header) -> Result<Self, NodeError> {
        let element = |name: &str| {
            let found = header.elements.iter().position(|element| element.name == name && element.count > 0);
            found.ok_or_else(|| damaged("PLY header", format!("there is no element `{name}`")))
        };
        let (vertex, face) = (element("vertex")?, element("face")?);
        let find = |element: usize, name: &str, is_list: bool| {
            let mut properties = header.elements[element].properties.iter();
            properties.position(|property| property.name == name && property.list.is_some() == is_list)
        };
        let number = |name: &str| find(vertex, name, false);
        let missing = |what: &str| damaged("PLY header", format!("{what} missing"));
        let pair = |[u, v]: [&str; 2]| Some([number(u)?, number(v)?]);
        let triple = |[x, y, z]: [&str; 3]| Some([number(x)?, number(y)?, number(z)?]);
        let uv = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"]].into_iter().find_map(pair);
        let corner_uvs = find(face, "texcoord", true);
        if uv.is_none() && corner_uvs.is_none() {
            let error = missing("texture coordinates (`u`, `v` or `s`, `t` of vertices or `texcoord` of faces) are");
            return Err(error.hint("unwrap the mesh and export it with texture coordinates"));
        }
        let indices = find(face, "vertex_indices", true).or_else(|| find(face, "vertex_index", true));
        Ok(Self {
            vertex,
            position: triple(["x", "y", "z"]).ok_or_else(|| missing("`x`, `y` or `z` of vertices is"))?,
            uv,
            normal: triple(["nx", "ny", "nz"]),
            face,
            indices: indices.ok_or_else(|| missing("the list `vertex_indices` of faces is"))?,
            corner_uvs,
        })
    }

    /// Without triangles and their texture coordinates. Only to be believed once the file was walked through.
    fn counts(&self, header: &Header) -> Counts {
        let positions = header.elements[self.vertex].count as usize;
        let uvs = if self.corner_uvs.is_none() { positions } else { 0 };
        let normals = if self.normal.is_some() { positions } else { 0 };
        Counts { positions, uvs, normals, triangles: 0 }
    }

    fn wants(&self, element: usize, property: usize) -> bool {
        element == self.face && (property == self.indices || Some(property) == self.corner_uvs)
    }
}

fn header(bytes: &[u8]) -> Result<Header, NodeError> {
    let mut header = Header { format: Format::Ascii, elements: Vec::new(), length: 0 };
    let mut format = None;
    let lines = bytes[..bytes.len().min(MAX_HEADER)].split_inclusive(|byte| *byte == b'\n');
    for (number, line) in (1..).zip(lines) {
        header.length += line.len();
        let text = String::from_utf8_lossy(line);
        let words: Vec<&str> = text.split_whitespace().collect();
        let unknown = || damaged(format!("line {number}"), format!("`{}` is not of a PLY", shown(line.trim_ascii())));
        match words[..] {
            ["ply"] | ["comment" | "obj_info", ..] | [] => {}
            ["format", name, "1.0"] => {
                format = Some(match name {
                    "ascii" => Format::Ascii,
                    "binary_little_endian" => Format::LittleEndian,
                    "binary_big_endian" => Format::BigEndian,
                    _ => return Err(unknown()),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| unknown())?;
                header.elements.push(Element { name: name.into(), count, properties: Vec::new() });
            }
            ["property", ref rest @ .., name] => {
                let (list, scalar) = match rest {
                    ["list", length, item] => (Some(scalar(length).ok_or_else(unknown)?), item),
                    [item] => (None, item),
                    _ => return Err(unknown()),
                };
                let scalar = self::scalar(scalar).ok_or_else(unknown)?;
                let element = header.elements.last_mut().ok_or_else(unknown)?;
                element.properties.push(Property { name: name.into(), list, scalar });
            }
            ["end_header"] => {
                header.format = format.ok_or_else(|| damaged("PLY header", "there is no format"))?;
                return Ok(header);
            }
            _ => return Err(unknown()),
        }
    }
    Err(damaged("PLY header", format!("there is no `end_header` in the first {MAX_HEADER} bytes")))
}

fn scalar(name: &str) -> Option<Scalar> {
    Some(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}

impl Scalar {
    fn bytes(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }
}

/// One entry of an element.
struct Row<'a> {
    header: &'a Header,
    element: usize,
    number: u64,
    /// Per property, 0 for a list.
    values: Vec<f64>,
    /// Per property, empty unless it is a list that is wanted.
    lists: Vec<Vec<f64>>,
}

impl Row<'_> {
    fn damaged(&self, problem: impl std::fmt::Display) -> NodeError {
        damaged(format!("{} {}", self.header.elements[self.element].name, self.number), problem)
    }

    fn finite<const N: usize>(&self, numbers: [f64; N]) -> Result<[f64; N], NodeError> {
        match numbers.iter().find(|number| !number.is_finite()) {
            Some(number) => Err(self.damaged(format!("{number} is not a finite number"))),
            None => Ok(numbers),
        }
    }

    fn numbers<const N: usize>(&self, properties: [usize; N]) -> Result<[f64; N], NodeError> {
        self.finite(properties.map(|property| self.values[property]))
    }
}

/// Calls `each` with every row of every element.
fn each_row(
    header: &Header,
    layout: &Layout,
    bytes: &[u8],
    host: &dyn Host,
    [from, to]: [f64; 2],
    each: &mut dyn FnMut(&Row) -> Result<(), NodeError>,
) -> Result<(), NodeError> {
    let mut body = Body { left: &bytes[header.length..], format: header.format };
    for (element, Element { name, count, properties }) in header.elements.iter().enumerate() {
        // Each property takes a byte at least, so that no count is believed that the file has no room for.
        let least = properties.iter().map(|property| body.least(property)).sum::<usize>().max(1);
        if count.saturating_mul(least as u64) > body.left.len() as u64 {
            let problem = format!("{count} entries are announced, but {} bytes are left", body.left.len());
            return Err(damaged(format!("element {name}"), problem));
        }
        let (values, lists) = (vec![0.0; properties.len()], vec![Vec::new(); properties.len()]);
        let mut row = Row { header, element, number: 0, values, lists };
        for number in 0..*count {
            if number % PORTION as u64 == 0 {
                host.progress(to - (to - from) * body.left.len() as f64 / bytes.len() as f64)?;
            }
            row.number = number;
            for (at, property) in properties.iter().enumerate() {
                let wanted = layout.wants(element, at);
                let read = body.property(property, wanted, &mut row.values[at], &mut row.lists[at]);
                read.map_err(|problem| row.damaged(format!("{}: {problem}", property.name)))?;
            }
            each(&row)?;
        }
    }
    Ok(())
}

/// What is left of a file.
struct Body<'a> {
    left: &'a [u8],
    format: Format,
}

impl<'a> Body<'a> {
    /// Fewest bytes of a property.
    fn least(&self, property: &Property) -> usize {
        if self.format == Format::Ascii { 1 } else { property.list.unwrap_or(property.scalar).bytes() }
    }

    fn property(
        &mut self,
        property: &Property,
        wanted: bool,
        value: &mut f64,
        list: &mut Vec<f64>,
    ) -> Result<(), String> {
        let Some(length) = property.list else {
            *value = self.number(property.scalar)?;
            return Ok(());
        };
        let length = self.number(length)?;
        if !(length >= 0.0 && length.fract() == 0.0) {
            return Err(format!("a list of {length} items"));
        }
        if wanted && length > 2.0 * MAX_CORNERS as f64 {
            return Err(format!("a list of {length} items, more than {}", 2 * MAX_CORNERS));
        }
        list.clear();
        for _ in 0..length as u64 {
            let item = self.number(property.scalar)?;
            if wanted {
                list.push(item);
            }
        }
        Ok(())
    }

    fn number(&mut self, scalar: Scalar) -> Result<f64, String> {
        if self.format == Format::Ascii {
            let word = self.word().ok_or("the file ends here")?;
            let number = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
            return number.ok_or_else(|| format!("`{}` is not a number", shown(word)));
        }
        let (bytes, left) = self.left.split_at_checked(scalar.bytes()).ok_or("the file ends here")?;
        self.left = left;
        let mut little = [0; 8];
        little[..bytes.len()].copy_from_slice(bytes);
        if self.format == Format::BigEndian {
            little[..bytes.len()].reverse();
        }
        let [a, b, c, d, ..] = little;
        Ok(match scalar {
            Scalar::I8 => f64::from(a as i8),
            Scalar::U8 => f64::from(a),
            Scalar::I16 => f64::from(i16::from_le_bytes([a, b])),
            Scalar::U16 => f64::from(u16::from_le_bytes([a, b])),
            Scalar::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Scalar::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Scalar::F64 => f64::from_le_bytes(little),
        })
    }

    fn word(&mut self) -> Option<&'a [u8]> {
        let left = self.left.trim_ascii_start();
        let end = left.iter().position(u8::is_ascii_whitespace).unwrap_or(left.len());
        let (word, left) = left.split_at(end);
        self.left = left;
        (!word.is_empty()).then_some(word)
    }
}
