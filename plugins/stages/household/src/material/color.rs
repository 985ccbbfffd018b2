//! sRGB colors and palettes.

use syntable_model::color::srgb_to_linear;
use syntable_model::random::Stream;

/// sRGB, each channel in [0, 1].
pub type SrgbColor = [f32; 3];

/// Decodes sRGB to linear Rec. 709.
pub fn linear(color: SrgbColor) -> [f32; 3] {
    color.map(srgb_to_linear)
}

/// Interpolates from `a` at 0 to `b` at 1, clamped.
pub fn mix(a: SrgbColor, b: SrgbColor, t: f32) -> SrgbColor {
    let t = t.clamp(0.0, 1.0);
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
}

/// Multiplies by a brightness factor, clamped.
pub fn shade(color: SrgbColor, factor: f32) -> SrgbColor {
    color.map(|c| (c * factor).clamp(0.0, 1.0))
}

/// Hue in turns, saturation and value in [0, 1].
pub fn hsv(hue: f64, saturation: f64, value: f64) -> SrgbColor {
    [5.0, 3.0, 1.0].map(|n| {
        let k = (n + hue.rem_euclid(1.0) * 6.0) % 6.0;
        (value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0)) as f32
    })
}

/// A random saturated color.
pub fn vivid(stream: &mut Stream) -> SrgbColor {
    let (hue, saturation, value) = (stream.unit(), stream.uniform(0.55, 0.95), stream.uniform(0.45, 0.9));
    hsv(hue, saturation, value)
}

/// Background, main, accent and ink of a print. Ink reads well on the background.
pub fn palette(stream: &mut Stream) -> [SrgbColor; 4] {
    let hue = stream.unit();
    let turn = *stream.pick(&[0.5, 0.33, 0.42, 0.08, 0.58]).unwrap_or(&0.5);
    let main = hsv(hue, stream.uniform(0.6, 0.95), stream.uniform(0.45, 0.85));
    let accent = hsv(hue + turn, stream.uniform(0.6, 0.95), stream.uniform(0.6, 0.95));
    if stream.chance(0.45) {
        let background = hsv(hue + turn, stream.uniform(0.02, 0.15), stream.uniform(0.88, 0.97));
        [background, main, accent, shade(main, 0.35)]
    } else {
        let background = main;
        let light = hsv(hue, 0.08, 0.95);
        [background, light, accent, light]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hues_are_where_they_should_be() {
        assert_eq!(hsv(0.0, 1.0, 1.0), [1.0, 0.0, 0.0]);
        assert_eq!(hsv(1.0 / 3.0, 1.0, 1.0), [0.0, 1.0, 0.0]);
        assert_eq!(hsv(2.0 / 3.0, 1.0, 0.5), [0.0, 0.0, 0.5]);
        assert_eq!(hsv(0.2, 0.0, 0.7), [0.7; 3]);
        assert!((linear([0.5; 3])[0] - 0.214_041).abs() < 1e-5);
    }
}
