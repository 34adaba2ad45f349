//! Work on several threads: how many there can be, and how it is shared out.

use std::sync::{Mutex, OnceLock, PoisonError};
use std::thread;

/// The number of processors. The system is asked once: its answer takes as long as thousands of lookups.
pub fn processors() -> usize {
    static FOUND: OnceLock<usize> = OnceLock::new();
    *FOUND.get_or_init(|| thread::available_parallelism().map_or(1, |n| n.get()))
}

/// The most threads: more are of no use.
pub const MOST: usize = 256;

/// Does all tasks on at most so many threads, of which the caller's is one. Where the system starts fewer, those do all. Panics if a
/// task does, when the others are done.
pub fn share_out<T: Send>(tasks: impl ExactSizeIterator<Item = T> + Send, threads: usize, work: impl Fn(T) + Sync) {
    let others = tasks.len().min(threads).saturating_sub(1);
    let queue = Mutex::new(tasks);
    let help = || {
        loop {
            // A task that panics is out of the queue by then: what is left in it is whole.
            let next = queue.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(task) = next else { return };
            work(task);
        }
    };
    thread::scope(|scope| {
        for _ in 0..others {
            if thread::Builder::new().spawn_scoped(scope, help).is_err() {
                break;
            }
        }
        help();
    });
}
