//! The texts a graph is made of: its file, and the flags that change it.

use std::path::{Path, PathBuf};

use super::read::{Lines, Span};
use crate::diag::Place;

/// A stretch of one of the texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct At {
    /// Number of the text.
    pub source: u32,
    /// The stretch.
    pub span: Span,
}

/// Characters of a long line that a place shows.
const WINDOW: usize = 240;

/// The part of a line to show around its character number `at`, and how many characters are cut off before it.
fn window(line: &str, at: usize) -> (usize, String) {
    if line.len() <= WINDOW {
        return (0, line.to_owned());
    }
    let cut = at.saturating_sub(WINDOW / 3);
    (cut, line.chars().skip(cut).take(WINDOW).collect())
}

/// The texts, by number; the graph file is number 0.
#[derive(Debug, Default)]
pub struct Sources {
    list: Vec<(PathBuf, Lines<String>)>,
}

impl Sources {
    /// Adds a text under the name that places show; gives its number.
    pub fn add(&mut self, name: &Path, text: &str) -> u32 {
        self.list.push((name.to_owned(), Lines::new(text.to_owned())));
        self.list.len() as u32 - 1
    }

    /// File, line and column of a stretch.
    pub fn place(&self, at: At) -> Place {
        let (name, lines) = &self.list[at.source as usize];
        let (line, column) = lines.position(at.span.start);
        let (end_line, end_column) = lines.position(at.span.end);
        let text = lines.line(line);
        let end = if end_line == line { end_column } else { text.chars().count() + 1 };
        let (cut, text) = window(text, column - 1);
        let length = end.saturating_sub(column).min(WINDOW);
        Place { file: name.clone(), line, column, length, text, cut }
    }
}
