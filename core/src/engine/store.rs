//! What is known: action key -> record, digest -> value; in memory, and on disk behind it.

use std::collections::{HashMap, hash_map};
use std::hash::{BuildHasherDefault, Hasher};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

use serde::{Deserialize, Serialize};

use super::context::Artifact;
use super::disk::{DiskTier, Table};
use super::memory::{Charge, Lease, Memory, Note};
use crate::registry::NodeType;
use crate::value::{Digest, Outline, Value, cut_shelf, shelf_bytes};

/// What is kept of an executed action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    pub outputs: Vec<Outline>,
    pub artifacts: Vec<Artifact>,
    pub stats: serde_json::Map<String, serde_json::Value>,
    #[serde(default)]
    pub warnings: Vec<String>,
    pub seconds: f64,
}

impl Record {
    /// Whether it can be of a node of that type.
    pub fn fits(&self, node_type: &NodeType) -> bool {
        self.outputs.len() == node_type.outputs.len()
    }

    /// Memory that its values take.
    pub fn value_bytes(&self) -> u64 {
        self.outputs.iter().map(|outline| outline.bytes).sum()
    }

    /// Memory it takes, roughly.
    fn bytes(&self) -> u64 {
        let channels: usize = self.outputs.iter().map(|outline| outline.channels.len()).sum();
        let stats = self.stats.len() * 64;
        let warnings: usize = self.warnings.iter().map(|text| 64 + text.len()).sum();
        let artifacts = 256 * self.artifacts.len();
        (512 + size_of_val(self.outputs.as_slice()) + 96 * channels + artifacts + stats + warnings) as u64
    }
}

/// Which values go to disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum StorePolicy {
    /// Those that are cheaper to load than to compute again.
    #[default]
    Auto,
    /// All that can be written.
    All,
}

/// Where a value came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tier {
    Memory,
    Disk,
}

/// A disk reads and checks about this many bytes in a second; what took longer to compute is worth storing.
const LOAD_BYTES_PER_SECOND: f64 = 400e6;

/// Memory that a value takes beside its content.
const OVERHEAD: u64 = 256;

/// A value in memory. Whoever holds it keeps it there; nobody but the store may let it go.
pub(crate) struct Kept {
    pub value: Value,
    /// What it costs to have it again, seconds per byte.
    cost: f64,
    /// When it is worth to be let go of, as the bits of an f64.
    credit: AtomicU64,
    /// For all of it but its planes, which carry their own.
    _charge: Charge,
}

/// A record in memory.
#[derive(Clone)]
struct Noted {
    record: Arc<Record>,
    _note: Arc<Note>,
}

type Waker = Box<dyn FnOnce() + Send>;

