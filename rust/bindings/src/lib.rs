//! Sommerl's core as a Python module: it converts arguments, refuses what does not fit, and calls `sommerl_kernels` and
//! `sommerl_codec`. The contracts are in `python/sommerl/_core.pyi`.

mod convert;
mod learner;
mod least_squares;
mod lookup;
mod node_palette;
mod quantiser;
mod threads;

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use sommerl_simd::InstructionSet;

/// Does the work of an entry point, and raises RuntimeError if it panics: that is a fault of this library. PyO3 would raise an
/// exception that `except Exception` does not catch.
fn guarded<T>(work: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|fault| {
        let what = text(fault.as_ref());
        Err(PyRuntimeError::new_err(format!(
            "the core: expected no fault of its own, found one ({what}); please report it"
        )))
    })
}

/// What a panic said.
fn text(fault: &(dyn Any + Send)) -> &str {
    match (fault.downcast_ref::<String>(), fault.downcast_ref::<&str>()) {
        (Some(text), _) => text,
        (_, Some(text)) => text,
        _ => "which says nothing",
    }
}

#[pyfunction]
fn simd_paths() -> Vec<&'static str> {
    InstructionSet::available().map(InstructionSet::name).collect()
}

#[pymodule]
fn _core(module: &Bound<PyModule>) -> PyResult<()> {
    set_hook(Box::new(|_| {})); // nothing on standard error about panics, which `guarded` raises
    module.add("VERSION", env!("CARGO_PKG_VERSION"))?;
    module.add("STORED", sommerl_kernels::STORED)?;
    module.add("EMPTY", sommerl_kernels::EMPTY)?;
    module.add_class::<learner::Learner>()?;
    module.add_class::<quantiser::Quantiser>()?;
    module.add_class::<lookup::CellLookup>()?;
    module.add_class::<lookup::NodeLookup>()?;
    module.add_class::<node_palette::NodePalette>()?;
    module.add_class::<least_squares::NormalEquations>()?;
    module.add_function(wrap_pyfunction!(least_squares::line_errors, module)?)?;
    module.add_function(wrap_pyfunction!(simd_paths, module)?)
}
