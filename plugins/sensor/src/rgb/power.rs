//! Powers that are the same on every computer.

/// Digits of an exponent's fraction, in binary.
const DIGITS: u32 = 24;

/// `base` to the power of `exponent`, for a base in [0, 1] and an exponent in [0, 100].
///
/// Powers of mathematical libraries differ in their last bit from system to system. Here only products and square roots
/// are taken, which IEEE 754 rounds the same everywhere: the whole part of the exponent is a product, and every digit of
/// its fraction in binary is a square root more. The exponent is rounded to 24 such digits, which changes the result by
/// a share of `3e-8 · ln base` at most.
pub fn power(base: f64, exponent: f64) -> f64 {
    let digits = (exponent * f64::from(1_u32 << DIGITS)).round() as u32;
    let (whole, fraction) = (digits >> DIGITS, digits & ((1 << DIGITS) - 1));
    let mut result = 1.0;
    if fraction != 0 {
        // From the last digit to the first: base^0.b₁b₂b₃ is the square root of base^b₁ · base^0.b₂b₃.
        for digit in fraction.trailing_zeros()..DIGITS {
            if fraction >> digit & 1 == 1 {
                result *= base;
            }
            result = f64::sqrt(result);
        }
    }
    for _ in 0..whole {
        result *= base;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_few_digits_are_exact() {
        assert_eq!([0.0, 1.0, 2.0, 3.0].map(|exponent| power(0.25, exponent)), [1.0, 0.25, 0.0625, 0.015_625]);
        assert_eq!([0.5, 1.5, 0.25, 0.75].map(|exponent| power(0.0625, exponent)), [0.25, 0.015_625, 0.5, 0.125]);
        assert_eq!([0.3, 8.0].map(|exponent| power(1.0, exponent)), [1.0; 2]);
        assert_eq!([0.0, 0.3, 1.0].map(|exponent| power(0.0, exponent)), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn powers_are_those_of_the_library_but_for_the_rounding_of_the_exponent() {
        for i in 1..=50 {
            let base = f64::from(i) / 50.0;
            for j in 0..=400 {
                let exponent = f64::from(j) * 0.0201;
                let (got, want) = (power(base, exponent), base.powf(exponent));
                let allowed = want * (3e-8 * base.ln().abs() + 1e-14);
                assert!((got - want).abs() <= allowed, "{base}^{exponent}: {got}, not {want}");
            }
        }
    }
}
