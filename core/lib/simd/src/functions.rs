//! Elementary functions from IEEE basic operations alone.
//!
//! The standard library's `sin` and `acos` come from the platform's mathematics library, whose last bits differ between
//! systems. These functions give the same bits everywhere, to a few units in the last place, and are faster.

use crate::{Int, Real, at_least, at_most};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Represents infinity on graphics cards: shaders treat larger numbers as infinite.
pub const FAR: f32 = 3.0e38;

/// The same functions in WGSL, with the vector functions of shaders.
pub const WGSL: &str = include_str!("functions.wgsl");

/// The whole number at or below, for |x| < 2³¹.
#[inline(always)]
pub fn floor(x: f32) -> (i32, f32) {
    let truncated = x as i32;
    let whole = truncated - i32::from((truncated as f32) > x);
    (whole, x - whole as f32)
}

/// Sine and cosine of `turns` full turns, for |turns| < 2²⁰.
#[inline(always)]
pub fn sin_cos_turns<T: Real>(turns: T) -> (T, T) {
    let quarters = turns * 4.0_f32;
    // Rounds to the nearest quarter turn: shifts away from zero, then truncates.
    let quadrant = (quarters + T::splat(0.5).copysign(quarters)).truncate();
    let x = (quarters - quadrant.signed_to_real()) * FRAC_PI_2;
    let x2 = x * x;
    let sin = x + x * x2 * (x2 * (x2 * -0.000_195_152_96_f32 + 0.008_332_161_f32) + -0.166_666_55_f32);
    let cos = (x2 * x2 * (x2 * (x2 * 2.443_315_7e-5_f32 + -0.001_388_731_6_f32) + 0.041_666_646_f32) - x2 * 0.5_f32)
        + 1.0_f32;
    let odd = (quadrant & T::Int::splat(1)).equals(T::Int::splat(1));
    let (s, c) = (T::select(odd, cos, sin), T::select(odd, sin, cos));
    // The sign bits: bit 1 of the quadrant for the sine, bit 1 of the next quadrant for the cosine.
    let flip = |v: T, quadrant: T::Int| T::from_bits(v.bits() ^ ((quadrant & T::Int::splat(2)) << 30));
    (flip(s, quadrant), flip(c, quadrant.plus(T::Int::splat(1))))
}

/// Arc cosine; clamps arguments to ±1. (Abramowitz and Stegun 4.4.46.)
#[inline(always)]
pub fn acos<T: Real>(x: T) -> T {
    let a = at_most(x.abs(), 1.0);
    let p = a * -0.001_262_491_1_f32 + 0.006_670_09_f32;
    let p = a * p + -0.017_088_126_f32;
    let p = a * p + 0.030_891_88_f32;
    let p = a * p + -0.050_174_305_f32;
    let p = a * p + 0.088_978_99_f32;
    let p = a * p + -0.214_598_8_f32;
    let p = a * p + FRAC_PI_2;
    let angle = (T::splat(1.0) - a).sqrt() * p;
    T::select(x.lt(T::splat(0.0)), T::splat(PI) - angle, angle)
}

/// Angle of the point (x, y) in turns, in [-1/2, 1/2]; 0 for the origin. Accurate to about 1e-7.
#[inline(always)]
pub fn atan2_turns<T: Real>(y: T, x: T) -> T {
    let (ax, ay) = (x.abs(), y.abs());
    let steep = ay.gt(ax);
    let (small, large) = (T::select(steep, ax, ay), T::select(steep, ay, ax));
    let t = small / at_least(large, f32::MIN_POSITIVE);
    // Beyond tan(π/8), uses the angle's difference to π/4, so that the series is short.
    let far = t.gt(T::splat(0.414_213_57));
    let t = T::select(far, (t - 1.0_f32) / (t + 1.0_f32), t);
    let t2 = t * t;
    let p = t2 * 8.053_744e-2_f32 - 1.387_768_6e-1_f32;
    let p = p * t2 + 1.997_771_1e-1_f32;
    let p = p * t2 - 3.333_295e-1_f32;
    let angle = t + t * t2 * p;
    let angle = T::select(far, angle + FRAC_PI_4, angle);
    let angle = T::select(steep, T::splat(FRAC_PI_2) - angle, angle);
    let angle = T::select(x.lt(T::splat(0.0)), T::splat(PI) - angle, angle);
    (angle * (0.5 / PI)).copysign(y)
}

