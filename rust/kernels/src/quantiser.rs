//! Phase 3: the nearest LUT entry of each cell, on all threads.

use sommerl_simd::{InstructionSet, Simd, for_each_instruction_set};

use crate::codebook::Codebook;
use crate::threads::share_out;

/// Fewer triples are not worth a thread.
const LEAST: usize = 256;

/// A LUT, prepared for finding the nearest of its entries.
pub struct Quantiser {
    lut: Codebook,
    in_boxes: bool,
    set: InstructionSet,
    threads: usize,
}

impl Quantiser {
    /// in_boxes: whether to search only the boxes that can hold the nearest entry, which changes nothing but the time. threads: the
    /// most that work at once.
    pub fn new(lut: &[[f32; 3]], in_boxes: bool, set: InstructionSet, threads: usize) -> Self {
        let mut lut = Codebook::new(lut);
        if in_boxes {
            lut.rearrange();
        }
        Quantiser { lut, in_boxes, set, threads: threads.max(1) }
    }

    /// Writes the number of each triple's nearest entry, the lowest where several are equally near.
    pub fn query(&self, triples: &[[f32; 3]], found: &mut [u32]) {
        let share = triples.len().div_ceil(self.threads).max(LEAST);
        let parts = triples.chunks(share).zip(found.chunks_mut(share));
        share_out(parts, self.threads, |(part, out)| query_part(self.set, self, part, out));
    }

    #[inline(always)]
    unsafe fn query_each<S: Simd>(&self, triples: &[[f32; 3]], found: &mut [u32]) {
        let (mut last, mut work) = (0, 0); // neighbouring cells look alike
        for (&x, out) in triples.iter().zip(found) {
            (last, _) = unsafe {
                if self.in_boxes { self.lut.nearest::<S>(x, last, &mut work) } else { self.lut.nearest_of_all::<S>(x) }
            };
            *out = last as u32;
        }
    }
}

for_each_instruction_set! {
    fn query_part(quantiser: &Quantiser, triples: &[[f32; 3]], found: &mut [u32]) {
        // SAFETY: the function is compiled for the instruction set of `Lanes`.
        unsafe { quantiser.query_each::<Lanes>(triples, found) }
    }
}
