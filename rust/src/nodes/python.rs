//! Bindings of the bits of compact materials.

use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::assign::{Quadratic, Values, sweep};
use super::stream::{self, Nodes};
use super::{Axes, Palette};
use crate::{path_named, rows};

fn invalid(what: impl Into<String>) -> PyErr {
    PyValueError::new_err(what.into())
}

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
    }

    /// The material in a stream: lattice and palette, and each node's entries.
    #[staticmethod]
    #[pyo3(signature = (data, simd = None))]
    fn decode<'py>(py: Python<'py>, data: &[u8], simd: Option<&str>) -> PyResult<(Self, Indices<'py>)> {
        let path = path_named(simd)?;
        let Nodes { axes, palette, gain, shape } = py.detach(|| stream::decode(data, path)).map_err(invalid)?;
        Ok((NodePalette { axes, palette }, (gain.to_pyarray(py), shape.to_pyarray(py))))
    }

    #[pyo3(signature = (gain, shape, simd = None))]
    fn encode<'py>(
        &self,
        py: Python<'py>,
        gain: PyReadonlyArray1<u16>,
        shape: PyReadonlyArray1<u16>,
        simd: Option<&str>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let nodes = self.nodes(gain.as_slice()?, shape.as_slice()?)?;
        Ok(PyBytes::new(py, &stream::encode(&nodes, path_named(simd)?).map_err(invalid)?))
    }

    /// Bits of lattice and palette, and of the indices.
    fn measure(&self, gain: PyReadonlyArray1<u16>, shape: PyReadonlyArray1<u16>) -> PyResult<(f64, f64)> {
        stream::measure(&self.nodes(gain.as_slice()?, shape.as_slice()?)?, path_named(None)?).map_err(invalid)
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
        let (gain, shape) = (gain.as_slice_mut()?, shape.as_slice_mut()?);
        self.check(gain, shape)?;
        let (starts, columns, values) = (starts.as_slice()?, columns.as_slice()?, values.as_slice()?);
        let right = rows(&right, "right")?;
        let nodes = self.axes.nodes();
        let increasing = starts.windows(2).all(|pair| 0 <= pair[0] && pair[0] <= pair[1]);
        if starts.len() != nodes + 1
            || right.len() != nodes
            || !increasing
            || starts[nodes] as usize > columns.len().min(values.len())
            || columns.iter().any(|&j| j < 0 || j as usize >= nodes)
        {
            return Err(invalid("expected a sparse square matrix with a row for each node"));
        }
        let values_of = Values { gains: gain_values.as_slice()?, shapes: rows(&shape_values, "shape_values")? };
        if values_of.gains.len() != self.palette.gains.len() || values_of.shapes.len() != self.palette.shapes.len() {
            return Err(invalid("expected a value for each gain and each shape"));
        }
        let quadratic = Quadratic { starts, columns, values, right };
        Ok(py.detach(|| sweep(&self.axes, &self.palette, &values_of, &quadratic, gain, shape, price)))
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
