//! Eight lanes in AVX2 registers.
//!
//! SAFETY of the whole module: its types are private to the crate, which exposes them only as type arguments of tasks
//! that `processor.rs` runs after it has detected AVX2 and FMA. Every function here therefore runs on a processor with
//! both.

use crate::real::{Int, Mask, Real};
use crate::wide::{Column, Wide};
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Shl, Shr, Sub};

/// Eight `f32`.
#[derive(Clone, Copy, Debug)]
pub struct F32x8(__m256);

/// Eight `u32`.
#[derive(Clone, Copy, Debug)]
pub struct U32x8(__m256i);

/// Eight truth values, all bits set or none.
#[derive(Clone, Copy, Debug)]
pub struct Mask8(__m256);

macro_rules! operators {
    ($t:ident: $($trait:ident $method:ident $intrinsic:ident),* $(,)?) => {$(
        impl $trait for $t {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: see the module documentation.
                unsafe { Self($intrinsic(self.0, other.0)) }
            }
        }
    )*};
}
operators!(F32x8: Add add _mm256_add_ps, Sub sub _mm256_sub_ps, Mul mul _mm256_mul_ps, Div div _mm256_div_ps);
operators!(U32x8: BitAnd bitand _mm256_and_si256, BitOr bitor _mm256_or_si256, BitXor bitxor _mm256_xor_si256);
operators!(Mask8: BitAnd bitand _mm256_and_ps, BitOr bitor _mm256_or_ps);

macro_rules! with_constants {
    ($($trait:ident $method:ident),*) => {$(
        impl $trait<f32> for F32x8 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f32) -> Self {
                $trait::$method(self, Self::splat(other))
            }
        }
    )*};
}
with_constants!(Add add, Sub sub, Mul mul);

impl Neg for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_xor_ps(self.0, _mm256_set1_ps(-0.0))) }
    }
}

impl Shl<u32> for U32x8 {
    type Output = Self;
    #[inline(always)]
    fn shl(self, by: u32) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_sll_epi32(self.0, _mm_cvtsi32_si128(by as i32))) }
    }
}

impl Shr<u32> for U32x8 {
    type Output = Self;
    #[inline(always)]
    fn shr(self, by: u32) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_srl_epi32(self.0, _mm_cvtsi32_si128(by as i32))) }
    }
}

impl Not for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_xor_ps(self.0, _mm256_castsi256_ps(_mm256_set1_epi32(-1)))) }
    }
}

