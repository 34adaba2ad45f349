//! Which instruction sets there are, functions that are compiled for each of them, and sixteen 32-bit floats at a time on each.
//! The choice changes the time that something takes and not one bit of its result.

mod instruction_set;
mod lanes;

pub use instruction_set::{InstructionSet, Kind};
#[cfg(target_arch = "x86_64")]
pub use lanes::{Avx2, Avx512};
pub use lanes::{Line, Portable, Simd};
#[cfg(test)]
mod tests;
