//! The warploom command: reads the command line, shows what happens, gives an exit code. It knows no algorithm.

mod args;
mod cache;
mod check;
mod dump;
mod explain;
mod fmt;
mod graph;
mod help;
pub mod nodes;
mod progress;
mod run;
mod shell;
mod terminal;
mod watch;

use std::process::ExitCode;

use clap::Parser;
use warploom_core::diag::Code;
use warploom_core::registry::Registry;

use args::{Command, Line};

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    warploom_core::value::give_back_freed_memory();
    warploom_core::engine::let_large_writes_fail();
    let line = Line::parse();
    let registry = Registry::new(warploom_nodes::NODES);
    // What panics here was printed already; the code says whose bug it is.
    let code = std::panic::catch_unwind(|| match line.command {
        Command::Run(args) => run::run(&args, &registry),
        Command::Check(args) => check::check(&args, &registry),
        Command::Nodes(args) => nodes::nodes(&args, &registry),
        Command::Graph(args) => graph::graph(&args, &registry),
        Command::Explain(args) => explain::explain(&args, &registry),
        Command::Fmt(args) => fmt::fmt(&args),
        Command::Cache(args) => cache::cache(&args),
        Command::Completions(args) => shell::completions(&args),
        Command::Man(args) => shell::man(&args),
    })
    .unwrap_or(Code::Panic.exit_code());
    let code = if code == 0 && terminal::output_was_lost() { Code::OutputUnwritable.exit_code() } else { code };
    ExitCode::from(code)
}
