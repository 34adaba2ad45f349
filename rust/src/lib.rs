//! Python bindings of the hot loops. The contracts are in `python/sommerl/_core.pyi`.

mod nearest;
mod train;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

type Triples<'py> = PyReadonlyArray2<'py, f32>;

fn triples_of(array: &Triples, name: &str) -> PyResult<Vec<[f32; 3]>> {
    if array.shape()[1] != 3 {
        let (rows, columns) = (array.shape()[0], array.shape()[1]);
        return Err(PyValueError::new_err(format!("{name}: expected shape (n, 3), found ({rows}, {columns})")));
    }
    Ok(array.as_array().rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
}

fn matrix<'py, T: numpy::Element + Copy>(py: Python<'py>, rows: Vec<[T; 3]>) -> PyResult<Bound<'py, PyArray2<T>>> {
    rows.as_flattened().to_pyarray(py).reshape([rows.len(), 3])
}

#[pyclass(subclass)]
struct Learner {
    inner: train::Learner,
    rule: train::Rule,
    columns: usize,
}

#[pymethods]
impl Learner {
    #[new]
    fn new(triples: Triples, weights: Triples, rule: &str, columns: usize) -> PyResult<Self> {
        let (triples, weights) = (triples_of(&triples, "triples")?, triples_of(&weights, "weights")?);
        let rule = match rule {
            "paper" => train::Rule::Paper,
            "kohonen" => train::Rule::Kohonen,
            _ => return Err(PyValueError::new_err(format!("rule: expected paper or kohonen, found {rule}"))),
        };
        if weights.is_empty() || columns == 0 || triples.len() >= train::EMPTY as usize {
            return Err(PyValueError::new_err(
                "expected at least one unit and column, and fewer than 2^32 - 1 triples",
            ));
        }
        Ok(Learner { inner: train::Learner::new(triples, &weights), rule, columns })
    }

    fn present(
        &mut self,
        py: Python,
        cells: PyReadonlyArray1<u32>,
        alpha: f32,
        falloff: PyReadonlyArray1<f32>,
    ) -> PyResult<f64> {
        let (cells, falloff) = (cells.as_slice()?, falloff.as_slice()?);
        if falloff.is_empty() || cells.iter().any(|&cell| cell as usize >= self.inner.cells()) {
            return Err(PyValueError::new_err("expected a falloff, and cells within the triples"));
        }
        let epoch = train::Epoch { rule: self.rule, alpha, falloff, columns: self.columns };
        let learner = &mut self.inner;
        Ok(py.detach(|| learner.present(cells, &epoch)))
    }

    fn weights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        matrix(py, self.inner.weights())
    }

    fn stored_cells<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        matrix(py, self.inner.stored_cells())
    }
}

#[pyfunction]
fn query<'py>(py: Python<'py>, triples: Triples<'py>, lut: Triples<'py>) -> PyResult<Bound<'py, PyArray1<u32>>> {
    let (triples, lut) = (triples_of(&triples, "triples")?, triples_of(&lut, "lut")?);
    if lut.is_empty() {
        return Err(PyValueError::new_err("lut: expected at least one entry, found none"));
    }
    Ok(py.detach(|| nearest::Codebook::new(&lut).query(&triples)).to_pyarray(py))
}

#[pymodule]
fn _core(module: &Bound<PyModule>) -> PyResult<()> {
    module.add("STORED", train::STORED)?;
    module.add("EMPTY", train::EMPTY)?;
    module.add_class::<Learner>()?;
    module.add_function(wrap_pyfunction!(query, module)?)
}
