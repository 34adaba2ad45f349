//! Sixteen 32-bit floats at a time. Every implementation gives the same bits.

/// Sixteen numbers, aligned for the widest vectors.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub struct Line(
    /// The numbers.
    pub [f32; 16],
);

/// Operations on sixteen lanes. A comparison gives sixteen bits, the lowest for the first lane.
///
/// # Safety
/// An implementation uses no instructions but those of its instruction set. Its functions may be called only on a processor that
/// has these, and are fast only where they are inlined into a function that is compiled for them.
#[allow(clippy::missing_safety_doc)] // of each function: the trait's
pub unsafe trait Simd {
    /// The sixteen lanes in registers.
    type V: Copy;
    /// `x` in each lane.
    unsafe fn splat(x: f32) -> Self::V;
    /// The numbers of a line.
    unsafe fn load(line: &Line) -> Self::V;
    /// a + b.
    unsafe fn add(a: Self::V, b: Self::V) -> Self::V;
    /// a − b.
    unsafe fn sub(a: Self::V, b: Self::V) -> Self::V;
    /// a · b.
    unsafe fn mul(a: Self::V, b: Self::V) -> Self::V;
    /// The smaller of each two; of `b` where one is NaN.
    unsafe fn min(a: Self::V, b: Self::V) -> Self::V;
    /// The larger of each two; of `b` where one is NaN.
    unsafe fn max(a: Self::V, b: Self::V) -> Self::V;
    /// Where a ≤ b.
    unsafe fn le(a: Self::V, b: Self::V) -> u32;
    /// Lanes of `x` where a < b, of `y` elsewhere.
    unsafe fn select_lt(a: Self::V, b: Self::V, x: Self::V, y: Self::V) -> Self::V;
    /// The lanes as a line.
    unsafe fn store(v: Self::V) -> Line;
    /// The smallest of all lanes, none of which is NaN.
    unsafe fn smallest(v: Self::V) -> f32;
}

/// Plain loops over lanes, which the compiler turns into vectors of what every processor of the target has (SSE2, NEON …).
pub struct Portable;

#[inline(always)]
fn lanes(f: impl Fn(usize) -> f32) -> [f32; 16] {
    std::array::from_fn(f)
}

unsafe impl Simd for Portable {
    type V = [f32; 16];
    #[inline(always)]
    unsafe fn splat(x: f32) -> Self::V {
        [x; 16]
    }
    #[inline(always)]
    unsafe fn load(line: &Line) -> Self::V {
        line.0
    }
    #[inline(always)]
    unsafe fn add(a: Self::V, b: Self::V) -> Self::V {
        lanes(|i| a[i] + b[i])
    }
    #[inline(always)]
    unsafe fn sub(a: Self::V, b: Self::V) -> Self::V {
        lanes(|i| a[i] - b[i])
    }
    #[inline(always)]
    unsafe fn mul(a: Self::V, b: Self::V) -> Self::V {
        lanes(|i| a[i] * b[i])
    }
    #[inline(always)]
    unsafe fn min(a: Self::V, b: Self::V) -> Self::V {
        lanes(|i| if a[i] < b[i] { a[i] } else { b[i] })
    }
    #[inline(always)]
    unsafe fn max(a: Self::V, b: Self::V) -> Self::V {
        lanes(|i| if a[i] > b[i] { a[i] } else { b[i] })
    }
    #[inline(always)]
    unsafe fn le(a: Self::V, b: Self::V) -> u32 {
        (0..16).fold(0, |bits, i| bits | (u32::from(a[i] <= b[i]) << i))
    }
    #[inline(always)]
    unsafe fn select_lt(a: Self::V, b: Self::V, x: Self::V, y: Self::V) -> Self::V {
        lanes(|i| if a[i] < b[i] { x[i] } else { y[i] })
    }
    #[inline(always)]
    unsafe fn store(v: Self::V) -> Line {
        Line(v)
    }
    #[inline(always)]
    unsafe fn smallest(v: Self::V) -> f32 {
        v.into_iter().fold(f32::INFINITY, f32::min)
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Line, Simd};
    use std::arch::x86_64::*;

    /// One AVX-512 register.
    pub struct Avx512;

