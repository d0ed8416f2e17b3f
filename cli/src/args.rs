//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use warploom_core::graph::frames::parse_frames;

use crate::help;

/// Renders image-processing graphs: only what a change reaches runs again
///
/// A graph is a RON file of nodes that load pictures, make masks and warps of them, and save what comes out. What a run
/// computed is remembered by its content, on disk too: the next run does only what is new.
#[derive(Parser)]
#[command(name = "warploom", version, max_term_width = 100, after_long_help = help::line())]
#[command(subcommand_required = true, arg_required_else_help = true, disable_help_subcommand = true)]
pub struct Line {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    /// Run a graph: whatever is not known yet is computed, files are written
    #[command(after_long_help = help::run())]
    Run(RunArgs),
    /// Report every fault of a graph file; opens no input and runs nothing
    #[command(after_long_help = help::CHECK)]
    Check(CheckArgs),
    /// Tell what a run would do and why; may read and hash inputs, runs nothing
    #[command(after_long_help = help::EXPLAIN)]
    Explain(ExplainArgs),
    /// List the node types, describe one, or write a page of each
    #[command(after_long_help = help::NODES)]
    Nodes(NodesArgs),
    /// Draw a graph's structure
    #[command(after_long_help = help::GRAPH)]
    Graph(GraphArgs),
    /// Put graph files into the standard form; keeps comments and values
    #[command(after_long_help = help::FMT)]
    Fmt(FmtArgs),
    /// Look after the cache; safe beside running renders
    #[command(after_long_help = help::CACHE)]
    Cache(CacheArgs),
    /// Print a script that completes command lines in a shell
    #[command(after_long_help = help::COMPLETIONS)]
    Completions(CompletionsArgs),
    /// Print or write the manual pages
    #[command(after_long_help = help::MAN)]
    Man(ManArgs),
}

/// Headings of flags.
const GRAPH: &str = "What to run";
const CACHE: &str = "What is remembered";
const MACHINE: &str = "What it may take";
const RUN: &str = "What comes out";

/// A frame range.
#[derive(Clone)]
pub struct Frames(pub Vec<i64>);

fn frames(text: &str) -> Result<Frames, String> {
    parse_frames(text).map(Frames)
}

/// What every command that reads a graph takes.
#[derive(Args)]
pub struct GraphFile {
    /// The graph file (RON)
    pub graph: PathBuf,
    /// Run for this node instead of all sinks; may be given several times
    #[arg(long, help_heading = GRAPH, value_name = "NODE")]
    pub target: Vec<String>,
    /// Replace a parameter, as in --set bend.angle=75.0; may be given several times
    #[arg(long, help_heading = GRAPH, value_name = "NODE.PARAM=RON")]
    pub set: Vec<String>,
    /// Frames to run, as in 1001-1100, 1001-1100x2 or 1,5,9; overrides the file's
    #[arg(long, help_heading = GRAPH, value_name = "RANGE", value_parser = frames, allow_hyphen_values = true)]
    pub frames: Option<Frames>,
    /// A folder with plugins; may be given several times
    #[arg(long, help_heading = GRAPH, value_name = "DIR")]
    pub plugins: Vec<PathBuf>,
}

/// Where results are kept between runs.
#[derive(Args)]
pub struct CacheFolder {
    /// Folder of the cache [default: $WARPLOOM_CACHE, else warploom in the user's cache folder]
    #[arg(long, help_heading = CACHE, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// Most bytes the cache may take, as 50G or 500M; what was not used for longest goes first [default: 50G]
    #[arg(long, help_heading = CACHE, value_name = "BYTES", value_parser = cache_bytes)]
    pub cache_size: Option<u64>,
}

/// How results are kept and computed.
#[derive(Args)]
pub struct EngineArgs {
    #[command(flatten)]
    pub cache: CacheFolder,
    /// Read and write no cache on disk; values are still shared within the run
    #[arg(long, help_heading = CACHE)]
    pub no_cache: bool,
    /// Which values go to disk
    #[arg(long, help_heading = CACHE, value_enum, default_value_t = Store::Auto)]
    pub store: Store,
    /// Memory the process may take, as 8G or 500M [default: three quarters of the machine's or the container's]
    #[arg(long, help_heading = MACHINE, value_name = "BYTES", value_parser = memory_bytes)]
    pub memory: Option<u64>,
    /// Threads that compute [default: all]
    #[arg(long, help_heading = MACHINE, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// What to do where an output is there already
    #[arg(long, help_heading = RUN, value_enum, default_value_t = Existing::Overwrite)]
    pub existing: Existing,
}

#[derive(Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub file: GraphFile,
    #[command(flatten)]
    pub engine: EngineArgs,
    /// Go on with other frames after a fault
    #[arg(long, help_heading = RUN)]
    pub keep_going: bool,
    /// Write the value on any edge to a file as well; #### stands for the frame
    #[arg(long, help_heading = RUN, value_name = "NODE[.PORT]=FILE")]
    pub dump: Vec<String>,
    /// Write what ran, why, and what came out, as JSON
    #[arg(long, help_heading = RUN, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// How progress is shown
    #[arg(long, help_heading = RUN, value_enum, default_value_t = Progress::Auto)]
    pub progress: Progress,
    /// Run again whenever the graph file or a file it reads is saved, until stopped
    #[arg(long, help_heading = RUN)]
    pub watch: bool,
}

