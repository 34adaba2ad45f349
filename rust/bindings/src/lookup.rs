//! Python bindings of lookups: materials that are prepared once and evaluated often.
//!
//! A prepared lookup keeps references to the caller's NumPy arrays and reads them anew in each call, so that a large table is
//! not copied and a change of its numbers is seen. The owner of an array may also change its type or its length in place, so
//! that nothing which was found out about it when the lookup was prepared is relied on for safety: each call converts the
//! arrays again, which takes less than a microsecond, and indices are checked where they are used.

use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use sommerl_codec::NodeLattice;
use sommerl_kernels::{CellLattice, CellMaterial, Cells, Cubes, Factors, Material, NodeMaterial, NodeSteps, eval};

use crate::convert::{instruction_set, invalid, line, rows};
use crate::guarded;
use crate::threads::allowed;

/// A material on cells.
#[pyclass(frozen)]
pub struct CellLookup {
    lattice: CellLattice,
    values: Py<PyAny>,
    index: Option<Py<PyAny>>,
}

#[pymethods]
impl CellLookup {
    #[new]
    #[pyo3(signature = (bins, reciprocal, trilinear, values, index = None))]
    fn new(
        py: Python,
        bins: [usize; 3],
        reciprocal: bool,
        trilinear: bool,
        values: Py<PyAny>,
        index: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        guarded(|| {
            let lattice = CellLattice { bins, reciprocal, trilinear };
            let made = CellLookup { lattice, values, index };
            made.with_material(py, |_| Ok(()))?;
            Ok(made)
        })
    }

    #[pyo3(signature = (wi, wo, simd = None, threads = None))]
    fn eval<'py>(
        &self,
        py: Python<'py>,
        wi: PyReadonlyArray2<'py, f64>,
        wo: PyReadonlyArray2<'py, f64>,
        simd: Option<&str>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        guarded(|| {
            let pairs = Pairs::new(&wi, &wo)?;
            self.with_material(py, |material| pairs.evaluated(py, &material, simd, threads))
        })
    }
}

impl CellLookup {
    /// Hands over the material as its arrays are now.
    fn with_material<T>(&self, py: Python, work: impl FnOnce(CellMaterial) -> PyResult<T>) -> PyResult<T> {
        let values: PyReadonlyArray1<f64> = self.values.extract(py)?;
        let values = line(&values, "values")?;
        let Some(index) = &self.index else {
            return work(self.material(Cells::Values(values))?);
        };
        if let Ok(index) = index.extract::<PyReadonlyArray1<u8>>(py) {
            return work(self.material(Cells::Index8(line(&index, "index")?, values))?);
        }
        let index: PyReadonlyArray1<u16> = index.extract(py)?;
        work(self.material(Cells::Index16(line(&index, "index")?, values))?)
    }

    fn material<'a>(&self, cells: Cells<'a>) -> PyResult<CellMaterial<'a>> {
        let size = self.lattice.bins.iter().try_fold(1, |size: usize, &n| size.checked_mul(n));
        // Numbers of cells have 32 bits.
        if !cells.are_triples() || !size.is_some_and(|n| 0 < n && n == cells.len() && n < u32::MAX as usize) {
            return Err(invalid("expected triples of values, and as many cells as bins"));
        }
        Ok(CellMaterial { lattice: self.lattice, cells })
    }
}

/// A material on nodes.
#[pyclass(frozen)]
pub struct NodeLookup {
    steps: NodeSteps,
    gains: Py<PyAny>,
    shapes: Py<PyAny>,
    gain: Py<PyAny>,
    shape: Py<PyAny>,
    scale: f64,
    signed: bool,
    smooth: bool,
}

