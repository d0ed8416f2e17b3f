//! Wavefront OBJ: vertices `v`, `vt`, `vn` and faces `f`; everything else is passed over.

use warploom_core::node::NodeError;

use super::{Corner, Counts, MAX_CORNERS, NONE, PORTION, Soup, beyond, damaged, shown};
use crate::io::codec::Host;

pub fn read(bytes: &[u8], host: &dyn Host) -> Result<Soup, NodeError> {
    let mut counts = Counts::default();
    each_line(bytes, host, [0.0, 0.3], &mut |line| {
        match line.keyword {
            b"v" => counts.positions += 1,
            b"vt" => counts.uvs += 1,
            b"vn" => counts.normals += 1,
            b"f" => counts.triangles += line.words().count().saturating_sub(2),
            _ => {}
        }
        Ok(())
    })?;
    if counts.triangles == 0 {
        return Err(damaged("OBJ", format!("there are no faces, and {} vertices", counts.positions)));
    }
    let mut soup = Soup::with_room_for(&counts, host)?;
    each_line(bytes, host, [0.3, 1.0], &mut |line| {
        match line.keyword {
            b"v" => soup.positions.push(line.numbers(3)?),
            b"vt" => {
                // The second is 0 if it is not given.
                let count = line.words().count().clamp(1, 2);
                soup.uvs.push(line.numbers(count)?);
            }
            b"vn" => soup.normals.push(line.numbers(3)?),
            b"f" => faces(&line, &mut soup, &counts)?,
            _ => {}
        }
        Ok(())
    })?;
    Ok(soup)
}

fn each_line<'a>(
    bytes: &'a [u8],
    host: &dyn Host,
    [from, to]: [f64; 2],
    each: &mut dyn FnMut(Line<'a>) -> Result<(), NodeError>,
) -> Result<(), NodeError> {
    let mut done = 0;
    for (number, line) in (1..).zip(bytes.split(|byte| *byte == b'\n')) {
        if number % PORTION == 0 {
            host.progress(from + (to - from) * done as f64 / bytes.len() as f64)?;
        }
        done += line.len() + 1;
        let line = line.trim_ascii();
        let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
        each(Line { number, keyword: &line[..end], rest: &line[end..] })?;
    }
    Ok(())
}

struct Line<'a> {
    number: usize,
    keyword: &'a [u8],
    rest: &'a [u8],
}

impl<'a> Line<'a> {
    /// What follows the keyword, up to a comment.
    fn words(&self) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        let rest = self.rest.split(|byte| *byte == b'#').next().unwrap_or_default();
        rest.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
    }

    fn damaged(&self, problem: impl std::fmt::Display) -> NodeError {
        damaged(format!("line {}", self.number), problem)
    }

    /// The first `count` words as numbers, zeros after them.
    fn numbers<const N: usize>(&self, count: usize) -> Result<[f64; N], NodeError> {
        let mut numbers = [0.0; N];
        let mut words = self.words();
        for number in &mut numbers[..count] {
            let word = words.next().ok_or_else(|| self.damaged(format!("a vertex takes {count} numbers")))?;
            let parsed = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
            *number = parsed
                .filter(|number: &f64| number.is_finite())
                .ok_or_else(|| self.damaged(format!("`{}` is not a finite number", shown(word))))?;
        }
        Ok(numbers)
    }
}

fn faces(line: &Line, soup: &mut Soup, counts: &Counts) -> Result<(), NodeError> {
    let mut corners = [[0; 3]; MAX_CORNERS];
    let mut count = 0;
    for word in line.words() {
        let corner = corners.get_mut(count);
        *corner.ok_or_else(|| line.damaged(format!("a face has more than {MAX_CORNERS} corners")))? =
            corner_of(line, word, soup, counts)?;
        count += 1;
    }
    if count < 3 {
        return Err(line.damaged(format!("a face has {count} corners, not 3 or more")));
    }
    if let Some(later) = corners[..count].iter().find(|corner| corner[0] as usize >= soup.positions.len()) {
        return Err(line.damaged(format!("vertex {} comes only later in the file", later[0] + 1)));
    }
    soup.face(&corners[..count]);
    Ok(())
}

/// `position/texture/normal`, each counted from 1, or backwards from the last one so far as -1.
fn corner_of(line: &Line, word: &[u8], soup: &Soup, counts: &Counts) -> Result<Corner, NodeError> {
    let mut parts = word.split(|byte| *byte == b'/');
    let mut index = |name: &str, so_far: usize, count: usize| -> Result<Option<u32>, NodeError> {
        let Some(part) = parts.next().filter(|part| !part.is_empty()) else { return Ok(None) };
        let number = std::str::from_utf8(part).ok().and_then(|part| part.parse::<i64>().ok());
        let number = number.ok_or_else(|| line.damaged(format!("`{}` is not a corner", shown(word))))?;
        let place = if number < 0 { so_far as i64 + number } else { number - 1 };
        if place < 0 || place >= count as i64 {
            return Err(beyond(|problem| line.damaged(problem), name, number, count, 1));
        }
        Ok(Some(place as u32))
    };
    let position = index("vertex", soup.positions.len(), counts.positions)?;
    let uv = index("texture coordinate", soup.uvs.len(), counts.uvs)?;
    let normal = index("normal", soup.normals.len(), counts.normals)?;
    let position = position.ok_or_else(|| line.damaged(format!("`{}` is not a corner", shown(word))))?;
    let uv = uv.ok_or_else(|| {
        let error = line.damaged(format!("corner `{}` has no texture coordinates", shown(word)));
        error.hint("unwrap the mesh and export it with texture coordinates")
    })?;
    Ok([position, uv, normal.unwrap_or(NONE)])
}
