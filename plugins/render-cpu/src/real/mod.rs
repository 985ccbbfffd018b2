//! Numbers, one or eight at a time: what shading is written in.
//!
//! Light transport is written once over [`Real`]. With `f32` it computes one path, on any processor; with
//! [`Eight`](eight::Eight) it computes eight in AVX2 registers. Every operation is an IEEE operation of one lane on its
//! own, rounded once, so that both give the same bits. Branches become [`Real::pick`].

#[cfg(target_arch = "x86_64")]
mod eight;
mod one;

#[cfg(target_arch = "x86_64")]
pub(crate) use eight::Eight;

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Shl, Shr, Sub};

/// Lanes of `f32`.
pub(crate) trait Real:
    Copy
    + Debug
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<f32, Output = Self>
    + Sub<f32, Output = Self>
    + Mul<f32, Output = Self>
{
    /// Truth by lane.
    type Mask: Mask;
    /// Whole numbers by lane.
    type Int: Int<Real = Self, Mask = Self::Mask>;
    /// Number of lanes.
    const WIDTH: usize;

    /// The same number in every lane.
    fn splat(x: f32) -> Self;
    /// The first numbers of a slice.
    fn load(from: &[f32]) -> Self;
    /// Writes the first numbers of a slice.
    fn store(self, to: &mut [f32]);
    /// Writes the lanes of `mask`, one after the other, to the front of a slice, which must have room for all lanes:
    /// what is written after the chosen ones is anything.
    fn compress(self, mask: Self::Mask, to: &mut [f32]);
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    /// This size with that sign.
    fn copysign(self, sign: Self) -> Self;
    /// The larger; the second if either is NaN.
    fn larger(self, other: Self) -> Self;
    /// The smaller; the second if either is NaN.
    fn smaller(self, other: Self) -> Self;
    fn lt(self, other: Self) -> Self::Mask;
    fn le(self, other: Self) -> Self::Mask;
    fn gt(self, other: Self) -> Self::Mask {
        other.lt(self)
    }
    fn ge(self, other: Self) -> Self::Mask {
        other.le(self)
    }
    /// By lane, `yes` where the mask is true.
    fn pick(mask: Self::Mask, yes: Self, no: Self) -> Self;
    fn bits(self) -> Self::Int;
    fn from_bits(bits: Self::Int) -> Self;
    /// Towards zero; for |x| < 2³¹.
    fn truncate(self) -> Self::Int;
    /// Looks every lane's index up, which must be within the table: eight numbers a lane.
    fn lookup(table: &[[f32; 8]], index: Self::Int) -> [Self; 8];
}

/// Lanes of `u32`, wrapping.
pub(crate) trait Int:
    Copy
    + Debug
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + BitXor<Output = Self>
    + Shl<u32, Output = Self>
    + Shr<u32, Output = Self>
{
    type Mask: Mask;
    type Real: Real<Int = Self, Mask = Self::Mask>;

    fn splat(x: u32) -> Self;
    fn load(from: &[u32]) -> Self;
    fn store(self, to: &mut [u32]);
    /// As [`Real::compress`].
    fn compress(self, mask: Self::Mask, to: &mut [u32]);
    fn plus(self, other: Self) -> Self;
    fn times(self, other: Self) -> Self;
    fn equals(self, other: Self) -> Self::Mask;
    fn pick(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// The value of the lanes read as signed numbers.
    fn signed_to_real(self) -> Self::Real;
    fn reverse_bits(self) -> Self;
}

/// Truth by lane.
pub(crate) trait Mask: Copy + Debug + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    fn splat(set: bool) -> Self;
    /// Bit `i` for lane `i`.
    fn to_bits(self) -> u32;
    fn any(self) -> bool {
        self.to_bits() != 0
    }
}

/// The larger number; the second if one is NaN.
#[inline(always)]
pub(crate) fn max<T: Real>(a: T, b: T) -> T {
    a.larger(b)
}

/// The smaller number; the second if one is NaN.
#[inline(always)]
pub(crate) fn min<T: Real>(a: T, b: T) -> T {
    a.smaller(b)
}

/// The larger of a number and a constant.
#[inline(always)]
pub(crate) fn at_least<T: Real>(a: T, least: f32) -> T {
    a.larger(T::splat(least))
}

/// The smaller of a number and a constant.
#[inline(always)]
pub(crate) fn at_most<T: Real>(a: T, most: f32) -> T {
    a.smaller(T::splat(most))
}

/// 1 − a.
#[inline(always)]
pub(crate) fn complement<T: Real>(a: T) -> T {
    T::splat(1.0) - a
}

/// 1 / a.
#[inline(always)]
pub(crate) fn inverse<T: Real>(a: T) -> T {
    T::splat(1.0) / a
}

/// Whether the processor can compute with [`Eight`].
#[cfg(target_arch = "x86_64")]
pub(crate) fn has_eight() -> bool {
    is_x86_feature_detected!("avx2")
}
