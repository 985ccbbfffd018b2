//! Per-pixel accumulators for radiance, denoising guides and variance.

use syntable_model::photometry::luminance;
use syntable_model::product::standard::DEMODULATION_EPSILON;

/// Sums over the samples of a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSums {
    /// Number of samples.
    pub samples: u32,
    /// Samples whose camera ray hit a body.
    pub hits: u32,
    /// Radiance, nits.
    pub radiance: [f64; 3],
    /// Squared luminance.
    pub square: f64,
    /// Number of samples of the guides, which may be larger.
    pub guide_samples: u32,
    /// Base color of the guides.
    pub albedo: [f32; 3],
    /// Normal of the guides, world.
    pub normal: [f32; 3],
    /// Specular part of the radiance at the first surface.
    pub specular: PartSums,
    /// The rest, demodulated: every sample divided by its albedo.
    pub demodulated: PartSums,
}

/// Sums of a part of the radiance.
#[derive(Clone, Copy, Debug, Default)]
pub struct PartSums {
    sum: [f32; 3],
    /// Squared luminance.
    square: f32,
}

impl PartSums {
    /// Sums of the radiance and of its squared luminance.
    pub fn new(sum: [f32; 3], square: f32) -> Self {
        Self { sum, square }
    }

    fn add_sums(&mut self, other: &Self) {
        self.square += other.square;
        self.sum.iter_mut().zip(other.sum).for_each(|(sum, value)| *sum += value);
    }

    #[inline(always)]
    fn add(&mut self, light: [f32; 3]) {
        let y = luminance(light.map(f64::from)) as f32;
        self.square += y * y;
        self.sum.iter_mut().zip(light).for_each(|(sum, value)| *sum += value);
    }

    /// Mean over the samples.
    pub fn mean(&self, samples: u32) -> [f32; 3] {
        self.sum.map(|x| x / samples.max(1) as f32)
    }

    /// Estimated variance of the mean's luminance, nits².
    pub fn variance(&self, samples: u32) -> f32 {
        variance(luminance(self.sum.map(f64::from)), self.square.into(), samples) as f32
    }
}

impl PixelSums {
    /// Adds the radiance of a sample.
    #[inline(always)]
    pub fn add(&mut self, radiance: [f32; 3]) {
        let radiance = radiance.map(f64::from);
        let y = luminance(radiance);
        self.samples += 1;
        self.square += y * y;
        self.radiance.iter_mut().zip(radiance).for_each(|(sum, value)| *sum += value);
    }

    /// Adds the sums of more samples.
    pub fn add_sums(&mut self, other: &Self) {
        self.samples += other.samples;
        self.hits += other.hits;
        self.square += other.square;
        self.radiance.iter_mut().zip(other.radiance).for_each(|(sum, value)| *sum += value);
        self.guide_samples += other.guide_samples;
        self.albedo.iter_mut().zip(other.albedo).for_each(|(sum, value)| *sum += value);
        self.normal.iter_mut().zip(other.normal).for_each(|(sum, value)| *sum += value);
        self.specular.add_sums(&other.specular);
        self.demodulated.add_sums(&other.demodulated);
    }

    /// Adds the parts of a sample: the specular radiance, and the rest demodulated by the albedo.
    #[inline(always)]
    pub fn add_parts(&mut self, radiance: [f32; 3], specular: [f32; 3], albedo: [f32; 3]) {
        let demodulated = std::array::from_fn(|c| (radiance[c] - specular[c]) / (albedo[c] + DEMODULATION_EPSILON));
        self.specular.add(specular);
        self.demodulated.add(demodulated);
    }

    /// Adds the guides of a sample.
    #[inline(always)]
    pub fn add_guides(&mut self, albedo: [f32; 3], normal: [f32; 3]) {
        self.guide_samples += 1;
        self.albedo.iter_mut().zip(albedo).for_each(|(sum, value)| *sum += value);
        self.normal.iter_mut().zip(normal).for_each(|(sum, value)| *sum += value);
    }

    /// Fraction of the samples whose camera ray hit a body.
    pub fn opacity(&self) -> f32 {
        self.hits as f32 / self.samples.max(1) as f32
    }

    /// Mean base color.
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

/// Estimated variance of a mean, from the sum of the samples and the sum of their squares; infinite for a single
/// sample.
fn variance(sum: f64, square: f64, samples: u32) -> f64 {
    let n = f64::from(samples);
    let mean = sum / n;
    if samples > 1 { (square / n - mean * mean).max(0.0) / (n - 1.0) } else { f64::INFINITY }
}
