//! The disk tier: records, values, memos and the journal as files named by digest.
//!
//! Files are written once, whole, and checked on every read, so any number of processes and machines can share a
//! folder without locks: whatever is corrupt, truncated or foreign is a miss. The format's number is part of the
//! path. What goes wrong here costs time and one warning, never a result.

use std::io::{self, BufReader};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::io::{self as door, Durable, Io, plain};
use super::upkeep::Usage;
use crate::value::{Digest, Value, decode, encode};

const FORMAT: &str = "v2";

/// What entries are about; each table is a folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Table {
    /// Action key -> record.
    Records,
    /// Digest -> value.
    Values,
    /// Path -> digest of the file there.
    Files,
    /// Graph and frame -> what pairs were made of.
    Journal,
}

impl Table {
    pub const ALL: [Table; 4] = [Table::Records, Table::Values, Table::Files, Table::Journal];

    pub fn name(self) -> &'static str {
        match self {
            Table::Records => "records",
            Table::Values => "values",
            Table::Files => "files",
            Table::Journal => "journal",
        }
    }
}

/// What a run had of the disk tier.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CacheCounts {
    /// Entries found.
    pub hits: u64,
    /// Entries that were not there.
    pub misses: u64,
    /// Entries that were there and not whole: removed, and misses too.
    pub damaged: u64,
    /// Bytes written.
    pub written_bytes: u64,
    /// Bytes removed to stay within the size asked for.
    pub evicted_bytes: u64,
}

#[derive(Default)]
pub(super) struct Counters {
    hits: AtomicU64,
    misses: AtomicU64,
    damaged: AtomicU64,
    written_bytes: AtomicU64,
    pub(super) evicted_bytes: AtomicU64,
}

/// A folder of content-addressed files.
pub struct DiskTier {
    pub(super) root: PathBuf,
    pub(super) io: Arc<dyn Io>,
    /// Most bytes that all files together may have.
    pub(super) budget: u64,
    pub(super) usage: Mutex<Usage>,
    pub(super) counters: Counters,
    /// Damaged entries that no warning told of yet.
    damaged_untold: AtomicU64,
    writable: AtomicBool,
    warning: Mutex<Option<String>>,
}

/// How reading an entry ended.
enum Found<T> {
    Whole(T),
    Damaged,
}

impl DiskTier {
    /// The tier in `folder`, made when first written to, of at most `budget` bytes.
    pub fn new(folder: &Path, io: Arc<dyn Io>, budget: u64) -> Self {
        Self {
            root: folder.join(FORMAT),
            io,
            budget,
            usage: Mutex::new(Usage::new(budget)),
            counters: Counters::default(),
            damaged_untold: AtomicU64::new(0),
            writable: AtomicBool::new(true),
            warning: Mutex::new(None),
        }
    }

    fn path(&self, table: Table, name: &Digest) -> PathBuf {
        let hex = name.hex();
        let mut path = PathBuf::with_capacity(self.root.as_os_str().len() + 80);
        path.push(&self.root);
        path.push(table.name());
        path.push(&hex[..2]);
        path.push(hex);
        path
    }

    /// A value by its digest; a miss if the bytes there give another one, and then they are removed, so that the
    /// value can be written again.
    pub(crate) fn load_value(&self, digest: &Digest) -> Option<Value> {
        let path = self.path(Table::Values, digest);
        let value = self.look(&path, || read_value(&*self.io, &path, digest))?;
        if self.is_writable()
            && let Err(error) = door::persist(|| self.io.touch(&path))
            && !door::is_gone(&error)
        {
            self.cannot_write(&error);
        }
        Some(value)
    }

    /// Whether a file of that name is there, whatever is in it.
    pub(crate) fn has_value(&self, digest: &Digest) -> bool {
        let found = door::stat(&*self.io, &self.path(Table::Values, digest));
        found.inspect_err(|error| self.cannot_read(error)).is_ok()
    }

    pub(crate) fn save_value(&self, digest: &Digest, value: &Value) {
        let path = self.path(Table::Values, digest);
        self.save(&path, value.bytes() + (1 << 12), &mut |out| encode(value, out));
    }

    /// Something small, by name; a miss if its checksum does not hold.
    pub(crate) fn load(&self, table: Table, name: &Digest) -> Option<Vec<u8>> {
        let path = self.path(table, name);
        self.look(&path, || read_sealed(&*self.io, &path, name))
    }

    /// Something small that fits `T`, by name.
    pub(crate) fn load_json<T: DeserializeOwned>(&self, table: Table, name: &Digest) -> Option<T> {
        let path = self.path(table, name);
        self.look(&path, || {
            let Found::Whole(bytes) = read_sealed(&*self.io, &path, name)? else { return Ok(Found::Damaged) };
            Ok(serde_json::from_slice(&bytes).map_or(Found::Damaged, Found::Whole))
        })
    }

    /// Whether it is written.
    pub(crate) fn save_bytes(&self, table: Table, name: &Digest, content: &[u8]) -> bool {
        let checksum = seal(name, content);
        self.save(&self.path(table, name), content.len() as u64 + 32, &mut |out| {
            out.write_all(&checksum.0)?;
            out.write_all(content)
        })
    }

