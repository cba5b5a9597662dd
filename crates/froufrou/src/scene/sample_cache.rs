//! The last two samples of something, kept so that a dense sequence of times does not read the same
//! bytes over and over.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// How much all caches of one file hold together. A file may let thousands of meshes share one
/// big block; beyond the limit samples are read but not kept.
#[derive(Debug)]
pub(crate) struct Ledger {
    used: AtomicU64,
    limit: u64,
}

impl Ledger {
    pub(crate) fn new(limit: u64) -> Arc<Self> {
        Arc::new(Self { used: AtomicU64::new(0), limit })
    }
}

/// A sample in a cache, and its entry in the ledger.
#[derive(Debug)]
struct Kept<T> {
    sample: Arc<T>,
    bytes: u64,
    ledger: Arc<Ledger>,
}

impl<T> Kept<T> {
    fn new(sample: Arc<T>, bytes: u64, ledger: &Arc<Ledger>) -> Option<Self> {
        let kept = Self { sample, bytes, ledger: Arc::clone(ledger) };
        // If this is too much, dropping `kept` takes it off again.
        (ledger.used.fetch_add(bytes, Ordering::Relaxed) + bytes <= ledger.limit).then_some(kept)
    }
}

impl<T> Drop for Kept<T> {
    fn drop(&mut self) {
        self.ledger.used.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// The two samples that were asked for last.
#[derive(Debug)]
pub(crate) struct SampleCache<K, T> {
    /// At most two, the latest last.
    kept: Mutex<Vec<(K, Kept<T>)>>,
    ledger: Arc<Ledger>,
}

impl<K: PartialEq, T> SampleCache<K, T> {
    pub(crate) fn new(ledger: &Arc<Ledger>) -> Self {
        Self { kept: Mutex::new(Vec::new()), ledger: Arc::clone(ledger) }
    }

    /// The sample of a key, from memory or else from `read`; `bytes` is what it takes in memory.
    ///
    /// # Errors
    /// What `read` gives.
    pub(crate) fn get<E>(
        &self,
        key: K,
        read: impl FnOnce() -> Result<T, E>,
        bytes: impl FnOnce(&T) -> u64,
    ) -> Result<Arc<T>, E> {
        // A thread that panicked elsewhere leaves whole samples here, so its poison is harmless.
        let lock = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        {
            let mut kept = lock();
            if let Some(found) = kept.iter().position(|(other, _)| *other == key) {
                let last = kept.len() - 1;
                kept.swap(found, last);
                return Ok(Arc::clone(&kept[last].1.sample));
            }
        }
        // Read without the lock: other threads may be at other frames.
        let sample = Arc::new(read()?);
        let bytes = bytes(&sample);
        let mut kept = lock();
        if kept.len() >= 2 {
            kept.remove(0);
        }
        if let Some(entry) = Kept::new(Arc::clone(&sample), bytes, &self.ledger) {
            kept.push((key, entry));
        }
        Ok(sample)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_two_are_kept_and_older_ones_read_again() {
        let cache = SampleCache::new(&Ledger::new(1000));
        let mut reads = Vec::new();
        for key in [0, 1, 0, 1, 2, 1, 2, 0, 2] {
            let sample = cache
                .get(
                    key,
                    || -> Result<i32, ()> {
                        reads.push(key);
                        Ok(key * 10)
                    },
                    |_| 8,
                )
                .expect("a read");
            assert_eq!(*sample, key * 10);
        }
        assert_eq!(reads, [0, 1, 2, 0]);
    }

    #[test]
    fn what_exceeds_the_limit_is_given_but_not_kept() {
        let ledger = Ledger::new(100);
        let (small, big) = (SampleCache::new(&ledger), SampleCache::new(&ledger));
        let mut reads = 0;
        for _ in 0..3 {
            small.get(0, || -> Result<i32, ()> { Ok(1) }, |_| 60).expect("a read");
            big.get(
                0,
                || -> Result<i32, ()> {
                    reads += 1;
                    Ok(2)
                },
                |_| 60,
            )
            .expect("a read");
        }
        assert_eq!(reads, 3);
        assert_eq!(ledger.used.load(Ordering::Relaxed), 60);
        drop(small);
        assert_eq!(ledger.used.load(Ordering::Relaxed), 0);
    }
}
