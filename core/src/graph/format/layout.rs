//! A tree of brackets as text: what goes on which line, and in which column.

use super::tree::{Comment, Entry, Group, Part};

/// Longest line, unless what must stand on it is longer. A comment behind it may reach further.
const WIDTH: usize = 120;

const INDENT: usize = 4;

/// Longest key that others are aligned with.
const LONGEST_KEY: usize = 32;

pub(super) fn lay_out(document: &Group, line_end: &str) -> String {
    let layout = Layout { line_end };
    layout.lines(&layout.rows(document, 0), 0) + line_end
}

struct Layout<'a> {
    line_end: &'a str,
}

/// A line, or what must stand together on several.
struct Row<'a> {
    /// Whether a blank line stands before it.
    blank: bool,
    text: String,
    behind: &'a [Comment<'a>],
    is_comment: bool,
}

fn width(text: &str) -> usize {
    text.chars().count()
}

fn spaces(count: usize) -> String {
    " ".repeat(count)
}

fn words(comments: &[Comment]) -> String {
    comments.iter().map(|comment| comment.text).collect::<Vec<_>>().join(" ")
}

/// Whether a comment may stand within a line.
fn stays_within(comment: &Comment) -> bool {
    !comment.ends_line && !comment.text.contains('\n')
}

fn has_key(entry: &Entry) -> bool {
    entry.parts.iter().any(|part| matches!(part, Part::Colon))
}

/// Whether a group and the one bracket in it open and close together: `Keys([`.
fn hugs(group: &Group) -> bool {
    let [entry] = &group.entries[..] else { return false };
    let has_comments = [&group.beside, &group.below, &entry.above, &entry.behind].iter().any(|list| !list.is_empty())
        || entry.parts.iter().any(|part| matches!(part, Part::Comment(_)));
    let ends_in_group = matches!(entry.parts.last(), Some(Part::Group(inner)) if !inner.entries.is_empty());
    group.open == "(" && ends_in_group && !has_comments && !(group.opened && has_key(entry))
}

/// Whether a group has several lines, however short it is.
fn stays_open(group: &Group) -> bool {
    !group.entries.is_empty() && (group.open == "{" || group.opened && !hugs(group))
}

/// The white space between two parts on one line.
fn gap(before: Option<&Part>, part: &Part) -> &'static str {
    match (before, part) {
        (None, _) | (_, Part::Colon) => "",
        (Some(Part::Word(_)), Part::Group(group)) if group.open == "(" => "",
        _ => " ",
    }
}

/// Writes parts as one line; false if they cannot be one, or are far too long for it. `pad` more spaces stand behind the key.
fn flat(parts: &[Part], pad: usize, out: &mut String) -> bool {
    let mut before = None;
    let mut pad = Some(pad);
    for part in parts {
        *out += gap(before, part);
        let fits = match part {
            Part::Word(word) => {
                *out += word;
                !word.contains('\n')
            }
            Part::Colon => {
                *out += ":";
                *out += &spaces(pad.take().unwrap_or_default());
                true
            }
            Part::Comment(comment) => {
                *out += comment.text;
                stays_within(comment)
            }
            Part::Group(group) => flat_group(group, out),
        };
        // A character has at most 4 bytes.
        if !fits || out.len() > 4 * WIDTH {
            return false;
        }
        before = Some(part);
    }
    true
}

fn flat_group(group: &Group, out: &mut String) -> bool {
    let beside = if group.entries.is_empty() { &group.beside[..] } else { &[] };
    if stays_open(group) || !group.below.is_empty() || beside.len() < group.beside.len() {
        return false;
    }
    *out += group.open;
    *out += &words(beside);
    for (number, entry) in group.entries.iter().enumerate() {
        *out += if number > 0 { ", " } else { "" };
        if !entry.above.is_empty() || !entry.behind.iter().all(stays_within) || !flat(&entry.parts, 0, out) {
            return false;
        }
        entry.behind.iter().for_each(|comment| *out += &format!(" {}", comment.text));
    }
    *out += group.close;
    beside.iter().all(stays_within)
}

/// For each entry of a map the spaces behind its key that put the values of its block in a column.
fn pads(group: &Group) -> Vec<usize> {
    let key = |entry: &Entry| {
        let end = entry.parts.iter().position(|part| matches!(part, Part::Colon))? + 1;
        let mut key = String::new();
        flat(&entry.parts[..end], 0, &mut key).then(|| width(&key))
    };
    if group.open != "{" {
        return vec![0; group.entries.len()];
    }
    let begins = |entry: &Entry| entry.line_ends > 1 || entry.above.iter().any(|comment| comment.line_ends > 1);
    let mut pads = Vec::with_capacity(group.entries.len());
    for block in group.entries.chunk_by(|_, entry| !begins(entry)) {
        let keys: Vec<usize> = block.iter().map(|entry| key(entry).unwrap_or(WIDTH)).collect();
        let column = keys.iter().copied().filter(|&key| key <= LONGEST_KEY).max().unwrap_or_default();
        pads.extend(keys.iter().map(|&key| column.saturating_sub(key)));
    }
    pads
}

