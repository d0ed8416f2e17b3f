//! What is said about a fault, and where reading goes on after it.
//!
//! A missing closing bracket shows where another bracket closes, or where the next entry of an enclosing map begins:
//! `"id":` cannot stand in parentheses. Of a closing bracket that does not fit there are three readings: it closes
//! an outer bracket, and the inner ones were left open; it is mistyped for the right one; or it is one too many. The
//! reading that lets the brackets behind it match furthest is taken.

use super::lex::{
    NameAt, SMART_QUOTES, blank_end, char_at, is_blank, is_raw_name_char, name_at, quoted_end, run_end, token_end,
};
use super::lines::Lines;
use super::tree::{Kind, Part, Reader, Trouble};
use super::{Fault, MOST_FAULTS, Ron, Span, Spanned};

/// A look ahead reads so many bytes at most, and a whole text is worth so many of them: garbage costs no more.
const BYTES_AHEAD: usize = 4096;
const LOOK_AHEADS: usize = 10 * MOST_FAULTS;

/// Lines indented further than this (or longer, before their key) tell nothing.
const WIDEST_INDENT: usize = 400;

/// What a closing bracket that does not fit is taken for.
enum Misfit {
    ClosesOuter(usize),
    Mistyped,
    Stray,
}

impl Reader<'_> {
    pub fn fault(&mut self, start: usize, end: usize, message: String, hint: Option<String>) {
        self.marked = true;
        if self.trouble == Trouble::Leave(0) {
            return;
        }
        self.faults.push(Fault { span: Span::new(start, end), message, hint, opened: None });
        if start == self.text.len() || self.faults.len() >= MOST_FAULTS {
            self.trouble = Trouble::Leave(0);
        }
    }

    /// Reports the token at the cursor.
    pub fn fault_here(&mut self, expected: String) {
        let message = format!("{expected}, found {}", self.found(self.at));
        self.fault(self.at, self.token_end(self.at), message, self.hint_here());
    }

    /// Reports that the innermost bracket is not closed before the token at the cursor.
    fn unclosed(&mut self, keep: usize) {
        let Some((at, kind)) = self.open.last().map(|open| (open.at, open.kind)) else { return };
        let (close, bracket, line) = (char::from(kind.close()), kind.open(), self.line(at));
        let found = self.found(self.at);
        let message = format!("expected `{close}` before {found}: the `{bracket}` of line {line} is not closed");
        self.fault(self.at, self.token_end(self.at), message, None);
        if let Some(fault) = self.faults.last_mut() {
            fault.opened = Some(Span::new(at, at + 1));
        }
        self.leave(keep);
    }

    pub fn lose(&mut self) {
        if self.trouble == Trouble::None {
            self.trouble = Trouble::Lost;
        }
    }

    pub fn found_again(&mut self) {
        if self.trouble == Trouble::Lost {
            self.trouble = Trouble::None;
        }
    }

    pub fn leave(&mut self, keep: usize) {
        if self.trouble != Trouble::Leave(0) {
            self.trouble = Trouble::Leave(keep);
        }
    }

    pub fn token_end(&self, at: usize) -> usize {
        token_end(self.text, at)
    }

    fn line(&mut self, at: usize) -> usize {
        let text = self.text;
        self.lines.get_or_insert_with(|| Lines::new(text)).line_of(at as u32)
    }

    /// The token at `at` as messages name it.
    pub fn found(&self, at: usize) -> String {
        let token = &self.text[at..self.token_end(at)];
        let shown: String = token.chars().take_while(|&c| c != '\n').take(40).collect();
        let dots = if shown.len() < token.len() { ".." } else { "" };
        match token.chars().next() {
            None => "the end of the file".to_owned(),
            Some(c) if c.is_control() || c.is_whitespace() || c == '\u{FEFF}' => format!("U+{:04X}", u32::from(c)),
            Some(_) => format!("`{shown}{dots}`"),
        }
    }

    /// What the author may have meant by the token at the cursor.
    fn hint_here(&self) -> Option<String> {
        let before = &self.text[..self.at];
        let word = before.trim_end_matches(is_blank);
        let word = &word[word.trim_end_matches(is_word).len()..];
        let adjacent = before.ends_with(is_word);
        let hint = match char_at(self.text, self.at)? {
            '=' => "a name and its value are joined by `:`",
            ';' => "entries are separated by `,`",
            '#' if self.rest()[1..].starts_with(|c: char| c.is_ascii_hexdigit()) => {
                "a colour is written in numbers, and a comment begins with `//`"
            }
            '#' => "a comment begins with `//`",
            ':' if adjacent && self.rest().starts_with("::") => "a name stands alone, without what leads to it",
            ',' if adjacent && self.rest()[1..].starts_with(|c: char| c.is_ascii_digit()) => {
                "use a decimal point, not a comma"
            }
            '\'' if adjacent && word.starts_with(|c: char| c.is_ascii_digit()) => {
                "digits stand together, or apart by `_`"
            }
            '\u{FEFF}' => "this is a byte order mark: save the file without it",
            c if SMART_QUOTES.contains(&c) => "text stands in straight double quotes: \"..\"",
            c if c.is_whitespace() => "RON does not take this for white space: write a plain space",
            c if adjacent
                && word.starts_with(|c: char| c.is_ascii_digit())
                && (c.is_alphabetic() || "%°".contains(c)) =>
            {
                "a number carries no unit"
            }
            '/' | '*' if adjacent && word.starts_with(|c: char| c.is_ascii_digit()) => {
                "nothing is computed here: write the number itself"
            }
            _ if self.glued() => "a `\"` is missing before this, or is one too many",
            '{' | '[' if adjacent => "what belongs to a name stands in parentheses: Name(..)",
            '.' | '/' | '-' | '\\' | '*' | '$' if adjacent => {
                "text stands in double quotes; a name is one word of letters, digits and `_`"
            }
            c if is_word(c) && !c.is_ascii_digit() && word.starts_with(char::is_alphabetic) => {
                "text stands in double quotes, and what belongs to a name in parentheses: Name(..)"
            }
            _ => return None,
        };
        Some(hint.to_owned())
    }

    pub fn at_end_or_closing(&self) -> bool {
        matches!(self.peek(), None | Some(b')' | b']' | b'}'))
    }

    /// At the end of the text, or at a closing bracket that is not the innermost one's.
    pub fn wrong_end(&mut self) {
        let Some(found) = self.peek() else { return self.never_closed() };
        match self.judge(found) {
            Misfit::ClosesOuter(keep) => self.unclosed(keep),
            Misfit::Mistyped => {
                let Some((at, kind)) = self.open.last().map(|open| (open.at, open.kind)) else { return };
                let (close, bracket, line) = (char::from(kind.close()), kind.open(), self.line(at));
                self.fault_here(format!("expected `{close}` to close the `{bracket}` of line {line}"));
                self.at += 1;
                self.leave(self.open.len() - 1);
            }
            Misfit::Stray => {
                self.stray(found);
                self.leave(self.open.len());
            }
        }
    }

    fn stray(&mut self, closing: u8) {
        let message = format!("this `{}` closes nothing", char::from(closing));
        self.fault(self.at, self.at + 1, message, None);
        self.at += 1;
    }

    /// Behind the text's one value, where nothing may stand.
    pub fn trailing(&mut self) {
        match self.peek() {
            None => {}
            Some(closing @ (b')' | b']' | b'}')) => self.stray(closing),
            Some(_) => self.fault_here("expected nothing more".to_owned()),
        }
    }

    fn never_closed(&mut self) {
        let Some((at, kind)) = self.open.last().map(|open| (open.at, open.kind)) else { return };
        let message = format!("this `{}` is never closed", kind.open());
        self.fault(at, at + 1, message, Some(format!("write the closing `{}`", char::from(kind.close()))));
        self.leave(0);
    }

    /// At a token that neither separates entries nor closes the bracket.
    pub fn missing_separator(&mut self) {
        let Some((kind, entry)) = self.open.last().map(|open| (open.kind, open.entry)) else { return };
        if let Some((at, keep)) = self.unclosed_before(kind, entry) {
            self.at = at;
            return self.unclosed(keep);
        }
        let close = char::from(kind.close());
        self.fault_here(format!("expected `,` or `{close}` after this value"));
        let hint = match kind {
            Kind::Tuple => "either every entry has a name or none has",
            Kind::List => "names with values stand in braces: {\"name\": value}",
            _ => "",
        };
        if let (Some(b':'), Some(fault), false) = (self.peek(), self.faults.last_mut(), hint.is_empty()) {
            fault.hint = Some(hint.to_owned());
        }
        if self.peek() == Some(b';') {
            self.at += 1;
        } else if self.glued() || !self.entry_starts(kind) {
            self.lose();
        }
    }

    /// Where an outer bracket's entry begins instead of the innermost one's separator, and how many brackets hold it.
    fn unclosed_before(&mut self, kind: Kind, entry: usize) -> Option<(usize, usize)> {
        let innermost = self.open.len() - 1;
        let colon = self.peek() == Some(b':');
        let at = if colon && kind != Kind::Map && self.last_text >= entry { self.last_text } else { self.at };
        if let Some(keep) = self.outer_entry(at).filter(|&keep| keep <= innermost) {
            return Some((at, keep));
        }
        let outer_is_struct = innermost > 0 && self.open[innermost - 1].kind == Kind::Struct;
        let field = colon && outer_is_struct && matches!(kind, Kind::Tuple | Kind::List) && self.field_starts(entry);
        let closes = field && self.matches_until(innermost) > self.matches_until(innermost + 1);
        closes.then_some((entry, innermost))
    }

    /// Whether a word and a quote touch at the cursor: another quote is missing, and what is text here cannot be told.
    fn glued(&self) -> bool {
        let (before, rest) = (&self.text[..self.at], self.rest());
        before.ends_with('"') && rest.starts_with(is_word) || before.ends_with(is_word) && rest.starts_with('"')
    }

    fn entry_starts(&self, kind: Kind) -> bool {
        match kind {
            Kind::Struct => self.field_starts(self.at),
            Kind::Map if self.peek() != Some(b'"') && !self.starts_line(self.at) => false,
            Kind::Map => colon_behind(self.text, self.token_end(self.at)).is_some(),
            _ => self.value_starts(),
        }
    }

    fn value_starts(&self) -> bool {
        let first = self.peek();
        name_at(self.text, self.at).is_some()
            || first.is_some_and(|first| first.is_ascii_digit() || b"\"'([{+-.rb".contains(&first))
    }

    /// At something else than the `:` that must stand behind `what`; a value there, or behind a `=`, can still be read.
    pub fn missing_colon(&mut self, what: &str) {
        self.fault_here(format!("expected `:` after {what}"));
        if let Some(other) = ["=>", "="].iter().find(|other| self.rest().starts_with(**other)) {
            self.at += other.len();
        } else if self.glued() || !self.value_starts() && !self.rest().starts_with(',') && !self.at_end_or_closing() {
            self.lose();
        }
    }

    /// The `=` of a `:=`, at the cursor.
    fn colon_equals(&mut self) {
        if self.text[..self.at].ends_with(':') && self.peek() == Some(b'=') {
            self.fault_here("expected a value".to_owned());
            self.at += 1;
            self.blank();
        }
    }

    /// The value behind a `:`, which is `Broken` if a fault was met before it.
    pub fn value_behind_colon(&mut self, whose: &str) -> Spanned<Ron> {
        let start = self.at;
        self.colon_equals();
        self.blank();
        if self.trouble != Trouble::None {
            return self.broken_here();
        }
        let ends = self.at_end_or_closing() || self.peek() == Some(b',');
        if ends && self.marked {
            return self.broken_here();
        }
        if ends {
            self.fault_here(format!("{whose} needs a value after `:`"));
            self.lose();
            return self.broken_here();
        }
        if self.next_entry_on_new_line(start) {
            if let Some(keep) = self.outer_entry(self.at) {
                self.fault_here(format!("{whose} needs a value after `:`"));
                self.leave(keep);
                return self.broken_here();
            }
            self.fault_here("expected `{`".to_owned());
            self.marked = false;
            let map = self.map_without_brace();
            self.marked = true;
            return map;
        }
        let marked = std::mem::take(&mut self.marked);
        let value = self.value();
        self.marked |= marked;
        value
    }

    pub fn broken_here(&mut self) -> Spanned<Ron> {
        self.marked = false;
        Spanned::broken(Span::new(self.at, self.at))
    }

    /// Whether a line break behind `start` and then a text with a `:` make the token at the cursor the next entry.
    fn next_entry_on_new_line(&self, start: usize) -> bool {
        self.peek() == Some(b'"')
            && self.text[start..self.at].contains('\n')
            && colon_behind(self.text, self.token_end(self.at)).is_some()
    }

    /// At something that is no field's name, though a field must begin here.
    pub fn wrong_field_name(&mut self, name: Option<NameAt>) -> Option<Spanned<String>> {
        let start = self.at;
        if let Some(name) = name {
            let end = run_end(self.text, name.end, is_raw_name_char);
            let value = self.text[start..end].to_owned();
            let hint = Some("a name is one word of letters, digits and `_`".to_owned());
            self.fault(start, end, format!("`{value}` is not a name"), hint);
            self.at = end;
            return Some(Spanned { value, span: Span::new(start, end) });
        }
        if self.peek() == Some(b'"') && self.field_starts(start) {
            if let Some(keep) = self.outer_entry(start) {
                self.unclosed(keep);
                return None;
            }
            let end = self.token_end(start);
            let value = self.text[start..end].trim_matches('"').to_owned();
            let outside = self.open.last().map_or("", |open| self.text[..open.at].trim_end());
            let hint = match outside.ends_with(|c: char| c.is_alphanumeric() || c == '_') {
                true => format!("write {value}: .."),
                false => format!("write {value}: .., or put quoted names in braces: {{ \"{value}\": .. }}"),
            };
            self.fault(start, end, "a parameter's name stands without quotes".to_owned(), Some(hint));
            self.at = end;
            return Some(Spanned { value, span: Span::new(start, end) });
        }
        self.fault_here("expected a parameter's name".to_owned());
        self.hint_decimal_comma();
        self.lose();
        None
    }

    /// `1,5` reads as two entries, the second of which has no name.
    fn hint_decimal_comma(&mut self) {
        let before = &self.text.as_bytes()[..self.at];
        let comma = matches!(before, [.., b'0'..=b'9', b',']) && self.peek().is_some_and(|byte| byte.is_ascii_digit());
        if let (true, Some(fault)) = (comma, self.faults.last_mut()) {
            fault.hint = Some("use a decimal point, not a comma".to_owned());
        }
    }

    /// Goes to where the innermost bracket's next entry can be read; false if the bracket ends here instead.
    pub fn recover(&mut self) -> bool {
        if self.trouble == Trouble::Lost {
            self.trouble = Trouble::None;
            self.skip_entry();
        }
        match self.trouble {
            Trouble::Leave(keep) if keep < self.open.len() => return false,
            _ => self.trouble = Trouble::None,
        }
        self.blank();
        self.eat(b',');
        self.trouble == Trouble::None
    }

    /// Skips to a comma, a closing bracket or a line that begins an entry; silently, for the fault is reported.
    fn skip_entry(&mut self) {
        let Some((kind, entry)) = self.open.last().map(|open| (open.kind, open.entry)) else { return };
        let mut inner = Vec::new();
        loop {
            self.blank();
            let Some(found) = self.peek() else { return self.leave(0) };
            if self.at > entry && self.starts_line(self.at) {
                if let Some(keep) = self.outer_entry(self.at) {
                    return self.leave(keep);
                }
                if inner.is_empty() && kind == Kind::Struct && self.field_starts(self.at) {
                    return;
                }
            }
            match found {
                b'(' => inner.push(b')'),
                b'[' => inner.push(b']'),
                b'{' => inner.push(b'}'),
                b',' if inner.is_empty() => return,
                b')' | b']' | b'}' => match inner.iter().rposition(|&close| close == found) {
                    Some(index) => inner.truncate(index),
                    None if found == kind.close() => return,
                    None => match self.judge(found) {
                        Misfit::ClosesOuter(keep) => return self.leave(keep),
                        Misfit::Mistyped => {
                            self.at += 1;
                            return self.leave(self.open.len() - 1);
                        }
                        Misfit::Stray => {}
                    },
                },
                _ => {}
            }
            self.at = self.token_end(self.at);
        }
    }

    fn judge(&mut self, found: u8) -> Misfit {
        let innermost = self.open.len() - 1;
        let outer = self.open[..innermost].iter().rposition(|open| open.kind.close() == found);
        let mistyped = self.matches_until(innermost);
        let stray = self.matches_until(innermost + 1);
        match outer {
            Some(index) if self.matches_until(index) >= mistyped.max(stray) => Misfit::ClosesOuter(index + 1),
            _ if mistyped >= stray => Misfit::Mistyped,
            _ => Misfit::Stray,
        }
    }

    /// How far the brackets behind the one at the cursor match, so many of the open ones being open there.
    fn matches_until(&mut self, keep: usize) -> usize {
        self.look_aheads += 1;
        if self.look_aheads > LOOK_AHEADS {
            return self.at;
        }
        let mut awaited: Vec<u8> = self.open[..keep].iter().map(|open| open.kind.close()).collect();
        let text = &self.text[..self.text.floor_char_boundary(self.at + BYTES_AHEAD)];
        let mut at = self.at + 1;
        loop {
            at = blank_end(text, at).unwrap_or(text.len());
            let Some(&found) = text.as_bytes().get(at) else {
                let all_match = awaited.is_empty() && text.len() == self.text.len();
                return if all_match { usize::MAX } else { at };
            };
            match found {
                _ if awaited.is_empty() => return at,
                b'(' => awaited.push(b')'),
                b'[' => awaited.push(b']'),
                b'{' => awaited.push(b'}'),
                b')' | b']' | b'}' if awaited.pop() != Some(found) => return at,
                b'"' if awaited.last() != Some(&b'}')
                    && self.starts_line(at)
                    && colon_behind(text, token_end(text, at)).is_some() =>
                {
                    return at;
                }
                _ => {}
            }
            at = token_end(text, at);
        }
    }

    /// How many of the open brackets hold the map entry that begins at `at`; none if no map's entry begins there.
    ///
    /// At the start of a line, it is the outermost map whose entry at hand is indented as far or further. Within a
    /// line, where only a field could stand, it is the innermost map if a node follows.
    fn outer_entry(&self, at: usize) -> Option<usize> {
        if !self.text[at..].starts_with('"') {
            return None;
        }
        let quoted = quoted_end(self.text, at);
        let colon = colon_behind(self.text, quoted.end).filter(|_| quoted.closed)?;
        if self.starts_line(at) {
            let column = self.column(at)?;
            let holds = |entry: usize| self.column(entry).is_some_and(|key| column <= key);
            return self
                .open
                .iter()
                .position(|open| open.kind == Kind::Map && holds(open.entry))
                .map(|index| index + 1);
        }
        let innermost = self.open.last().filter(|open| open.kind != Kind::Map)?;
        let is_first = blank_end(self.text, innermost.at + 1) == Ok(at);
        let value = blank_end(self.text, colon + 1).ok()?;
        let behind_name = name_at(self.text, value).and_then(|name| blank_end(self.text, name.end).ok())?;
        if is_first || !self.text[behind_name..].starts_with('(') {
            return None;
        }
        self.open.iter().rposition(|open| open.kind == Kind::Map).map(|index| index + 1)
    }

    fn starts_line(&self, at: usize) -> bool {
        let before = &self.text[..at];
        before.trim_end_matches(|c| c != '\n' && is_blank(c)).ends_with('\n')
    }

    /// Bytes between the line's start and `at`.
    fn column(&self, at: usize) -> Option<usize> {
        let before = self.text[..at].bytes().rev().take(WIDEST_INDENT + 1);
        let column = before.take_while(|&byte| byte != b'\n').count();
        (column <= WIDEST_INDENT).then_some(column)
    }
}

/// Where the `:` stands behind a token that ends at `end`.
fn colon_behind(text: &str, end: usize) -> Option<usize> {
    blank_end(text, end).ok().filter(|&colon| text[colon..].starts_with(':'))
}

fn is_word(c: char) -> bool {
    c == '_' || c.is_alphanumeric()
}
