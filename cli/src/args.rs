//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use warploom_core::graph::frames::parse_frames;

/// Renders image-processing graphs: only what a change reaches runs again.
#[derive(Parser)]
#[command(name = "warploom", version, about, max_term_width = 100)]
pub struct Line {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    /// Run a graph: whatever is not known yet is computed, files are written
    Run(RunArgs),
    /// Report every fault of a graph file; opens no input and runs nothing
    Check(CheckArgs),
    /// Tell what a run would do and why; may read and hash inputs, runs nothing
    Explain(ExplainArgs),
    /// List the node types, or describe one
    Nodes(NodesArgs),
    /// Draw a graph's structure
    Graph(GraphArgs),
    /// Look after the cache; safe beside running renders
    Cache(CacheArgs),
}

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
    #[arg(long, value_name = "NODE")]
    pub target: Vec<String>,
    /// Replace a parameter, as --set bend.angle=75.0; may be given several times
    #[arg(long, value_name = "NODE.PARAM=RON")]
    pub set: Vec<String>,
    /// Frames to run, as 1001-1100, 1001-1100x2 or 1,5,9; overrides the file's
    #[arg(long, value_name = "RANGE", value_parser = frames, allow_hyphen_values = true)]
    pub frames: Option<Frames>,
    /// A folder with plugins; may be given several times
    #[arg(long, value_name = "DIR")]
    pub plugins: Vec<PathBuf>,
}

/// Where results are kept between runs.
#[derive(Args)]
pub struct CacheFolder {
    /// Folder of the cache [default: $WARPLOOM_CACHE, else warploom in the user's cache folder]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// Most bytes the cache may take, as 50G or 500M; what was not used for longest goes first [default: 50G]
    #[arg(long, value_name = "BYTES", value_parser = cache_bytes)]
    pub cache_size: Option<u64>,
}

/// How results are kept and computed.
#[derive(Args)]
pub struct EngineArgs {
    #[command(flatten)]
    pub cache: CacheFolder,
    /// Read and write no cache on disk; values are still shared within the run
    #[arg(long)]
    pub no_cache: bool,
    /// Which values go to disk: those cheaper to load than to compute, or all
    #[arg(long, value_enum, default_value_t = Store::Auto)]
    pub store: Store,
    /// Memory the process may take, as 8G or 500M [default: three quarters of the machine's or the container's]
    #[arg(long, value_name = "BYTES", value_parser = memory_bytes)]
    pub memory: Option<u64>,
    /// Threads that compute [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Where an output is there already: overwrite it unless it is what would be written; skip it, whatever is in it; or
    /// verify that it is what would be written, and write nothing
    #[arg(long, value_enum, default_value_t = Existing::Overwrite)]
    pub existing: Existing,
}

#[derive(Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub file: GraphFile,
    #[command(flatten)]
    pub engine: EngineArgs,
    /// Go on with other frames after a fault
    #[arg(long)]
    pub keep_going: bool,
    /// Write the value on any edge to a file as well; #### stands for the frame
    #[arg(long, value_name = "NODE[.PORT]=FILE")]
    pub dump: Vec<String>,
    /// Write what ran, why, and what came out, as JSON
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// How progress is shown; auto: human on a terminal, plain elsewhere
    #[arg(long, value_enum, default_value_t = Progress::Auto)]
    pub progress: Progress,
    /// Run again whenever the graph file or a file it reads is saved, until stopped
    #[arg(long)]
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
    Overwrite,
    Skip,
    Verify,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum Store {
    Auto,
    All,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum Progress {
    Auto,
    /// A bar
    Human,
    /// A line per frame
    Plain,
    /// An object per event on standard output
    Jsonl,
    /// Open Job Description lines on standard output
    Openjd,
    /// A line per percent
    Percent,
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
    /// How it is shown; json is the JSON Schema, as in a plugin's manifest
    #[arg(long, value_enum, default_value_t = NodesFormat::Human)]
    pub format: NodesFormat,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum NodesFormat {
    Human,
    Json,
    Markdown,
}

#[derive(Args)]
pub struct GraphArgs {
    #[command(flatten)]
    pub file: GraphFile,
    /// The language of the drawing
    #[arg(long, value_enum)]
    pub format: GraphFormat,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum GraphFormat {
    Dot,
    Mermaid,
    Json,
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