impl Layout<'_> {
    fn new_line(&self, indent: usize) -> String {
        format!("{}{}", self.line_end, spaces(indent))
    }

    /// The parts of an entry that begins in column `indent`, with `reserve` characters behind them.
    fn parts(&self, parts: &[Part], indent: usize, pad: usize, reserve: usize) -> String {
        let mut line = String::new();
        if flat(parts, pad, &mut line) && indent + width(&line) + reserve <= WIDTH {
            return line;
        }
        self.broken_parts(parts, indent, pad, |group, column, indent| {
            let mut whole = String::new();
            let fits = flat_group(group, &mut whole) && column + width(&whole) + reserve <= WIDTH;
            if fits { whole } else { self.open(group, indent) }
        })
    }

    /// Parts that do not fit on one line; `group` writes a bracket, given the column it begins in and the indent.
    fn broken_parts(
        &self,
        parts: &[Part],
        mut indent: usize,
        pad: usize,
        group: impl Fn(&Group, usize, usize) -> String,
    ) -> String {
        let (mut text, start) = (String::new(), indent);
        let mut before: Option<&Part> = None;
        let mut pad = Some(pad);
        for part in parts {
            match before {
                Some(Part::Comment(comment)) if comment.ends_line => {
                    indent = start + INDENT;
                    text += &self.new_line(indent);
                }
                _ => text += gap(before, part),
            }
            match part {
                Part::Word(word) => text += word,
                Part::Colon => text += &format!(":{}", spaces(pad.take().unwrap_or_default())),
                Part::Comment(comment) => text += comment.text,
                Part::Group(inner) => {
                    let line = text.rsplit('\n').next().unwrap_or_default();
                    let column = width(line) + if line.len() == text.len() { start } else { 0 };
                    text += &group(inner, column, indent);
                }
            }
            before = Some(part);
        }
        text
    }

    /// A group over several lines, the last of which begins in column `indent`.
    fn open(&self, group: &Group, indent: usize) -> String {
        if hugs(group) {
            let inner = self.broken_parts(&group.entries[0].parts, indent, 0, |inner, _, _| self.open(inner, indent));
            return format!("{}{inner}{}", group.open, group.close);
        }
        let mut text = group.open.to_owned();
        group.beside.iter().for_each(|comment| text += &format!(" {}", comment.text));
        let rows = self.rows(group, indent + INDENT);
        if !rows.is_empty() {
            text += &self.new_line(indent + INDENT);
            text += &self.lines(&rows, indent + INDENT);
        }
        text + &self.new_line(indent) + group.close
    }

    /// What a group holds, a row per entry and comment; short items may share one.
    fn rows<'g>(&self, group: &'g Group, indent: usize) -> Vec<Row<'g>> {
        let mut rows: Vec<Row> = Vec::new();
        let comma = if group.open.is_empty() { "" } else { "," };
        let may_share = !group.open.is_empty() && !group.entries.iter().any(has_key);
        for (entry, pad) in group.entries.iter().zip(pads(group)) {
            rows.extend(entry.above.iter().map(comment_row));
            let text = self.parts(&entry.parts, indent, pad, comma.len()) + comma;
            let shares = |row: &Row| {
                let fits = indent + width(&row.text) + 1 + width(&text) <= WIDTH;
                let one_line = !row.text.contains('\n') && !text.contains('\n');
                fits && one_line && !row.is_comment && row.behind.is_empty()
            };
            match rows.last_mut() {
                Some(row) if may_share && entry.line_ends == 0 && entry.above.is_empty() && shares(row) => {
                    row.text += &format!(" {text}");
                    row.behind = &entry.behind;
                }
                _ => rows.push(Row { blank: entry.line_ends > 1, text, behind: &entry.behind, is_comment: false }),
            }
        }
        rows.extend(group.below.iter().map(comment_row));
        rows
    }

    /// Rows below each other, comments behind them in columns.
    fn lines(&self, rows: &[Row], indent: usize) -> String {
        let mut text = String::new();
        let is_alike = |row: &Row| !row.behind.is_empty() && !row.text.contains('\n');
        for run in rows.chunk_by(|before, row| is_alike(before) && is_alike(row) && !row.blank) {
            let column = run.iter().map(|row| width(&row.text)).max().unwrap_or_default();
            let fits = run.iter().all(|row| indent + column + 1 + width(&words(row.behind)) <= WIDTH);
            for row in run {
                if !text.is_empty() {
                    text += if row.blank { self.line_end } else { "" };
                    text += &self.new_line(indent);
                }
                text += &row.text;
                if !row.behind.is_empty() {
                    let pad = if fits && is_alike(row) { column - width(&row.text) } else { 0 };
                    text += &format!("{} {}", spaces(pad), words(row.behind));
                }
            }
        }
        text
    }
}

fn comment_row<'g>(comment: &'g Comment) -> Row<'g> {
    Row { blank: comment.line_ends > 1, text: comment.text.to_owned(), behind: &[], is_comment: true }
}
