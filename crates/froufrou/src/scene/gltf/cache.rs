//! What was read last and may be asked for again, up to a number of bytes.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Arc, Mutex, PoisonError};

use crate::Result;

/// Values by key; those not asked for longest make room for others.
#[derive(Debug)]
pub(super) struct Cache<K, T> {
    kept: Mutex<Kept<K, T>>,
    limit: u64,
}

#[derive(Debug)]
struct Kept<K, T> {
    values: HashMap<K, Entry<T>>,
    bytes: u64,
    clock: u64,
}

#[derive(Debug)]
struct Entry<T> {
    value: Arc<T>,
    bytes: u64,
    asked: u64,
}

impl<K: Copy + Eq + Hash, T> Cache<K, T> {
    /// A cache of so many bytes.
    pub(super) fn new(limit: u64) -> Self {
        let kept = Kept { values: HashMap::new(), bytes: 0, clock: 0 };
        Self { kept: Mutex::new(kept), limit }
    }

    /// The value of a key, from memory or else from `read`; `bytes` is what it takes in memory.
    ///
    /// # Errors
    /// What `read` gives.
    pub(super) fn get(
        &self,
        key: K,
        read: impl FnOnce() -> Result<T>,
        bytes: impl FnOnce(&T) -> usize,
    ) -> Result<Arc<T>> {
        // A thread that panicked elsewhere leaves whole values here, so its poison is harmless.
        let lock = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        {
            let mut kept = lock();
            kept.clock += 1;
            let clock = kept.clock;
            if let Some(entry) = kept.values.get_mut(&key) {
                entry.asked = clock;
                return Ok(Arc::clone(&entry.value));
            }
        }
        // Read without the lock: other threads may want other values.
        let value = Arc::new(read()?);
        let bytes = bytes(&value) as u64;
        if bytes > self.limit {
            return Ok(value);
        }
        let mut kept = lock();
        while kept.bytes + bytes > self.limit {
            let oldest = kept.values.iter().min_by_key(|(_, entry)| entry.asked).map(|(key, _)| *key);
            let Some(removed) = oldest.and_then(|key| kept.values.remove(&key)) else { break };
            kept.bytes -= removed.bytes;
        }
        let entry = Entry { value: Arc::clone(&value), bytes, asked: kept.clock };
        kept.bytes += bytes;
        if let Some(replaced) = kept.values.insert(key, entry) {
            kept.bytes -= replaced.bytes;
        }
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_makes_room_and_what_is_too_big_is_not_kept() {
        let cache = Cache::new(100);
        let mut reads = Vec::new();
        for key in [40, 50, 40, 30, 40, 50, 101, 101, 40] {
            let read = || {
                reads.push(key);
                Ok(key)
            };
            assert_eq!(*cache.get(key, read, |bytes| *bytes).expect("a read"), key);
        }
        // 30 pushed 50 out, and 50 then 30.
        assert_eq!(reads, [40, 50, 30, 50, 101, 101]);
        assert_eq!(cache.kept.lock().expect("no panic").bytes, 90);
    }
}
