//! The lines a RON text may begin with: `#![enable(..)]`, and `#![type = ".."]` and `#![schema = ".."]`, which say
//! nothing to us.

use super::Ron;
use super::lex::{dashed, line_end, name_at, word_at};
use super::tree::Reader;

/// The extensions that change what a text may say; ron knows two more, which change only what it is decoded into.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Extensions {
    pub implicit_some: bool,
    pub unwrap_variant_newtypes: bool,
}

impl Reader<'_> {
    /// Reads all attributes; after a fault it goes on behind the attribute's `]`, or at the next line.
    pub(super) fn attributes(&mut self) {
        self.blank();
        while self.rest().starts_with('#') {
            if self.attribute().is_none() {
                self.skip_attribute();
            }
            self.blank();
        }
    }

    fn attribute(&mut self) -> Option<()> {
        if !self.rest().starts_with("#!") && !self.rest()[1..].trim_start().starts_with('!') {
            let (start, end) = (self.at, self.token_end(self.at));
            let hint = Some("a comment begins with `//`".to_owned());
            self.fault(start, end, format!("expected a graph, found {}", self.found(start)), hint);
            self.at = end;
            return None;
        }
        for mark in ["#", "!", "["] {
            self.expect(mark)?;
        }
        self.blank();
        let word = ["enable", "type", "schema"].into_iter().find(|word| word_at(self.text, self.at, word));
        let Some(word) = word else { return self.expected("`enable`, `type` or `schema`") };
        self.at += word.len();
        if word == "enable" {
            self.expect("(")?;
            self.extension_names()?;
            self.expect(")")?;
        } else {
            self.expect("=")?;
            self.blank();
            if !self.rest().starts_with(['"', 'r']) {
                return self.expected("a text in double quotes");
            }
            if let Ron::Broken = self.text_literal() {
                return None;
            }
        }
        self.expect("]")
    }

    /// One or more names, a comma behind the last allowed.
    fn extension_names(&mut self) -> Option<()> {
        loop {
            self.blank();
            let name = name_at(self.text, self.at).filter(|name| name.raw || !dashed(self.text, *name));
            match name.map(|name| &self.text[name.start..name.end]) {
                Some("implicit_some") => self.extensions.implicit_some = true,
                Some("unwrap_variant_newtypes") => self.extensions.unwrap_variant_newtypes = true,
                Some("unwrap_newtypes" | "explicit_struct_names") => {}
                _ => return self.expected("a RON extension: `implicit_some`, `unwrap_newtypes` or another"),
            }
            self.at = name.map_or(self.at, |name| name.end);
            self.blank();
            let more = self.eat(b',');
            self.blank();
            if !more || self.rest().starts_with(')') {
                return Some(());
            }
        }
    }

    fn expect(&mut self, mark: &str) -> Option<()> {
        self.blank();
        if !self.rest().starts_with(mark) {
            return self.expected(&format!("`{mark}`"));
        }
        self.at += mark.len();
        Some(())
    }

    fn expected(&mut self, what: &str) -> Option<()> {
        self.fault_here(format!("expected {what}"));
        None
    }

    fn skip_attribute(&mut self) {
        let line_end = line_end(self.text, self.at);
        self.at = self.text[self.at..line_end].find(']').map_or(line_end, |len| self.at + len + 1);
        self.found_again();
    }
}
