//! From Python's values to Rust's, and back.

use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use sommerl_simd::InstructionSet;

/// A ValueError with a sentence.
pub fn invalid(what: impl ToString) -> PyErr {
    PyValueError::new_err(what.to_string())
}

/// A new array of rows of three numbers.
pub fn matrix<'py, T: numpy::Element + Copy>(py: Python<'py>, rows: Vec<[T; 3]>) -> PyResult<Bound<'py, PyArray2<T>>> {
    rows.as_flattened().to_pyarray(py).reshape([rows.len(), 3])
}

/// The instruction set of that name; the fastest if None.
pub fn instruction_set(name: Option<&str>) -> PyResult<InstructionSet> {
    let Some(name) = name else { return Ok(InstructionSet::fastest()) };
    InstructionSet::available().find(|set| set.name() == name).ok_or_else(|| {
        let known: Vec<_> = InstructionSet::available().map(InstructionSet::name).collect();
        invalid(format!("simd: expected one of {}, found {name}", known.join(", ")))
    })
}

/// An array's rows of three numbers each. Raises ValueError, which names the array, if they do not lie one after the other.
pub fn rows<'a, T: numpy::Element>(array: &'a PyReadonlyArray2<T>, name: &str) -> PyResult<&'a [[T; 3]]> {
    if array.shape()[1] != 3 || !array.is_c_contiguous() {
        return Err(invalid(format!("{name}: expected rows of 3 in one piece, found {:?}", array.shape())));
    }
    Ok(array.as_slice()?.as_chunks::<3>().0)
}

/// An array's numbers. Raises ValueError, which names the array, if they do not lie one after the other.
pub fn line<'a, T: numpy::Element>(array: &'a PyReadonlyArray1<T>, name: &str) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| invalid(format!("{name}: expected numbers in one piece")))
}
