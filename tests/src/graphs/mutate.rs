//! Slips of the hand, and of the disk.

use crate::Random;

/// Tokens, roughly: words, texts, numbers, single signs.
fn tokens(text: &str) -> Vec<std::ops::Range<usize>> {
    let mut found: Vec<std::ops::Range<usize>> = Vec::new();
    let is_word = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
    for (at, c) in text.char_indices() {
        let before = text[..at].chars().next_back();
        match found.last_mut() {
            Some(last) if is_word(c) && before.is_some_and(is_word) => last.end = at + c.len_utf8(),
            _ if c.is_whitespace() => {}
            _ => found.push(at..at + c.len_utf8()),
        }
    }
    found
}

/// One to three tokens deleted, doubled, replaced by another or moved.
pub fn token_mutation(text: &str, random: &mut Random) -> String {
    let mut text = text.to_owned();
    for _ in 0..1 + random.below(3) {
        let tokens = tokens(&text);
        if tokens.is_empty() {
            break;
        }
        let (at, other) = (random.pick(&tokens).clone(), random.pick(&tokens).clone());
        let foreign =
            *random.pick(&["NaN", "\"", "Keys([(1, 2)])", "'", "(", "[", "{", "}", ",", "-1e400", "Some(1)", "é"]);
        let other = text[other].to_owned();
        match random.below(5) {
            0 => text.replace_range(at, ""),
            1 => text.insert_str(at.end, &other),
            2 => text.replace_range(at, &other),
            3 => text.insert_str(at.start, foreign),
            _ => text.replace_range(at, foreign),
        }
    }
    text
}

/// One to three bytes deleted, inserted, replaced or doubled; what is no UTF-8 then becomes a sign of its own.
pub fn byte_mutation(text: &str, random: &mut Random) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..1 + random.below(3) {
        let at = random.below(bytes.len().max(1)).min(bytes.len().saturating_sub(1));
        match random.below(4) {
            0 => drop(bytes.remove(at)),
            1 => bytes.insert(at, random.next() as u8),
            2 => bytes[at] = random.next() as u8,
            _ => {
                let end = (at + 1 + random.below(20)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
