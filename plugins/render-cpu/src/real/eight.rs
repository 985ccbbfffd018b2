//! Eight numbers at a time, in AVX2 registers.
//!
//! SAFETY of the whole module: values of these types are only made in code that runs after
//! [`has_eight`](super::has_eight) said yes, which the one place that chooses the lanes sees to.

use super::{Int, Mask, Real};
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Shl, Shr, Sub};

/// Eight `f32`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Eight(__m256);

/// Eight `u32`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EightInts(__m256i);

/// Eight truths, all bits set or none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EightMasks(__m256);

macro_rules! operators {
    ($t:ident: $($trait:ident $method:ident $intrinsic:ident),* $(,)?) => {$(
        impl $trait for $t {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: of the module.
                unsafe { Self($intrinsic(self.0, other.0)) }
            }
        }
    )*};
}
operators!(Eight: Add add _mm256_add_ps, Sub sub _mm256_sub_ps, Mul mul _mm256_mul_ps, Div div _mm256_div_ps);
operators!(EightInts: BitAnd bitand _mm256_and_si256, BitOr bitor _mm256_or_si256, BitXor bitxor _mm256_xor_si256);
operators!(EightMasks: BitAnd bitand _mm256_and_ps, BitOr bitor _mm256_or_ps);

macro_rules! with_constants {
    ($($trait:ident $method:ident),*) => {$(
        impl $trait<f32> for Eight {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f32) -> Self {
                $trait::$method(self, Self::splat(other))
            }
        }
    )*};
}
with_constants!(Add add, Sub sub, Mul mul);

impl Neg for Eight {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_xor_ps(self.0, _mm256_set1_ps(-0.0))) }
    }
}

impl Shl<u32> for EightInts {
    type Output = Self;
    #[inline(always)]
    fn shl(self, by: u32) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_sll_epi32(self.0, _mm_cvtsi32_si128(by as i32))) }
    }
}

impl Shr<u32> for EightInts {
    type Output = Self;
    #[inline(always)]
    fn shr(self, by: u32) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_srl_epi32(self.0, _mm_cvtsi32_si128(by as i32))) }
    }
}

impl Not for EightMasks {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_xor_ps(self.0, _mm256_castsi256_ps(_mm256_set1_epi32(-1)))) }
    }
}

/// For every set of lanes, the lanes in order, then anything.
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
fn order(mask: EightMasks) -> __m256i {
    // SAFETY: of the module; the table's rows hold eight numbers.
    unsafe { _mm256_loadu_si256(COMPRESSED[(mask.to_bits() & 0xff) as usize].as_ptr().cast()) }
}

