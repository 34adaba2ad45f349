//! How many threads may work.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use sommerl_kernels::threads::{MOST, processors};

/// As many as were asked for, or as there are processors; but no more than the user's limit, `sommerl.system.threads.limit`.
pub fn allowed(py: Python, asked: Option<usize>) -> PyResult<usize> {
    static LIMIT: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let limit: Option<usize> = LIMIT.import(py, "sommerl.system.threads", "limit")?.call0()?.extract()?;
    let count = asked.or(limit).unwrap_or_else(processors);
    Ok(count.min(limit.unwrap_or(MOST)).clamp(1, MOST))
}
