//! Frames in threads: short work that is begun at once and shared with whoever is free in time.
//!
//! A frame's product takes tenths of a millisecond, and waking a thread some hundredths. So the calling
//! thread works too, from the start, and the threads of the pool take from the same queue when they come.

use rayon::{current_num_threads, in_place_scope};
use std::sync::{Mutex, PoisonError};

/// Calls `work` for every one of `parts`, in whatever order, in this thread and up to `helpers` others.
pub(crate) fn each<T: Send>(parts: impl Iterator<Item = T> + Send, helpers: usize, work: impl Fn(T) + Sync) {
    let queue = Mutex::new(parts);
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
    let drain = || {
        while let Some(part) = next() {
            work(part);
        }
    };
    in_place_scope(|scope| {
        for _ in 0..helpers.min(current_num_threads().saturating_sub(1)) {
            scope.spawn(|_| drain());
        }
        drain();
    });
}
