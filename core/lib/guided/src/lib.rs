//! `guided`: an edge-avoiding filter guided by albedo, normals, depth and ids.
//!
//! The radiance comes in two parts ([`Part`]): the specular part, and the rest demodulated by the albedo, so that
//! textures stay sharp. Each part is filtered with its own [`tuning`], and the results are summed. First, the noise of
//! every pixel is estimated and fireflies are clamped ([`noise`]). Then follow levels of 5 × 5 taps at growing
//! distances, such as 1, 2, 4, 8, … px ([`smooth`]): the edge-avoiding à-trous transform of Dammertz et al. (High
//! Performance Graphics 2010), guided by variance as in Schied et al. (High Performance Graphics 2017, sections 4.2 and
//! 4.3). The weight of a tap falls with the difference of its normal, its distance from the pixel's plane, and the
//! difference of its light relative to the remaining noise. An image without noise therefore stays unchanged.
//!
//! Additions to these papers: planes are found from depth without the camera ([`guides`]), normals count less the
//! noisier the light is, borders of bodies use mean colors and normals, the first level compares means instead of
//! samples, and energy that the filter lost is restored ([`balance`]).

mod balance;
mod guides;
mod noise;
mod planes;
mod signal;
mod smooth;
pub mod tuning;

use guides::{Guides, NO_SURFACE, NOTHING};
use planes::{CHUNK, ChunkPosition, Padded, Size, fill};
use signal::{Signal, luminance};
use smooth::Level;
use std::any::Any;
use syntable_model::context::Workers;
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    DEMODULATION_EPSILON, DENOISE_ALBEDO, DENOISE_NORMAL, DENOISER, DEPTH, INSTANCE, RADIANCE, RADIANCE_DEMODULATED,
    RADIANCE_DEMODULATED_VARIANCE, RADIANCE_NOISY, RADIANCE_SPECULAR, RADIANCE_SPECULAR_VARIANCE,
};
use tuning::{MOST_NITS, NEAREST, RESIDUAL, Tuning, WHOLE};

/// Removes noise from images of few samples by averaging over similar neighbors, guided by albedo, normals, depth and
/// ids. Needs nothing installed. With `cpu_path` it runs on the processor and gives the same image on every machine;
/// with `gpu_path` it runs on the card, and its image is the same up to rounding.
///
/// Made for 1 to 64 samples per pixel; with more it does less. Fireflies are clamped, and their light is spread over
/// their surroundings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Guided {
    /// Tolerance for differences of light between pixels, relative to their noise. Higher values are smoother, lower
    /// ones keep faint shadows and reflections.
    #[schemars(range(min = 0.1, max = 10.0))]
    pub strength: f64,
    /// Number of filter levels, which sets the radius: 2, 6, 14, 30 or 62 pixels.
    #[schemars(range(min = 1, max = 5))]
    pub levels: u32,
}

impl Default for Guided {
    fn default() -> Self {
        Self { strength: 1.0, levels: 4 }
    }
}

config!(Guided => dyn Denoiser, "guided", "strength = 1.0\nlevels = 4");

impl Denoiser for Guided {
    fn reads(&self) -> Vec<KeyId> {
        keys![
            RADIANCE_NOISY,
            DENOISE_ALBEDO,
            DENOISE_NORMAL,
            DEPTH,
            INSTANCE,
            RADIANCE_SPECULAR,
            RADIANCE_SPECULAR_VARIANCE,
            RADIANCE_DEMODULATED,
            RADIANCE_DEMODULATED_VARIANCE
        ]
    }

    fn as_any(&self) -> Option<&dyn Any> {
        Some(self)
    }

    fn denoise(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let (rendered, workers) = (&*products, cx.workers);
        let input = Input {
            radiance: rendered.get(RADIANCE_NOISY)?,
            parts: [rendered.get(RADIANCE_DEMODULATED)?, rendered.get(RADIANCE_SPECULAR)?],
            variances: [rendered.get(RADIANCE_DEMODULATED_VARIANCE)?, rendered.get(RADIANCE_SPECULAR_VARIANCE)?],
            albedo: rendered.get(DENOISE_ALBEDO)?,
            normal: rendered.get(DENOISE_NORMAL)?,
            depth: rendered.get(DEPTH)?,
            instance: rendered.get(INSTANCE)?,
        };
        let size = input.size();
        let guides = input.surfaces(size, workers);
        let parts = [Part::Diffuse, Part::Specular].map(|part| self.filter(&input, part, &guides, workers));
        let radiance = input.join(size, &guides, &parts);
        products.put(RADIANCE, radiance)?;
        products.put(DENOISER, self.report())
    }
}