#[derive(Args)]
pub struct ExplainArgs {
    #[command(flatten)]
    pub file: GraphFile,
    #[command(flatten)]
    pub engine: EngineArgs,
    /// How verdicts are shown
    #[arg(long, value_enum, default_value_t = CheckFormat::Human)]
    pub format: CheckFormat,
}

#[derive(Args)]
pub struct CacheArgs {
    #[command(subcommand)]
    pub work: CacheWork,
}

#[derive(Subcommand)]
pub enum CacheWork {
    /// How many entries of which sort it holds
    Stat(CacheFolder),
    /// Remove what killed processes left, and entries until it is within its size
    Gc(CacheFolder),
    /// Read every entry and remove those that are damaged; exit code 7 if there were any
    Verify(CacheFolder),
    /// Remove every entry
    Clear(CacheFolder),
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum Existing {
    /// Write it again unless it is what would be written
    Overwrite,
    /// Let it stand, whatever is in it
    Skip,
    /// Compare it with what would be written; write nothing
    Verify,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum Store {
    /// Those that are cheaper to load than to compute
    Auto,
    /// All that can
    All,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum Progress {
    /// `human` on a terminal, `plain` elsewhere
    Auto,
    /// A bar
    Human,
    /// A line per frame, on standard error
    Plain,
    /// A JSON object per event, on standard output
    Jsonl,
    /// Open Job Description: `openjd_progress: 42` and its like, on standard output
    Openjd,
    /// `Progress: 42%`, a line per percent, on standard output
    Percent,
    /// Nothing but faults
    None,
}

#[derive(Args)]
pub struct CheckArgs {
    #[command(flatten)]
    pub file: GraphFile,
    /// How faults are shown
    #[arg(long, value_enum, default_value_t = CheckFormat::Human)]
    pub format: CheckFormat,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum CheckFormat {
    Human,
    Json,
}

#[derive(Args)]
pub struct NodesArgs {
    /// The node type to describe
    pub name: Option<String>,
    /// How it is shown
    #[arg(long, value_enum, default_value_t = NodesFormat::Human)]
    pub format: NodesFormat,
    /// Write a page of each node type, and an index, into this folder; with --format markdown
    #[arg(long, value_name = "DIR", conflicts_with = "name")]
    pub out: Option<PathBuf>,
    /// For --out: a folder that holds an example of each node type
    #[arg(long, value_name = "DIR", requires = "out")]
    pub examples: Option<PathBuf>,
    /// For --out: a folder that holds a picture of each node type
    #[arg(long, value_name = "DIR", requires = "out")]
    pub pictures: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum NodesFormat {
    /// For reading
    Human,
    /// JSON Schema, as in a plugin's manifest
    Json,
    /// A page
    Markdown,
}

#[derive(Args)]
pub struct GraphArgs {
    #[command(flatten)]
    pub file: GraphFile,
    /// The language of the drawing
    #[arg(long, value_enum, default_value_t = GraphFormat::Dot)]
    pub format: GraphFormat,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum GraphFormat {
    /// Graphviz
    Dot,
    /// Mermaid, which Markdown pages may hold
    Mermaid,
    /// For programs
    Json,
}

#[derive(Args)]
pub struct FmtArgs {
    /// Graph files (RON); - is standard input, which goes to standard output
    #[arg(required = true)]
    pub graphs: Vec<PathBuf>,
    /// Change nothing; say which files would change, and exit with 7 if there are any
    #[arg(long)]
    pub check: bool,
}

#[derive(Args)]
pub struct CompletionsArgs {
    /// The shell
    pub shell: clap_complete::Shell,
}

#[derive(Args)]
pub struct ManArgs {
    /// The command whose page to print, instead of the one for all
    #[arg(conflicts_with = "out")]
    pub command: Option<String>,
    /// Write all pages into this folder
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

fn memory_bytes(text: &str) -> Result<u64, String> {
    bytes(text, "16M", 16e6)
}

fn cache_bytes(text: &str) -> Result<u64, String> {
    bytes(text, "1M", 1e6)
}

/// A count of bytes with an optional K, M, G or T, powers of 1024.
fn bytes(text: &str, least: &str, min: f64) -> Result<u64, String> {
    let allowed = || format!("`{text}` is no size that will do; write 8G, 500M or a count of bytes, at least {least}");
    let (digits, unit) = match text.char_indices().last() {
        Some((at, c)) if c.is_ascii_alphabetic() => (&text[..at], c.to_ascii_uppercase()),
        _ => (text, 'B'),
    };
    let shift = match unit {
        'B' => 0,
        'K' => 10,
        'M' => 20,
        'G' => 30,
        'T' => 40,
        _ => return Err(allowed()),
    };
    let number: f64 = digits.parse().map_err(|_| allowed())?;
    let bytes = number * (1u64 << shift) as f64;
    if (min..=1e18).contains(&bytes) { Ok(bytes as u64) } else { Err(allowed()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_sound() {
        Line::command().debug_assert();
    }

    #[test]
    fn sizes() {
        assert_eq!(memory_bytes("8G"), Ok(8 << 30));
        assert_eq!(memory_bytes("1.5g"), Ok(3 << 29));
        assert_eq!(memory_bytes("500M"), Ok(500 << 20));
        assert_eq!(cache_bytes("1M"), Ok(1 << 20));
        for bad in ["", "G", "8X", "-1G", "1K", "inf", "NaN"] {
            assert!(memory_bytes(bad).is_err() && cache_bytes(bad).is_err(), "{bad}");
        }
    }
}
