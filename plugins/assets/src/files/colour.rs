//! Colour encodings.

/// Decodes one sRGB channel (IEC 61966-2-1) in [0, 1] to a linear one.
pub fn srgb_to_linear(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    #[test]
    fn known_values_of_srgb() {
        for (encoded, linear) in [(0.0, 0.0), (1.0, 1.0), (0.5, 0.214_041_14), (0.04045, 0.003_130_8)] {
            assert!((super::srgb_to_linear(encoded) - linear).abs() < 1e-6, "{encoded}");
        }
    }
}
