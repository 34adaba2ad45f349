//! The bits of a compact material: the lattice of nodes, the palette of gains and shapes, and each node's entries.

pub mod assign;
mod entries;
mod model;
mod predictor;
pub mod python;
mod range;
pub mod stream;

/// Steps of each axis of the fine grid.
pub const FINE: u8 = 180;

/// Places of nodes on the fine grid, as `nodes.py` has them.
#[derive(Clone, Debug, PartialEq)]
pub struct Axes {
    pub theta_h: Vec<u8>,
    /// Of each row of equal θ_h.
    pub band: Vec<u8>,
    pub theta_d: Vec<Vec<u8>>,
    pub phi_d: Vec<Vec<u8>>,
}

impl Axes {
    pub fn nodes_in(&self, row: usize) -> usize {
        let band = self.band[row] as usize;
        self.theta_d[band].len() * self.phi_d[band].len()
    }

    /// The number of nodes in φ_d of a row.
    pub fn width(&self, row: usize) -> usize {
        self.phi_d[self.band[row] as usize].len()
    }

    pub fn nodes(&self) -> usize {
        (0..self.band.len()).map(|row| self.nodes_in(row)).sum()
    }
}

/// Steps of a gain's code to the octave.
pub const OCTAVE: u32 = 128;
/// Steps of a shape's coordinates to 1.
pub const UNIT: f64 = 64.0;

/// Gains and shapes, by their codes.
#[derive(Clone, Debug, PartialEq)]
pub struct Palette {
    /// Increasing.
    pub gains: Vec<u32>,
    /// Coordinates (r − b, g − (r + b)/2) in steps of 1/UNIT, of shapes whose mean is 1. The first does not decrease.
    pub shapes: Vec<[i32; 2]>,
}

impl Palette {
    /// Octaves of the gains, and both coordinates of the shapes.
    fn places(&self) -> [Vec<f64>; 3] {
        let gains = self.gains.iter().map(|&code| f64::from(code) / f64::from(OCTAVE)).collect();
        let [first, second] = [0, 1].map(|axis| self.shapes.iter().map(|s| f64::from(s[axis]) / UNIT).collect());
        [gains, first, second]
    }
}