/// The two tables, and who is at work on what.
pub(crate) struct Store {
    records: Shards<Noted>,
    values: Shards<Arc<Kept>>,
    /// The credit of what was let go of last, as the bits of an f64: what is used now is worth that much more.
    level: AtomicU64,
    evicting: Mutex<()>,
    at_work: Mutex<HashMap<Digest, Vec<Waker>>>,
    pub memory: Arc<Memory>,
    pub disk: Option<DiskTier>,
    policy: StorePolicy,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Store {
    pub fn new(memory: Arc<Memory>, disk: Option<DiskTier>, policy: StorePolicy) -> Self {
        Self {
            records: Shards::default(),
            values: Shards::default(),
            level: AtomicU64::new(0),
            evicting: Mutex::default(),
            at_work: Mutex::default(),
            memory,
            disk,
            policy,
        }
    }

    /// A record that is in memory.
    pub fn record_at_hand(&self, key: &Digest) -> Option<Arc<Record>> {
        self.records.get(key, |noted| noted.record.clone())
    }

    /// A record, from memory or else from disk.
    pub fn record(&self, key: &Digest) -> Option<Arc<Record>> {
        self.record_at_hand(key).or_else(|| {
            let record: Arc<Record> = Arc::new(self.disk.as_ref()?.load_json(Table::Records, key)?);
            self.remember(*key, record.clone());
            Some(record)
        })
    }

    pub fn insert_record(&self, key: Digest, record: Arc<Record>) {
        if let Some(disk) = &self.disk {
            disk.save_json(Table::Records, &key, &*record);
        }
        self.remember(key, record);
    }

    fn remember(&self, key: Digest, record: Arc<Record>) {
        let note = Arc::new(self.memory.note(record.bytes()));
        self.records.insert(key, Noted { record, _note: note });
    }

    /// Forgets records that can be read again, if all there are take too much memory.
    pub fn tidy(&self) {
        if self.memory.is_cluttered() && self.disk.as_ref().is_some_and(DiskTier::is_writable) {
            self.records.clear();
        }
    }

    /// A value that is in memory. A hit moves nothing and waits for nobody who reads.
    fn value_at_hand(&self, digest: &Digest) -> Option<Arc<Kept>> {
        let kept = self.values.get(digest, Arc::clone)?;
        self.renew(&kept);
        Some(kept)
    }

    /// All outputs of a record that are in memory, if all are.
    pub fn values_at_hand(&self, record: &Record) -> Option<Vec<Arc<Kept>>> {
        record.outputs.iter().map(|outline| self.value_at_hand(&outline.digest)).collect()
    }

    /// A value by its digest, from memory or else from disk, where it takes memory that `lease` has.
    pub fn value(&self, outline: &Outline, lease: &Lease) -> Option<(Arc<Kept>, Tier)> {
        if let Some(kept) = self.value_at_hand(&outline.digest) {
            return Some((kept, Tier::Memory));
        }
        let value = self.disk.as_ref().filter(|_| outline.storable)?.load_value(&outline.digest)?;
        Some((self.keep(outline, value, 1.0 / LOAD_BYTES_PER_SECOND, lease), Tier::Disk))
    }

    /// Whether a value need not be computed.
    pub fn has_value(&self, outline: &Outline) -> Option<Tier> {
        if self.values.get(&outline.digest, |_| ()).is_some() {
            return Some(Tier::Memory);
        }
        let disk = self.disk.as_ref().filter(|_| outline.storable)?;
        disk.has_value(&outline.digest).then_some(Tier::Disk)
    }

    /// Keeps a computed value in memory, and on disk where the policy says so.
    pub fn insert_value(&self, outline: &Outline, value: Value, seconds: f64, lease: &Lease) -> Arc<Kept> {
        let per_byte = seconds / outline.bytes.max(1) as f64;
        let worth_storing = self.policy == StorePolicy::All || per_byte > 1.0 / LOAD_BYTES_PER_SECOND;
        let disk = self.disk.as_ref().filter(|_| worth_storing && outline.storable);
        if let Some(disk) = disk.filter(|disk| !disk.has_value(&outline.digest)) {
            disk.save_value(&outline.digest, &value);
        }
        let cost = if disk.is_some() { per_byte.min(1.0 / LOAD_BYTES_PER_SECOND) } else { per_byte };
        self.keep(outline, value, cost, lease)
    }

    /// Keeps a value on disk whatever the policy says: it is about to leave memory, and still needed.
    pub fn rescue(&self, outline: &Outline, kept: &Kept) {
        let disk = self.disk.as_ref().filter(|disk| outline.storable && !disk.has_value(&outline.digest));
        if let Some(disk) = disk {
            disk.save_value(&outline.digest, &kept.value);
        }
    }

    fn keep(&self, outline: &Outline, value: Value, cost: f64, lease: &Lease) -> Arc<Kept> {
        let planes = value.planes();
        let rest = value.bytes() - planes.iter().map(|plane| plane.bytes()).sum::<u64>();
        for plane in planes.iter().filter(|plane| !plane.is_accompanied()) {
            plane.accompany(Box::new(lease.pay(plane.bytes())));
        }
        let kept = Kept { value, cost, credit: AtomicU64::new(0), _charge: lease.pay(rest + OVERHEAD) };
        self.renew(&kept);
        self.values.insert_first(outline.digest, Arc::new(kept))
    }

    /// GreedyDual (Cao, Irani 1997): what is used is worth its cost per byte more than what was let go of last.
    fn renew(&self, kept: &Kept) {
        let credit = f64::from_bits(self.level.load(Ordering::Relaxed)) + kept.cost;
        kept.credit.store(credit.to_bits(), Ordering::Relaxed);
    }

    /// Lets go of values that nobody holds, those of least credit first, until `bytes` more fit, or nothing is left.
    pub fn make_room(&self, bytes: u64) -> bool {
        let fits = || self.memory.used().saturating_add(bytes) <= self.memory.room();
        if fits() {
            return true;
        }
        let _one_at_a_time = lock(&self.evicting);
        let mut free: Vec<(f64, Digest)> = Vec::new();
        self.values.for_each(|digest, kept| {
            if Arc::strong_count(kept) == 1 {
                free.push((f64::from_bits(kept.credit.load(Ordering::Relaxed)), *digest));
            }
        });
        free.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // A little more than is asked for, so that not every value that comes has to look at all of them.
        let spare = bytes.saturating_add(self.memory.room() / 64);
        for (credit, digest) in free {
            if self.memory.used().saturating_add(spare) <= self.memory.room() {
                break;
            }
            // Numbers that are not negative rise with their bits.
            self.level.fetch_max(credit.to_bits(), Ordering::Relaxed);
            // Somebody may hold it by now; then it stays alive with its charge, and out of the table.
            drop(self.values.remove(&digest));
        }
        let fits = fits();
        if !fits && shelf_bytes() > 0 {
            cut_shelf(0);
        }
        fits
    }

    /// Lets go of what is over the bound since its last holder let go of it.
    pub fn settle(&self) {
        if self.memory.is_over() {
            self.make_room(0);
        }
    }

    /// Takes the work on `key`, or, if somebody has it, arranges for `waker` to be called when they are done.
    pub fn take_work(&self, key: Digest, waker: impl FnOnce() + Send + 'static) -> bool {
        match lock(&self.at_work).entry(key) {
            hash_map::Entry::Vacant(entry) => {
                entry.insert(Vec::new());
                true
            }
            hash_map::Entry::Occupied(mut entry) => {
                entry.get_mut().push(Box::new(waker));
                false
            }
        }
    }

    /// Ends the work on `key`, well or badly, and wakes those who wait.
    pub fn end_work(&self, key: &Digest) {
        let wakers = lock(&self.at_work).remove(key).unwrap_or_default();
        wakers.into_iter().for_each(|wake| wake());
    }
}

/// A table by digest in parts, so that threads seldom meet at a lock.
struct Shards<V>([RwLock<HashMap<Digest, V, BuildHasherDefault<ByDigest>>>; 64]);

impl<V> Default for Shards<V> {
    fn default() -> Self {
        Self(std::array::from_fn(|_| RwLock::default()))
    }
}

impl<V: Clone> Shards<V> {
    fn shard(&self, digest: &Digest) -> &RwLock<HashMap<Digest, V, BuildHasherDefault<ByDigest>>> {
        // Not a byte that the table's own hash is made of.
        &self.0[usize::from(digest.0[31]) % self.0.len()]
    }

