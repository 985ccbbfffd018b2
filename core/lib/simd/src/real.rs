//! Numbers for shading code, one or eight at a time.
//!
//! Light transport is written once over [`Real`]. With `f32` it computes one path, on any processor; with eight lanes
//! it computes eight. Branches become [`Real::select`].

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Shl, Shr, Sub};

/// Lanes of `f32`.
pub trait Real:
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
    /// Booleans.
    type Mask: Mask;
    /// Unsigned integers.
    type Int: Int<Real = Self, Mask = Self::Mask>;
    /// Number of lanes.
    const WIDTH: usize;

    /// The same number in every lane.
    fn splat(x: f32) -> Self;
    /// Loads the first numbers of a slice.
    fn load(from: &[f32]) -> Self;
    /// Stores to the front of a slice.
    fn store(self, to: &mut [f32]);
    /// Stores the lanes of `mask`, compacted, to the front of a slice with room for all lanes. The rest of the slice is
    /// unspecified.
    fn compress(self, mask: Self::Mask, to: &mut [f32]);
    /// Square root.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// Magnitude of `self` with the sign of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// The larger; the second if either is NaN.
    fn larger(self, other: Self) -> Self;
    /// The smaller; the second if either is NaN.
    fn smaller(self, other: Self) -> Self;
    /// `self < other`; false for NaN.
    fn lt(self, other: Self) -> Self::Mask;
    /// `self <= other`; false for NaN.
    fn le(self, other: Self) -> Self::Mask;
    /// `self > other`; false for NaN.
    #[inline(always)]
    fn gt(self, other: Self) -> Self::Mask {
        other.lt(self)
    }
    /// `self >= other`; false for NaN.
    #[inline(always)]
    fn ge(self, other: Self) -> Self::Mask {
        other.le(self)
    }
    /// `yes` in the lanes where the mask is true, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Bit patterns.
    fn bits(self) -> Self::Int;
    /// Numbers with these bit patterns.
    fn from_bits(bits: Self::Int) -> Self;
    /// Rounds towards zero; for |x| < 2³¹.
    fn truncate(self) -> Self::Int;
    /// Looks up a row of eight numbers for every lane.
    ///
    /// # Panics
    /// If an index is not below the table's length.
    fn lookup(table: &[[f32; 8]], index: Self::Int) -> [Self; 8];
}

/// Lanes of `u32`, wrapping.
pub trait Int:
    Copy
    + Debug
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + BitXor<Output = Self>
    + Shl<u32, Output = Self>
    + Shr<u32, Output = Self>
{
    /// Booleans.
    type Mask: Mask;
    /// Real numbers.
    type Real: Real<Int = Self, Mask = Self::Mask>;

    /// The same number in every lane.
    fn splat(x: u32) -> Self;
    /// Loads the first numbers of a slice.
    fn load(from: &[u32]) -> Self;
    /// Stores to the front of a slice.
    fn store(self, to: &mut [u32]);
    /// Like [`Real::compress`].
    fn compress(self, mask: Self::Mask, to: &mut [u32]);
    /// Sum modulo 2³².
    fn plus(self, other: Self) -> Self;
    /// Product modulo 2³².
    fn times(self, other: Self) -> Self;
    /// Whether the lanes are equal.
    fn equals(self, other: Self) -> Self::Mask;
    /// `yes` in the lanes where the mask is true, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Converts the lanes, read as signed integers.
    fn signed_to_real(self) -> Self::Real;
    /// Reverses the order of the bits of every lane.
    fn reverse_bits(self) -> Self;
}

/// Lanes of booleans.
pub trait Mask: Copy + Debug + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// The same value in every lane.
    fn splat(set: bool) -> Self;
    /// Bit `i` for lane `i`.
    fn to_bits(self) -> u32;
    /// Whether any lane is true.
    #[inline(always)]
    fn any(self) -> bool {
        self.to_bits() != 0
    }
}

/// The larger number; the second if one is NaN.
#[inline(always)]
pub fn max<T: Real>(a: T, b: T) -> T {
    a.larger(b)
}

/// The smaller number; the second if one is NaN.
#[inline(always)]
pub fn min<T: Real>(a: T, b: T) -> T {
    a.smaller(b)
}

/// The larger of a number and a constant.
#[inline(always)]
pub fn at_least<T: Real>(a: T, least: f32) -> T {
    a.larger(T::splat(least))
}

/// The smaller of a number and a constant.
#[inline(always)]
pub fn at_most<T: Real>(a: T, most: f32) -> T {
    a.smaller(T::splat(most))
}

/// 1 − a.
#[inline(always)]
pub fn complement<T: Real>(a: T) -> T {
    T::splat(1.0) - a
}

/// 1 / a.
#[inline(always)]
pub fn inverse<T: Real>(a: T) -> T {
    T::splat(1.0) / a
}
