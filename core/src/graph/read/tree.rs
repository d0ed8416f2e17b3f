//! Values and brackets: one function per rule of the grammar. What happens after a fault is in `recover`.

use super::attributes::Extensions;
use super::lex::{NameAt, blank_end, dashed, is_raw_name_char, line_end, name_at, number_run_end, quoted_end, run_end};
use super::lines::Lines;
use super::numbers::{named_float, number};
use super::{Fault, Reading, Ron, Span, Spanned};

/// Ron's own limit.
const LEVELS: usize = 128;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Struct,
    Tuple,
    /// `Some( .. )`, which holds one value.
    Some,
    List,
    Map,
}

impl Kind {
    pub fn open(self) -> char {
        match self {
            Kind::Struct | Kind::Tuple | Kind::Some => '(',
            Kind::List => '[',
            Kind::Map => '{',
        }
    }

    pub fn close(self) -> u8 {
        match self {
            Kind::Struct | Kind::Tuple | Kind::Some => b')',
            Kind::List => b']',
            Kind::Map => b'}',
        }
    }
}

/// A bracket that is open at the cursor.
pub(super) struct Open {
    pub at: usize,
    pub kind: Kind,
    /// Where the entry begins that is being read.
    pub entry: usize,
}

/// What keeps reading from going on at the cursor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Trouble {
    None,
    /// The token at the cursor begins nothing that may stand there; its fault is reported.
    Lost,
    /// All open brackets but so many outer ones end at the cursor; the fault is reported.
    Leave(usize),
}

/// What a bracket holds: values, map entries or fields.
pub(super) trait Part {
    /// Stands for a part that could not be read.
    fn broken(span: Span) -> Self;
    /// Marks a part as one that was not read whole.
    fn spoil(&mut self);
}

impl Part for Spanned<Ron> {
    fn broken(span: Span) -> Self {
        Spanned { value: Ron::Broken, span }
    }

    fn spoil(&mut self) {
        self.value = Ron::Broken;
    }
}

type Entry = (Spanned<Ron>, Spanned<Ron>);

impl Part for Entry {
    fn broken(span: Span) -> Self {
        (Spanned::broken(span), Spanned::broken(span))
    }

    fn spoil(&mut self) {
        self.1.spoil();
    }
}

type Field = (Spanned<String>, Spanned<Ron>);

impl Part for Field {
    fn broken(span: Span) -> Self {
        (Spanned { value: String::new(), span }, Spanned::broken(span))
    }

    fn spoil(&mut self) {
        self.1.spoil();
    }
}

pub(super) struct Reader<'a> {
    pub text: &'a str,
    /// The cursor, always between characters.
    pub at: usize,
    pub extensions: Extensions,
    /// The brackets open at the cursor, outermost first.
    pub open: Vec<Open>,
    levels_left: usize,
    pub trouble: Trouble,
    /// A fault was reported that has left no `Broken` yet.
    pub marked: bool,
    pub faults: Vec<Fault>,
    pub lines: Option<Lines<&'a str>>,
    pub look_aheads: usize,
    /// Where the last text literal read begins.
    pub last_text: usize,
}

impl<'a> Reader<'a> {
    pub fn new(text: &'a str) -> Self {
        Reader {
            text,
            at: 0,
            extensions: Extensions::default(),
            open: Vec::new(),
            levels_left: LEVELS,
            trouble: Trouble::None,
            marked: false,
            faults: Vec::new(),
            lines: None,
            look_aheads: 0,
            last_text: 0,
        }
    }

    pub fn document(mut self) -> Reading {
        if self.text.starts_with('\u{FEFF}') {
            self.fault_here("expected a value".to_owned());
            self.at = '\u{FEFF}'.len_utf8();
        }
        self.attributes();
        let tree = self.value();
        if self.trouble == Trouble::None {
            self.blank();
            self.trailing();
        }
        self.faults.sort_by_key(|fault| fault.span);
        Reading { tree: Some(tree).filter(|tree| !matches!(tree.value, Ron::Broken)), faults: self.faults }
    }