    unsafe impl Simd for Avx512 {
        type V = __m512;
        #[inline(always)]
        unsafe fn splat(x: f32) -> __m512 {
            unsafe { _mm512_set1_ps(x) }
        }
        #[inline(always)]
        unsafe fn load(line: &Line) -> __m512 {
            unsafe { _mm512_load_ps(line.0.as_ptr()) }
        }
        #[inline(always)]
        unsafe fn add(a: __m512, b: __m512) -> __m512 {
            unsafe { _mm512_add_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn sub(a: __m512, b: __m512) -> __m512 {
            unsafe { _mm512_sub_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn mul(a: __m512, b: __m512) -> __m512 {
            unsafe { _mm512_mul_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn min(a: __m512, b: __m512) -> __m512 {
            unsafe { _mm512_min_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn max(a: __m512, b: __m512) -> __m512 {
            unsafe { _mm512_max_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn le(a: __m512, b: __m512) -> u32 {
            unsafe { u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b)) }
        }
        #[inline(always)]
        unsafe fn select_lt(a: __m512, b: __m512, x: __m512, y: __m512) -> __m512 {
            unsafe { _mm512_mask_blend_ps(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b), y, x) }
        }
        #[inline(always)]
        unsafe fn store(v: __m512) -> Line {
            let mut line = Line([0.0; 16]);
            unsafe { _mm512_store_ps(line.0.as_mut_ptr(), v) };
            line
        }
        #[inline(always)]
        unsafe fn smallest(v: __m512) -> f32 {
            unsafe { _mm512_reduce_min_ps(v) }
        }
    }

    /// Two AVX2 registers.
    pub struct Avx2;

    unsafe impl Simd for Avx2 {
        type V = [__m256; 2];
        #[inline(always)]
        unsafe fn splat(x: f32) -> Self::V {
            unsafe { [_mm256_set1_ps(x); 2] }
        }
        #[inline(always)]
        unsafe fn load(line: &Line) -> Self::V {
            let p = line.0.as_ptr();
            unsafe { [_mm256_load_ps(p), _mm256_load_ps(p.add(8))] }
        }
        #[inline(always)]
        unsafe fn add(a: Self::V, b: Self::V) -> Self::V {
            unsafe { [_mm256_add_ps(a[0], b[0]), _mm256_add_ps(a[1], b[1])] }
        }
        #[inline(always)]
        unsafe fn sub(a: Self::V, b: Self::V) -> Self::V {
            unsafe { [_mm256_sub_ps(a[0], b[0]), _mm256_sub_ps(a[1], b[1])] }
        }
        #[inline(always)]
        unsafe fn mul(a: Self::V, b: Self::V) -> Self::V {
            unsafe { [_mm256_mul_ps(a[0], b[0]), _mm256_mul_ps(a[1], b[1])] }
        }
        #[inline(always)]
        unsafe fn min(a: Self::V, b: Self::V) -> Self::V {
            unsafe { [_mm256_min_ps(a[0], b[0]), _mm256_min_ps(a[1], b[1])] }
        }
        #[inline(always)]
        unsafe fn max(a: Self::V, b: Self::V) -> Self::V {
            unsafe { [_mm256_max_ps(a[0], b[0]), _mm256_max_ps(a[1], b[1])] }
        }
        #[inline(always)]
        unsafe fn le(a: Self::V, b: Self::V) -> u32 {
            unsafe {
                let low = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a[0], b[0]));
                let high = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a[1], b[1]));
                (low | (high << 8)) as u32
            }
        }
        #[inline(always)]
        unsafe fn select_lt(a: Self::V, b: Self::V, x: Self::V, y: Self::V) -> Self::V {
            unsafe {
                [
                    _mm256_blendv_ps(y[0], x[0], _mm256_cmp_ps::<_CMP_LT_OQ>(a[0], b[0])),
                    _mm256_blendv_ps(y[1], x[1], _mm256_cmp_ps::<_CMP_LT_OQ>(a[1], b[1])),
                ]
            }
        }
        #[inline(always)]
        unsafe fn store(v: Self::V) -> Line {
            let mut line = Line([0.0; 16]);
            let p = line.0.as_mut_ptr();
            unsafe {
                _mm256_store_ps(p, v[0]);
                _mm256_store_ps(p.add(8), v[1]);
            }
            line
        }
        #[inline(always)]
        unsafe fn smallest(v: Self::V) -> f32 {
            unsafe {
                let eight = _mm256_min_ps(v[0], v[1]);
                let four = _mm_min_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps::<1>(eight));
                let two = _mm_min_ps(four, _mm_movehl_ps(four, four));
                _mm_cvtss_f32(_mm_min_ss(two, _mm_shuffle_ps::<1>(two, two)))
            }
        }
    }
}
