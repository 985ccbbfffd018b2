//! Transmission of light through a surface: a rough dielectric interface (Walter et al., EGSR 2007) or a thin sheet.
//!
//! A path carries radiance over the squared index of its medium. Refraction leaves this quantity unchanged, so
//! interfaces need no factor.
//!
//! Smith's model loses light that leaves a facet and meets another: a third of white light that crosses a body of
//! roughness 0.6. Here, that light keeps its direction after the first facet, or its mirror image if that direction
//! points to the wrong side, so no energy is lost. In return, the lobe is not reciprocal by that fraction. Light
//! arrives through transmission only from sampled directions, so it needs no density.

use super::ggx;
use syntable_simd::functions::sin_cos_turns;
use syntable_simd::{Real, at_least, complement, inverse};
use syntable_simd::{Rgb, Vec3, vec3};

/// An interface at a point for one outgoing direction, with z > 0 on its side.
#[derive(Clone, Copy, Debug)]
pub struct Transmission<T: Real = f32> {
    wo: Vec3<T>,
    alpha: T,
    /// Index of refraction on the far side over the index on this side.
    eta: T,
    /// Whether the surface is a thin sheet, which transmits light without refraction.
    thin_walled: T::Mask,
    /// Factor of transmitted light.
    tint: Rgb<T>,
}

/// A sampled direction, on either side.
#[derive(Clone, Copy, Debug)]
pub struct TransmissionSample<T: Real> {
    /// Whether the sample is valid.
    pub valid: T::Mask,
    /// Incoming direction, local.
    pub wi: Vec3<T>,
    /// BSDF times cosine over density.
    pub weight: Rgb<T>,
    /// Whether the sample is a reflection that could also have been a transmission: not a total reflection.
    pub reflected: T::Mask,
}

impl<T: Real> Transmission<T> {
    /// `wo` is unit length with z > 0.
    #[inline(always)]
    pub fn new(wo: Vec3<T>, roughness: T, eta: T, thin_walled: T::Mask, tint: Rgb<T>) -> Self {
        Self { wo, alpha: at_least(roughness * roughness, ggx::MIN_ALPHA), eta, thin_walled, tint }
    }

    /// Samples a microfacet from the visible normals; `random` then selects reflection or transmission by the Fresnel
    /// reflectance. If both are possible, each has at least the probability `least`, up to one half.
    #[inline(always)]
    pub fn sample(&self, [u, v]: [T; 2], random: T, least: T) -> TransmissionSample<T> {
        let one = T::splat(1.0);
        let wo = self.wo;
        let standard = vec3(wo.x * self.alpha, wo.y * self.alpha, wo.z).normalized();
        // Spherical caps (Dupuy and Benyoub, HPG 2023).
        let z = complement(v) * (standard.z + 1.0_f32) - standard.z;
        let r = at_least(complement(z * z), 0.0).sqrt();
        let (sin, cos) = sin_cos_turns(u);
        let h = vec3(r * cos + standard.x, r * sin + standard.y, z + standard.z);
        let h = vec3(h.x * self.alpha, h.y * self.alpha, at_least(h.z, 1e-6));
        let h = h * inverse(at_least(h.dot(h), 1e-30).sqrt());

        let cos_o = at_least(wo.dot(h), 1e-6);
        let (fresnel, cos_t) = dielectric(cos_o, self.eta);
        let fresnel = T::select(self.thin_walled, of_two_faces(fresnel), fresnel);
        let total = fresnel.ge(one);
        let probability = fresnel.larger(least).smaller(complement(least));
        let probability = T::select(total, one, probability);
        let reflects = random.lt(probability);
        let mirrored = h * (cos_o * 2.0_f32) - wo;
        let per_eta = inverse(self.eta);
        let refracted = h * (cos_o * per_eta - cos_t) - wo * per_eta;
        let straight = vec3(mirrored.x, mirrored.y, -mirrored.z);
        let transmitted = Vec3::select(self.thin_walled, straight, refracted);
        let wi = Vec3::select(reflects, mirrored, transmitted);

        let up = wi.z.abs();
        let wi = vec3(wi.x, wi.y, T::select(reflects, up, -up));
        let passage = complement(fresnel) * inverse(at_least(complement(probability), 1e-6));
        let weight = Vec3::select(reflects, Rgb::all(fresnel * inverse(probability)), self.tint * passage);
        let reflected = reflects & !total;
        TransmissionSample { valid: up.gt(T::splat(1e-6)), wi, weight, reflected }
    }
}

/// Reflectance of a thin sheet with all reflections between its two faces: F + (1 − F)² F / (1 − F²).
#[inline(always)]
pub fn of_two_faces<T: Real>(fresnel: T) -> T {
    fresnel * 2.0_f32 / (fresnel + 1.0_f32)
}

/// Fraction of the light that enters a pane and leaves it on the other side, from the cosine of its direction.
#[inline(always)]
pub fn pane_transmittance(cosine: f32, ior: f32) -> f32 {
    1.0 - of_two_faces(dielectric(cosine, ior).0)
}

/// Fresnel's reflectance of unpolarized light at a dielectric, and the cosine on the far side; 1 and 0 for total
/// reflection.
#[inline(always)]
pub fn dielectric<T: Real>(cos_i: T, eta: T) -> (T, T) {
    let per_eta = inverse(eta);
    let sin2_t = complement(cos_i * cos_i) * per_eta * per_eta;
    let total = sin2_t.ge(T::splat(1.0));
    let cos_t = at_least(complement(sin2_t), 0.0).sqrt();
    let parallel = (eta * cos_i - cos_t) / at_least(eta * cos_i + cos_t, 1e-12);
    let perpendicular = (cos_i - eta * cos_t) / at_least(cos_i + eta * cos_t, 1e-12);
    let reflectance = (parallel * parallel + perpendicular * perpendicular) * 0.5_f32;
    (T::select(total, T::splat(1.0), reflectance), T::select(total, T::splat(0.0), cos_t))
}
