//! Eight lanes of `f32` arithmetic, for walks over eight-wide trees.

/// Number of lanes of a [`Wide`].
pub const WIDTH: usize = 8;

/// Eight values side by side, aligned for one vector load.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Column(pub [f32; WIDTH]);

/// Eight lanes of `f32` arithmetic.
///
/// `min` and `max` follow the x86 rule: they return the second operand unless the comparison holds, and therefore also
/// if either operand is NaN.
pub trait Wide: Copy {
    /// Eight numbers, or eight all-ones/all-zeros masks.
    type V: Copy;

    /// Loads eight numbers.
    fn load(column: &Column) -> Self::V;
    /// Stores eight numbers.
    fn store(v: Self::V) -> Column;
    /// The same number in every lane.
    fn splat(x: f32) -> Self::V;
    /// Four numbers, twice.
    fn twice(from: &[f32; 4]) -> Self::V;
    /// Moves lanes within each half: lane `i` of a half takes its lane `ORDER >> 2 i & 3`.
    fn shuffle<const ORDER: i32>(v: Self::V) -> Self::V;
    /// `a + b`.
    fn add(a: Self::V, b: Self::V) -> Self::V;
    /// `a - b`.
    fn sub(a: Self::V, b: Self::V) -> Self::V;
    /// `a * b`.
    fn mul(a: Self::V, b: Self::V) -> Self::V;
    /// `a / b`.
    fn div(a: Self::V, b: Self::V) -> Self::V;
    /// `a * b + c`, rounded once.
    fn mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// `c - a * b`, rounded once.
    fn neg_mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// `a < b ? a : b`.
    fn min(a: Self::V, b: Self::V) -> Self::V;
    /// `a > b ? a : b`.
    fn max(a: Self::V, b: Self::V) -> Self::V;
    /// Mask of `a ≤ b`; false for NaN.
    fn le(a: Self::V, b: Self::V) -> Self::V;
    /// Mask of `a < b or a > b`; false for NaN.
    fn differ(a: Self::V, b: Self::V) -> Self::V;
    /// Bitwise and.
    fn and(a: Self::V, b: Self::V) -> Self::V;
    /// Bitwise or.
    fn or(a: Self::V, b: Self::V) -> Self::V;
    /// Bit `i` set iff mask lane `i` is.
    fn bits(mask: Self::V) -> u32;
}

/// Plain Rust, for every CPU; slow on x86 CPUs older than FMA, where `mul_add` is a library call.
#[derive(Clone, Copy)]
pub struct Portable;

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

impl Wide for Portable {
    type V = [f32; WIDTH];

    #[inline(always)]
    fn load(column: &Column) -> Self::V {
        column.0
    }
    #[inline(always)]
    fn store(v: Self::V) -> Column {
        Column(v)
    }
    #[inline(always)]
    fn splat(x: f32) -> Self::V {
        [x; WIDTH]
    }
    #[inline(always)]
    fn twice(&[x, y, z, w]: &[f32; 4]) -> Self::V {
        [x, y, z, w, x, y, z, w]
    }
    #[inline(always)]
    fn shuffle<const ORDER: i32>(v: Self::V) -> Self::V {
        let mut out = v;
        for i in 0..WIDTH {
            out[i] = v[(i & 4) + (ORDER >> (2 * (i & 3)) & 3) as usize];
        }
        out
    }
    #[inline(always)]
    fn add(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V {
        let mut out = c;
        for i in 0..WIDTH {
            out[i] = a[i].mul_add(b[i], c[i]);
        }
        out
    }
    #[inline(always)]
    fn neg_mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V {
        let mut out = c;
        for i in 0..WIDTH {
            out[i] = (-a[i]).mul_add(b[i], c[i]);
        }
        out
    }
    #[inline(always)]
    fn min(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn le(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| mask(a <= b))
    }
    #[inline(always)]
    fn differ(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| mask(a.partial_cmp(&b).is_some_and(|order| order.is_ne())))
    }
    #[inline(always)]
    fn and(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| bitwise(a, b, |a, b| a & b))
    }
    #[inline(always)]
    fn or(a: Self::V, b: Self::V) -> Self::V {
        zip(a, b, |a, b| bitwise(a, b, |a, b| a | b))
    }
    #[inline(always)]
    fn bits(mask: Self::V) -> u32 {
        (0..WIDTH).fold(0, |bits, i| bits | (mask[i].to_bits() >> 31) << i)
    }
}
