//! What is found of a pixel, and how sure it is.

use syntable_model::photometry::luminance;

/// What was found of a pixel so far: sums over its samples.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PixelSums {
    pub samples: u32,
    pub radiance: [f64; 3],
    /// Of the luminance's square.
    pub square: f64,
    pub albedo: [f32; 3],
    /// World.
    pub normal: [f32; 3],
    /// Of the radiance that the first surface mirrored without colouring it, and of its luminance's square.
    pub gloss: [f32; 3],
    pub gloss_square: f32,
    /// Of the square of the rest's luminance.
    pub matte_square: f32,
}

impl PixelSums {
    /// Estimated variance of the mean luminance, nits².
    pub fn variance(&self) -> f64 {
        self.variance_of(luminance(self.radiance), self.square)
    }

    /// The same of what is mirrored without colour, and of the rest.
    pub fn variance_of_parts(&self) -> [f64; 2] {
        let gloss = luminance(self.gloss.map(f64::from));
        let matte = luminance(self.radiance) - gloss;
        [self.variance_of(gloss, self.gloss_square.into()), self.variance_of(matte, self.matte_square.into())]
    }

    /// Of a sum over the samples and that of its squares.
    fn variance_of(&self, sum: f64, square: f64) -> f64 {
        let n = f64::from(self.samples);
        let mean = sum / n;
        if self.samples > 1 { (square / n - mean * mean).max(0.0) / (n - 1.0) } else { f64::INFINITY }
    }
}