/// Base-2 logarithm of a positive normal number, accurate to about 1e-7.
#[inline(always)]
pub fn log2<T: Real>(x: T) -> T {
    let bits = x.bits();
    let exponent = (bits >> 23).signed_to_real() - 127.0_f32;
    let mantissa = T::from_bits(bits & T::Int::splat(0x007f_ffff) | T::Int::splat(0x3f80_0000));
    let upper = mantissa.gt(T::splat(std::f32::consts::SQRT_2));
    let exponent = T::select(upper, exponent + 1.0_f32, exponent);
    let m = T::select(upper, mantissa * 0.5_f32, mantissa);
    // The series of the inverse hyperbolic tangent.
    let t = (m - 1.0_f32) / (m + 1.0_f32);
    let t2 = t * t;
    let series = ((t2 * (1.0_f32 / 7.0) + 0.2_f32) * t2 + (1.0_f32 / 3.0)) * t2 + 1.0_f32;
    exponent + t * series * (2.0 * std::f32::consts::LOG2_E)
}

/// Two to the power of x, accurate to about 2e-7 of the result; x is clamped to ±126.
#[inline(always)]
pub fn exp2<T: Real>(x: T) -> T {
    let x = at_most(at_least(x, -126.0), 126.0);
    let whole = (x + T::splat(0.5).copysign(x)).truncate();
    let f = (x - whole.signed_to_real()) * std::f32::consts::LN_2;
    let p = f * (1.0_f32 / 720.0) + (1.0_f32 / 120.0);
    let p = p * f + (1.0_f32 / 24.0);
    let p = p * f + (1.0_f32 / 6.0);
    let p = (p * f + 0.5_f32) * f + 1.0_f32;
    let scale = T::from_bits(whole.plus(T::Int::splat(127)) << 23);
    (p * f + 1.0_f32) * scale
}

/// A positive number to a power.
#[inline(always)]
pub fn pow<T: Real>(x: T, power: T) -> T {
    exp2(log2(at_least(x, f32::MIN_POSITIVE)) * power)
}

/// Base-2 logarithm, accurate to about 0.01, for choosing texture levels. The argument must be positive and normal.
#[inline(always)]
pub fn log2_rough(x: f32) -> f32 {
    let bits = x.to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let mantissa = f32::from_bits(bits & 0x007f_ffff | 0x3f80_0000);
    // Quadratic through 1, √2 and 2.
    exponent as f32 + (mantissa - 1.0) * (1.0 + 0.343_145_75 * (2.0 - mantissa))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shaders_know_the_same_infinity() {
        let (_, rest) = WGSL.split_once("const FAR: f32 = ").expect("it is there");
        let (number, _) = rest.split_once(';').expect("it ends");
        assert_eq!(number.parse(), Ok(FAR));
    }

    #[test]
    fn agree_with_f64() {
        for i in -4000..=4000 {
            let x = i as f32 / 1000.0;
            let (sin, cos) = sin_cos_turns(x);
            let (s, c) = (f64::from(x) * std::f64::consts::TAU).sin_cos();
            assert!((f64::from(sin) - s).abs() < 2.5e-7 && (f64::from(cos) - c).abs() < 2.5e-7, "{x}: {sin} {cos}");
            let y = i as f32 / 4000.0;
            assert!((f64::from(acos(y)) - f64::from(y).acos()).abs() < 5e-7, "{y}");
            let (whole, part) = floor(x);
            assert_eq!((whole as f32, part), (x.floor(), x - x.floor()));
        }
        for i in 0..720 {
            let turn = (i as f64 + 0.25) / 720.0 - 0.5;
            let (s, c) = (turn * std::f64::consts::TAU).sin_cos();
            let got = atan2_turns((s * 3.0) as f32, (c * 3.0) as f32);
            assert!((f64::from(got) - turn).abs() < 1e-7, "{turn}: {got}");
        }
        assert_eq!(atan2_turns(0.0_f32, 0.0), 0.0);
        for i in 1..2000 {
            let x = i as f32 * 0.013;
            assert!((log2(x) - x.log2()).abs() < 4e-7 * x.log2().abs().max(1.0), "{x}: {}", log2(x));
            let y = (i as f32 - 1000.0) * 0.11;
            assert!((f64::from(exp2(y)) / f64::from(y).exp2() - 1.0).abs() < 4e-7, "{y}: {}", exp2(y));
            assert!((pow(x.min(1.0), 7.3) - x.min(1.0).powf(7.3)).abs() < 3e-6, "{x}");
        }
        for x in [1e-20_f32, 0.3, 1.0, 1.5, 2.0, 7.3, 1e9] {
            assert!((log2_rough(x) - x.log2()).abs() < 0.011, "{x}");
        }
    }
}
