//! What a run tells of itself.

use std::path::PathBuf;
use std::sync::Arc;

use serde::Serialize;

use super::disk::CacheCounts;
use super::memory::kernel_bytes;
use crate::diag::Fault;
use crate::value::Digest;

/// What became of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Its result was not known (or, of a sink, not there any more).
    Executed,
    /// Its result was known, its bytes were needed and not kept.
    Recomputed,
    /// Its result was known.
    Reused,
    /// It ended in a fault.
    Failed,
    /// It waited for one that failed, the run ended before it, or nobody needed it.
    Skipped,
}

/// Where a reused pair's result came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum From {
    /// Its bytes were in memory.
    Memory,
    /// Its bytes were read from disk.
    Disk,
    /// A sink's file still is what it wrote, or is to stand whatever it is.
    File,
    /// Only its digest was needed.
    Record,
}

/// Why a pair ran.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Why {
    /// What sort of reason.
    pub code: Reason,
    /// The node whose change it was.
    pub node: String,
    /// Its parameter, file path or port.
    pub param: Option<String>,
    /// What that was.
    pub old: Option<serde_json::Value>,
    /// What it is.
    pub new: Option<serde_json::Value>,
    /// Where it stands, `file:line:column`.
    pub at: Option<String>,
    /// The same in words.
    pub text: String,
}

/// Sorts of reasons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// A parameter has another value.
    Param,
    /// A port is connected to something else.
    Input,
    /// A file has other content.
    File,
    /// Those who read its outputs look at other parts of them.
    Wanted,
    /// The plugin is another build.
    Plugin,
    /// The node type is another version.
    Version,
    /// The file it wrote is gone.
    OutputMissing,
    /// The file it wrote is another now.
    OutputChanged,
    /// Its result was known once and is no more.
    Evicted,
    /// Its bytes were not kept.
    NotKept,
    /// It never ran here before.
    FirstRun,
}

/// One pair of a run.
#[derive(Clone, Debug, Serialize)]
pub struct PairReport {
    /// The node's name.
    pub node: Arc<str>,
    /// Its type.
    #[serde(rename = "type")]
    pub node_type: Arc<str>,
    /// The frame; none of what is the same for all.
    pub frame: Option<i64>,
    /// What became of it.
    pub status: Status,
    /// Where a reused result came from.
    pub from: Option<From>,
    /// Seconds this run spent on it.
    pub seconds: f64,
    /// Memory its outputs take.
    pub bytes: u64,
    /// Most memory the node asked for while it computed; 0 where it did not.
    pub peak_bytes: u64,
    /// Why it ran; none where it did not.
    pub why: Option<Box<Why>>,
    /// What it measured of itself.
    pub stats: serde_json::Map<String, serde_json::Value>,
}

/// One file of a run: written, or found as it was written before.
#[derive(Clone, Debug, Serialize)]
pub struct OutputReport {
    /// The sink.
    pub node: String,
    /// The frame.
    pub frame: Option<i64>,
    /// Absolute.
    pub path: PathBuf,
    /// Size of the file.
    pub bytes: u64,
    /// Digest of its content; none where a file stands that was not looked into.
    pub blake3: Option<Digest>,
}

/// What a run tells of itself; the form of `--report`.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Version of this form.
    pub schema: u32,
    /// The graph file.
    pub graph: PathBuf,
    /// Frames asked for.
    pub frames: Vec<i64>,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Peak resident memory of the process, bytes; 0 where the system does not tell.
    pub peak_bytes: u64,
    /// What was had of the disk tier.
    pub cache: CacheCounts,
    /// Every pair in the upstream closure of the targets, inputs first.
    pub nodes: Vec<PairReport>,
    /// Every file.
    pub outputs: Vec<OutputReport>,
    /// What nodes say of results that are there, inputs first.
    pub warnings: Vec<Fault>,
    /// Everything that went wrong.
    pub faults: Vec<Fault>,
    /// Frames all of whose targets are there.
    #[serde(skip)]
    pub frames_delivered: usize,
    /// Whether the run was stopped from outside.
    #[serde(skip)]
    pub cancelled: bool,
}

/// Memory that is resident now, bytes; 0 where the system does not tell.
pub fn resident_bytes() -> u64 {
    status_bytes("VmRSS:")
}

/// Peak resident memory of this process, bytes; 0 where the system does not tell.
pub fn peak_bytes() -> u64 {
    status_bytes("VmHWM:")
}

fn status_bytes(name: &str) -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    kernel_bytes(&status, name).unwrap_or(0)
}