impl Guided {
    /// The product [`DENOISER`] for an image of this filter.
    pub fn report(&self) -> Value {
        Value::record([("name", Self::KIND.into()), ("strength", self.strength.into()), ("levels", self.levels.into())])
    }

    /// Filters one part of the radiance.
    fn filter(&self, input: &Input, part: Part, guides: &Guides, workers: &dyn Workers) -> Filtered {
        let (size, strength, tuning) = (input.size(), self.strength as f32, part.tuning());
        let signal = input.signal(size, part, guides, workers);
        let known = input.variances[part as usize].data().iter().any(|v| v.is_finite());
        let noise = noise::estimate(size, workers, guides, &signal, known, tuning);
        // An estimate from the neighbors is good enough for the filter, but no reason to trust a pixel's own light.
        let noise_before = if known { noise.signal.variance.clone() } else { Padded::new(size, f32::INFINITY) };
        let (mut now, mut next) = (noise.signal, signal);
        for (number, (step, sigmas)) in tuning.levels(self.levels).enumerate() {
            let level = Level {
                guides,
                tuning,
                from: &now,
                pilot: (number == 0).then_some(&noise.pilot),
                step: step as usize,
                sigmas: sigmas * strength,
                pilot_sigmas: tuning.pilot_sigmas * strength,
            };
            smooth::smooth(size, workers, &level, &mut next);
            std::mem::swap(&mut now, &mut next);
        }
        Filtered { color: now.color, noise_before }
    }
}

/// A part of the radiance.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    /// Divided by the albedo.
    Diffuse,
    /// Specular reflection at the first surface.
    Specular,
}

impl Part {
    fn tuning(self) -> &'static Tuning {
        match self {
            Self::Diffuse => &tuning::DIFFUSE,
            Self::Specular => &tuning::SPECULAR,
        }
    }
}

/// A filtered part of the radiance.
struct Filtered {
    /// Like [`Signal::color`].
    color: [Padded; 3],
    /// Variance of the luminance before filtering.
    noise_before: Padded,
}

