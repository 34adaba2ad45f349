//! The nearest LUT entries: phase 3.

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use sommerl_kernels as kernels;

use crate::convert::{instruction_set, invalid, rows};
use crate::guarded;
use crate::threads::allowed;

type Triples<'py> = PyReadonlyArray2<'py, f32>;

/// A LUT, asked for the nearest of its entries.
#[pyclass(subclass)]
pub struct Quantiser(kernels::Quantiser);

#[pymethods]
impl Quantiser {
    #[new]
    #[pyo3(signature = (lut, search = "boxes", simd = None, threads = None))]
    fn new(py: Python, lut: Triples, search: &str, simd: Option<&str>, threads: Option<usize>) -> PyResult<Self> {
        guarded(|| {
            let lut = rows(&lut, "lut")?;
            if lut.is_empty() || !["boxes", "all"].contains(&search) {
                return Err(invalid("lut: expected at least one entry, and a search in boxes or all"));
            }
            moderate(lut.as_flattened(), "lut")?;
            let threads = allowed(py, threads)?;
            Ok(Quantiser(kernels::Quantiser::new(lut, search == "boxes", instruction_set(simd)?, threads)))
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
