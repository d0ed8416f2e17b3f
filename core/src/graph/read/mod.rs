//! RON text to a tree with spans, and every syntax fault in it.
//!
//! The `ron` crate says what RON is: [`read`] finds no fault exactly where
//! `ron::from_str::<serde::de::IgnoredAny>` succeeds, which a property test holds us to. Ron itself stops at the first
//! fault, keeps no spans for values and no duplicate keys, and is slow where both are wrung from it; a graph's author
//! wants all faults at once, each where it stands.
//!
//! `IgnoredAny` is the arbiter because it is what `RawValue` scans with. `RawValue` refuses two things more, neither of
//! them syntax: a line comment that ends with the text, and the `#![enable(..)]` line. `ron::Value` cannot judge: it
//! drops names. Literals are held to their own range only (`300u8` is a fault, as in ron); the range of a parameter is
//! the checker's business.
//!
//! **Faults.** A fault stands at the token that could not be, and leaves a [`Ron::Broken`] in the innermost bracket it
//! was met in: as the value that could not be read or has something unreadable behind it, or as an entry of its own behind
//! the last one read. So [`has_broken`] of a node's value tells whether that node was read whole, and every other entry
//! is as it was written.
//! Reading resumes at the next entry. A bracket or quote left open is one fault, which names the line it was opened
//! on: the closing bracket met instead tells where reading goes on (see `recover`).
//!
//! **Limits.** Brackets nest as deep as ron lets them: 128 levels, a bracket and its entry being one each. After
//! [`MOST_FAULTS`] faults reading stops.
//!
//! Keys and names may repeat: the tree keeps them all, in order. Ron's number ranges (`0..10`) are read, their bounds
//! not kept. With `#![enable(unwrap_variant_newtypes)]`, what stands in `Some( .. )` counts two levels, where ron
//! counts one or three.

use std::fmt;

mod attributes;
mod lex;
mod lines;
mod numbers;
mod quoted;
mod recover;
#[cfg(test)]
pub(super) mod tests;
mod tokens;
mod tree;

pub use lines::Lines;
pub(super) use tokens::{Token, TokenKind, tokens};

/// A stretch of one source text, in bytes; both ends stand between characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Span {
    /// Offset of the first byte.
    pub start: u32,
    /// Offset behind the last byte.
    pub end: u32,
}

impl Span {
    fn new(start: usize, end: usize) -> Self {
        Span { start: start as u32, end: end as u32 }
    }

    /// The stretch of `text` it means; empty if `text` is not the text it was made for.
    pub fn of(self, text: &str) -> &str {
        text.get(self.start as usize..self.end as usize).unwrap_or("")
    }
}

/// A value and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct Spanned<T> {
    /// The value.
    pub value: T,
    /// Where it stands.
    pub span: Span,
}

/// An integer literal: sign and all 64 bits. `-0` keeps its sign, as ron's decoding into a float does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Int {
    /// Whether a minus stands before it.
    pub negative: bool,
    /// The number without its sign.
    pub magnitude: u64,
}

impl Int {
    /// The number, exactly.
    pub fn value(self) -> i128 {
        let magnitude = i128::from(self.magnitude);
        if self.negative { -magnitude } else { magnitude }
    }

    /// The nearest float.
    pub fn as_f64(self) -> f64 {
        let magnitude = self.magnitude as f64;
        if self.negative { -magnitude } else { magnitude }
    }
}

impl fmt::Display for Int {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}{}", if self.negative { "-" } else { "" }, self.magnitude)
    }
}

/// A RON value as it was written.
#[derive(Debug, Clone, PartialEq)]
pub enum Ron {
    /// `()`
    Unit,
    /// `true` or `false`
    Bool(bool),
    /// An integer, a byte literal (`b'a'`) among them. A decimal one too large for 64 bits is a [`Ron::Float`].
    Int(Int),
    /// A number with a point or an exponent, `inf`, `NaN`.
    Float(f64),
    /// `'x'`
    Char(char),
    /// `"text"` or `r#"text"#`, escapes resolved.
    Text(String),
    /// `b"bytes"` or `br#"bytes"#`, escapes resolved.
    Bytes(Vec<u8>),
    /// A range of numbers, such as `0..10` or `..=5`.
    Range,
    /// A bare name, such as a unit variant or `None`.
    Name(String),
    /// `[ .. ]`
    List(Vec<Spanned<Ron>>),
    /// `{ key: value, .. }`; keys may repeat.
    Map(Vec<(Spanned<Ron>, Spanned<Ron>)>),
    /// `Name(field: value, .. )`, the name being optional; fields may repeat. `Name()` is a struct without fields.
    /// An entry without a readable name has the name `""` and the value [`Ron::Broken`].
    Struct {
        /// What stands before the bracket.
        name: Option<Spanned<String>>,
        /// The fields in file order.
        fields: Vec<(Spanned<String>, Spanned<Ron>)>,
    },
    /// `Name(item, .. )`, the name being optional; `Some(x)` among them. Never without items.
    Tuple {
        /// What stands before the bracket.
        name: Option<Spanned<String>>,
        /// The items in file order.
        items: Vec<Spanned<Ron>>,
    },
    /// Stands where a syntax fault was found.
    Broken,
}

/// One syntax fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The offending token; empty only at the end of the text.
    pub span: Span,
    /// What was found and what was expected.
    pub message: String,
    /// What the author may have meant.
    pub hint: Option<String>,
    /// The bracket that was left open, where that is the fault and `span` is not that bracket.
    pub opened: Option<Span>,
}

/// What [`read`] made of a text.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// The value; none if the text holds nothing that begins one.
    pub tree: Option<Spanned<Ron>>,
    /// All syntax faults in file order.
    pub faults: Vec<Fault>,
}

/// Reading stops after so many faults: a text that is not RON at all has no end of them.
pub const MOST_FAULTS: usize = 1000;

/// Reads a RON text: its tree, and all its syntax faults.
///
/// See the [module](self) for what counts as RON and how reading goes on after a fault. A text of 4 GiB or more is
/// refused. Cost: one pass; a fault may look ahead over a bounded number of tokens.
pub fn read(text: &str) -> Reading {
    if u32::try_from(text.len()).is_err() {
        let message = "this text is too long: 4 GiB or more".to_owned();
        return Reading {
            tree: None,
            faults: vec![Fault { span: Span::new(0, 0), message, hint: None, opened: None }],
        };
    }
    tree::Reader::new(text).document()
}

/// Whether a syntax fault was found in `value`.
pub fn has_broken(value: &Spanned<Ron>) -> bool {
    match &value.value {
        Ron::Broken => true,
        Ron::List(items) | Ron::Tuple { items, .. } => items.iter().any(has_broken),
        Ron::Map(entries) => entries.iter().any(|(key, value)| has_broken(key) || has_broken(value)),
        Ron::Struct { fields, .. } => fields.iter().any(|(_, value)| has_broken(value)),
        _ => false,
    }
}
