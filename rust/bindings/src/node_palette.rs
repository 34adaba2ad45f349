//! The stream of compact materials, and the choice of their nodes' entries.

use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use sommerl_codec::{
    CompactMaterial, InstructionSet, Layout, NodeLattice, Palette, Prior, check_indices, decode, decode_part, encode,
    encode_part, learnt, measure,
};
use sommerl_kernels::{Values, sweep};

use crate::convert::{instruction_set, invalid, line, rows};
use crate::guarded;
use crate::least_squares::NormalEquations;

type Indices<'py> = (Bound<'py, PyArray1<u16>>, Bound<'py, PyArray1<u16>>);

/// Weights of neighbours and usual errors, for each of three coordinates.
type Known = ([[f64; 10]; 3], [f64; 3]);

/// Bounds on what a model begins with: predictions stay finite.
const MOST_WEIGHT: f64 = 16.0;
const MOST_LEVEL: f64 = 1024.0;

/// A lattice of nodes and a palette. With a prior, streams are those of parts, which leave out the lattice.
#[pyclass]
pub struct NodePalette {
    lattice: NodeLattice,
    palette: Palette,
    prior: Option<Prior>,
}

impl NodePalette {
    fn material(&self, gain: &PyReadonlyArray1<u16>, shape: &PyReadonlyArray1<u16>) -> PyResult<CompactMaterial> {
        let (lattice, palette) = (self.lattice.clone(), self.palette.clone());
        Ok(CompactMaterial {
            lattice,
            palette,
            gain: line(gain, "gain")?.to_vec(),
            shape: line(shape, "shape")?.to_vec(),
        })
    }
}

