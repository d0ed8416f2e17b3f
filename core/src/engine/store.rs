//! What is known: action key -> record, digest -> value; in memory, and on disk behind it.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};

use super::context::Artifact;
use super::disk::DiskTier;
use crate::value::{Digest, Outline, Value};

/// What is kept of an executed action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    pub outputs: Vec<Outline>,
    pub artifacts: Vec<Artifact>,
    pub stats: serde_json::Map<String, serde_json::Value>,
    pub seconds: f64,
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

type Waker = Box<dyn FnOnce() + Send>;

/// The two tables, and who is at work on what.
pub(crate) struct Store {
    records: Mutex<HashMap<Digest, Arc<Record>>>,
    values: Mutex<Values>,
    at_work: Mutex<HashMap<Digest, Vec<Waker>>>,
    pub disk: Option<DiskTier>,
    policy: StorePolicy,
}

/// Values in memory under a byte budget, evicted by the clock algorithm: a hit sets a flag and moves nothing.
struct Values {
    entries: HashMap<Digest, Entry>,
    clock: VecDeque<Digest>,
    bytes: u64,
    budget: u64,
}

struct Entry {
    value: Value,
    bytes: u64,
    used: bool,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Store {
    pub fn new(budget: u64, disk: Option<DiskTier>, policy: StorePolicy) -> Self {
        let values = Values { entries: HashMap::new(), clock: VecDeque::new(), bytes: 0, budget };
        Self { records: Mutex::default(), values: Mutex::new(values), at_work: Mutex::default(), disk, policy }
    }

    pub fn record(&self, key: &Digest) -> Option<Arc<Record>> {
        if let Some(record) = lock(&self.records).get(key) {
            return Some(record.clone());
        }
        let record: Arc<Record> = Arc::new(self.disk.as_ref()?.load_json("records", key)?);
        lock(&self.records).insert(*key, record.clone());
        Some(record)
    }

    pub fn insert_record(&self, key: Digest, record: Arc<Record>) {
        if let Some(disk) = &self.disk {
            disk.save_json("records", &key, &*record);
        }
        lock(&self.records).insert(key, record);
    }

    /// A value by its digest, from memory or else from disk.
    pub fn value(&self, outline: &Outline) -> Option<(Value, Tier)> {
        if let Some(entry) = lock(&self.values).entries.get_mut(&outline.digest) {
            entry.used = true;
            return Some((entry.value.clone(), Tier::Memory));
        }
        if !outline.storable {
            return None;
        }
        let value = self.disk.as_ref()?.load_value(&outline.digest)?;
        lock(&self.values).insert(outline.digest, value.clone(), outline.bytes);
        Some((value, Tier::Disk))
    }

    /// Keeps a computed value in memory, and on disk where the policy says so.
    pub fn insert_value(&self, outline: &Outline, value: &Value, seconds: f64) {
        lock(&self.values).insert(outline.digest, value.clone(), outline.bytes);
        let worth_storing = match self.policy {
            StorePolicy::All => true,
            StorePolicy::Auto => seconds > outline.bytes as f64 / LOAD_BYTES_PER_SECOND,
        };
        if let Some(disk) =
            self.disk.as_ref().filter(|disk| worth_storing && outline.storable && !disk.has_value(&outline.digest))
        {
            disk.save_value(&outline.digest, value);
        }
    }

    /// Takes the work on `key`, or, if somebody has it, arranges for `waker` to be called when they are done.
    pub fn take_work(&self, key: Digest, waker: impl FnOnce() + Send + 'static) -> bool {
        match lock(&self.at_work).entry(key) {
            std::collections::hash_map::Entry::Vacant(entry) => {
                entry.insert(Vec::new());
                true
            }
            std::collections::hash_map::Entry::Occupied(mut entry) => {
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

impl Values {
    fn insert(&mut self, digest: Digest, value: Value, bytes: u64) {
        if bytes > self.budget || self.entries.contains_key(&digest) {
            return;
        }
        while self.bytes + bytes > self.budget {
            let Some(oldest) = self.clock.pop_front() else { break };
            let Some(entry) = self.entries.get_mut(&oldest) else { continue };
            if std::mem::take(&mut entry.used) {
                self.clock.push_back(oldest);
            } else if let Some(entry) = self.entries.remove(&oldest) {
                self.bytes -= entry.bytes;
            }
        }
        self.bytes += bytes;
        self.entries.insert(digest, Entry { value, bytes, used: false });
        self.clock.push_back(digest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_keeps_what_is_used_within_the_budget() {
        let store = Store::new(40, None, StorePolicy::Auto);
        let numbers: Vec<Value> = (0..8).map(|i| Value::Number(f64::from(i))).collect();
        let outlines: Vec<Outline> = numbers.iter().map(Outline::of).collect();
        for (outline, value) in outlines.iter().zip(&numbers).take(5) {
            store.insert_value(outline, value, 0.0);
        }
        assert!(store.value(&outlines[0]).is_some());
        store.insert_value(&outlines[5], &numbers[5], 0.0);
        let kept: Vec<bool> = outlines.iter().map(|outline| store.value(outline).is_some()).collect();
        assert_eq!(kept, [true, false, true, true, true, true, false, false]);
    }

    #[test]
    fn work_is_taken_once_and_waiters_are_woken() {
        let store = Store::new(0, None, StorePolicy::Auto);
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
