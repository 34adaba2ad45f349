//! Python bindings of the hot loops. The contracts are in `python/sommerl/_core.pyi`.

mod eval;
mod lookup;
mod nearest;
mod node_lookup;
mod nodes;
mod query;
mod simd;
mod threads;
mod train;

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook};

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use simd::Path;

type Triples<'py> = PyReadonlyArray2<'py, f32>;

/// What every entry point does its work in: a fault of ours becomes an error that Python's own handlers see. PyO3 would make one
/// that passes by `except Exception`.
fn guarded<T>(work: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|fault| {
        let what = text(fault.as_ref());
        Err(PyRuntimeError::new_err(format!(
            "the core: expected no fault of its own, found one ({what}); please report it"
        )))
    })
}

fn text(fault: &(dyn Any + Send)) -> &str {
    match (fault.downcast_ref::<String>(), fault.downcast_ref::<&str>()) {
        (Some(text), _) => text,
        (_, Some(text)) => text,
        _ => "which says nothing",
    }
}

fn invalid(what: impl Into<String>) -> PyErr {
    PyValueError::new_err(what.into())
}

fn matrix<'py, T: numpy::Element + Copy>(py: Python<'py>, rows: Vec<[T; 3]>) -> PyResult<Bound<'py, PyArray2<T>>> {
    rows.as_flattened().to_pyarray(py).reshape([rows.len(), 3])
}

fn path_named(name: Option<&str>) -> PyResult<Path> {
    let available = Path::available();
    let chosen = match name {
        None => available.last(),
        Some(name) => available.iter().find(|(known, _)| *known == name),
    };
    chosen.map(|&(_, path)| path).ok_or_else(|| {
        let known: Vec<_> = available.iter().map(|&(name, _)| name).collect();
        invalid(format!("simd: expected one of {}, found {}", known.join(", "), name.unwrap_or("none")))
    })
}

#[pyclass(subclass)]
struct Learner(train::Learner);

#[pymethods]
impl Learner {
    #[new]
    #[pyo3(signature = (triples, cells, weights, rule, columns, search = "boxes", simd = None))]
    fn new(
        triples: Triples,
        cells: PyReadonlyArray1<u32>,
        weights: Triples,
        rule: &str,
        columns: usize,
        search: &str,
        simd: Option<&str>,
    ) -> PyResult<Self> {
        guarded(|| {
            let (triples, weights) = (rows(&triples, "triples")?, rows(&weights, "weights")?);
            let cells = line(&cells, "cells")?;
            if weights.is_empty() || columns == 0 || cells.len() != triples.len() {
                return Err(invalid("expected at least one unit and column, and as many cells as triples"));
            }
            // Steps toward such triples stay among them, and no distance overflows.
            shares(triples.as_flattened(), "triples")?;
            shares(weights.as_flattened(), "weights")?;
            let mut learner = train::Learner::new(triples.to_vec(), cells.to_vec(), weights);
            learner.columns = columns;
            learner.path = path_named(simd)?;
            learner.rule = match rule {
                "paper" => train::Rule::Paper,
                "kohonen" => train::Rule::Kohonen,
                _ => return Err(invalid(format!("rule: expected paper or kohonen, found {rule}"))),
            };
            learner.search = match search {
                "boxes" => train::Search::Boxes,
                "all" => train::Search::All,
                "scalar" => train::Search::Scalar,
                _ => return Err(invalid(format!("search: expected boxes, all or scalar, found {search}"))),
            };
            Ok(Learner(learner))
        })
    }

    fn present(
        &mut self,
        py: Python,
        start: usize,
        stop: usize,
        alpha: f32,
        falloff: PyReadonlyArray1<f32>,
    ) -> PyResult<f64> {
        guarded(|| {
            let falloff = line(&falloff, "falloff")?;
            if falloff.is_empty() || start > stop || stop > self.0.len() {
                return Err(invalid("expected a falloff, and a range within the triples"));
            }
            shares(&[alpha], "alpha")?;
            shares(falloff, "falloff")?;
            let epoch = train::Epoch { alpha, falloff };
            let learner = &mut self.0;
            Ok(py.detach(|| learner.present(start..stop, &epoch)))
        })
    }

