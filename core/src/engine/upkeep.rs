//! Keeping the disk tier within its size, and what `warploom cache` does with it; safe beside running renders.
//!
//! No file tells how large the tier is: a process that writes looks for itself, each time it has written a small part
//! of the budget. So no index can be torn or stale, and a machine that dies leaves nothing to mend.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::PoisonError;
use std::sync::atomic::Ordering;

use super::disk::{DiskTier, Table};
use super::io::{self as door, Temporary};
use crate::value::Digest;

/// After looking, this part of the budget may be written before looking again.
const PART: u64 = 64;

/// Files take whole blocks.
const BLOCK: u64 = 4096;

/// What this process may write before it looks at the whole tier again.
pub(super) struct Usage {
    allowance: u64,
    /// Bytes that are being written.
    in_flight: u64,
}

impl Usage {
    /// A process begins at a random point of its first part, so that many short ones look as often as one long one.
    pub fn new(budget: u64) -> Self {
        let noise = Digest::of_bytes(format!("{} {}", std::process::id(), door::now()).as_bytes()).0[0];
        Self { allowance: budget / PART / 256 * u64::from(noise), in_flight: 0 }
    }
}

/// Room for an entry that is being written.
pub(super) struct Room<'a> {
    tier: &'a DiskTier,
    bytes: u64,
}

impl Drop for Room<'_> {
    fn drop(&mut self) {
        self.tier.usage.lock().unwrap_or_else(PoisonError::into_inner).in_flight -= self.bytes;
    }
}

/// A file of the tier.
struct Entry {
    path: PathBuf,
    table: Table,
    /// None of temporary files.
    name: Option<Digest>,
    bytes: u64,
    modified: i128,
}

/// What is in the tier.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CacheStat {
    /// The folder.
    pub folder: PathBuf,
    /// Most bytes it may hold.
    pub budget: u64,
    /// Name, entries and bytes per table.
    pub tables: Vec<(&'static str, u64, u64)>,
    /// Files that are being written, or were left, and their bytes.
    pub temporary: (u64, u64),
}

impl CacheStat {
    /// Bytes of all files.
    pub fn bytes(&self) -> u64 {
        self.tables.iter().map(|(_, _, bytes)| bytes).sum::<u64>() + self.temporary.1
    }
}

/// What was removed from the tier, or looked at in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CacheWork {
    /// Entries looked at.
    pub entries: u64,
    /// Of those, entries removed.
    pub removed: u64,
    /// Bytes removed.
    pub removed_bytes: u64,
    /// Bytes left.
    pub left_bytes: u64,
}

