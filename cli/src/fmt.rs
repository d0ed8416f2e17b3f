//! `warploom fmt`: graph files in the standard form.

use std::io::Read;
use std::path::Path;

use warploom_core::diag::{Code, Fault};
use warploom_core::engine::{cannot_write, plain, write_file};
use warploom_core::graph::check::MAX_BYTES;
use warploom_core::graph::format;

use crate::args::FmtArgs;
use crate::terminal::{counted, note, print, say, show};

/// What `--check` exits with where a file would change.
const DIFFERS: u8 = 7;

/// The command. A fault matters more than a file that would change; all files are looked at.
pub fn fmt(args: &FmtArgs) -> u8 {
    let mut codes = Vec::new();
    for path in &args.graphs {
        codes.push(one(path, args.check).unwrap_or_else(|faults| {
            faults.iter().for_each(|fault| show(fault, false));
            faults.first().map_or(0, |fault| fault.code.exit_code())
        }));
    }
    let differing = codes.iter().filter(|&&code| code == DIFFERS).count();
    if differing > 0 {
        note(&format!("{} to format: run `warploom fmt` on what is named", counted(differing, "file")));
    }
    let fault = codes.iter().copied().find(|&code| code != 0 && code != DIFFERS);
    fault.unwrap_or(if differing > 0 { DIFFERS } else { 0 })
}

fn one(path: &Path, check: bool) -> Result<u8, Vec<Fault>> {
    let is_stdin = path == Path::new("-");
    let (text, name) =
        if is_stdin { (standard_input(), Path::new("<stdin>")) } else { (crate::check::text(path), path) };
    let text = text.map_err(|fault| vec![*fault])?;
    let formatted = format(name, &text)?;
    let shown = if is_stdin { name.to_owned() } else { std::path::absolute(path).unwrap_or_else(|_| path.to_owned()) };
    match (is_stdin, check) {
        (_, true) if formatted == text => {}
        (_, true) => {
            say(&shown.display().to_string());
            return Ok(DIFFERS);
        }
        (true, false) => print(&formatted),
        (false, false) if formatted == text => {}
        (false, false) => {
            write_file(path, formatted.as_bytes()).map_err(|error| {
                let message = format!("{} cannot be written: {}", path.display(), plain(&error));
                vec![Fault::new(Code::OutputUnwritable, message).hint(cannot_write(&error).to_owned())]
            })?;
            say(&shown.display().to_string());
        }
    }
    Ok(0)
}

fn standard_input() -> Result<String, Box<Fault>> {
    let refused = |message: String| Box::new(Fault::new(Code::Usage, message));
    let mut bytes = Vec::new();
    let read = std::io::stdin().take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes);
    read.map_err(|error| refused(format!("standard input cannot be read: {}", plain(&error))))?;
    if bytes.len() > MAX_BYTES {
        let message = format!("standard input has more than {MAX_BYTES} bytes; a graph has at most that many");
        return Err(Box::new(Fault::new(Code::TooLarge, message)));
    }
    String::from_utf8(bytes)
        .map_err(|error| refused(format!("byte {} of standard input is not UTF-8", error.utf8_error().valid_up_to())))
}
