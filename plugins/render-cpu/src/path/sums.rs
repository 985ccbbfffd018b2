//! What is found of a pixel, and how sure it is.

use syntable_model::photometry::luminance;

/// What was found of a pixel so far: sums over its samples.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PixelSums {
    pub samples: u32,
    pub radiance: [f64; 3],
    /// Of the luminance's square.
    pub square: f64,
    /// Of the guides, which may be more.
    pub guide_samples: u32,
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
    /// Adds a sample's light.
    #[inline(always)]
    pub fn add(&mut self, radiance: [f32; 3]) {
        let radiance = radiance.map(f64::from);
        let y = luminance(radiance);
        self.samples += 1;
        self.square += y * y;
        self.radiance.iter_mut().zip(radiance).for_each(|(sum, value)| *sum += value);
    }

    /// Adds the part of a sample's light that was mirrored without colour.
    #[inline(always)]
    pub fn add_gloss(&mut self, radiance: [f32; 3], gloss: [f32; 3]) {
        let (y, y_gloss) = (luminance(radiance.map(f64::from)), luminance(gloss.map(f64::from)));
        self.gloss.iter_mut().zip(gloss).for_each(|(sum, value)| *sum += value);
        self.gloss_square += (y_gloss * y_gloss) as f32;
        self.matte_square += ((y - y_gloss) * (y - y_gloss)) as f32;
    }

    /// Adds a sample's guides.
    #[inline(always)]
    pub fn add_guides(&mut self, albedo: [f32; 3], normal: [f32; 3]) {
        self.guide_samples += 1;
        self.albedo.iter_mut().zip(albedo).for_each(|(sum, value)| *sum += value);
        self.normal.iter_mut().zip(normal).for_each(|(sum, value)| *sum += value);
    }

    /// Mean base colour.
    pub fn mean_albedo(&self) -> [f32; 3] {
        self.albedo.map(|x| x / self.guide_samples.max(1) as f32)
    }

    /// Mean normal, world.
    pub fn mean_normal(&self) -> [f32; 3] {
        self.normal.map(|x| x / self.guide_samples.max(1) as f32)
    }

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
