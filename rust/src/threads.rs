//! Work on several threads: how many there may be, and how it is shared out.

use std::sync::{Mutex, OnceLock, PoisonError};
use std::thread;

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

/// As many as asked for, or as there are processors; but no more than the user's limit, `sommerl.system.threads.limit`.
pub fn allowed(py: Python, asked: Option<usize>) -> PyResult<usize> {
    static LIMIT: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let limit: Option<usize> = LIMIT.import(py, "sommerl.system.threads", "limit")?.call0()?.extract()?;
    let count = asked.or(limit).unwrap_or_else(processors);
    Ok(count.min(limit.unwrap_or(MOST)).clamp(1, MOST))
}

/// Asked for once: the answer takes as long as thousands of lookups.
fn processors() -> usize {
    static FOUND: OnceLock<usize> = OnceLock::new();
    *FOUND.get_or_init(|| thread::available_parallelism().map_or(1, |n| n.get()))
}

/// More help nobody.
const MOST: usize = 256;

/// Does all tasks, on so many threads at most, of which the caller's is one. Where the system gives no more threads, those that
/// there are do all.
pub fn share_out<T: Send>(tasks: impl ExactSizeIterator<Item = T> + Send, threads: usize, work: impl Fn(T) + Sync) {
    let others = tasks.len().min(threads).saturating_sub(1);
    let queue = Mutex::new(tasks);
    let help = || {
        loop {
            // Whoever had it has not been at work on it: a task that panics has been taken out.
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
