//! Byte offsets to lines and columns.

/// The line starts of one text. Lines end at `\n`.
#[derive(Debug, Clone)]
pub struct Lines<T> {
    text: T,
    starts: Vec<u32>,
}

impl<T: AsRef<str>> Lines<T> {
    /// Finds the line starts of `text` (at most 4 GiB long). Cost: one pass over the text.
    pub fn new(text: T) -> Self {
        let ends = text.as_ref().bytes().enumerate().filter(|&(_, byte)| byte == b'\n');
        let starts = std::iter::once(0).chain(ends.map(|(at, _)| at as u32 + 1)).collect();
        Lines { text, starts }
    }

    /// How many lines there are; an empty text has one.
    pub fn count(&self) -> usize {
        self.starts.len()
    }

    /// Line and column of the byte at `offset`, both counted from 1, the column in characters.
    /// An offset past the end means the end; one inside a character means that character.
    pub fn position(&self, offset: u32) -> (usize, usize) {
        let line = self.line_of(offset);
        let start = self.starts[line - 1] as usize;
        let before = &self.text.as_ref().as_bytes()[start..self.text.as_ref().len().min(offset as usize)];
        let inside = !self.text.as_ref().is_char_boundary(start + before.len());
        (line, 1 + before.iter().filter(|&&byte| byte & 0xC0 != 0x80).count() - usize::from(inside))
    }

    /// The line of the byte at `offset`, counted from 1.
    pub(super) fn line_of(&self, offset: u32) -> usize {
        self.starts.partition_point(|&start| start <= offset)
    }

    /// The text of a line counted from 1, without its line end; empty for a line that is not there.
    pub fn line(&self, line: usize) -> &str {
        let Some(&start) = line.checked_sub(1).and_then(|index| self.starts.get(index)) else { return "" };
        let rest = &self.text.as_ref()[start as usize..];
        let Some(&next) = self.starts.get(line) else { return rest };
        let text = &rest[..(next - start) as usize - 1];
        text.strip_suffix('\r').unwrap_or(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_characters() {
        let text = "a\r\nänder: \"日本\"\n\nend";
        let lines = Lines::new(text);
        assert_eq!(lines.count(), 4);
        assert_eq!(lines.position(0), (1, 1));
        assert_eq!(lines.position(text.find('日').unwrap_or(0) as u32), (2, 9));
        assert_eq!(lines.position(text.find('日').unwrap_or(0) as u32 + 2), (2, 9));
        assert_eq!(lines.position(text.find('本').unwrap_or(0) as u32), (2, 10));
        assert_eq!(lines.position(text.len() as u32), (4, 4));
        assert_eq!(lines.position(u32::MAX), (4, 4));
        assert_eq!(["", "a", "änder: \"日本\"", "", "end", ""], [0, 1, 2, 3, 4, 5].map(|line| lines.line(line)));
    }

    /// A column may stand behind the line's last character, and no farther.
    #[test]
    fn a_return_without_a_newline_ends_no_line() {
        let lines = Lines::new("a\r\nb\r");
        assert_eq!((lines.line(1), lines.line(2), lines.position(5)), ("a", "b\r", (2, 3)));
    }

    #[test]
    fn the_newline_belongs_to_its_line() {
        let lines = Lines::new("ab\ncd\n");
        assert_eq!([0, 2, 3, 5, 6].map(|at| lines.position(at)), [(1, 1), (1, 3), (2, 1), (2, 3), (3, 1)]);
    }
}