#[pymethods]
impl NodeLookup {
    #[new]
    #[pyo3(signature = (
        theta_h, band, theta_d, phi_d, gains, shapes, gain, shape, scale, reciprocal = true, mirrored = false, signed = false,
        smooth = false
    ))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python,
        theta_h: Bound<PyAny>,
        band: Bound<PyAny>,
        theta_d: Bound<PyAny>,
        phi_d: Bound<PyAny>,
        gains: Py<PyAny>,
        shapes: Py<PyAny>,
        gain: Py<PyAny>,
        shape: Py<PyAny>,
        scale: f64,
        reciprocal: bool,
        mirrored: bool,
        signed: bool,
        smooth: bool,
    ) -> PyResult<Self> {
        guarded(|| {
            let lattice = NodeLattice {
                theta_h: small_numbers(&theta_h, "theta_h")?,
                band: small_numbers(&band, "band")?,
                theta_d: small_numbers(&theta_d, "theta_d")?,
                phi_d: small_numbers(&phi_d, "phi_d")?,
                reciprocal,
                mirrored,
            };
            let steps = NodeSteps::new(&lattice)
                .ok_or_else(|| invalid("nodes: expected axes that increase from 0 to 180, and a band for each row"))?;
            let made = NodeLookup { steps, gains, shapes, gain, shape, scale, signed, smooth };
            let fits = made.with_factors(py, |factors| Ok(factors.fit(made.steps.nodes())))?;
            if !fits || !scale.is_finite() {
                return Err(invalid("expected a finite gain, shape and scale for each node"));
            }
            Ok(made)
        })
    }

    #[pyo3(signature = (wi, wo, simd = None, threads = None))]
    fn eval<'py>(
        &self,
        py: Python<'py>,
        wi: PyReadonlyArray2<'py, f64>,
        wo: PyReadonlyArray2<'py, f64>,
        simd: Option<&str>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        guarded(|| {
            let pairs = Pairs::new(&wi, &wo)?;
            self.with_factors(py, |factors| {
                let NodeLookup { steps, scale, signed, smooth, .. } = self;
                let count = pairs.wi.len();
                let material =
                    py.detach(|| NodeMaterial::new(steps, factors, Cubes::new(*scale, *signed, *smooth), count));
                pairs.evaluated(py, &material, simd, threads)
            })
        })
    }
}

impl NodeLookup {
    /// Hands over the gains and shapes as they are now.
    fn with_factors<T>(&self, py: Python, work: impl FnOnce(Factors) -> PyResult<T>) -> PyResult<T> {
        let (gains, shapes): (PyReadonlyArray1<f64>, PyReadonlyArray2<f64>) =
            (self.gains.extract(py)?, self.shapes.extract(py)?);
        let (gain, shape): (PyReadonlyArray1<u16>, PyReadonlyArray1<u16>) =
            (self.gain.extract(py)?, self.shape.extract(py)?);
        work(Factors {
            gains: line(&gains, "gains")?,
            shapes: rows(&shapes, "shapes")?,
            gain: line(&gain, "gain")?,
            shape: line(&shape, "shape")?,
        })
    }
}

/// Directions to light and viewer, as many of each.
struct Pairs<'a> {
    wi: &'a [[f64; 3]],
    wo: &'a [[f64; 3]],
}

impl<'a> Pairs<'a> {
    fn new(wi: &'a PyReadonlyArray2<f64>, wo: &'a PyReadonlyArray2<f64>) -> PyResult<Self> {
        let (wi, wo) = (rows(wi, "wi")?, rows(wo, "wo")?);
        if wi.len() != wo.len() {
            return Err(invalid(format!("expected as many wi as wo, found {} and {}", wi.len(), wo.len())));
        }
        Ok(Pairs { wi, wo })
    }

    /// f_r of each pair: a new array.
    fn evaluated<'py>(
        &self,
        py: Python<'py>,
        material: &impl Material,
        simd: Option<&str>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (set, threads) = (instruction_set(simd)?, allowed(py, threads)?);
        // SAFETY: `eval` writes every element. NumPy gives large arrays large pages, which calloc's zeros do not get.
        let found = unsafe { PyArray2::new(py, [self.wi.len(), 3], false) };
        {
            let mut out = found.try_readwrite()?;
            let (rows, _) = out.as_slice_mut()?.as_chunks_mut::<3>();
            py.detach(|| eval(self.wi, self.wo, material, set, threads, rows));
        }
        Ok(found)
    }
}

/// Whole numbers of a byte each, or lists of such.
fn small_numbers<'py, T: FromPyObjectOwned<'py>>(numbers: &Bound<'py, PyAny>, name: &str) -> PyResult<T> {
    numbers.extract().map_err(|_| invalid(format!("{name}: expected whole numbers from 0 to 180")))
}
