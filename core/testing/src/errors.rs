//! Differences between an image and a reference.

/// Radiance of pixels.
pub type Image = [[f32; 3]];

/// Radiance of white: 5.56 times the log-average luminance of a reference.
pub fn white(reference: &Image) -> f64 {
    let logs: f64 = reference.iter().map(|c| libm::log(luminance(c).max(1e-6))).sum();
    libm::exp(logs / reference.len() as f64) * 5.56
}

/// Peak signal-to-noise ratio of the sRGB-encoded image, dB.
pub fn psnr(image: &Image, reference: &Image, white: f64) -> f64 {
    -10.0 * libm::log10(mean_of(image, reference, |a, r| (srgb(a / white) - srgb(r / white)).powi(2)))
}

/// Mean over pixels and channels of (x − r)² / (r² + 0.01 m²), r the reference and m its mean luminance.
pub fn relative_error(image: &Image, reference: &Image) -> f64 {
    let mean = reference.iter().map(luminance).sum::<f64>() / reference.len() as f64;
    mean_of(image, reference, |a, r| (a - r).powi(2) / (r * r + 0.01 * mean * mean))
}

/// A linear value in [0, 1] as sRGB encodes it, IEC 61966-2-1.
pub fn srgb(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * libm::pow(x, 1.0 / 2.4) - 0.055 }
}

fn luminance(c: &[f32; 3]) -> f64 {
    0.2126 * f64::from(c[0]) + 0.7152 * f64::from(c[1]) + 0.0722 * f64::from(c[2])
}

fn mean_of(image: &Image, reference: &Image, f: impl Fn(f64, f64) -> f64) -> f64 {
    let pairs = image.iter().flatten().zip(reference.iter().flatten());
    pairs.map(|(&a, &r)| f(a.into(), r.into())).sum::<f64>() / (3 * reference.len()) as f64
}