    pub(crate) fn save_json(&self, table: Table, name: &Digest, content: &impl Serialize) {
        if let Ok(json) = serde_json::to_vec(content) {
            self.save_bytes(table, name, &json);
        }
    }

    fn look<T>(&self, path: &Path, read: impl FnOnce() -> io::Result<Found<T>>) -> Option<T> {
        let count = |counter: &AtomicU64| counter.fetch_add(1, Ordering::Relaxed);
        match read() {
            Ok(Found::Whole(content)) => {
                count(&self.counters.hits);
                return Some(content);
            }
            Ok(Found::Damaged) => {
                count(&self.counters.damaged);
                count(&self.damaged_untold);
                self.remove(path);
            }
            Err(error) => self.cannot_read(&error),
        }
        count(&self.counters.misses);
        None
    }

    /// Writes; the first failure turns writing off for good and leaves one warning.
    fn save(&self, path: &Path, bytes: u64, content: &mut dyn FnMut(&mut dyn io::Write) -> io::Result<()>) -> bool {
        let Some(_room) = self.is_writable().then(|| self.make_room(bytes)).flatten() else { return false };
        let written = door::replace(&*self.io, path, Durable::No, content);
        match &written {
            Ok(()) => _ = self.counters.written_bytes.fetch_add(bytes, Ordering::Relaxed),
            Err(error) => self.cannot_write(error),
        }
        written.is_ok()
    }

    /// Removes an entry, if it is still there.
    pub(super) fn remove(&self, path: &Path) {
        if let Err(error) = door::remove(&*self.io, path) {
            self.cannot_write(&error);
        }
    }

    pub(crate) fn is_writable(&self) -> bool {
        self.writable.load(Ordering::Relaxed)
    }

    /// That something is not there is no trouble.
    fn cannot_read(&self, error: &io::Error) {
        if !door::is_gone(error) {
            let problem = plain(error);
            self.warn(|root| {
                format!("the cache at {root} cannot be read ({problem}); what is not found there is made anew")
            });
        }
    }

    pub(super) fn cannot_write(&self, error: &io::Error) {
        if self.writable.swap(false, Ordering::Relaxed) {
            let problem = plain(error);
            self.warn(|root| format!("the cache at {root} cannot be written ({problem}); the run goes on without"));
        }
    }

    /// Keeps the first warning.
    fn warn(&self, text: impl FnOnce(&str) -> String) {
        let mut warning = self.warning.lock().unwrap_or_else(PoisonError::into_inner);
        warning.get_or_insert_with(|| text(&self.root.display().to_string()));
    }

    /// The one warning, if something went wrong since it was last taken.
    pub fn take_warning(&self) -> Option<String> {
        match self.damaged_untold.swap(0, Ordering::Relaxed) {
            0 => {}
            1 => self.warn(|root| format!("an entry of the cache at {root} was damaged; it was made anew")),
            count => {
                self.warn(|root| format!("{count} entries of the cache at {root} were damaged; they were made anew"))
            }
        }
        self.warning.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// What was found and written since this was last asked.
    pub fn take_counts(&self) -> CacheCounts {
        let take = |counter: &AtomicU64| counter.swap(0, Ordering::Relaxed);
        CacheCounts {
            hits: take(&self.counters.hits),
            misses: take(&self.counters.misses),
            damaged: take(&self.counters.damaged),
            written_bytes: take(&self.counters.written_bytes),
            evicted_bytes: take(&self.counters.evicted_bytes),
        }
    }

    /// Whether the entry of that name is whole.
    pub(super) fn is_whole(&self, table: Table, name: &Digest, path: &Path) -> io::Result<bool> {
        Ok(match table {
            Table::Values => matches!(read_value(&*self.io, path, name)?, Found::Whole(_)),
            _ => matches!(read_sealed(&*self.io, path, name)?, Found::Whole(_)),
        })
    }
}

fn read_value(io: &dyn Io, path: &Path, digest: &Digest) -> io::Result<Found<Value>> {
    let (file, size) = door::open(io, path)?;
    let mut file = BufReader::with_capacity(1 << 16, file);
    let value = decode(&mut file, size)?.filter(|value| value.digest() == *digest);
    Ok(value.map_or(Found::Damaged, Found::Whole))
}

fn read_sealed(io: &dyn Io, path: &Path, name: &Digest) -> io::Result<Found<Vec<u8>>> {
    let mut bytes = door::read(io, path)?;
    let is_whole = bytes.split_at_checked(32).is_some_and(|(checksum, content)| *checksum == seal(name, content).0);
    if !is_whole {
        return Ok(Found::Damaged);
    }
    bytes.drain(..32);
    Ok(Found::Whole(bytes))
}

/// Checksum of a file's content under its name, so that files cannot be swapped either.
fn seal(name: &Digest, content: &[u8]) -> Digest {
    let mut hasher = blake3::Hasher::new_keyed(&name.0);
    Digest(*hasher.update(content).finalize().as_bytes())
}