    fn get<T>(&self, digest: &Digest, see: impl FnOnce(&V) -> T) -> Option<T> {
        self.shard(digest).read().unwrap_or_else(PoisonError::into_inner).get(digest).map(see)
    }

    fn insert(&self, digest: Digest, value: V) {
        self.shard(&digest).write().unwrap_or_else(PoisonError::into_inner).insert(digest, value);
    }

    /// Keeps what is there, and gives it.
    fn insert_first(&self, digest: Digest, value: V) -> V {
        let mut shard = self.shard(&digest).write().unwrap_or_else(PoisonError::into_inner);
        shard.entry(digest).or_insert(value).clone()
    }

    fn remove(&self, digest: &Digest) -> Option<V> {
        self.shard(digest).write().unwrap_or_else(PoisonError::into_inner).remove(digest)
    }

    fn clear(&self) {
        self.0.iter().for_each(|shard| shard.write().unwrap_or_else(PoisonError::into_inner).clear());
    }

    fn for_each(&self, mut visit: impl FnMut(&Digest, &V)) {
        for shard in &self.0 {
            let shard = shard.read().unwrap_or_else(PoisonError::into_inner);
            shard.iter().for_each(|(digest, value)| visit(digest, value));
        }
    }
}

/// A digest is its own hash.
#[derive(Default)]
struct ByDigest(u64);

impl Hasher for ByDigest {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, _: &[u8]) {
        unreachable!("a digest hashes as one number")
    }