/// For every set of lanes, the lanes in order, then arbitrary lanes.
static COMPRESSED: [[u32; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut set = 0;
    while set < 256 {
        let (mut lane, mut at) = (0, 0);
        while lane < 8 {
            if set >> lane & 1 == 1 {
                table[set][at] = lane;
                at += 1;
            }
            lane += 1;
        }
        set += 1;
    }
    table
};

#[inline(always)]
fn order(mask: Mask8) -> __m256i {
    // SAFETY: see the module documentation; the table's rows hold eight numbers.
    unsafe { _mm256_loadu_si256(COMPRESSED[(mask.to_bits() & 0xff) as usize].as_ptr().cast()) }
}

impl Real for F32x8 {
    type Mask = Mask8;
    type Int = U32x8;
    const WIDTH: usize = 8;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_set1_ps(x)) }
    }
    #[inline(always)]
    fn load(from: &[f32]) -> Self {
        // SAFETY: see the module documentation; the slice is long enough.
        unsafe { Self(_mm256_loadu_ps(from[..8].as_ptr())) }
    }
    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        // SAFETY: see the module documentation; the slice is long enough.
        unsafe { _mm256_storeu_ps(to[..8].as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn compress(self, mask: Mask8, to: &mut [f32]) {
        // SAFETY: see the module documentation; the slice is long enough.
        unsafe { _mm256_storeu_ps(to[..8].as_mut_ptr(), _mm256_permutevar8x32_ps(self.0, order(mask))) }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_sqrt_ps(self.0)) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)) }
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        // SAFETY: see the module documentation.
        unsafe {
            let bit = _mm256_set1_ps(-0.0);
            Self(_mm256_or_ps(_mm256_andnot_ps(bit, self.0), _mm256_and_ps(bit, sign.0)))
        }
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_max_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_min_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Mask8 {
        // SAFETY: see the module documentation.
        unsafe { Mask8(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)) }
    }
    #[inline(always)]
    fn le(self, other: Self) -> Mask8 {
        // SAFETY: see the module documentation.
        unsafe { Mask8(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) }
    }
    #[inline(always)]
    fn select(mask: Mask8, yes: Self, no: Self) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_blendv_ps(no.0, yes.0, mask.0)) }
    }
    #[inline(always)]
    fn bits(self) -> U32x8 {
        // SAFETY: see the module documentation.
        unsafe { U32x8(_mm256_castps_si256(self.0)) }
    }
    #[inline(always)]
    fn from_bits(bits: U32x8) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_castsi256_ps(bits.0)) }
    }
    #[inline(always)]
    fn truncate(self) -> U32x8 {
        // SAFETY: see the module documentation.
        unsafe { U32x8(_mm256_cvttps_epi32(self.0)) }
    }
    #[inline(always)]
    fn lookup(table: &[[f32; 8]], index: U32x8) -> [Self; 8] {
        let mut at = [0; 8];
        index.store(&mut at);
        // SAFETY: see the module documentation; the table's rows hold eight numbers.
        unsafe {
            let row = |lane: usize| _mm256_loadu_ps(table[at[lane] as usize].as_ptr());
            // Lanes and numbers are swapped, as in a transposed matrix.
            let (a, b, c, d) = (row(0), row(1), row(2), row(3));
            let (e, f, g, h) = (row(4), row(5), row(6), row(7));
            let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
            let (ef, gh) = (_mm256_unpacklo_ps(e, f), _mm256_unpacklo_ps(g, h));
            let (ab2, cd2) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
            let (ef2, gh2) = (_mm256_unpackhi_ps(e, f), _mm256_unpackhi_ps(g, h));
            let left = [
                _mm256_shuffle_ps::<0x44>(ab, cd),
                _mm256_shuffle_ps::<0xee>(ab, cd),
                _mm256_shuffle_ps::<0x44>(ab2, cd2),
                _mm256_shuffle_ps::<0xee>(ab2, cd2),
            ];
            let right = [
                _mm256_shuffle_ps::<0x44>(ef, gh),
                _mm256_shuffle_ps::<0xee>(ef, gh),
                _mm256_shuffle_ps::<0x44>(ef2, gh2),
                _mm256_shuffle_ps::<0xee>(ef2, gh2),
            ];
            let low = |i: usize| Self(_mm256_permute2f128_ps::<0x20>(left[i], right[i]));
            let high = |i: usize| Self(_mm256_permute2f128_ps::<0x31>(left[i], right[i]));
            [low(0), low(1), low(2), low(3), high(0), high(1), high(2), high(3)]
        }
    }
}

impl Int for U32x8 {
    type Mask = Mask8;
    type Real = F32x8;

    #[inline(always)]
    fn splat(x: u32) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_set1_epi32(x as i32)) }
    }
    #[inline(always)]
    fn load(from: &[u32]) -> Self {
        // SAFETY: see the module documentation; the slice is long enough.
        unsafe { Self(_mm256_loadu_si256(from[..8].as_ptr().cast())) }
    }
    #[inline(always)]
    fn store(self, to: &mut [u32]) {
        // SAFETY: see the module documentation; the slice is long enough.
        unsafe { _mm256_storeu_si256(to[..8].as_mut_ptr().cast(), self.0) }
    }
    #[inline(always)]
    fn compress(self, mask: Mask8, to: &mut [u32]) {
        // SAFETY: see the module documentation; the slice is long enough.
        unsafe { _mm256_storeu_si256(to[..8].as_mut_ptr().cast(), _mm256_permutevar8x32_epi32(self.0, order(mask))) }
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_add_epi32(self.0, other.0)) }
    }
    #[inline(always)]
    fn times(self, other: Self) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_mullo_epi32(self.0, other.0)) }
    }
    #[inline(always)]
    fn equals(self, other: Self) -> Mask8 {
        // SAFETY: see the module documentation.
        unsafe { Mask8(_mm256_castsi256_ps(_mm256_cmpeq_epi32(self.0, other.0))) }
    }
    #[inline(always)]
    fn select(mask: Mask8, yes: Self, no: Self) -> Self {
        // SAFETY: see the module documentation.
        unsafe { Self(_mm256_blendv_epi8(no.0, yes.0, _mm256_castps_si256(mask.0))) }
    }
    #[inline(always)]
    fn signed_to_real(self) -> F32x8 {
        // SAFETY: see the module documentation.
        unsafe { F32x8(_mm256_cvtepi32_ps(self.0)) }
    }
    #[inline(always)]
    fn reverse_bits(self) -> Self {
        // Reverses the bytes of each number, and the bits of each nibble by table, and swaps the nibbles.
        // SAFETY: see the module documentation.
        unsafe {
            let bytes = _mm256_setr_epi8(
                3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12, 3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13,
                12,
            );
            let nibbles = _mm256_setr_epi8(
                0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15, 0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7,
                15,
            );
            let low = _mm256_set1_epi8(0x0f);
            let x = _mm256_shuffle_epi8(self.0, bytes);
            let lower = _mm256_shuffle_epi8(nibbles, _mm256_and_si256(x, low));
            let upper = _mm256_shuffle_epi8(nibbles, _mm256_and_si256(_mm256_srli_epi16::<4>(x), low));
            Self(_mm256_or_si256(_mm256_slli_epi16::<4>(lower), upper))
        }
    }
}

