//! The tokens of a text, comments among them: what a formatter moves about and never changes.

use super::lex::{blank_end, block_comment_end, is_blank, line_end, run_end, token_end};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::graph) enum TokenKind {
    /// `// ..`, without white space at its end.
    LineComment,
    /// `/* .. */`
    BlockComment,
    /// `#![ .. ]`
    Attribute,
    Open,
    Close,
    Comma,
    Colon,
    /// A literal, a name, a range: whatever may not be taken apart.
    Word,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::graph) struct Token<'a> {
    pub kind: TokenKind,
    pub text: &'a str,
    /// Line ends between the token before and this one.
    pub line_ends: usize,
}

/// The tokens of a text in which [`read`](super::read) finds no fault.
pub(in crate::graph) fn tokens(text: &str) -> impl Iterator<Item = Token<'_>> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let start = run_end(text, at, is_blank);
        let line_ends = text[at..start].matches('\n').count();
        let (kind, end) = token(text, start)?;
        at = end;
        let whole = &text[start..end];
        let shown = if kind == TokenKind::LineComment { whole.trim_end_matches(is_blank) } else { whole };
        Some(Token { kind, text: shown, line_ends })
    })
}

fn token(text: &str, at: usize) -> Option<(TokenKind, usize)> {
    let bytes = text.as_bytes();
    Some(match bytes.get(at)? {
        b'(' | b'[' | b'{' => (TokenKind::Open, at + 1),
        b')' | b']' | b'}' => (TokenKind::Close, at + 1),
        b',' => (TokenKind::Comma, at + 1),
        b':' => (TokenKind::Colon, at + 1),
        b'#' => (TokenKind::Attribute, attribute_end(text, at + 1)),
        b'/' if bytes.get(at + 1) == Some(&b'/') => (TokenKind::LineComment, line_end(text, at)),
        b'/' if bytes.get(at + 1) == Some(&b'*') => {
            (TokenKind::BlockComment, block_comment_end(bytes, at).unwrap_or(text.len()))
        }
        _ => (TokenKind::Word, word_end(text, at)),
    })
}

/// Pieces with nothing between them belong together: `0..b'a'`.
fn word_end(text: &str, mut at: usize) -> usize {
    loop {
        at = token_end(text, at);
        // A line end in single quotes, which elsewhere tells that a quote was never closed.
        if text[..at].ends_with('\'') && text[at..].starts_with("\n'") {
            at += 2;
        }
        let ends = |c: char| is_blank(c) || matches!(c, '(' | ')' | '[' | ']' | '{' | '}' | ',' | ':' | '/');
        if text[at..].chars().next().is_none_or(ends) {
            return at;
        }
    }
}

fn attribute_end(text: &str, mut at: usize) -> usize {
    loop {
        at = blank_end(text, at).unwrap_or(text.len());
        match text.as_bytes().get(at) {
            None => return at,
            Some(b']') => return at + 1,
            Some(_) => at = token_end(text, at),
        }
    }
}