impl DiskTier {
    /// Room for `bytes` more, made by removing what was not used for longest; none if there is none to be had.
    pub(super) fn make_room(&self, bytes: u64) -> Option<Room<'_>> {
        let bytes = bytes.next_multiple_of(BLOCK);
        if bytes > self.budget / 2 {
            // It would drive out too much else.
            return None;
        }
        let mut usage = self.usage.lock().unwrap_or_else(PoisonError::into_inner);
        if bytes > usage.allowance {
            let wanted = bytes.saturating_add(usage.in_flight);
            let done = self.evict(wanted, self.budget - self.budget / 8, self.budget / 4 * 3);
            let done = done.inspect_err(|error| self.cannot_write(error)).ok()?;
            if done.left_bytes.saturating_add(wanted) > self.budget {
                return None;
            }
            usage.allowance = (self.budget / PART).max(bytes);
        }
        usage.allowance -= bytes;
        usage.in_flight += bytes;
        Some(Room { tier: self, bytes })
    }

    /// Sweeps, then removes entries until `wanted` more bytes would fit in `target`, if they do not fit in `limit`.
    fn evict(&self, wanted: u64, limit: u64, target: u64) -> io::Result<CacheWork> {
        let mut entries = self.entries()?;
        let mut work = CacheWork::on(&entries);
        self.sweep(&mut entries, &mut work)?;
        if work.left_bytes.saturating_add(wanted) <= limit {
            return Ok(work);
        }
        entries.retain(|entry| entry.name.is_some());
        let removable: u64 = entries.iter().map(|entry| entry.bytes).sum();
        let least = work.left_bytes.saturating_add(wanted) - removable;
        if least > self.budget {
            // It would not fit if there were no entry at all.
            return Ok(work);
        }
        // Of what others are writing nothing can go: that must not drive all entries out.
        let target = target.max(least + (self.budget - least) / 2);
        // Values first, those used least lately first: without them a result is still known. The rest by age.
        entries.sort_by_key(|entry| (entry.table != Table::Values, entry.modified));
        for entry in entries {
            if work.left_bytes.saturating_add(wanted) <= target {
                break;
            }
            self.counters.evicted_bytes.fetch_add(entry.bytes, Ordering::Relaxed);
            work.remove(self, &entry)?;
        }
        Ok(work)
    }

    /// Removes temporary files whose process has ended or that are old.
    fn sweep(&self, entries: &mut Vec<Entry>, work: &mut CacheWork) -> io::Result<()> {
        // The clock is looked at where this would find what that leaves if it is killed.
        let temporary = entries.iter().find(|entry| entry.name.is_none());
        let Some(folder) = temporary.and_then(|temporary| temporary.path.parent()) else { return Ok(()) };
        let now = door::clock_of(&*self.io, folder)?;
        let is_left = |entry: &Entry| {
            let name = entry.path.file_name().and_then(|name| name.to_str());
            let owner = name.and_then(Temporary::of).filter(|_| entry.name.is_none());
            owner.is_some_and(|owner| owner.is_orphan() || now - entry.modified > door::STALE)
        };
        entries.extract_if(.., |entry| is_left(entry)).try_for_each(|entry| work.remove(self, &entry))
    }

    /// Every file. Folders and files that go while it looks are not there.
    fn entries(&self) -> io::Result<Vec<Entry>> {
        let mut entries = Vec::new();
        for table in Table::ALL {
            let folder = self.root.join(table.name());
            for part in self.list(&folder)? {
                let folder = folder.join(part);
                for name in self.list(&folder)? {
                    let path = folder.join(&name);
                    let stat = match door::stat(&*self.io, &path) {
                        // Nor is a folder that somebody else made here.
                        Err(error) if door::is_gone(&error) || error.kind() == ErrorKind::InvalidInput => continue,
                        stat => stat?,
                    };
                    let name = name.to_str().and_then(Digest::from_hex);
                    let bytes = stat.size.next_multiple_of(BLOCK);
                    entries.push(Entry { path, table, name, bytes, modified: stat.modified });
                }
            }
        }
        Ok(entries)
    }

    fn list(&self, folder: &Path) -> io::Result<Vec<std::ffi::OsString>> {
        match door::persist(|| self.io.list(folder)) {
            // A file among the folders is nobody's entry.
            Err(error) if door::is_gone(&error) || error.kind() == ErrorKind::NotADirectory => Ok(Vec::new()),
            listed => listed,
        }
    }

    /// Most bytes it may take.
    pub fn budget(&self) -> u64 {
        self.budget
    }

    /// What is in the tier.
    pub fn stat(&self) -> io::Result<CacheStat> {
        let entries = self.entries()?;
        let sum = |entries: &mut dyn Iterator<Item = &Entry>| {
            entries.fold((0, 0), |(count, bytes), entry| (count + 1, bytes + entry.bytes))
        };
        let of_table = |table: Table| {
            let (count, bytes) = sum(&mut entries.iter().filter(|entry| entry.table == table && entry.name.is_some()));
            (table.name(), count, bytes)
        };
        Ok(CacheStat {
            folder: self.root.clone(),
            budget: self.budget,
            tables: Table::ALL.map(of_table).to_vec(),
            temporary: sum(&mut entries.iter().filter(|entry| entry.name.is_none())),
        })
    }

    /// Removes what was left by processes that ended, and entries until the tier is within its size.
    pub fn collect(&self) -> io::Result<CacheWork> {
        self.evict(0, self.budget, self.budget)
    }

    /// Reads every entry and removes those that are not whole.
    pub fn verify(&self) -> io::Result<CacheWork> {
        let entries = self.entries()?;
        let mut work = CacheWork::on(&entries);
        for entry in &entries {
            let Some(name) = &entry.name else { continue };
            match self.is_whole(entry.table, name, &entry.path) {
                Ok(true) => {}
                Ok(false) => work.remove(self, entry)?,
                Err(error) if door::is_gone(&error) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(work)
    }

    /// Removes every entry; what others write meanwhile stays.
    pub fn clear(&self) -> io::Result<CacheWork> {
        let mut entries = self.entries()?;
        let mut work = CacheWork::on(&entries);
        self.sweep(&mut entries, &mut work)?;
        let mut whole = entries.iter().filter(|entry| entry.name.is_some());
        whole.try_for_each(|entry| work.remove(self, entry))?;
        Ok(work)
    }
}

impl CacheWork {
    fn on(entries: &[Entry]) -> Self {
        let left_bytes = entries.iter().map(|entry| entry.bytes).sum();
        Self { entries: entries.len() as u64, removed: 0, removed_bytes: 0, left_bytes }
    }

    fn remove(&mut self, tier: &DiskTier, entry: &Entry) -> io::Result<()> {
        door::remove(&*tier.io, &entry.path)?;
        self.removed += 1;
        self.removed_bytes += entry.bytes;
        self.left_bytes -= entry.bytes;
        Ok(())
    }
}
