//! `guided`: a filter of its own that looks at albedo, normals, depth and ids.
//!
//! The picture is divided by the surfaces' colour, so that textures stay sharp whatever happens to the light on them
//! ([`Signal`]). Every pixel's noise is estimated and specks are cut ([`noise`]). Then come levels of 5 × 5 taps at
//! distances of 1, 2, 4, 8, … px ([`smooth`]): the edge-avoiding à-trous transform of Dammertz et al. (High Performance
//! Graphics 2010), led by variance as Schied et al. have it (High Performance Graphics 2017, section 4.2 and 4.3). A tap is
//! worth less the more its normal differs, the farther it is from the pixel's plane and the less likely its light is the
//! same within the noise that is left; so a quiet picture stays as it is.
//!
//! Of its own are: planes found from depth without knowing the camera ([`guides`]), normals that count for less the
//! noisier the light is, borders of bodies that go by mean colours and normals, and a first level that compares means
//! rather than samples.

mod guides;
mod noise;
mod planes;
mod smooth;

use guides::{Guides, NOTHING};
use planes::{CHUNK, Padded, Size, Spot, fill};
use smooth::Level;
use syntable_model::context::Workers;
use syntable_model::prelude::*;
use syntable_model::product::standard::{ALBEDO_MEAN, DEPTH, INSTANCE, NORMAL_MEAN, RADIANCE, RADIANCE_VARIANCE};

/// What is added to the colour before the light is divided by it: about what a dielectric mirrors, which has no colour.
const MIRRORED: f32 = 0.04;

/// The largest light that is reckoned with, nits, so that its square is a number.
const MOST: f32 = 1e12;

/// How unlike a tap's light may be at each level, in standard deviations, for a strength of 1.
const SIGMAS: [f32; 5] = [6.0, 2.5, 2.0, 2.0, 2.0];

/// The same for the means that the first level compares.
const PILOT_SIGMAS: f32 = 2.5;

/// Takes the noise out of pictures of few samples by averaging over likely neighbours, guided by colour, normals, depth
/// and ids. Fast, on the processor, the same everywhere; nothing needs to be installed. With more samples it does less.
///
/// It is meant for 1 to 64 samples a pixel. Bright specks are cut, which takes one to three hundredths of the light away
/// at one or two samples and nearly none from 16 on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Guided {
    /// How unlike the light of two pixels may be, relative to their noise, to be averaged. More is smoother, less keeps
    /// faint shadows and mirror images.
    #[schemars(range(min = 0.1, max = 10.0))]
    pub strength: f64,
    /// How far averages reach: 2, 6, 14, 30 or 62 pixels.
    #[schemars(range(min = 1, max = 5))]
    pub levels: u32,
}

impl Default for Guided {
    fn default() -> Self {
        Self { strength: 1.0, levels: 4 }
    }
}

impl Config for Guided {
    type Stage = dyn Denoiser;
    const KIND: &'static str = "guided";
    const EXAMPLE: &'static str = "strength = 1.0\nlevels = 4";
    fn build(self) -> Result<Box<dyn Denoiser>, Invalid> {
        if !(0.1..=10.0).contains(&self.strength) {
            return Err(Invalid::new("strength", format!("`strength = {}` is not from 0.1 to 10", self.strength)));
        }
        if !(1..=SIGMAS.len() as u32).contains(&self.levels) {
            return Err(Invalid::new("levels", format!("`levels = {}` is not from 1 to 5", self.levels)));
        }
        Ok(Box::new(self))
    }
}

impl Denoiser for Guided {
    fn guides(&self) -> Vec<KeyId> {
        keys![ALBEDO_MEAN, NORMAL_MEAN, DEPTH, INSTANCE, RADIANCE_VARIANCE]
    }

    fn denoise(&self, rendered: &Frame, workers: &dyn Workers) -> Result<Denoised> {
        let input = Input {
            radiance: rendered.get(RADIANCE)?,
            variance: rendered.get(RADIANCE_VARIANCE)?,
            albedo: rendered.get(ALBEDO_MEAN)?,
            normal: rendered.get(NORMAL_MEAN)?,
            depth: rendered.get(DEPTH)?,
            instance: rendered.get(INSTANCE)?,
        };
        let size = input.size();
        let known = input.variance.data().iter().any(|v| v.is_finite());
        let (signal, guides) = input.split(size, workers);
        let noise = noise::estimate(size, workers, &guides, &signal, known);
        let (mut now, mut next) = (noise.signal, signal);
        for level in 0..self.levels {
            let pilot = (level == 0).then_some(&noise.pilot);
            let sigmas = SIGMAS[level as usize] * self.strength as f32;
            let pilot_sigmas = PILOT_SIGMAS * self.strength as f32;
            let level = Level { guides: &guides, from: &now, pilot, step: 1 << level, sigmas, pilot_sigmas };
            smooth::smooth(size, workers, &level, &mut next);
            std::mem::swap(&mut now, &mut next);
        }
        let report = Value::record([
            ("name", Self::KIND.into()),
            ("strength", self.strength.into()),
            ("levels", self.levels.into()),
        ]);
        Ok(Denoised { radiance: input.join(size, &now), report })
    }
}

