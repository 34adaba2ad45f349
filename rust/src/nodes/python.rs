//! Bindings of the bits of compact materials.

use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::assign::{Quadratic, Values, sweep};
use super::stream::{self, Nodes};
use super::{Axes, Palette};
use crate::{guarded, invalid, line, path_named, rows};

type Indices<'py> = (Bound<'py, PyArray1<u16>>, Bound<'py, PyArray1<u16>>);

/// A lattice of nodes and a palette.
#[pyclass]
pub struct NodePalette {
    axes: Axes,
    palette: Palette,
}

impl NodePalette {
    fn nodes(&self, gain: &[u16], shape: &[u16]) -> PyResult<Nodes> {
        self.check(gain, shape)?;
        let (axes, palette) = (self.axes.clone(), self.palette.clone());
        Ok(Nodes { axes, palette, gain: gain.to_vec(), shape: shape.to_vec() })
    }

    fn check(&self, gain: &[u16], shape: &[u16]) -> PyResult<()> {
        let fits = |index: &[u16], entries: usize| {
            index.len() == self.axes.nodes() && index.iter().all(|&i| usize::from(i) < entries)
        };
        if !fits(gain, self.palette.gains.len()) || !fits(shape, self.palette.shapes.len()) {
            return Err(invalid("expected an entry of the palette for each node"));
        }
        Ok(())
    }
}

#[pymethods]
impl NodePalette {
    #[new]
    fn new(
        theta_h: Vec<u8>,
        band: Vec<u8>,
        theta_d: Vec<Vec<u8>>,
        phi_d: Vec<Vec<u8>>,
        gains: Vec<u32>,
        shapes: Vec<[i32; 2]>,
    ) -> PyResult<Self> {
        guarded(|| {
            let lattice = crate::node_lookup::Nodes::new(&theta_h, &band, &theta_d, &phi_d);
            if theta_d.len() > stream::MOST_BANDS
                || lattice.is_none_or(|lattice| lattice.size > stream::MOST_NODES)
                || !band.is_sorted()
            {
                return Err(invalid(
                    "lattice: expected nodes that increase on each axis, and bands in order, found others",
                ));
            }
            let palette = Palette { gains, shapes };
            stream::check(&palette).map_err(invalid)?;
            Ok(NodePalette { axes: Axes { theta_h, band, theta_d, phi_d }, palette })
        })
    }

    /// The material in a stream: lattice and palette, and each node's entries.
    #[staticmethod]
    #[pyo3(signature = (data, simd = None))]
    fn decode<'py>(py: Python<'py>, data: &[u8], simd: Option<&str>) -> PyResult<(Self, Indices<'py>)> {
        guarded(|| {
            let path = path_named(simd)?;
            let Nodes { axes, palette, gain, shape } = py.detach(|| stream::decode(data, path)).map_err(invalid)?;
            Ok((NodePalette { axes, palette }, (gain.to_pyarray(py), shape.to_pyarray(py))))
        })
    }

    #[pyo3(signature = (gain, shape, simd = None))]
    fn encode<'py>(
        &self,
        py: Python<'py>,
        gain: PyReadonlyArray1<u16>,
        shape: PyReadonlyArray1<u16>,
        simd: Option<&str>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        guarded(|| {
            let nodes = self.nodes(line(&gain, "gain")?, line(&shape, "shape")?)?;
            Ok(PyBytes::new(py, &stream::encode(&nodes, path_named(simd)?).map_err(invalid)?))
        })
    }

    /// Bits of lattice and palette, and of the indices.
    fn measure(&self, gain: PyReadonlyArray1<u16>, shape: PyReadonlyArray1<u16>) -> PyResult<(f64, f64)> {
        guarded(|| {
            let nodes = self.nodes(line(&gain, "gain")?, line(&shape, "shape")?)?;
            stream::measure(&nodes, path_named(None)?).map_err(invalid)
        })
    }

    #[allow(clippy::too_many_arguments)]
    fn sweep(
        &self,
        py: Python,
        mut gain: PyReadwriteArray1<u16>,
        mut shape: PyReadwriteArray1<u16>,
        gain_values: PyReadonlyArray1<f64>,
        shape_values: PyReadonlyArray2<f64>,
        starts: PyReadonlyArray1<i32>,
        columns: PyReadonlyArray1<i32>,
        values: PyReadonlyArray1<f64>,
        right: PyReadonlyArray2<f64>,
        price: Option<f64>,
    ) -> PyResult<f64> {
        guarded(|| {
            let whole = |_| invalid("gain, shape: expected numbers in one piece");
            let (gain, shape) = (gain.as_slice_mut().map_err(whole)?, shape.as_slice_mut().map_err(whole)?);
            self.check(gain, shape)?;
            let (starts, columns) = (line(&starts, "starts")?, line(&columns, "columns")?);
            let (values, right) = (line(&values, "values")?, rows(&right, "right")?);
            let nodes = self.axes.nodes();
            if starts.len() != nodes + 1
                || starts.iter().any(|&start| start < 0)
                || !starts.is_sorted()
                || right.len() != nodes
                || starts[nodes] as usize > columns.len().min(values.len())
                || columns.iter().any(|&j| j < 0 || j as usize >= nodes)
            {
                return Err(invalid("expected a sparse square matrix with a row for each node"));
            }
            let values_of =
                Values { gains: line(&gain_values, "gain_values")?, shapes: rows(&shape_values, "shape_values")? };
            if values_of.gains.len() != self.palette.gains.len() || values_of.shapes.len() != self.palette.shapes.len()
            {
                return Err(invalid("expected a value for each gain and each shape"));
            }
            let numbers = values.iter().chain(right.as_flattened()).chain(values_of.gains);
            let mut numbers = numbers.chain(values_of.shapes.as_flattened()).chain(&price);
            if !numbers.all(|x| x.is_finite()) {
                return Err(invalid("expected finite numbers, found others"));
            }
            let quadratic = Quadratic { starts, columns, values, right };
            Ok(py.detach(|| sweep(&self.axes, &self.palette, &values_of, &quadratic, gain, shape, price)))
        })
    }

    #[getter]
    fn theta_h(&self) -> Vec<usize> {
        self.axes.theta_h.iter().map(|&x| x.into()).collect()
    }

    #[getter]
    fn band(&self) -> Vec<usize> {
        self.axes.band.iter().map(|&x| x.into()).collect()
    }

    #[getter]
    fn theta_d(&self) -> Vec<Vec<usize>> {
        numbers(&self.axes.theta_d)
    }

    #[getter]
    fn phi_d(&self) -> Vec<Vec<usize>> {
        numbers(&self.axes.phi_d)
    }

    #[getter]
    fn gains(&self) -> Vec<u32> {
        self.palette.gains.clone()
    }

    #[getter]
    fn shapes(&self) -> Vec<[i32; 2]> {
        self.palette.shapes.clone()
    }
}

fn numbers(axes: &[Vec<u8>]) -> Vec<Vec<usize>> {
    axes.iter().map(|axis| axis.iter().map(|&x| x.into()).collect()).collect()
}
