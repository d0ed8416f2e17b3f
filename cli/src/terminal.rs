//! Standard output and standard error. A pipe that is closed at its other end is a quiet end.

use std::ffi::OsStr;
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use warploom_core::diag::{Code, Fault};
use warploom_core::engine::plain;

static OUTPUT_LOST: AtomicBool = AtomicBool::new(false);

static OUTPUT_CLOSED: AtomicBool = AtomicBool::new(false);

/// Whether whoever read standard output has gone.
pub fn output_is_closed() -> bool {
    OUTPUT_CLOSED.load(Ordering::Relaxed)
}

/// Writes a line to standard output, at once.
pub fn say(line: &str) {
    print(&format!("{line}\n"));
}

/// Writes lines to standard output, at once.
pub fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    let Err(error) = out.write_all(text.as_bytes()).and_then(|()| out.flush()) else { return };
    if error.kind() == ErrorKind::BrokenPipe {
        // Where nobody reads any more there is nobody to tell.
        OUTPUT_CLOSED.store(true, Ordering::Relaxed);
    } else if !OUTPUT_LOST.swap(true, Ordering::Relaxed) {
        let message = format!("standard output cannot be written: {}", plain(&error));
        show(&Fault::new(Code::OutputUnwritable, message), false);
    }
}

/// Whether standard output could not take all that was said.
pub fn output_was_lost() -> bool {
    OUTPUT_LOST.load(Ordering::Relaxed)
}

/// Writes a line to standard error, in one piece: others may write to the same pipe.
pub fn note(line: &str) {
    let _ = std::io::stderr().lock().write_all(format!("{line}\n").as_bytes());
}

/// Shows a fault or a warning on standard error, as wide and as coloured as that allows.
pub fn show(fault: &Fault, is_warning: bool) {
    note(&rendered(fault, is_warning));
}

/// Shows warnings; of many nodes that no target needs, the names alone.
pub fn show_warnings(warnings: &[Fault]) {
    let (unreached, others): (Vec<&Fault>, Vec<&Fault>) =
        warnings.iter().partition(|warning| warning.code == Code::Unreached);
    others.iter().for_each(|warning| show(warning, true));
    if unreached.len() <= 2 {
        return unreached.iter().for_each(|warning| show(warning, true));
    }
    let names: Vec<&str> = unreached.iter().filter_map(|warning| warning.node.as_deref()).collect();
    let some = if names.len() > 10 { format!("{}, ..", names[..10].join(", ")) } else { names.join(", ") };
    show(&Fault::new(Code::Unreached, format!("no target needs {} nodes: {some}", names.len())), true);
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
