//! Eight lanes of `f32` arithmetic, once portable and once in AVX2.
//!
//! The walks are written once against [`Lanes`]. Every operation rounds once, fused exactly where
//! `mul_add` is called, so both kinds give the same bits. `min` and `max` follow the x86 rule: the second operand wins
//! unless the comparison holds, so a NaN in either gives the second.

use super::wide::{Block, Column, WIDTH};

/// One way to compute on eight lanes.
///
/// # Safety
/// Callers of any method must run on a CPU that has the implementation's features.
pub(super) unsafe trait Lanes: Copy {
    /// Eight numbers, or eight all-ones/all-zeros masks.
    type V: Copy;

    unsafe fn load(column: &Column) -> Self::V;
    unsafe fn store(v: Self::V) -> Column;
    unsafe fn splat(x: f32) -> Self::V;
    /// Four numbers in memory, twice.
    unsafe fn twice(p: *const f32) -> Self::V;
    /// Moves lanes within each half: lane `i` of a half takes its lane `ORDER >> 2 i & 3`.
    unsafe fn shuffle<const ORDER: i32>(v: Self::V) -> Self::V;
    unsafe fn add(a: Self::V, b: Self::V) -> Self::V;
    unsafe fn sub(a: Self::V, b: Self::V) -> Self::V;
    unsafe fn mul(a: Self::V, b: Self::V) -> Self::V;
    unsafe fn div(a: Self::V, b: Self::V) -> Self::V;
    /// `a * b + c`, rounded once.
    unsafe fn mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// `c - a * b`, rounded once.
    unsafe fn neg_mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// `a < b ? a : b`.
    unsafe fn min(a: Self::V, b: Self::V) -> Self::V;
    /// `a > b ? a : b`.
    unsafe fn max(a: Self::V, b: Self::V) -> Self::V;
    /// Mask of `a ≤ b`; false for NaN.
    unsafe fn le(a: Self::V, b: Self::V) -> Self::V;
    /// Mask of `a < b or a > b`; false for NaN.
    unsafe fn differ(a: Self::V, b: Self::V) -> Self::V;
    unsafe fn and(a: Self::V, b: Self::V) -> Self::V;
    unsafe fn or(a: Self::V, b: Self::V) -> Self::V;
    /// Bit `i` set iff mask lane `i` is.
    unsafe fn bits(mask: Self::V) -> u32;
    /// Hints that the node or leaf there will be needed; any address will do.
    unsafe fn prefetch(block: *const Block);
}

/// Plain Rust, for every CPU; slow on x86 CPUs older than FMA, where `mul_add` is a library call.
#[derive(Clone, Copy)]
pub(super) struct Portable;

#[inline(always)]
fn zip(a: [f32; WIDTH], b: [f32; WIDTH], f: impl Fn(f32, f32) -> f32) -> [f32; WIDTH] {
    let mut out = a;
    for i in 0..WIDTH {
        out[i] = f(a[i], b[i]);
    }
    out
}

#[inline(always)]
fn mask(set: bool) -> f32 {
    f32::from_bits(if set { u32::MAX } else { 0 })
}

#[inline(always)]
fn bitwise(a: f32, b: f32, f: impl Fn(u32, u32) -> u32) -> f32 {
    f32::from_bits(f(a.to_bits(), b.to_bits()))
}

// SAFETY: nothing here needs a CPU feature.
unsafe impl Lanes for Portable {
    type V = [f32; WIDTH];