#[pymethods]
impl NodePalette {
    #[new]
    #[pyo3(signature = (theta_h, band, theta_d, phi_d, gains, shapes, reciprocal = true, mirrored = false, prior = None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        theta_h: Vec<u8>,
        band: Vec<u8>,
        theta_d: Vec<Vec<u8>>,
        phi_d: Vec<Vec<u8>>,
        gains: Vec<i32>,
        shapes: Vec<[i32; 2]>,
        reciprocal: bool,
        mirrored: bool,
        prior: Option<Known>,
    ) -> PyResult<Self> {
        guarded(|| {
            let made = NodePalette {
                lattice: NodeLattice { theta_h, band, theta_d, phi_d, reciprocal, mirrored },
                palette: Palette { gains, shapes },
                prior: prior.map(|(weights, levels)| Prior { weights, levels }),
            };
            if let Some(Prior { weights, levels }) = &made.prior {
                let fit = weights.iter().flatten().all(|weight| weight.abs() <= MOST_WEIGHT)
                    && levels.iter().all(|&level| level > 0.0 && level <= MOST_LEVEL);
                if !fit {
                    return Err(invalid("prior: expected weights up to 16, and levels above 0 and up to 1024"));
                }
            }
            made.lattice.check().map_err(invalid)?;
            made.palette.check().map_err(invalid)?;
            Ok(made)
        })
    }

    /// The material in a stream: lattice and palette, and each node's entries.
    #[staticmethod]
    #[pyo3(signature = (data, reciprocal, mirrored, version = 2, simd = None))]
    fn decode<'py>(
        py: Python<'py>,
        data: &[u8],
        reciprocal: bool,
        mirrored: bool,
        version: u16,
        simd: Option<&str>,
    ) -> PyResult<(Self, Indices<'py>)> {
        guarded(|| {
            let layout = match (version, reciprocal, mirrored) {
                (1, true, false) => Layout::First,
                (2, ..) => Layout::Second { reciprocal, mirrored },
                _ => return Err(invalid("expected version 2, or version 1 reciprocal and not mirrored")),
            };
            let set = instruction_set(simd)?;
            let CompactMaterial { lattice, palette, gain, shape } =
                py.detach(|| decode(data, layout, set)).map_err(invalid)?;
            Ok((NodePalette { lattice, palette, prior: None }, (gain.to_pyarray(py), shape.to_pyarray(py))))
        })
    }

    /// The material in a part of a stream, on this lattice and after this prior.
    #[pyo3(signature = (data, simd = None))]
    fn decode_part<'py>(&self, py: Python<'py>, data: &[u8], simd: Option<&str>) -> PyResult<(Self, Indices<'py>)> {
        guarded(|| {
            let (set, prior) = (instruction_set(simd)?, self.prior.clone().ok_or_else(|| invalid("expected a prior"))?);
            let CompactMaterial { lattice, palette, gain, shape } =
                py.detach(|| decode_part(data, &self.lattice, &prior, set)).map_err(invalid)?;
            Ok((NodePalette { lattice, palette, prior: Some(prior) }, (gain.to_pyarray(py), shape.to_pyarray(py))))
        })
    }

    /// What a model has learnt from a material.
    fn learnt(&self, gain: PyReadonlyArray1<u16>, shape: PyReadonlyArray1<u16>) -> PyResult<Known> {
        guarded(|| {
            let Prior { weights, levels } =
                learnt(&self.material(&gain, &shape)?, self.prior.as_ref()).map_err(invalid)?;
            Ok((weights, levels))
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
            let (material, set) = (self.material(&gain, &shape)?, instruction_set(simd)?);
            let stream = py.detach(|| match &self.prior {
                Some(prior) => encode_part(&material, prior, set),
                None => encode(&material, set),
            });
            let stream = stream.map_err(invalid)?;
            Ok(PyBytes::new(py, &stream))
        })
    }

    /// Bits of lattice and palette, and of the indices.
    fn measure(&self, gain: PyReadonlyArray1<u16>, shape: PyReadonlyArray1<u16>) -> PyResult<(f64, f64)> {
        let set = InstructionSet::fastest();
        guarded(|| measure(&self.material(&gain, &shape)?, self.prior.as_ref(), set).map_err(invalid))
    }

    #[allow(clippy::too_many_arguments)]
    fn sweep(
        &self,
        py: Python,
        mut gain: PyReadwriteArray1<u16>,
        mut shape: PyReadwriteArray1<u16>,
        gain_values: PyReadonlyArray1<f64>,
        shape_values: PyReadonlyArray2<f64>,
        equations: PyRef<NormalEquations>,
        price: Option<f64>,
    ) -> PyResult<f64> {
        guarded(|| {
            let whole = |_| invalid("gain, shape: expected numbers in one piece");
            let (gain, shape) = (gain.as_slice_mut().map_err(whole)?, shape.as_slice_mut().map_err(whole)?);
            check_indices(&self.lattice, &self.palette, gain, shape).map_err(invalid)?;
            let equations = &equations.normal;
            if equations.nodes() != self.lattice.nodes() {
                return Err(invalid("expected an equation for each node"));
            }
            let (gains, shapes) = (line(&gain_values, "gain_values")?, rows(&shape_values, "shape_values")?);
            if gains.len() != self.palette.gains.len() || shapes.len() != self.palette.shapes.len() {
                return Err(invalid("expected a value for each gain and each shape"));
            }
            let numbers = [gains, shapes.as_flattened(), price.as_slice()];
            if !numbers.iter().all(|part| part.iter().all(|x| x.is_finite())) {
                return Err(invalid("expected finite numbers, found others"));
            }
            let values = Values { gains, shapes };
            Ok(py.detach(|| {
                sweep(&self.lattice, &self.palette, self.prior.as_ref(), &values, equations, gain, shape, price)
            }))
        })
    }

    #[getter]
    fn theta_h(&self) -> Vec<usize> {
        self.lattice.theta_h.iter().map(|&x| x.into()).collect()
    }

    #[getter]
    fn band(&self) -> Vec<usize> {
        self.lattice.band.iter().map(|&x| x.into()).collect()
    }

    #[getter]
    fn theta_d(&self) -> Vec<Vec<usize>> {
        widened(&self.lattice.theta_d)
    }

    #[getter]
    fn phi_d(&self) -> Vec<Vec<usize>> {
        widened(&self.lattice.phi_d)
    }

    #[getter]
    fn reciprocal(&self) -> bool {
        self.lattice.reciprocal
    }

    #[getter]
    fn mirrored(&self) -> bool {
        self.lattice.mirrored
    }

    #[getter]
    fn gains(&self) -> Vec<i32> {
        self.palette.gains.clone()
    }

    #[getter]
    fn shapes(&self) -> Vec<[i32; 2]> {
        self.palette.shapes.clone()
    }
}

/// As Python's lists of int: bytes would become an object of type bytes.
fn widened(axes: &[Vec<u8>]) -> Vec<Vec<usize>> {
    axes.iter().map(|axis| axis.iter().map(|&x| x.into()).collect()).collect()
}
