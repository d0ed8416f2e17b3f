//! The disk tier: records, values and memos as files named by digest.
//!
//! Files are written once, whole, and checked on every read, so any number of processes can share a folder without
//! locks: whatever is corrupt, truncated or foreign is a miss. The format's number is part of the path.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::io::Io;
use crate::value::{Digest, Value, decode, encode};

const FORMAT: &str = "v1";

/// A folder of content-addressed files.
pub struct DiskTier {
    root: PathBuf,
    io: Arc<dyn Io>,
    writable: AtomicBool,
    warning: Mutex<Option<String>>,
}

impl DiskTier {
    /// The tier in `folder`, made when first written to.
    pub fn new(folder: &Path, io: Arc<dyn Io>) -> Self {
        Self { root: folder.join(FORMAT), io, writable: AtomicBool::new(true), warning: Mutex::new(None) }
    }

    fn path(&self, table: &str, name: &Digest) -> PathBuf {
        let hex = name.hex();
        self.root.join(table).join(&hex[..2]).join(hex)
    }

    /// A value by its digest; a miss if the bytes there give another one, and then they are removed, so that the
    /// value can be written again.
    pub(crate) fn load_value(&self, digest: &Digest) -> Option<Value> {
        let path = self.path("values", digest);
        let bytes = self.io.read(&path).ok()?;
        let value = decode(&bytes).filter(|value| value.digest() == *digest);
        if value.is_none() {
            // Where it cannot be removed it stays a miss.
            let _ = self.io.remove(&path);
        }
        value
    }

    /// Whether a file of that name is there, whatever is in it.
    pub(crate) fn has_value(&self, digest: &Digest) -> bool {
        self.io.stat(&self.path("values", digest)).is_ok()
    }

    pub(crate) fn save_value(&self, digest: &Digest, value: &Value) {
        if self.writable.load(Ordering::Relaxed)
            && let Some(bytes) = encode(value)
        {
            self.write(&self.path("values", digest), &bytes);
        }
    }

    /// Something small, by name; a miss if its checksum does not hold or it does not fit `T`.
    pub(crate) fn load_json<T: DeserializeOwned>(&self, table: &str, name: &Digest) -> Option<T> {
        let bytes = self.io.read(&self.path(table, name)).ok()?;
        let (checksum, json) = bytes.split_at_checked(32)?;
        (checksum == seal(name, json).0).then(|| serde_json::from_slice(json).ok()).flatten()
    }

    pub(crate) fn save_json(&self, table: &str, name: &Digest, content: &impl Serialize) {
        let Ok(json) = serde_json::to_vec(content) else { return };
        let mut bytes = seal(name, &json).0.to_vec();
        bytes.extend_from_slice(&json);
        self.write(&self.path(table, name), &bytes);
    }

    /// Writes; the first failure turns writing off for good and leaves one warning.
    fn write(&self, path: &Path, bytes: &[u8]) {
        if !self.writable.load(Ordering::Relaxed) {
            return;
        }
        if let Err(error) = self.io.write(path, bytes)
            && self.writable.swap(false, Ordering::Relaxed)
        {
            let text =
                format!("the cache at {} cannot be written ({error}); the run goes on without", self.root.display());
            *self.warning.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(text);
        }
    }

    /// The one warning, if writing failed since it was last taken.
    pub fn take_warning(&self) -> Option<String> {
        self.warning.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take()
    }
}

/// Checksum of a file's content under its name, so that files cannot be swapped either.
fn seal(name: &Digest, content: &[u8]) -> Digest {
    crate::value::Hasher::new("sealed").digest(name).bytes(content).finish()
}
