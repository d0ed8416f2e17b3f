//! Standard output and standard error. A pipe that is closed at its other end is a quiet end.

use std::ffi::OsStr;
use std::io::{IsTerminal, Write};

use warploom_core::diag::Fault;

/// Writes a line to standard output, at once.
pub fn say(line: &str) {
    let mut out = std::io::stdout().lock();
    // Nobody reads any more: there is nobody to tell.
    let _ = writeln!(out, "{line}").and_then(|()| out.flush());
}

/// Writes a line to standard error.
pub fn note(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// Shows a fault or a warning on standard error, as wide and as coloured as that allows.
pub fn show(fault: &Fault, is_warning: bool) {
    note(&rendered(fault, is_warning));
}

/// The text of a fault for standard error.
pub fn rendered(fault: &Fault, is_warning: bool) -> String {
    let color = std::io::stderr().is_terminal() && !refuses_color(std::env::var_os("NO_COLOR").as_deref());
    let width = terminal_size::terminal_size_of(std::io::stderr()).map_or(120, |(width, _)| usize::from(width.0));
    fault.render(is_warning, color, width)
}

/// Whether `NO_COLOR` has this value: by its convention empty is as good as not set.
fn refuses_color(value: Option<&OsStr>) -> bool {
    value.is_some_and(|value| !value.is_empty())
}

/// "1 fault", "2 faults".
pub fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_no_color_refuses_nothing() {
        assert!(refuses_color(Some(OsStr::new("1"))));
        assert!(!refuses_color(Some(OsStr::new(""))) && !refuses_color(None));
    }
}
