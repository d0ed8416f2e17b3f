//! Labels painted from bits.

use super::lanes::{Lanes, WORD, Work};
use super::runs::with_left;
use crate::view::ViewMut;

/// For each byte of bits, which of its runs, counted from 1, each pixel lies in, 0 if in none.
const RUN_IN_BYTE: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut byte = 0;
    while byte < 256 {
        let (mut x, mut run) = (0, 0);
        while x < 8 {
            let set = byte >> x & 1 == 1;
            if set && (x == 0 || byte >> (x - 1) & 1 == 0) {
                run += 1;
            }
            table[byte][x] = if set { run } else { 0 };
            x += 1;
        }
        byte += 1;
    }
    table
};

/// Paints rows that begin with the names of their runs.
pub(super) struct Paint<'a> {
    /// Of the rows.
    pub(super) bits: &'a [u64],
    /// Of each name.
    pub(super) labels: &'a [u32],
    pub(super) out: ViewMut<'a, u32>,
}

impl Work for Paint<'_> {
    type Result = ();

    #[inline(always)]
    fn with<L: Lanes>(mut self, lanes: L) {
        let width = self.out.width();
        // The label of run n at n + 2, with room for eight from any run on.
        let mut labels = vec![0; width / 2 + 11];
        for (y, bits) in self.bits.chunks(width.div_ceil(WORD)).enumerate() {
            let row = self.out.row_mut(y);
            let runs: u32 = with_left(bits).map(|(word, left)| (word & !left).count_ones()).sum();
            for (label, &name) in labels[2..].iter_mut().zip(&row[..runs as usize]) {
                *label = self.labels[name as usize];
            }
            paint_row(lanes, bits, &labels, row);
        }
    }
}

/// Paints a row; `labels` are those of its runs from the third on, with room for eight from any run on.
#[inline(always)]
fn paint_row<L: Lanes>(lanes: L, bits: &[u64], labels: &[u32], row: &mut [u32]) {
    let (words, rest) = row.as_chunks_mut::<WORD>();
    let (mut words, mut runs) = (words.iter_mut(), 0);
    for (word, left) in with_left(bits) {
        let labels = &labels[runs..];
        if let Some(pixels) = words.next() {
            runs += paint_word(lanes, word, left, labels, pixels);
        } else {
            let mut pixels = [0; WORD];
            paint_word(lanes, word, left, labels, &mut pixels);
            rest.copy_from_slice(&pixels[..rest.len()]);
        }
    }
}

/// Paints the pixels of a word; of `labels`, the second is that of the last run that began before it, and those of the runs
/// that begin in it follow. Gives their count.
#[inline(always)]
fn paint_word<L: Lanes>(lanes: L, word: u64, left: u64, labels: &[u32], pixels: &mut [u32; WORD]) -> usize {
    let starts = word & !left;
    let mut runs = 0;
    for (index, pixels) in pixels.as_chunks_mut::<8>().0.iter_mut().enumerate() {
        let at = |bits: u64| (bits >> (8 * index)) as u8;
        // One before the label of the first run in the byte, which may have begun before.
        let first = runs + 1 - usize::from(at(word & left) & 1);
        let labels = labels[first..].first_chunk().expect("there is room");
        *pixels = lanes.pick(*labels, RUN_IN_BYTE[usize::from(at(word))]);
        runs += at(starts).count_ones() as usize;
    }
    runs
}
