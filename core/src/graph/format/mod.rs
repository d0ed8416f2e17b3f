//! A graph file in the house's form: white space, line breaks and commas behind the last entry change, nothing else.
//!
//! Every comment stays, in its order, and every literal as it was written. The form is a function of the tokens, of
//! which of them begin a line, and of blank lines, of which one stays; formatting again changes nothing.
//!
//! - An entry of a map, such as a node, has a line of its own. Values stand in a column within a block of entries
//!   between blank lines, comments behind entries in another.
//! - A bracket stays on its line if it fits and its author did not begin a new line behind it. Otherwise each parameter
//!   gets a line; items of lists and tuples stay beside those they stood beside, as far as there is room.
//! - A text keeps its own line ends: that of its last line.

mod layout;
#[cfg(test)]
mod tests;
mod tree;

use std::path::Path;

use super::read::{self, TokenKind, tokens};
use super::source::{At, Sources};
use crate::diag::{Code, Fault};

/// The text of a graph file in the house's form; its syntax faults, if it has any. What the text means is not checked.
///
/// `file` names the text in faults. Cost: a few passes over the text.
pub fn format(file: &Path, text: &str) -> Result<String, Vec<Fault>> {
    let reading = read::read(text);
    if !reading.faults.is_empty() {
        let mut sources = Sources::default();
        let source = sources.add(file, text);
        let place = |fault: read::Fault| {
            let found = Fault::new(Code::Syntax, fault.message).hint(fault.hint);
            found.place(Some(sources.place(At { source, span: fault.span })))
        };
        return Err(reading.faults.into_iter().map(place).collect());
    }
    let formatted = layout::lay_out(&tree::document(text), line_end(text));
    // Somebody's file is about to be replaced.
    assert!(same_tokens(text, &formatted), "formatting would change what the text says");
    Ok(formatted)
}

/// What ends the lines of `text`: what ends its last, or else its first. (The first may end within a literal.)
fn line_end(text: &str) -> &'static str {
    let at = if text.ends_with('\n') { text.len() - 1 } else { text.find('\n').unwrap_or_default() };
    if text[..at].ends_with('\r') { "\r\n" } else { "\n" }
}

/// Whether two texts differ in white space and commas only, and both can be read.
fn same_tokens(before: &str, after: &str) -> bool {
    fn said(text: &str) -> impl Iterator<Item = (TokenKind, &str)> {
        tokens(text).filter(|token| token.kind != TokenKind::Comma).map(|token| (token.kind, token.text))
    }
    read::read(after).faults.is_empty() && said(before).eq(said(after))
}
