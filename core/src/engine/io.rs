//! The door to the file system, so that tests can break it at will, and what is built on it.

use std::ffi::OsString;
use std::io::{self, BufWriter, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use crate::value::Digest;

/// What a file system says of a file without reading it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stat {
    /// Bytes.
    pub size: u64,
    /// Last change of the content, nanoseconds since 1970.
    pub modified: i128,
    /// Last change of content or attributes, nanoseconds since 1970.
    pub changed: i128,
    /// Number of the file in its file system.
    pub inode: u64,
    /// Number of the file system.
    pub device: u64,
}

/// Everything the engine asks of a file system, one operation each.
pub trait Io: Send + Sync {
    /// What there is at `path`; anything but a regular file is an error.
    fn stat(&self, path: &Path) -> io::Result<Stat>;
    /// Opens a regular file for reading.
    fn open(&self, path: &Path) -> io::Result<Box<dyn Read + Send>>;
    /// Makes a file that is not there yet.
    fn create(&self, path: &Path) -> io::Result<Box<dyn NewFile>>;
    /// Gives a file another name, in the place of whatever has it.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;
    /// Removes a file.
    fn remove(&self, path: &Path) -> io::Result<()>;
    /// Makes a folder and those above it; it may be there already.
    fn make_folder(&self, path: &Path) -> io::Result<()>;
    /// Names of what is in a folder.
    fn list(&self, folder: &Path) -> io::Result<Vec<OsString>>;
    /// Whether the file system that `path` lies in stamps files by this machine's clock. A server's clock may be off.
    fn has_our_clock(&self, path: &Path) -> bool;
    /// Says that a file was used: sets its times to now, by the clock of its file system.
    fn touch(&self, path: &Path) -> io::Result<()>;
}

/// A file that is being written.
pub trait NewFile: Write + Send {
    /// Waits until all of it is on the disk. Some file systems tell only now that they have no room for it.
    fn sync(&mut self) -> io::Result<()>;
}

/// The real file system.
pub struct Disk;

impl NewFile for std::fs::File {
    fn sync(&mut self) -> io::Result<()> {
        self.sync_data()
    }
}

impl Io for Disk {
    fn stat(&self, path: &Path) -> io::Result<Stat> {
        let metadata = std::fs::metadata(path)?;
        if !metadata.is_file() {
            return Err(io::Error::new(ErrorKind::InvalidInput, "it is not a regular file"));
        }
        Ok(stat_of(&metadata))
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Read + Send>> {
        // To open a pipe or a device may wait for ever.
        self.stat(path)?;
        Ok(Box::new(std::fs::File::open(path)?))
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn NewFile>> {
        Ok(Box::new(std::fs::File::create_new(path)?))
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        std::fs::rename(from, to)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        std::fs::remove_file(path)
    }

    fn make_folder(&self, path: &Path) -> io::Result<()> {
        std::fs::create_dir_all(path)
    }

    fn list(&self, folder: &Path) -> io::Result<Vec<OsString>> {
        std::fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name())).collect()
    }

    #[cfg(target_os = "linux")]
    fn has_our_clock(&self, path: &Path) -> bool {
        /// ext2 to ext4, XFS, Btrfs, ZFS, F2FS, tmpfs, ramfs and overlays of them.
        const LOCAL: [u32; 8] =
            [0xef53, 0x5846_5342, 0x9123_683e, 0x2fc1_2fc1, 0xf2f5_2010, 0x0102_1994, 0x8584_58f6, 0x794c_7630];
        rustix::fs::statfs(path).is_ok_and(|stat| LOCAL.contains(&(stat.f_type as u32)))
    }

    #[cfg(not(target_os = "linux"))]
    fn has_our_clock(&self, _: &Path) -> bool {
        false
    }

    #[cfg(unix)]
    fn touch(&self, path: &Path) -> io::Result<()> {
        use rustix::fs::{AtFlags, CWD, Timespec, Timestamps, UTIME_NOW, utimensat};
        let now = Timespec { tv_sec: 0, tv_nsec: UTIME_NOW };
        let times = Timestamps { last_access: now, last_modification: now };
        Ok(utimensat(CWD, path, &times, AtFlags::empty())?)
    }

    #[cfg(not(unix))]
    fn touch(&self, path: &Path) -> io::Result<()> {
        std::fs::File::options().write(true).open(path)?.set_modified(SystemTime::now())
    }
}

#[cfg(unix)]
fn stat_of(metadata: &std::fs::Metadata) -> Stat {
    use std::os::unix::fs::MetadataExt;
    let nanoseconds = |seconds: i64, rest: i64| i128::from(seconds) * 1_000_000_000 + i128::from(rest);
    Stat {
        size: metadata.len(),
        modified: nanoseconds(metadata.mtime(), metadata.mtime_nsec()),
        changed: nanoseconds(metadata.ctime(), metadata.ctime_nsec()),
        inode: metadata.ino(),
        device: metadata.dev(),
    }
}

