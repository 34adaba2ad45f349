//! Phase 3: the nearest LUT entry of each cell, on all threads.

use crate::nearest::Codebook;
use crate::simd::{Path, Portable, Simd};
use crate::threads::share_out;

/// Fewer triples are not worth a thread.
const LEAST: usize = 256;

pub struct Palette {
    lut: Codebook,
    in_boxes: bool,
    path: Path,
    threads: usize,
}

impl Palette {
    pub fn new(lut: &[[f32; 3]], in_boxes: bool, path: Path, threads: usize) -> Self {
        let mut lut = Codebook::new(lut);
        if in_boxes {
            lut.rearrange();
        }
        Palette { lut, in_boxes, path, threads: threads.max(1) }
    }

    /// Writes the nearest entry, the lowest of several, of each triple.
    pub fn query(&self, triples: &[[f32; 3]], found: &mut [u32]) {
        let share = triples.len().div_ceil(self.threads).max(LEAST);
        let parts = triples.chunks(share).zip(found.chunks_mut(share));
        share_out(parts, self.threads, |(part, out)| self.query_part(part, out));
    }

    fn query_part(&self, triples: &[[f32; 3]], found: &mut [u32]) {
        // SAFETY: a path is only ever one that this processor has.
        unsafe {
            match self.path {
                Path::Portable => self.query_each::<Portable>(triples, found),
                #[cfg(target_arch = "x86_64")]
                Path::Avx2 => self.query_avx2(triples, found),
                #[cfg(target_arch = "x86_64")]
                Path::Avx512 => self.query_avx512(triples, found),
            }
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    unsafe fn query_avx2(&self, triples: &[[f32; 3]], found: &mut [u32]) {
        unsafe { self.query_each::<crate::simd::Avx2>(triples, found) }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f")]
    unsafe fn query_avx512(&self, triples: &[[f32; 3]], found: &mut [u32]) {
        unsafe { self.query_each::<crate::simd::Avx512>(triples, found) }
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
