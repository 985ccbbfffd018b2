//! What is found of a pixel, and how sure it is.

use syntable_model::photometry::luminance;
use syntable_model::product::standard::LEAST_TINT;

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
    /// Of the radiance that the first surface mirrored without colouring it.
    pub gloss: PartSums,
    /// Of the rest, every sample divided by its colour.
    pub untinted: PartSums,
}

/// Of a part of the light.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PartSums {
    sum: [f32; 3],
    /// Of the luminance's square.
    square: f32,
}

impl PartSums {
    #[inline(always)]
    fn add(&mut self, light: [f32; 3]) {
        let y = luminance(light.map(f64::from)) as f32;
        self.square += y * y;
        self.sum.iter_mut().zip(light).for_each(|(sum, value)| *sum += value);
    }

    /// Over so many samples.
    pub fn mean(&self, samples: u32) -> [f32; 3] {
        self.sum.map(|x| x / samples.max(1) as f32)
    }

    /// Estimated variance of the mean's luminance, nits².
    pub fn variance(&self, samples: u32) -> f32 {
        variance(luminance(self.sum.map(f64::from)), self.square.into(), samples) as f32
    }
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

    /// Adds the parts of a sample's light: what was mirrored without colour, and the rest without the colour that it got.
    #[inline(always)]
    pub fn add_parts(&mut self, radiance: [f32; 3], gloss: [f32; 3], albedo: [f32; 3]) {
        let untinted = std::array::from_fn(|c| (radiance[c] - gloss[c]) / (albedo[c] + LEAST_TINT));
        self.gloss.add(gloss);
        self.untinted.add(untinted);
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
        variance(luminance(self.radiance), self.square, self.samples)
    }
}

/// Estimated variance of a mean, from the samples' sum and that of their squares; infinite for a single one.
fn variance(sum: f64, square: f64, samples: u32) -> f64 {
    let n = f64::from(samples);
    let mean = sum / n;
    if samples > 1 { (square / n - mean * mean).max(0.0) / (n - 1.0) } else { f64::INFINITY }
}