#[cfg(not(unix))]
fn stat_of(metadata: &std::fs::Metadata) -> Stat {
    let since = |time: io::Result<SystemTime>| {
        time.ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok()).map_or(0, |d| d.as_nanos() as i128)
    };
    let modified = since(metadata.modified());
    Stat { size: metadata.len(), modified, changed: modified.max(since(metadata.created())), inode: 0, device: 0 }
}

/// Does it again while a signal comes between.
pub(crate) fn persist<T>(mut operation: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    loop {
        match operation() {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            ended => return ended,
        }
    }
}

/// Whether an error says that a file is not there: on a network, one that another machine removed may be open still.
pub(crate) fn is_gone(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::StaleNetworkFileHandle)
}

/// What there is at `path`.
pub(crate) fn stat(io: &dyn Io, path: &Path) -> io::Result<Stat> {
    persist(|| io.stat(path))
}

/// A regular file and its size.
pub(crate) fn open(io: &dyn Io, path: &Path) -> io::Result<(Box<dyn Read + Send>, u64)> {
    let size = stat(io, path)?.size;
    Ok((persist(|| io.open(path))?, size))
}

/// The whole content of a file.
pub(crate) fn read(io: &dyn Io, path: &Path) -> io::Result<Vec<u8>> {
    let (mut file, size) = open(io, path)?;
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(usize::try_from(size).unwrap_or(usize::MAX).saturating_add(1))?;
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Digest of the whole content of a file.
pub(crate) fn digest(io: &dyn Io, path: &Path) -> io::Result<Digest> {
    let (file, _) = open(io, path)?;
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(file)?;
    Ok(Digest(*hasher.finalize().as_bytes()))
}

/// Removes a file; that it is not there is as good.
pub(crate) fn remove(io: &dyn Io, path: &Path) -> io::Result<()> {
    match persist(|| io.remove(path)) {
        Err(error) if is_gone(&error) => Ok(()),
        ended => ended,
    }
}

/// How sure a file must be on the disk before it gets its name.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Durable {
    /// It is checked when read.
    No,
    /// Nobody will check it.
    Yes,
}

/// Writes a file whole or not at all, in the place of whatever has its name: a temporary file in the same folder,
/// then a rename. Makes missing folders. Whatever goes wrong, the temporary file is removed.
pub(crate) fn replace(
    io: &dyn Io,
    path: &Path,
    durable: Durable,
    content: &mut dyn FnMut(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let temporary = folder.join(Temporary::new_name());
    let file = persist(|| io.create(&temporary)).or_else(|error| match error.kind() {
        ErrorKind::NotFound => {
            persist(|| io.make_folder(folder))?;
            persist(|| io.create(&temporary))
        }
        _ => Err(error),
    })?;
    let written = fill(file, durable, content).and_then(|()| persist(|| io.rename(&temporary, path)));
    written.inspect_err(|_| {
        // The write has failed already; what is left of it is removed as far as that goes.
        let _ = remove(io, &temporary);
    })
}

fn fill(
    file: Box<dyn NewFile>,
    durable: Durable,
    content: &mut dyn FnMut(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 16, file);
    content(&mut out)?;
    let mut file = out.into_inner().map_err(io::IntoInnerError::into_error)?;
    if durable == Durable::Yes { persist(|| file.sync()) } else { Ok(()) }
}

/// Whose temporary file it is: its name tells the machine and the process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Temporary {
    host: u64,
    process: u32,
}

impl Temporary {
    /// A name no other process on any machine and no other thread of this one uses.
    fn new_name() -> String {
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        let count = COUNTER.fetch_add(1, Ordering::Relaxed);
        format!(".warploom-{:x}-{}-{count}-{:x}.tmp", host(), std::process::id(), now() as u64)
    }

    /// The owner of a temporary file; `None` of any other file.
    pub fn of(name: &str) -> Option<Self> {
        let mut parts = name.strip_prefix(".warploom-")?.strip_suffix(".tmp")?.split('-');
        let host = u64::from_str_radix(parts.next()?, 16).ok()?;
        Some(Self { host, process: parts.next()?.parse().ok()? })
    }

    /// Whether its process is known to have ended: one of another machine, or of a container of its own, is not.
    pub fn is_orphan(&self) -> bool {
        self.host == host() && host() != 0 && !is_running(self.process)
    }
}

#[cfg(unix)]
fn is_running(process: u32) -> bool {
    use rustix::process::{Pid, test_kill_process};
    let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) else { return false };
    // Whoever may not signal it is told otherwise than whoever asks for one that is gone.
    test_kill_process(pid) != Err(rustix::io::Errno::SRCH)
}

#[cfg(not(unix))]
fn is_running(_: u32) -> bool {
    true
}

