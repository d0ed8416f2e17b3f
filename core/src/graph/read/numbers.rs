//! Number literals, exactly as ron reads them: an integer that fits 64 bits keeps all its digits, a larger decimal
//! one becomes a float, and a suffix (`300u8`) holds the literal to its range.

use std::ops::RangeInclusive;

use super::lex::{run_end, word_at};
use super::{Int, Ron};

/// Why a literal is no number: how far it was read, and what to say.
#[derive(Debug)]
pub(super) struct NotANumber {
    read: usize,
    pub message: String,
}

/// Reads the number that begins `literal`; returns it with its length.
pub(super) fn number(literal: &str) -> Result<(Ron, usize), NotANumber> {
    if is_float(literal) {
        return float(literal).ok_or_else(|| malformed(literal, 0));
    }
    integer(literal).or_else(|fault| match float(literal) {
        Some((value, len)) if len >= fault.read => Ok((value, len)),
        _ => Err(fault),
    })
}

/// `inf` and `NaN`, with or without a suffix, as names at `at`.
pub(super) fn named_float(text: &str, at: usize) -> Option<(f64, usize)> {
    let names = [("inf", f64::INFINITY), ("NaN", f64::NAN)];
    let (name, value) = names.into_iter().find(|(name, _)| text[at..].starts_with(name))?;
    let suffix = ["", "f32", "f64"].into_iter().find(|suffix| word_at(text, at + name.len(), suffix))?;
    Some((value, name.len() + suffix.len()))
}

fn malformed(literal: &str, read: usize) -> NotANumber {
    let shown = &literal[..super::lex::number_run_end(literal, 0)];
    NotANumber { read, message: format!("`{shown}` is not a number") }
}

/// The letters of a number are also those of `e` exponents and `f32` suffixes: whichever reads on further decides.
fn is_float(literal: &str) -> bool {
    let start = usize::from(literal.starts_with(['+', '-']));
    float_run_end(literal, start) > run_end(literal, start, is_int_char)
}

fn is_int_char(c: char) -> bool {
    c.is_ascii_hexdigit() || c == '_'
}

/// End of the characters of a float; `..` belongs to a range.
fn float_run_end(literal: &str, start: usize) -> usize {
    let end = run_end(literal, start, |c| c.is_ascii_digit() || matches!(c, 'e' | 'E' | '.' | '+' | '-' | '_'));
    literal[start..end].find("..").map_or(end, |len| start + len)
}

fn float(literal: &str) -> Option<(Ron, usize)> {
    let sign = usize::from(literal.starts_with(['+', '-']));
    if let Some((value, len)) = named_float(literal, sign) {
        let value = if literal.starts_with('-') { -value } else { value };
        return Some((Ron::Float(value), sign + len));
    }
    let end = float_run_end(literal, 0);
    let digits = without_underscores(&literal[..end])?;
    if word_at(literal, end, "f32") {
        return Some((Ron::Float(digits.parse::<f32>().ok()?.into()), end + 3));
    }
    let suffix = if word_at(literal, end, "f64") { 3 } else { 0 };
    Some((Ron::Float(digits.parse().ok()?), end + suffix))
}

/// An underscore must follow a digit, an exponent's letter or another underscore.
fn without_underscores(digits: &str) -> Option<std::borrow::Cow<'_, str>> {
    if !digits.contains('_') {
        return Some(digits.into());
    }
    let mut allowed = false;
    for c in digits.chars() {
        match c {
            '_' if !allowed => return None,
            '0'..='9' | 'e' | 'E' => allowed = true,
            '.' => allowed = false,
            _ => {}
        }
    }
    Some(digits.replace('_', "").into())
}

fn integer(literal: &str) -> Result<(Ron, usize), NotANumber> {
    let negative = literal.starts_with('-');
    let sign = usize::from(literal.starts_with(['+', '-']));
    let bases = [("0b", 2), ("0o", 8), ("0x", 16)];
    let prefixed = bases.into_iter().find(|(prefix, _)| literal[sign..].starts_with(prefix));
    let (start, base) = prefixed.map_or((sign, 10), |(_, base)| (sign + 2, base));
    let end = run_end(literal, start, is_int_char);
    let (suffix, range) = match suffix_at(literal, end) {
        Some(bits) => bits,
        None if negative => ("", i64::MIN.into()..=i64::MAX.into()),
        None => ("", 0..=u64::MAX.into()),
    };
    let most = if negative { range.start().unsigned_abs() } else { range.end().unsigned_abs() };
    let len = end + suffix.len();
    if end == start || literal[start..].starts_with('_') {
        return Err(malformed(literal, start));
    }
    let magnitude = magnitude(&literal[start..end], base, most).map_err(|fault| match fault {
        NoMagnitude::Digit(at) => malformed(literal, start + at),
        NoMagnitude::TooLarge => too_large(&literal[..len], suffix),
    })?;
    Ok((Ron::Int(Int { negative, magnitude: magnitude as u64 }), len))
}

fn too_large(literal: &str, suffix: &str) -> NotANumber {
    let kind = if suffix.is_empty() { "an integer of 64 bits" } else { suffix };
    NotANumber { read: literal.len(), message: format!("`{literal}` does not fit {kind}") }
}

/// The integer type named at `at`, with its range.
fn suffix_at(literal: &str, at: usize) -> Option<(&'static str, RangeInclusive<i128>)> {
    let suffixes = [
        ("i8", i8::MIN.into()..=i8::MAX.into()),
        ("i16", i16::MIN.into()..=i16::MAX.into()),
        ("i32", i32::MIN.into()..=i32::MAX.into()),
        ("i64", i64::MIN.into()..=i64::MAX.into()),
        ("u8", 0..=u8::MAX.into()),
        ("u16", 0..=u16::MAX.into()),
        ("u32", 0..=u32::MAX.into()),
        ("u64", 0..=u64::MAX.into()),
    ];
    if !literal[at..].starts_with(['i', 'u']) {
        return None;
    }
    suffixes.into_iter().find(|(suffix, _)| word_at(literal, at, suffix))
}

enum NoMagnitude {
    Digit(usize),
    TooLarge,
}

fn magnitude(digits: &str, base: u32, most: u128) -> Result<u128, NoMagnitude> {
    let mut magnitude = 0;
    for (at, c) in digits.char_indices().filter(|&(_, c)| c != '_') {
        if magnitude * u128::from(base) > most {
            return Err(NoMagnitude::TooLarge);
        }
        let digit = c.to_digit(base).ok_or(NoMagnitude::Digit(at))?;
        magnitude = magnitude * u128::from(base) + u128::from(digit);
        if magnitude > most {
            return Err(NoMagnitude::TooLarge);
        }
    }
    Ok(magnitude)
}