/// Input products.
struct Input<'a> {
    radiance: &'a Plane<[f32; 3]>,
    /// The parts of the radiance, by [`Part`].
    parts: [&'a Plane<[f32; 3]>; 2],
    /// Variance of each part's luminance.
    variances: [&'a Plane<f32>; 2],
    albedo: &'a Plane<[f32; 3]>,
    normal: &'a Plane<[f32; 3]>,
    depth: &'a Plane<f32>,
    instance: &'a Plane<InstanceId>,
}

impl Input<'_> {
    fn size(&self) -> Size {
        Size { width: self.radiance.width() as usize, height: self.radiance.height() as usize }
    }

    /// Whether a pixel shows only surfaces, and its light is finite. Other pixels pass unchanged, and taps ignore them:
    /// lights, the sky, broken pixels, and pixels that show a surface only in part. Such a partial pixel mixes color
    /// and light of the surface and of its surroundings ([`WHOLE`]), and the share of each is as uncertain as the
    /// pixel's own light.
    fn surface(&self, pixel: usize) -> bool {
        let lit = self.radiance.data()[pixel].iter().all(|nits| nits.is_finite());
        lit && self.meets_surface(pixel) && (self.is_covered(pixel) || !self.is_beside_nothing(pixel))
    }

    /// Whether the ray through the center meets a surface.
    fn meets_surface(&self, pixel: usize) -> bool {
        let depth = self.depth.data()[pixel];
        self.instance.data()[pixel].0 != 0 && depth.is_finite() && depth > NEAREST
    }

    /// Whether all rays through a pixel meet surfaces with nearly the same orientation.
    fn is_covered(&self, pixel: usize) -> bool {
        self.normal.data()[pixel].iter().map(|n| n * n).sum::<f32>() >= WHOLE * WHOLE
    }

    /// Whether one of the eight neighbors has no surface.
    fn is_beside_nothing(&self, pixel: usize) -> bool {
        let Size { width, height } = self.size();
        let (x, y) = (pixel % width, pixel / width);
        let mut rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.any(|y| (x.saturating_sub(1)..(x + 2).min(width)).any(|x| !self.meets_surface(y * width + x)))
    }

    /// Divisor of the diffuse part.
    fn factor(&self, pixel: usize) -> [f32; 3] {
        self.albedo.data()[pixel]
            .map(|albedo| DEMODULATION_EPSILON + if albedo.is_finite() { albedo.clamp(0.0, 1.0) } else { 1.0 })
    }

    /// A pixel's light of a part. At the `border` of bodies, color and light change together. Light at a border is
    /// divided by the mean color, not sample by sample, so that neighbors with similar shares of each body are similar,
    /// too.
    fn light(&self, pixel: usize, part: Part, border: bool) -> [f32; 3] {
        let specular = self.parts[Part::Specular as usize].data()[pixel];
        let light = match part {
            Part::Specular => specular,
            Part::Diffuse if border => {
                let (all, factor) = (self.radiance.data()[pixel], self.factor(pixel));
                std::array::from_fn(|c| (all[c] - specular[c]) / factor[c])
            }
            Part::Diffuse => self.parts[Part::Diffuse as usize].data()[pixel],
        };
        light.map(|nits| if nits.is_finite() { nits.clamp(0.0, MOST_NITS) } else { 0.0 })
    }

    /// A part of the radiance.
    fn signal(&self, size: Size, part: Part, guides: &Guides, workers: &dyn Workers) -> Signal {
        let mut signal = Signal::new(size);
        let Signal { color: [r, g, b], luminance: l, variance: v } = &mut signal;
        fill(size, workers, [r, g, b, l, v], |ChunkPosition { x, y, at }| {
            let mut out = [[0.0; CHUNK]; 5];
            for i in 0..CHUNK.min(size.width - x) {
                let pixel = y * size.width + x + i;
                if !self.surface(pixel) {
                    continue;
                }
                let light = self.light(pixel, part, guides.border.at(at + i) > 0.0);
                let bright = luminance(light);
                let variance = self.variances[part as usize].data()[pixel];
                let variance = if variance.is_finite() && variance >= 0.0 { variance } else { bright * bright };
                let pixel = [light[0], light[1], light[2], bright, variance.min(MOST_NITS * MOST_NITS)];
                out.iter_mut().zip(pixel).for_each(|(chunk, number)| chunk[i] = number);
            }
            out
        });
        signal
    }

    /// The guides.
    fn surfaces(&self, size: Size, workers: &dyn Workers) -> Guides {
        let zero = || Padded::new(size, 0.0);
        let (mut normal, mut color, mut disparity) = ([zero(), zero(), zero()], zero(), zero());
        let mut id = Padded::new(size, NOTHING);
        let [nx, ny, nz] = &mut normal;
        fill(size, workers, [nx, ny, nz, &mut color, &mut disparity, &mut id], |ChunkPosition { x, y, .. }| {
            let mut out = [[0.0; CHUNK]; 6];
            out[5] = [NOTHING; CHUNK];
            for i in 0..CHUNK.min(size.width - x) {
                let pixel = y * size.width + x + i;
                if !self.surface(pixel) {
                    out[5][i] = NO_SURFACE;
                    continue;
                }
                let normal = self.normal.data()[pixel].map(|n| if n.is_finite() { n.clamp(-1.0, 1.0) } else { 0.0 });
                let color = luminance(self.factor(pixel));
                let (depth, id) = (self.depth.data()[pixel], self.instance.data()[pixel]);
                let pixel = [normal[0], normal[1], normal[2], color, 1.0 / depth, f32::from(id.0)];
                out.iter_mut().zip(pixel).for_each(|(chunk, number)| chunk[i] = number);
            }
            out
        });
        Guides::new(size, workers, normal, color, disparity, id)
    }

    /// Joins the filtered parts.
    fn join(&self, size: Size, guides: &Guides, [diffuse, specular]: &[Filtered; 2]) -> Plane<[f32; 3]> {
        let mut joined = Plane::from_fn(self.radiance.width(), self.radiance.height(), |x, y| {
            let (x, y) = (x as usize, y as usize);
            let pixel = y * size.width + x;
            if !self.surface(pixel) {
                return self.radiance.data()[pixel];
            }
            let (at, factor) = (size.index(x, y), self.factor(pixel));
            // If light and color both vary within a pixel, the mean of their product is not the product of their means.
            // The difference is as reliable as the pixel's own light.
            let (own, scale) = (self.radiance.data()[pixel], luminance(factor));
            let noise = diffuse.noise_before.at(at) * scale * scale + specular.noise_before.at(at);
            let error = (RESIDUAL * luminance(own).min(MOST_NITS)).powi(2);
            let trust = (error / (error + noise + 1e-30)).powi(2);
            let border = guides.border.at(at) > 0.0;
            let [demodulated, mirrored] =
                [self.light(pixel, Part::Diffuse, border), self.light(pixel, Part::Specular, border)];
            std::array::from_fn(|c| {
                let product = demodulated[c] * factor[c] + mirrored[c];
                let filtered = diffuse.color[c].at(at) * factor[c] + specular.color[c].at(at);
                // The difference is reduced by the same factor as a clamped firefly.
                let kept = if filtered < product { filtered / product } else { 1.0 };
                let residual = kept * trust * (own[c] - product);
                (filtered + if residual.is_finite() { residual } else { 0.0 }).max(0.0)
            })
        });
        balance::restore(size.width, self.radiance.data(), joined.data_mut(), |pixel| self.surface(pixel));
        joined
    }
}