    #[inline(always)]
    unsafe fn load(column: &Column) -> Self::V {
        column.0
    }
    #[inline(always)]
    unsafe fn store(v: Self::V) -> Column {
        Column(v)
    }
    #[inline(always)]
    unsafe fn splat(x: f32) -> Self::V {
        [x; WIDTH]
    }
    #[inline(always)]
    unsafe fn twice(p: *const f32) -> Self::V {
        // SAFETY: the caller's promise.
        let [x, y, z, w] = unsafe { *p.cast::<[f32; 4]>() };
        [x, y, z, w, x, y, z, w]
    }
    #[inline(always)]
    unsafe fn shuffle<const ORDER: i32>(v: Self::V) -> Self::V {
        let mut out = v;
        for i in 0..WIDTH {
            out[i] = v[(i & 4) + (ORDER >> (2 * (i & 3)) & 3) as usize];
        }
        out
    }
    #[inline(always)]
    unsafe fn add(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| a + b)
    }
    #[inline(always)]
    unsafe fn sub(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| a - b)
    }
    #[inline(always)]
    unsafe fn mul(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| a * b)
    }
    #[inline(always)]
    unsafe fn div(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| a / b)
    }
    #[inline(always)]
    unsafe fn mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V {
        let mut out = c;
        for i in 0..WIDTH {
            out[i] = a[i].mul_add(b[i], c[i]);
        }
        out
    }
    #[inline(always)]
    unsafe fn neg_mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V {
        let mut out = c;
        for i in 0..WIDTH {
            out[i] = (-a[i]).mul_add(b[i], c[i]);
        }
        out
    }
    #[inline(always)]
    unsafe fn min(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    unsafe fn max(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    unsafe fn le(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| mask(a <= b))
    }
    #[inline(always)]
    unsafe fn differ(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| mask(a.partial_cmp(&b).is_some_and(|order| order.is_ne())))
    }
    #[inline(always)]
    unsafe fn and(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| bitwise(a, b, |a, b| a & b))
    }
    #[inline(always)]
    unsafe fn or(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| bitwise(a, b, |a, b| a | b))
    }
    #[inline(always)]
    unsafe fn bits(mask: Self::V) -> u32 {
        (0..WIDTH).fold(0, |bits, i| bits | (mask[i].to_bits() >> 31) << i)
    }
    #[inline(always)]
    unsafe fn prefetch(_: *const Block) {}
}

/// AVX2 and FMA, which the caller must have detected. The methods carry no `target_feature` of their own:
/// they are inlined into functions that do, which is what lets the walks stay generic.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(super) struct Avx2;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::*;

    use super::{Avx2, Block, Column, Lanes};

    // SAFETY: the trait asks callers for a CPU with AVX2 and FMA, which is all these intrinsics need, and
    // a `Column` is 32-byte aligned.
    unsafe impl Lanes for Avx2 {
        type V = __m256;

        #[inline(always)]
        unsafe fn load(column: &Column) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_load_ps(column.0.as_ptr()) }
        }
        #[inline(always)]
        unsafe fn store(v: __m256) -> Column {
            let mut column = Column([0.0; 8]);
            // SAFETY: as above.
            unsafe { _mm256_store_ps(column.0.as_mut_ptr(), v) };
            column
        }
        #[inline(always)]
        unsafe fn splat(x: f32) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_set1_ps(x) }
        }
        #[inline(always)]
        unsafe fn twice(p: *const f32) -> __m256 {
            // SAFETY: as above; the caller vouches for the address, which may be unaligned.
            unsafe {
                let half = _mm_loadu_ps(p);
                _mm256_set_m128(half, half)
            }
        }
        #[inline(always)]
        unsafe fn shuffle<const ORDER: i32>(v: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_permute_ps::<ORDER>(v) }
        }
        #[inline(always)]
        unsafe fn add(a: __m256, b: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_add_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn sub(a: __m256, b: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_sub_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn mul(a: __m256, b: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_mul_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn div(a: __m256, b: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_div_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn mul_add(a: __m256, b: __m256, c: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_fmadd_ps(a, b, c) }
        }
        #[inline(always)]
        unsafe fn neg_mul_add(a: __m256, b: __m256, c: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_fnmadd_ps(a, b, c) }
        }
        #[inline(always)]
        unsafe fn min(a: __m256, b: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_min_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn max(a: __m256, b: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_max_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn le(a: __m256, b: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(a, b) }
        }
        #[inline(always)]
        unsafe fn differ(a: __m256, b: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_cmp_ps::<_CMP_NEQ_OQ>(a, b) }
        }
        #[inline(always)]
        unsafe fn and(a: __m256, b: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_and_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn or(a: __m256, b: __m256) -> __m256 {
            // SAFETY: as above.
            unsafe { _mm256_or_ps(a, b) }
        }
        #[inline(always)]
        unsafe fn bits(mask: __m256) -> u32 {
            // SAFETY: as above.
            unsafe { _mm256_movemask_ps(mask) as u32 }
        }
        #[inline(always)]
        unsafe fn prefetch(block: *const Block) {
            // SAFETY: a prefetch of whatever address has no effect but on speed.
            unsafe {
                _mm_prefetch::<_MM_HINT_T0>(block.cast());
                _mm_prefetch::<_MM_HINT_T0>(block.wrapping_add(1).cast());
                _mm_prefetch::<_MM_HINT_T0>(block.wrapping_add(2).cast());
                _mm_prefetch::<_MM_HINT_T0>(block.wrapping_add(3).cast());
            }
        }
    }
}
