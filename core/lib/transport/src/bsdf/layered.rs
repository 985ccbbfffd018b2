//! Layered surfaces: a path scatters from one layer.

use super::{Bsdf, BsdfParameters, BsdfSample, CoatingAttenuation, CoatingParameters, Sheen, Transmission, table};
use syntable_simd::{Mask, Real, inverse};
use syntable_simd::{Rgb, Vec3};

/// Scattering of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lobe {
    /// Metallic-roughness.
    Base = 0,
    /// Sheen fibers.
    Sheen = 1,
    /// A thin sheet that light transmitted.
    ThinWalled = 2,
    /// The interface of a filled body.
    Refraction = 3,
}

/// Sampled layer of each lane, with its parameters.
pub struct LayerInputs<T> {
    /// Number of the [`Lobe`].
    pub lobe: T,
    /// Layers above it.
    pub coating: CoatingParameters<T>,
    /// Index of refraction on the far side over the index on this side.
    pub eta: T,
}

/// Scattering by the selected layers, for one outgoing direction each.
pub struct Layered<T: Real = f32> {
    coating: CoatingAttenuation<T>,
    sheen: Sheen<T>,
    transmission: Transmission<T>,
    color: Rgb<T>,
    is_sheen: T::Mask,
    is_transmission: T::Mask,
}

impl<T: Real> Layered<T> {
    /// `wo` is unit length with z > 0.
    #[inline(always)]
    pub fn new(inputs: &LayerInputs<T>, parameters: &BsdfParameters<T>, wo: Vec3<T>) -> Self {
        let is = |lobe: Lobe| {
            let number = lobe as u32 as f32;
            inputs.lobe.gt(T::splat(number - 0.5)) & inputs.lobe.lt(T::splat(number + 0.5))
        };
        let thin_walled = is(Lobe::ThinWalled);
        // Light that crosses a body with an interior medium is tinted twice.
        let tint = Vec3::select(thin_walled, parameters.base_color, parameters.base_color.map(|c| c.sqrt()));
        Self {
            coating: CoatingAttenuation::new(inputs.coating, wo.z, table()),
            sheen: Sheen::new(parameters.roughness, wo),
            transmission: Transmission::new(wo, parameters.roughness, inputs.eta, thin_walled, tint),
            color: parameters.base_color,
            is_sheen: is(Lobe::Sheen),
            is_transmission: thin_walled | is(Lobe::Refraction),
        }
    }

    /// BSDF times cosine of the sampled layer, and its density. Transmission has no density: only BSDF sampling finds
    /// lights through it.
    #[inline(always)]
    pub fn evaluate(&self, bsdf: &Bsdf<T>, wi: Vec3<T>) -> (Rgb<T>, T) {
        let ([glossy, matte], pdf) = self.lobes(bsdf, wi);
        (glossy + matte, pdf)
    }

    /// Like [`evaluate`](Self::evaluate), with glossy and diffuse parts separate. Sheen is diffuse.
    #[inline(always)]
    pub fn lobes(&self, bsdf: &Bsdf<T>, wi: Vec3<T>) -> ([Rgb<T>; 2], T) {
        let ([glossy, matte], mut pdf) = bsdf.lobes(wi);
        let [glossy_left, matte_left] = self.coating.factors(wi.z);
        let (mut glossy, mut matte) = (glossy * glossy_left, matte * matte_left);
        let black = Vec3::all(T::splat(0.0));
        if self.is_sheen.any() {
            let (sheen, density) = self.sheen.evaluate(wi);
            // Clearcoat over sheen. The sheen lobe does not attenuate itself.
            matte = Vec3::select(self.is_sheen, self.color * (sheen * glossy_left), matte);
            glossy = Vec3::select(self.is_sheen, black, glossy);
            pdf = T::select(self.is_sheen, density, pdf);
        }
        ([glossy, matte].map(|lobe| Vec3::select(self.is_transmission, black, lobe)), pdf)
    }

    /// Samples a direction; for `random` and `least`, see [`Transmission::sample`].
    #[inline(always)]
    pub fn sample(&self, bsdf: &Bsdf<T>, uv: [T; 2], random: T, least: T) -> BsdfSample<T> {
        let (mut wi, mut specular) = bsdf.direction(uv);
        if self.is_sheen.any() {
            wi = Vec3::select(self.is_sheen, Sheen::sample(uv), wi);
            specular = specular & !self.is_sheen;
        }
        let (value, pdf) = self.evaluate(bsdf, wi);
        let mut scattered = BsdfSample {
            valid: wi.z.gt(T::splat(1e-6)) & pdf.gt(T::splat(0.0)) & pdf.lt(T::splat(f32::INFINITY)),
            wi,
            weight: value * inverse(pdf),
            pdf,
            specular,
            transmitted: T::Mask::splat(false),
            reflected: T::Mask::splat(false),
        };
        if self.is_transmission.any() {
            let transmitted = self.transmission.sample(uv, random, least);
            let mine = self.is_transmission;
            scattered = BsdfSample {
                valid: mine & transmitted.valid | !mine & scattered.valid,
                wi: Vec3::select(mine, transmitted.wi, wi),
                weight: Vec3::select(mine, transmitted.weight, scattered.weight),
                // Only this sampling finds lights behind the surface.
                pdf: T::select(mine, T::splat(f32::INFINITY), pdf),
                specular: specular | mine,
                transmitted: mine & transmitted.wi.z.lt(T::splat(0.0)),
                reflected: mine & transmitted.reflected,
            };
        }
        scattered
    }
}
