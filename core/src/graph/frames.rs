//! Frame ranges and frame patterns in paths.

use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};

/// Most frames a range may name.
pub const MAX_FRAMES: usize = 1_000_000;

/// Reads a frame range: `1001-1100`, `1001-1100x2` (each second), lists with commas, negative frames as `-5--1`.
///
/// Frames come in the order written; one named twice comes once. The error says what is wrong with which part.
pub fn parse_frames(text: &str) -> Result<Vec<i64>, String> {
    let mut frames = Vec::new();
    let mut seen = std::collections::HashSet::new();
    for part in text.split(',').map(str::trim) {
        let (first, last, step) = parse_part(part).ok_or_else(|| {
            format!("`{part}` is no frame range; write 1001, 1001-1100, 1001-1100x2, or several with commas")
        })?;
        if step <= 0 {
            return Err(format!("the step in `{part}` must be at least 1"));
        }
        if last < first {
            return Err(format!("`{part}` runs backwards; write {last}-{first}"));
        }
        if (last - first) / step + 1 > (MAX_FRAMES - frames.len()) as i128 {
            return Err(format!("`{part}` makes more than {MAX_FRAMES} frames"));
        }
        let mut frame = first;
        while frame <= last {
            if seen.insert(frame as i64) {
                frames.push(frame as i64);
            }
            frame += step;
        }
    }
    Ok(frames)
}

fn parse_part(part: &str) -> Option<(i128, i128, i128)> {
    let number = |text: &str| text.trim().parse::<i64>().ok().map(i128::from);
    let (range, step) = match part.split_once('x') {
        Some((range, step)) => (range, number(step)?),
        None => (part, 1),
    };
    // The dash that separates is the first one after a digit; others are signs.
    let dash =
        range.char_indices().skip(1).find(|&(at, c)| c == '-' && range[..at].ends_with(|c: char| c.is_ascii_digit()));
    match dash {
        Some((at, _)) => Some((number(&range[..at])?, number(&range[at + 1..])?, step)),
        None if step == 1 => number(range).map(|frame| (frame, frame, 1)),
        None => None,
    }
}

/// Whether a path stands for one file per frame.
pub fn has_pattern(path: &str) -> bool {
    path.contains('#')
}

/// What other programs put for a frame number or a variable, if a path has it, and how it is written here.
pub fn foreign_pattern(path: &str) -> Option<(&str, String)> {
    path.match_indices(['%', '$', '~']).find_map(|(at, sign)| {
        let rest = &path[at..];
        let word = |from: usize| &rest[from..][..rest[from..].find(|c: char| !is_word(c)).unwrap_or(rest.len() - from)];
        let frame = |len: usize, width: &str| Some((&rest[..len], "#".repeat(width.parse().unwrap_or(1).clamp(1, 9))));
        let is_width = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
        match sign {
            "%" => {
                let is_last = |behind: &str| !behind.starts_with(|c: char| c.is_ascii_alphanumeric());
                let (width, _) =
                    word(1).split_once('d').filter(|(width, behind)| is_width(width) && is_last(behind))?;
                frame(width.len() + 2, width)
            }
            "$" if rest.starts_with("${") => {
                let name = Some(word(2)).filter(|name| !name.is_empty() && rest[2 + name.len()..].starts_with('}'))?;
                Some((&rest[..name.len() + 3], format!("$(env:{name})")))
            }
            "$" if rest.starts_with("$(") => {
                let (inside, is_closed) =
                    rest[2..].split_once(')').map_or((&rest[2..], false), |(inside, _)| (inside, true));
                let name = inside.rsplit([':', '/']).next().unwrap_or_default();
                let is_right = is_closed && inside.strip_prefix("env:").is_some_and(|name| !name.is_empty());
                let part = &rest[..2 + inside.len() + usize::from(is_closed)];
                (!is_right).then(|| (part, format!("$(env:{})", if name.is_empty() { "NAME" } else { name })))
            }
            "$" => match word(1).strip_prefix('F') {
                Some(width) if is_width(width) => frame(width.len() + 2, width),
                _ if word(1).starts_with(|c: char| c.is_ascii_alphabetic()) => {
                    Some((&rest[..word(1).len() + 1], format!("$(env:{})", word(1))))
                }
                _ => None,
            },
            _ => (at == 0 && rest.starts_with("~/")).then(|| ("~", "$(env:HOME)".to_owned())),
        }
    })
}

fn is_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// A path in two: the graph's folder where it begins with that, whose signs mean themselves, and the rest.
pub fn split_folder<'a>(path: &'a str, folder: &Path) -> (&'a str, &'a str) {
    match path.strip_prefix(&*folder.to_string_lossy()) {
        Some(rest) => path.split_at(path.len() - rest.len()),
        None => ("", path),
    }
}

/// The path at `frame`: each run of `#` becomes the frame number, padded with zeros to the run's length.
pub fn expand_pattern(path: &str, frame: i64) -> String {
    let mut expanded = String::with_capacity(path.len() + 8);
    let mut rest = path;
    while let Some(start) = rest.find('#') {
        let run = rest[start..].chars().take_while(|&c| c == '#').count();
        expanded.push_str(&rest[..start]);
        let sign = if frame < 0 { "-" } else { "" };
        expanded.push_str(&format!("{sign}{:0run$}", frame.unsigned_abs()));
        rest = &rest[start + run..];
    }
    expanded.push_str(rest);
    expanded
}

