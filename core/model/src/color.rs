//! The sRGB transfer function (IEC 61966-2-1), in single and double precision. Luminance is in
//! [`photometry`](crate::photometry).

/// A color channel: `f32` or `f64`. Each type computes in its own precision, so no conversion changes the results.
pub trait Channel: Copy {
    /// Decodes an sRGB-encoded value in [0, 1] to a linear one.
    fn srgb_to_linear(self) -> Self;
    /// Encodes a linear value in [0, 1] as sRGB.
    fn linear_to_srgb(self) -> Self;
}

macro_rules! channel {
    ($($t:ty: $pow:path),*) => {$(
        impl Channel for $t {
            fn srgb_to_linear(self) -> Self {
                if self <= 0.040_45 { self / 12.92 } else { $pow((self + 0.055) / 1.055, 2.4) }
            }
            fn linear_to_srgb(self) -> Self {
                if self <= 0.003_130_8 { 12.92 * self } else { 1.055 * $pow(self, 1.0 / 2.4) - 0.055 }
            }
        }
    )*};
}
channel!(f32: libm::powf, f64: libm::pow);

/// Decodes one sRGB-encoded channel in [0, 1] to a linear one.
pub fn srgb_to_linear<C: Channel>(encoded: C) -> C {
    encoded.srgb_to_linear()
}

/// Encodes one linear channel in [0, 1] as sRGB.
pub fn linear_to_srgb<C: Channel>(linear: C) -> C {
    linear.linear_to_srgb()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_the_standard() {
        for (encoded, linear) in [(0.0_f64, 0.0_f64), (1.0, 1.0), (0.5, 0.214_041_14), (0.040_45, 0.003_130_8)] {
            assert!((srgb_to_linear(encoded) - linear).abs() < 1e-7, "{encoded}");
            assert!((linear_to_srgb(linear) - encoded).abs() < 1e-6, "{linear}");
            assert!((srgb_to_linear(encoded as f32) - linear as f32).abs() < 1e-6, "{encoded}");
        }
    }
}
