//! Digests of files, read again only when they may have changed.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use serde::{Deserialize, Serialize};

use super::disk::{DiskTier, Table};
use super::io::{self as door, Io, Stat, host, now};
use crate::value::{Digest, Hasher};

/// A file's times may lag behind its content by this much; a memo made sooner after a change proves nothing.
const SETTLED: i128 = 2_000_000_000;

/// What was known of a file when it was last read whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Memo {
    stat: Stat,
    /// When the machine that read it saw it so for the first time, nanoseconds since 1970 by that machine's clock.
    seen: i128,
    /// When the reading began, by the same clock.
    made: i128,
    /// That machine.
    host: u64,
    /// Whether its clock is the file's.
    has_our_clock: bool,
    digest: Digest,
}

impl Memo {
    /// Whether the file cannot have changed since: same stat, and that stat was old when the memo was made. Where a
    /// server stamps files its clock may be off, so that a file looks older than it is: then it must have been seen so
    /// for a while by the clock that the memo was made by.
    fn holds(&self, stat: &Stat) -> bool {
        let age = self.made - stat.modified.max(stat.changed);
        let watched = if self.has_our_clock { age } else { age.min(self.made - self.seen) };
        self.stat == *stat && watched >= SETTLED
    }

    /// Since when this machine saw the file so.
    fn seen(&self, stat: &Stat) -> Option<i128> {
        (self.stat == *stat && self.host == host() && self.host != 0).then_some(self.seen)
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
        let stored = disk.and_then(|disk| disk.load_json::<Memo>(Table::Files, &name));
        if let Some(memo) = stored.filter(|memo| memo.holds(&stat)) {
            lock().insert(path.to_owned(), memo);
            return Ok(memo.digest);
        }
        let made = now();
        let seen = [known, stored].iter().flatten().filter_map(|memo| memo.seen(&stat)).min();
        let (digest, has_our_clock) = (door::digest(io, path)?, io.has_our_clock(path));
        let memo = Memo { stat, seen: seen.unwrap_or(made), made, host: host(), has_our_clock, digest };
        // A file that was written meanwhile has another stat now, so the memo cannot be taken for its new content.
        lock().insert(path.to_owned(), memo);
        if let Some(disk) = disk.filter(|_| memo.holds(&stat) || !has_our_clock && seen.is_none()) {
            disk.save_json(Table::Files, &name, &memo);
        }
        Ok(digest)
    }
}
