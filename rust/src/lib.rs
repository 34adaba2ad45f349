//! Python bindings of the hot loops. The contracts are in `python/sommerl/_core.pyi`.

mod eval;
mod nearest;
mod node_lookup;
mod nodes;
mod query;
mod simd;
mod train;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use simd::Path;

type Triples<'py> = PyReadonlyArray2<'py, f32>;

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
        PyValueError::new_err(format!("simd: expected one of {}, found {}", known.join(", "), name.unwrap_or("none")))
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
        let (triples, weights) = (rows(&triples, "triples")?.to_vec(), rows(&weights, "weights")?);
        let cells = cells.as_slice()?.to_vec();
        if weights.is_empty() || columns == 0 || cells.len() != triples.len() {
            return Err(PyValueError::new_err("expected at least one unit and column, and as many cells as triples"));
        }
        let mut learner = train::Learner::new(triples, cells, weights);
        learner.columns = columns;
        learner.path = path_named(simd)?;
        learner.rule = match rule {
            "paper" => train::Rule::Paper,
            "kohonen" => train::Rule::Kohonen,
            _ => return Err(PyValueError::new_err(format!("rule: expected paper or kohonen, found {rule}"))),
        };
        learner.search = match search {
            "boxes" => train::Search::Boxes,
            "all" => train::Search::All,
            "scalar" => train::Search::Scalar,
            _ => return Err(PyValueError::new_err(format!("search: expected boxes, all or scalar, found {search}"))),
        };
        Ok(Learner(learner))
    }

    fn present(
        &mut self,
        py: Python,
        start: usize,
        stop: usize,
        alpha: f32,
        falloff: PyReadonlyArray1<f32>,
    ) -> PyResult<f64> {
        let falloff = falloff.as_slice()?;
        if falloff.is_empty() || start > stop || stop > self.0.len() {
            return Err(PyValueError::new_err("expected a falloff, and a range within the triples"));
        }
        let epoch = train::Epoch { alpha, falloff };
        let learner = &mut self.0;
        Ok(py.detach(|| learner.present(start..stop, &epoch)))
    }

    fn settled(&mut self) -> bool {
        self.0.settled()
    }

    fn weights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        matrix(py, self.0.weights())
    }

    fn stored_cells<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        matrix(py, self.0.stored_cells())
    }
}

#[pyclass(subclass)]
struct Palette(query::Palette);

#[pymethods]
impl Palette {
    #[new]
    #[pyo3(signature = (lut, search = "boxes", simd = None, threads = None))]
    fn new(lut: Triples, search: &str, simd: Option<&str>, threads: Option<usize>) -> PyResult<Self> {
        let lut = rows(&lut, "lut")?;
        if lut.is_empty() || !["boxes", "all"].contains(&search) {
            return Err(PyValueError::new_err("lut: expected at least one entry, and a search in boxes or all"));
        }
        Ok(Palette(query::Palette::new(lut, search == "boxes", path_named(simd)?, threads_or_all(threads))))
    }

    fn query<'py>(&self, py: Python<'py>, triples: Triples<'py>) -> PyResult<Bound<'py, PyArray1<u32>>> {
        let triples = rows(&triples, "triples")?;
        let found = PyArray1::zeros(py, triples.len(), false);
        {
            let mut out = found.try_readwrite()?;
            let out = out.as_slice_mut()?;
            py.detach(|| self.0.query(triples, out));
        }
        Ok(found)
    }
}

/// Rows of three numbers each; borrowed where they lie one after the other.
fn rows<'a, T: numpy::Element>(array: &'a PyReadonlyArray2<T>, name: &str) -> PyResult<&'a [[T; 3]]> {
    if array.shape()[1] != 3 || !array.is_c_contiguous() {
        return Err(PyValueError::new_err(format!(
            "{name}: expected rows of 3 in one piece, found {:?}",
            array.shape()
        )));
    }
    Ok(array.as_slice()?.as_chunks::<3>().0)
}