/// Light without the colour of what it falls on, and what is known of its noise.
struct Signal {
    /// Linear Rec. 709, nits.
    color: [Padded; 3],
    /// Its luminance.
    luminance: Padded,
    /// Variance of the luminance.
    variance: Padded,
}

impl Signal {
    fn new(size: Size) -> Self {
        let zero = || Padded::new(size, 0.0);
        Self { color: [zero(), zero(), zero()], luminance: zero(), variance: zero() }
    }
}

/// The products of a frame.
struct Input<'a> {
    radiance: &'a Plane<[f32; 3]>,
    variance: &'a Plane<f32>,
    albedo: &'a Plane<[f32; 3]>,
    normal: &'a Plane<[f32; 3]>,
    depth: &'a Plane<f32>,
    instance: &'a Plane<InstanceId>,
}

impl Input<'_> {
    fn size(&self) -> Size {
        Size { width: self.radiance.width() as usize, height: self.radiance.height() as usize }
    }

    /// Whether there is a surface and sound light at a pixel. Lamps, the sky and broken pixels pass as they are, and
    /// nothing is taken from them.
    fn surface(&self, pixel: usize) -> bool {
        let depth = self.depth.data()[pixel];
        let lit = self.radiance.data()[pixel].iter().all(|nits| nits.is_finite());
        lit && self.instance.data()[pixel].0 != 0 && depth.is_finite() && depth > 1e-6
    }

    /// What the light is divided by.
    fn factor(&self, pixel: usize) -> [f32; 3] {
        self.albedo.data()[pixel].map(|share| MIRRORED + if share.is_finite() { share.clamp(0.0, 1.0) } else { 1.0 })
    }

    fn split(&self, size: Size, workers: &dyn Workers) -> (Signal, Guides) {
        let mut signal = Signal::new(size);
        let zero = || Padded::new(size, 0.0);
        let (mut normal, mut color, mut disparity) = ([zero(), zero(), zero()], zero(), zero());
        let mut id = Padded::new(size, NOTHING);
        let Signal { color: [r, g, b], luminance: l, variance: v } = &mut signal;
        let [nx, ny, nz] = &mut normal;
        fill(
            size,
            workers,
            [r, g, b, l, v, nx, ny, nz, &mut color, &mut disparity, &mut id],
            |Spot { x, y, .. }| {
                let mut out = [[0.0; CHUNK]; 11];
                out[10] = [NOTHING; CHUNK];
                for i in 0..CHUNK.min(size.width - x) {
                    let pixel = y * size.width + x + i;
                    if !self.surface(pixel) {
                        continue;
                    }
                    let (factor, radiance) = (self.factor(pixel), self.radiance.data()[pixel]);
                    let light: [f32; 3] = std::array::from_fn(|c| (radiance[c] / factor[c]).clamp(0.0, MOST));
                    let (bright, scale) = (luminance(light), luminance(factor));
                    let variance = self.variance.data()[pixel] / (scale * scale);
                    let variance = if variance.is_finite() && variance >= 0.0 { variance } else { bright * bright };
                    let normal =
                        self.normal.data()[pixel].map(|n| if n.is_finite() { n.clamp(-1.0, 1.0) } else { 0.0 });
                    let pixel = [
                        light[0],
                        light[1],
                        light[2],
                        bright,
                        variance.min(MOST * MOST),
                        normal[0],
                        normal[1],
                        normal[2],
                        luminance(factor),
                        1.0 / self.depth.data()[pixel],
                        f32::from(self.instance.data()[pixel].0),
                    ];
                    out.iter_mut().zip(pixel).for_each(|(chunk, number)| chunk[i] = number);
                }
                out
            },
        );
        (signal, Guides::new(size, workers, normal, color, disparity, id))
    }

    /// The picture of a filtered signal.
    fn join(&self, size: Size, signal: &Signal) -> Plane<[f32; 3]> {
        Plane::from_fn(self.radiance.width(), self.radiance.height(), |x, y| {
            let (x, y) = (x as usize, y as usize);
            let pixel = y * size.width + x;
            if !self.surface(pixel) {
                return self.radiance.data()[pixel];
            }
            let (at, factor) = (size.index(x, y), self.factor(pixel));
            std::array::from_fn(|c| signal.color[c].at(at) * factor[c])
        })
    }
}

/// Relative luminance of linear Rec. 709.
#[inline(always)]
fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Whether eight numbers can be taken at a time. The result is the same either way: every operation is an IEEE operation
/// of one number.
fn wide() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    false
}

register!(Guided);
