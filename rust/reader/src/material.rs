//! What a file says of a material, and its values.

use sommerl_kernels::{CellLattice, CellMaterial, Cells, Cubes, NodeSteps};

use crate::factors::Factors;

/// What a material answers from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Cells, each with an entry of a LUT: the paper's.
    Cells,
    /// Nodes, between which values are interpolated: compact materials.
    Nodes,
    /// Products of small tables.
    Factored,
}

/// All that a file says of a material.
pub struct Material {
    pub name: String,
    pub source_sha256: String,
    pub notes: String,
    pub reciprocal: bool,
    pub mirrored: bool,
    pub signed: bool,
    pub values: Values,
}

/// The values, prepared for lookup.
pub enum Values {
    Cells(CellLattice, Vec<f64>, Index),
    Nodes(Box<NodeSteps>, Cubes, Vec<[f64; 4]>),
    Factors(Factors),
}

/// The number of each cell's entry, in 8 or in 16 bits.
pub enum Index {
    Narrow(Vec<u8>),
    Wide(Vec<u16>),
}

impl Material {
    pub fn kind(&self) -> Kind {
        match self.values {
            Values::Cells(..) => Kind::Cells,
            Values::Nodes(..) => Kind::Nodes,
            Values::Factors(_) => Kind::Factored,
        }
    }

    pub fn trilinear(&self) -> bool {
        if let Values::Cells(lattice, ..) = &self.values { lattice.trilinear } else { true }
    }

    /// f_r, for any vectors: docs/conventions.md says what those give that are no directions.
    pub fn eval(&self, wi: [f64; 3], wo: [f64; 3]) -> [f64; 3] {
        if !wi.iter().chain(&wo).all(|x| x.is_finite()) {
            return [f64::NAN; 3];
        }
        if !(wi[2] > 0.0 && wo[2] > 0.0) {
            return [0.0; 3];
        }
        let f_r = match &self.values {
            Values::Cells(lattice, lut, index) => {
                let cells = match index {
                    Index::Narrow(index) => Cells::Index8(index, lut),
                    Index::Wide(index) => Cells::Index16(index, lut),
                };
                CellMaterial { lattice: *lattice, cells }.eval(wi, wo)
            }
            Values::Nodes(steps, cubes, values) => {
                steps.eval(wi, wo, *cubes, |node| values.get(node).copied().unwrap_or_default())
            }
            Values::Factors(factors) => factors.eval(wi, wo),
        };
        f_r.map(finite)
    }
}

/// 0 for what is no number; what overflows, at the largest of single precision.
pub fn finite(x: f64) -> f64 {
    if x.is_nan() { 0.0 } else { x.clamp(-f64::from(f32::MAX), f64::from(f32::MAX)) }
}

/// The number of the bin of width 1 that holds x, from 0 to count - 1; of what is no number, 0.
pub fn bin(x: f64, count: usize) -> usize {
    (x as usize).min(count - 1)
}
