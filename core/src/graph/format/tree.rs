//! Tokens as a tree of brackets, each comment with what it belongs to.

use std::iter::Peekable;

use crate::graph::read::{Token, TokenKind, tokens};

pub(super) struct Comment<'a> {
    pub text: &'a str,
    /// Whether it goes on to the end of its line.
    pub ends_line: bool,
    /// Line ends before it.
    pub line_ends: usize,
}

pub(super) enum Part<'a> {
    Word(&'a str),
    Colon,
    /// One between other parts.
    Comment(Comment<'a>),
    Group(Group<'a>),
}

/// What stands between two commas.
#[derive(Default)]
pub(super) struct Entry<'a> {
    /// Comments on lines of their own before it.
    pub above: Vec<Comment<'a>>,
    /// Line ends before its first part.
    pub line_ends: usize,
    pub parts: Vec<Part<'a>>,
    /// Comments behind it, on the line it ends on.
    pub behind: Vec<Comment<'a>>,
}

/// A bracket and what it holds. The document is one without a bracket, its attributes and its value being entries.
#[derive(Default)]
pub(super) struct Group<'a> {
    pub open: &'a str,
    pub close: &'a str,
    /// Whether a new line begins behind the opening bracket.
    pub opened: bool,
    /// Comments on the line of the opening bracket.
    pub beside: Vec<Comment<'a>>,
    pub entries: Vec<Entry<'a>>,
    /// Comments on lines of their own behind the last entry.
    pub below: Vec<Comment<'a>>,
}

/// The tree of a text without faults.
pub(super) fn document(text: &str) -> Group<'_> {
    Builder { group: Group::default(), entry: Entry::default(), waiting: Vec::new(), joins: false }
        .build(&mut tokens(text).peekable())
}

/// A group in the making.
struct Builder<'a> {
    group: Group<'a>,
    entry: Entry<'a>,
    /// Comments that have no place yet.
    waiting: Vec<Comment<'a>>,
    /// Whether a comment on this line belongs to the last entry, or to the opening bracket.
    joins: bool,
}

impl<'a> Builder<'a> {
    fn build<T: Iterator<Item = Token<'a>>>(mut self, tokens: &mut Peekable<T>) -> Group<'a> {
        self.group.opened = tokens.peek().is_some_and(|token| token.line_ends > 0);
        while let Some(token) = tokens.next() {
            match token.kind {
                TokenKind::LineComment | TokenKind::BlockComment => self.waiting.push(Comment {
                    text: token.text,
                    ends_line: token.kind == TokenKind::LineComment,
                    line_ends: token.line_ends,
                }),
                TokenKind::Comma => {
                    self.end_entry();
                    self.joins = token.line_ends == 0 && self.waiting.is_empty();
                }
                TokenKind::Close => {
                    self.group.close = token.text;
                    break;
                }
                TokenKind::Attribute => {
                    self.part(token.line_ends, Part::Word(token.text));
                    self.end_entry();
                }
                TokenKind::Colon => self.part(token.line_ends, Part::Colon),
                TokenKind::Word => self.part(token.line_ends, Part::Word(token.text)),
                TokenKind::Open => {
                    let group = Group { open: token.text, ..Group::default() };
                    let inner = Builder { group, entry: Entry::default(), waiting: Vec::new(), joins: true };
                    let inner = inner.build(tokens);
                    self.part(token.line_ends, Part::Group(inner));
                }
            }
        }
        if !self.entry.parts.is_empty() {
            self.end_entry();
        }
        self.group.below = self.settle(self.waiting.len());
        self.group
    }

    fn part(&mut self, line_ends: usize, part: Part<'a>) {
        if self.entry.parts.is_empty() {
            // Comments that this part's line begins with are parts of the entry.
            let (mut inside, mut before) = (self.waiting.len(), line_ends);
            while inside > 0 && before == 0 && !self.waiting[inside - 1].ends_line {
                inside -= 1;
                before = self.waiting[inside].line_ends;
            }
            self.entry.line_ends = before;
            self.entry.above = self.settle(inside);
        }
        self.entry.parts.extend(self.waiting.drain(..).map(Part::Comment));
        self.entry.parts.push(part);
    }

    fn end_entry(&mut self) {
        self.group.entries.push(std::mem::take(&mut self.entry));
        self.joins = true;
        self.waiting = self.settle(self.waiting.len());
    }

    /// Gives of the first `count` waiting comments those on this line to whom they belong, and returns the others.
    fn settle(&mut self, count: usize) -> Vec<Comment<'a>> {
        let joining = self.waiting[..count].iter().take_while(|comment| self.joins && comment.line_ends == 0).count();
        let owner = self.group.entries.last_mut().map_or(&mut self.group.beside, |entry| &mut entry.behind);
        owner.extend(self.waiting.drain(..joining));
        self.waiting.drain(..count - joining).collect()
    }
}
