//! The fit of a lattice's nodes to samples: errors of lines, and normal equations.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray};
use pyo3::prelude::*;

use sommerl_codec::NodeLattice;
use sommerl_kernels::{NodeSteps, Normal, Samples};

use crate::convert::{instruction_set, invalid, line, matrix, rows};
use crate::guarded;
use crate::threads::allowed;

/// y: (places · lines, 3), line after line for each place.
#[pyfunction]
#[pyo3(signature = (places, y, weight, simd = None, threads = None))]
pub fn line_errors<'py>(
    py: Python<'py>,
    places: usize,
    y: PyReadonlyArray2<f64>,
    weight: PyReadonlyArray1<f64>,
    simd: Option<&str>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    guarded(|| {
        let (y, weight) = (rows(&y, "y")?, line(&weight, "weight")?);
        if places == 0 || y.len() != weight.len() || y.len() % places != 0 || y.len() / places > 1 << 20 {
            return Err(invalid("expected a value and a weight for each place of each line"));
        }
        if places > 1 << 12 {
            return Err(invalid("expected at most 4096 places"));
        }
        let (set, threads) = (instruction_set(simd)?, allowed(py, threads)?);
        let found = py.detach(|| sommerl_kernels::line_errors(places, y, weight, set, threads));
        found.to_pyarray(py).reshape([places, places])
    })
}

/// The normal equations of a lattice's nodes.
#[pyclass(frozen)]
pub struct NormalEquations {
    pub normal: Normal,
}

#[pymethods]
impl NormalEquations {
    #[new]
    fn new(
        starts: PyReadonlyArray1<i32>,
        columns: PyReadonlyArray1<i32>,
        values: PyReadonlyArray1<f64>,
        right: PyReadonlyArray2<f64>,
    ) -> PyResult<Self> {
        guarded(|| {
            let normal = Normal {
                starts: line(&starts, "starts")?.to_vec(),
                columns: line(&columns, "columns")?.to_vec(),
                values: line(&values, "values")?.to_vec(),
                right: rows(&right, "right")?.to_vec(),
                squares: 0.0,
            };
            if !normal.fits() {
                return Err(invalid("expected a sparse square matrix of finite numbers with a row for each node"));
            }
            Ok(NormalEquations { normal })
        })
    }

    #[staticmethod]
    #[pyo3(signature = (theta_h, band, theta_d, phi_d, places, weights, targets, reciprocal = true, mirrored = false, threads = None))]
    #[allow(clippy::too_many_arguments)]
    fn of(
        py: Python,
        theta_h: Vec<u8>,
        band: Vec<u8>,
        theta_d: Vec<Vec<u8>>,
        phi_d: Vec<Vec<u8>>,
        places: PyReadonlyArray2<f64>,
        weights: PyReadonlyArray1<f64>,
        targets: PyReadonlyArray2<f64>,
        reciprocal: bool,
        mirrored: bool,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        guarded(|| {
            let lattice = NodeLattice { theta_h, band, theta_d, phi_d, reciprocal, mirrored };
            lattice.check().map_err(invalid)?;
            let steps = NodeSteps::new(&lattice).ok_or_else(|| invalid("expected a valid lattice"))?;
            let (places, weights) = (rows(&places, "places")?, line(&weights, "weights")?);
            let samples = Samples { places, weights, targets: rows(&targets, "targets")? };
            if weights.len() != places.len() || samples.targets.len() != places.len() {
                return Err(invalid("expected a place, a weight and a target for each sample"));
            }
            let numbers = [places.as_flattened(), weights, samples.targets.as_flattened()];
            if !numbers.iter().all(|part| part.iter().all(|x| x.is_finite())) {
                return Err(invalid("expected finite numbers, found others"));
            }
            if !places.is_sorted_by_key(|place| place[0]) {
                return Err(invalid("places: expected increasing θ_h"));
            }
            let threads = allowed(py, threads)?;
            Ok(NormalEquations { normal: py.detach(|| Normal::of(&steps, &samples, threads)) })
        })
    }

    fn held(&self, values: PyReadonlyArray2<f64>, ridge: f64) -> PyResult<Self> {
        guarded(|| {
            let mut normal = self.normal.clone();
            normal.hold(self.nodes(rows(&values, "values")?)?, ridge);
            NormalEquations { normal }.checked()
        })
    }

    fn with_right(&self, right: PyReadonlyArray2<f64>) -> PyResult<Self> {
        guarded(|| {
            let right = self.nodes(rows(&right, "right")?)?.to_vec();
            NormalEquations { normal: Normal { right, ..self.normal.clone() } }.checked()
        })
    }

    fn solved<'py>(
        &self,
        py: Python<'py>,
        start: PyReadonlyArray2<f64>,
        tolerance: f64,
        most: usize,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        guarded(|| {
            let start = self.nodes(rows(&start, "start")?)?;
            matrix(py, py.detach(|| self.normal.solved(start, tolerance, most)))
        })
    }

    fn product<'py>(&self, py: Python<'py>, z: PyReadonlyArray2<f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        guarded(|| {
            let z = self.nodes(rows(&z, "z")?)?;
            matrix(py, py.detach(|| self.normal.product(z)))
        })
    }

    fn diagonal<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.normal.diagonal().to_pyarray(py)
    }

    fn between_entries<'py>(
        &self,
        py: Python<'py>,
        index: PyReadonlyArray1<u16>,
        factors: PyReadonlyArray2<f64>,
        count: usize,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        guarded(|| {
            let index = line(&index, "index")?;
            let (nodes, width) = (factors.shape()[0], factors.shape()[1]);
            let factors = factors.as_slice().map_err(|_| invalid("factors: expected numbers in one piece"))?;
            if nodes != self.normal.nodes() || index.len() != nodes || width > 16 {
                return Err(invalid("expected an entry and at most 16 factors for each node"));
            }
            if count > 1 << 12 || index.iter().any(|&entry| usize::from(entry) >= count) {
                return Err(invalid("expected entries below count, and a count of at most 4096"));
            }
            let found = py.detach(|| self.normal.between_entries(index, factors, width, count));
            found.to_pyarray(py).reshape([count, count])
        })
    }

    #[getter]
    fn right<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, self.normal.right.clone())
    }

    #[getter]
    fn squares(&self) -> f64 {
        self.normal.squares
    }
}

impl NormalEquations {
    /// Three numbers a node. Raises ValueError if there are others.
    fn nodes<'a>(&self, values: &'a [[f64; 3]]) -> PyResult<&'a [[f64; 3]]> {
        let nodes = self.normal.nodes();
        if values.len() != nodes {
            return Err(invalid(format!("expected 3 numbers for each of {nodes} nodes, found {}", values.len())));
        }
        Ok(values)
    }

    fn checked(self) -> PyResult<Self> {
        if self.normal.fits() { Ok(self) } else { Err(invalid("expected finite numbers, found others")) }
    }
}