/// A number of this machine since it started, and of the container whose process numbers are ours; 0 if unknown.
pub(crate) fn host() -> u64 {
    static HOST: OnceLock<u64> = OnceLock::new();
    *HOST.get_or_init(|| {
        let Ok(boot) = std::fs::read_to_string("/proc/sys/kernel/random/boot_id") else { return 0 };
        let Ok(processes) = std::fs::read_link("/proc/self/ns/pid") else { return 0 };
        let digest = Digest::of_bytes(format!("{boot}{}", processes.display()).as_bytes());
        let [a, b, c, d, e, f, g, h, ..] = digest.0;
        u64::from_le_bytes([a, b, c, d, e, f, g, h]).max(1)
    })
}

/// A temporary file that nobody is known to have left is taken for one after a day.
pub(crate) const STALE: i128 = 24 * 3600 * 1_000_000_000;

/// Removes temporary files that killed processes left in `folder`.
pub(crate) fn sweep(io: &dyn Io, folder: &Path) {
    // What cannot be listed or removed is no worse than before.
    let names = persist(|| io.list(folder)).unwrap_or_default().into_iter();
    let temporary = names.filter_map(|name| Some((folder.join(&name), Temporary::of(name.to_str()?)?)));
    let (orphans, others): (Vec<_>, Vec<_>) = temporary.partition(|(_, temporary)| temporary.is_orphan());
    let now = if others.is_empty() { None } else { clock_of(io, folder).ok() };
    let is_stale = |path: &PathBuf| Some(now? - stat(io, path).ok()?.modified > STALE);
    let stale = others.into_iter().filter(|(path, _)| is_stale(path) == Some(true));
    for (path, _) in orphans.into_iter().chain(stale) {
        let _ = remove(io, &path);
    }
}

/// The time by the clock of the file system that `folder` lies in, nanoseconds since 1970: a machine's own clock may
/// be days off.
pub(crate) fn clock_of(io: &dyn Io, folder: &Path) -> io::Result<i128> {
    let probe: PathBuf = folder.join(Temporary::new_name());
    drop(persist(|| io.create(&probe))?);
    let time = stat(io, &probe).map(|stat| stat.modified);
    remove(io, &probe)?;
    time
}

/// Nanoseconds since 1970 by this machine's clock.
pub(crate) fn now() -> i128 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos() as i128)
}

/// Writes a file whole or not at all, for good. Makes missing folders. What is no regular file, a pipe or a device, is
/// written into.
pub fn write_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    match path.metadata() {
        Ok(there) if !there.is_file() && !there.is_dir() => {
            std::fs::OpenOptions::new().write(true).open(path)?.write_all(bytes)
        }
        _ => deliver(&Disk, path, bytes),
    }
}

/// Writes a file for people, whole or not at all: a link to it stays one, it keeps its permissions, and one that is
/// read-only is refused, as is what is no regular file.
pub(crate) fn deliver(io: &dyn Io, path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut content = |out: &mut dyn Write| out.write_all(bytes);
    let Ok(there) = path.metadata() else {
        // Not there, or a link to what is not.
        let linked = path.read_link().map(|linked| path.parent().unwrap_or(Path::new("")).join(linked));
        return replace(io, linked.as_deref().unwrap_or(path), Durable::Yes, &mut content);
    };
    if there.is_file() && there.permissions().readonly() {
        return Err(io::Error::new(ErrorKind::PermissionDenied, READ_ONLY));
    }
    if !there.is_file() && !there.is_dir() {
        return Err(io::Error::new(ErrorKind::InvalidInput, "it is not a regular file"));
    }
    let path = path.canonicalize()?;
    replace(io, &path, Durable::Yes, &mut content)?;
    if there.is_file() {
        // The content is whole already: that of another's file cannot keep all permissions is no reason to fail.
        let _ = std::fs::set_permissions(&path, there.permissions());
    }
    Ok(())
}

const READ_ONLY: &str = "it is read-only";

/// An I/O error without the number at its end.
pub fn plain(error: &std::io::Error) -> String {
    let text = error.to_string();
    text.split(" (os error").next().unwrap_or(&text).to_lowercase()
}

/// How a file is written all the same that could not be.
pub fn cannot_write(error: &std::io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "make room there, or write elsewhere",
        ErrorKind::FileTooLarge => "raise the limit on the size of files (`ulimit -f`), or write elsewhere",
        ErrorKind::PermissionDenied if error.to_string() == READ_ONLY => {
            "make it writable (`chmod u+w`), or write elsewhere"
        }
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => "write to a folder that is yours to write to",
        ErrorKind::IsADirectory => "a folder has that name: write to another",
        ErrorKind::NotADirectory | ErrorKind::AlreadyExists => "a file has the name of a folder: write elsewhere",
        _ => "write to another file or folder",
    }
}
