//! The stream that a compact material's file holds: its lattice of nodes, its palette of gains and shapes, and the entries that
//! each node has. docs/format.md says what each bit means. Format 2 is written, formats 1 and 2 are read.
//!
//! ```
//! use sommerl_codec::{CompactMaterial, Error, InstructionSet, Layout, NodeLattice, Palette, decode, encode};
//!
//! let material = CompactMaterial {
//!     lattice: NodeLattice {
//!         theta_h: vec![0, 180],
//!         band: vec![0, 0],
//!         theta_d: vec![vec![0, 180]],
//!         phi_d: vec![vec![0]],
//!         reciprocal: false,
//!         mirrored: true,
//!     },
//!     palette: Palette { gains: vec![-100, 200], shapes: vec![[0, 0]] },
//!     gain: vec![0, 1, 1, 0],
//!     shape: vec![0; 4],
//! };
//! let stream = encode(&material, InstructionSet::fastest())?;
//! let layout = Layout::Second { reciprocal: false, mirrored: true };
//! assert_eq!(decode(&stream, layout, InstructionSet::fastest())?, material);
//! # Ok::<(), Error>(())
//! ```

mod entries;
mod error;
mod lattice;
mod model;
mod palette;
mod predictor;
mod range_coder;
mod stream;
#[cfg(test)]
mod tests;

pub use error::Error;
pub use lattice::{FINE, NodeLattice};
pub use model::{Model, Prior};
pub use palette::Palette;
pub use range_coder::{Weights, bits_of};
pub use sommerl_simd::InstructionSet;
pub use stream::{CompactMaterial, Layout, check_indices, decode, decode_part, encode, encode_part, learnt, measure};