    fn settled(&mut self) -> PyResult<bool> {
        guarded(|| Ok(self.0.settled()))
    }

    fn weights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        guarded(|| matrix(py, self.0.weights()))
    }

    fn stored_cells<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        guarded(|| matrix(py, self.0.stored_cells()))
    }
}

#[pyclass(subclass)]
struct Palette(query::Palette);

#[pymethods]
impl Palette {
    #[new]
    #[pyo3(signature = (lut, search = "boxes", simd = None, threads = None))]
    fn new(py: Python, lut: Triples, search: &str, simd: Option<&str>, threads: Option<usize>) -> PyResult<Self> {
        guarded(|| {
            let lut = rows(&lut, "lut")?;
            if lut.is_empty() || !["boxes", "all"].contains(&search) {
                return Err(invalid("lut: expected at least one entry, and a search in boxes or all"));
            }
            moderate(lut.as_flattened(), "lut")?;
            let threads = threads::allowed(py, threads)?;
            Ok(Palette(query::Palette::new(lut, search == "boxes", path_named(simd)?, threads)))
        })
    }

    fn query<'py>(&self, py: Python<'py>, triples: Triples<'py>) -> PyResult<Bound<'py, PyArray1<u32>>> {
        guarded(|| {
            let triples = rows(&triples, "triples")?;
            moderate(triples.as_flattened(), "triples")?;
            let found = PyArray1::zeros(py, triples.len(), false);
            {
                let mut out = found.try_readwrite()?;
                let out = out.as_slice_mut()?;
                py.detach(|| self.0.query(triples, out));
            }
            Ok(found)
        })
    }
}

/// Refuses what is no number, and numbers so large that distances may overflow: nothing is nearest then.
fn moderate(numbers: &[f32], name: &str) -> PyResult<()> {
    const MOST: f32 = 1e18;
    if !numbers.iter().all(|x| x.abs() <= MOST) {
        return Err(invalid(format!("{name}: expected numbers up to {MOST:e}, found others")));
    }
    Ok(())
}

/// Refuses what is not from 0 to 1.
fn shares(numbers: &[f32], name: &str) -> PyResult<()> {
    if !numbers.iter().all(|x| (0.0..=1.0).contains(x)) {
        return Err(invalid(format!("{name}: expected numbers from 0 to 1, found others")));
    }
    Ok(())
}

/// Rows of three numbers each; borrowed where they lie one after the other.
fn rows<'a, T: numpy::Element>(array: &'a PyReadonlyArray2<T>, name: &str) -> PyResult<&'a [[T; 3]]> {
    if array.shape()[1] != 3 || !array.is_c_contiguous() {
        return Err(invalid(format!("{name}: expected rows of 3 in one piece, found {:?}", array.shape())));
    }
    Ok(array.as_slice()?.as_chunks::<3>().0)
}

/// Numbers that lie one after the other.
fn line<'a, T: numpy::Element>(array: &'a PyReadonlyArray1<T>, name: &str) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| invalid(format!("{name}: expected numbers in one piece")))
}

#[pyfunction]
fn simd_paths() -> Vec<&'static str> {
    Path::available().into_iter().map(|(name, _)| name).collect()
}

#[pymodule]
fn _core(module: &Bound<PyModule>) -> PyResult<()> {
    set_hook(Box::new(|_| {})); // of this library's own faults, which `guarded` tells
    module.add("STORED", train::STORED)?;
    module.add("EMPTY", train::EMPTY)?;
    module.add_class::<Learner>()?;
    module.add_class::<Palette>()?;
    module.add_class::<lookup::CellLookup>()?;
    module.add_class::<lookup::NodeLookup>()?;
    module.add_class::<nodes::python::NodePalette>()?;
    module.add_function(wrap_pyfunction!(simd_paths, module)?)
}
