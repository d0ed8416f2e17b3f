//! `warploom completions` and `warploom man`: what the command line says of itself, for shells and for `man`.

use std::path::Path;

use clap::builder::{PossibleValuesParser, Resettable};
use clap::{Command, CommandFactory};
use clap_mangen::Man;
use warploom_core::diag::{Code, Fault, suggestion};
use warploom_core::engine::{cannot_write, plain, write_file};

use crate::args::{CompletionsArgs, Line, ManArgs};
use crate::terminal::{print, say, show};

/// The command `completions`: a script that knows commands, flags, their values, and the node types.
pub fn completions(args: &CompletionsArgs) -> u8 {
    let types = warploom_nodes::NODES.iter().map(|(name, _)| *name);
    let mut command = Line::command().mut_subcommand("nodes", |nodes| {
        nodes.mut_arg("name", |name| name.value_parser(PossibleValuesParser::new(types)))
    });
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "warploom", &mut script);
    print(&String::from_utf8_lossy(&script));
    0
}

/// The command `man`.
pub fn man(args: &ManArgs) -> u8 {
    let pages = pages();
    let shown = match (&args.out, &args.command) {
        (Some(folder), _) => write(folder, &pages),
        (None, command) => {
            let name = command.as_ref().map_or("warploom".to_owned(), |name| format!("warploom-{name}"));
            page(&pages, &name).map(print)
        }
    };
    shown.map_or_else(
        |fault| {
            show(&fault, false);
            fault.code.exit_code()
        },
        |()| 0,
    )
}

/// Name and text of all pages.
fn pages() -> Vec<(String, String)> {
    fn add(command: &Command, name: String, pages: &mut Vec<(String, String)>) {
        let below = command.get_subcommands().filter(|below| !below.is_hide_set());
        below.for_each(|below| add(below, format!("{name}-{}", below.get_name()), pages));
        pages.push((name.clone(), manual(command, &name)));
    }
    let mut command = Line::command().disable_help_subcommand(true);
    command.build();
    let mut pages = Vec::new();
    add(&command, "warploom".to_owned(), &mut pages);
    pages.sort();
    pages
}

/// One page. What stands below the flags gets sections of its own: its lines are not to be filled.
fn manual(command: &Command, name: &str) -> String {
    let below = command.get_after_long_help().map(ToString::to_string).unwrap_or_default();
    let command = command.clone().display_name(name).after_long_help(Resettable::Reset);
    let mut page = Vec::new();
    // Nothing can fail: it is written to memory.
    let _ = Man::new(command).source(concat!("warploom ", env!("CARGO_PKG_VERSION"))).render(&mut page);
    let mut text = String::from_utf8_lossy(&page).into_owned();
    for paragraph in below.split("\n\n").filter(|paragraph| !paragraph.is_empty()) {
        let (title, lines) = match paragraph.split_once(":\n") {
            Some((title, lines)) if !title.contains('\n') => (format!(".SH \"{}\"\n", title.to_uppercase()), lines),
            _ => (".PP\n".to_owned(), paragraph),
        };
        text += &format!("{title}.nf\n{}\n.fi\n", roff(lines));
    }
    text
}

/// A text in which nothing is a command of the page's language.
fn roff(text: &str) -> String {
    let escaped = text.replace('\\', "\\e").replace('-', "\\-").replace('\'', "\\(aq");
    escaped
        .lines()
        .map(|line| if line.starts_with('.') { format!("\\&{line}") } else { line.to_owned() })
        .collect::<Vec<_>>()
        .join("\n")
}

fn page<'a>(pages: &'a [(String, String)], name: &str) -> Result<&'a str, Fault> {
    let found = pages.iter().find(|(page, _)| page == name);
    found.map(|(_, text)| text.as_str()).ok_or_else(|| {
        let command = name.trim_start_matches("warploom-");
        let names = pages.iter().filter_map(|(page, _)| page.strip_prefix("warploom-"));
        let fault = Fault::new(Code::Usage, format!("there is no command `{command}`"));
        fault.hint(suggestion(command, names))
    })
}

fn write(folder: &Path, pages: &[(String, String)]) -> Result<(), Fault> {
    for (name, text) in pages {
        let path = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned()).join(format!("{name}.1"));
        write_file(&path, text.as_bytes()).map_err(|error| {
            let message = format!("{} cannot be written: {}", path.display(), plain(&error));
            Fault::new(Code::OutputUnwritable, message).hint(cannot_write(&error).to_owned())
        })?;
        say(&path.display().to_string());
    }
    Ok(())
}
