//! Texts, characters and byte strings: finding their end, resolving their escapes.

use super::lex::{char_at, quoted_end, raw_quoted_end, run_end, single_quoted_end};
use super::tree::Reader;
use super::{Int, Ron};

/// A stretch of a literal as it reads once its escapes are resolved.
enum Piece<'a> {
    Plain(&'a str),
    Char(char),
    Byte(u8),
}

#[derive(Clone, Copy, PartialEq)]
enum Inside {
    Text,
    Char,
    Bytes,
}

/// Resolves the escape whose `\` begins `rest`; returns its length too.
fn escape(rest: &str, inside: Inside) -> Result<(Piece<'static>, usize), &'static str> {
    let simple = |c| Ok((Piece::Char(c), 2));
    match rest[1..].chars().next() {
        Some(c @ ('\'' | '"' | '\\')) => simple(c),
        Some('n') => simple('\n'),
        Some('r') => simple('\r'),
        Some('t') => simple('\t'),
        Some('0') => simple('\0'),
        Some('x') => byte_escape(rest, inside),
        Some('u') => unicode_escape(rest),
        Some('\n') if inside != Inside::Char => Ok(continuation(rest, 2)),
        Some('\r') if inside != Inside::Char && rest[1..].starts_with("\r\n") => Ok(continuation(rest, 3)),
        _ => Err("is no escape"),
    }
}

/// A backslash at a line's end swallows the line break and the white space behind it.
fn continuation(rest: &str, len: usize) -> (Piece<'static>, usize) {
    let swallowed = rest.len() - rest[len..].trim_start_matches([' ', '\t', '\n', '\r']).len();
    (Piece::Plain(""), swallowed)
}

/// In texts, up to four `\x` escapes spell the UTF-8 bytes of one character.
fn byte_escape(rest: &str, inside: Inside) -> Result<(Piece<'static>, usize), &'static str> {
    let byte = |index: usize| {
        let digits = rest.get(4 * index..4 * index + 4)?.strip_prefix("\\x")?;
        let is_hex = digits.bytes().all(|digit| digit.is_ascii_hexdigit());
        u8::from_str_radix(digits, 16).ok().filter(|_| is_hex)
    };
    let first = byte(0).ok_or("needs two hexadecimal digits")?;
    if inside == Inside::Bytes {
        return Ok((Piece::Byte(first), 4));
    }
    let mut bytes = vec![first];
    while bytes.len() <= if inside == Inside::Char { 1 } else { 4 } {
        if let Some(c) = std::str::from_utf8(&bytes).ok().and_then(|text| text.chars().next()) {
            return Ok((Piece::Char(c), 4 * bytes.len()));
        }
        let Some(next) = byte(bytes.len()) else { break };
        bytes.push(next);
    }
    Err("does not begin a character in UTF-8")
}

fn unicode_escape(rest: &str) -> Result<(Piece<'static>, usize), &'static str> {
    let digits = rest[2..].strip_prefix('{').and_then(|inner| inner.split_once('}')).map(|(digits, _)| digits);
    let digits = digits.filter(|digits| (1..=6).contains(&digits.len()));
    let digits = digits.filter(|digits| digits.bytes().all(|digit| digit.is_ascii_hexdigit()));
    let digits = digits.ok_or("needs one to six hexadecimal digits in braces")?;
    let c = u32::from_str_radix(digits, 16).ok().and_then(char::from_u32).ok_or("names no Unicode character")?;
    Ok((Piece::Char(c), digits.len() + 4))
}

/// The one character between single quotes, the first of them at `open`; returns the offset behind the second.
fn single_quoted(text: &str, open: usize, inside: Inside) -> Option<(Piece<'static>, usize)> {
    let rest = &text[open + 1..];
    let (piece, len) = match rest.chars().next()? {
        '\\' => escape(rest, inside).ok()?,
        c => (Piece::Char(c), c.len_utf8()),
    };
    rest[len..].starts_with('\'').then_some((piece, open + len + 2))
}

impl<'a> Reader<'a> {
    /// A text, escaped or raw.
    pub(super) fn text_literal(&mut self) -> Ron {
        let raw = !self.rest().starts_with('"');
        let Some((start, inner)) = self.between_quotes(usize::from(raw), raw) else { return Ron::Broken };
        if raw || !inner.contains('\\') {
            return Ron::Text(inner.to_owned());
        }
        let mut text = String::with_capacity(inner.len());
        let whole = self.resolve(start, inner, Inside::Text, |piece| match piece {
            Piece::Plain(plain) => text.push_str(plain),
            Piece::Char(c) => text.push(c),
            Piece::Byte(byte) => text.push(char::from(byte)),
        });
        if whole { Ron::Text(text) } else { Ron::Broken }
    }

    /// A byte string, escaped or raw.
    pub(super) fn bytes_literal(&mut self) -> Ron {
        let raw = self.rest().starts_with("br");
        let Some((start, inner)) = self.between_quotes(1 + usize::from(raw), raw) else { return Ron::Broken };
        if raw {
            return Ron::Bytes(inner.as_bytes().to_owned());
        }
        let mut bytes = Vec::with_capacity(inner.len());
        let whole = self.resolve(start, inner, Inside::Bytes, |piece| match piece {
            Piece::Plain(plain) => bytes.extend_from_slice(plain.as_bytes()),
            Piece::Char(c) => bytes.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes()),
            Piece::Byte(byte) => bytes.push(byte),
        });
        if whole { Ron::Bytes(bytes) } else { Ron::Broken }
    }

    /// Passes over a literal of `prefix_len` letters and a quoted text; returns what stands between the quotes.
    fn between_quotes(&mut self, prefix_len: usize, raw: bool) -> Option<(usize, &'a str)> {
        let (start, hashes) = (self.at, self.at + prefix_len);
        let quote = if raw { run_end(self.text, hashes, |c| c == '#') } else { hashes };
        let quoted = if raw { raw_quoted_end(self.text, hashes) } else { Some(quoted_end(self.text, quote)) };
        let Some(quoted) = quoted else {
            let found = self.found(quote);
            self.fault(quote, self.token_end(quote), format!("expected `\"` after the `#`, found {found}"), None);
            self.at = quote;
            self.lose();
            return None;
        };
        self.at = quoted.end;
        if !quoted.closed {
            let hashes = if raw { &self.text[hashes..quote] } else { "" };
            let hint = format!("write the closing `\"{hashes}`");
            self.fault(start, quoted.end, "this text is never closed".to_owned(), Some(hint));
            if quoted.end == self.text.len() {
                self.leave(0);
            }
            return None;
        }
        Some((quote + 1, &self.text[quote + 1..quoted.inner_end]))
    }

    /// Hands over the pieces of `inner`; false, with all its faults reported, if an escape cannot be resolved.
    fn resolve(&mut self, mut start: usize, inner: &str, inside: Inside, mut take: impl FnMut(Piece)) -> bool {
        let (mut rest, mut whole) = (inner, true);
        while let Some(plain) = rest.find('\\') {
            take(Piece::Plain(&rest[..plain]));
            (rest, start) = (&rest[plain..], start + plain);
            let len = match escape(rest, inside) {
                Ok((piece, len)) => {
                    take(piece);
                    len
                }
                Err(message) => {
                    whole = false;
                    self.bad_escape(start, message)
                }
            };
            (rest, start) = (&rest[len..], start + len);
        }
        take(Piece::Plain(rest));
        whole
    }

    /// Reports the escape at `start`; returns how much of it to skip.
    fn bad_escape(&mut self, start: usize, message: &str) -> usize {
        let len = 1 + char_at(self.text, start + 1).map_or(0, char::len_utf8);
        let shown = self.text[start..start + len].escape_debug().to_string().replace("\\\\", "\\");
        let hint = "a backslash itself is written `\\\\`; a path can use `/`".to_owned();
        self.fault(start, start + len, format!("`{shown}` {message}"), Some(hint));
        len
    }

    /// A character in single quotes.
    pub(super) fn char_literal(&mut self) -> Ron {
        match single_quoted(self.text, self.at, Inside::Char) {
            Some((Piece::Char(c), end)) => {
                self.at = end;
                Ron::Char(c)
            }
            _ => self.not_one_char(self.at),
        }
    }

    /// An ASCII character as a number: `b'a'`.
    pub(super) fn byte_literal(&mut self) -> Ron {
        let byte = match single_quoted(self.text, self.at + 1, Inside::Bytes) {
            Some((Piece::Byte(byte), end)) => Some((byte, end)),
            Some((Piece::Char(c), end)) if c.is_ascii() && !self.rest().starts_with("b'\\u") => Some((c as u8, end)),
            _ => None,
        };
        let Some((byte, end)) = byte else { return self.not_one_char(self.at + 1) };
        self.at = end;
        Ron::Int(Int { negative: false, magnitude: byte.into() })
    }

    fn not_one_char(&mut self, open: usize) -> Ron {
        let start = self.at;
        match single_quoted_end(self.text, open) {
            Some(end) => {
                let inner = &self.text[open + 1..end - 1];
                let message = format!("`{}` is not one character", &self.text[start..end]);
                self.fault(start, end, message, Some(format!("text stands in double quotes: \"{inner}\"")));
                self.at = end;
            }
            None => {
                let message = "this `'` is never closed".to_owned();
                self.fault(open, open + 1, message, Some("text stands in double quotes".to_owned()));
                self.lose();
            }
        }
        Ron::Broken
    }
}