enum Volume<'py> {
    Index8(PyReadonlyArray1<'py, u8>),
    Index16(PyReadonlyArray1<'py, u16>),
    Values,
}

#[pyfunction]
#[pyo3(signature = (wi, wo, bins, reciprocal, trilinear, values, index = None, simd = None, threads = None))]
#[allow(clippy::too_many_arguments)]
fn lookup<'py>(
    py: Python<'py>,
    wi: PyReadonlyArray2<'py, f64>,
    wo: PyReadonlyArray2<'py, f64>,
    bins: [usize; 3],
    reciprocal: bool,
    trilinear: bool,
    values: PyReadonlyArray1<'py, f64>,
    index: Option<Bound<'py, PyAny>>,
    simd: Option<&str>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let volume = match &index {
        None => Volume::Values,
        Some(array) => match array.extract::<PyReadonlyArray1<u8>>() {
            Ok(index) => Volume::Index8(index),
            Err(_) => Volume::Index16(array.extract()?),
        },
    };
    let values = values.as_slice()?;
    let cells = match &volume {
        Volume::Values => eval::Cells::Values(values),
        Volume::Index8(index) => eval::Cells::Index8(index.as_slice()?, values),
        Volume::Index16(index) => eval::Cells::Index16(index.as_slice()?, values),
    };
    let (wi, wo) = (rows(&wi, "wi")?, rows(&wo, "wo")?);
    if wi.len() != wo.len() || bins.contains(&0) || bins.iter().product::<usize>() != cells.len() {
        return Err(PyValueError::new_err("expected as many wi as wo, and a value for each cell"));
    }
    let material = eval::OnLattice { lattice: eval::Lattice { bins, reciprocal, trilinear }, cells };
    let path = path_named(simd)?;
    let threads = threads_or_all(threads);
    // SAFETY: `eval` writes every element. NumPy gives large arrays large pages, which calloc's zeros do not get.
    let found = unsafe { PyArray2::new(py, [wi.len(), 3], false) };
    {
        let mut out = found.try_readwrite()?;
        let (rows, _) = out.as_slice_mut()?.as_chunks_mut::<3>();
        py.detach(|| eval::eval(wi, wo, &material, path, threads, rows));
    }
    Ok(found)
}

#[pyfunction]
#[pyo3(signature = (wi, wo, theta_h, band, theta_d, phi_d, gains, shapes, gain, shape, scale, simd = None, threads = None))]
#[allow(clippy::too_many_arguments)]
fn lookup_nodes<'py>(
    py: Python<'py>,
    wi: PyReadonlyArray2<'py, f64>,
    wo: PyReadonlyArray2<'py, f64>,
    theta_h: Bound<'py, PyAny>,
    band: Bound<'py, PyAny>,
    theta_d: Bound<'py, PyAny>,
    phi_d: Bound<'py, PyAny>,
    gains: PyReadonlyArray1<'py, f64>,
    shapes: PyReadonlyArray2<'py, f64>,
    gain: PyReadonlyArray1<'py, u16>,
    shape: PyReadonlyArray1<'py, u16>,
    scale: f64,
    simd: Option<&str>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (wi, wo) = (rows(&wi, "wi")?, rows(&wo, "wo")?);
    let nodes = node_lookup::Nodes::new(
        &small_numbers::<Vec<u8>>(&theta_h, "theta_h")?,
        &small_numbers::<Vec<u8>>(&band, "band")?,
        &small_numbers::<Vec<Vec<u8>>>(&theta_d, "theta_d")?,
        &small_numbers::<Vec<Vec<u8>>>(&phi_d, "phi_d")?,
    )
    .ok_or_else(|| {
        PyValueError::new_err("nodes: expected axes that increase from 0 to 180, and a band for each row")
    })?;
    let factors = node_lookup::Factors {
        gains: line(&gains, "gains")?,
        shapes: rows(&shapes, "shapes")?,
        gain: line(&gain, "gain")?,
        shape: line(&shape, "shape")?,
    };
    if wi.len() != wo.len() || !factors.fit(nodes.size) {
        return Err(PyValueError::new_err("expected as many wi as wo, and a finite gain and shape for each node"));
    }
    let path = path_named(simd)?;
    let threads = threads_or_all(threads);
    // SAFETY: `eval` writes every element.
    let found = unsafe { PyArray2::new(py, [wi.len(), 3], false) };
    {
        let mut out = found.try_readwrite()?;
        let (rows, _) = out.as_slice_mut()?.as_chunks_mut::<3>();
        py.detach(|| {
            let material = node_lookup::OnNodes::new(&nodes, factors, scale, wi.len());
            eval::eval(wi, wo, &material, path, threads, rows)
        });
    }
    Ok(found)
}

/// Whole numbers of a byte each, or lists of such.
fn small_numbers<'py, T: FromPyObjectOwned<'py>>(numbers: &Bound<'py, PyAny>, name: &str) -> PyResult<T> {
    numbers.extract().map_err(|_| PyValueError::new_err(format!("{name}: expected whole numbers from 0 to 180")))
}

/// Numbers that lie one after the other.
fn line<'a, T: numpy::Element>(array: &'a PyReadonlyArray1<T>, name: &str) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| PyValueError::new_err(format!("{name}: expected numbers in one piece")))
}

fn threads_or_all(threads: Option<usize>) -> usize {
    threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, |n| n.get()))
}

#[pyfunction]
fn simd_paths() -> Vec<&'static str> {
    Path::available().into_iter().map(|(name, _)| name).collect()
}

#[pymodule]
fn _core(module: &Bound<PyModule>) -> PyResult<()> {
    module.add("STORED", train::STORED)?;
    module.add("EMPTY", train::EMPTY)?;
    module.add_class::<Learner>()?;
    module.add_class::<Palette>()?;
    module.add_class::<nodes::python::NodePalette>()?;
    module.add_function(wrap_pyfunction!(lookup, module)?)?;
    module.add_function(wrap_pyfunction!(lookup_nodes, module)?)?;
    module.add_function(wrap_pyfunction!(simd_paths, module)?)
}
