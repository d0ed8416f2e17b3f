//! The one accountant of memory: what values take as long as anybody holds them, and what nodes at work asked for.
//!
//! Values carry their charges: a buffer's ends when its last reader lets go of it, whoever that is. Memory that lies
//! ready for new buffers is counted beside, and is the first to go.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::value::{cut_shelf, shelf_bytes};

/// Counts bytes against a bound.
pub(crate) struct Memory {
    bound: u64,
    /// What is known of pairs. It cannot be refused, so it narrows the room for all else.
    notes: AtomicU64,
    used: AtomicU64,
    leases: AtomicUsize,
}

impl Memory {
    pub fn new(bound: u64) -> Arc<Self> {
        Arc::new(Self { bound, notes: AtomicU64::new(0), used: AtomicU64::new(0), leases: AtomicUsize::new(0) })
    }

    /// Most bytes that may be in use beside the notes; the notes leave an eighth of the bound, however many they are.
    pub fn room(&self) -> u64 {
        self.bound - self.notes.load(Ordering::Relaxed).min(self.bound / 8 * 7)
    }

    /// Whether notes take more than half of the bound.
    pub fn is_cluttered(&self) -> bool {
        self.notes.load(Ordering::Relaxed) > self.bound / 2
    }

    /// Counts what is noted of pairs until it is dropped.
    pub fn note(self: &Arc<Self>, bytes: u64) -> Note {
        self.notes.fetch_add(bytes, Ordering::Relaxed);
        Note { memory: self.clone(), bytes }
    }

    /// Bytes in use now.
    pub fn used(&self) -> u64 {
        self.used.load(Ordering::Relaxed)
    }

    /// Whether more is in use than may be.
    pub fn is_over(&self) -> bool {
        self.used() > self.room()
    }

    /// Nodes at work that may ask for memory.
    pub fn leases(&self) -> usize {
        self.leases.load(Ordering::Relaxed)
    }

    /// A place to ask for memory from.
    pub fn lease(self: &Arc<Self>) -> Lease {
        self.leases.fetch_add(1, Ordering::Relaxed);
        Lease { memory: self.clone(), account: Mutex::default() }
    }

    fn try_take(&self, bytes: u64) -> bool {
        if bytes == 0 {
            return true;
        }
        let room = self.room();
        let add = |used: u64| used.checked_add(bytes).filter(|&used| used <= room);
        self.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, add).is_ok()
    }
}

/// Bytes in use until it is dropped.
pub(crate) struct Charge {
    memory: Arc<Memory>,
    bytes: u64,
}

