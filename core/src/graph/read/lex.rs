//! Where the pieces of RON end: white space, comments, names, quoted text. Pure functions from a text and an offset.

use unicode_ident::{is_xid_continue, is_xid_start};

/// RON's white space; a no-break space is not among it.
pub(super) fn is_blank(c: char) -> bool {
    matches!(
        c,
        ' ' | '\t' | '\n' | '\r' | '\x0B' | '\x0C' | '\u{85}' | '\u{200E}' | '\u{200F}' | '\u{2028}' | '\u{2029}'
    )
}

pub(super) fn char_at(text: &str, at: usize) -> Option<char> {
    text[at..].chars().next()
}

/// End of the characters from `at` on that satisfy `wanted`.
pub(super) fn run_end(text: &str, at: usize, wanted: impl Fn(char) -> bool) -> usize {
    text[at..].find(|c| !wanted(c)).map_or(text.len(), |len| at + len)
}

/// End of the white space and comments from `at` on, or the start of a block comment that is never closed.
pub(super) fn blank_end(text: &str, mut at: usize) -> Result<usize, usize> {
    let bytes = text.as_bytes();
    loop {
        match bytes.get(at) {
            Some(b' ' | b'\n' | b'\t' | b'\r' | 0x0B | 0x0C) => at += 1,
            Some(b'/') if bytes.get(at + 1) == Some(&b'/') => at = line_end(text, at),
            Some(b'/') if bytes.get(at + 1) == Some(&b'*') => at = block_comment_end(bytes, at).ok_or(at)?,
            Some(byte) if !byte.is_ascii() => match char_at(text, at) {
                Some(c) if is_blank(c) => at += c.len_utf8(),
                _ => return Ok(at),
            },
            _ => return Ok(at),
        }
    }
}

/// Where the line of `at` ends: its `\n`, or the end of the text.
pub(super) fn line_end(text: &str, at: usize) -> usize {
    let rest = &text.as_bytes()[at..];
    rest.iter().position(|&byte| byte == b'\n').map_or(text.len(), |len| at + len)
}

/// Offset behind the block comment that begins at `open`; block comments nest.
pub(super) fn block_comment_end(bytes: &[u8], open: usize) -> Option<usize> {
    let (mut at, mut level) = (open + 2, 1);
    while level > 0 {
        match (bytes.get(at)?, bytes.get(at + 1)) {
            (b'/', Some(b'*')) => (at, level) = (at + 2, level + 1),
            (b'*', Some(b'/')) => (at, level) = (at + 2, level - 1),
            _ => at += 1,
        }
    }
    Some(at)
}

/// A name: where it begins behind an `r#`, and where it ends.
#[derive(Clone, Copy)]
pub(super) struct NameAt {
    pub start: usize,
    pub end: usize,
    pub raw: bool,
}

pub(super) fn is_raw_name_char(c: char) -> bool {
    matches!(c, '.' | '+' | '-') || is_xid_continue(c)
}

/// The name at `at`, unless the `r` or `b` there begins a literal.
pub(super) fn name_at(text: &str, at: usize) -> Option<NameAt> {
    let bytes = text.as_bytes();
    let first = *bytes.get(at)?;
    if matches!(first, b'r' | b'b') {
        let rest = &bytes[at..];
        if [&b"b\""[..], b"b'", b"br#", b"br\"", b"r\"", b"r#\"", b"r##"].iter().any(|prefix| rest.starts_with(prefix))
        {
            return None;
        }
        if rest.starts_with(b"r#") {
            let end = run_end(text, at + 2, is_raw_name_char);
            return (end > at + 2).then_some(NameAt { start: at + 2, end, raw: true });
        }
    }
    if first.is_ascii() {
        if !(first.is_ascii_alphabetic() || first == b'_') {
            return None;
        }
    } else if !char_at(text, at).is_some_and(is_xid_start) {
        return None;
    }
    Some(NameAt { start: at, end: name_end(text, at), raw: false })
}

/// Whether a character goes on behind `name` that only a raw name may hold: `a-b`.
pub(super) fn dashed(text: &str, name: NameAt) -> bool {
    text[name.end..].starts_with(['.', '+', '-'])
}

fn name_end(text: &str, at: usize) -> usize {
    let is_plain = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
    let plain = at + text.as_bytes()[at..].iter().take_while(|byte| is_plain(byte)).count();
    match text.as_bytes().get(plain) {
        Some(byte) if !byte.is_ascii() => run_end(text, plain, is_xid_continue),
        _ => plain,
    }
}

/// Whether `word` stands at `at` and no name goes on behind it.
pub(super) fn word_at(text: &str, at: usize, word: &str) -> bool {
    text[at..].strip_prefix(word).is_some_and(|rest| !rest.chars().next().is_some_and(is_xid_continue))
}

/// How a quoted text ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct QuotedEnd {
    /// Offset behind the closing quote; of a text never closed, where reading had better go on.
    pub end: usize,
    pub closed: bool,
    /// Offset behind the last character between the quotes.
    pub inner_end: usize,
}