/// The path (its graph's folder, and the rest) of every frame, or the one path that is the same for all.
pub fn paths_over<'a>((folder, rest): (&'a str, &'a str), frames: &'a [i64]) -> impl Iterator<Item = String> + 'a {
    let frames = if has_pattern(rest) { frames } else { &[] };
    let one = frames.is_empty().then(|| format!("{folder}{rest}"));
    one.into_iter().chain(frames.iter().map(move |&frame| format!("{folder}{}", expand_pattern(rest, frame))))
}

/// Brings paths into the form in which two that may be one file are equal: links, `.` and `..` resolved, case folded.
/// Each folder is looked for once.
#[derive(Default)]
pub struct Folding {
    /// Where a folder really lies, and whether it is there.
    folders: HashMap<PathBuf, (PathBuf, bool)>,
}

impl Folding {
    /// The form of a path.
    pub fn folded(&mut self, path: &str) -> String {
        let path = Path::new(path);
        let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else { return without_dots(path) };
        if !self.folders.contains_key(folder) {
            let real = |there: &Path| Some(there.canonicalize().ok()?.join(folder.strip_prefix(there).ok()?));
            let real = folder.ancestors().find_map(real).unwrap_or_else(|| folder.to_owned());
            self.folders.insert(folder.to_owned(), (real, folder.is_dir()));
        }
        let (real, is_there) = &self.folders[folder];
        let file = real.join(name);
        match *is_there && file.is_symlink() {
            true => without_dots(&file.canonicalize().unwrap_or(file)),
            false => without_dots(&file),
        }
    }
}

fn without_dots(path: &Path) -> String {
    let mut resolved = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                resolved.pop();
            }
            part => resolved.push(part),
        }
    }
    resolved.to_string_lossy().to_lowercase()
}

/// Replaces `$(env:NAME)` by the variable's value; the error is the names of those that are not set.
pub fn expand_variables(text: &str, variable: &dyn Fn(&str) -> Option<String>) -> Result<String, Vec<String>> {
    let mut expanded = String::with_capacity(text.len());
    let mut missing = Vec::new();
    let mut rest = text;
    while let Some(start) = rest.find("$(env:") {
        let Some(end) = rest[start..].find(')') else { break };
        let name = &rest[start + "$(env:".len()..start + end];
        expanded.push_str(&rest[..start]);
        match variable(name) {
            Some(value) => expanded.push_str(&value),
            None if missing.iter().any(|other| other == name) => {}
            None => missing.push(name.to_owned()),
        }
        rest = &rest[start + end + 1..];
    }
    expanded.push_str(rest);
    if missing.is_empty() { Ok(expanded) } else { Err(missing) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges() {
        assert_eq!(parse_frames("1001-1004"), Ok(vec![1001, 1002, 1003, 1004]));
        assert_eq!(parse_frames("1-10x4, 7,5"), Ok(vec![1, 5, 9, 7]));
        assert_eq!(parse_frames("-2--1,-5-0x5"), Ok(vec![-2, -1, -5, 0]));
        for bad in ["", "a", "5-1", "1-5x0", "1-5x-1", "1:5", "5x2", "1-2-3", "0-9999999999", "1,,2"] {
            assert!(parse_frames(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn patterns() {
        assert_eq!(expand_pattern("a.####.exr", 12), "a.0012.exr");
        assert_eq!(expand_pattern("##/a.#.exr", 1234), "1234/a.1234.exr");
        assert_eq!(expand_pattern("a.####.exr", -3), "a.-0003.exr");
    }

    #[test]
    fn patterns_of_other_programs() {
        for (path, found) in [
            ("a.%04d.exr", Some(("%04d", "####"))),
            ("a.%d.exr", Some(("%d", "#"))),
            ("a.%dir.exr", None),
            ("a.$F4.exr", Some(("$F4", "####"))),
            ("$F.exr", Some(("$F", "#"))),
            ("$SHOT/a.exr", Some(("$SHOT", "$(env:SHOT)"))),
            ("x/${SHOT}/a.exr", Some(("${SHOT}", "$(env:SHOT)"))),
            ("~/a.exr", Some(("~", "$(env:HOME)"))),
            ("100%/a~1.$5.exr", None),
            ("é%é$é~é.####.exr", None),
            ("$(env:SHOT)/${", None),
            ("$(env:SHOT)/$(evn:JOB)/a.exr", Some(("$(evn:JOB)", "$(env:JOB)"))),
            ("$(HOME)/a.exr", Some(("$(HOME)", "$(env:HOME)"))),
            ("$(env:)/a.exr", Some(("$(env:)", "$(env:NAME)"))),
        ] {
            let expected = found.map(|(part, instead)| (part, instead.to_owned()));
            assert_eq!(foreign_pattern(path), expected, "{path}");
        }
    }

    #[test]
    fn variables() {
        let shot = |name: &str| (name == "SHOT").then(|| "sh010".to_owned());
        assert_eq!(expand_variables("a/$(env:SHOT)/b", &shot), Ok("a/sh010/b".into()));
        let missing = expand_variables("$(env:NONE)/$(env:SHOT)/$(env:NIL)/$(env:NONE)", &shot);
        assert_eq!(missing, Err(vec!["NONE".into(), "NIL".into()]));
        assert_eq!(expand_variables("costs $5 (env:", &shot), Ok("costs $5 (env:".into()));
    }
}
