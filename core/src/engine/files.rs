//! Digests of files, read again only when they may have changed.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use serde::{Deserialize, Serialize};

use super::disk::{DiskTier, Table};
use super::io::{self as door, Io, Stat, now};
use crate::value::{Digest, Hasher};

/// A file's times may lag behind its content by this much; a memo made sooner after a change proves nothing.
const SETTLED: i128 = 2_000_000_000;

/// What was known of a file when it was last read whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Memo {
    stat: Stat,
    /// When the reading began, nanoseconds since 1970.
    made: i128,
    digest: Digest,
}

impl Memo {
    /// Whether the file cannot have changed since: same stat, and that stat was old when the memo was made.
    fn holds(&self, stat: &Stat) -> bool {
        self.stat == *stat && self.made - stat.modified.max(stat.changed) >= SETTLED
    }
}

/// Digests of files by path.
#[derive(Default)]
pub(crate) struct FileMemos {
    memory: Mutex<HashMap<PathBuf, Memo>>,
}

impl FileMemos {
    /// Digest of the content that is at `path` now.
    pub fn digest(&self, path: &Path, io: &dyn Io, disk: Option<&DiskTier>) -> io::Result<Digest> {
        let stat = door::stat(io, path)?;
        let lock = || self.memory.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let known = lock().get(path).copied();
        if let Some(memo) = known.filter(|memo| memo.holds(&stat)) {
            return Ok(memo.digest);
        }
        let name = Hasher::new("file").text(&path.to_string_lossy()).finish();
        if let Some(memo) = disk.and_then(|disk| disk.load_json::<Memo>(Table::Files, &name)).filter(|m| m.holds(&stat))
        {
            lock().insert(path.to_owned(), memo);
            return Ok(memo.digest);
        }
        let made = now();
        let digest = door::digest(io, path)?;
        let memo = Memo { stat, made, digest };
        // A file that was written meanwhile has another stat now, so the memo cannot be taken for its new content.
        lock().insert(path.to_owned(), memo);
        if let Some(disk) = disk.filter(|_| memo.holds(&stat)) {
            disk.save_json(Table::Files, &name, &memo);
        }
        Ok(digest)
    }
}