    pub fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    pub fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    pub fn eat(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    /// Passes over white space and comments.
    pub fn blank(&mut self) {
        match blank_end(self.text, self.at) {
            Ok(end) => self.at = end,
            Err(open) => {
                let hint = Some("write the closing `*/`".to_owned());
                self.fault(open, open + 2, "this comment is never closed".to_owned(), hint);
                self.at = self.text.len();
                self.trouble = Trouble::Leave(0);
            }
        }
    }

    pub fn value(&mut self) -> Spanned<Ron> {
        let start = self.at;
        let value = self.bare_value();
        if let Ron::Broken = value {
            self.marked = false;
        }
        Spanned { value, span: Span::new(start, self.at) }
    }

    fn bare_value(&mut self) -> Ron {
        match self.peek() {
            Some(b'"') => {
                self.last_text = self.at;
                self.text_literal()
            }
            Some(b'0'..=b'9' | b'+' | b'-' | b'.') => self.number_or_range(),
            Some(b'(') => self.parenthesis(None),
            Some(b'[') => self.bracket(Kind::List, Self::value).map_or(Ron::Broken, Ron::List),
            Some(b'{') => self.bracket(Kind::Map, Self::entry).map_or(Ron::Broken, Ron::Map),
            Some(b'\'') => self.char_literal(),
            Some(first) => match name_at(self.text, self.at) {
                Some(name) => self.named(name),
                None if self.rest().starts_with("b'") => {
                    let byte = self.byte_literal();
                    self.range_behind(byte)
                }
                None if first == b'b' => self.bytes_literal(),
                None if first == b'r' => self.text_literal(),
                None => self.no_value(),
            },
            None => self.no_value(),
        }
    }

    fn no_value(&mut self) -> Ron {
        self.fault_here("expected a value".to_owned());
        self.lose();
        Ron::Broken
    }

    fn named(&mut self, name: NameAt) -> Ron {
        let start = self.at;
        let word = &self.text[name.start..name.end];
        self.at = name.end;
        if !name.raw {
            match word {
                "true" => return Ron::Bool(true),
                "false" => return Ron::Bool(false),
                "None" => return Ron::Name(word.to_owned()),
                "Some" => return self.some(Span::new(start, name.end)),
                _ => {}
            }
            if let Some((value, _)) = named_float(self.text, start) {
                return self.range_behind(Ron::Float(value));
            }
        }
        self.blank();
        if self.peek() == Some(b'(') {
            return self.parenthesis(Some(Spanned { value: word.to_owned(), span: Span::new(start, name.end) }));
        }
        self.at = name.end;
        Ron::Name(word.to_owned())
    }

    fn some(&mut self, span: Span) -> Ron {
        let after = self.at;
        let name = Some(Spanned { value: "Some".to_owned(), span });
        self.blank();
        if self.peek() != Some(b'(') {
            return self.some_without_parenthesis(name, after);
        }
        if self.extensions.unwrap_variant_newtypes {
            return self.parenthesis(name);
        }
        let Some(mut items) = self.bracket(Kind::Some, Self::value) else { return Ron::Broken };
        if items.len() != 1 && !items.iter().any(super::has_broken) {
            let surplus = items.get(1).map_or(self.at - 1, |item| item.span.start as usize);
            self.fault(surplus, self.token_end(surplus), "`Some` takes one value".to_owned(), None);
            self.marked = false;
            items.push(Spanned::broken(Span::new(self.at - 1, self.at - 1)));
        }
        Ron::Tuple { name, items }
    }

    fn some_without_parenthesis(&mut self, name: Option<Spanned<String>>, after: usize) -> Ron {
        if !self.extensions.implicit_some {
            self.fault_here("expected `(` after `Some`".to_owned());
            self.at = after;
            return Ron::Broken;
        }
        if !self.enter(1) {
            return Ron::Broken;
        }
        let item = self.value();
        self.levels_left += 1;
        Ron::Tuple { name, items: vec![item] }
    }

    /// What stands in `( .. )`, with or without a name before it.
    fn parenthesis(&mut self, name: Option<Spanned<String>>) -> Ron {
        if name.is_none() && self.rest().starts_with("()") {
            self.at += 2;
            return Ron::Unit;
        }
        let first = blank_end(self.text, self.at + 1).unwrap_or(self.text.len());
        if self.field_starts(first) {
            let fields = self.bracket(Kind::Struct, Self::field);
            return fields.map_or(Ron::Broken, |fields| Ron::Struct { name, fields });
        }
        match self.bracket(Kind::Tuple, Self::value) {
            None => Ron::Broken,
            Some(items) if !items.is_empty() => Ron::Tuple { name, items },
            Some(_) if name.is_some() => Ron::Struct { name, fields: Vec::new() },
            Some(_) => Ron::Unit,
        }
    }

    /// Whether the entry at `at` is meant to be a field, however its name and its `:` are written.
    pub fn field_starts(&self, at: usize) -> bool {
        let behind = |end: usize| blank_end(self.text, end).ok().and_then(|end| self.text.as_bytes().get(end).copied());
        let quoted = || self.text[at..].starts_with('"').then(|| quoted_end(self.text, at).end);
        let Some(end) = name_at(self.text, at).map(|name| name.end).or_else(quoted) else { return false };
        matches!(behind(end), Some(b':' | b'=')) || behind(run_end(self.text, end, is_raw_name_char)) == Some(b':')
    }

    /// Takes `needed` nesting levels, or reports that there are none left at the cursor.
    fn enter(&mut self, needed: usize) -> bool {
        let fits = needed <= self.levels_left;
        if fits {
            self.levels_left -= needed;
        } else {
            let message = format!("this is nested too deep: ron reads {LEVELS} levels");
            self.fault(self.at, self.token_end(self.at), message, None);
            self.lose();
        }
        fits
    }

    /// Reads the entries of a bracket from its opening to its closing one; none if it is nested too deep.
    fn bracket<T: Part>(&mut self, kind: Kind, read: fn(&mut Self) -> T) -> Option<Vec<T>> {
        let first = blank_end(self.text, self.at + 1).unwrap_or(self.text.len());
        let is_empty = self.text.as_bytes().get(first) == Some(&kind.close());
        let levels = if is_empty || kind == Kind::Some { 1 } else { 2 };
        if !self.enter(levels) {
            return None;
        }
        let open = self.at;
        self.at += 1;
        let entries = self.inside(kind, open, read);
        self.levels_left += levels;
        Some(entries)
    }

    /// Reads the entries of a map whose opening bracket is missing at the cursor.
    pub fn map_without_brace(&mut self) -> Spanned<Ron> {
        let start = self.at;
        if !self.enter(2) {
            return self.broken_here();
        }
        let entries = self.inside(Kind::Map, start, Self::entry);
        self.levels_left += 2;
        Spanned { value: Ron::Map(entries), span: Span::new(start, self.at) }
    }

    fn inside<T: Part>(&mut self, kind: Kind, open: usize, read: fn(&mut Self) -> T) -> Vec<T> {
        self.open.push(Open { at: open, kind, entry: self.at });
        let entries = self.entries(kind.close(), read);
        self.open.pop();
        entries
    }

    fn entries<T: Part>(&mut self, close: u8, read: fn(&mut Self) -> T) -> Vec<T> {
        let mut entries = Vec::new();
        loop {
            self.blank();
            if self.eat(close) {
                return entries;
            }
            if self.at_end_or_closing() {
                self.wrong_end();
            } else {
                if let Some(open) = self.open.last_mut() {
                    open.entry = self.at;
                }
                let mut entry = read(self);
                let end = self.at;
                if self.trouble == Trouble::None {
                    self.separator(close);
                    if self.trouble == Trouble::Lost {
                        entry.spoil();
                        self.marked = false;
                    }
                }
                // An unclosed bracket may have been found to end before this entry, which an outer one holds then.
                if self.at >= end {
                    entries.push(entry);
                }
            }
            if std::mem::take(&mut self.marked) {
                entries.push(T::broken(Span::new(self.at, self.at)));
            }
            if self.trouble != Trouble::None && !self.recover() {
                return entries;
            }
        }
    }

    /// What stands behind an entry: a comma, or the closing bracket, which is left for the next round.
    fn separator(&mut self, close: u8) {
        self.blank();
        if self.eat(b',') || self.peek() == Some(close) {
            return;
        }
        if self.at_end_or_closing() { self.wrong_end() } else { self.missing_separator() }
    }

    fn entry(&mut self) -> Entry {
        let key = self.value();
        if self.trouble != Trouble::None {
            return (key, self.broken_here());
        }
        self.blank();
        if !self.eat(b':') {
            self.missing_colon("this key");
        }
        let value = self.value_behind_colon("a key");
        (key, value)
    }

    fn field(&mut self) -> Field {
        let Some(name) = self.field_name() else { return Field::broken(Span::new(self.at, self.at)) };
        self.blank();
        if !self.eat(b':') {
            self.missing_colon(&format!("`{}`", name.value));
        }
        let value = self.value_behind_colon("a parameter");
        (name, value)
    }

    fn field_name(&mut self) -> Option<Spanned<String>> {
        let start = self.at;
        match name_at(self.text, start) {
            Some(name) if name.raw || !dashed(self.text, name) => {
                self.at = name.end;
                let value = self.text[name.start..name.end].to_owned();
                Some(Spanned { value, span: Span::new(start, name.end) })
            }
            name => self.wrong_field_name(name),
        }
    }

    fn number(&mut self) -> Ron {
        match number(self.rest()) {
            Ok((value, len)) => {
                self.at += len;
                value
            }
            Err(fault) => {
                let end = number_run_end(self.text, self.at);
                let hint = not_a_number_hint(&self.text[self.at..end]);
                let is_remark = &self.text[self.at..end] == "--";
                self.fault(self.at, end, fault.message, hint.map(str::to_owned));
                self.at = end;
                if is_remark {
                    self.at = line_end(self.text, end);
                    self.lose();
                }
                Ron::Broken
            }
        }
    }

    fn number_or_range(&mut self) -> Ron {
        if self.rest().starts_with("..") {
            return self.range_behind(Ron::Range);
        }
        let value = self.number();
        self.range_behind(value)
    }

    /// `value`, or the range that it begins.
    fn range_behind(&mut self, value: Ron) -> Ron {
        if !self.rest().starts_with("..") || matches!(value, Ron::Broken) {
            return value;
        }
        let inclusive = self.rest().starts_with("..=");
        self.at += if inclusive { 3 } else { 2 };
        if let Some((_, len)) = named_float(self.text, self.at) {
            self.at += len;
            return Ron::Range;
        }
        let end = match self.peek() {
            Some(b'0'..=b'9' | b'+' | b'-' | b'.') => self.number(),
            Some(b'b') if self.rest().starts_with("b'") => self.byte_literal(),
            _ if inclusive => {
                self.fault_here("expected a number after `..=`".to_owned());
                Ron::Broken
            }
            _ => Ron::Range,
        };
        if let Ron::Broken = end { Ron::Broken } else { Ron::Range }
    }
}

/// What the author of a number that is none may have meant.
fn not_a_number_hint(literal: &str) -> Option<&'static str> {
    let is_range = |(first, last): (&str, &str)| {
        [first, last].iter().all(|part| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit()))
    };
    match literal {
        _ if literal.starts_with("--") => Some("a comment begins with `//`; a number has one sign"),
        _ if literal.split_once('-').is_some_and(is_range) => Some("frames stand in double quotes: \"1001-1100\""),
        _ => None,
    }
}