    fn write_u64(&mut self, number: u64) {
        self.0 = number;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: u32) -> (Vec<Value>, Vec<Outline>) {
        let numbers: Vec<Value> = (0..count).map(|i| Value::Number(f64::from(i))).collect();
        let outlines = numbers.iter().map(Outline::of).collect();
        (numbers, outlines)
    }

    /// A store with room for so many numbers.
    fn store(count: u64) -> Store {
        Store::new(Memory::new(count * (OVERHEAD + 8) * 64 / 63), None, StorePolicy::Auto)
    }

    fn insert(store: &Store, outline: &Outline, value: &Value, seconds: f64) {
        let lease = store.memory.lease();
        store.make_room(OVERHEAD + 8);
        drop(store.insert_value(outline, value.clone(), seconds, &lease));
    }

    fn kept(store: &Store, outlines: &[Outline]) -> Vec<bool> {
        outlines.iter().map(|outline| store.values.get(&outline.digest, |_| ()).is_some()).collect()
    }

    #[test]
    fn what_is_cheap_per_byte_goes_first_and_use_keeps() {
        let (numbers, outlines) = numbers(6);
        let store = store(4);
        for (at, seconds) in [8.0, 2.0, 4.0, 2.5].into_iter().enumerate() {
            insert(&store, &outlines[at], &numbers[at], seconds);
        }
        insert(&store, &outlines[4], &numbers[4], 4.0);
        assert_eq!(kept(&store, &outlines), [true, false, true, true, true, false], "the cheapest went");
        // What came later is worth 2 more, and what is used now is too: 3 has 2.5 + 2 and outlives 2 with 4.
        assert!(store.value_at_hand(&outlines[3].digest).is_some());
        insert(&store, &outlines[5], &numbers[5], 4.0);
        assert_eq!(kept(&store, &outlines), [true, false, false, true, true, true]);
    }

    #[test]
    fn what_is_held_stays_and_its_bytes_are_counted_until_it_is_not() {
        let (numbers, outlines) = numbers(3);
        let store = store(1);
        insert(&store, &outlines[0], &numbers[0], 1.0);
        let held = store.value_at_hand(&outlines[0].digest);
        insert(&store, &outlines[1], &numbers[1], 1.0);
        assert_eq!(kept(&store, &outlines), [true, true, false]);
        assert!(store.memory.is_over());
        store.settle();
        assert_eq!(kept(&store, &outlines), [true, false, false]);
        drop(held);
        assert!(!store.memory.is_over());
        insert(&store, &outlines[2], &numbers[2], 1.0);
        assert_eq!(kept(&store, &outlines), [false, false, true]);
    }

    #[test]
    fn work_is_taken_once_and_waiters_are_woken() {
        let store = store(1);
        let key = Digest([1; 32]);
        let woken = Arc::new(Mutex::new(0));
        assert!(store.take_work(key, || unreachable!("the taker does not wait")));
        for _ in 0..3 {
            let woken = woken.clone();
            assert!(!store.take_work(key, move || *lock(&woken) += 1));
        }
        store.end_work(&key);
        assert_eq!(*lock(&woken), 3);
        assert!(store.take_work(key, || ()), "the work is free again");
    }
}