impl Real for Eight {
    type Mask = EightMasks;
    type Int = EightInts;
    const WIDTH: usize = 8;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_set1_ps(x)) }
    }
    #[inline(always)]
    fn load(from: &[f32]) -> Self {
        // SAFETY: of the module; the slice is long enough.
        unsafe { Self(_mm256_loadu_ps(from[..8].as_ptr())) }
    }
    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        // SAFETY: of the module; the slice is long enough.
        unsafe { _mm256_storeu_ps(to[..8].as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn compress(self, mask: EightMasks, to: &mut [f32]) {
        // SAFETY: of the module; the slice is long enough.
        unsafe { _mm256_storeu_ps(to[..8].as_mut_ptr(), _mm256_permutevar8x32_ps(self.0, order(mask))) }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_sqrt_ps(self.0)) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)) }
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        // SAFETY: of the module.
        unsafe {
            let bit = _mm256_set1_ps(-0.0);
            Self(_mm256_or_ps(_mm256_andnot_ps(bit, self.0), _mm256_and_ps(bit, sign.0)))
        }
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_max_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_min_ps(self.0, other.0)) }
    }
    #[inline(always)]
    fn lt(self, other: Self) -> EightMasks {
        // SAFETY: of the module.
        unsafe { EightMasks(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)) }
    }
    #[inline(always)]
    fn le(self, other: Self) -> EightMasks {
        // SAFETY: of the module.
        unsafe { EightMasks(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) }
    }
    #[inline(always)]
    fn pick(mask: EightMasks, yes: Self, no: Self) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_blendv_ps(no.0, yes.0, mask.0)) }
    }
    #[inline(always)]
    fn bits(self) -> EightInts {
        // SAFETY: of the module.
        unsafe { EightInts(_mm256_castps_si256(self.0)) }
    }
    #[inline(always)]
    fn from_bits(bits: EightInts) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_castsi256_ps(bits.0)) }
    }
    #[inline(always)]
    fn truncate(self) -> EightInts {
        // SAFETY: of the module.
        unsafe { EightInts(_mm256_cvttps_epi32(self.0)) }
    }
    #[inline(always)]
    fn lookup(table: &[[f32; 8]], index: EightInts) -> [Self; 8] {
        let mut at = [0; 8];
        index.store(&mut at);
        // SAFETY: of the module; the table's rows hold eight numbers.
        unsafe {
            let row = |lane: usize| _mm256_loadu_ps(table[at[lane] as usize].as_ptr());
            // Lanes and numbers change places, as in a transposed matrix.
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

impl Int for EightInts {
    type Mask = EightMasks;
    type Real = Eight;

    #[inline(always)]
    fn splat(x: u32) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_set1_epi32(x as i32)) }
    }
    #[inline(always)]
    fn load(from: &[u32]) -> Self {
        // SAFETY: of the module; the slice is long enough.
        unsafe { Self(_mm256_loadu_si256(from[..8].as_ptr().cast())) }
    }
    #[inline(always)]
    fn store(self, to: &mut [u32]) {
        // SAFETY: of the module; the slice is long enough.
        unsafe { _mm256_storeu_si256(to[..8].as_mut_ptr().cast(), self.0) }
    }
    #[inline(always)]
    fn compress(self, mask: EightMasks, to: &mut [u32]) {
        // SAFETY: of the module; the slice is long enough.
        unsafe { _mm256_storeu_si256(to[..8].as_mut_ptr().cast(), _mm256_permutevar8x32_epi32(self.0, order(mask))) }
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_add_epi32(self.0, other.0)) }
    }
    #[inline(always)]
    fn times(self, other: Self) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_mullo_epi32(self.0, other.0)) }
    }
    #[inline(always)]
    fn equals(self, other: Self) -> EightMasks {
        // SAFETY: of the module.
        unsafe { EightMasks(_mm256_castsi256_ps(_mm256_cmpeq_epi32(self.0, other.0))) }
    }
    #[inline(always)]
    fn pick(mask: EightMasks, yes: Self, no: Self) -> Self {
        // SAFETY: of the module.
        unsafe { Self(_mm256_blendv_epi8(no.0, yes.0, _mm256_castps_si256(mask.0))) }
    }
    #[inline(always)]
    fn signed_to_real(self) -> Eight {
        // SAFETY: of the module.
        unsafe { Eight(_mm256_cvtepi32_ps(self.0)) }
    }
    #[inline(always)]
    fn reverse_bits(self) -> Self {
        // Bytes are turned round within each number; nibbles are reversed by table and swapped.
        // SAFETY: of the module.
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

impl Mask for EightMasks {
    #[inline(always)]
    fn splat(set: bool) -> Self {
        EightInts::splat(if set { u32::MAX } else { 0 }).as_mask()
    }
    #[inline(always)]
    fn to_bits(self) -> u32 {
        // SAFETY: of the module.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
}

impl EightInts {
    #[inline(always)]
    fn as_mask(self) -> EightMasks {
        // SAFETY: of the module.
        unsafe { EightMasks(_mm256_castsi256_ps(self.0)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;

    /// Every operation on eight lanes gives the bits of the operation on one.
    #[test]
    fn lanes_agree_with_single_numbers() {
        if !super::super::has_eight() {
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
            let (va, vb) = (Eight::load(&a), Eight::load(&b));
            let real = |name: &str, got: Eight, want: fn(f32, f32) -> f32| {
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
            real("lt", Eight::pick(va.lt(vb), va, vb), |a, b| f32::pick(a < b, a, b));
            real("le", Eight::pick(va.le(vb), va, vb), |a, b| f32::pick(a <= b, a, b));
            real("not", Eight::pick(!va.le(vb), va, vb), |a, b| f32::pick(!Real::le(a, b), a, b));
            real("bits", Eight::from_bits(va.bits()), |a, _| a);
            real("signed", va.bits().signed_to_real(), |a, _| a.to_bits().signed_to_real());
            let c = a.map(|x| if x.is_finite() { x } else { 7.5 });
            let mut out = [0; 8];
            Eight::load(&c).truncate().store(&mut out);
            assert_eq!(out, c.map(Real::truncate));

            let (a, b) = (a.map(f32::to_bits), b.map(f32::to_bits));
            let (va, vb) = (EightInts::load(&a), EightInts::load(&b));
            let int = |name: &str, got: EightInts, want: fn(u32, u32) -> u32| {
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
            int("equals", EightInts::pick(va.equals(vb), va, vb), |a, b| u32::pick(a == b, a, b));
        }
    }

    #[test]
    fn compression_keeps_order() {
        if !super::super::has_eight() {
            println!("skipped: this processor has no AVX2");
            return;
        }
        let numbers: [f32; 8] = std::array::from_fn(|i| i as f32);
        for set in 0..256_u32 {
            let wanted: [f32; 8] = std::array::from_fn(|i| if set >> i & 1 == 1 { 1.0 } else { 0.0 });
            let mask = Eight::load(&wanted).gt(Eight::splat(0.5));
            assert_eq!(mask.to_bits(), set);
            let (mut reals, mut ints) = ([0.0; 8], [0; 8]);
            Eight::load(&numbers).compress(mask, &mut reals);
            EightInts::load(&numbers.map(|x| x as u32)).compress(mask, &mut ints);
            let want: Vec<u32> = (0..8).filter(|i| set >> i & 1 == 1).collect();
            assert_eq!(ints[..want.len()], want);
            assert!(reals.iter().zip(&want).all(|(&r, &w)| r == w as f32));
        }
    }

    #[test]
    fn tables_are_looked_up_by_lane() {
        if super::super::has_eight() {
            let table: Vec<[f32; 8]> = (0..5).map(|row| std::array::from_fn(|i| (row * 8 + i) as f32)).collect();
            let rows = [2, 1, 0, 4, 1, 3, 2, 1];
            let found = Eight::lookup(&table, EightInts::load(&rows));
            for (i, numbers) in found.into_iter().enumerate() {
                let mut out = [0.0; 8];
                numbers.store(&mut out);
                assert_eq!(out, rows.map(|row| f32::lookup(&table, row)[i]));
            }
        }
    }
}
