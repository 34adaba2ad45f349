//! Training: phases 1 and 2.

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use sommerl_kernels as kernels;

use crate::convert::{instruction_set, invalid, line, matrix, rows};
use crate::guarded;

type Triples<'py> = PyReadonlyArray2<'py, f32>;

/// The units of the SOM and their MANs.
#[pyclass(subclass)]
pub struct Learner(kernels::Learner);

#[pymethods]
impl Learner {
    #[new]
    #[pyo3(signature = (triples, cells, weights, rule, columns, search = "boxes", simd = None, distinct = false))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        triples: Triples,
        cells: PyReadonlyArray1<u32>,
        weights: Triples,
        rule: &str,
        columns: usize,
        search: &str,
        simd: Option<&str>,
        distinct: bool,
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
            let mut learner = kernels::Learner::new(triples.to_vec(), cells.to_vec(), weights);
            learner.columns = columns;
            learner.distinct = distinct;
            learner.set = instruction_set(simd)?;
            learner.rule = match rule {
                "paper" => kernels::Rule::Paper,
                "kohonen" => kernels::Rule::Kohonen,
                _ => return Err(invalid(format!("rule: expected paper or kohonen, found {rule}"))),
            };
            learner.search = match search {
                "boxes" => kernels::Search::Boxes,
                "all" => kernels::Search::All,
                "scalar" => kernels::Search::Scalar,
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
            let epoch = kernels::Epoch { alpha, falloff };
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

/// Refuses what is not from 0 to 1.
fn shares(numbers: &[f32], name: &str) -> PyResult<()> {
    if !numbers.iter().all(|x| (0.0..=1.0).contains(x)) {
        return Err(invalid(format!("{name}: expected numbers from 0 to 1, found others")));
    }
    Ok(())
}
