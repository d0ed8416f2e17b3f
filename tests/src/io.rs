//! A file system that is meddled with.

use std::ffi::OsString;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use warploom_core::engine::{Disk, Io, NewFile, Stat};

/// One operation on a file system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Op {
    /// Asking what there is.
    Stat,
    /// Opening a file.
    Open,
    /// Reading a piece of it.
    Read,
    /// Making a file.
    Create,
    /// Writing a piece of it.
    Write,
    /// Waiting until it is on the disk.
    Sync,
    /// Renaming.
    Rename,
    /// Removing.
    Remove,
    /// Making a folder.
    MakeFolder,
    /// Listing a folder.
    List,
    /// Setting times.
    Touch,
}

/// Who meddles.
pub trait Meddler: Send + Sync + 'static {
    /// An error here is the operation's.
    fn before(&self, op: Op, path: &Path) -> io::Result<()> {
        let _ = (op, path);
        Ok(())
    }
    /// What is said of a file.
    fn stat(&self, path: &Path, stat: Stat) -> Stat {
        let _ = path;
        stat
    }
    /// Whether its files are stamped by this machine's clock.
    fn has_our_clock(&self, path: &Path) -> bool {
        Disk.has_our_clock(path)
    }
    /// How many of `length` bytes are written at once.
    fn written(&self, path: &Path, length: usize) -> usize {
        let _ = path;
        length
    }
}

/// The real file system, meddled with.
#[derive(Default)]
pub struct Meddled<M>(Arc<M>);

impl<M> Meddled<M> {
    /// The file system as `meddler` leaves it.
    pub fn new(meddler: M) -> Self {
        Self(Arc::new(meddler))
    }
}

impl<M> std::ops::Deref for Meddled<M> {
    type Target = M;
    fn deref(&self) -> &M {
        &self.0
    }
}

impl<M: Meddler> Io for Meddled<M> {
    fn stat(&self, path: &Path) -> io::Result<Stat> {
        self.0.before(Op::Stat, path)?;
        Ok(self.0.stat(path, Disk.stat(path)?))
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Read + Send>> {
        self.0.before(Op::Open, path)?;
        Ok(Box::new(File { file: Disk.open(path)?, path: path.to_owned(), meddler: self.0.clone() }))
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn NewFile>> {
        self.0.before(Op::Create, path)?;
        Ok(Box::new(File { file: Disk.create(path)?, path: path.to_owned(), meddler: self.0.clone() }))
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.0.before(Op::Rename, to)?;
        Disk.rename(from, to)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        self.0.before(Op::Remove, path)?;
        Disk.remove(path)
    }

    fn make_folder(&self, path: &Path) -> io::Result<()> {
        self.0.before(Op::MakeFolder, path)?;
        Disk.make_folder(path)
    }

    fn list(&self, folder: &Path) -> io::Result<Vec<OsString>> {
        self.0.before(Op::List, folder)?;
        Disk.list(folder)
    }

    fn has_our_clock(&self, path: &Path) -> bool {
        self.0.has_our_clock(path)
    }

    fn touch(&self, path: &Path) -> io::Result<()> {
        self.0.before(Op::Touch, path)?;
        Disk.touch(path)
    }
}

struct File<F: ?Sized, M> {
    path: PathBuf,
    meddler: Arc<M>,
    file: Box<F>,
}

impl<M: Meddler> Read for File<dyn Read + Send, M> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.meddler.before(Op::Read, &self.path)?;
        self.file.read(bytes)
    }
}

impl<M: Meddler> Write for File<dyn NewFile, M> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.meddler.before(Op::Write, &self.path)?;
        let length = self.meddler.written(&self.path, bytes.len());
        self.file.write(&bytes[..length])
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl<M: Meddler> NewFile for File<dyn NewFile, M> {
    fn sync(&mut self) -> io::Result<()> {
        self.meddler.before(Op::Sync, &self.path)?;
        self.file.sync()
    }
}