/// End of the text whose opening `"` stands at `open`.
///
/// A missing closing quote makes the next text's opening quote close this one. What follows is then the next text
/// itself, which no grammar allows, so this is seen here and such a text ends with its own line.
pub(super) fn quoted_end(text: &str, open: usize) -> QuotedEnd {
    let bytes = text.as_bytes();
    let mut at = open + 1;
    while let Some(len) = bytes[at..].iter().position(|&byte| matches!(byte, b'"' | b'\\')) {
        at += len;
        if bytes[at] == b'"' {
            return closed_unless_swallowed(text, open, at, at + 1);
        }
        at = (at + 2).min(bytes.len());
    }
    never_closed(text, open)
}

/// End of the raw text whose hashes and `"` begin at `hashes`; none if no quote stands there. With hashes, it holds
/// quotes, so nothing tells where one that is never closed was to end.
pub(super) fn raw_quoted_end(text: &str, hashes: usize) -> Option<QuotedEnd> {
    let open = run_end(text, hashes, |c| c == '#');
    let closing = ["\"", &text[hashes..open]].concat();
    let inner = text[open..].strip_prefix('"')?;
    let inner_end = inner.find(&closing).map(|len| open + 1 + len);
    Some(match inner_end {
        Some(inner_end) if closing.len() == 1 => closed_unless_swallowed(text, open, inner_end, inner_end + 1),
        Some(inner_end) => QuotedEnd { end: inner_end + closing.len(), closed: true, inner_end },
        None => QuotedEnd { end: text.len(), closed: false, inner_end: text.len() },
    })
}

fn closed_unless_swallowed(text: &str, open: usize, inner_end: usize, end: usize) -> QuotedEnd {
    let may_follow = match char_at(text, end) {
        None | Some(',' | ':' | ')' | ']' | '}' | '/') => true,
        Some(c) => is_blank(c) || !text[open..inner_end].contains('\n'),
    };
    if may_follow { QuotedEnd { end, closed: true, inner_end } } else { never_closed(text, open) }
}

/// Such a text is taken to end with its line, before the closing brackets and the comma there.
fn never_closed(text: &str, open: usize) -> QuotedEnd {
    let line = &text[open..line_end(text, open)];
    let end = open + line.trim_end_matches(|c| is_blank(c) || matches!(c, ',' | ')' | ']' | '}')).len();
    QuotedEnd { end, closed: false, inner_end: end }
}

/// End of the token at `at`, for looking ahead and for skipping what could not be read: a literal, a name, a number,
/// or one character.
pub(super) fn token_end(text: &str, at: usize) -> usize {
    let rest = &text[at..];
    let raw = |prefix: &str| rest.strip_prefix(prefix).and_then(|_| raw_quoted_end(text, at + prefix.len()));
    if let Some(quoted) = raw("br").or_else(|| raw("r")) {
        return quoted.end;
    }
    match rest.as_bytes().first() {
        Some(b'"') => quoted_end(text, at).end,
        Some(b'b') if rest.starts_with("b\"") => quoted_end(text, at + 1).end,
        Some(b'\'') => single_quoted_end(text, at).unwrap_or(at + 1),
        Some(b'b') if rest.starts_with("b'") => single_quoted_end(text, at + 1).unwrap_or(at + 2),
        Some(b'0'..=b'9') => number_run_end(text, at),
        Some(b'#') => at + text[at..line_end(text, at)].trim_end().len(),
        Some(b'\\') => at + 1 + char_at(text, at + 1).map_or(0, char::len_utf8),
        _ if rest.starts_with(SMART_QUOTES) => smart_quoted_end(text, at),
        _ => match name_at(text, at) {
            Some(name) => name.end,
            None => at + char_at(text, at).map_or(0, char::len_utf8),
        },
    }
}

/// Quotes that word processors make of straight ones.
pub(super) const SMART_QUOTES: [char; 6] = ['\u{201C}', '\u{201D}', '\u{2018}', '\u{2019}', '\u{AB}', '\u{BB}'];

/// Offset behind the quote that closes the one at `open`, if it stands on the same line; else behind that one.
fn smart_quoted_end(text: &str, open: usize) -> usize {
    let inner = open + char_at(text, open).map_or(0, char::len_utf8);
    let mut behind = text[inner..].char_indices().take_while(|&(_, c)| c != '\n');
    behind.find(|(_, c)| SMART_QUOTES.contains(c)).map_or(inner, |(at, c)| inner + at + c.len_utf8())
}

/// End of what looks like one number: `1.5e-3`, `0xff`, but also `1.2.3` or `12px`.
pub(super) fn number_run_end(text: &str, at: usize) -> usize {
    run_end(text, at, |c| c.is_ascii_alphanumeric() || matches!(c, '_' | '.' | '+' | '-'))
}

/// Offset behind the `'` that closes the one at `open`, on the same line: of a character, or of a whole word.
pub(super) fn single_quoted_end(text: &str, open: usize) -> Option<usize> {
    let bytes = text.as_bytes();
    let first = match bytes.get(open + 1)? {
        b'\\' => open + 3,
        b'\n' => return None,
        b'\'' if bytes.get(open + 2) != Some(&b'\'') => return Some(open + 2),
        _ => open + 1 + char_at(text, open + 1)?.len_utf8(),
    };
    let closing = bytes.get(first..)?.iter().position(|&byte| matches!(byte, b'\'' | b'\n'))?;
    (bytes[first + closing] == b'\'').then_some(first + closing + 1)
}
