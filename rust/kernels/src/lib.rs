//! Sommerl's hot loops: SOM-MAN training, the nearest entry of a LUT, the fit of nodes and the choice of their entries, and the lookup of directions in
//! materials on cells and on nodes.
//!
//! Every one gives the same bits on all instruction sets and any number of threads. The package's tests hold training and search
//! to `compression/paper/reference.py` bit for bit, and lookup to `Brdf.eval` within rounding.

mod cells;
mod codebook;
mod learner;
mod least_squares;
mod line_errors;
mod lookup;
mod nodes;
mod quantiser;
mod sweep;
pub mod threads;

pub use cells::{CellLattice, CellMaterial, Cells};
pub use learner::{EMPTY, Epoch, Learner, Rule, STORED, Search};
pub use least_squares::{Normal, Samples};
pub use line_errors::line_errors;
pub use lookup::{Material, Pairs, Room, angle, eval, half_diff};
pub use nodes::{Corners, Cubes, Factors, NodeMaterial, NodeSteps};
pub use quantiser::Quantiser;
pub use sweep::{Values, sweep};

#[cfg(test)]
mod tests;