impl Mask for Mask8 {
    #[inline(always)]
    fn splat(set: bool) -> Self {
        U32x8::splat(if set { u32::MAX } else { 0 }).as_mask()
    }
    #[inline(always)]
    fn to_bits(self) -> u32 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
}

impl U32x8 {
    #[inline(always)]
    fn as_mask(self) -> Mask8 {
        // SAFETY: see the module documentation.
        unsafe { Mask8(_mm256_castsi256_ps(self.0)) }
    }
}

/// Eight lanes with fused multiplication.
#[derive(Clone, Copy, Debug)]
pub struct WideF32x8;

impl Wide for WideF32x8 {
    type V = __m256;

    #[inline(always)]
    fn load(column: &Column) -> __m256 {
        // SAFETY: see the module documentation; a column is 32-byte aligned.
        unsafe { _mm256_load_ps(column.0.as_ptr()) }
    }
    #[inline(always)]
    fn store(v: __m256) -> Column {
        let mut column = Column([0.0; 8]);
        // SAFETY: see the module documentation.
        unsafe { _mm256_store_ps(column.0.as_mut_ptr(), v) };
        column
    }
    #[inline(always)]
    fn splat(x: f32) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_set1_ps(x) }
    }
    #[inline(always)]
    fn twice(from: &[f32; 4]) -> __m256 {
        // SAFETY: see the module documentation; the four numbers may be unaligned.
        unsafe {
            let half = _mm_loadu_ps(from.as_ptr());
            _mm256_set_m128(half, half)
        }
    }
    #[inline(always)]
    fn shuffle<const ORDER: i32>(v: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_permute_ps::<ORDER>(v) }
    }
    #[inline(always)]
    fn add(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_add_ps(a, b) }
    }
    #[inline(always)]
    fn sub(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_sub_ps(a, b) }
    }
    #[inline(always)]
    fn mul(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_mul_ps(a, b) }
    }
    #[inline(always)]
    fn div(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_div_ps(a, b) }
    }
    #[inline(always)]
    fn mul_add(a: __m256, b: __m256, c: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_fmadd_ps(a, b, c) }
    }
    #[inline(always)]
    fn neg_mul_add(a: __m256, b: __m256, c: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_fnmadd_ps(a, b, c) }
    }
    #[inline(always)]
    fn min(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_min_ps(a, b) }
    }
    #[inline(always)]
    fn max(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_max_ps(a, b) }
    }
    #[inline(always)]
    fn le(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(a, b) }
    }
    #[inline(always)]
    fn differ(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_cmp_ps::<_CMP_NEQ_OQ>(a, b) }
    }
    #[inline(always)]
    fn and(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_and_ps(a, b) }
    }
    #[inline(always)]
    fn or(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_or_ps(a, b) }
    }
    #[inline(always)]
    fn bits(mask: __m256) -> u32 {
        // SAFETY: see the module documentation.
        unsafe { _mm256_movemask_ps(mask) as u32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Processor;
    use syntable_model::random::Stream;

    /// Whether the types of this module may be used: the tests check what [`Processor::run`] normally ensures.
    fn available() -> bool {
        Processor::detect() != Processor::portable()
    }

    /// Every operation on eight lanes gives the same bits as on a single number.
    #[test]
    fn lanes_agree_with_single_numbers() {
        if !available() {
            println!("skipped: this processor has no AVX2");
            return;
        }
        let mut stream = Stream::root(2);
        let special = [0.0, -0.0, 1.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, f32::MIN_POSITIVE, 1e-42];
        for round in 0..400 {
            let mut draw = || match round % 4 {
                0 => special[stream.below(8) as usize],
                _ => (stream.uniform(-3.0, 3.0) * 10.0_f64.powf(stream.uniform(-3.0, 3.0))) as f32,
            };
            let (a, b): ([f32; 8], [f32; 8]) = (std::array::from_fn(|_| draw()), std::array::from_fn(|_| draw()));
            let (va, vb) = (F32x8::load(&a), F32x8::load(&b));
            let real = |name: &str, got: F32x8, want: fn(f32, f32) -> f32| {
                let mut out = [0.0; 8];
                got.store(&mut out);
                for i in 0..8 {
                    let want = want(a[i], b[i]);
                    assert!(
                        out[i].to_bits() == want.to_bits() || out[i].is_nan() && want.is_nan(),
                        "{name} {} {}",
                        a[i],
                        b[i]
                    );
                }
            };
            real("add", va + vb, |a, b| a + b);
            real("sub", va - vb, |a, b| a - b);
            real("mul", va * vb, |a, b| a * b);
            real("div", va / vb, |a, b| a / b);
            real("neg", -va, |a, _| -a);
            real("sqrt", va.sqrt(), |a, _| Real::sqrt(a));
            real("abs", va.abs(), |a, _| Real::abs(a));
            real("copysign", va.copysign(vb), Real::copysign);
            real("larger", va.larger(vb), |a, b| a.larger(b));
            real("smaller", va.smaller(vb), |a, b| a.smaller(b));
            real("lt", F32x8::select(va.lt(vb), va, vb), |a, b| f32::select(a < b, a, b));
            real("le", F32x8::select(va.le(vb), va, vb), |a, b| f32::select(a <= b, a, b));
            real("not", F32x8::select(!va.le(vb), va, vb), |a, b| f32::select(!Real::le(a, b), a, b));
            real("bits", F32x8::from_bits(va.bits()), |a, _| a);
            real("signed", va.bits().signed_to_real(), |a, _| a.to_bits().signed_to_real());
            let c = a.map(|x| if x.is_finite() { x } else { 7.5 });
            let mut out = [0; 8];
            F32x8::load(&c).truncate().store(&mut out);
            assert_eq!(out, c.map(Real::truncate));

            let (a, b) = (a.map(f32::to_bits), b.map(f32::to_bits));
            let (va, vb) = (U32x8::load(&a), U32x8::load(&b));
            let int = |name: &str, got: U32x8, want: fn(u32, u32) -> u32| {
                let mut out = [0; 8];
                got.store(&mut out);
                for i in 0..8 {
                    assert_eq!(out[i], want(a[i], b[i]), "{name} {} {}", a[i], b[i]);
                }
            };
            int("and", va & vb, |a, b| a & b);
            int("or", va | vb, |a, b| a | b);
            int("xor", va ^ vb, |a, b| a ^ b);
            int("shl", va << 5, |a, _| a << 5);
            int("shr", va >> 9, |a, _| a >> 9);
            int("plus", va.plus(vb), |a, b| a.plus(b));
            int("times", va.times(vb), |a, b| a.times(b));
            int("reverse", va.reverse_bits(), |a, _| a.reverse_bits());
            int("equals", U32x8::select(va.equals(vb), va, vb), |a, b| u32::select(a == b, a, b));
        }
    }

    #[test]
    fn compression_keeps_order() {
        if !available() {
            println!("skipped: this processor has no AVX2");
            return;
        }
        let numbers: [f32; 8] = std::array::from_fn(|i| i as f32);
        for set in 0..256_u32 {
            let wanted: [f32; 8] = std::array::from_fn(|i| if set >> i & 1 == 1 { 1.0 } else { 0.0 });
            let mask = F32x8::load(&wanted).gt(F32x8::splat(0.5));
            assert_eq!(mask.to_bits(), set);
            let (mut reals, mut ints) = ([0.0; 8], [0; 8]);
            F32x8::load(&numbers).compress(mask, &mut reals);
            U32x8::load(&numbers.map(|x| x as u32)).compress(mask, &mut ints);
            let want: Vec<u32> = (0..8).filter(|i| set >> i & 1 == 1).collect();
            assert_eq!(ints[..want.len()], want);
            assert!(reals.iter().zip(&want).all(|(&r, &w)| r == w as f32));
        }
    }

    #[test]
    fn tables_are_looked_up_by_lane() {
        if available() {
            let table: Vec<[f32; 8]> = (0..5).map(|row| std::array::from_fn(|i| (row * 8 + i) as f32)).collect();
            let rows = [2, 1, 0, 4, 1, 3, 2, 1];
            let found = F32x8::lookup(&table, U32x8::load(&rows));
            for (i, numbers) in found.into_iter().enumerate() {
                let mut out = [0.0; 8];
                numbers.store(&mut out);
                assert_eq!(out, rows.map(|row| f32::lookup(&table, row)[i]));
            }
        }
    }
}