impl Drop for Charge {
    fn drop(&mut self) {
        self.memory.used.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// What is noted of pairs, until it is dropped.
pub(crate) struct Note {
    memory: Arc<Memory>,
    bytes: u64,
}

impl Drop for Note {
    fn drop(&mut self) {
        self.memory.notes.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// What memory is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Purpose {
    /// Planes of samples: memory that lies ready may do.
    Planes,
    /// Anything else: it comes fresh from the system.
    Other,
}

/// What one node at work holds. What is left of it is given back when it is dropped.
pub(crate) struct Lease {
    memory: Arc<Memory>,
    account: Mutex<Account>,
}

#[derive(Default)]
struct Account {
    held: u64,
    asked: u64,
}

impl Lease {
    fn account(&self) -> MutexGuard<'_, Account> {
        self.account.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes so much before the node asks for it.
    pub fn advance(&self, bytes: u64) -> bool {
        let taken = self.memory.try_take(bytes);
        if taken {
            self.account().held += bytes;
        }
        taken
    }

    /// Asks for more, if there is room for it; what was advanced comes first.
    pub fn grow(&self, bytes: u64, purpose: Purpose) -> bool {
        let mut account = self.account();
        let asked = account.asked.saturating_add(bytes);
        let more = asked.saturating_sub(account.held);
        if !self.memory.try_take(more) {
            return false;
        }
        (account.held, account.asked) = (account.held + more, asked);
        drop(account);
        let free = self.memory.room().saturating_sub(self.memory.used());
        let keep = free.saturating_add(if purpose == Purpose::Planes { bytes } else { 0 });
        if shelf_bytes() > keep {
            cut_shelf(keep);
        }
        true
    }

    /// Takes more, room or no room.
    pub fn grow_anyway(&self, bytes: u64) {
        let mut account = self.account();
        account.asked += bytes;
        let more = account.asked.saturating_sub(account.held);
        account.held += more;
        self.memory.used.fetch_add(more, Ordering::Relaxed);
    }

    /// Bytes the node asked for so far.
    pub fn asked(&self) -> u64 {
        self.account().asked
    }

    /// A charge for a value that the node made, out of what it holds as far as that goes.
    pub fn pay(&self, bytes: u64) -> Charge {
        let mut account = self.account();
        let paid = bytes.min(account.held);
        account.held -= paid;
        self.memory.used.fetch_add(bytes - paid, Ordering::Relaxed);
        Charge { memory: self.memory.clone(), bytes }
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        self.memory.used.fetch_sub(self.account().held, Ordering::Relaxed);
        self.memory.leases.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Three quarters of the memory that this process may use: the machine's, or that of a container around it if less.
pub(crate) fn default_room() -> u64 {
    let meminfo = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let machine = kernel_bytes(&meminfo, "MemTotal:").unwrap_or(8 << 30);
    let groups = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    group_files(&groups)
        .filter_map(|path| std::fs::read_to_string(path).ok()?.trim().parse::<u64>().ok())
        .fold(machine, u64::min)
        / 4
        * 3
}

/// The size after `name` in a text of lines such as `VmRSS:  1024 kB`.
pub(crate) fn kernel_bytes(text: &str, name: &str) -> Option<u64> {
    let size = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(size.trim().trim_end_matches("kB").trim().parse::<u64>().ok()? * 1024)
}

/// Files that may hold a limit, for each control group in the text of `/proc/self/cgroup` and all those around it.
fn group_files(groups: &str) -> impl Iterator<Item = String> {
    groups.lines().flat_map(|line| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
        let (root, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            _ => ("/sys/fs/cgroup/memory", "memory.limit_in_bytes"),
        };
        let is_memory = controllers.is_empty() || controllers.split(',').any(|name| name == "memory");
        let around = std::path::Path::new(path).ancestors().filter(move |_| is_memory);
        let files: Vec<String> =
            around.map(|group| format!("{root}{}/{file}", group.display().to_string().trim_end_matches('/'))).collect();
        files
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charges_and_leases_end_with_their_holders() {
        let memory = Memory::new(100);
        let lease = memory.lease();
        assert!(lease.advance(60) && !lease.advance(50), "60 of 100 are taken");
        assert!(lease.grow(40, Purpose::Other) && memory.used() == 60, "out of the advance");
        assert!(lease.grow(50, Purpose::Other) && memory.used() == 90);
        assert!(!lease.grow(11, Purpose::Other));
        assert_eq!(lease.asked(), 90);
        let value = lease.pay(70);
        drop(lease);
        assert_eq!((memory.used(), memory.leases()), (70, 0));
        let notes = memory.note(50);
        assert!(memory.is_over() && memory.room() == 50 && !memory.is_cluttered());
        let more = memory.note(1000);
        assert!(memory.room() == 16 && memory.is_cluttered());
        drop((value, notes, more));
        assert_eq!((memory.used(), memory.room()), (0, 100));
    }

    #[test]
    fn limits_of_all_groups_around_count() {
        let files: Vec<String> = group_files("5:cpu:/a\n4:memory:/a/b\n0::/c d\n").collect();
        assert_eq!(
            files,
            [
                "/sys/fs/cgroup/memory/a/b/memory.limit_in_bytes",
                "/sys/fs/cgroup/memory/a/memory.limit_in_bytes",
                "/sys/fs/cgroup/memory/memory.limit_in_bytes",
                "/sys/fs/cgroup/c d/memory.max",
                "/sys/fs/cgroup/memory.max",
            ]
        );
    }
}
